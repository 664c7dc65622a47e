"""The sections of the page that say what came out."""

from __future__ import annotations

from typing import Final

from shapechanger.pages.markup import (
    Html,
    element,
    joined,
    pairs,
    paragraph,
    table,
    text,
)
from shapechanger.transfer.metrics import Summary
from shapechanger.transfer.plan import Arm
from shapechanger.transfer.report.arms import GOOD, ArmRow, arm_rows
from shapechanger.transfer.report.numbers import UNDEFINED, count, number
from shapechanger.transfer.report.table import Row, measure_rows
from shapechanger.transfer.report.verdict import caveats, judged_arm
from shapechanger.transfer.report.words import (
    ASYMPTOTIC_GAIN,
    EXPLANATIONS,
    JUMPSTART,
    TIME_TO_THRESHOLD,
    TOTAL_REWARD_GAIN,
)
from shapechanger.transfer.study import Study

__all__ = ["arms", "headline", "measures"]

_HEADLINE: Final = (TOTAL_REWARD_GAIN, JUMPSTART, ASYMPTOTIC_GAIN)

_INTERVALS: Final = (
    "Intervals are over training seeds, never over episodes: the episodes of one run share a "
    "policy, and counting them as independent would make every interval too narrow. Arms are not "
    "paired. Differences have Welch's t-interval (Biometrika 34, 1947); auc_ratio and forward "
    "transfer have a studentised bootstrap interval, for which the seeds of both arms are drawn "
    "again apart (Efron & Tibshirani, An Introduction to the Bootstrap, 1993)."
)


def headline(study: Study) -> Html:
    """The numbers that the verdict rests on, in target steps with those in total steps below."""
    arm = judged_arm(study)
    rows = [row for row in measure_rows(study) if row.arm == arm]
    wanted = [row for name in _HEADLINE for row in rows if row.measure == name]
    wanted += [row for row in rows if row.measure.startswith(TIME_TO_THRESHOLD)][-1:]
    cards = [_card(row) for row in wanted if row.target != UNDEFINED]
    return joined(
        (
            element("div", *cards, class_="cards"),
            paragraph(
                f"{arm.capitalize()} against scratch, {study.plan.seeds} seeds each: estimate "
                "[95 % interval over seeds], counted in target steps, and below that in total "
                "steps.",
                class_="note",
            ),
        )
    )


def measures(study: Study) -> Html:
    """Every measure, what it means, and how the intervals are made."""
    rows = measure_rows(study)
    defined = [row for row in rows if _defined(row)]
    notes = {row.note: None for row in defined if row.note}
    marks = {note: f"({place})" for place, note in enumerate(notes, start=1)}
    items = (element("li", text(note)) for note in notes)
    summary = next(iter(study.summaries.values()))
    return joined(
        (
            *(_measure_table(arm, rows, marks) for arm in study.summaries),
            *([element("ol", *items, class_="notes")] if notes else []),
            element("h3", text("What the measures say")),
            pairs((name, text(words)) for name, words in EXPLANATIONS.items()),
            element("h3", text("How to read the numbers")),
            paragraph(_INTERVALS),
            paragraph(_scale(summary)),
            *(paragraph(sentence) for sentence in caveats(study)),
        )
    )


def arms(study: Study) -> Html:
    """What each arm came to, and what its return is made of."""
    rows = arm_rows(study)
    header = (
        "Runs",
        "Seeds",
        "First return",
        "Final return",
        "Episode length",
        "Success",
        f"Reached {GOOD:.0%} of best".replace("%", " %"),
        "Final return of each seed",
    )
    return joined(
        (
            table("Returns of the runs", header, [_arm_cells(row) for row in rows], class_="wide"),
            paragraph(_arms_note(study), class_="note"),
            *_terms(rows),
        )
    )


def _card(row: Row) -> Html:
    """One number, large."""
    value, bracket, interval = row.target.partition(" [")
    value, _, missing = value.partition(" (")
    unit = "" if row.unit == "steps" else f" {row.unit}"
    return element(
        "div",
        element("p", text(row.measure), class_="label"),
        element("p", text(value), element("small", text(unit)), class_="value"),
        paragraph(f"[{interval}" if bracket else missing.rstrip(")"), class_="interval"),
        paragraph(f"total steps: {row.total}", class_="total"),
        class_="card",
    )


