"""What a step is worth, from what the robot says that it sensed."""

from __future__ import annotations

from typing import Final

from shapechanger.link.messages import Observation
from shapechanger.remote.senses import Senses
from shapechanger.tasks.drive import DriveReward

__all__ = ["BUMP", "Judge"]

BUMP: Final = "bump"
"""Name of the event of a bump, and of the quantity."""

_NS_PER_S: Final = 1e9
_QUANTITIES: Final = ("speed", "collision", "stall")
_ABSENT: Final = "absent"


class Judge:
    """Judges the steps of one robot, one after another.

    Args:
        senses: Reads the robot's messages.
        reward: Weights of the task.
    """

    def __init__(self, senses: Senses, reward: DriveReward) -> None:
        self._senses = senses
        self._reward = reward
        self._touched = False

    def start(self, seen: Observation) -> None:
        """Begin an episode: what it touches now is no collision of this episode."""
        self._touched = bool(self._touches(seen)[0])

    def judge(
        self, before: Observation, seen: Observation, bumped: bool
    ) -> tuple[bool, dict[str, float]]:
        """Whether the task is over, and the terms of the reward.

        Args:
            before: The observation before.
            seen: The one after.
            bumped: Whether there was a bump, which may be over by now.
        """
        touches = self._touches(seen)[0]
        stall = self._senses.quantity(seen, "stall")
        hits = bool(touches) or bumped
        collided = None if touches is None else hits and not self._touched
        self._touched = hits
        dt_s = max(0, seen.state_ns - before.state_ns) / _NS_PER_S
        speed = self._senses.quantity(seen, "speed")
        stalled = None if stall is None else bool(stall)
        return self._reward.ends(collided), self._reward.terms(speed, collided, stalled, dt_s)

    def sources(self, seen: Observation) -> dict[str, str]:
        """Which sensor each quantity of the reward comes from."""
        sources = {name: self._senses.source(seen, name) for name in _QUANTITIES}
        return sources | {"collision": self._touches(seen)[1]}

    def _touches(self, seen: Observation) -> tuple[float | None, str]:
        """Whether it touches something, 0 or 1, and which sensor says so."""
        for quantity in ("collision", BUMP):
            value = self._senses.quantity(seen, quantity)
            if value is not None:
                return value, self._senses.source(seen, quantity)
        return None, _ABSENT
