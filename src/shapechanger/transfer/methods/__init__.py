"""Transfer methods: how the arms of a study use the source.

A method is a small class with a name, in one file. Naming one imports only that one. Others than
those that come with Shapechanger are found in three ways: by `register` in a module that is already
imported, by an entry point of the group `shapechanger.methods`, or by a name such as
`my_package:warm-start`, which imports `my_package` first, as Gymnasium's ids do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from shapechanger.contract.env_ref import EnvRef, EnvTraits
from shapechanger.errors import StudyError
from shapechanger.identity import Identity
from shapechanger.registry import METHODS
from shapechanger.transfer.learners import Learner, LearnerSettings, SharedFile, Takes, ignore

if TYPE_CHECKING:
    from shapechanger.transfer.body_map import BodyMap
    from shapechanger.transfer.learners.evaluation import Evaluation


@dataclass(kw_only=True)
class MethodRun:
    """One run of a method: the bodies, the budget, and how to train and to evaluate.

    Attributes:
        source: The source env.
        target: The target env.
        body_map: Map between their layouts.
        learner: The learner.
        steps: Target steps that may be used, a multiple of an update.
        source_steps: Source steps that a policy of the method's own may be trained for.
        seed: Seed of the run; everything random follows from it.
        folder: Folder of the run, for files of the method's own.
        source_file: File of the source policy of this run's seed, or of the given one.
        policy_file: File of the policy of this run.
        shared: Returns the shared file of a kind of run: "source" or "scratch".
        kind: The kind of the run.
        identity: Version of the method, if it is the user's own, for the card of its policy.
        report: Records an evaluation on the target. Evaluations of a method that learns on the
            target are at the same steps as the evaluations of scratch.
        on_steps: Called with the number of steps done in all trainings of this run.
    """

    source: EnvRef
    target: EnvRef
    body_map: BodyMap
    learner: Learner[Any]
    steps: int
    source_steps: int
    seed: int
    folder: Path
    source_file: Path
    policy_file: Path
    shared: Callable[[str], SharedFile]
    kind: str
    identity: dict[str, Identity]
    report: Callable[[Evaluation], None]
    on_steps: Callable[[int], None]
    _done: int = field(default=0, init=False)

    @property
    def settings(self) -> Any:
        """The settings of the learner."""
        return self.learner.settings

    def source_policy(self) -> Any:
        """Load the source policy of this run's seed."""
        return self.learner.load(self.source_file)

    def train(
        self,
        env: EnvRef,
        steps: int,
        *,
        start: Any = None,
        body_map: BodyMap | None = None,
        on_evaluation: Callable[[Evaluation], None] = ignore,
        **more: Any,
    ) -> Any:
        """Train a policy with the study's learner.

        Args:
            env: The env to train in.
            steps: Its steps.
            start: A policy of another body to start from; None for a new one.
            body_map: Map from that body to the body of `env`.
            on_evaluation: Called with each evaluation in `env`.
            **more: Arguments of learners that the method `needs`, such as `callback`.
        """
        before = self._done
        if "demonstrations" in self.settings.takes:
            # All arms share the demonstrations of a target: they differ only in where they start.
            shared = self.shared("scratch" if env == self.target else self.kind)
            more |= {"demonstrations": shared, "only_last": env != self.target}
        policy = self.learner.train(
            env,
            steps,
            self.seed,
            start=start,
            body_map=body_map,
            on_evaluation=on_evaluation,
            on_steps=lambda now: self.on_steps(before + now),
            **more,
        )
        self._done += steps
        return policy

    def fine_tune(self, *, start: Any = None, body_map: BodyMap | None = None, **more: Any) -> Any:
        """Train on the target from a policy of the source, whose weights are transplanted.

        Args:
            start: The policy; None for the source policy of this run's seed.
            body_map: Map from its body to the target's; None for the study's.
            **more: As of `train`.
        """
        return self.train(
            self.target,
            self.steps,
            start=self.source_policy() if start is None else start,
            body_map=body_map or self.body_map,
            on_evaluation=self.report,
            **more,
        )

    def saved_policy(self) -> Any:
        """Load the policy that an earlier attempt of this run has saved; None without one."""
        return self.learner.load(self.policy_file) if self.policy_file.exists() else None

    def save(self, policy: Any) -> None:
        """Save the policy of this run, so that a failure from here on does not cost its training.

        Args:
            policy: The policy.
        """
        if self.identity and hasattr(policy, "carded"):  # Only policies with a card have a version.
            policy = policy.carded(identity={**policy.card.identity, **self.identity})
        policy.save(self.policy_file)

    def evaluate(self, policy: Any, body_map: BodyMap | None = None) -> Evaluation:
        """Evaluate a policy on the target, without training it.

        Args:
            policy: The policy.
            body_map: Map from its body to the target's; the study's if not given.
        """
        return self.learner.evaluate(self.target, policy, body_map or self.body_map)


class Method:
    """A transfer method; subclass it and `register` the subclass.

    Attributes:
        name: Its name, as in `--arms`.
        paper: The publication that describes it.
        uses_source_policy: Whether it starts from the source policy that the study trains.
        uses_source: Whether it has cost source steps, which count in total steps.
        trains: Whether it trains a policy, which `learn` returns.
        learns_on_target: Whether it learns on the target, so that it has a learning curve there.
        needs: What the learner must have in `takes`, each with a description of such a learner.
        one_family: Whether source and target must be bodies of one family.
    """

    name: ClassVar[str] = ""
    paper: ClassVar[str] = ""
    uses_source_policy: ClassVar[bool] = True
    uses_source: ClassVar[bool] = True
    trains: ClassVar[bool] = True
    learns_on_target: ClassVar[bool] = True
    needs: ClassVar[tuple[tuple[Takes, str], ...]] = ()
    one_family: ClassVar[bool] = False

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse a study that the method cannot be an arm of.

        Args:
            source: Traits of the source.
            target: Traits of the target.
            settings: Settings of the learner.

        Raises:
            StudyError: With the reason.
        """
        for takes, text in self.needs:
            if takes not in settings.takes:
                raise self._lacks(text)
        if self.one_family and not (source.family and source.family == target.family):
            raise self._lacks("two bodies of one family, such as two ants")

    def _lacks(self, needed: str) -> StudyError:
        return StudyError(f"{self.name} needs {needed}: leave this arm out.")

    def learn(self, run: MethodRun) -> Any:
        """Run the method once, and return its policy; None if it trains none.

        Args:
            run: The run.
        """
        raise NotImplementedError


def register(method: type[Method]) -> type[Method]:
    """Register a method under its name; may be used as a decorator.

    Args:
        method: The class.

    Raises:
        StudyError: If the name is empty, taken, or the name of a kind of run.
    """
    if method.name in ("source", "random", "zero-action"):
        raise StudyError(
            f"There is already a method {method.name!r}: give {method.__name__} another name."
        )
    METHODS.register(method.name, method)
    return method


def load_method(name: str) -> Method:
    """Return the method of a name."""
    method: Any = METHODS.load(name)
    if not (isinstance(method, type) and issubclass(method, Method)):
        raise StudyError(f"The method {name} is {method!r}, not a subclass of Method.")
    return method()
