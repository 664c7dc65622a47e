"""When an expert takes over from a policy, and gives back."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.demos.drivers import Gate, GateRule
from shapechanger.errors import DemosError

RIGHT = np.array([0.0, 0.5], np.float32)
RULE = GateRule(apart=0.5, apart_s=0.3, near_s=0.4, agree=0.2, agree_s=0.3)


def drivers(gaps: list[float], dangers: dict[int, str] | None = None) -> str:
    """Who drives at each step of 0.1 s: P or E."""
    gate, who = Gate(RULE, 0.1), ""
    for number, gap in enumerate(gaps):
        wanted = RIGHT + np.array([gap, 0.0], np.float32)
        gate.watch(wanted, RIGHT, (dangers or {}).get(number, ""))
        who += "E" if gate.corrects else "P"
    return who


def test_a_difference_must_last() -> None:
    """A moment is let pass, and a break begins anew."""
    assert drivers([0.9, 0.9, 0.0, 0.9, 0.9, 0.9]) == "PPPPPE"


def test_it_is_given_back_when_both_have_agreed_for_long_enough() -> None:
    """A difference meanwhile begins anew."""
    assert drivers([0.9] * 3 + [0.1] * 2 + [0.3] + [0.1] * 4) == "PPEEEEEEPP"


def test_danger_takes_over_at_once_and_keeps() -> None:
    """Also where both want the same."""
    assert drivers([0.0] * 7, {1: "0.1 m ahead", 3: "0.1 m ahead"}) == "PEEEEEP"


def test_it_says_why() -> None:
    """In words, and only when the driver changes."""
    gate = Gate(RULE, 0.1)
    off = RIGHT + np.float32(0.8)
    told = [gate.watch(off, RIGHT, "") for _ in range(4)]
    assert told == ["", "", "the expert takes over: the policy is off by 0.8", ""]
    told = [gate.watch(RIGHT, RIGHT, "") for _ in range(4)]
    assert [text for text in told if text] == ["the policy drives on"]


def test_a_rule_that_contradicts_itself_is_refused() -> None:
    """Nobody could give back."""
    with pytest.raises(DemosError, match="agree must be positive"):
        GateRule(apart=0.2, agree=0.3)
    with pytest.raises(DemosError, match="must not be negative"):
        GateRule(apart_s=-1.0)
