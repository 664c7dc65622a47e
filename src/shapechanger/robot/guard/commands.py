"""Acceptance of commands: age, order, caps and slew."""

from __future__ import annotations

import math

from shapechanger.robot.guard.messages import Order
from shapechanger.robot.guard.plan import ActionPlan

__all__ = ["FUTURE_NS", "Freshness", "aimed", "clipped", "slewed"]

FUTURE_NS = 50_000_000
"""Tolerance for times in the future, ns. Both processes read one clock, so this is generous."""

_NS_PER_MS = 1_000_000


class Freshness:
    """Refuse commands that are repeated, out of order, too old or from the future.

    A command replaces its predecessors even when it is refused for another reason, because its
    sender has superseded them.

    Args:
        deadline_ms: Longest time for which a command acts, ms.
    """

    def __init__(self, deadline_ms: int) -> None:
        self._deadline_ms = deadline_ms
        self._newest = (-1, -1)

    def refusal(self, order: Order, now_ns: int) -> str:
        """Return why a command that arrives now is refused, or an empty string."""
        if (order.session, order.seq) <= self._newest:
            session, seq = self._newest
            return (
                f"Command {order.seq} of session {order.session} is not newer than "
                f"{seq} of session {session}."
            )
        self._newest = (order.session, order.seq)
        if order.issued_ns > now_ns + FUTURE_NS:
            return f"Command {order.seq} comes from the future."
        if now_ns >= self.expiry_ns(order, now_ns):
            age_ms = (now_ns - order.issued_ns) / _NS_PER_MS
            limit_ms = min(self._deadline_ms, order.ttl_ms)
            return f"Command {order.seq} is {age_ms:.0f} ms old; it may act for {limit_ms} ms."
        return ""

    def expiry_ns(self, order: Order, arrived_ns: int) -> int:
        """Return the time at which a command expires, ns."""
        start_ns = min(order.issued_ns, arrived_ns)
        return start_ns + min(self._deadline_ms, order.ttl_ms) * _NS_PER_MS


_SAME = 1e-6  # A cap that was stored as a 32-bit float is still the cap.


def aimed(action: ActionPlan, value: float) -> float:
    """Return the target of a command's value: clipped to the caps and rounded to a level."""
    if action.levels == "three":
        if value >= action.threshold:
            return action.high
        return action.low if value <= -action.threshold else action.rest
    return max(action.low, min(action.high, value))


def clipped(action: ActionPlan, value: float) -> bool:
    """Return whether a command's value lies outside the caps."""
    is_inside = action.low - _SAME <= value <= action.high + _SAME
    return action.levels == "any" and not is_inside


def slewed(action: ActionPlan, now: float, aim: float, elapsed_s: float) -> float:
    """Return the next value on the way to the target.

    It jumps towards rest, is limited by the slew away from rest, and pauses at rest for one step
    when it changes sides. A three-level motor has no slew.

    Args:
        action: The action.
        now: Current value.
        aim: Target value.
        elapsed_s: Time since the current value was set, s.
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
