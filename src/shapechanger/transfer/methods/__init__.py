"""Transfer methods: how the arms of a study use the source.

A method is a small class with a name. Its file is imported only if the method is used.
Other packages add methods in three ways: by `register` in a module that is already imported, by an
entry point of the group `shapechanger.methods`, or by a name such as `my_package:warm-start`, which
imports `my_package` first, as ids of Gymnasium do.
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
    """One run of a method: the envs, the budget, and functions to train and to evaluate.

    Attributes:
        steps: Target steps that may be used, a multiple of the steps of an update.
        source_steps: Source steps of the policy that the method starts from or trains itself.
        seed: Seed of the run, from which all random numbers must derive.
        folder: Folder of the run, for files of the method.
        source_file: File of the source policy of this run's seed, or of the given source policy.
        policy_file: File of the policy of this run.
        shared: Returns the file that runs of a kind share, such as "source" or "scratch".
        kind: Name of the method, or "source" for the training of the source policy.
        identity: Identity of a custom method, for the card of its policy; empty for shipped ones.
        report: Records an evaluation on the target. Evaluations of a method that learns on the
            target must be at the same steps as the evaluations of scratch.
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
        """Load the source policy of this run, see `source_file`."""
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
        """Train a policy in an env with the study's learner, see `Learner.train`.

        `more` are arguments of the learners that the method `needs`, such as `callback`.
        """
        before = self._done
        if "demonstrations" in self.settings.takes:
            # All arms share the demonstrations of a target.
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
        """Train on the target from a policy, whose weights are transplanted.

        The default is the source policy of this run, with the study's map. `more` are arguments of
        `train`.
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
        """Load the policy that an earlier attempt of this run saved; None if there is no file."""
        return self.learner.load(self.policy_file) if self.policy_file.exists() else None

    def save(self, policy: Any) -> None:
        """Save the policy of this run, so that a later failure does not lose its training."""
        if self.identity and hasattr(policy, "carded"):  # The identity is stored in the card.
            policy = policy.carded(identity={**policy.card.identity, **self.identity})
        policy.save(self.policy_file)

    def evaluate(self, policy: Any, body_map: BodyMap | None = None) -> Evaluation:
        """Evaluate a policy on the target, through this map or the study's, without training."""
        return self.learner.evaluate(self.target, policy, body_map or self.body_map)


class Method:
    """A transfer method; subclass it and `register` the subclass.

    Attributes:
        name: Name of the method, which `--arms` takes.
        paper: The publication that describes the method.
        uses_source_policy: Whether the method starts from the source policy of the study.
        uses_source: Whether the method needs source steps, which count as total steps.
        trains: Whether the method trains a policy, which `learn` returns.
        learns_on_target: Whether the method trains on the target and has a learning curve there.
        needs: Required entries of the learner's `takes`, each with a description of such learners.
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
        """Raise StudyError for a study in which the method cannot be an arm."""
        for takes, text in self.needs:
            if takes not in settings.takes:
                raise self._lacks(text)
        if self.one_family and not (source.family and source.family == target.family):
            raise self._lacks("two bodies of one family, such as two ants")

    def _lacks(self, needed: str) -> StudyError:
        return StudyError(f"{self.name} needs {needed}: leave this arm out.")

    def learn(self, run: MethodRun) -> Any:
        """Run the method once, and return its policy; None if the method does not train."""
        raise NotImplementedError


def register(method: type[Method]) -> type[Method]:
    """Register a method under its name; may be used as a decorator."""
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
