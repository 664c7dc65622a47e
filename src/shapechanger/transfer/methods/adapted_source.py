"""Learn in a source that is adapted to the target, and act on the target without learning there."""

from __future__ import annotations

from abc import abstractmethod
from contextlib import closing
from typing import Any

from shapechanger.contract.env_ref import EnvTraits
from shapechanger.files import write_json
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.methods import Method, MethodRun


class AdaptedSource(Method):
    """Train in a source adapted to the target; base class of the two below."""

    uses_source_policy = False
    learns_on_target = False

    def learn(self, run: MethodRun) -> Any:
        """Adapt the source, train in it, and evaluate on the target.

        A rig may fail in the evaluation; the repeated run evaluates the policy that was trained.
        """
        policy = run.saved_policy()
        if policy is None:
            with closing(run.source.make()) as source, closing(run.target.make()) as target:
                adapted = self.arguments(source.unwrapped, target.unwrapped, run.seed)
            env = run.source.having(adapted)
            write_json(run.folder / "source.json", env)
            policy = run.train(env, run.source_steps)
            run.save(policy)
        run.report(run.evaluate(policy))
        return policy

    @abstractmethod
    def arguments(self, source: Any, target: Any, seed: int) -> dict[str, Any]:
        """Return the arguments that make the source more like the target."""


class Randomised(AdaptedSource):
    """Learn in a source whose body is drawn again for each episode.

    A target may state the plausible range of its body, such as a finger. Otherwise, in a family of
    bodies, each body lies between the source and the target, both included.
    """

    name = "randomised"
    paper = "X. B. Peng and others, Sim-to-Real Transfer with Dynamics Randomization, ICRA 2018"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Require two bodies of one family and space, or a target that states its range."""
        del settings
        same_family = source.family and source.family == target.family
        if target.adapts_source or (same_family and source.same_layouts(target)):
            return
        raise self._lacks(
            "two bodies of one family with the same spaces, or a target that can adapt the source "
            "to itself, such as a finger"
        )

    def arguments(self, source: Any, target: Any, seed: int) -> dict[str, Any]:
        """Return the range of bodies."""
        del seed
        if hasattr(target, "randomised_source"):
            return target.randomised_source()
        return source.arguments_between(target)


class Identified(AdaptedSource):
    """Learn in a source whose parameters are identified from motions of the target."""

    name = "identified"
    paper = "J. Tan and others, Sim-to-Real: Learning Agile Locomotion, RSS 2018"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse a target that cannot adapt its source."""
        del source, settings
        if not target.adapts_source:
            raise self._lacks("a target that can adapt the source to itself, such as a finger")

    def arguments(self, source: Any, target: Any, seed: int) -> dict[str, Any]:
        """Move the target, and return the identified parameters."""
        del source
        return target.identified_source(seed)
