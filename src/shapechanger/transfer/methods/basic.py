"""Methods that only use the interface of learners, such as fine-tuning."""

from __future__ import annotations

from abc import abstractmethod
from contextlib import closing
from typing import Any, Final

import msgspec
import numpy as np

from shapechanger.contract.env_ref import BodyDraw, EnvRef, EnvTraits, layouts_of
from shapechanger.errors import StudyError
from shapechanger.files import write_json
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.body_map.rules import Copy, MapEntry
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.methods import Method, MethodRun


class Scratch(Method):
    """Learn the target from the start, without the source: the baseline."""

    name = "scratch"
    uses_source_policy = False
    uses_source = False

    def learn(self, run: MethodRun) -> Any:
        """Train on the target."""
        return run.train(run.target, run.steps, on_evaluation=run.report)


class ZeroShot(Method):
    """Act on the target with the source policy, through the body map, without learning."""

    name = "zero-shot"
    trains = False
    learns_on_target = False

    def learn(self, run: MethodRun) -> Any:
        """Evaluate the source policy on the target."""
        run.report(run.evaluate(run.source_policy()))


class FineTune(Method):
    """Learn the target from the source policy, whose weights are transplanted by the body map."""

    name = "fine-tune"
    paper = "M. E. Taylor and P. Stone, Transfer Learning for Reinforcement Learning Domains, 2009"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune()


class Rehearsal(Method):
    """Fine-tune on batches that mix the target's demonstrations with the source's.

    A few seconds of demonstrations show little of a target, and a clone that is trained on them
    alone forgets other situations. The share of the source in each batch is `rehearsal` of the
    learner's `CloneSettings`.
    """

    name = "rehearsal"
    needs = (("demonstrations", "a learner that clones demonstrations"),)
    paper = "A. Robins, Catastrophic Forgetting, Rehearsal and Pseudorehearsal, Conn. Sci., 1995"

    def learn(self, run: MethodRun) -> Any:
        """Train on demonstrations of source and target, starting from the source policy."""
        rehearsed = (run.source, run.source_steps, run.shared("source"))
        return run.fine_tune(rehearsed=rehearsed)


class ShuffledMap(Method):
    """Fine-tune through a body map with exchanged entries, to measure the map's contribution.

    If this arm still gains over scratch, the gain does not depend on a correct map.
    """

    name = "shuffled-map"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune(body_map=shuffle(run.body_map, np.random.default_rng(run.seed)))


def shuffle(body_map: BodyMap, rng: np.random.Generator) -> BodyMap:
    """Return a body map whose copies of features of equal shape are exchanged randomly.

    Other rules stay in place.
    """
    sides = (
        (body_map.observation, body_map.source_observation),
        (body_map.action, body_map.target_action),
    )
    shuffled: list[tuple[MapEntry, ...]] = []
    for entries, layout in sides:
        places: dict[tuple[int, ...], list[int]] = {}
        for i, entry in enumerate(entries):
            if isinstance(entry.rule, Copy):
                places.setdefault(layout[entry.feature].shape, []).append(i)
        result = list(entries)
        for exchangeable in places.values():
            order: list[int] = rng.permutation(exchangeable).tolist()
            for place, taken in zip(exchangeable, order, strict=True):
                result[place] = MapEntry(entries[place].feature, entries[taken].rule, "shuffled")
        shuffled.append(tuple(result))
    return msgspec.structs.replace(body_map, observation=shuffled[0], action=shuffled[1])


BODIES: Final = 32
"""Number of bodies that the policy is trained in before the target."""


class Generalist(Method):
    """Train in bodies drawn from the source's family, then in the target with the same weights.

    The evaluation before the first target step shows the policy in a body that is new to it.
    """

    name = "generalist"
    needs = (("many bodies", "a policy that fits many bodies: give --learner limbs or rsl-limbs"),)
    paper = "A. Gupta and others, MetaMorph: Learning Universal Controllers, ICLR 2022"
    uses_source_policy = False
    one_family = True

    def learn(self, run: MethodRun) -> Any:
        """Train on many bodies, then on the target."""
        many = run.source.having({"bodies": msgspec.to_builtins(BodyDraw(count=BODIES))})
        return run.fine_tune(start=run.train(many, run.source_steps))


# Share of the target steps that are spent on bodies between source and target.
_ON_THE_WAY: Final = 0.5


