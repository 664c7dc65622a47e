"""Transfer methods: what the arms of a study do with the source.

A method is a small class with a name. Those that come with Shapechanger are listed here by module,
so that naming one imports only that one. Others are found in three ways: by `register` in a module
that is already imported, by an entry point of the group `shapechanger.methods`, or by a name such
as `my_package:warm-start`, which imports `my_package` first, as Gymnasium's ids do.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError, UnknownName
from shapechanger.transfer.learners import DemonstrationFile, ignore

if TYPE_CHECKING:
    from shapechanger.contract.env_ref import EnvTraits
    from shapechanger.transfer.body_map import BodyMap
    from shapechanger.transfer.learners import Learner
    from shapechanger.transfer.learners.evaluation import Evaluation
    from shapechanger.transfer.learners.settings import Settings
    from shapechanger.transfer.plan import Plan, Run

__all__ = ["Method", "MethodRun", "load_method", "method_names", "register"]

_GROUP: Final = "shapechanger.methods"
_HERE: Final = "shapechanger.transfer.methods"
# In the order in which reports list them.
_SHIPPED: Final = {
    "scratch": f"{_HERE}.basic:Scratch",
    "zero-shot": f"{_HERE}.basic:ZeroShot",
    "fine-tune": f"{_HERE}.basic:FineTune",
    "frozen-trunk": f"{_HERE}.frozen_trunk:FrozenTrunk",
    "rehearsal": f"{_HERE}.rehearsal:Rehearsal",
    "kickstart": f"{_HERE}.kickstart:Kickstart",
    "evolution": f"{_HERE}.evolution:Evolution",
    "prefilled-replay": f"{_HERE}.replay:PrefilledReplay",
    "off-dynamics": f"{_HERE}.replay:OffDynamics",
    "shuffled-map": f"{_HERE}.shuffled_map:ShuffledMap",
    "randomised": f"{_HERE}.adapted_source:Randomised",
    "identified": f"{_HERE}.adapted_source:Identified",
    "generalist": f"{_HERE}.generalist:Generalist",
}


class MethodRun:
    """One run of a method: the bodies, the budget, and how to train and to evaluate.

    Attributes:
        source: The source env.
        target: The target env.
        body_map: Map between their layouts.
        learner: The learner.
        settings: Its settings.
        steps: Target steps that may be used, a multiple of an update.
        source_steps: Source steps that a policy of the method's own may be trained for.
        seed: Seed of the run; everything random follows from it.
        folder: Folder of the run, for files of the method's own.
        report: Records an evaluation on the target. Those of a method that learns on the target are
            at the same steps as those of scratch.

    Args:
        plan: The plan of the study.
        run: The run.
        study: Folder of the study.
        learner: The learner.
        given: File of the given source policy; None if the study trains its own.
        report: See the attribute.
        on_steps: Called with the number of steps done in all trainings of this run.
    """

    def __init__(
        self,
        plan: Plan,
        run: Run,
        study: Path,
        learner: Learner,
        *,
        given: Path | None,
        report: Callable[[Evaluation], None],
        on_steps: Callable[[int], None],
    ) -> None:
        self.source = plan.task.source
        self.target = plan.target_of(run)
        self.body_map = plan.body_map
        self.learner = learner
        self.settings = plan.settings
        self.steps = plan.steps
        self.source_steps = plan.source_steps_of(run.kind)
        self.seed = plan.seed_of(run)
        self.folder = run.folder(study)
        self.report = report
        self._plan = plan
        self._run = run
        self._study = study
        self._given = given
        self._on_steps = on_steps
        self._done = 0

    def source_policy(self) -> Any:
        """Load the source policy of this run's seed."""
        trained = msgspec.structs.replace(self._run, kind="source").policy_file(self._study)
        return self.learner.load(self._given or trained)

    def train(
        self,
        env: EnvRef,
        steps: int,
        *,
        start: Any = None,
        body_map: BodyMap | None = None,
        callback: Any = None,
        rehearsal: Any = None,
        on_evaluation: Callable[[Evaluation], None] = ignore,
    ) -> Any:
        """Train a policy with the study's learner.

        Args:
            env: The env to train in.
            steps: Its steps.
            start: A policy of another body to start from; None for a new one.
            body_map: Map from that body to that of `env`.
            callback: A callback of Stable-Baselines3 for the training; learners that are not of
                Stable-Baselines3 refuse one.
            rehearsal: Demonstrations that `start` was cloned from, to mix in; learners that do not
                clone refuse them.
            on_evaluation: Called with each evaluation in `env`.
        """
        before = self._done
        # All arms share the demonstrations of a target: they differ only in where they start.
        kind = "scratch" if env == self.target else self._run.kind
        policy = self.learner.train(
            env,
            steps,
            self.seed,
            demonstrations=self._demonstrations(kind),
            start=start,
            body_map=body_map,
            only_last=env != self.target,
            callback=callback,
            rehearsal=rehearsal,
            on_evaluation=on_evaluation,
            on_steps=lambda now: self._on_steps(before + now),
        )
        self._done += steps
        return policy

    def saved_policy(self) -> Any:
        """Load the policy that an earlier attempt of this run has saved; None without one."""
        file = self._run.policy_file(self._study)
        return self.learner.load(file) if file.exists() else None

    def save(self, policy: Any) -> None:
        """Save the policy of this run, so that a failure from here on does not cost its training.

        Args:
            policy: The policy.
        """
        part = f"method {self._run.kind}"
        if part in self._plan.identity:  # The method is the user's own.
            own = {part: self._plan.identity[part]}
            policy = policy.described(identity={**policy.card.identity, **own})
        self.learner.save(policy, self._run.policy_file(self._study))

    def source_demonstrations(self) -> DemonstrationFile:
        """Return the file of the demonstrations that the source policy is cloned from."""
        return self._demonstrations("source")

    def _demonstrations(self, kind: str) -> DemonstrationFile:
        run = msgspec.structs.replace(self._run, kind=kind)
        path = self._study / "demonstrations" / f"{run.name}.npz"
        return DemonstrationFile(path, self._plan.seed_of(run))

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
        paper: Where it comes from.
        uses_source_policy: Whether it starts from the source policy that the study trains.
        uses_source: Whether it has cost source steps, which count in total steps.
        trains: Whether it trains a policy, which `learn` returns.
        learns_on_target: Whether it learns on the target, so that it has a learning curve there.
    """

    name: ClassVar[str]
    paper: ClassVar[str] = ""
    uses_source_policy: ClassVar[bool] = True
    uses_source: ClassVar[bool] = True
    trains: ClassVar[bool] = True
    learns_on_target: ClassVar[bool] = True

    def require(self, source: EnvTraits, target: EnvTraits, settings: Settings) -> None:
        """Refuse a study that the method cannot be an arm of; by default none.

        Args:
            source: Traits of the source.
            target: Traits of the target.
            settings: Settings of the learner.

        Raises:
            StudyError: With the reason.
        """

    def _lacks(self, needed: str) -> StudyError:
        """Return the error for a study without what the method needs."""
        return StudyError(f"{self.name} needs {needed}: leave this arm out.")

    def learn(self, run: MethodRun) -> Any:
        """Run the method once, and return its policy; None if it trains none.

        Args:
            run: The run.
        """
        raise NotImplementedError


_registered: dict[str, type[Method]] = {}


def register(method: type[Method]) -> type[Method]:
    """Register a method under its name; may be used as a decorator.

    Args:
        method: The class.

    Raises:
        StudyError: If the name is empty, that of a kind of run, or taken.
    """
    name: str = getattr(method, "name", "")
    if not name or not name.replace("-", "").replace("_", "").isalnum():
        raise StudyError(
            f"A method's name is made of letters, digits, - and _, and {method.__name__}'s is "
            f"{name!r}."
        )
    taken = name in ("source", "random", "zero-action", *_SHIPPED)
    other = _registered.get(name)
    # A worker process may import the same class again under another module's name.
    if taken or (other is not None and other.__qualname__ != method.__qualname__):
        raise StudyError(
            f"There is already a method {name!r}: give {method.__name__} another name."
        )
    _registered[name] = method
    return method


def method_names() -> tuple[str, ...]:
    """Return the names of all methods that are shipped, installed or registered."""
    installed = (point.name for point in entry_points(group=_GROUP))
    return tuple(dict.fromkeys([*_SHIPPED, *installed, *_registered]))


def load_method(name: str) -> Method:
    """Return a method by its name.

    Args:
        name: Its name, or `module:name` to import a module first.

    Raises:
        UnknownName: If there is no such method or module.
        StudyError: If a method that is installed cannot be loaded.
    """
    module, _, own = name.rpartition(":")
    if module:
        try:
            import_module(module)
        except ModuleNotFoundError as error:
            raise UnknownName("method", name, method_names()) from error
    if own in _SHIPPED:
        home, _, attribute = _SHIPPED[own].partition(":")
        return getattr(import_module(home), attribute)()
    if own not in _registered:
        for point in entry_points(group=_GROUP, name=own):
            loaded: Any = point.load()
            if not (isinstance(loaded, type) and issubclass(loaded, Method)):
                raise StudyError(
                    f"The entry point {own} of {_GROUP} is {loaded!r}, not a subclass of Method."
                )
            return loaded()
        raise UnknownName("method", name, method_names())
    return _registered[own]()
