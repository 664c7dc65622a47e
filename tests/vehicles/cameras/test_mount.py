"""Errors of the camera's pose."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from shapechanger.errors import WorldError
from shapechanger.vehicles.bodies.parts import CameraJitter, move_camera

# Looks along x, with z up, as the cameras of vehicles.
_MODEL = """
<mujoco><worldbody><body><geom size="0.1"/>
<camera name="eye" pos="0.05 0 0.12" xyaxes="0 -1 0 0 0 1"/>
</body></worldbody></mujoco>
"""


def _moved(jitter: CameraJitter) -> mujoco.MjModel:
    model = mujoco.MjModel.from_xml_string(_MODEL)
    move_camera(model, "eye", jitter)
    return model


def _axes(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the axes of the camera as columns: right, up and backward."""
    axes = np.empty(9)
    mujoco.mju_quat2Mat(axes, model.camera("eye").quat)
    return axes.reshape(3, 3)


def test_offsets_are_up_and_left() -> None:
    assert _moved(CameraJitter()).camera("eye").pos == pytest.approx([0.05, 0.0, 0.12])
    np.testing.assert_allclose(_axes(_moved(CameraJitter()))[:, 2], [-1, 0, 0], atol=1e-9)
    place = _moved(CameraJitter(up_m=0.01, left_m=0.02)).camera("eye").pos
    assert place == pytest.approx([0.05, 0.02, 0.13])


def test_directions_of_the_angles() -> None:
    """Pitch turns down, yaw to the left, and roll clockwise."""
    few = 0.05
    ahead_down = -_axes(_moved(CameraJitter(pitch_rad=few)))[:, 2]
    np.testing.assert_allclose(ahead_down, [math.cos(few), 0.0, -math.sin(few)], atol=1e-9)
    ahead_left = -_axes(_moved(CameraJitter(yaw_rad=few)))[:, 2]
    np.testing.assert_allclose(ahead_left, [math.cos(few), math.sin(few), 0.0], atol=1e-9)
    up_right = _axes(_moved(CameraJitter(roll_rad=few)))[:, 1]
    np.testing.assert_allclose(up_right, [0.0, -math.sin(few), math.cos(few)], atol=1e-9)


def test_random_errors_are_within_their_ranges() -> None:
    drawn = [CameraJitter.random(np.random.default_rng(seed)) for seed in range(200)]
    for name, most in {
        "up_m": 0.015,
        "left_m": 0.01,
        "roll_rad": math.radians(3.0),
        "pitch_rad": math.radians(3.0),
        "yaw_rad": math.radians(3.0),
    }.items():
        values = np.array([getattr(jitter, name) for jitter in drawn])
        assert -most <= values.min() < -0.8 * most
        assert 0.8 * most < values.max() <= most
    assert drawn[7] == CameraJitter.random(np.random.default_rng(7))


_ERRORS = st.one_of(st.floats(-2.0, 2.0), st.floats())


@given(jitter=st.builds(CameraJitter, _ERRORS, _ERRORS, _ERRORS, _ERRORS, _ERRORS))
def test_a_refused_error_changes_nothing(jitter: CameraJitter) -> None:
    """An error is added completely, or not at all."""
    model = mujoco.MjModel.from_xml_string(_MODEL)
    before = model.cam_pos.copy(), model.cam_quat.copy()
    try:
        move_camera(model, "eye", jitter)
    except WorldError:
        np.testing.assert_array_equal(model.cam_pos, before[0])
        np.testing.assert_array_equal(model.cam_quat, before[1])
    else:
        np.testing.assert_allclose(model.cam_pos, before[0] + [0.0, jitter.left_m, jitter.up_m])
        assert np.isfinite(model.cam_quat).all()


@pytest.mark.parametrize("name", ["up_m", "left_m", "roll_rad"])
@pytest.mark.parametrize("value", [-1.5, math.nan])
def test_a_camera_stays_on_its_vehicle(name: str, value: float) -> None:
    if name != "roll_rad" or math.isnan(value):
        with pytest.raises(WorldError, match="would be off its vehicle or in the floor"):
            _moved(CameraJitter(**{name: value}))