class Evolution(Method):
    """Fine-tune on one body after another, each a little more like the target.

    At most half of the target steps are spent on bodies between source and target, in each for the
    steps between two evaluations. REvolveR chooses the next body by the policy's performance; here
    the bodies are at equal distances.
    """

    name = "evolution"
    needs = (("trial", "a learner that trains by steps in an env"),)
    paper = "X. Liu, D. Pathak and K. M. Kitani, REvolveR, ICML 2022"
    one_family = True

    def learn(self, run: MethodRun) -> Any:
        """Train on the bodies between source and target, and then on the target."""
        stage = run.settings.whole_updates(run.settings.eval_every)
        n_stages = int(_ON_THE_WAY * run.steps) // stage
        path = bodies_between(run.source, run.target, n_stages)
        policy, env, onward = run.source_policy(), run.source, run.body_map
        run.report(run.evaluate(policy))
        for done, body in enumerate(path, 1):
            policy = run.train(body, stage, start=policy, body_map=_map_between(env, body, run))
            env, onward = body, _map_between(body, run.target, run)
            evaluation = run.evaluate(policy, onward)
            run.report(msgspec.structs.replace(evaluation, steps=done * stage))
        before = len(path) * stage

        def later(evaluation: Evaluation) -> None:
            if evaluation.steps > 0:
                run.report(msgspec.structs.replace(evaluation, steps=evaluation.steps + before))

        return run.train(
            run.target, run.steps - before, start=policy, body_map=onward, on_evaluation=later
        )


def bodies_between(source: EnvRef, target: EnvRef, count: int) -> list[EnvRef]:
    """Return envs with bodies at equal distances between two bodies of one family."""
    with closing(source.make()) as first, closing(target.make()) as last:
        start: Any = first.unwrapped
        end: Any = last.unwrapped
        families = {getattr(body, "family_name", "") for body in (start, end)}
        if len(families) > 1 or "" in families:
            raise StudyError(f"{source} and {target} must be bodies of one family.")
        shares = (k / (count + 1) for k in range(1, count + 1))
        return [target.having(start.arguments_towards(end, share)) for share in shares]


def _map_between(one: EnvRef, other: EnvRef, run: MethodRun) -> BodyMap:
    """Return the identity if layouts are equal, the study's map if it fits, or a map by names."""
    with closing(one.make()) as before, closing(other.make()) as after:
        (seen, acted), (sees, acts) = layouts_of(before), layouts_of(after)
    if (seen, acted) == (sees, acts):
        return BodyMap.identity(seen, acted)
    if (seen, sees, acted, acts) == run.body_map.layouts:
        return run.body_map
    return BodyMap.between(seen, sees, acted, acts)


class AdaptedSource(Method):
    """Train in a source that is adapted to the target; base class of two methods."""

    uses_source_policy = False
    learns_on_target = False

    def learn(self, run: MethodRun) -> Any:
        """Adapt the source, train in it, and evaluate on the target.

        If a robot fails in the evaluation, the repeated run evaluates the saved policy.
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

    A target such as a finger states the plausible range of its body. Otherwise each body lies
    between the source and the target, both included.
    """

    name = "randomised"
    paper = "X. B. Peng and others, Sim-to-Real Transfer with Dynamics Randomization, ICRA 2018"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Require bodies of one family with equal layouts, or a target that states its range."""
        same_family = source.family and source.family == target.family
        if target.adapts_source or (same_family and source.same_layouts(target)):
            return
        raise self._lacks(
            "two bodies of one family with the same spaces, or a target that can adapt the source "
            "to itself, such as a finger"
        )

    def arguments(self, source: Any, target: Any, seed: int) -> dict[str, Any]:
        """Return the range of bodies."""
        if hasattr(target, "randomised_source"):
            return target.randomised_source()
        return source.arguments_between(target)


class Identified(AdaptedSource):
    """Learn in a source whose parameters are identified from motions of the target."""

    name = "identified"
    paper = "J. Tan and others, Sim-to-Real: Learning Agile Locomotion, RSS 2018"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse a target that cannot adapt its source."""
        if not target.adapts_source:
            raise self._lacks("a target that can adapt the source to itself, such as a finger")

    def arguments(self, source: Any, target: Any, seed: int) -> dict[str, Any]:
        """Move the target, and return the identified parameters."""
        return target.identified_source(seed)
