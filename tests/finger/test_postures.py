"""Postures for targets and starts."""

from __future__ import annotations

import mujoco
import numpy as np

from shapechanger.finger.anatomy import (
    DIP_BAND,
    DIP_BY_PIP,
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
)
from shapechanger.finger.postures import (
    coupled,
    draw_posture,
    draw_start,
    inner_range,
    moving_torque,
)
from shapechanger.finger.tensions import tensions_for_torque
from tests.finger.commands import made
from tests.finger.holding import can_hold

_STILL = np.zeros(4)
_LOW, _HIGH = JOINT_RANGE.T


def test_postures_are_away_from_limits_and_can_be_held() -> None:
    """Targets and starts are 10 % of the range from the limits, balanced and varied."""
    rng = np.random.default_rng(0)
    inner = 0.1 * (_HIGH - _LOW) - 1e-12
    for draw in (draw_posture, draw_start):
        postures = np.array([draw(rng) for _ in range(100)])
        assert (postures >= _LOW + inner).all()
        assert (postures <= _HIGH - inner).all()
        assert all(can_hold(posture) for posture in postures)
        assert (np.ptp(postures, axis=0) > 0.1).all()


def test_every_posture_of_the_range_can_be_held() -> None:
    """Also at its corners, so that no drawn one needs a check."""
    low, high = inner_range()
    shares = np.stack(np.meshgrid(*[[0.0, 0.5, 1.0]] * 4), axis=-1).reshape(-1, 4)
    for share in shares:
        free = low[:3] + share[:3] * (high - low)[:3]
        off = DIP_BAND * (2.0 * share[3] - 1.0)
        assert can_hold(np.array(coupled(free[0], free[1], free[2], off)).clip(low, high))


def test_balanced_tensions_hold_a_posture() -> None:
    """In the simulator, each joint stays for a second under the computed tensions."""
    model = made()
    rng = np.random.default_rng(0)
    most = np.array(MOST_TENSION_N)
    for _ in range(10):
        posture = draw_posture(rng)
        torque = moving_torque(posture, _STILL, _STILL)
        tensions, is_enough = tensions_for_torque(MOMENT_ARMS, torque, LEAST_TENSION_N, most)
        assert is_enough
        data = mujoco.MjData(model)
        data.qpos[:] = posture
        middle, half = 0.5 * (most + LEAST_TENSION_N), 0.5 * (most - LEAST_TENSION_N)
        data.ctrl[:] = data.act[:] = (tensions - middle) / half
        mujoco.mj_step(model, data, 500)
        np.testing.assert_allclose(data.qpos, posture, atol=np.radians(0.5))


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
        least = MOMENT_ARMS.T @ np.full(7, LEAST_TENSION_N)
        asked = moving_torque(angles, speed, acceleration)
        data.qfrc_applied[:] = asked - friction - least
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qacc, acceleration, atol=1e-6)


def test_nearly_every_posture_that_the_hood_allows_can_be_held() -> None:
    """An end joint that is fully flexed alone cannot."""
    rng = np.random.default_rng(0)
    held = 0
    for angles in rng.uniform(_LOW, _HIGH, (200, 4)):
        angles[3] = DIP_BY_PIP * angles[2] + rng.uniform(-DIP_BAND, DIP_BAND)
        held += can_hold(angles.clip(_LOW, _HIGH))
    assert held >= 190
    assert not can_hold(np.array([0.0, 0.0, 0.0, _HIGH[3]]))
    assert not can_hold(JOINT_REST + np.array([20.0, 0.0, 0.0, 0.0]))