def _defined(row: Row) -> bool:
    """Whether a row holds any number."""
    return {row.target, row.total} != {UNDEFINED}


def _estimate(words: str) -> Html:
    """An estimate, broken into two lines before its interval if at all."""
    value, bracket, interval = words.partition(" [")
    parts = (value, f"[{interval}") if bracket else (value,)
    numbers = joined(element("span", text(part), class_="number") for part in parts)
    return element("span", numbers)


def _measure_table(arm: Arm, rows: tuple[Row, ...], marks: dict[str, str]) -> Html:
    """The measures of one arm with the marks of their notes; below, what is undefined and why."""
    cells: list[tuple[Html, ...]] = []
    undefined: dict[str, list[str]] = {}
    for row in rows:
        if row.arm == arm and _defined(row):
            cells.append(
                (
                    text(row.measure),
                    _estimate(row.target),
                    _estimate(row.total),
                    text(row.unit),
                    text(row.method),
                    text(marks.get(row.note, "")),
                )
            )
        elif row.arm == arm:
            undefined.setdefault(row.note, []).append(row.measure)
    header = ("Measure", "In target steps", "In total steps", "Unit", "Interval", "Note")
    reasons = (f"{'; '.join(names)}. {note}" for note, names in undefined.items())
    return joined(
        (
            table(f"{arm.capitalize()} against scratch", header, cells),
            *(paragraph(reason, class_="note") for reason in reasons),
        )
    )


def _scale(summary: Summary) -> str:
    """What a score is, or why there are none."""
    random, final = number(summary.reference.random), number(summary.reference.final)
    if summary.unit == "return":
        return (
            f"There are no scores: scratch ended at {final}, which is not above the random policy, "
            f"worth {random}. Gains are in units of return."
        )
    return (
        "Returns are normalised to scores by (return - random) / (final - random), both of the "
        f"target: random = {random} is the mean return of the random policy, and final = {final} "
        f"is what scratch ends with, the mean of its last {summary.last_k} evaluations. So 0 is "
        "the random policy, 1 is scratch, and more than 1 is better than scratch. The intervals "
        "take these two numbers as given. A gain in returns is one in scores times "
        f"{number(summary.reference.final - summary.reference.random)}."
    )


def _arm_cells(row: ArmRow) -> tuple[Html, ...]:
    name = {"random": "random policy", "source": "source policy, in the source"}
    return (
        text(name.get(row.kind, row.kind)),
        text(str(row.seeds)),
        _estimate(row.first_return),
        _estimate(row.final_return),
        text(row.length),
        text(row.success or "not told"),
        text(row.good or "not measured"),
        text(row.per_seed),
    )


def _arms_note(study: Study) -> str:
    budget = count(study.plan.steps)
    return (
        "Mean return of an evaluation, with Student's 95 % t-interval over seeds. Final is the "
        f"mean of the last {study.plan.last_k} evaluations of {budget} target steps; of a source "
        "policy it is the last evaluation. A run reached 90 % of best if one of its evaluations "
        "came to 90 % of the way from the random policy to the best final return of any run."
    )


def _terms(rows: tuple[ArmRow, ...]) -> list[Html]:
    """The table of reward terms; nothing if no env reports any."""
    names = {name: None for row in rows for name in row.terms}
    if not names:
        return []
    cells = [
        (
            text(name.removeprefix("reward_")),
            *(text(number(row.terms[name]) if name in row.terms else "none") for row in rows),
        )
        for name in names
    ]
    kinds = {"random": "random policy", "source": "source policy"}
    header = ("Term", *(kinds.get(row.kind, row.kind) for row in rows))
    return [
        table("Reward terms: mean sum over a final episode", header, cells),
        paragraph(
            "Terms as the env reports them. A body that merely stays upright shows here: it "
            "collects what it gets for surviving and nothing for moving.",
            class_="note",
        ),
    ]
