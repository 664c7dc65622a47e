"""Moment arms, tensions that give a torque, and drives of the modes of action."""

import math

import mujoco
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from shapechanger.finger import anatomy
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.tensions import (
    DRIVES,
    co_contraction,
    drive_of,
    spans_all_torques,
    tensions_for_torque,
)
from tests.finger.commands import made

_ARMS = anatomy.MOMENT_ARMS
_LEAST_N, _MOST_N = anatomy.LEAST_TENSION_N, anatomy.MOST_TENSION_N
_STILL = np.zeros(7)
_REST = -_ARMS @ anatomy.JOINT_REST
_MICRO = 1e-6


def test_arms_that_do_not_span_are_detected() -> None:
    tensions = co_contraction(_ARMS)
    assert tensions is not None
    assert spans_all_torques(_ARMS)
    assert tensions.min() == pytest.approx(1.0)
    np.testing.assert_allclose(_ARMS.T @ tensions, 0.0, atol=1e-12)
    assert co_contraction(np.abs(_ARMS)) is None
    numb = _ARMS * (1.0, 1.0, 1.0, 0.0)
    assert co_contraction(numb) is not None
    # An et al.'s arms extend the middle and last joints too strongly to be balanced.
    for arms in (np.abs(_ARMS), numb, np.zeros((7, 4)), anatomy.AN_1983_ARMS):
        assert not spans_all_torques(arms)


def _problem(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Draw arms, a torque and bounds; the torque is feasible for an even seed."""
    rng = np.random.default_rng(seed)
    arms = _ARMS * (1.0 + rng.uniform(-0.3, 0.3, _ARMS.shape))
    low = rng.uniform(0.0, 2.0, 7)
    high = low + rng.uniform(0.5, 20.0, 7)
    torque = arms.T @ rng.uniform(low, high)
    if seed % 2:
        torque = torque * rng.uniform(1.0, 3.0) + rng.uniform(-0.1, 0.1, 4)
    return arms, torque, low, high


@pytest.mark.parametrize("seed", range(40))
def test_tensions_are_within_bounds(seed: int) -> None:
    """The flag states whether the tensions give the torque; otherwise they are the nearest."""
    arms, torque, low, high = _problem(seed)
    tensions, is_enough = tensions_for_torque(arms, torque, low, high)
    assert (tensions >= low - 1e-9).all()
    assert (tensions <= high + 1e-6).all()
    off = float(np.abs(arms.T @ tensions - torque).max())
    assert is_enough == (off <= _MICRO)
    best = lsq_linear(1e3 * arms.T, 1e3 * torque, bounds=(low, high), method="bvls", tol=1e-14)
    nearest = float(np.linalg.norm(arms.T @ best.x - torque))
    assert np.linalg.norm(arms.T @ tensions - torque) <= nearest + _MICRO
    if seed % 2:
        return
    # No other solution has less co-contraction.
    assert is_enough
    matrix = np.concatenate([1e5 * arms.T, 1e-2 * np.eye(7)])
    goal = np.concatenate([1e5 * (torque - arms.T @ low), np.zeros(7)])
    other = lsq_linear(matrix, goal, bounds=(np.zeros(7), high - low), method="bvls", tol=1e-14)
    assert np.abs(arms.T @ (low + other.x) - torque).max() < _MICRO
    assert np.linalg.norm(tensions - low) <= np.linalg.norm(other.x) * (1.0 + 1e-3)


@pytest.mark.parametrize("mode", DRIVES)
def test_command_inverts_tension(mode: str) -> None:
    """At the resting length, -1 and 1 give the least and largest tension, except for "length"."""
    rng = np.random.default_rng(0)
    drive = drive_of(mode, NOMINAL)
    command, length, speed = rng.uniform(-1, 1, (3, 7)) * [[1.0], [0.01], [0.2]]
    tension = drive.tension(command, length, speed)
    np.testing.assert_allclose(drive.command(tension, length, speed), command, atol=1e-12)
    assert (drive.tension(command + 0.1, length, speed) > tension).all()
    stiffer = drive.tension(_STILL, _REST + 0.01, _STILL) / drive.tension(_STILL, _REST, _STILL)
    if mode != "length":
        np.testing.assert_allclose(drive.tension(-np.ones(7), _REST, _STILL), _LEAST_N)
        np.testing.assert_allclose(drive.tension(np.ones(7), _REST, _STILL), _MOST_N)
        np.testing.assert_allclose(stiffer, 1.25 if mode == "impedance" else 1.0)


@pytest.mark.parametrize("mode", DRIVES)
def test_the_model_pulls_as_the_drive(mode: str) -> None:
    model, drive = made(mode=mode), drive_of(mode, NOMINAL)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(20):
        data.qpos[:] = anatomy.JOINT_REST + rng.uniform(-0.2, 0.2, 4)
        data.qvel[:] = rng.uniform(-3.0, 3.0, 4)
        data.act[:] = rng.uniform(-1.0, 1.0, 7)
        mujoco.mj_forward(model, data)
        asked = drive.tension(data.act, -_ARMS @ data.qpos, -_ARMS @ data.qvel)
        expected = np.clip(asked, _LEAST_N, _MOST_N)
        np.testing.assert_allclose(-data.actuator_force, expected, atol=1e-9)


def test_length_commands_span_all_postures() -> None:
    """In any posture, -1 gives at most the least tension, and 1 at least the largest."""
    drive = drive_of("length", NOMINAL)
    rng = np.random.default_rng(0)
    for angles in rng.uniform(anatomy.JOINT_RANGE[:, 0], anatomy.JOINT_RANGE[:, 1], (50, 4)):
        length = -_ARMS @ angles
        assert (drive.tension(-np.ones(7), length, _STILL) <= _LEAST_N + 1e-9).all()
        assert (drive.tension(np.ones(7), length, _STILL) >= _MOST_N).all()


# Effect of 1 N of each tendon at the fingertip of a cadaver's index finger: force sideways, along
# and across it, N, and torque about it, N·m (R/main.r of github.com/bc/stfeasibility).
_ASIDE = [-0.08941, -0.0447, -0.009249, 0.03669, 0.1421, 0.2087, -0.2138]
_ALONG = [-0.04689, -0.1496, 0.052, 0.052, 0.0248, 0.0, 0.0248]
_ACROSS = [0.06472, 0.001953, -0.1518, -0.1518, 0.2919, 0.0568, 0.2067]
_TORQUE = [0.003081, -0.002352, -0.0001649, -0.0001649, -0.0004483, 0.0001579, -0.000685]
_FDS, _DI = 1, 5


def test_moment_arms_follow_from_measured_forces() -> None:
    aside, along, across, torque = map(np.array, (_ASIDE, _ALONG, _ACROSS, _TORQUE))
    # FDS and DI exert no torque on the last joint, so their forces determine where it is.
    y = torque[_DI] / across[_DI]
    z = (torque[_FDS] - y * across[_FDS]) / -along[_FDS]
    assert math.hypot(y, z) == pytest.approx(0.016, abs=1e-4)
    assert math.degrees(math.atan2(abs(y), abs(z))) == pytest.approx(10.0, abs=0.1)
    proximal, middle, _ = anatomy.PHALANX_LENGTH_M
    level = math.cos(math.radians(45.0)) * proximal
    end = torque - y * across + z * along
    mid = end - middle * along
    knuckle = mid + level * (across - along)
    arms = np.stack([knuckle, aside * (level - y), mid, end], axis=1)
    np.testing.assert_allclose(1e3 * _ARMS, 1e3 * arms, atol=0.06)
