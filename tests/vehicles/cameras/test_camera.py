"""The on-board camera."""

from __future__ import annotations

import gc
import os
import weakref

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
def test_cameras_render_their_models_in_turn() -> None:
    """The image shows the geom ahead of the camera, in a new array; models may change."""
    cameras = [OnboardCamera((32, 16), "eye"), OnboardCamera((16, 16), "eye")]
    for colours, brightest in ((("1 0 0", "0 0 1"), (0, 2)), (("0 1 0", "1 0 0"), (1, 0))):
        models = [_model(colour) for colour in colours]
        for _ in range(2):
            pictures = [camera.picture(*one) for camera, one in zip(cameras, models, strict=True)]
            assert [picture.shape for picture in pictures] == [(16, 32, 3), (16, 16, 3)]
            assert [picture[8, 8].argmax() for picture in pictures] == list(brightest)
        assert not np.may_share_memory(pictures[0], cameras[0].picture(*models[0]))
    for camera in cameras:
        camera.close()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_an_unclosed_camera_frees_its_context() -> None:
    """Garbage collection frees it, and `close` can be called twice and before an image."""
    model, data = _model("1 0 0")
    dropped: list[weakref.ref[OnboardCamera]] = []
    for _ in range(3):
        camera = OnboardCamera((32, 16), "eye")
        camera.picture(model, data)
        dropped.append(weakref.ref(camera))
    del camera
    gc.collect()
    assert [reference() for reference in dropped] == [None] * 3
    camera = OnboardCamera((32, 16), "eye")
    camera.close()
    camera.close()


def test_rendering_after_a_fork_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process forked after rendering raises an error instead of a deadlock."""
    monkeypatch.setattr(module, "_drawing", {os.getpid() + 1})
    camera = OnboardCamera((32, 16), "eye")
    model, data = _model("1 0 0")
    with pytest.raises(RenderError, match="forked after rendering"):
        camera.picture(model, data)
