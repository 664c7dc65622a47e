"""Random postures, torques of motions, and inverse kinematics."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from shapechanger.finger import anatomy
from shapechanger.finger.postures import (
    angles_for,
    coupled,
    draw_posture,
    draw_start,
    inner_range,
    moving_torque,
)
from shapechanger.finger.task import fingertip
from tests.finger.commands import can_hold, made

_LOW, _HIGH = anatomy.JOINT_RANGE.T


@pytest.mark.parametrize("draw", [draw_posture, draw_start])
def test_postures_are_away_from_limits_and_varied(draw: Callable[..., np.ndarray]) -> None:
    """Targets and starts are at least 10 % of the range away from each limit."""
    rng = np.random.default_rng(0)
    inner = 0.1 * (_HIGH - _LOW) - 1e-12
    postures = np.array([draw(rng) for _ in range(100)])
    assert (postures >= _LOW + inner).all()
    assert (postures <= _HIGH - inner).all()
    assert (np.ptp(postures, axis=0) > 0.1).all()


def test_every_posture_of_the_range_can_be_held() -> None:
    """This includes the corners of the range, so drawn postures need no check."""
    low, high = inner_range()
    shares = np.stack(np.meshgrid(*[[0.0, 0.5, 1.0]] * 4), axis=-1).reshape(-1, 4)
    for share in shares:
        free = low[:3] + share[:3] * (high - low)[:3]
        off = anatomy.DIP_BAND * (2.0 * share[3] - 1.0)
        assert can_hold(np.array(coupled(free[0], free[1], free[2], off)).clip(low, high))


def test_moving_torque_gives_the_acceleration() -> None:
    """The computed torques give the requested accelerations in the simulator."""
    model = made()
    model.dof_frictionloss[:] = 0.0
    rng = np.random.default_rng(0)
    for _ in range(20):
        angles = draw_posture(rng)
        speed, acceleration = rng.uniform(-2.0, 2.0, 4), rng.uniform(-50.0, 50.0, 4)
        friction = np.array([1.0, 1.0, 0.7, 0.4]) * 1e-3 * np.tanh(speed / 0.1)
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = angles, speed
        data.act[:] = -1.0
        least = anatomy.MOMENT_ARMS.T @ np.full(7, anatomy.LEAST_TENSION_N)
        asked = moving_torque(angles, speed, acceleration)
        data.qfrc_applied[:] = asked - friction - least
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qacc, acceleration, atol=1e-6)


def _is_within(angles: np.ndarray) -> bool:
    return bool(((angles >= _LOW) & (angles <= _HIGH)).all())


def test_the_fingertip_of_any_posture_is_reached() -> None:
    """A quarter of the postures are at the joint limits."""
    rng = np.random.default_rng(1)
    postures = rng.uniform(_LOW, _HIGH, (80, 4))
    postures[::4] = np.where(rng.random((20, 4)) < 0.5, _LOW, _HIGH)
    for posture in postures:
        angles, off = angles_for(fingertip(posture))
        assert _is_within(angles)
        assert off < 1e-5


@pytest.mark.parametrize(
    ("place", "least_mm"),
    [
        ((sum(anatomy.PHALANX_LENGTH_M) + 0.001, 0.0, 0.0), 1.0),
        ((0.5, 0.0, 0.0), 408.4),
        ((0.05, 0.08, 0.0), 5.0),
        ((-0.08, 0.0, 0.0), 5.0),
        ((0.0, 0.0, 0.09), 100.0),
    ],
    ids=["just beyond", "far beyond", "to the side", "behind", "above"],
)
def test_the_error_of_unreachable_points_is_correct(
    place: tuple[float, float, float], least_mm: float
) -> None:
    """The returned error is the distance at the returned angles, and at least the minimum."""
    angles, off = angles_for(np.array(place))
    assert _is_within(angles)
    assert off == pytest.approx(np.linalg.norm(fingertip(angles) - place), abs=1e-12)
    assert off >= 1e-3 * least_mm - 1e-9


def test_angles_are_continuous() -> None:
    """A displacement of 0.1 mm changes the angles by less than 3 degrees."""
    rng = np.random.default_rng(1)
    for _ in range(30):
        posture = draw_posture(rng)
        place = fingertip(posture)
        angles, _ = angles_for(place + rng.uniform(-1e-4, 1e-4, 3), posture)
        assert np.degrees(np.abs(angles - posture)).max() < 3.0
