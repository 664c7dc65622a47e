"""Twins that an env serves itself."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.errors import FingerError, UnknownName
from shapechanger.finger.anatomy import TENDONS
from shapechanger.finger.gap import GAPS, shipped_rig, with_gears
from shapechanger.finger.parameters import NOMINAL
from shapechanger.robot.profile.load import find_profile, load_profile

RIG = "shapechanger/RemoteFinger-v1"


def test_an_unknown_twin_is_refused() -> None:
    """The error suggests the nearest name, and nothing is started."""
    with pytest.raises(UnknownName, match="real-like"):
        gym.make(RIG, twin="real-lik")


def test_without_a_rig_a_twin_is_proposed() -> None:
    """The sentence names the argument that needs no rig."""
    with pytest.raises(UnknownName, match='Without a rig, give twin="real-like"'):
        gym.make(RIG)


@pytest.mark.parametrize("twin", ["", "nominal"])
def test_finger_seed_needs_a_gap(twin: str) -> None:
    with pytest.raises(FingerError, match="selects a finger of a gap"):
        gym.make(RIG, twin=twin, finger_seed=3)


def test_a_geared_finger_is_within_its_gap() -> None:
    """Arms stay nominal, and the motors are within the ranges of the gap."""
    geared = with_gears(NOMINAL)
    gap = GAPS["real-like"]
    assert geared.moment_arms == NOMINAL.moment_arms
    for name in ("motor_kg", "tendon_damping", "tendon_friction", "motor_lag"):
        low, high = getattr(gap, name)
        assert low < getattr(geared, name) < high
    drawn = gap.draw(np.random.default_rng(0))
    assert 0.5 < drawn.motor_kg / geared.motor_kg < 2.0


def test_the_shipped_rig_has_the_tensions_and_the_path_of_its_profile() -> None:
    """`finger identify --geared` assumes the values in a log of that rig."""
    rig = shipped_rig()
    layout = load_profile(find_profile("finger")).action_layout()
    spans = [(layout[name].gain, layout[name].gain_unit) for name in TENDONS]
    assert [(most - rig.least_tension, "N") for most in rig.most_tension] == spans
    assert rig == with_gears(rig)
    assert rig.path == GAPS["real-like"].around.path


def test_geared_fingers_have_the_path_of_the_shipped_rig() -> None:
    """Rates and slew are its profile's, so its tensions fall as fast as they rise."""
    profile = load_profile(find_profile("finger"))
    path = GAPS["real-like"].around.path
    assert path is not None
    assert path.control_hz == profile.control_hz
    assert path.tick_hz == profile.guard_plan().tick_hz
    for action in profile.actions:
        assert (action.slew_per_s, action.slew_down_per_s) == (
            path.slew_per_s,
            path.slew_down_per_s,
        )
        assert action.slew_per_s == action.slew_down_per_s
