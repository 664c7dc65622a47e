"""The report of a transfer study: rows of text for a terminal, and one page that holds everything.

The rows and the verdict need no matplotlib; `write_report` does, which the extra `report` installs.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.reports.numbers import UNDEFINED, count, number
from shapechanger.reports.page import (
    Html,
    details,
    element,
    joined,
    page_text,
    pairs,
    paragraph,
    png_uri,
    pre,
    svg_uri,
    table,
    text,
)
from shapechanger.reports.verdict import (
    ASYMPTOTIC_GAIN,
    EXPLANATIONS,
    GOOD,
    JUMPSTART,
    TIME_TO_THRESHOLD,
    TOTAL_REWARD_GAIN,
    ArmRow,
    MeasureRow,
    arm_rows,
    caveats,
    headline_arm,
    measure_rows,
    verdict,
)
from shapechanger.transfer.body_map import BodyMap, Copy, MapRow
from shapechanger.transfer.body_map.rules import SAME_NAME
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.files import write_atomic
from shapechanger.transfer.learners.settings import CloningSettings, SacSettings, Settings
from shapechanger.transfer.metrics import Summary
from shapechanger.transfer.plan import Arm
from shapechanger.transfer.study import Study

__all__ = [
    "ArmRow",
    "MeasureRow",
    "Pictures",
    "arm_rows",
    "arms",
    "body_map",
    "caveats",
    "headline",
    "learner",
    "measure_rows",
    "measures",
    "provenance",
    "report_html",
    "shift",
    "short_name",
    "verdict",
    "write_report",
]

_LONGEST_ARGUMENT: Final = 40
_MAP_HEADER: Final = ("Entry", "Filled with", "Why")


def short_name(env: EnvRef) -> str:
    """The name of an env without its namespace, and its arguments, cut where they are long."""
    arguments = ", ".join(f"{name}={_cut(str(value))}" for name, value in env.kwargs.items())
    name = env.id.rpartition("/")[2]
    return f"{name} ({arguments})" if arguments else name


def shift(study: Study) -> Html:
    """The certificate of the shift."""
    if not study.shift:
        return paragraph(
            "The envs publish no certificate, so nothing here proves that source and target differ."
        )
    return pre(study.shift)


def body_map(study: Study) -> Html:
    """Which rule fills which entry: partners counted, everything else listed."""
    ours = study.plan.body_map
    rows = ours.table()
    matched = [row for row in rows if row.why == SAME_NAME]
    others = [row for row in rows if row.why != SAME_NAME]
    parts = [
        paragraph(
            "The source policy senses what it knows: each source observation is filled from the "
            "target's. What it does reaches the target: each target action is filled from the "
            "source's."
        ),
        paragraph(
            f"Filled from a partner of the same name: {_share(matched, rows, 'observation')} "
            f"source observations and {_share(matched, rows, 'action')} target actions."
        ),
    ]
    if others:
        parts.append(table("Entries without such a partner", _MAP_HEADER, _grouped(others)))
    else:
        parts.append(paragraph("Every entry has such a partner."))
    parts += _unused(ours)
    if matched:
        cells = [(text(_entry(row)), text(row.rule), text(row.why)) for row in matched]
        parts.append(
            details(
                f"The {len(matched)} entries with a partner of the same name",
                table("Entries with a partner of the same name", _MAP_HEADER, cells),
            )
        )
    return joined(parts)


def learner(study: Study) -> Html:
    """The learner and what it was set to."""
    plan = study.plan
    settings: dict[str, Any] = msgspec.structs.asdict(plan.settings)
    budget = (
        f"{plan.learner}, with the same settings in every arm: {count(plan.steps)} target "
        f"steps a run, {count(plan.source_steps)} source steps a source policy, an evaluation of "
        f"{plan.settings.eval_episodes} episodes"
    )
    return joined(
        (
            paragraph(f"{budget} {_rhythm(plan.settings)}"),
            details(
                "All settings",
                pairs((name, text(_setting(value))) for name, value in settings.items()),
            ),
        )
    )


def _rhythm(settings: Settings) -> str:
    """When policies are judged, and what they learn from."""
    if isinstance(settings, CloningSettings):
        budgets = ", ".join(count(budget) for budget in settings.budgets)
        return (
            f"after {budgets} steps. A step is one of a demonstration: a policy is cloned from so "
            "many, each time from the same start, and the arms see the same demonstrations."
        )
    if isinstance(settings, SacSettings):
        return (
            f"every {count(settings.eval_every)} steps of trying, which begins after "
            f"{count(settings.demonstrated_steps)} steps of demonstrations: these are cloned, and "
            "half of what SAC learns from is drawn from them. The arms see the same ones."
        )
    normalised = (
        "Observations and rewards are normalised for the learner by running estimates of their "
        "standard deviation. Returns in this report never are."
        if settings.normalise
        else "Observations and rewards reach the learner as they are."
    )
    return f"every {count(settings.eval_every)} steps. {normalised}"


def provenance(study: Study) -> Html:
    """What was run, from which seeds, with which versions, on what and for how long."""
    plan = study.plan
    source = (
        f"brought along, SHA-256 {plan.source_policy}"
        if plan.source_policy
        else f"{plan.seeds} trained by the study, one for each seed"
    )
    wall_s = sum(result.wall_s for result in study.runs)
    facts = (
        ("Source", text(str(plan.task.source))),
        ("Target", text(str(plan.task.target))),
        ("Source policy", text(source)),
        ("Command", pre(study.command) if study.command else text("called from Python")),
        ("Seed", text(f"{plan.seed}, which the seeds of all runs are drawn from")),
        ("Machine", text(study.machine)),
        ("Time", text(f"{_duration(wall_s)} for all runs together; some ran side by side")),
        ("Versions", text(", ".join(f"{name} {v}" for name, v in study.plan.versions.items()))),
    )
    runs = [
        (
            text(result.run.name),
            text(str(result.seed)),
            text(count(result.curve[-1].steps)),
            text(str(len(result.curve))),
            text(_duration(result.wall_s)),
        )
        for result in study.runs
    ]
    header = ("Run", "Seed", "Steps", "Evaluations", "Time")
    return joined((pairs(facts), details(f"The {len(runs)} runs", table("Runs", header, runs))))


def _cut(words: str) -> str:
    """The beginning of a long text."""
    cut = words[: _LONGEST_ARGUMENT - 1].rstrip()
    return words if len(words) <= _LONGEST_ARGUMENT else f"{cut}…"


def _entry(row: MapRow) -> str:
    return f"{row.side}: {row.entry}"


def _share(matched: list[MapRow], rows: tuple[MapRow, ...], side: str) -> str:
    """As in `11 of 13`."""
    ours, every = (sum(row.side == side for row in some) for some in (matched, rows))
    return f"{ours} of {every}"


def _grouped(rows: list[MapRow]) -> list[tuple[Html, Html, Html]]:
    """Entries with the same rule in one line."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for row in rows:
        groups.setdefault((row.side, row.rule, row.why), []).append(row.entry)
    return [
        (text(f"{side}: {', '.join(entries)}"), text(rule), text(why))
        for (side, rule, why), entries in groups.items()
    ]


