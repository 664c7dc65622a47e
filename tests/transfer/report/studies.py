"""Synthetic studies, whose curves are drawn from a seed."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.metrics.curves import LearningCurves, Reference
from shapechanger.transfer.metrics.measures import Summary, summarise
from shapechanger.transfer.plan import ARMS, Plan, Run, TransferTask
from shapechanger.transfer.runs import RunResult
from shapechanger.transfer.study import Study
from tests.transfer.studies import TINY

STEPS = np.linspace(0, 10_240, 11)

SETTINGS = msgspec.structs.replace(TINY, n_envs=4, n_steps=64, steps=10_240, eval_every=1024)


def rising(
    start: float, end: float, half: float, seeds: int = 5, noise: float = 20.0, seed: int = 0
) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    way = 1.0 - 0.5 ** (STEPS / half)
    return start + (end - start) * way + rng.normal(0.0, noise, (seeds, STEPS.size))


def body_map() -> BodyMap:
    source = ("torso/z", "leg_1/angle", "tail/angle")
    target = ("torso/z", "leg_1/angle", "leg_2/angle")
    return BodyMap.between(
        Layout(tuple(Feature(name, "rad") for name in source)),
        Layout(tuple(Feature(name, "rad") for name in target)),
        Layout((Feature("leg_1/motor", "1", -1.0, 1.0), Feature("tail/motor", "1", -1.0, 1.0))),
        Layout((Feature("leg_1/motor", "1", -1.0, 1.0), Feature("leg_2/motor", "1", -1.0, 1.0))),
        rules={"leg_2/motor": "copy leg_1/motor"},
    )


def results(kind: str, returns: NDArray[np.float64], terms: Sequence[str] = ()) -> list[RunResult]:
    return [
        RunResult(
            Run(kind, index),
            seed=1000 + index,
            curve=tuple(
                Evaluation(
                    int(steps),
                    float(value),
                    mean_length=100.0,
                    terms={name: float(value) / len(terms) for name in terms},
                )
                for steps, value in zip(STEPS[: row.size], row, strict=True)
            ),
            wall_s=12.5,
        )
        for index, row in enumerate(returns)
    ]


def make_study(
    *,
    arms: tuple[str, ...] = ARMS,
    source_steps: int = 2048,
    given: bool = False,
    terms: Sequence[str] = (),
    source: EnvRef = EnvRef("shapechanger/Ant-v1"),  # noqa: B008 - frozen.
    target: EnvRef = EnvRef("shapechanger/BigAnt-v1"),  # noqa: B008 - frozen.
    command: str = "shapechanger transfer Ant BigAnt --seeds 5",
    shift: str = "pole: length 0.6 m -> 1.2 m (x2)",
    **curves: NDArray[np.float64],
) -> Study:
    """Return a study in which transfer helps, unless other curves are given by kind."""
    own = {kind.replace("_", "-"): rows for kind, rows in curves.items()}
    seeds = len(own.setdefault("scratch", rising(0.0, 1000.0, 3000.0)))
    drawn: dict[str, NDArray[np.float64]] = {
        "source": rising(0.0, 1000.0, 2500.0, seeds, seed=1),
        "random": np.linspace(5.0, 15.0, seeds)[:, np.newaxis],
        "zero-shot": np.linspace(350.0, 450.0, seeds)[:, np.newaxis],
        "fine-tune": rising(400.0, 1000.0, 1000.0, seeds, seed=2),
        **own,
    }
    drawn["zero-action"] = drawn["random"][:1]
    drawn["frozen-trunk"] = drawn["fine-tune"]
    wanted: list[str] = [*([] if given else ["source"]), "random", "zero-action", *arms]
    plan = Plan(
        task=TransferTask(source, target),
        body_map=body_map(),
        learner="ppo-balance",
        settings=SETTINGS,
        steps=10_240,
        source_steps=source_steps,
        seeds=seeds,
        arms=arms,
        seed=7,
        source_policy="ab" * 32 if given else "",
        versions={"shapechanger": "0.1.0", "numpy": "2.4.0"},
        identity={},
    )
    return Study(
        plan=plan,
        command=command,
        machine="Linux x86_64",
        shift=shift,
        runs=tuple(run for kind in wanted for run in results(kind, drawn[kind], terms)),
        source_return=() if given else tuple(float(row[-1]) for row in drawn["source"]),
        summaries=_summaries(plan, drawn),
    )


def _summaries(plan: Plan, drawn: dict[str, NDArray[np.float64]]) -> dict[str, Summary]:
    scratch = LearningCurves(STEPS, drawn["scratch"])
    ends = {arm: float(drawn[arm][:, -plan.last_k :].mean()) for arm in plan.arms}
    floors = {"random actions": float(drawn["random"].mean())}
    reference = Reference.of(floors, ends)
    return {
        arm: summarise(
            scratch,
            LearningCurves(STEPS[: drawn[arm].shape[1]], drawn[arm]),
            reference,
            source_steps=plan.source_steps,
            rng=np.random.default_rng(plan.seed),
            last_k=plan.last_k,
        )
        for arm in plan.arms
        if arm != "scratch"
    }
