"""How the actions go to rest at a stop."""

from __future__ import annotations

from collections.abc import Sequence

from shapechanger.robot.guard.plan import ActionPlan, StopPlan

__all__ = ["Stopping"]

_NS_PER_MS = 1_000_000


class Stopping:
    """One stop: what propels rests at once, the other actions hold, ramp to rest, and let go.

    Args:
        plan: How long they hold and ramp.
        actions: The actions.
        values: What they are when the stop begins.
        since_ns: When it begins.
    """

    def __init__(
        self,
        plan: StopPlan,
        actions: Sequence[ActionPlan],
        values: Sequence[float],
        since_ns: int,
    ) -> None:
        self._actions = actions
        self._values = values
        self._then = plan.then
        self._hold_end_ns = since_ns + plan.hold_ms * _NS_PER_MS
        self._ramp_ns = plan.ramp_ms * _NS_PER_MS
        self.end_ns = self._hold_end_ns + self._ramp_ns
        """When all of them rest."""

    def values(self, now_ns: int) -> tuple[float, ...]:
        """What the actions are now."""
        left = self._left(now_ns)
        return tuple(
            action.rest if action.propels else action.rest + left * (value - action.rest)
            for action, value in zip(self._actions, self._values, strict=True)
        )

    def releases(self, now_ns: int) -> bool:
        """Whether the outputs let go."""
        return self._then == "release" and now_ns >= self.end_ns

    def next_ns(self, now_ns: int) -> int | None:
        """When the next thing happens; None when nothing does, or something all the time."""
        return next((t for t in (self._hold_end_ns, self.end_ns) if t > now_ns), None)

    def _left(self, now_ns: int) -> float:
        """How much of the way to rest is left, 1 to 0."""
        if now_ns < self._hold_end_ns:
            return 1.0
        if now_ns >= self.end_ns:
            return 0.0
        return (self.end_ns - now_ns) / self._ramp_ns
