"""A transfer study: what it found, and the way there, which can be cut off at any point."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np

import shapechanger
from shapechanger.errors import ForeignStudy, StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.env_ref import layouts_of
from shapechanger.transfer.executor import Executor, Job, OnProgress, Processes
from shapechanger.transfer.files import make_folder, read_json, write_json
from shapechanger.transfer.learners.ppo import require_budget
from shapechanger.transfer.learners.settings import CloningSettings, LearnerSettings, Settings
from shapechanger.transfer.methods import (
    RunResult,
    given_policy_steps,
    load_result,
    perform_run,
    require_source_adaptation,
)
from shapechanger.transfer.metrics import LearningCurves, Reference, Summary, summarise
from shapechanger.transfer.plan import ARMS, Arm, Plan, Run, RunKind, TransferTask

__all__ = [
    "PLAN_FILE",
    "STUDY_FILE",
    "Study",
    "is_folder_of",
    "make_plan",
    "run_study",
    "unfinished_runs",
]

PLAN_FILE: Final = "plan.json"
STUDY_FILE: Final = "study.json"

_LAST_K: Final = 3

# What the numbers depend on besides the plan.
_PACKAGES: Final = ("numpy", "scipy", "gymnasium", "mujoco", "torch", "stable-baselines3")


class Study(msgspec.Struct, frozen=True, kw_only=True):
    """What a study has found, with all that is needed to check it.

    Attributes:
        plan: What was done.
        command: The command that did it; empty if it was called from Python.
        machine: What it ran on.
        shift: The certificate of the shift, in words; empty if the envs publish none.
        runs: Every run with its learning curve.
        source_return: Mean return of the source policies in the source, one for each seed; empty
            if a policy was brought along.
        summaries: For each arm but scratch its measures.
    """

    plan: Plan
    command: str
    machine: str
    shift: str
    runs: tuple[RunResult, ...]
    source_return: tuple[float, ...]
    summaries: dict[Arm, Summary]

    def of(self, kind: RunKind) -> list[RunResult]:
        """The runs of one kind, by index."""
        return [result for result in self.runs if result.run.kind == kind]

    def curves(self, kind: RunKind) -> LearningCurves:
        """The learning curves of one kind of run, in units of return."""
        return _curves(self.of(kind))


def make_plan(
    task: TransferTask,
    learner: str,
    settings: Settings,
    *,
    seeds: int = 5,
    steps: int | None = None,
    source_steps: int | None = None,
    source_policy: Path | None = None,
    arms: Sequence[Arm] = ARMS,
    seed: int = 0,
    rules: Mapping[str, Any] | None = None,
    map_text: str = "",
    units: str = "same",
) -> Plan:
    """Plan a study.

    Args:
        task: Source and target.
        learner: Name of the learner.
        settings: Its settings.
        seeds: Runs of each arm, at least 2.
        steps: Target steps of a run; None for the learner's own number.
        source_steps: Source steps of a source policy; None for the learner's own number.
        source_policy: File of a policy to bring along in place of training one for each seed.
        arms: What to compare.
        seed: Number that the seeds of all runs are drawn from.
        rules: Rules of the body map for entries without a partner, as in `BodyMap.between`.
        map_text: The body map as TOML, in place of `rules` and `units`.
        units: "same" or "torque", as in `BodyMap.between`.

    Raises:
        UnknownName: If an env, an arm or a feature does not exist.
        MapError: If the spaces cannot be mapped.
        StudyError: If the budget or the number of seeds is too small, the policy that was brought
            along did not learn as the learner does, or nobody shows what the learner is to learn.
        CorruptStudy: If the file of that policy is missing, or holds none.
        SpaceMismatch: If that policy belongs to another body.
    """
    if not isinstance(settings, LearnerSettings):
        _require_demonstrators(task, learner)
    budget = settings.whole_updates(settings.steps if steps is None else steps)
    require_budget(settings.steps if steps is None else steps, settings)
    if source_steps is None:
        own = settings.source_steps if isinstance(settings, LearnerSettings) else 0
        source_steps = own or budget // 2
    source_budget = settings.whole_updates(source_steps)
    body_map, individual, exclusive = _looked_at(task, tuple(arms), rules, map_text, units)
    digest = ""
    if source_policy is not None:
        source_budget = given_policy_steps(source_policy, task.source, learner, settings)
        digest = _digest(source_policy)
    else:
        require_budget(source_budget, settings)
    return Plan(
        task=task,
        body_map=body_map,
        learner=learner,
        settings=settings,
        steps=budget,
        source_steps=source_budget,
        seeds=seeds,
        arms=tuple(arms),
        seed=seed,
        source_policy=digest,
        # Each evaluation of a clone is another clone, of another number of demonstrations.
        last_k=1 if isinstance(settings, CloningSettings) else _LAST_K,
        individual=individual,
        exclusive=exclusive,
        versions={
            "shapechanger": shapechanger.__version__,
            "python": platform.python_version(),
            **{name: version_of(name) for name in _PACKAGES},
        },
    )


def run_study(
    plan: Plan,
    out: Path,
    *,
    source_policy: Path | None = None,
    executor: Executor | None = None,
    on_progress: OnProgress = lambda name, steps, ended: None,
    command: str = "",
) -> Study:
    """Do what of a plan is not yet done in `out`, and say what it comes to.

    A run that was cut off starts again from its beginning, so a study that was killed ends with the
    same numbers as one that was not.

    Args:
        plan: What to do.
        out: The study's folder; made if it is not there.
        source_policy: The file that `plan.source_policy` is the digest of.
        executor: What runs the runs; None for processes on this machine.
        on_progress: Called with the name of a run, its steps so far and whether it has ended.
        command: The command that can be typed to repeat it.

    Raises:
        EmptyShift: If nothing changes between source and target.
        OutputError: If `out` cannot be written, now or later; what has ended is kept.
        ForeignStudy: If `out` holds another study, or something else.
        CorruptStudy: If a file in `out` cannot be read.
    """
    digest = _digest(source_policy) if source_policy is not None else ""
    if digest != plan.source_policy:
        raise StudyError("The source policy is not the one that this study was planned with.")
    shift = _shift(plan.task)
    claim_folder(plan, out)
    jobs = [
        Job(
            run.name,
            perform_run,
            (plan, run, str(out), str(source_policy or "")),
            after=_after(plan, run),
        )
        for run in unfinished_runs(plan, out)
    ]
    if jobs:
        (executor or Processes()).run(jobs, on_progress)
    results = [load_result(plan, out, run) for run in plan.runs()]
    study = _study(plan, [result for result in results if result is not None], command, shift)
    write_json(out / STUDY_FILE, study)
    return study


def unfinished_runs(plan: Plan, out: Path) -> tuple[Run, ...]:
    """The runs of a plan that have not ended in `out`.

    Raises:
        CorruptStudy: If the file of one that has cannot be read.
    """
    return tuple(run for run in plan.runs() if load_result(plan, out, run) is None)


def is_folder_of(plan: Plan, out: Path) -> bool:
    """Whether `out` is the folder of this study, done with as many seeds or with fewer.

    Raises:
        CorruptStudy: If the plan in it cannot be read.
    """
    if not (out / PLAN_FILE).exists():
        return False
    found = _plan_in(out)
    return found == plan or plan.grows(found)


def _plan_in(out: Path) -> Plan:
    remedy = "give another --out, or delete that folder to begin again; nothing was changed"
    return read_json(out / PLAN_FILE, Plan, remedy)


def _digest(policy: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(policy.read_bytes()).hexdigest()


def claim_folder(plan: Plan, out: Path) -> None:
    """Make `out` the folder of this study, or see that it already is.

    A study that was begun with fewer seeds goes on with more: no run depends on how many there are.

    Raises:
        OutputError: If it cannot be written.
        ForeignStudy: If it holds another study, or something else.
        CorruptStudy: If its plan cannot be read.
    """
    make_folder(out)
    path = out / PLAN_FILE
    if path.exists():
        found = _plan_in(out)
        if plan.grows(found):
            write_json(path, plan)
        elif found != plan:
            raise ForeignStudy(
                f"{out} holds another study, which differs in {plan.difference(found)}: give "
                "another --out, or delete that folder."
            )
        return
    if any(out.iterdir()):
        raise ForeignStudy(f"{out} holds other files and no study: give another --out.")
    write_json(path, plan)


def _looked_at(
    task: TransferTask,
    arms: tuple[Arm, ...],
    rules: Mapping[str, Any] | None,
    map_text: str,
    units: str,
) -> tuple[BodyMap, str, bool]:
    """The map between two envs' layouts, what tells one target from another, and who shares it."""
    source, target = task.source.make(), task.target.make()
    try:
        source_observation, source_action = layouts_of(source)
        target_observation, target_action = layouts_of(target)
        require_source_adaptation(task, arms, target.unwrapped)
        individual: str = getattr(target.unwrapped, "individual", "")
        exclusive: bool = getattr(target.unwrapped, "exclusive", False)
    finally:
        source.close()
        target.close()
    layouts = (source_observation, target_observation, source_action, target_action)
    if map_text:
        return BodyMap.from_toml(map_text, *layouts), individual, exclusive
    body_map = BodyMap.between(*layouts, rules=rules, units=cast("Any", units))
    return body_map, individual, exclusive


