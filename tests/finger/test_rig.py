"""Measurements and commands of a rig, and the arguments of its envs."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.errors import FingerError, RobotRefused, UnknownName
from shapechanger.finger.anatomy import (
    JOINT_RANGE,
    JOINT_REST,
    MOMENT_ARMS,
    MOST_TENSION_N,
    TENDONS,
)
from shapechanger.finger.gap import GAPS, shipped_rig, with_gears
from shapechanger.finger.plant import JointVelocities
from shapechanger.finger.rig import RigSenses
from shapechanger.finger.task import fingertip
from shapechanger.robot.profile import Profile
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.read import read_profile

_STIFFNESS = 20e3


def _senses_of(profile: Profile) -> RigSenses:
    return RigSenses("it", profile.action_layout(), profile.state_layout())


def _senses() -> RigSenses:
    """Return the senses of a rig without joint encoders."""
    text = find_profile("finger").read_text()
    begin, end = text.index("[sensor.joints]"), text.index("[limits]")
    return _senses_of(read_profile(text[:begin] + text[end:], Path("it.toml")))


def _encoders() -> RigSenses:
    return _senses_of(load_profile(find_profile("finger")))


def _state(angles: NDArray[np.float64], tensions: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = -MOMENT_ARMS @ angles - tensions / _STIFFNESS
    return np.concatenate([lengths, -MOMENT_ARMS @ angles, tensions, np.zeros(7)])


def _measured(angles: NDArray[np.float64], arms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the state of a rig with encoders, at rest and without stretch."""
    return np.concatenate([-arms @ angles, np.zeros(14), angles, np.zeros(7)])


def test_angles_follow_from_lengths_and_stretch() -> None:
    tensions = np.linspace(2.0, 20.0, 7)
    seen = _senses().read(_state(JOINT_REST, tensions), (), np.zeros(7))
    np.testing.assert_allclose(seen.angles, JOINT_REST, atol=1e-12)
    np.testing.assert_allclose(seen.velocities, JOINT_REST, atol=1e-12)
    np.testing.assert_array_equal(seen.tensions, tensions)


def test_commands_are_shares_in_the_order_of_the_rig(tmp_path: Path) -> None:
    """Tensions up to the pretension give the command 0; tensions from the largest on give 1."""
    text = find_profile("finger").read_text()
    begin, end = text.index("[action.FDP]"), text.index("[action.FDS]")
    moved = text[:begin] + text[end:] + "\n" + text[begin:end]
    senses = _senses_of(read_profile(moved, tmp_path / "it.toml"))
    middle = 0.5 * (senses.least + senses.most)
    for tensions, share in ((np.zeros(7), 0.0), (np.full(7, 99.0), 1.0), (middle, 0.5)):
        np.testing.assert_allclose(senses.values(tensions), np.full(7, share), atol=1e-6)
    assert (senses.most <= MOST_TENSION_N + 1e-9).all()
    tensions = senses.least.copy()
    tensions[TENDONS.index("FDP")] = 99.0
    assert senses.values(tensions).tolist() == [0.0] * 6 + [1.0]


@pytest.mark.parametrize("name", ["car", "finger-pwm"])
def test_other_robots_are_refused(name: str) -> None:
    with pytest.raises(RobotRefused, match="it is not a finger"):
        _senses_of(load_profile(find_profile(name)))


def test_encoders_give_the_fingertip_for_any_arms() -> None:
    """With arms off by up to 20 %, angles are exact from encoders, and not from lengths."""
    rng = np.random.default_rng(1)
    arms = MOMENT_ARMS * (1.0 + rng.uniform(-0.2, 0.2, MOMENT_ARMS.shape))
    angles = np.array([0.9, -0.1, 1.1, 0.6])
    seen = _encoders().read(_measured(angles, arms), (), np.zeros(7))
    np.testing.assert_array_equal(seen.angles, angles)
    np.testing.assert_array_equal(seen.fingertip, fingertip(angles))
    np.testing.assert_allclose(seen.lengths, -arms @ angles)
    state = np.delete(_measured(angles, arms), slice(21, 25))
    assert np.abs(_senses().read(state, (), np.zeros(7)).angles - angles).max() > 0.05


