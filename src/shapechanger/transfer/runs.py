"""The runs of a study, each in a process of its own, and their results.

Everything random in a run follows from its own seed.
"""

from __future__ import annotations

import math
import shutil
import time
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.errors import CorruptStudy, StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.executor import ReportSteps
from shapechanger.transfer.files import append_line, make_folder, read_json, write_json
from shapechanger.transfer.learners import Learner
from shapechanger.transfer.learners.cloning import CloneLearner, DemonstrationFile
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    evaluation_envs,
    random_actions,
    zero_actions,
)
from shapechanger.transfer.learners.sb3 import OnEvaluation, Sb3Learner, use_one_thread
from shapechanger.transfer.learners.settings import Sb3Settings, Settings
from shapechanger.transfer.methods import MethodRun, load_method
from shapechanger.transfer.plan import NO_SKILL, SOURCE, Plan, Run

_RESULT: Final = "run.json"
_CURVE: Final = "curve.jsonl"


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
    if isinstance(settings, Sb3Settings):
        return Sb3Learner(name, settings)
    return CloneLearner(name, settings)


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
    if not path.exists() or (plan.trains(run.kind) and not policy_path(study, run).exists()):
        return None
    remedy = f"delete {path.parent} to repeat that run"
    result = read_json(path, RunResult, remedy)
    steps = [evaluation.steps for evaluation in result.curve]
    complete = bool(steps) and steps[0] == 0 and steps[-1] == plan.last_step_of(run.kind)
    if result.run != run or result.seed != plan.seed_of(run) or not complete:
        raise CorruptStudy(f"{path} does not hold the result of {run.name}: {remedy}.")
    return result


def last_evaluation(study: Path, run: Run) -> Evaluation | None:
    """Return the last evaluation of a run so far; None if there is none yet.

    Args:
        study: Folder of the study.
        run: The run.
    """
    path = run.folder(study) / _CURVE
    try:
        # The last line may be half-written.
        *_, last = (
            line for line in path.read_bytes().splitlines(keepends=True) if line[-1:] == b"\n"
        )
        return msgspec.json.decode(last, type=Evaluation)
    except (FileNotFoundError, ValueError, msgspec.MsgspecError):
        return None


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
        if run.kind != SOURCE:
            evaluation.value(plan.measure)  # A reward term that the env lacks is refused here.
        if not math.isfinite(evaluation.mean_return):
            raise StudyError(
                f"{run.name} diverged: its return after {evaluation.steps} steps is "
                f"{evaluation.mean_return}. Try a smaller learning rate or a milder body."
            )
        curve.append(evaluation)
        append_line(folder / _CURVE, evaluation)

    if run.kind in NO_SKILL:
        on_evaluation(_evaluate_unskilled(plan, run))
        policy = None
    else:
        context = _method_run(plan, run, Path(study), given, on_evaluation, report)
        if run.kind == SOURCE:
            policy = context.train(
                context.source, context.source_steps, on_evaluation=context.report
            )
        else:
            policy = load_method(run.kind).learn(context)
        if policy is not None:
            context.learner.save(policy, policy_path(Path(study), run))
    result = RunResult(run, plan.seed_of(run), tuple(curve), time.monotonic() - began)
    write_json(folder / _RESULT, result)


def _method_run(
    plan: Plan,
    run: Run,
    study: Path,
    given: Path | None,
    on_evaluation: OnEvaluation,
    on_steps: ReportSteps,
) -> MethodRun:
    """Return the arguments of a method for one of its runs."""
    learner = learner_of(plan.learner, plan.settings)
    target = plan.target_of(run)
    done = 0

    def source_policy() -> object:
        return learner.load(given or policy_path(study, Run(SOURCE, run.index)))

    def train(
        env: EnvRef,
        steps: int,
        *,
        start: Any = None,
        body_map: BodyMap | None = None,
        callback: Any = None,
        on_evaluation: OnEvaluation | None = None,
    ) -> Any:
        nonlocal done
        before = done
        # All arms share the demonstrations of a target: they differ only in where they start.
        shown = Run("scratch", run.index) if env == target else run
        trained = learner.train(
            env,
            steps,
            plan.seed_of(run),
            demonstrations=DemonstrationFile(
                study / "demonstrations" / f"{shown.name}.npz", plan.seed_of(shown)
            ),
            start=start,
            body_map=body_map,
            only_last=env != target,
            callback=callback,
            on_evaluation=on_evaluation or _ignore,
            on_steps=lambda now: on_steps(before + now),
        )
        done += steps
        return trained

    return MethodRun(
        source=plan.task.source,
        target=target,
        body_map=plan.body_map,
        learner=learner,
        settings=plan.settings,
        steps=plan.steps,
        source_steps=plan.source_steps,
        seed=plan.seed_of(run),
        folder=run.folder(study),
        source_policy=source_policy,
        report=on_evaluation,
        train=train,
    )


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


def policy_path(study: Path, run: Run) -> Path:
    """Return the policy file of a run.

    Args:
        study: Folder of the study.
        run: The run.
    """
    return run.folder(study) / "policy.safetensors"