def _require_demonstrators(task: TransferTask, learner: str) -> None:
    """Refuse envs in which nobody shows how, for a learner that begins with that.

    Raises:
        StudyError: If one is such.
    """
    for env in (task.source, task.target):
        made = env.make()
        try:
            shows = hasattr(made.unwrapped, "demonstrator")
        finally:
            made.close()
        if not shows:
            raise StudyError(
                f"{env} has no demonstrator, and {learner} learns from one: give another --learner."
            )


def _shift(task: TransferTask) -> str:
    """What changes between source and target, if the envs can tell.

    Raises:
        EmptyShift: If nothing does.
    """
    source, target = task.source.make(), task.target.make()
    try:
        certify = getattr(source.unwrapped, "certify_shift", None)
        return "" if certify is None else str(certify(source, target))
    finally:
        source.close()
        target.close()


def _after(plan: Plan, run: Run) -> tuple[str, ...]:
    """The runs that must have ended before this one."""
    needs_source = run.kind in ("zero-shot", "fine-tune") and not plan.source_policy
    return (Run("source", run.index).name,) if needs_source else ()


def _study(plan: Plan, results: list[RunResult], command: str, shift: str) -> Study:
    """What the results come to."""
    by_kind: dict[RunKind, list[RunResult]] = {}
    for result in results:
        by_kind.setdefault(result.run.kind, []).append(result)
    scratch = _curves(by_kind["scratch"])
    last_k = min(plan.last_k, scratch.n_evals)
    reference = Reference.of(scratch, _curves(by_kind["random"]).returns, last_k)
    summaries: dict[Arm, Summary] = {
        arm: summarise(
            scratch,
            _curves(by_kind[arm]),
            reference,
            source_steps=plan.source_steps,
            rng=np.random.default_rng(plan.seed),
            last_k=last_k,
        )
        for arm in plan.arms
        if arm != "scratch"
    }
    return Study(
        plan=plan,
        command=command,
        machine=f"{platform.system()} {platform.machine()}",
        shift=shift,
        runs=tuple(results),
        source_return=tuple(r.curve[-1].mean_return for r in by_kind.get("source", [])),
        summaries=summaries,
    )


def _curves(results: list[RunResult]) -> LearningCurves:
    """The curves of several runs."""
    steps = [float(evaluation.steps) for evaluation in results[0].curve]
    returns = [[evaluation.mean_return for evaluation in result.curve] for result in results]
    return LearningCurves(np.array(steps), np.array(returns))
