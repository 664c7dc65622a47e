"""What the outputs really do, where that is not what they were told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from shapechanger.robot.guard.mix import output_values
from shapechanger.robot.guard.plan import GuardPlan

__all__ = ["Done", "Truth"]

# Pulses and duties have steps: those of a PCA9685 at 50 Hz are 1 % of a servo's range and 5 % of
# that of a controller which is told to use a fifth of it.
_STEP: Final = 0.06

_WHY: Final = {
    "esc": "its controller waits, brakes or changes direction",
    "dynamixel": "its bus has a fault, and lets go",
    "servo": "it turns no faster than its profile allows",
}


class Done(NamedTuple):
    """What the outputs do.

    Attributes:
        actions: One number for each action.
        reason: Which outputs do something else than they were told, and why, in words.
    """

    actions: tuple[float, ...]
    reason: str


class Truth:
    """Tells from the values of the outputs which actions they are.

    Args:
        plan: The robot.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._plan = plan
        self._rest = output_values(plan, [action.rest for action in plan.actions])
        # The outputs that each action moves, by index.
        self._moved = [
            [i for i, output in enumerate(plan.outputs) if output.mix.get(action.name, 0.0)]
            for action in plan.actions
        ]

    def done(self, actions: Sequence[float], told: Sequence[float], has: Sequence[float]) -> Done:
        """What the outputs do.

        Args:
            actions: What was decided, one number for each action.
            told: The value that each output was told.
            has: The value that it has.
        """
        others = {i for i, (a, b) in enumerate(zip(told, has, strict=True)) if abs(a - b) > _STEP}
        if not others:
            return Done(tuple(actions), "")
        outputs = self._plan.outputs
        reasons = [
            f"Output {outputs[i].name}: {_WHY.get(outputs[i].driver, 'it does something else')}."
            for i in sorted(others)
        ]
        done = tuple(self._action(i, value, others, has) for i, value in enumerate(actions))
        return Done(done, " ".join(reasons))

    def _action(self, index: int, value: float, others: set[int], has: Sequence[float]) -> float:
        """One action: the furthest from rest that an output of its own does."""
        moved = self._moved[index]
        if others.isdisjoint(moved):
            return value
        action = self._plan.actions[index]
        if all(abs(has[i] - self._rest[i]) <= _STEP for i in moved):
            return action.rest
        found = [
            (has[i] - output.offset) / output.mix[action.name]
            for i in moved
            if sum(map(bool, (output := self._plan.outputs[i]).mix.values())) == 1
        ]
        return max(found, key=lambda v: abs(v - action.rest), default=value)
