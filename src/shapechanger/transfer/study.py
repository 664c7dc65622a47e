"""Transfer studies: planning, running, resuming, and the result."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import msgspec
import numpy as np

from shapechanger.contract.env_ref import (
    RETURN,
    EnvRef,
    EnvTraits,
    Measure,
    certify_shift,
    env_traits,
    is_reward_term,
)
from shapechanger.errors import ForeignStudy, SpaceMismatch, StudyError, UnknownName
from shapechanger.files import make_folder, read_json, write_json
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.executor import Executor, Job, OnProgress, Processes
from shapechanger.transfer.identities import known, require_same_env, steady
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.settings import study_budgets
from shapechanger.transfer.methods import load_method
from shapechanger.transfer.metrics.curves import LearningCurves, Reference
from shapechanger.transfer.metrics.measures import Summary, summarise
from shapechanger.transfer.plan import (
    ARMS,
    NO_SKILL,
    PLAN_FILE,
    SOURCE,
    Plan,
    Run,
    TransferTask,
    read_plan,
)
from shapechanger.transfer.references import reference_of
from shapechanger.transfer.runs import (
    RunResult,
    changes_between,
    identities_of_code,
    learner_of,
    load_result,
    perform_run,
)

STUDY_FILE: Final = "study.json"

# Arms that adapt the source to the target, if the target supports them.
_ADAPTED: Final = ("randomised", "identified")
# Packages that the numbers depend on.
_PACKAGES: Final = ("numpy", "scipy", "gymnasium", "mujoco", "torch", "stable-baselines3")
_KEPT: Final = "give another --out, or delete that folder to start again; no file was changed"


class Study(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a study.

    Attributes:
        plan: Plan of the study.
        command: The command that ran the study; empty if it was called from Python.
        machine: Operating system and processor architecture of the machine.
        shift: The certificate of the shift as text; empty if the envs publish none.
        runs: Every run with its learning curve.
        source_return: Mean return of each source policy in the source, one for each seed; empty if
            the study trained none.
        summaries: Measures of transfer of each arm except scratch.
        looks: Numbers of seeds at which the result was computed, the present one last. With more
            than one, seeds were added after results had been computed.
    """

    plan: Plan
    command: str
    machine: str
    shift: str
    runs: tuple[RunResult, ...]
    source_return: tuple[float, ...]
    summaries: dict[str, Summary]
    looks: tuple[int, ...] = ()

    @property
    def headline_arm(self) -> str:
        """The arm to compare with scratch first: fine-tune, or one that learns, or the first."""
        if "fine-tune" in self.summaries:
            return "fine-tune"
        learning = (arm for arm in self.summaries if self.curves(arm).n_evals > 1)
        return next(learning, next(iter(self.summaries)))

    def of(self, kind: str) -> list[RunResult]:
        """Return the runs of one kind, by index."""
        return [result for result in self.runs if result.run.kind == kind]

    def curves(self, kind: str) -> LearningCurves:
        """Return the learning curves of one kind of run, in units of the measure."""
        results = self.of(kind)
        steps = [float(evaluation.steps) for evaluation in results[0].curve]
        values = [[e.value(self.plan.measure) for e in result.curve] for result in results]
        return LearningCurves(np.array(steps), np.array(values))


class TaskTraits(NamedTuple):
    """Properties of the two envs of a study.

    Attributes:
        source: Properties of the source.
        target: Properties of the target.
        shift: The certificate of the shift as text; empty if the envs publish none.
    """

    source: EnvTraits
    target: EnvTraits
    shift: str


def inspect_task(task: TransferTask) -> TaskTraits:
    """Make both envs of a task, and read their traits for a study.

    Raises:
        EmptyShift: If source and target do not differ.
    """
    with closing(task.source.make()) as source, closing(task.target.make()) as target:
        one, other = env_traits(source, task.source.id), env_traits(target, task.target.id)
        return TaskTraits(
            replace(one, identity=steady(task.source, one.identity)),
            replace(other, identity=steady(task.target, other.identity)),
            certify_shift(source, target),
        )


def default_arms(traits: TaskTraits) -> tuple[str, ...]:
    """Return the arms of a study that names none.

    The arms that adapt the source are included if the target supports them and both envs have equal
    layouts, so that they are the same task.
    """
    adapts = traits.target.adapts_source and traits.source.same_layouts(traits.target)
    return (*ARMS, *_ADAPTED) if adapts else ARMS