def test_velocities_are_smoothed_differences_of_the_encoders() -> None:
    """Velocities are estimated as in a simulation with joint noise, and start at zero."""
    senses, differences = _encoders(), JointVelocities()
    fastest = 0.0
    for i in range(5):
        angles = JOINT_REST + 0.01 * i**2
        seen = senses.read(_measured(angles, MOMENT_ARMS), (), np.zeros(7))
        np.testing.assert_array_equal(seen.velocities, differences.of(angles))
        fastest = float(seen.velocities.max())
    assert fastest > 1.0
    senses.forget()
    seen = senses.read(_measured(JOINT_REST, MOMENT_ARMS), (), np.zeros(7))
    np.testing.assert_array_equal(seen.velocities, np.zeros(4))


def test_absent_measurements_keep_their_last_value() -> None:
    """Other measurements are updated."""
    senses = _encoders()
    senses.read(_measured(JOINT_REST, MOMENT_ARMS), (), np.zeros(7))
    later = _measured(JOINT_REST + 0.1, MOMENT_ARMS)
    later[0] = 0.7
    seen = senses.read(later, ("PIP_flexion/angle", "FDP/length", "no/such"), np.zeros(7))
    assert seen.lengths[0] == (-MOMENT_ARMS @ JOINT_REST)[0]
    np.testing.assert_allclose(seen.angles, JOINT_REST + np.array([0.1, 0.1, 0.0, 0.1]))


def test_a_lost_turn_is_distinguished_from_wrong_arms() -> None:
    """A lost turn of a small spool, 31 mm, is detected; errors of arms of 20 % are tolerated."""
    rng = np.random.default_rng(0)
    senses, (low, high) = _encoders(), JOINT_RANGE.T
    for _ in range(300):
        arms = MOMENT_ARMS * (1.0 + rng.uniform(-0.2, 0.2, MOMENT_ARMS.shape))
        state = _measured(rng.uniform(low, high), arms)
        assert senses.misfit(senses.read(state, (), np.zeros(7))) == ""
        lost = int(rng.integers(7))
        state[lost] += rng.choice([-0.0314, 0.0314])
        said = senses.misfit(senses.read(state, (), np.zeros(7)))
        assert f"{TENDONS[lost]} is off by" in said
        assert "robot calibrate --zeros" in said


@pytest.mark.parametrize(
    ("arguments", "error", "sentence"),
    [
        ({"twin": "real-lik"}, UnknownName, "real-like"),
        ({}, UnknownName, "No known robot matches 'finger'"),
        ({"twin": "nominal", "finger_seed": 3}, FingerError, "selects a finger of a gap"),
        ({"finger_seed": 3}, FingerError, "selects a finger of a gap"),
    ],
)
def test_unknown_robots_and_impossible_twins_are_refused(
    arguments: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        gym.make("shapechanger/RemoteFinger-v1", **arguments)


def test_the_shipped_rig_has_the_path_of_its_profile() -> None:
    """`finger identify --geared` assumes this rig."""
    rig, profile = shipped_rig(), load_profile(find_profile("finger"))
    layout = profile.action_layout()
    spans = [(layout[name].gain, layout[name].gain_unit) for name in TENDONS]
    assert [(most - rig.least_tension, "N") for most in rig.most_tension] == spans
    assert rig == with_gears(rig)
    path = GAPS["real-like"].around.path
    assert path is not None
    assert rig.path == path
    assert (path.control_hz, path.tick_hz) == (profile.control_hz, profile.guard_plan().tick_hz)
    # Equal rates up and down: tensions fall as fast as they rise.
    slews = {(action.slew_per_s, action.slew_down_per_s) for action in profile.actions}
    assert slews == {(path.slew_per_s, path.slew_down_per_s)} == {(path.slew_per_s,) * 2}
