"""What happens in the process of one run; everything random in it comes from the run's own seed."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.errors import CorruptStudy, StudyError
from shapechanger.transfer.body_map import MappedEnv
from shapechanger.transfer.by_camera import learn_by_camera
from shapechanger.transfer.cloning import Recording, evaluate_clone, load_clone
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.evaluation import (
    Evaluation,
    evaluate,
    evaluation_envs,
    random_actions,
)
from shapechanger.transfer.executor import Report
from shapechanger.transfer.files import append_line, make_folder, read_json, write_json
from shapechanger.transfer.likeness import likened_source
from shapechanger.transfer.plan import LIKENED, Plan, Run
from shapechanger.transfer.policy_file import TrainedPolicy, load_policy, save_policy
from shapechanger.transfer.settings import CloningSettings, LearnerSettings, SacSettings
from shapechanger.transfer.training import EVALUATION_SEED, train, use_one_thread

__all__ = ["RunResult", "finished", "perform"]

_RESULT: Final = "run.json"
_CURVE: Final = "curve.jsonl"
_POLICY: Final = "policy.zip"
# The env of a policy that was learned in a source made more like the target.
_SOURCE: Final = "source.json"


class RunResult(msgspec.Struct, frozen=True):
    """What a run has come to.

    Attributes:
        run: Which run.
        seed: Its seed.
        curve: Its evaluations, by steps.
        wall_s: How long it took, s; the only number here that another machine would not repeat.
    """

    run: Run
    seed: int
    curve: tuple[Evaluation, ...]
    wall_s: float


def finished(plan: Plan, study: Path, run: Run) -> RunResult | None:
    """The result of a run; None if it has not ended, or its policy is no longer there.

    Raises:
        CorruptStudy: If its file cannot be read, or is not that of this run.
    """
    path = run.folder(study) / _RESULT
    trains = run.kind in ("source", "scratch", "fine-tune", *LIKENED)
    if not path.exists() or (trains and not policy_path(study, run).exists()):
        return None
    remedy = f"delete {path.parent} to do that run again"
    result = read_json(path, RunResult, remedy)
    steps = [evaluation.steps for evaluation in result.curve]
    last = {"source": plan.source_steps, "scratch": plan.steps, "fine-tune": plan.steps}
    whole = bool(steps) and steps[0] == 0 and steps[-1] == last.get(run.kind, 0)
    if result.run != run or result.seed != plan.seed_of(run) or not whole:
        raise CorruptStudy(f"{path} does not hold the result of {run.name}: {remedy}.")
    return result


def policy_path(study: Path, run: Run) -> Path:
    """Where a run keeps its policy."""
    return run.folder(study) / _POLICY


def perform(plan: Plan, run: Run, study: str, source_policy: str, report: Report) -> None:
    """Do one run from its beginning, whatever an earlier try has left.

    Args:
        plan: The plan of the study.
        run: Which run.
        study: The study's folder.
        source_policy: File of the policy that was brought along; empty if there is none.
        report: Called with the steps done.

    Raises:
        OutputError: If its files cannot be written.
    """
    use_one_thread()
    folder = run.folder(Path(study))
    shutil.rmtree(folder, ignore_errors=True)
    make_folder(folder)
    began = time.monotonic()
    curve: list[Evaluation] = []

    def on_evaluation(evaluation: Evaluation) -> None:
        if not math.isfinite(evaluation.mean_return):
            raise StudyError(
                f"{run.name} diverged: its return after {evaluation.steps} steps is "
                f"{evaluation.mean_return}. Try a smaller learning rate or a milder body."
            )
        curve.append(evaluation)
        append_line(folder / _CURVE, evaluation)

    source_path = Path(source_policy or policy_path(Path(study), Run("source", run.index)))
    if not isinstance(plan.settings, LearnerSettings) and run.kind != "random":
        _drive(plan, plan.settings, run, Path(study), source_path, on_evaluation, report)
    elif run.kind in ("source", "scratch", "fine-tune"):
        start = load_policy(source_path) if run.kind == "fine-tune" else None
        policy = _train(plan, run, start, on_evaluation, report)
        save_policy(policy, folder / _POLICY)
    elif run.kind in LIKENED:
        source = likened_source(plan, run)
        write_json(folder / _SOURCE, source)
        policy = _train_in(plan, source, run, report)
        save_policy(policy, folder / _POLICY)
        on_evaluation(_evaluate_unchanged(plan, run, policy))
    elif run.kind == "random":
        on_evaluation(_evaluate_random(plan, run))
    else:
        on_evaluation(_evaluate_unchanged(plan, run, load_policy(source_path)))
    result = RunResult(run, plan.seed_of(run), tuple(curve), time.monotonic() - began)
    write_json(folder / _RESULT, result)


def _drive(
    plan: Plan,
    settings: CloningSettings | SacSettings,
    run: Run,
    study: Path,
    source_path: Path,
    on_evaluation: Callable[[Evaluation], None],
    report: Report,
) -> None:
    """Learn to drive by camera in the source or in the target, or see what that is worth."""
    if run.kind == "zero-shot":
        on_evaluation(evaluate_clone(plan.target_of(run), load_clone(source_path), settings))
        return
    of_source = run.kind == "source"
    # The same demonstrations for each arm: the arms differ in what they begin with.
    shown = Run("source" if of_source else "scratch", run.index)
    policy = learn_by_camera(
        plan.task.source if of_source else plan.target_of(run),
        settings,
        plan.source_steps if of_source else plan.steps,
        plan.seed_of(run),
        demonstrations=Recording(
            study / "demonstrations" / f"{shown.name}.npz", plan.seed_of(shown)
        ),
        start=load_clone(source_path) if run.kind == "fine-tune" else None,
        # Of a source policy only its beginning and its end are of interest.
        only_last=of_source,
        on_evaluation=on_evaluation,
        on_steps=report,
    )
    policy.save(policy_path(study, run))


def _train(
    plan: Plan,
    run: Run,
    source: TrainedPolicy | None,
    on_evaluation: Callable[[Evaluation], None],
    report: Report,
) -> TrainedPolicy:
    """Learn in the source, or in the target: from nothing, or from a source policy."""
    of_source = run.kind == "source"
    if not isinstance(plan.settings, LearnerSettings):
        raise StudyError(f"{plan.learner} does not learn by trying.")
    return train(
        plan.task.source if of_source else plan.target_of(run),
        plan.learner,
        plan.settings,
        plan.source_steps if of_source else plan.steps,
        plan.seed_of(run),
        on_evaluation=on_evaluation,
        on_steps=report,
        source=source,
        body_map=plan.body_map if source is not None else None,
    )


def _evaluate_random(plan: Plan, run: Run) -> Evaluation:
    """What actions drawn at random are worth in the target."""
    envs = evaluation_envs(plan.target_of(run), plan.settings)
    try:
        # Each run draws its own actions, from starts of its own.
        seed = plan.seed_of(run)
        actions = random_actions(envs[0].action_space, seed)
        return evaluate(actions, envs, seed, episodes=plan.settings.eval_episodes)
    finally:
        for env in envs:
            env.close()


def _train_in(plan: Plan, source: EnvRef, run: Run, report: Report) -> TrainedPolicy:
    """Learn in a source that was made more like the target."""
    if not isinstance(plan.settings, LearnerSettings):
        raise StudyError(f"{plan.learner} does not learn by trying.")
    return train(
        source,
        plan.learner,
        plan.settings,
        plan.source_steps,
        plan.seed_of(run),
        on_evaluation=lambda evaluation: None,
        on_steps=report,
    )


def _evaluate_unchanged(plan: Plan, run: Run, source: TrainedPolicy) -> Evaluation:
    """What a source policy is worth in the target, made to look like the source by the map."""
    envs = [
        MappedEnv(env, plan.body_map) for env in evaluation_envs(plan.target_of(run), plan.settings)
    ]
    try:
        return evaluate(source.act, envs, EVALUATION_SEED, episodes=plan.settings.eval_episodes)
    finally:
        for env in envs:
            env.close()
