"""Train reference policies of each env from scratch, and measure its floor: scores without skill.

Policies and curves are kept in `results/references`, and finished trainings are not repeated. A
source policy of the suite of ants with the same budget is copied instead of trained. `ONLY` names
envs, and `SEEDS` limits the trainings of each; finished trainings beyond that limit still count.
The values and the best policy of each env are written into the package.
"""

from __future__ import annotations

import os
import shutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import numpy as np

import shapechanger
from benchmarks.row import Row, asked
from shapechanger.contract.env_ref import EnvRef, measures_of
from shapechanger.envs.catalogue import default_learner
from shapechanger.files import read_json, write_atomic, write_json
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners.evaluation import (
    EVALUATION_SEED,
    Evaluation,
    evaluate,
    random_actions,
    zero_actions,
)
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import Sb3Settings
from shapechanger.transfer.references import FOLDER, EnvReference, load_references
from shapechanger.transfer.runs import RunResult, learner_of

RESULTS: Final = Path("results", "references")
COMMAND: Final = "python -m benchmarks.run references"
# Final evaluations that are averaged, and episodes for floor and policy.
LAST: Final = 3
EPISODES: Final = 20


class Target(NamedTuple):
    """Training budget and target of an env.

    Attributes:
        steps: Env steps.
        measure: Name of the measure.
        wanted: Value that a reference policy should reach; None for no target.
        seeds: Number of trainings.
    """

    steps: int
    measure: str
    wanted: float | None
    seeds: int


TARGETS: Final = {
    "InvertedPendulum": Target(24_576, "return", 1000.0, 10),
    "SmallInvertedPendulum": Target(49_152, "return", 1000.0, 10),
    "BigInvertedPendulum": Target(24_576, "return", 1000.0, 10),
    "InvertedDoublePendulum": Target(524_288, "return", 9100.0, 3),
    "HalfCheetah": Target(1_572_864, "return", 5000.0, 3),
    "Hopper": Target(1_048_576, "return", 2500.0, 3),
    "Walker2d": Target(1_048_576, "return", 2500.0, 3),
    "Swimmer": Target(1_048_576, "return", 300.0, 3),
    "Humanoid": Target(524_288, "return", None, 1),
    "Ant": Target(2_097_152, "forward speed", 3.0, 3),
    "AmputatedAnt": Target(1_048_576, "forward speed", 2.0, 3),
    "BigAnt": Target(1_048_576, "forward speed", 2.0, 3),
    "ExtendedAnt": Target(3_145_728, "forward speed", 2.0, 3),
}


def references() -> list[Row]:
    """Train the missing policies and write the shipped files."""
    names = asked("env", TARGETS)
    most = int(os.environ.get("SEEDS", "10"))
    wanted = [(name, seed) for name in names for seed in range(_seeds(name, most))]
    earlier = [name for name, seed in wanted if (RESULTS / f"{name}-{seed}.json").exists()]
    RESULTS.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        curves = list(pool.map(_trained, *zip(*wanted, strict=True)))
    found = dict(load_references())
    rows: list[Row] = []
    for name in names:
        of_env = [curve for (one, _), curve in zip(wanted, curves, strict=True) if one == name]
        rows.append(_write(name, of_env, found, earlier.count(name)))
    ordered = {_env(name).id: found[_env(name).id] for name in TARGETS if _env(name).id in found}
    write_atomic(
        FOLDER / "references.json",
        msgspec.json.format(msgspec.json.encode(ordered), indent=1) + b"\n",
    )
    load_references.cache_clear()
    return rows


def _seeds(name: str, most: int) -> int:
    """Return the number of trainings of an env: the requested number, or all finished if more."""
    done = 0
    while (RESULTS / f"{name}-{done}.json").exists():
        done += 1
    return max(done, min(most, TARGETS[name].seeds))


def _env(name: str) -> EnvRef:
    return EnvRef(f"shapechanger/{name}-v1")


