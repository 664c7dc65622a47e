"""What becomes of a number of a command: caps, levels and slew."""

from __future__ import annotations

import math

from shapechanger.robot.guard.plan import ActionPlan

__all__ = ["aimed", "clipped", "slewed"]

_SAME = 1e-6  # A cap that went through a 32-bit float is still the cap.


def aimed(action: ActionPlan, value: float) -> float:
    """What a value of a command aims at: within the caps, and one of the levels."""
    if action.levels == "three":
        if value >= action.threshold:
            return action.high
        return action.low if value <= -action.threshold else action.rest
    return max(action.low, min(action.high, value))


def clipped(action: ActionPlan, value: float) -> bool:
    """Whether a value of a command lies outside the caps."""
    is_inside = action.low - _SAME <= value <= action.high + _SAME
    return action.levels == "any" and not is_inside


def slewed(action: ActionPlan, now: float, aim: float, elapsed_s: float) -> float:
    """The next value on the way to what is aimed at.

    Towards rest it jumps, away from rest it keeps to the slew, and to the other side of rest it
    passes through rest, where it is for one step. A motor that knows three levels only has no
    slew.

    Args:
        action: The action.
        now: Its value now.
        aim: Where to.
        elapsed_s: Time since it got its value, s.
    """
    is_away, will_be_away = now - action.rest, aim - action.rest
    if is_away < 0.0 < will_be_away or will_be_away < 0.0 < is_away:
        return action.rest
    if abs(will_be_away) <= abs(is_away):
        return aim
    if action.levels == "three" or math.isinf(action.slew_per_s):
        return aim
    step = action.slew_per_s * elapsed_s
    return aim if abs(aim - now) <= step else now + math.copysign(step, aim - now)
