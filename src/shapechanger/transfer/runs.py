"""The runs of a study, each in its own process, and their results.

All random numbers of a run derive from the seed of the run.
"""

from __future__ import annotations

import math
import pkgutil
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.errors import CorruptStudy, ForeignStudy, StudyError
from shapechanger.files import append_line, make_folder, read_json, write_json
from shapechanger.identity import Identity
from shapechanger.transfer.executor import ReportSteps, use_one_thread
from shapechanger.transfer.learners import Learner, LearnerSettings, SharedFile
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    random_actions,
    zero_actions,
)
from shapechanger.transfer.methods import MethodRun, load_method
from shapechanger.transfer.plan import NO_SKILL, SOURCE, Plan, Run
from shapechanger.transfer.versions import differences, parts_of, require_planned

_RESULT: Final = "run.json"
_CURVE: Final = "curve.jsonl"


class RunResult(msgspec.Struct, frozen=True):
    """Result of a run.

    Attributes:
        run: The run.
        seed: Seed of the run.
        curve: Evaluations of the run, in the order of their steps.
        wall_s: Duration, s; the only value here that is not reproducible.
        device: The device that trained: "CPU", or the name of a GPU; empty without training.
        identity: Identities of the parts that the run depends on, from the plan.
    """

    run: Run
    seed: int
    curve: tuple[Evaluation, ...]
    wall_s: float
    device: str = ""
    identity: dict[str, Identity] = {}


def learner_of(name: str, settings: LearnerSettings) -> Learner[Any]:
    """Return the learner that the settings belong to."""
    return pkgutil.resolve_name(settings.learner)(name, settings)


def load_result(plan: Plan, study: Path, run: Run) -> RunResult | None:
    """Load the result of a run; None if the run has not ended or its policy is missing."""
    path = run.folder(study) / _RESULT
    if not path.exists() or (plan.trains(run.kind) and not run.policy_file(study).exists()):
        return None
    remedy = f"delete {path.parent} to repeat that run"
    result = read_json(path, RunResult, remedy)
    steps = [evaluation.steps for evaluation in result.curve]
    complete = bool(steps) and steps[0] == 0 and steps[-1] == plan.last_step_of(run.kind)
    if result.run != run or result.seed != plan.seed_of(run) or not complete:
        raise CorruptStudy(f"{path} does not hold the result of {run.name}: {remedy}.")
    if text := differences(plan, result.identity, parts_of(plan, run)):
        raise ForeignStudy(
            f"{path} is the result of another version than the planned one. {text}. Give another "
            f"--out, or {remedy}."
        )
    return result


def last_evaluation(study: Path, run: Run) -> Evaluation | None:
    """Return the last evaluation of a run so far; None before the first."""
    try:
        # The last line may be half-written.
        *lines, _ = (run.folder(study) / _CURVE).read_bytes().split(b"\n")
    except FileNotFoundError:
        return None
    return msgspec.json.decode(lines[-1], type=Evaluation) if lines else None


def perform_run(plan: Plan, run: Run, study: str, given: Path | None, report: ReportSteps) -> None:
    """Perform a run; files of an earlier attempt are deleted, except those of its method."""
    use_one_thread()
    require_planned(plan, run)
    folder = run.folder(Path(study))
    make_folder(folder)
    for stale in (_CURVE, _RESULT):
        (folder / stale).unlink(missing_ok=True)
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

    def shared(kind: str) -> SharedFile:
        one = Run(kind, run.index)
        path = Path(study, "demonstrations", f"{one.name}.npz")
        return SharedFile(path, plan.seed_of(one))

    policy = None
    learner = learner_of(plan.learner, plan.settings)
    if run.kind in NO_SKILL:
        on_evaluation(_evaluate_unskilled(plan, run, learner))
    else:
        part = f"method {run.kind}"
        context = MethodRun(
            source=plan.task.source,
            target=plan.target_of(run),
            body_map=plan.body_map,
            learner=learner,
            steps=plan.steps,
            source_steps=plan.source_steps_of(run.kind),
            seed=plan.seed_of(run),
            folder=folder,
            source_file=given or Run(SOURCE, run.index).policy_file(Path(study)),
            policy_file=run.policy_file(Path(study)),
            shared=shared,
            kind=run.kind,
            identity={part: plan.identity[part]} if part in plan.identity else {},
            report=on_evaluation,
            on_steps=report,
        )
        if run.kind == SOURCE:
            policy = context.train(
                plan.task.source, context.source_steps, on_evaluation=on_evaluation
            )
        else:
            policy = load_method(run.kind).learn(context)
        if policy is not None:
            context.save(policy)
    device = "" if policy is None else learner.device
    wall_s = time.monotonic() - began
    require_planned(plan, run)
    parts = parts_of(plan, run)
    result = RunResult(run, plan.seed_of(run), tuple(curve), wall_s, device, parts)
    write_json(folder / _RESULT, result)


def _evaluate_unskilled(plan: Plan, run: Run, learner: Learner[Any]) -> Evaluation:
    with ExitStack() as stack:
        envs = learner.evaluation_envs(plan.target_of(run))
        for env in envs:
            stack.callback(env.close)
        # Each run draws its own actions and its own starts.
        seed, space = plan.seed_of(run), envs[0].action_space
        act = random_actions(space, seed) if run.kind == "random" else zero_actions(space)
        return evaluate(act, envs, seed, episodes=plan.settings.eval_episodes)