def _trained(name: str, seed: int) -> tuple[Evaluation, ...]:
    """Return the curve of a training; train if it does not exist."""
    place = RESULTS / f"{name}-{seed}.json"
    if place.exists():
        return read_json(place, tuple[Evaluation, ...], f"delete {place}")
    if _taken_from_atlas(name, seed, place):
        return _trained(name, seed)
    use_one_thread()
    env = _env(name)
    learner = default_learner(env)
    settings = learner_settings(learner)
    assert isinstance(settings, Sb3Settings)
    curve: list[Evaluation] = []
    policy = Sb3Learner(learner, settings).train(
        env, TARGETS[name].steps, seed, on_evaluation=curve.append
    )
    save_policy(policy.carded(command=COMMAND), place.with_suffix(".safetensors"))
    write_json(place, tuple(curve))
    return tuple(curve)


def _taken_from_atlas(name: str, seed: int, place: Path) -> bool:
    """Copy a source of the suite of ants if its budget is the same; return whether one exists."""
    for run in Path("results", "ants").glob(f"{name}-to-*/runs/source-{seed}"):
        policy = run / "policy.safetensors"
        if policy.exists() and load_policy(policy).card.steps == TARGETS[name].steps:
            shutil.copyfile(policy, place.with_suffix(".safetensors"))
            result = read_json(run / "run.json", RunResult, f"delete {run}")
            write_json(place, result.curve)
            return True
    return False


def _write(
    name: str,
    curves: list[tuple[Evaluation, ...]],
    found: dict[str, EnvReference],
    earlier: int,
) -> Row:
    """Copy the best policy of an env into the package, with its values.

    The row states how many trainings were finished by earlier runs, with other `SEEDS` perhaps.
    """
    env, target = _env(name), TARGETS[name]
    floor, measures = _floor(env)
    ends = {
        measure: tuple(
            float(np.mean([one.value(measure) for one in curve[-LAST:]])) for curve in curves
        )
        for measure in measures
    }
    seeds = tuple(
        load_policy(RESULTS / f"{name}-{i}.safetensors").card.seed for i in range(len(curves))
    )
    best = int(np.argmax([curve[-1].value(target.measure) for curve in curves]))
    reference = EnvReference(
        learner=default_learner(env),
        steps=curves[0][-1].steps,
        seeds=seeds,
        version=shapechanger.__version__,
        command=COMMAND,
        floor=floor,
        ends=ends,
        policy_seed=seeds[best],
    )
    found[env.id] = reference
    shutil.copyfile(RESULTS / f"{name}-{best}.safetensors", FOLDER / f"{name}-v1.safetensors")
    values = ends[target.measure]
    last = _played(env, FOLDER / f"{name}-v1.safetensors").value(target.measure)
    return Row(
        f"reference of {name}: {target.measure} of the policy that ships, "
        f"{reference.learner}, {reference.steps:,} steps",
        f"{last:.4g}",
        f"{EPISODES} episodes; {len(values)} seed{'s' * (len(values) > 1)}, of which {earlier} "
        "trained in earlier runs, end at " + ", ".join(f"{value:.4g}" for value in values),
        "none: whatever comes out" if target.wanted is None else f"at least {target.wanted:g}",
        target.wanted is None or last >= target.wanted,
    )


def _played(env: EnvRef, policy: Path) -> Evaluation:
    """Evaluate a policy over as many episodes as the floor."""
    learner = default_learner(env)
    envs = learner_of(learner, learner_settings(learner)).evaluation_envs(env)
    try:
        act = load_policy(policy).act
        return evaluate(act, envs, EVALUATION_SEED, episodes=EPISODES)
    finally:
        for one in envs:
            one.close()


def _floor(env: EnvRef) -> tuple[dict[str, dict[str, float]], list[str]]:
    """Return the values of each measure without skill, and the names of the measures."""
    learner = default_learner(env)
    envs = learner_of(learner, learner_settings(learner)).evaluation_envs(env)
    try:
        measures = [measure.name for measure in measures_of(envs[0])]
        floor: dict[str, dict[str, float]] = {}
        space = envs[0].action_space
        acts = {"random actions": random_actions(space, 0), "the zero action": zero_actions(space)}
        for label, act in acts.items():
            found = evaluate(act, envs, EVALUATION_SEED, episodes=EPISODES)
            floor[label] = {measure: found.value(measure) for measure in measures}
        return floor, measures
    finally:
        for one in envs:
            one.close()
