"""When somebody who can drive takes over from a policy, and gives back.

The policy drives and is watched; only while it is corrected is there something to learn: M. Kelly
et al., "HG-DAgger: Interactive Imitation Learning with Human Experts", ICRA 2019. There a person
decides by feeling; here a rule in plain numbers does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import DemosError

__all__ = ["Gate", "GateRule"]

_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRule:
    """When to take over, and when to give back.

    Attributes:
        apart: The expert takes over when any number of the two actions, such as the steering, has
            differed by more than this,
        apart_s: for so long without a break, s; at least one step.
        near_s: It takes over at once when, at the present speed, what is ahead is so near, s, and
            the policy does not brake.
        agree: It gives back when no number has differed by more than this,
        agree_s: for so long without a break, s, and nothing was near; at least one step.
    """

    apart: float = 0.6
    apart_s: float = 0.3
    near_s: float = 0.4
    agree: float = 0.3
    agree_s: float = 1.0

    def __post_init__(self) -> None:
        """Refuse a rule by which nobody could drive."""
        if not 0.0 < self.agree <= self.apart:
            raise DemosError(
                f"The expert gives back below the difference at which it takes over, which is above"
                f" 0: got {self.agree} and {self.apart}."
            )
        if min(self.apart_s, self.near_s, self.agree_s) < 0.0:
            raise DemosError("The times of a rule for taking over are not below 0 s.")


class Gate:
    """Says at each step who drives.

    Args:
        rule: When.
        period_s: Time from one step to the next, s.

    Attributes:
        corrects: Whether the expert drives.
    """

    def __init__(self, rule: GateRule, period_s: float) -> None:
        self._rule = rule
        self._steps_apart = _steps(rule.apart_s, period_s)
        self._steps_agreed = _steps(rule.agree_s, period_s)
        self.begin()

    def begin(self) -> None:
        """An episode has begun: the policy drives."""
        self.corrects = False
        self._lasted = 0

    def watch(self, wanted: NDArray[np.float32], right: NDArray[np.float32], danger: str) -> str:
        """Take in one step.

        Args:
            wanted: What the policy would do, (n,).
            right: What the expert would do, (n,).
            danger: What is about to go wrong, in words; empty for nothing.

        Returns:
            Why the driver changes now, in words; empty if it does not.
        """
        rule, gap = self._rule, float(np.abs(wanted - right).max())
        if self.corrects:
            fine = gap <= rule.agree and not danger
            self._lasted = self._lasted + 1 if fine else 0
            if self._lasted >= self._steps_agreed:
                self.corrects, self._lasted = False, 0
                return "the policy drives on"
            return ""
        self._lasted = self._lasted + 1 if gap > rule.apart else 0
        why = danger
        if not why and self._lasted >= self._steps_apart:
            why = f"the policy is off by {gap:.1f}"
        if not why:
            return ""
        self.corrects, self._lasted = True, 0
        return f"the expert takes over: {why}"


def _steps(seconds: float, period_s: float) -> int:
    """How many steps last so long; a sum of periods is never quite what it should be."""
    return max(1, math.ceil(seconds / period_s - _ROUNDING))
