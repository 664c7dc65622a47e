"""The three fits: motors from commands, joints and friction from motion, arms from lengths."""

import dataclasses
import functools
import importlib

import numpy as np
import pytest

from shapechanger.errors import MissingExtra
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.identify.kinematics import (
    ARMS,
    Kinematics,
    fit_kinematics,
    interval_quantile,
    robust_covariance,
)
from shapechanger.finger.identify.log import FingerLog
from shapechanger.finger.identify.motion import (
    FACTORS,
    MOTOR_KG,
    CommandSignal,
    Motors,
    cut_windows,
    fit_dynamics,
    fit_motors,
    with_motors,
)
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from tests.finger.identify.logs import changed, kinematics, made_up, recorded, swings, synthetic


@functools.cache
def short() -> tuple[FingerLog, FingerParameters]:
    """Return a log of two windows of a stiff, lightly damped finger, and its parameters."""
    parameters = NOMINAL.replace(
        joint_stiffness=tuple(1.3 * v for v in NOMINAL.joint_stiffness),
        joint_damping=tuple(0.8 * v for v in NOMINAL.joint_damping),
        tendon_friction=0.3,
        command_delay=0.02,
    )
    return recorded(2.6, parameters=parameters)


def exact() -> Kinematics:
    return kinematics(angles=short()[0].angles)


def motors(**changes: float) -> Motors:
    """Return motors that match the log of `short`, with changes."""
    found = Motors(0.020, 0.022, 1.0, (1e-4, 1e-4, 0.0), saturates=False, tension_noise=0.0)
    return dataclasses.replace(found, **changes)  # pyright: ignore[reportArgumentType]


def test_joints_and_friction_are_found() -> None:
    log, truth = short()
    found = fit_dynamics(log, exact(), motors())
    for name in ("joint_stiffness", "joint_damping"):
        values = [found[f"{name}/{joint}"][0] for joint in JOINTS]
        np.testing.assert_allclose(values, getattr(truth, name), rtol=0.05)
    assert found["tendon_friction"][0] == pytest.approx(0.3, rel=0.15)
    assert set(found) == set(FACTORS)
    assert all(1e-3 < sd < 0.2 for _, sd in found.values())


def test_windows_begin_in_the_measured_state() -> None:
    """Windows last 1 s from 0.3 s on, and start with velocities and activations from the log."""
    log, _ = short()
    dt = log.control_dt
    windows = cut_windows(log, exact(), motors())
    assert [window.start for window in windows] == pytest.approx(log.t[0] + [0.3, 1.3])
    for window in windows:
        row = round((window.start - log.t[0]) / dt)
        np.testing.assert_array_equal(window.angles, log.angles[row : row + round(1.0 / dt) + 1])
        ahead, back = log.angles[row + 1], log.angles[row - 1]
        np.testing.assert_allclose(window.velocities, (ahead - back) / (2 * dt), atol=0.5)
        assert np.corrcoef(window.velocities, (ahead - back) / (2 * dt))[0, 1] > 0.99
        # Delay and lag keep the activations within the range of the recent commands.
        acting = log.commands[max(row - 4, 0) : row + 1]
        assert (acting.min(axis=0) - 1e-3 <= window.activations).all()
        assert (window.activations <= acting.max(axis=0) + 1e-3).all()
    assert len(cut_windows(log, exact(), motors(), 80)) == 1
    assert len(cut_windows(log, exact(), motors(), None, 0.5, 0.0)) == 5


def test_known_motors_take_precedence() -> None:
    """Known motors set tensions, mass and damping; the lag is always fitted."""
    found = with_motors(motors(lag=0.03, strength=0.5), None)
    assert found.motor_lag == 0.03
    assert found.motor_kg == MOTOR_KG
    np.testing.assert_allclose(found.most_tension, 0.5 * np.array(NOMINAL.most_tension))
    known = NOMINAL.replace(
        most_tension=(9.0,) * 7, least_tension=1.0, motor_kg=2.0, tendon_damping=70.0
    )
    assert with_motors(motors(lag=0.03, strength=0.5), known) == known.replace(motor_lag=0.03)


