"""The runs of a study, their results, and the identities of their parts.

Random numbers of a run derive from its seed, except in evaluations of policies and in
demonstrations that runs share. Keys of identities: "source", "target", "learner", "method NAME".
"""

from __future__ import annotations

import math
import pkgutil
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.errors import CorruptStudy, ForeignStudy, StudyError
from shapechanger.files import append_line, make_folder, read_json, write_json
from shapechanger.identity import identify_code
from shapechanger.transfer.executor import ReportSteps, use_one_thread
from shapechanger.transfer.identities import (
    LEARNER,
    NOTHING,
    Identities,
    identify,
    identify_learner,
    known,
)
from shapechanger.transfer.learners import Learner, LearnerSettings, SharedFile
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    random_actions,
    zero_actions,
)
from shapechanger.transfer.methods import MethodRun, load_method
from shapechanger.transfer.plan import NO_SKILL, SOURCE, Plan, Run

_RESULT: Final = "run.json"
_CURVE: Final = "curve.jsonl"
_METHOD: Final = "method "


class RunResult(msgspec.Struct, frozen=True):
    """Result of a run.

    Attributes:
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
    identity: Identities = {}


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
    """Perform a run; delete the curve and the result of an earlier attempt, but no other files."""
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
                f"{evaluation.mean_return}. Try a smaller learning rate, or change the body less."
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
        part = f"{_METHOD}{run.kind}"
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


def identities_of_code(settings: object, arms: Sequence[str] = ()) -> Identities:
    """Return the identities of a learner and of methods."""
    methods = {f"{_METHOD}{arm}": identify_code([arm], load_method(arm)) for arm in arms}
    return known({LEARNER: identify_learner(settings), **methods})


def parts_of(plan: Plan, run: Run) -> Identities:
    """Return the identities that a run depends on."""
    parts = {"target"} if run.kind in NO_SKILL else {"target", LEARNER, f"{_METHOD}{run.kind}"}
    if run.kind == SOURCE:
        parts = {"source", LEARNER}
    elif run.kind not in NO_SKILL and load_method(run.kind).uses_source:
        parts.add("source")
    return {part: each for part, each in plan.identity.items() if part in parts}


def changes_between(old: Plan, new: Plan) -> str:
    """Describe how the common parts of two plans differ; empty if they are equal."""
    mine, theirs = ({"source": p.task.source, "target": p.task.target} for p in (new, old))
    common = [(f"{mine[a]}", a, b) for a in mine for b in theirs if mine[a] == theirs[b]]
    if (new.learner, new.settings) == (old.learner, old.settings):
        common.append((f"the learner {new.learner}", LEARNER, LEARNER))
    arms = [arm for arm in new.arms if arm in old.arms]
    common += [(f"the method {arm}", _METHOD + arm, _METHOD + arm) for arm in arms]
    found: dict[str, str] = {}
    for title, part, other in common:
        before, after = old.identity.get(other, NOTHING), new.identity.get(part, NOTHING)
        if before != after:
            found[title] = before.changes_to(after)
    return "; ".join(f"{title}: {text}" for title, text in found.items())


def differences(plan: Plan, old: Identities, new: Identities) -> str:
    """Describe how identities of a plan's parts differ; empty if they are equal."""
    titles = {"source": f"{plan.task.source}", "target": f"{plan.task.target}"}
    changed = {
        titles.get(part, f"the {part}"): old.get(part, NOTHING).changes_to(new.get(part, NOTHING))
        for part in sorted({*old, *new})
    }
    return "; ".join(f"{title}: {text}" for title, text in changed.items() if text)


def require_planned(plan: Plan, run: Run) -> None:
    """Refuse a run if its envs, method or learner differ from the plan in this process.

    A file may be edited while a study runs, and another node of a cluster may have another version.
    """
    parts = parts_of(plan, run)
    arms = [run.kind] if _METHOD + run.kind in parts else []
    code = identities_of_code(plan.settings, arms)
    found = {part: each for part, each in code.items() if part in parts}
    for part, ref in (("source", plan.task.source), ("target", plan.task.target)):
        if part in parts:
            # Do not connect to a robot a second time.
            is_robot = plan.exclusive and part == "target"
            found[part] = parts[part] if is_robot else identify(ref)
    if text := differences(plan, parts, found):
        raise ForeignStudy(
            f"An env or code of this study has changed since it was planned. {text}. Restore it "
            "and run the same command again, or start again with another --out."
        )
