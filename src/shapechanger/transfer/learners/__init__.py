"""Base classes of learners and of their settings.

A learner, of Shapechanger or of another package, has two classes: its settings, registered as an
entry point in the group `shapechanger.learners`, and the `Learner` that the settings name.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, NamedTuple, TypeVar

import msgspec

from shapechanger.contract.env_ref import EnvRef, EnvTraits
from shapechanger.errors import StudyError
from shapechanger.policy import PolicyCard
from shapechanger.registry import LEARNERS
from shapechanger.transfer.learners.evaluation import evaluation_envs

if TYPE_CHECKING:
    import gymnasium as gym

    from shapechanger.transfer.body_map import BodyMap
    from shapechanger.transfer.learners.evaluation import Evaluation

Takes = Literal[
    "trial", "on-policy", "off-policy", "callback", "demonstrations", "many bodies", "device"
]
"""Abilities and requirements of learners: training by steps in an env ("trial"), each step used
once ("on-policy") or kept in a replay buffer ("off-policy"); callbacks of Stable-Baselines3;
demonstrations; many bodies at once; worlds on a device."""


def ignore(_: Evaluation) -> None:
    """Discard an evaluation; as `on_evaluation`, it skips evaluations during training."""


class LearnerSettings:
    """Base class of the settings of learners, which are also structs of msgspec with a tag.

    The tag is the name of the learner's kind, which files store as `type`.

    Attributes:
        takes: Abilities and requirements of the learner.
        learner: Class of the learner, as `module:class`.
        packages: Packages that results depend on, in addition to the packages of every study.
        steps: Default env steps of a training.
        source_steps: Default env steps of a source policy; 0 for half as many as on the target.
        eval_every: Steps between two evaluations.
        eval_episodes: Episodes of an evaluation.
        last_k: Number of final evaluations that count as the end of a run.
        episode_limit: Steps after which an evaluation episode is truncated; None for the env's own
            limit.
    """

    __slots__ = ()

    takes: ClassVar[frozenset[Takes]]
    learner: ClassVar[str]
    packages: ClassVar[tuple[str, ...]] = ()
    steps: int
    source_steps: int
    eval_every: int
    eval_episodes: int
    last_k: int
    episode_limit: int | None

    @classmethod
    def from_builtins(cls, value: Any) -> LearnerSettings:
        """Read settings from a table with their kind as `type`; ValueError if they are wrong."""
        table: dict[str, Any] = msgspec.convert(value, dict[str, Any])
        return msgspec.convert(table, LEARNERS.load(str(table.get("type", ""))))

    def whole_updates(self, steps: int) -> int:
        """Round `steps` up to whole updates."""
        raise NotImplementedError

    def for_budget(self, steps: int) -> LearnerSettings:
        """Return the settings for a shorter budget of `steps`."""
        raise NotImplementedError

    def rhythm(self) -> str:
        """Return the end of a sentence about the evaluations, such as "every 10 steps."."""
        return f"every {self.eval_every:,} steps."

    def require_budget(self, steps: int, which: str = "") -> None:
        """Raise StudyError for a budget, "target" or "source", of less than `eval_every` steps."""
        if steps < self.eval_every:
            budget = f"{steps} {which} steps" if which else f"{steps} steps"
            raise StudyError(
                f"A budget of {budget} is too small, because policies are evaluated every "
                f"{self.eval_every} steps: give at least {self.eval_every} steps."
            )


class SharedFile(NamedTuple):
    """File that several runs of a study share, such as demonstrations, and the seed of its data."""

    path: Path
    seed: int


_Settings = TypeVar("_Settings", bound=LearnerSettings, covariant=True)


class Learner(Generic[_Settings]):
    """Base class of learners; each has its own type of policy.

    Attributes:
        name: Name of the learner, for the cards of its policies.
        settings: Settings of the learner.
        threads: Number of threads that step the envs, None for one per core. It does not change
            results. The default is 1, because a study already runs one training per core.
        tensorboard: Folder of TensorBoard's logs; None for no logs.
    """

    threads: int | None = 1
    tensorboard: Path | None = None

    def __init__(self, name: str, settings: _Settings) -> None:  # pyright: ignore[reportGeneralTypeIssues]
        self.name = name
        self.settings = settings

    @property
    def device(self) -> str:
        """The device that trains: "CPU", or the name of a GPU."""
        return "CPU"

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Raise StudyError or SpaceMismatch for an env that the learner cannot train in."""
        raise NotImplementedError

    def train(
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        start: Any = None,
        body_map: BodyMap | None = None,
        on_evaluation: Callable[[Evaluation], None] = ignore,
        on_steps: Callable[[int], None] = lambda steps: None,
    ) -> Any:
        """Train a policy.

        Subclasses may have more arguments, such as `callback` if `takes` contains "callback".

        Args:
            env: The env.
            steps: Budget, in steps.
            seed: Seed of the training.
            start: A source policy to start from; None for a new policy.
            body_map: Map between the bodies of `start` and `env`.
            on_evaluation: Called with each evaluation; `ignore` to skip evaluations.
            on_steps: Called with the number of steps done.
        """
        raise NotImplementedError

    def evaluation_envs(self, env: EnvRef) -> list[gym.Env[Any, Any]]:
        """Make the envs of an evaluation: one for each episode, or the only possible instance."""
        return evaluation_envs(env, self.settings.eval_episodes, self.settings.episode_limit)

    def evaluate(self, env: EnvRef, policy: Any, body_map: BodyMap) -> Evaluation:
        """Evaluate a source policy in another env, through a body map, without training it."""
        raise NotImplementedError

    def load(self, path: Path) -> Any:
        """Load a policy."""
        raise NotImplementedError

    def origin(self, path: Path) -> PolicyCard:
        """Read the card of a source policy; PolicyError if the learner cannot start from it."""
        raise NotImplementedError