def _unused(ours: BodyMap) -> list[Html]:
    """What the target senses and the source does that no rule takes."""
    told: list[Html] = []
    for what, entries, names in (
        (
            "Target observations that the moved policy does not see",
            ours.observation,
            ours.target_observation.names,
        ),
        ("Source actions that move nothing in the target", ours.action, ours.source_action.names),
    ):
        taken = {entry.rule.feature for entry in entries if isinstance(entry.rule, Copy)}
        left = [name for name in names if name not in taken]
        if left:
            told.append(paragraph(f"{what}: {', '.join(left)}."))
    return told


def _setting(value: Any) -> str:
    """A setting as one would type it."""
    if isinstance(value, tuple):
        return ", ".join(map(str, cast("tuple[object, ...]", value)))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _duration(seconds: float) -> str:
    """Seconds, minutes or hours, as long as it took."""
    if seconds < 100.0:
        return f"{number(seconds, 1)} s"
    minutes = seconds / 60.0
    return f"{number(minutes, 1)} min" if minutes < 100.0 else f"{number(minutes / 60.0, 1)} h"


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
    arm = headline_arm(study)
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


def _card(row: MeasureRow) -> Html:
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


def _defined(row: MeasureRow) -> bool:
    """Whether a row holds any number."""
    return {row.target, row.total} != {UNDEFINED}


