"""Learners: settings, training, evaluation and stored policies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from shapechanger.contract.env_ref import EnvRef, EnvTraits
from shapechanger.identity import Identity

if TYPE_CHECKING:
    from shapechanger.transfer.body_map import BodyMap
    from shapechanger.transfer.learners.evaluation import Evaluation

__all__ = ["DemonstrationFile", "Learner", "PolicyOrigin", "ignore"]


def ignore(evaluation: Evaluation) -> None:
    """Discard an evaluation: given as `on_evaluation`, none is needed along the way."""
    del evaluation


class DemonstrationFile(NamedTuple):
    """File of demonstrations, shared by the runs that learn from them.

    Attributes:
        path: The file.
        seed: Seed of the recording.
    """

    path: Path
    seed: int


class PolicyOrigin(NamedTuple):
    """Origin of a stored policy.

    Attributes:
        env: The env that it was trained in.
        steps: Training steps; demonstrated steps for a clone.
        identity: Version of the env and of the learner, as in the policy's card.
    """

    env: EnvRef
    steps: int
    identity: dict[str, Identity]


class Learner(Protocol):
    """A learner as the methods of a study use it; its policies are of its own type."""

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env that it cannot learn in.

        Args:
            env: The env.
            traits: Its traits.

        Raises:
            StudyError: If it lacks something.
            SpaceMismatch: If its spaces do not fit its layouts.
        """
        ...

    def train(
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        demonstrations: DemonstrationFile,
        start: Any = None,
        body_map: BodyMap | None = None,
        only_last: bool = False,
        callback: Any = None,
        rehearsal: Any = None,
        on_evaluation: Callable[[Evaluation], None],
        on_steps: Callable[[int], None],
    ) -> Any:
        """Train a policy.

        Args:
            env: The env.
            steps: Budget, in steps.
            seed: Seed of the training.
            demonstrations: File of the demonstrations, for learners that need some.
            start: A source policy to start from; None for a new policy.
            body_map: Map between the bodies of `start` and `env`.
            only_last: Whether only the final evaluation is needed.
            callback: A callback of Stable-Baselines3 for the training; None for none.
            rehearsal: Demonstrations that `start` was cloned from, to mix in; None for none.
            on_evaluation: Called with each evaluation; `ignore` where none is needed.
            on_steps: Called with the number of steps done.

        Raises:
            StudyError: If a callback or a rehearsal is given to a learner that takes none, or the
                training diverges.
        """
        ...

    def evaluate(self, env: EnvRef, policy: Any, body_map: BodyMap) -> Evaluation:
        """Evaluate a source policy in another env without training it.

        Args:
            env: The env.
            policy: The policy.
            body_map: Map between the two bodies.
        """
        ...

    def load(self, path: Path) -> Any:
        """Load a policy."""
        ...

    def save(self, policy: Any, path: Path) -> None:
        """Write a policy to a file.

        Args:
            policy: The policy.
            path: The file.
        """
        ...

    def origin(self, path: Path) -> PolicyOrigin:
        """Read where a stored policy comes from.

        Raises:
            StudyError: If another kind of learner trained it.
        """
        ...
