"""Sources that are made more like the target, by what the target tells of itself."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

import msgspec

from shapechanger.errors import CorruptStudy, SpaceMismatch, StudyError
from shapechanger.transfer.body_map import MappedEnv
from shapechanger.transfer.env_ref import EnvRef, layouts_of
from shapechanger.transfer.executor import ReportSteps
from shapechanger.transfer.files import append_line, make_folder, read_json, write_json
from shapechanger.transfer.learners.cloning import (
    DemonstrationFile,
    evaluate_clone,
    is_clone,
    load_clone,
)
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    evaluation_envs,
    random_actions,
)
from shapechanger.transfer.learners.policy_file import TrainedPolicy, load_policy, save_policy
from shapechanger.transfer.learners.ppo import EVALUATION_SEED, train, use_one_thread
from shapechanger.transfer.learners.sac import train_camera_policy
from shapechanger.transfer.learners.settings import (
    CloningSettings,
    LearnerSettings,
    SacSettings,
    Settings,
)
from shapechanger.transfer.plan import (
    ADAPTED_SOURCE_ARMS,
    ARMS,
    EVERY_ARM,
    Arm,
    Plan,
    Run,
    TransferTask,
)

__all__ = [
    "RunResult",
    "SourceAdaptation",
    "adapt_source",
    "default_arms",
    "given_policy_steps",
    "load_result",
    "perform_run",
    "require_source_adaptation",
]


@runtime_checkable
class SourceAdaptation(Protocol):
    """A target that tells how its source becomes more like it."""

    def randomised_source(self) -> dict[str, Any]:
        """Arguments of the source with which each episode has another body that this may be."""
        ...

    def identified_source(self, seed: int) -> dict[str, Any]:
        """Arguments of the source with which it is what this was identified as.

        Args:
            seed: Of the motions that it is identified by.
        """
        ...


def adapt_source(plan: Plan, run: Run) -> EnvRef:
    """The source of a run, randomised or identified; to identify it moves the target.

    Raises:
        StudyError: If the target tells nothing of the kind.
    """
    made = plan.target_of(run).make()
    try:
        target = made.unwrapped
        if not isinstance(target, SourceAdaptation):
            raise StudyError(_nothing_told(plan.task))
        if run.kind == "randomised":
            more = target.randomised_source()
        else:
            more = target.identified_source(plan.seed_of(run))
    finally:
        made.close()
    return plan.task.source.having(more)


def default_arms(task: TransferTask) -> tuple[Arm, ...]:
    """What a pair of envs is compared by where nobody asks for other arms.

    A source that is made more like the target helps where both are the same task: where their
    layouts are the same.
    """
    source, target = task.source.make(), task.target.make()
    try:
        same = layouts_of(source) == layouts_of(target)
        return EVERY_ARM if same and isinstance(target.unwrapped, SourceAdaptation) else ARMS
    finally:
        source.close()
        target.close()


def require_source_adaptation(task: TransferTask, arms: tuple[Arm, ...], target: object) -> None:
    """Refuse arms that the target has nothing to offer for.

    Raises:
        StudyError: If there is one.
    """
    if set(arms) & set(ADAPTED_SOURCE_ARMS) and not isinstance(target, SourceAdaptation):
        raise StudyError(_nothing_told(task))


def _nothing_told(task: TransferTask) -> str:
    return (
        f"{task.target} does not tell how {task.source} becomes more like it, so the arms "
        f"{' and '.join(ADAPTED_SOURCE_ARMS)} cannot be: leave them out."
    )


class _Origin(NamedTuple):
    """Where a policy comes from: the env that it was trained in, and for how many steps."""

    env: EnvRef
    steps: int


class _Shown(msgspec.Struct):
    """What the card of a clone says of its demonstrations, where a study or `train` wrote it."""

    env: str
    arguments: dict[str, Any]
    demonstrated_steps: int
    tried_steps: int = 0


def given_policy_steps(path: Path, source: EnvRef, learner: str, settings: Settings) -> int:
    """Steps that a policy has cost, if a study can begin with it.

    Args:
        path: Its file.
        source: The source of the study.
        learner: Name of the learner of the study.
        settings: Its settings.

    Raises:
        CorruptStudy: If the file is missing or holds no policy.
        PolicyError: If it holds half a clone.
        StudyError: If the learner does not learn as the policy did.
        SpaceMismatch: If the policy was trained in another env than the source.
    """
    if is_clone(path):
        origin = _of_clone(path, learner, settings)
    else:
        origin = _of_learned(path, learner, settings)
    if origin.env != source:
        raise SpaceMismatch(
            f"The policy that was brought along was trained in {origin.env}, and the source is "
            f"{source}: name the env and the body that it was trained in."
        )
    return origin.steps


def _of_clone(path: Path, learner: str, settings: Settings) -> _Origin:
    if isinstance(settings, LearnerSettings):
        raise StudyError(
            f"{path} is a clone, and {learner} does not learn from pictures: give --learner "
            f"cloning or sac, or bring along a policy of {learner}."
        )
    card = load_clone(path).card
    if card.framing != settings.clone.framing:
        seen = settings.clone.framing
        raise StudyError(
            f"{path} sees pictures of {card.framing.height} x {card.framing.width} pixels from "
            f"{card.framing.top:g} of their height on, and {learner} {seen.height} x {seen.width} "
            f"from {seen.top:g}: bring along one that sees the same."
        )
    try:
        shown = msgspec.convert(card.data, _Shown)
    except msgspec.ValidationError as error:
        raise StudyError(
            f"The card of {path} does not say from which demonstrations it was cloned ({error}): "
            "bring along one that `shapechanger train` or a study has written."
        ) from error
    return _Origin(EnvRef(shown.env, shown.arguments), shown.demonstrated_steps + shown.tried_steps)


def _of_learned(path: Path, learner: str, settings: Settings) -> _Origin:
    card = load_policy(path).card
    if not isinstance(settings, LearnerSettings):
        raise StudyError(
            f"{path} has learned by trying, with {card.learner}, and {learner} begins with "
            f"demonstrations: give --learner {card.learner}, or bring along a clone."
        )
    return _Origin(card.env, card.steps)


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


def load_result(plan: Plan, study: Path, run: Run) -> RunResult | None:
    """The result of a run; None if it has not ended, or its policy is no longer there.

    Raises:
        CorruptStudy: If its file cannot be read, or is not that of this run.
    """
    path = run.folder(study) / _RESULT
    trains = run.kind in ("source", "scratch", "fine-tune", *ADAPTED_SOURCE_ARMS)
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


def perform_run(plan: Plan, run: Run, study: str, source_policy: str, report: ReportSteps) -> None:
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
    elif run.kind in ADAPTED_SOURCE_ARMS:
        source = adapt_source(plan, run)
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
    report: ReportSteps,
) -> None:
    """Learn to drive by camera in the source or in the target, or see what that is worth."""
    if run.kind == "zero-shot":
        on_evaluation(evaluate_clone(plan.target_of(run), load_clone(source_path), settings))
        return
    of_source = run.kind == "source"
    # The same demonstrations for each arm: the arms differ in what they begin with.
    shown = Run("source" if of_source else "scratch", run.index)
    policy = train_camera_policy(
        plan.task.source if of_source else plan.target_of(run),
        settings,
        plan.source_steps if of_source else plan.steps,
        plan.seed_of(run),
        demonstrations=DemonstrationFile(
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
    report: ReportSteps,
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


def _train_in(plan: Plan, source: EnvRef, run: Run, report: ReportSteps) -> TrainedPolicy:
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
