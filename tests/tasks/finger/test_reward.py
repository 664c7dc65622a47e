"""What nearness is worth, and effort costs."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.tasks.finger import FingertipReward


def test_a_second_at_the_right_place_is_worth_its_weight() -> None:
    """Without effort, however long the steps are."""
    for dt in (0.02, 0.1):
        terms = FingertipReward().terms(0.0, 0.0, dt)
        assert terms == {"reward_nearness": pytest.approx(50.0 * dt), "reward_effort": 0.0}


def test_nearer_is_always_better() -> None:
    """From ten centimetres to nothing, and most of all in the last millimetres."""
    distances = np.linspace(0.1, 0.0, 201)
    near = [FingertipReward().terms(d, 0.0, 0.02)["reward_nearness"] for d in distances]
    gains = np.diff(near)
    assert (gains > 0.0).all()
    assert gains.argmax() == len(gains) - 1
    assert near[0] > 0.0


def test_effort_costs_by_its_weight() -> None:
    """And a weight of 0 turns it off."""
    assert FingertipReward().terms(0.01, 0.5, 0.02)["reward_effort"] == pytest.approx(-0.01)
    free = FingertipReward.from_weights({"effort": 0})
    assert free.terms(0.01, 0.5, 0.02)["reward_effort"] == 0.0
    assert free.nearness == FingertipReward().nearness


def test_a_weight_that_there_is_not_is_named() -> None:
    """With the nearest spelling."""
    with pytest.raises(UnknownName, match=r"'nearnes'. Did you mean 'nearness'"):
        FingertipReward.from_weights({"nearnes": 1.0})