def make_plan(
    task: TransferTask,
    learner: str,
    settings: LearnerSettings,
    *,
    seeds: int = 5,
    steps: int | None = None,
    source_steps: int | None = None,
    source_policy: Path | None = None,
    arms: Sequence[str] = ARMS,
    seed: int = 0,
    rules: Mapping[str, Any] | None = None,
    map_text: str = "",
    units: str = "same",
    measure: str = "",
    traits: TaskTraits | None = None,
) -> Plan:
    """Plan a study.

    Args:
        task: Source and target.
        learner: Name of the learner.
        settings: Settings of the learner.
        seeds: Number of runs of each arm, at least 2.
        steps: Target steps of a run; None for the learner's default.
        source_steps: Source steps of a source policy; None for the learner's default. If a source
            policy is given, the steps of arms that train their own policy.
        source_policy: File of a given source policy; None to train one for each seed.
        arms: Names of the methods to compare.
        seed: The seed from which the seeds of all runs are drawn.
        rules: Rules of the body map, see `BodyMap.between`.
        map_text: The body map as TOML, instead of `rules` and `units`.
        units: "same", "torque" or "exact", see `BodyMap.between`.
        measure: Name of a measure of the target, of one of its reward terms, or "return"; empty
            for the target's default.
        traits: Result of `inspect_task` for the task; None to inspect it now.

    Raises:
        UnknownName: If an env, an arm, a measure or a feature does not exist.
        MapError: If the spaces cannot be mapped.
        StudyError: If the budget or the number of seeds is too small, or if the learner or an arm
            cannot be used with these envs.
        PolicyError: If the given policy is missing, corrupt, or of another kind of learner.
        SpaceMismatch: If the given policy was trained in another env, or a layout does not fit its
            space.
        ForeignStudy: If the source has changed since the given policy was trained.
        EmptyShift: If source and target do not differ; only without `traits`.
    """
    budget, source_budget = study_budgets(
        settings, steps, source_steps, is_given=source_policy is not None
    )
    if traits is None:
        traits = inspect_task(task)
    learns = learner_of(learner, settings)
    learns.require(task.source, traits.source)
    learns.require(task.target, traits.target)
    for arm in arms:
        load_method(arm).require(traits.source, traits.target, settings)
    measured = _measure(task.target, traits.target, measure)
    own_steps = 0 if source_steps is None or source_policy is None else source_steps
    digest = ""
    if source_policy is not None:
        origin = learns.origin(source_policy)
        if origin.env != task.source:
            raise SpaceMismatch(
                f"The given policy was trained in {origin.env}, and the source is {task.source}: "
                "name the env and the body of its training."
            )
        require_same_env(
            origin.identity,
            task.source,
            traits.source.identity,
            source_policy,
            "Train it again, or leave out the given policy to train one for each seed.",
        )
        if own_steps:
            methods = [load_method(arm) for arm in arms]
            if all(one.uses_source_policy or not one.uses_source for one in methods):
                raise StudyError(
                    "Source steps have no effect with a given source policy: no arm trains its "
                    "own policy there, as randomised and identified do."
                )
            own_steps = settings.whole_updates(own_steps)
        source_budget = origin.steps
        digest = hashlib.sha256(source_policy.read_bytes()).hexdigest()
    one, other = traits.source, traits.target
    seen = one.observation_layout, other.observation_layout
    layouts = (*seen, one.action_layout, other.action_layout)
    return Plan(
        task=task,
        body_map=(
            BodyMap.from_toml(map_text, *layouts)
            if map_text
            else BodyMap.between(*layouts, rules=rules, units=cast("Any", units))
        ),
        measure=measured.name,
        unit=measured.unit,
        learner=learner,
        settings=settings,
        steps=budget,
        source_steps=source_budget,
        own_steps=own_steps,
        seeds=seeds,
        arms=tuple(arms),
        seed=seed,
        source_policy=digest,
        last_k=settings.last_k,
        individual=traits.target.individual,
        exclusive=traits.target.exclusive,
        versions={
            "shapechanger": version_of("shapechanger"),
            "python": platform.python_version(),
            **{name: version_of(name) for name in (*_PACKAGES, *settings.packages)},
        },
        identity=known({"source": traits.source.identity, "target": traits.target.identity})
        | identities_of_code(settings, arms),
    )


def _measure(env: EnvRef, target: EnvTraits, name: str) -> Measure:
    """Return a measure or reward term of the target; a robot's reward terms are not checked."""
    known = {measure.name: measure for measure in target.measures}
    if not name or name in known:
        return known[name] if name else target.measures[0]
    if target.exclusive:
        terms = [name] if is_reward_term(name) else []
    else:
        with closing(env.make()) as made:
            made.reset(seed=0)
            terms = list(filter(is_reward_term, made.step(made.action_space.sample())[4]))
    if name not in terms:
        raise UnknownName("measure", name, (*known, *terms))
    return Measure(name, RETURN.unit)


