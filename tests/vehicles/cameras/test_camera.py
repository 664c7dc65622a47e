"""The on-board camera."""

from __future__ import annotations

import gc
import os

import mujoco
import numpy as np
import pytest

from shapechanger.errors import RenderError
from shapechanger.vehicles.cameras import camera as module
from shapechanger.vehicles.cameras.camera import OnboardCamera

_MODEL = """
<mujoco><asset><material name="m" emission="1" rgba="{colour} 1"/></asset><worldbody>
<geom type="box" size="0.1 5 5" pos="2 0 0" material="m"/>
<body><geom size="0.01"/><camera name="eye" xyaxes="0 -1 0 0 0 1"/></body>
</worldbody></mujoco>
"""


def _model(colour: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(_MODEL.format(colour=colour))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_it_renders_the_selected_model() -> None:
    """The image shows the geom ahead of the camera."""
    camera = OnboardCamera((32, 16), "eye")
    for colour, brightest in (("1 0 0", 0), ("0 1 0", 1)):
        model, data = _model(colour)
        picture = camera.picture(model, data)
        assert picture.shape == (16, 32, 3)
        assert int(picture[8, 16].argmax()) == brightest
    camera.close()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_images_share_no_memory() -> None:
    """Each picture is a new array."""
    camera = OnboardCamera((32, 16), "eye")
    model, data = _model("1 0 0")
    first, second = camera.picture(model, data), camera.picture(model, data)
    np.testing.assert_array_equal(first, second)
    assert not np.may_share_memory(first, second)
    camera.close()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_two_cameras_render_in_turn() -> None:
    """Contexts do not disturb each other."""
    cameras = [OnboardCamera((32, 16), "eye"), OnboardCamera((16, 16), "eye")]
    models = [_model("1 0 0"), _model("0 0 1")]
    for _ in range(2):
        for camera, (model, data), brightest in zip(cameras, models, (0, 2), strict=True):
            assert int(camera.picture(model, data)[8, 8].argmax()) == brightest
    for camera in cameras:
        camera.close()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_an_unclosed_camera_frees_its_context() -> None:
    """Garbage collection frees it, and `close` can be called twice and before a picture."""
    model, data = _model("1 0 0")
    for _ in range(3):
        camera = OnboardCamera((32, 16), "eye")
        camera.picture(model, data)
    del camera
    gc.collect()
    camera = OnboardCamera((32, 16), "eye")
    camera.close()
    camera.close()


@pytest.mark.parametrize("size", [(0, 16), (16, 0), (-1, -1)])
def test_invalid_sizes_are_refused(size: tuple[int, int]) -> None:
    """Sizes below 1 pixel raise an error with the size."""
    with pytest.raises(RenderError, match=f"cannot be {size[0]} x {size[1]} pixels"):
        OnboardCamera(size, "eye")


def test_rendering_after_a_fork_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process forked after rendering raises an error instead of a deadlock."""
    monkeypatch.setattr(module, "_drawing", {os.getpid() + 1})
    camera = OnboardCamera((32, 16), "eye")
    model, data = _model("1 0 0")
    with pytest.raises(RenderError, match="forked after rendering"):
        camera.picture(model, data)