def test_without_the_toolbox_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its dependencies, `mujoco.sysid` is an empty module."""
    log, found = short()[0], exact()  # These import the env, so they precede the patch.
    monkeypatch.setattr(importlib, "import_module", lambda name: object())
    with pytest.raises(MissingExtra, match=r"shapechanger\[identify\]"):
        fit_dynamics(log, found, motors())


def stepped() -> CommandSignal:
    """Return commands that step from 0 to 1 in the period that ends at 1 s."""
    log = made_up()
    return CommandSignal(changed(log, commands=np.repeat((log.t > 0.99)[:, None], 7, axis=1) * 1.0))


def test_a_command_acts_in_the_period_that_ends_with_its_row() -> None:
    """The command steps at 0.98 s plus the delay; a time step across the change has the mean."""
    late = stepped().delayed(0.96, 0.01, 6, 0.0)
    np.testing.assert_allclose(late[:, 0], [0, 0, 1, 1, 1, 1], atol=1e-9)
    late = stepped().delayed(0.96, 0.01, 6, 0.025)
    np.testing.assert_allclose(late[:, 0], [0, 0, 0, 0, 0.5, 1], atol=1e-9)


def test_motors_follow_with_their_lag() -> None:
    """After one lag, 1/e of a step remains; the first command of a log also acts before the log."""
    made = stepped().activations(0.0, 0.001, 1100, 0.0, 0.030)
    assert made[979, 3] == pytest.approx(0.0, abs=1e-9)
    assert made[1009, 3] == pytest.approx(1.0 - np.exp(-1.0), abs=1e-9)
    held = CommandSignal(changed(made_up(), commands=np.full((300, 7), 0.4)))
    np.testing.assert_allclose(held.activations(0.0, 0.001, 50, 0.02, 0.03), 0.4)


def test_strength_needs_saturation() -> None:
    """Without saturation, the strength is 1, even for a finger that is three times as strong."""
    strong = tuple(3.0 * tension for tension in NOMINAL.most_tension)
    log, _ = recorded(3.0, actions="tension", parameters=NOMINAL.replace(most_tension=strong))
    found = fit_motors(changed(log, motors=None))
    assert (found.saturates, found.strength) == (False, 1.0)


@pytest.mark.parametrize("actions", ["impedance", "tension", "length"])
def test_lag_and_delay_are_found(actions: str) -> None:
    most = tuple(0.9 * tension for tension in NOMINAL.most_tension)
    parameters = NOMINAL.replace(
        motor_lag=0.030, command_delay=0.024, most_tension=most, tension_noise=0.2
    )
    log, _ = recorded(5.0, actions=actions, parameters=parameters)
    found = fit_motors(log)
    assert found.lag == pytest.approx(0.030, abs=0.002)
    assert found.delay == pytest.approx(0.024, abs=0.005)  # 1 to 2 physics steps too long.
    assert found.saturates
    assert found.strength == pytest.approx(0.9, abs=0.02)
    assert found.tension_noise == pytest.approx(0.2, rel=0.2)


LARGE_M = 2e-3


def test_synthetic_logs_give_their_parameters() -> None:
    """Arms, compliance and noise are found, and noise of the angles does not bias the arms."""
    arms, noise = 1.15 * NOMINAL.arms, np.radians(1.5)
    log = synthetic(arms, compliance=5e-5, joint_noise=noise, length_noise=2e-5)
    found = fit_kinematics(log)
    large = np.abs(arms) > LARGE_M
    np.testing.assert_allclose(found.arms[large], arms[large], rtol=0.03)
    assert (found.arms[~ARMS] == 0.0).all()
    assert found.compliance == pytest.approx(5e-5, rel=0.05)
    assert 1e-7 < found.compliance_sd < 2.5e-6
    np.testing.assert_allclose(found.joint_noise, noise, rtol=0.1)
    # Lengths also determine the angles, which removes most of their noise.
    assert np.std(found.angles - swings(log.t)) < 0.5 * noise


def test_slack_and_the_start_of_a_log_are_outliers() -> None:
    """Slack of 5 mm for 0.5 s, and errors in the first 0.2 s, do not bias arms or intervals."""
    log = synthetic(NOMINAL.arms, 0.0, np.radians(1.0), 2e-5)
    lengths = log.lengths.copy()
    lengths[:9] += 0.02
    lengths[100:125, 0] += 5e-3
    found = fit_kinematics(changed(log, lengths=lengths))
    large = np.abs(NOMINAL.arms) > LARGE_M
    np.testing.assert_allclose(found.arms[large], NOMINAL.arms[large], rtol=0.05)
    ratio = (found.arms - NOMINAL.arms)[ARMS] / found.arms_sd[ARMS]
    assert 1.0 / 1.5 < np.sqrt(np.mean(ratio**2)) < 1.5
    assert len(found.angles) == len(log)


def test_the_covariance_has_newey_west_weights() -> None:
    """With L lags in half a second, lag k has the weight 1 - k / (L + 1)."""
    residual = np.array([[1.0], [2.0], [-1.0], [3.0]])
    # Two lags of 0.25 s: 1 + 4 + 1 + 9, + 2 (2/3) (2 - 2 - 3), + 2 (1/3) (-1 + 6); over 4 squared.
    expected = (15.0 - 2.0 * (2.0 / 3.0) * 3.0 + 2.0 * (1.0 / 3.0) * 5.0) / 16.0
    assert robust_covariance(np.ones((4, 1, 1)), residual, 0.25)[0, 0] == pytest.approx(expected)


def test_intervals_are_wider_for_short_logs() -> None:
    """The quantile is Kiefer and Vogelsang's cubic in the bandwidth."""
    assert interval_quantile(10**9, 0.02) == pytest.approx(1.96, abs=1e-4)
    assert interval_quantile(250, 0.02) == pytest.approx(1.96 + 0.29694 + 0.00416 - 0.0005324)
    assert interval_quantile(5, 0.02) == pytest.approx(1.96 + 2.9694 + 0.4160 - 0.5324)
