"""When an expert takes over from a policy, and hands back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.demos.drivers import Gate, GateRule
from shapechanger.errors import DemosError

RIGHT = np.array([0.0, 0.5], np.float32)
RULE = GateRule(apart=0.5, apart_s=0.3, near_s=0.4, agree=0.2, agree_s=0.3)


def drivers(gaps: list[float], dangers: dict[int, str] | None = None) -> str:
    """Return the driver of each step of 0.1 s: P or E."""
    gate, who = Gate(RULE, 0.1), ""
    for number, gap in enumerate(gaps):
        wanted = RIGHT + np.array([gap, 0.0], np.float32)
        gate.watch(wanted, RIGHT, (dangers or {}).get(number, ""))
        who += "E" if gate.corrects else "P"
    return who


def test_a_difference_must_last() -> None:
    assert drivers([0.9, 0.9, 0.0, 0.9, 0.9, 0.9]) == "PPPPPE"


def test_control_returns_after_lasting_agreement() -> None:
    assert drivers([0.9] * 3 + [0.1] * 2 + [0.3] + [0.1] * 4) == "PPEEEEEEPP"


def test_danger_takes_over_at_once() -> None:
    assert drivers([0.0] * 7, {1: "0.1 m ahead", 3: "0.1 m ahead"}) == "PEEEEEP"


def test_the_gate_gives_reasons() -> None:
    gate = Gate(RULE, 0.1)
    off = RIGHT + np.float32(0.8)
    reasons = [gate.watch(off, RIGHT, "") for _ in range(4)]
    assert reasons == ["", "", "the expert takes over: the policy is off by 0.8", ""]
    reasons = [gate.watch(RIGHT, RIGHT, "") for _ in range(4)]
    assert [text for text in reasons if text] == ["the policy drives on"]


@given(
    right=st.floats(-1.0, 1.0, width=32),
    rest=st.sampled_from([0.0, -1.0]),
    share=st.floats(0.0, 1.0, width=32),
)
def test_slower_than_the_expert_is_no_difference(right: float, rest: float, share: float) -> None:
    expert = np.array([0.0, right], np.float32)
    slow = np.array([0.1, rest + share * (right - rest)], np.float32)
    gate = Gate(RULE, 0.1, (None, rest))
    assert not any(gate.watch(slow, expert, "") for _ in range(10))
    gate.watch(slow, expert, "danger")
    assert [gate.watch(slow, expert, "") for _ in range(3)][-1] == "the policy drives on"


@pytest.mark.parametrize("wanted", [(0.9, 0.5), (0.0, 1.0), (0.0, -0.6)])
def test_faster_backward_and_aside_are_corrected(wanted: tuple[float, float]) -> None:
    gate = Gate(RULE, 0.1, (None, 0.0))
    right = np.array([0.0, 0.4], np.float32)
    reasons = [gate.watch(np.array(wanted, np.float32), right, "") for _ in range(3)]
    assert reasons[-1].startswith("the expert takes over: the policy is off by")


def test_a_rule_that_contradicts_itself_is_refused() -> None:
    with pytest.raises(DemosError, match="agree must be positive"):
        GateRule(apart=0.2, agree=0.3)
    with pytest.raises(DemosError, match="must not be negative"):
        GateRule(apart_s=-1.0)
