"""The runs of a study: what each method does, in a process of its own.

Everything random in a run follows from its own seed.
"""

from __future__ import annotations

import math
import shutil
import time
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.errors import CorruptStudy, StudyError
from shapechanger.transfer.env_ref import EnvRef, SourceAdaptation
from shapechanger.transfer.executor import ReportSteps
from shapechanger.transfer.files import append_line, make_folder, read_json, write_json
from shapechanger.transfer.learners import Learner
from shapechanger.transfer.learners.cloning import DemonstrationFile
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    evaluation_envs,
    random_actions,
    zero_actions,
)
from shapechanger.transfer.learners.ppo import PpoLearner, use_one_thread
from shapechanger.transfer.learners.sac import CameraLearner
from shapechanger.transfer.learners.settings import PpoSettings, Settings
from shapechanger.transfer.plan import ADAPTED_SOURCE_ARMS, Plan, Run

__all__ = [
    "RunResult",
    "adapt_source",
    "learner_of",
    "load_result",
    "perform_run",
    "policy_path",
]

_RESULT: Final = "run.json"
_CURVE: Final = "curve.jsonl"
# The adapted source env of a run.
_SOURCE: Final = "source.json"


class RunResult(msgspec.Struct, frozen=True):
    """Result of a run.

    Attributes:
        run: The run.
        seed: Its seed.
        curve: Its evaluations, by steps.
        wall_s: Duration, s; the only number here that another machine would not reproduce.
    """

    run: Run
    seed: int
    curve: tuple[Evaluation, ...]
    wall_s: float


def learner_of(name: str, settings: Settings) -> Learner:
    """Return the learner that the settings belong to.

    Args:
        name: Name of the learner.
        settings: Its settings.
    """
    if isinstance(settings, PpoSettings):
        return PpoLearner(name, settings)
    return CameraLearner(name, settings)


def load_result(plan: Plan, study: Path, run: Run) -> RunResult | None:
    """Load the result of a run; None if it has not ended, or its policy is missing.

    Args:
        plan: Plan of the study.
        study: Folder of the study.
        run: The run.

    Raises:
        CorruptStudy: If its file cannot be read or belongs to another run.
    """
    path = run.folder(study) / _RESULT
    trains = run.kind in ("source", "scratch", "fine-tune", *ADAPTED_SOURCE_ARMS)
    if not path.exists() or (trains and not policy_path(plan, study, run).exists()):
        return None
    remedy = f"delete {path.parent} to repeat that run"
    result = read_json(path, RunResult, remedy)
    steps = [evaluation.steps for evaluation in result.curve]
    last = {"source": plan.source_steps, "scratch": plan.steps, "fine-tune": plan.steps}
    complete = bool(steps) and steps[0] == 0 and steps[-1] == last.get(run.kind, 0)
    if result.run != run or result.seed != plan.seed_of(run) or not complete:
        raise CorruptStudy(f"{path} does not hold the result of {run.name}: {remedy}.")
    return result


def perform_run(plan: Plan, run: Run, study: str, given: Path | None, report: ReportSteps) -> None:
    """Perform a run from its start; results of an earlier attempt are deleted.

    Args:
        plan: Plan of the study.
        run: The run.
        study: Folder of the study.
        given: File of the given source policy; None if the study trains its own.
        report: Called with the steps done.

    Raises:
        OutputError: If its files cannot be written.
        StudyError: If the training diverges.
    """
    use_one_thread()
    folder = run.folder(Path(study))
    shutil.rmtree(folder, ignore_errors=True)
    make_folder(folder)
    began = time.monotonic()
    curve: list[Evaluation] = []

    def on_evaluation(evaluation: Evaluation) -> None:
        if run.kind != "source":
            evaluation.value(plan.measure)  # A reward term that the env lacks is refused here.
        if not math.isfinite(evaluation.mean_return):
            raise StudyError(
                f"{run.name} diverged: its return after {evaluation.steps} steps is "
                f"{evaluation.mean_return}. Try a smaller learning rate or a milder body."
            )
        curve.append(evaluation)
        append_line(folder / _CURVE, evaluation)

    learner = learner_of(plan.learner, plan.settings)
    target = plan.target_of(run)

    def source_policy() -> object:
        if given is not None:
            return learner.load(given)
        return learner.load(policy_path(plan, Path(study), Run("source", run.index)))

    if run.kind in ("random", "zero-action"):
        on_evaluation(_evaluate_unskilled(plan, run))
    elif run.kind == "zero-shot":
        on_evaluation(learner.evaluate(target, source_policy(), plan.body_map))
    else:
        in_source = run.kind == "source" or run.kind in ADAPTED_SOURCE_ARMS
        env, shown = (plan.task.source, run) if in_source else (target, Run("scratch", run.index))
        if run.kind in ADAPTED_SOURCE_ARMS:
            env = adapt_source(plan, run)
            write_json(folder / _SOURCE, env)
        tunes = run.kind == "fine-tune"
        policy = learner.train(
            env,
            plan.source_steps if in_source else plan.steps,
            plan.seed_of(run),
            # Scratch and fine-tune share demonstrations: they differ only in where they start.
            demonstrations=DemonstrationFile(
                Path(study, "demonstrations", f"{shown.name}.npz"), plan.seed_of(shown)
            ),
            start=source_policy() if tunes else None,
            body_map=plan.body_map if tunes else None,
            only_last=in_source,
            # The curve of an adapted-source run is its evaluation on the target.
            on_evaluation=_ignore if run.kind in ADAPTED_SOURCE_ARMS else on_evaluation,
            on_steps=report,
        )
        learner.save(policy, policy_path(plan, Path(study), run))
        if run.kind in ADAPTED_SOURCE_ARMS:
            on_evaluation(learner.evaluate(target, policy, plan.body_map))
    result = RunResult(run, plan.seed_of(run), tuple(curve), time.monotonic() - began)
    write_json(folder / _RESULT, result)


def adapt_source(plan: Plan, run: Run) -> EnvRef:
    """Return the source of a run, randomised or identified; identification moves the target.

    Args:
        plan: Plan of the study.
        run: The run.

    Raises:
        StudyError: If the target cannot adapt its source.
    """
    made = plan.target_of(run).make()
    try:
        target = made.unwrapped
        if not isinstance(target, SourceAdaptation):
            raise StudyError(f"{plan.task.target} cannot adapt {plan.task.source} to itself.")
        if run.kind == "randomised":
            more = target.randomised_source()
        else:
            more = target.identified_source(plan.seed_of(run))
    finally:
        made.close()
    return plan.task.source.having(more)


def _evaluate_unskilled(plan: Plan, run: Run) -> Evaluation:
    """Evaluate random actions, or the action zero, in the target."""
    envs = evaluation_envs(plan.target_of(run), plan.settings)
    try:
        # Each run draws its own actions, from starts of its own.
        seed = plan.seed_of(run)
        draw = random_actions if run.kind == "random" else zero_actions
        return evaluate(
            draw(envs[0].action_space, seed), envs, seed, episodes=plan.settings.eval_episodes
        )
    finally:
        for env in envs:
            env.close()


def _ignore(evaluation: Evaluation) -> None:
    pass


def policy_path(plan: Plan, study: Path, run: Run) -> Path:
    """Return the policy file of a run.

    Args:
        plan: Plan of the study.
        study: Folder of the study.
        run: The run.
    """
    is_ppo = isinstance(plan.settings, PpoSettings)
    return run.folder(study) / ("policy.safetensors" if is_ppo else "policy.zip")
