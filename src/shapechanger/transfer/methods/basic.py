"""The arms that every pair of bodies can be compared by, and variants of them.

None of them needs more of the learner than its interface.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import Any, Final

import msgspec
import numpy as np

from shapechanger.contract.env_ref import BodyDraw, EnvRef, layouts_of
from shapechanger.errors import StudyError
from shapechanger.layout import Layout
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.body_map.rules import Copy, MapEntry
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

    A few seconds of a target show little of its world, and a clone that learns from them alone
    forgets the rest. The share of the source in each batch is `rehearsal` of the learner's
    `CloneSettings`.
    """

    name = "rehearsal"
    needs = (("demonstrations", "a learner that clones demonstrations"),)
    paper = "A. Robins, Catastrophic Forgetting, Rehearsal and Pseudorehearsal, Conn. Sci., 1995"

    def learn(self, run: MethodRun) -> Any:
        """Train on both, starting from the source policy."""
        rehearsed = (run.source, run.source_steps, run.shared("source"))
        return run.fine_tune(rehearsed=rehearsed)


class ShuffledMap(Method):
    """Fine-tune through a body map with exchanged entries: a control of what the map contributes.

    A gain that remains does not depend on which inputs and outputs correspond.
    """

    name = "shuffled-map"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune(body_map=shuffle(run.body_map, np.random.default_rng(run.seed)))


def shuffle(body_map: BodyMap, rng: np.random.Generator) -> BodyMap:
    """Return a body map with the same rules, each at another entry."""
    return msgspec.structs.replace(
        body_map,
        observation=_shuffled(body_map.observation, body_map.source_observation, rng),
        action=_shuffled(body_map.action, body_map.target_action, rng),
    )


def _shuffled(
    entries: Sequence[MapEntry], layout: Layout, rng: np.random.Generator
) -> tuple[MapEntry, ...]:
    """Exchange the rules that copy features of the same shape; the others stay."""
    places: dict[tuple[int, ...], list[int]] = {}
    for i, entry in enumerate(entries):
        if isinstance(entry.rule, Copy):
            places.setdefault(layout[entry.feature].shape, []).append(i)
    result = list(entries)
    for exchangeable in places.values():
        order: list[int] = rng.permutation(exchangeable).tolist()
        for place, taken in zip(exchangeable, order, strict=True):
            result[place] = MapEntry(entries[place].feature, entries[taken].rule, "shuffled")
    return tuple(result)


BODIES: Final = 32
"""Bodies that the policy learns in before the target."""


class Generalist(Method):
    """Learn in bodies drawn from the source's family, then in the target with the same weights.

    The evaluation before the first target step shows the generalist in a body that it has
    never had.
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


# Share of the target steps that is spent on the bodies in between.
_ON_THE_WAY: Final = 0.5


class Evolution(Method):
    """Fine-tune on one body after another, each a little more like the target.

    Half of the target steps are spent on bodies between source and target, one for each evaluation
    of the learning curve, and count as target steps. REvolveR chooses the next body by how well the
    policy does; here the steps are equal.
    """

    name = "evolution"
    needs = (("trial", "a learner of Stable-Baselines3"),)
    paper = "X. Liu, D. Pathak and K. M. Kitani, REvolveR, ICML 2022"
    one_family = True

    def learn(self, run: MethodRun) -> Any:
        """Train along the path, and then on the target."""
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
    """Return envs whose bodies lie at equal distances between two others."""
    with closing(source.make()) as first, closing(target.make()) as last:
        start: Any = first.unwrapped
        end: Any = last.unwrapped
        families = {getattr(body, "family_name", "") for body in (start, end)}
        if len(families) > 1 or "" in families:
            raise StudyError(f"{source} and {target} are not of one family of bodies.")
        shares = (k / (count + 1) for k in range(1, count + 1))
        return [target.having(start.arguments_towards(end, share)) for share in shares]


def _map_between(one: EnvRef, other: EnvRef, run: MethodRun) -> BodyMap:
    """The study's map if the layouts change as from source to target, else a map by names."""
    with closing(one.make()) as before, closing(other.make()) as after:
        (seen, acted), (sees, acts) = layouts_of(before), layouts_of(after)
    if (seen, acted) == (sees, acts):
        return BodyMap.identity(seen, acted)
    if (seen, sees, acted, acts) == run.body_map.layouts:
        return run.body_map
    return BodyMap.between(seen, sees, acted, acts)
