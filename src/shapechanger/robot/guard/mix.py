"""From the actions of a robot to the values of its outputs."""

from __future__ import annotations

from collections.abc import Sequence

from shapechanger.robot.guard.plan import GuardPlan

__all__ = ["output_values"]


def output_values(plan: GuardPlan, actions: Sequence[float]) -> tuple[float, ...]:
    """The value of each output, -1 to 1: its offset plus the weighted sum of the actions, clipped.

    Args:
        plan: The robot.
        actions: One number for each of its actions, in order.

    Raises:
        ValueError: If these are not as many numbers as the robot has actions.
    """
    if len(actions) != len(plan.actions):
        names = ", ".join(action.name for action in plan.actions)
        raise ValueError(
            f"{plan.name} has {len(plan.actions)} actions ({names}), got {len(actions)} numbers."
        )
    named = {action.name: value for action, value in zip(plan.actions, actions, strict=True)}
    return tuple(
        max(-1.0, min(1.0, output.offset + sum(w * named[a] for a, w in output.mix.items())))
        for output in plan.outputs
    )
