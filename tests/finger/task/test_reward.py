"""Reward terms of the fingertip: nearness and effort."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.finger.task import FingertipReward


def test_a_second_at_the_target_earns_the_weight() -> None:
    """At the target, the reward per second is the weight at any control rate."""
    for dt in (0.02, 0.1):
        terms = FingertipReward().terms(0.0, 0.0, 0.0, dt)
        assert terms.pop("reward_nearness") == pytest.approx(50.0 * dt)
        assert terms == {"reward_effort": 0.0, "reward_change": 0.0}


def test_reward_grows_as_the_distance_shrinks() -> None:
    """Nearness grows monotonically, and fastest in the last millimetres."""
    distances = np.linspace(0.1, 0.0, 201)
    near = [FingertipReward().terms(d, 0.0, 0.0, 0.02)["reward_nearness"] for d in distances]
    gains = np.diff(near)
    assert (gains > 0.0).all()
    assert gains.argmax() == len(gains) - 1
    assert near[0] > 0.0


def test_effort_is_weighted() -> None:
    assert FingertipReward().terms(0.01, 0.5, 0.0, 0.02)["reward_effort"] == pytest.approx(-0.01)
    free = FingertipReward.from_weights({"effort": 0})
    assert free.terms(0.01, 0.5, 0.0, 0.02)["reward_effort"] == 0.0
    assert free.nearness == FingertipReward().nearness


def test_change_costs_where_it_has_a_weight() -> None:
    """Commands that change by 1 in each step cost the weight per second; by default nothing."""
    costly = FingertipReward.from_weights({"change": 5.0})
    assert costly.terms(0.01, 0.0, 1.0, 0.02)["reward_change"] == pytest.approx(-0.1)
    assert FingertipReward().terms(0.01, 0.0, 1.0, 0.02)["reward_change"] == 0.0


def test_an_unknown_weight_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match=r"'nearnes'. Did you mean 'nearness'"):
        FingertipReward.from_weights({"nearnes": 1.0})
