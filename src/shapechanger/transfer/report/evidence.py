"""The sections of the page that say what was compared, and how to do it again."""

from __future__ import annotations

from typing import Any, Final, cast

import msgspec

from shapechanger.pages.markup import (
    Html,
    details,
    joined,
    pairs,
    paragraph,
    pre,
    table,
    text,
)
from shapechanger.transfer.body_map import BodyMap, Row, Take
from shapechanger.transfer.body_map.entries import SAME_NAME
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.report.numbers import count, number
from shapechanger.transfer.settings import CloningSettings, SacSettings, Settings
from shapechanger.transfer.study import Study

__all__ = ["body_map", "learner", "provenance", "shift", "short_name"]

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


def _entry(row: Row) -> str:
    return f"{row.side}: {row.entry}"


def _share(matched: list[Row], rows: tuple[Row, ...], side: str) -> str:
    """As in `11 of 13`."""
    ours, every = (sum(row.side == side for row in some) for some in (matched, rows))
    return f"{ours} of {every}"


def _grouped(rows: list[Row]) -> list[tuple[Html, Html, Html]]:
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
        taken = {entry.rule.feature for entry in entries if isinstance(entry.rule, Take)}
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
