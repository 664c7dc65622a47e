"""Suites: several studies that share the runs of their targets and sources.

Training from scratch on a target does not depend on the source, and a source policy does not depend
on the target. The seed of a run depends only on its kind and index, and on the study's seed. So a
study copies these runs, if they have ended, from studies of its suite with the same settings.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.contract.env_ref import RETURN
from shapechanger.errors import CorruptStudy, ForeignStudy, OutputError
from shapechanger.files import make_folder
from shapechanger.transfer.metrics.curves import LearningCurves
from shapechanger.transfer.metrics.intervals import Estimate
from shapechanger.transfer.metrics.measures import steps_to_reach
from shapechanger.transfer.plan import PLAN_FILE, SOURCE, Plan, read_plan
from shapechanger.transfer.runs import changes_between, load_result
from shapechanger.transfer.study import Study, claim_folder

_OF_TARGET: Final = ("random", "zero-action", "scratch")
_GAINS: Final = ("jumpstart", "total_reward_gain", "asymptotic_gain")
_DEMONSTRATIONS: Final = "demonstrations"


class StudyOutcome(msgspec.Struct, frozen=True):
    """Outcome of one study of a suite; all steps are target steps.

    Attributes:
        final: Mean measure of scratch at its last evaluation.
        zero_shot: Measure of the source policy without training; None if that arm is missing.
        arm_final: Mean measure of `arm` at its last evaluation.
        scratch_steps: Steps at which scratch first reaches `final`.
        arm_steps: Steps at which `arm` first reaches `final`; None if it never does.
        arm: The arm that is compared with scratch.
    """

    name: str
    final: float
    zero_shot: float | None
    arm_final: float
    scratch_steps: float
    arm_steps: float | None
    unit: str = "score"
    gains: dict[str, Estimate] = {}
    measure: str = RETURN.name
    arm: str = "fine-tune"

    @property
    def halves(self) -> bool:
        """Return whether the arm needs less than half as many steps as scratch."""
        return self.arm_steps is not None and self.arm_steps < self.scratch_steps / 2


def open_study_folder(plan: Plan, out: Path, name: str) -> Path:
    """Make a study's folder in `out`, and copy the runs that it shares with other studies there."""
    make_folder(out)
    folder = out / name
    claim_folder(plan, folder)
    for other in sorted(out.glob(f"*/{PLAN_FILE}")):
        if other.parent != folder:
            _share(plan, folder, other.parent)
    return folder


def merge_study(folders: Sequence[Path], out: Path) -> Plan:
    """Copy the finished runs of one study from several folders into one folder."""
    plans = [read_plan(one, f"leave out {one}") for one in folders]
    arms = tuple(dict.fromkeys(arm for plan in plans for arm in plan.arms))
    seeds = max(plan.seeds for plan in plans)
    identity = {part: each for plan in reversed(plans) for part, each in plan.identity.items()}
    whole = msgspec.structs.replace(plans[0], arms=arms, seeds=seeds, identity=identity)
    for plan, folder in zip(plans, folders, strict=True):
        if whole != plan and not whole.extends(plan):
            text = changes_between(whole, plan) or f"they differ in {whole.difference(plan)}"
            raise ForeignStudy(
                f"{folders[0]} and {folder} hold different studies ({text}). Merge only folders of "
                "one version; no file was changed."
            )
    claim_folder(whole, out)
    for run in whole.runs():
        kept = load_result(whole, out, run)
        for plan, folder in zip(plans, folders, strict=True):
            found = load_result(plan, folder, run) if run in plan.runs() else None
            if found is None:
                continue
            if kept is None:
                _copy_atomic(run.folder(folder), run.folder(out))
                kept = found
            elif found.curve != kept.curve:
                raise CorruptStudy(
                    f"The result of {run.name} in {folder} differs from the one in {out}: delete "
                    "one. Processors that round differently can be the reason."
                )
    return whole


def _share(plan: Plan, folder: Path, sibling: Path) -> None:
    remedy = f"delete {sibling} to repeat that study"
    other = read_plan(sibling, remedy)
    if text := changes_between(other, plan):
        raise ForeignStudy(
            f"{sibling} was run with another version of an env, a learner or a method. {text}. A "
            f"suite has one version of each: give another --out, or delete {sibling} to repeat it."
        )
    same = msgspec.structs.replace(
        other,
        task=plan.task,
        body_map=plan.body_map,
        seeds=plan.seeds,
        arms=plan.arms,
        identity=plan.identity,
    )
    if same != plan:
        return
    kinds: list[str] = []
    if other.task.target == plan.task.target:
        kinds += _OF_TARGET
    if other.task.source == plan.task.source:
        kinds.append(SOURCE)
    for run in (run for run in plan.runs() if run.kind in kinds):
        shown = Path(_DEMONSTRATIONS, f"{run.name}.npz")
        if (sibling / shown).exists() and not (folder / shown).exists():
            make_folder((folder / shown).parent)
            (folder / shown).hardlink_to(sibling / shown)
        if load_result(plan, folder, run) is None and load_result(other, sibling, run) is not None:
            _copy_atomic(run.folder(sibling), run.folder(folder))


def _copy_atomic(theirs: Path, mine: Path) -> None:
    part = mine.with_name(f".{mine.name}.part")
    make_folder(mine.parent)
    try:
        for old in (part, mine):
            shutil.rmtree(old, ignore_errors=True)
        shutil.copytree(theirs, part)
        part.replace(mine)
    except OSError as error:
        raise OutputError(f"Cannot write {mine}: {error.strerror or error}.") from error


def study_outcome(name: str, study: Study) -> StudyOutcome:
    """Return the outcome of a study."""
    arm = study.headline_arm
    scratch, trained = study.curves("scratch"), study.curves(arm)
    final = float(scratch.returns[:, -1].mean())
    summary = study.summaries[arm]
    first = _first_at(scratch, final)
    return StudyOutcome(
        name,
        final,
        float(study.curves("zero-shot").returns.mean()) if study.of("zero-shot") else None,
        float(trained.returns[:, -1].mean()),
        study.plan.steps if first is None else first,
        _first_at(trained, final),
        summary.unit,
        {gain: getattr(summary.in_target_steps, gain) for gain in _GAINS},
        study.plan.measure,
        arm,
    )


def _first_at(curves: LearningCurves, level: float) -> float | None:
    """Return the steps at which the mean over seeds first reaches a level; None if never."""
    mean = LearningCurves(curves.steps, curves.returns.mean(axis=0, keepdims=True))
    steps = float(steps_to_reach(mean, level)[0])
    return steps if math.isfinite(steps) else None
