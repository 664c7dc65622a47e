"""A twin that an env serves for itself."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.bodies.finger import NOMINAL
from shapechanger.envs.finger.gap import GAPS, with_gears
from shapechanger.errors import FingerError, UnknownName

RIG = "shapechanger/RemoteFinger-v1"


def test_there_is_no_such_twin() -> None:
    """With what there is, and the nearest; nothing is started."""
    with pytest.raises(UnknownName, match="real-like"):
        gym.make(RIG, twin="real-lik")


@pytest.mark.parametrize("twin", ["", "nominal"])
def test_a_finger_of_no_gap_has_no_seed(twin: str) -> None:
    """As for `Finger-v1`."""
    with pytest.raises(FingerError, match="selects a finger of a gap"):
        gym.make(RIG, twin=twin, finger_seed=3)


def test_a_finger_with_gears_is_one_of_the_gap() -> None:
    """Its bones stay; what its servos are like is within the ranges."""
    geared = with_gears(NOMINAL)
    gap = GAPS["geared"]
    assert geared.moment_arms == NOMINAL.moment_arms
    for name in ("motor_kg", "tendon_damping", "tendon_friction", "motor_lag"):
        low, high = getattr(gap, name)
        assert low < getattr(geared, name) < high
    drawn = gap.draw(np.random.default_rng(0))
    assert 0.5 < drawn.motor_kg / geared.motor_kg < 2.0
