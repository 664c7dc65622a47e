"""Which commands are new enough to act."""

from __future__ import annotations

import math

from shapechanger.robot.guard.messages import Order
from shapechanger.robot.guard.plan import ActionPlan

__all__ = ["FUTURE_NS", "Freshness", "aimed", "clipped", "slewed"]

FUTURE_NS = 50_000_000
"""How far a time may lie in the future, ns: two processes read one clock, so this is generous."""

_NS_PER_MS = 1_000_000


class Freshness:
    """Refuses commands that are repeated, out of order, too old or from the future.

    A command counts as the newest one even when it is refused for another reason: whoever sent
    it had done with the ones before.

    Args:
        deadline_ms: How long a command acts at most.
    """

    def __init__(self, deadline_ms: int) -> None:
        self._deadline_ms = deadline_ms
        self._newest = (-1, -1)

    def refusal(self, order: Order, now_ns: int) -> str:
        """Why a command that arrives now must not act; empty when it may."""
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
        """When a command stops acting, ns."""
        start_ns = min(order.issued_ns, arrived_ns)
        return start_ns + min(self._deadline_ms, order.ttl_ms) * _NS_PER_MS


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
