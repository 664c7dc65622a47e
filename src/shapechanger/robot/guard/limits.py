"""Caps, slew and the bump reflex as pure functions of a plan's limits.

The guard calls them on a robot, and a simulation of the robot calls them too, so that both move
the same way. They need the standard library alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shapechanger.robot.guard.plan import ActionPlan

# Name of the turning action. It may propel, as a tank's does, but never forward.
_STEERING = "steering"
_SAME = 1e-6  # A cap that was stored as a 32-bit float is still the cap.
_NS_PER_MS = 1_000_000


def aimed(action: ActionPlan, value: float) -> float:
    """Return the target of a command's value: clipped to the caps and rounded to a level.

    Args:
        action: The action.
        value: Value in the command, dimensionless.
    """
    if action.levels == "three":
        if value >= action.threshold:
            return action.high
        return action.low if value <= -action.threshold else action.rest
    return max(action.low, min(action.high, value))


def clipped(action: ActionPlan, value: float) -> bool:
    """Return whether a command's value lies outside the caps.

    Args:
        action: The action; with three levels no value is clipped.
        value: Value in the command, dimensionless.
    """
    is_inside = action.low - _SAME <= value <= action.high + _SAME
    return action.levels == "any" and not is_inside


def slewed(action: ActionPlan, now: float, aim: float, elapsed_s: float) -> float:
    """Return the next value on the way to the target.

    The slew limits it away from rest and towards rest, and it pauses at rest for one step when it
    changes sides. A three-level motor has no slew.

    Args:
        action: The action.
        now: Current value.
        aim: Target value.
        elapsed_s: Time since the current value was set, s.
    """
    is_away, will_be_away = now - action.rest, aim - action.rest
    if is_away < 0.0 < will_be_away or will_be_away < 0.0 < is_away:
        aim = action.rest
    falls = abs(aim - action.rest) <= abs(is_away)
    slew_per_s = action.slew_down_per_s if falls else action.slew_per_s
    if action.levels == "three" or math.isinf(slew_per_s):
        return aim
    step = slew_per_s * elapsed_s
    return aim if abs(aim - now) <= step else now + math.copysign(step, aim - now)


def forward_actions(actions: Sequence[ActionPlan]) -> tuple[int, ...]:
    """Return the indices of the actions that push the robot forward or backward."""
    return tuple(i for i, a in enumerate(actions) if a.propels and a.name != _STEERING)


def bump_ends_ns(touches: bool, now_ns: int, ends_ns: int | None, hold_ms: int) -> int | None:
    """Return when the block of the newest bump ends, ns; None if there was none.

    Args:
        touches: Whether a bumper touches something now.
        now_ns: Time, ns.
        ends_ns: The end so far.
        hold_ms: Time for which a bump blocks forward motion (`LimitPlan.bump_hold_ms`), ms.
    """
    return now_ns + hold_ms * _NS_PER_MS if touches else ends_ns


def bump_blocks(touches: bool, now_ns: int, ends_ns: int | None) -> bool:
    """Return whether a bump blocks forward motion.

    Args:
        touches: Whether a bumper touches something now.
        now_ns: Time, ns.
        ends_ns: End of the block, as `bump_ends_ns` returns it.
    """
    return touches or (ends_ns is not None and now_ns < ends_ns)
