"""Which actions make the robot go, and how much it is pushed forward."""

from __future__ import annotations

from collections.abc import Sequence

from shapechanger.robot.guard.plan import ActionPlan

__all__ = ["STEERING", "Propulsion"]

STEERING = "steering"
"""Name of the action that turns. It may propel, as that of a tank does, but never forward."""


class Propulsion:
    """What of the actions goes forward; a positive value is forward.

    Attributes:
        forward: Which actions push the robot forward or backward, by index.

    Args:
        actions: The actions of the robot.
    """

    def __init__(self, actions: Sequence[ActionPlan]) -> None:
        self._actions = actions
        self.forward = tuple(i for i, a in enumerate(actions) if a.propels and a.name != STEERING)
        # Actions whose profile says how fast they make the robot.
        self._known = tuple(i for i in self.forward if actions[i].unit == "m/s")

    def push(self, values: Sequence[float]) -> float:
        """How hard the robot is pushed forward, -1 to 1; negative is backward."""
        return self._mean(self.forward, [value - a.rest for value, a in self._pairs(values)])

    def speed(self, values: Sequence[float]) -> float | None:
        """Speed that this push gives by the profile, m/s; None where the profile has none."""
        if not self._known:
            return None
        speeds = [a.gain * (value - a.rest) for value, a in self._pairs(values)]
        return self._mean(self._known, speeds)

    def _pairs(self, values: Sequence[float]) -> zip[tuple[float, ActionPlan]]:
        return zip(values, self._actions, strict=True)

    @staticmethod
    def _mean(which: Sequence[int], numbers: Sequence[float]) -> float:
        return sum(numbers[i] for i in which) / len(which) if which else 0.0
