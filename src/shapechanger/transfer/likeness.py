"""Sources that are made more like the target, by what the target tells of itself."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from shapechanger.errors import StudyError
from shapechanger.transfer.env_ref import EnvRef, layouts_of
from shapechanger.transfer.plan import ARMS, EVERY_ARM, LIKENED, Arm, Plan, Run, TransferTask

__all__ = ["Likened", "arms_for", "likened_source", "require_likeness"]


@runtime_checkable
class Likened(Protocol):
    """A target that tells how its source becomes more like it."""

    def randomised_source(self) -> dict[str, Any]:
        """Arguments of the source with which each episode has another body that this may be."""
        ...

    def identified_source(self, seed: int) -> dict[str, Any]:
        """Arguments of the source with which it is what this was identified as.

        Args:
            seed: Of the motions that it is identified by.
        """
        ...


def likened_source(plan: Plan, run: Run) -> EnvRef:
    """The source of a run, randomised or identified; to identify it moves the target.

    Raises:
        StudyError: If the target tells nothing of the kind.
    """
    made = plan.target_of(run).make()
    try:
        target = made.unwrapped
        if not isinstance(target, Likened):
            raise StudyError(_nothing_told(plan.task))
        if run.kind == "randomised":
            more = target.randomised_source()
        else:
            more = target.identified_source(plan.seed_of(run))
    finally:
        made.close()
    return plan.task.source.having(more)


def arms_for(task: TransferTask) -> tuple[Arm, ...]:
    """What a pair of envs is compared by where nobody asks for other arms.

    A source that is made more like the target helps where both are the same task: where their
    layouts are the same.
    """
    source, target = task.source.make(), task.target.make()
    try:
        same = layouts_of(source) == layouts_of(target)
        return EVERY_ARM if same and isinstance(target.unwrapped, Likened) else ARMS
    finally:
        source.close()
        target.close()


def require_likeness(task: TransferTask, arms: tuple[Arm, ...], target: object) -> None:
    """Refuse arms that the target has nothing to offer for.

    Raises:
        StudyError: If there is one.
    """
    if set(arms) & set(LIKENED) and not isinstance(target, Likened):
        raise StudyError(_nothing_told(task))


def _nothing_told(task: TransferTask) -> str:
    return (
        f"{task.target} does not tell how {task.source} becomes more like it, so the arms "
        f"{' and '.join(LIKENED)} cannot be: leave them out."
    )
