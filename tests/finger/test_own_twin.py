"""Twins that an env serves itself."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.errors import FingerError, UnknownName
from shapechanger.finger.anatomy import TENDONS
from shapechanger.finger.gap import GAPS, shipped_rig, with_gears
from shapechanger.finger.parameters import NOMINAL
from shapechanger.robot.profile.load import find_profile, load_profile


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


@pytest.mark.parametrize(
    ("arguments", "error", "sentence"),
    [
        ({"twin": "real-lik"}, UnknownName, "real-like"),
        ({}, UnknownName, 'Without a rig, give twin="real-like"'),
        ({"twin": "nominal", "finger_seed": 3}, FingerError, "selects a finger of a gap"),
        ({"finger_seed": 3}, FingerError, "selects a finger of a gap"),
    ],
)
def test_impossible_twins_are_refused(
    arguments: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        gym.make("shapechanger/RemoteFinger-v1", **arguments)


def test_geared_fingers_and_the_shipped_rig_have_the_path_of_its_profile() -> None:
    """`finger identify --geared` assumes the values in a log of that rig."""
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