def _estimate(words: str) -> Html:
    """An estimate, broken into two lines before its interval if at all."""
    value, bracket, interval = words.partition(" [")
    parts = (value, f"[{interval}") if bracket else (value,)
    numbers = joined(element("span", text(part), class_="number") for part in parts)
    return element("span", numbers)


def _measure_table(arm: Arm, rows: tuple[MeasureRow, ...], marks: dict[str, str]) -> Html:
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


Pictures = tuple[NDArray[np.uint8], NDArray[np.uint8]]
"""The source's body and the target's, each of shape (height, width, 3)."""


_CURVES_NOTE: Final = (
    "A thin line is one seed, a thick one the mean over seeds, a band its 95 % t-interval over "
    "seeds, cut off at the edges of the picture. A level is that of a policy that is not trained "
    "on the target. Counted in total steps, everything that comes from the source starts after its "
    "source steps."
)


def write_report(
    study: Study, path: Path, pictures: Pictures | None = None, picture_note: str = ""
) -> None:
    """Write the report of a study.

    Args:
        study: The study.
        path: The file, such as `results/demo/report.html`; its folder must exist.
        pictures: The two bodies; None if there are none.
        picture_note: Why there are no pictures, or what they show.

    Raises:
        MissingExtra: If matplotlib is not installed.
        OutputError: If the file cannot be written.
    """
    write_atomic(path, report_html(study, pictures, picture_note).encode())


def report_html(study: Study, pictures: Pictures | None = None, picture_note: str = "") -> str:
    """The report of a study as text, see `write_report`."""
    task = study.plan.task
    title = f"{short_name(task.source)} → {short_name(task.target)}"
    sections: tuple[tuple[str, str, Callable[[Study], Html]], ...] = (
        ("curves", "Learning curves on the target", _curves),
        ("measures", "Measures", measures),
        ("arms", "Arms", arms),
        ("shift", "What changes from source to target", shift),
        ("map", "Body map", body_map),
        ("learner", "Learner", learner),
        ("provenance", "Provenance", provenance),
    )
    body = joined(
        (
            element(
                "header",
                paragraph("Transfer study", class_="kind"),
                element("h1", text(title)),
                paragraph(verdict(study), class_="verdict"),
                headline(study),
            ),
            element(
                "main",
                _section("bodies", "The two bodies", _bodies(study, pictures, picture_note)),
                *(_section(name, heading, make(study)) for name, heading, make in sections),
            ),
        )
    )
    return page_text(title, body)


def _section(name: str, heading: str, content: Html) -> Html:
    return element("section", element("h2", text(heading)), content, id=name)


def _bodies(study: Study, pictures: Pictures | None, note: str) -> Html:
    """Both bodies side by side."""
    told = [paragraph(note, class_="note")] if note else []
    if pictures is None:
        return joined(told or [paragraph("There are no pictures.", class_="note")])
    plan = study.plan
    names = (
        ("Source", plan.task.source, plan.body_map.source_observation, plan.body_map.source_action),
        ("Target", plan.task.target, plan.body_map.target_observation, plan.body_map.target_action),
    )
    figures = [
        _figure(
            png_uri(picture),
            f"The body of {env}",
            f"{side}: {short_name(env)}, {_counted(observation.size, 'observation')}, "
            f"{_counted(action.size, 'action')}",
        )
        for picture, (side, env, observation, action) in zip(pictures, names, strict=True)
    ]
    return joined((element("div", *figures, class_="pair"), *told))


def _curves(study: Study) -> Html:
    """Both panels side by side."""
    # Matplotlib is needed here only, so that a terminal can show the table without it.
    from shapechanger.reports.charts import learning_curves

    panels = [
        _figure(
            svg_uri(learning_curves(study, "target")),
            "Mean return of each arm over target steps",
            "Counted in target steps",
        ),
        _figure(
            svg_uri(learning_curves(study, "total")),
            "Mean return of each arm over source and target steps",
            "Counted in total steps",
        ),
    ]
    return joined((element("div", *panels, class_="pair"), paragraph(_CURVES_NOTE, class_="note")))


def _figure(source: str, alternative: str, caption: str) -> Html:
    image = Html(f'<img src="{text(source)}" alt="{text(alternative)}">')
    return element("figure", image, element("figcaption", text(caption)))


def _counted(number: int, what: str) -> str:
    """As in `1 action` and `2 actions`."""
    return f"{number} {what}{'' if number == 1 else 's'}"
