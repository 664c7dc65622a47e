"""The on-board camera, errors of its pose, and its faults."""

import dataclasses
import gc
import math
import os
import weakref

import mujoco
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from shapechanger.errors import RenderError, UnknownName, WorldError
from shapechanger.vehicles.bodies.parts import CameraJitter, move_camera
from shapechanger.vehicles.cameras import camera as module
from shapechanger.vehicles.cameras.camera import (
    CORRUPTIONS,
    Corruption,
    OnboardCamera,
    Picture,
    blur,
    find_corruption,
    night,
)

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
    """Images are new arrays that show the geom ahead, also after a change of the model."""
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
def test_an_unclosed_camera_is_garbage_collected() -> None:
    """Its context keeps no camera alive; `close` can be called twice, and before an image."""
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
    monkeypatch.setattr(module, "_drawing", {os.getpid() + 1})
    camera = OnboardCamera((32, 16), "eye")
    model, data = _model("1 0 0")
    with pytest.raises(RenderError, match="forked after rendering"):
        camera.picture(model, data)


# A camera that looks along x, with z up, like the cameras of vehicles.
_MOUNTED = """
<mujoco><worldbody><body><geom size="0.1"/>
<camera name="eye" pos="0.05 0 0.12" xyaxes="0 -1 0 0 0 1"/>
</body></worldbody></mujoco>
"""


def test_jitter_moves_up_and_left_and_turns_down_left_and_clockwise() -> None:
    few, sin, cos = 0.05, math.sin(0.05), math.cos(0.05)
    for jitter, place, ahead, up in (
        (CameraJitter(), (0.05, 0.0, 0.12), (1, 0, 0), (0, 0, 1)),
        (CameraJitter(up_m=0.01, left_m=0.02), (0.05, 0.02, 0.13), (1, 0, 0), (0, 0, 1)),
        (CameraJitter(pitch_rad=few), (0.05, 0.0, 0.12), (cos, 0, -sin), (sin, 0, cos)),
        (CameraJitter(yaw_rad=few), (0.05, 0.0, 0.12), (cos, sin, 0), (0, 0, 1)),
        (CameraJitter(roll_rad=few), (0.05, 0.0, 0.12), (1, 0, 0), (0, -sin, cos)),
    ):
        model = mujoco.MjModel.from_xml_string(_MOUNTED)
        move_camera(model, "eye", jitter)
        assert model.camera("eye").pos == pytest.approx(place)
        axes = np.empty(9)  # Rows of (right, up, backward).
        mujoco.mju_quat2Mat(axes, model.camera("eye").quat)
        np.testing.assert_allclose([-axes[2::3], axes[1::3]], [ahead, up], atol=1e-9)


_ERRORS = st.one_of(st.floats(-2.0, 2.0), st.floats())


@given(jitter=st.builds(CameraJitter, _ERRORS, _ERRORS, _ERRORS, _ERRORS, _ERRORS))
@example(jitter=CameraJitter(up_m=-1.5))
@example(jitter=CameraJitter(left_m=-1.5))
@example(jitter=CameraJitter(roll_rad=math.nan))
def test_a_camera_stays_on_its_vehicle(jitter: CameraJitter) -> None:
    """An error of the pose is added completely, or refused without any change."""
    model = mujoco.MjModel.from_xml_string(_MOUNTED)
    before = model.cam_pos.copy(), model.cam_quat.copy()
    numbers = dataclasses.astuple(jitter)
    try:
        move_camera(model, "eye", jitter)
    except WorldError:
        np.testing.assert_array_equal(model.cam_pos, before[0])
        np.testing.assert_array_equal(model.cam_quat, before[1])
    else:
        assert np.isfinite(numbers).all()
        assert max(abs(jitter.up_m), abs(jitter.left_m)) < 1.5
        np.testing.assert_allclose(model.cam_pos, before[0] + [0.0, jitter.left_m, jitter.up_m])
        assert np.isfinite(model.cam_quat).all()


_ALL = pytest.mark.parametrize("change", CORRUPTIONS.values(), ids=CORRUPTIONS)


def _picture(height: int = 120, width: int = 160) -> Picture:
    rng = np.random.default_rng(0)
    rough = rng.integers(0, 256, (height // 8 + 1, width // 8 + 1, 3), np.uint8)
    return np.kron(rough, np.ones((8, 8, 1), np.uint8))[:height, :width].copy()


@_ALL
@pytest.mark.parametrize("size", [(120, 160), (33, 47), (1, 1), (1, 300), (300, 1), (1080, 1920)])
def test_image_and_seed_determine_a_corruption(change: Corruption, size: tuple[int, int]) -> None:
    """The result has the image's size and type; the image stays the same. Blur ignores the seed."""
    before = _picture(*size)
    kept = before.copy()
    after = change(before, 3)
    assert (after.shape, after.dtype) == (before.shape, np.uint8)
    assert not np.may_share_memory(before, after)
    np.testing.assert_array_equal(before, kept)
    np.testing.assert_array_equal(after, change(before, 3))
    if before.size > 3:  # A blur of one pixel is that pixel.
        assert not np.array_equal(before, after)
    if change is not blur and size == (120, 160):
        assert not np.array_equal(after, change(before, 4))
    assert find_corruption("night") is night
    with pytest.raises(UnknownName, match="Did you mean 'glare'"):
        find_corruption("glair")


def test_night_darkens_an_image_and_adds_noise() -> None:
    """Noise varies between images."""
    white = np.full((120, 160, 3), 255, np.uint8)
    dark = night(white, 0)
    assert dark.mean(axis=(0, 1)) == pytest.approx([117.3, 127.5, 168.3], abs=0.5)
    assert dark.std(axis=(0, 1)) == pytest.approx(9.0, abs=0.3)
    other = white.copy()
    other[0, 0] = 254
    assert not np.array_equal(night(other, 0)[1:], dark[1:])


def test_blur_keeps_the_sum_and_adds_its_variance() -> None:
    point = np.zeros((121, 161, 3), np.uint8)
    point[56:65, 76:85] = 255
    soft = blur(point, 0).astype(float)[..., 0]
    assert soft.sum() == pytest.approx(255 * 81, rel=0.02)
    columns = np.arange(161)
    variance = (soft.sum(axis=0) * (columns - 80) ** 2).sum() / soft.sum()
    assert variance == pytest.approx((81 - 1) / 12 + (0.0125 * 161) ** 2, rel=0.05)
