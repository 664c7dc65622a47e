"""Which commands are new enough to act."""

from __future__ import annotations

from shapechanger.robot.guard.wire import Order

__all__ = ["FUTURE_NS", "Freshness"]

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
