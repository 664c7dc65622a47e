"""Fine-tune along a path of bodies from the source to the target."""

from __future__ import annotations

from contextlib import closing
from typing import Any, Final

import msgspec

from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.errors import StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.methods import Method, MethodRun

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
