"""Several studies that share what they have in common: the runs of a target, and of a source.

Scratch on a target is the same training whatever the source is, and a source policy is the same
whatever it is moved to; seeds follow from the kind of run and its number alone. So a study that
begins finds these runs done, where a study beside it did them.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.errors import OutputError
from shapechanger.transfer.executor import Executor, OnProgress
from shapechanger.transfer.files import make_folder, read_json
from shapechanger.transfer.methods import load_result
from shapechanger.transfer.metrics import Estimate, LearningCurves
from shapechanger.transfer.plan import Plan, RunKind
from shapechanger.transfer.study import PLAN_FILE, Study, claim_folder, run_study

__all__ = ["StudyOutcome", "open_study_folder", "run_in_suite", "study_folder", "study_outcomes"]

_OF_TARGET: Final[tuple[RunKind, ...]] = ("random", "scratch")
_GAINS: Final = ("jumpstart", "total_reward_gain", "asymptotic_gain")
_DEMONSTRATIONS: Final = "demonstrations"


class StudyOutcome(msgspec.Struct, frozen=True):
    """What one study of a suite says, in steps on the target.

    Attributes:
        name: SOURCE-to-TARGET.
        final: What scratch ends with, mean over seeds.
        zero_shot: What the source policy is worth unchanged; None where that was not asked.
        fine_tuned: What fine-tuning ends with.
        scratch_steps: Steps after which scratch first comes to `final`.
        fine_tune_steps: The same of fine-tuning; None if it never does.
        unit: Of the gains, see `Summary`.
        gains: What fine-tuning gains over scratch, in target steps and with intervals: `jumpstart`,
            `total_reward_gain` and `asymptotic_gain`.
    """

    name: str
    final: float
    zero_shot: float | None
    fine_tuned: float
    scratch_steps: float
    fine_tune_steps: float | None
    unit: str = "score"
    gains: dict[str, Estimate] = {}

    @property
    def halves(self) -> bool:
        """Whether fine-tuning needs less than half of the steps that scratch needs."""
        return self.fine_tune_steps is not None and self.fine_tune_steps < self.scratch_steps / 2


def study_folder(plan: Plan, out: Path) -> Path:
    """Where a study of a suite is."""
    return out / "-to-".join(
        env.id.split("/")[-1].removesuffix("-v1")
        + "".join(f"-{lens}" for lens in env.kwargs.get("lenses", ()))
        for env in (plan.task.source, plan.task.target)
    )


def run_in_suite(
    plan: Plan,
    out: Path,
    *,
    executor: Executor | None = None,
    on_progress: OnProgress = lambda name, steps, ended: None,
    command: str = "",
) -> Study:
    """Do a study in its folder below `out`, with what the studies beside it have done already.

    Raises:
        ForeignStudy: If its folder holds another study.
        CorruptStudy: If a file in one cannot be read.
        OutputError: If `out` cannot be written.
    """
    folder = open_study_folder(plan, out)
    return run_study(plan, folder, executor=executor, on_progress=on_progress, command=command)


def open_study_folder(plan: Plan, out: Path) -> Path:
    """Make a study's folder below `out`, with what the studies beside it have done already.

    Returns:
        The folder; what is unfinished in it is left to do.

    Raises:
        ForeignStudy: If its folder holds another study.
        CorruptStudy: If a file in one cannot be read.
        OutputError: If `out` cannot be written.
    """
    make_folder(out)
    folder = study_folder(plan, out)
    claim_folder(plan, folder)
    for other in sorted(out.glob(f"*/{PLAN_FILE}")):
        if other.parent != folder:
            _share(plan, folder, other.parent)
    return folder


def study_outcomes(studies: Iterable[Study]) -> list[StudyOutcome]:
    """What each study says, in the order of the studies."""
    return [_crossing(study) for study in studies]


def _share(plan: Plan, folder: Path, sibling: Path) -> None:
    """Take over the runs of a sibling that are the same here."""
    remedy = f"delete {sibling} to do that study again"
    other = read_json(sibling / PLAN_FILE, Plan, remedy)
    alike = msgspec.structs.replace(other, task=plan.task, body_map=plan.body_map, seeds=plan.seeds)
    if alike != plan:
        return
    kinds: list[RunKind] = []
    if other.task.target == plan.task.target:
        kinds += _OF_TARGET
    if other.task.source == plan.task.source:
        kinds.append("source")
    for run in (run for run in plan.runs() if run.kind in kinds):
        shown = Path(_DEMONSTRATIONS, f"{run.name}.npz")
        if (sibling / shown).exists() and not (folder / shown).exists():
            make_folder((folder / shown).parent)
            (folder / shown).hardlink_to(sibling / shown)
        if load_result(plan, folder, run) is None and load_result(other, sibling, run) is not None:
            _copy_whole(run.folder(sibling), run.folder(folder))


def _copy_whole(theirs: Path, mine: Path) -> None:
    """Copy the folder of a run; it appears whole or not at all.

    Raises:
        OutputError: If it cannot be written.
    """
    part = mine.with_name(f".{mine.name}.part")
    make_folder(mine.parent)
    try:
        for old in (part, mine):
            shutil.rmtree(old, ignore_errors=True)
        shutil.copytree(theirs, part)
        part.replace(mine)
    except OSError as error:
        raise OutputError(f"Cannot write {mine}: {error.strerror or error}.") from error


def _crossing(study: Study) -> StudyOutcome:
    scratch, tuned = study.curves("scratch"), study.curves("fine-tune")
    final = float(scratch.returns[:, -1].mean())
    zero_shot = study.of("zero-shot")
    summary = study.summaries["fine-tune"]
    measures = summary.in_target_steps
    first = _first_at(scratch, final)
    return StudyOutcome(
        study_folder(study.plan, Path()).name,
        final,
        sum(run.curve[0].mean_return for run in zero_shot) / len(zero_shot) if zero_shot else None,
        float(tuned.returns[:, -1].mean()),
        study.plan.steps if first is None else first,
        _first_at(tuned, final),
        summary.unit,
        {name: getattr(measures, name) for name in _GAINS},
    )


def _first_at(curves: LearningCurves, level: float) -> float | None:
    """Steps at which the mean over seeds first comes to a level; in between, along a line."""
    means = curves.returns.mean(axis=0)
    before_steps, before = 0.0, float("-inf")
    for steps, mean in zip(curves.steps.tolist(), means.tolist(), strict=True):
        if mean >= level:
            if before == float("-inf"):
                return steps
            return before_steps + (steps - before_steps) * (level - before) / (mean - before)
        before_steps, before = steps, mean
    return None
