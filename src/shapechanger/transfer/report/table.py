"""The measures of a study as rows of text, for a terminal and for a page."""

from __future__ import annotations

from typing import NamedTuple

from shapechanger.transfer.metrics import Estimate, Measures, ReachTimes, Summary, TimeToThreshold
from shapechanger.transfer.plan import Arm
from shapechanger.transfer.report.numbers import count, estimate_text
from shapechanger.transfer.report.words import (
    ASYMPTOTIC_GAIN,
    AUC_RATIO,
    FORWARD_TRANSFER,
    JUMPSTART,
    PURE_NUMBER,
    TIME_TO_THRESHOLD,
    TOTAL_REWARD_GAIN,
)
from shapechanger.transfer.study import Study

__all__ = ["Row", "measure_rows"]


class Row(NamedTuple):
    """One measure of one arm against scratch, in both ways of counting.

    Attributes:
        arm: The arm.
        measure: What is measured, in words.
        unit: "score", "return", "steps" or "pure number".
        target: Value and interval, counted in target steps.
        total: Value and interval, counted in total steps.
        method: How the intervals were made, in words, or "none"; both ways, where they differ.
        note: What a reader must know; empty if nothing.
    """

    arm: Arm
    measure: str
    unit: str
    target: str
    total: str
    method: str
    note: str


def measure_rows(study: Study) -> tuple[Row, ...]:
    """Every measure of every arm other than scratch."""
    rows: list[Row] = []
    for arm in study.plan.arms:
        if arm != "scratch":
            rows += _rows_of(arm, study.summaries[arm])
    return tuple(rows)


def _rows_of(arm: Arm, summary: Summary) -> list[Row]:
    """The rows of one arm, gains first."""
    ours, total = _named(summary.in_target_steps), _named(summary.in_total_steps)
    rows: list[Row] = []
    for name, estimate in ours.items():
        unit = PURE_NUMBER if name in (AUC_RATIO, FORWARD_TRANSFER) else summary.unit
        rows.append(_row(arm, name, unit, estimate, total[name], signed=name != AUC_RATIO))
    times = zip(
        summary.in_target_steps.times_to_threshold,
        summary.in_total_steps.times_to_threshold,
        strict=True,
    )
    for in_target, in_total in times:
        row = _row(
            arm,
            f"{TIME_TO_THRESHOLD} {in_target.threshold:g}: steps saved",
            "steps",
            in_target.steps_saved,
            in_total.steps_saved,
            signed=True,
        )
        reached = _reached(arm, summary, in_target, in_total)
        rows.append(row._replace(note=" ".join(filter(None, (reached, row.note)))))
    return rows


def _named(measures: Measures) -> dict[str, Estimate]:
    """The measures that are not times, by what they are called."""
    return {
        JUMPSTART: measures.jumpstart,
        TOTAL_REWARD_GAIN: measures.total_reward_gain,
        ASYMPTOTIC_GAIN: measures.asymptotic_gain,
        AUC_RATIO: measures.auc_ratio,
        FORWARD_TRANSFER: measures.forward_transfer,
    }


def _row(
    arm: Arm, measure: str, unit: str, target: Estimate, total: Estimate, *, signed: bool
) -> Row:
    """One row, with what both ways of counting share told once."""
    methods = [estimate.method for estimate in (target, total)]
    return Row(
        arm=arm,
        measure=measure,
        unit=unit,
        target=estimate_text(target, signed=signed),
        total=estimate_text(total, signed=signed),
        method=methods[0] if methods[0] == methods[1] else " / ".join(methods),
        note=_once(target.note, total.note),
    )


def _once(target: str, total: str) -> str:
    """Two notes as one."""
    if target == total:
        return target
    notes = (("In target steps", target), ("In total steps", total))
    return " ".join(f"{where}: {note}" for where, note in notes if note)


def _reached(
    arm: Arm, summary: Summary, in_target: TimeToThreshold, in_total: TimeToThreshold
) -> str:
    """How many seeds reached a threshold, and how soon; empty where that is undefined."""
    if in_target.arm is None or in_target.scratch is None or in_total.arm is None:
        return ""
    reaches = (in_target.arm, in_total.arm, in_target.scratch)
    missed = any(reach.fraction < 1.0 for reach in reaches)
    censored = f" Runs that did not get there count as {count(summary.horizon)}." if missed else ""
    return (
        f"Reached by {_seeds(in_target.arm, summary.n_seeds_arm)} of {arm} after a mean of "
        f"{count(in_target.arm.restricted_mean)} steps; in total steps by "
        f"{_seeds(in_total.arm, summary.n_seeds_arm)} after {count(in_total.arm.restricted_mean)}; "
        f"by {_seeds(in_target.scratch, summary.n_seeds_scratch)} of scratch after "
        f"{count(in_target.scratch.restricted_mean)}.{censored}"
    )


def _seeds(reach: ReachTimes, n_seeds: int) -> str:
    """As in `3 of 5 seeds`."""
    return f"{round(reach.fraction * n_seeds)} of {n_seeds} seeds"