def run_study(
    plan: Plan,
    out: Path,
    *,
    source_policy: Path | None = None,
    executor: Executor | None = None,
    on_progress: OnProgress = lambda name, steps, ended: None,
    command: str = "",
    traits: TaskTraits | None = None,
    looked: Sequence[int] = (),
) -> Study:
    """Perform the runs of a plan that are missing in `out`, and return the result.

    An interrupted run starts again, so an interrupted study ends with the same numbers as an
    uninterrupted one.

    Args:
        plan: The plan.
        out: Folder of the study; made if missing.
        source_policy: File of the given policy, whose digest must equal `plan.source_policy`.
        executor: Executor of the runs; None for processes on this machine.
        on_progress: Called with the name of a run, its steps so far and whether it has ended.
        command: The command that repeats the study.
        traits: Result of `inspect_task` for the task; None to inspect it now.
        looked: Numbers of seeds at which parts of this study were evaluated in other folders.

    Raises:
        EmptyShift: If source and target do not differ.
        OutputError: If `out` cannot be written; finished runs are kept.
        StudyError: If `source_policy` is not the planned one, or a result is missing in the end.
        ForeignStudy: If `out` contains another study or other files.
        CorruptStudy: If a file in `out` cannot be read.
        FailedRuns: If runs have failed; all runs that do not depend on them have ended.
    """
    digest = hashlib.sha256(source_policy.read_bytes()).hexdigest() if source_policy else ""
    if digest != plan.source_policy:
        raise StudyError("The source policy is not the policy that the plan names.")
    traits = inspect_task(plan.task) if traits is None else traits
    claim_folder(plan, out)
    jobs: list[Job] = []
    for run in unfinished_runs(plan, out):
        needs = run.kind in plan.arms and load_method(run.kind).uses_source_policy
        after = [Run(SOURCE, run.index).name] if needs and not plan.source_policy else []
        if plan.exclusive:
            # A robot must not move again after a run has failed.
            after += [job.name for job in jobs[-1:]]
        attempts = 1 if plan.exclusive else Job.attempts
        arguments = (plan, run, str(out), source_policy)
        jobs.append(Job(run.name, perform_run, arguments, tuple(after), attempts))
    if jobs:
        (executor or Processes()).run(jobs, on_progress)
    found = {run: load_result(plan, out, run) for run in plan.runs()}
    if missing := [run.name for run, result in found.items() if result is None]:
        raise StudyError(
            f"The results of {', '.join(missing)} are not in {out}: all nodes of a cluster must "
            "share this folder."
        )
    results = tuple(result for result in found.values() if result is not None)
    # Numbers of seeds at which this study has been evaluated, with the present one.
    looks = looks_in(out / STUDY_FILE)
    looks += tuple(sorted(set(looked) - {*looks, plan.seeds}))
    study = Study(
        plan=plan,
        command=command,
        machine=f"{platform.system()} {platform.machine()}",
        shift=traits.shift,
        runs=results,
        source_return=tuple(r.curve[-1].mean_return for r in results if r.run.kind == SOURCE),
        summaries={},
        looks=looks if looks[-1:] == (plan.seeds,) else (*looks, plan.seeds),
    )
    study = msgspec.structs.replace(study, summaries=_summaries(study))
    write_json(out / STUDY_FILE, study)
    return study


def looks_in(path: Path) -> tuple[int, ...]:
    """Return the numbers of seeds at which a study was evaluated; empty without a file."""
    return read_json(path, Study, f"delete {path}").looks if path.exists() else ()


def unfinished_runs(plan: Plan, out: Path) -> tuple[Run, ...]:
    """Return the runs of a plan that have not ended in `out`."""
    return tuple(run for run in plan.runs() if load_result(plan, out, run) is None)


def is_folder_of(plan: Plan, out: Path) -> bool:
    """Return whether `out` is the folder of this study, perhaps with fewer seeds or arms."""
    if not (out / PLAN_FILE).exists():
        return False
    found = read_plan(out, _KEPT)
    return found == plan or plan.extends(found)


def claim_folder(plan: Plan, out: Path) -> None:
    """Make `out` the folder of this study, or check that it already is.

    A study can be resumed with more seeds or arms, because the finished runs do not depend on them.
    """
    make_folder(out)
    path = out / PLAN_FILE
    if not path.exists():
        if any(out.iterdir()):
            raise ForeignStudy(f"{out} holds other files and no study: give another --out.")
        write_json(path, plan)
        return
    found = read_plan(out, _KEPT)
    if plan.extends(found):
        write_json(path, plan)
    elif found != plan:
        text = changes_between(found, plan) or f"it differs in {plan.difference(found)}"
        raise ForeignStudy(f"{out} holds another study ({text}): {_KEPT}.")


def _summaries(study: Study) -> dict[str, Summary]:
    plan = study.plan
    curves = {kind: study.curves(kind) for kind in (*NO_SKILL, *plan.arms)}
    scratch = curves["scratch"]
    last_k = min(plan.last_k, scratch.n_evals)
    shipped = reference_of(plan.task.target)
    end = None if shipped is None else shipped.end(plan.measure)
    reference = Reference.of(
        {
            "random actions": float(curves["random"].returns.mean()),
            "the zero action": float(curves["zero-action"].returns.mean()),
            "untrained policies": float(scratch.returns[:, 0].mean()),
        },
        {arm: float(curves[arm].returns[:, -last_k:].mean()) for arm in plan.arms},
        None if shipped is None or end is None else (shipped.text, end),
    )
    return {
        arm: summarise(
            scratch,
            curves[arm],
            reference,
            source_steps=plan.source_steps_of(arm) if load_method(arm).uses_source else 0,
            rng=np.random.default_rng(plan.seed),
            last_k=last_k,
        )
        for arm in plan.arms
        if arm != "scratch"
    }
