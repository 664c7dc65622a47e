"""The report of a transfer study: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import RenderError
from shapechanger.files import write_atomic
from shapechanger.reports.numbers import UNDEFINED, count, number
from shapechanger.reports.page import render
from shapechanger.transfer.body_map import BodyMap, Copy
from shapechanger.transfer.body_map.rules import SAME_NAME
from shapechanger.transfer.learners.presets import tuning_text
from shapechanger.transfer.report.verdict import (
    GOOD,
    ArmRow,
    MeasureRow,
    arm_rows,
    caveats,
    machine_text,
    measure_rows,
    other_arms,
    verdict,
    weak_individuals,
)
from shapechanger.transfer.study import Study

Pictures = tuple[NDArray[np.uint8], NDArray[np.uint8]]
"""The source's body and the target's, each of shape (height, width, 3)."""

# Text before the numbers of simple edits.
_SIMPLE: Final = {"factor": "x", "scale": "x", "to": ""}
# Titles of kinds of runs; the title of any other kind is its name.
_ARMS: Final = {"random": "random actions", "source": "source policy, in the source"}


def study_html(study: Study, pictures: Pictures | None = None, picture_note: str = "") -> str:
    """Render the report of a study."""
    from shapechanger.transfer.report.curves import learning_curves  # Imports Matplotlib.

    plan, names = study.plan, labels(study.plan.task.source, study.plan.task.target)
    measures, arms = measure_rows(study), arm_rows(study)
    summary = next(iter(study.summaries.values()))
    notes = list(dict.fromkeys(row.note for row in measures if _defined(row) and row.note))
    return render(
        Path(__file__).with_name("study.html"),
        title=" → ".join(names[str(env)] for env in (plan.task.source, plan.task.target)),
        study=study,
        plan=plan,
        verdict=verdict(study),
        other_arms=other_arms(study),
        weak=weak_individuals(study),
        cards=_cards(study, measures),
        bodies=_bodies(study, pictures, names) if pictures is not None else [],
        picture_note=picture_note,
        curves=learning_curves(study, "target", "total"),
        measures=[_measure_table(arm, measures, notes) for arm in study.summaries],
        notes=notes,
        summary=summary,
        number=number,
        caveats=caveats(study),
        good=f"{100.0 * GOOD:.0f} %",
        arms=[
            (
                _ARMS.get(row.kind, row.kind),
                *row[1:6],
                row.success or "not reported",
                row.good or "not measured",
                row.per_seed,
            )
            for row in arms
        ],
        terms=_terms(arms),
        map=_body_map(plan.body_map),
        rhythm=plan.settings.rhythm(),
        tuning=tuning_text(plan.learner, plan.task.target.id),
        settings=[
            (name, _setting(value))
            for name, value in msgspec.structs.asdict(cast("Any", plan.settings)).items()
        ],
        machine=machine_text([study]),
        wall_time=_duration(sum(result.wall_s for result in study.runs)),
        runs=[
            (r.run.name, r.seed, count(r.curve[-1].steps), len(r.curve), _duration(r.wall_s))
            for r in study.runs
        ],
    )


def write_study_report(study: Study, out: Path) -> Path:
    """Write the report of a study, without images of the bodies if they cannot be rendered."""
    path = out / "report.html"
    pictures, note = None, ""
    try:
        pictures = _pictures(study.plan.task.source, study.plan.task.target)
    except RenderError as error:
        note = str(error)
    write_atomic(path, study_html(study, pictures, note).encode())
    return path


def _pictures(source: EnvRef, target: EnvRef) -> tuple[Any, Any] | None:
    """Render both bodies in their start poses at one scale; None if an env cannot be rendered."""
    with closing(source.make()) as one, closing(target.make()) as other:
        both: list[Any] = [one.unwrapped, other.unwrapped]
        if not all(hasattr(env, "picture") for env in both):
            return None
        reach = max(env.reach for env in both)
        return both[0].picture(reach=reach), both[1].picture(reach=reach)


def labels(*envs: EnvRef) -> dict[str, str]:
    """Return a label such as `Hopper, leg x0.7` for each env, keyed by the env as text.

    It has all arguments except flags that all envs share, such as `put_back`.
    """
    flags = {name for name, value in envs[0].kwargs.items() if isinstance(value, bool)}
    shared = {name for name in flags if len({str(env.kwargs.get(name)) for env in envs}) == 1}
    return {str(env): _label(env, shared) for env in envs}


def _label(env: EnvRef, shared: set[str]) -> str:
    # The file of a user's robot is more specific than the env's name.
    name = env.kwargs.get("path", env.id.rpartition("/")[2].removesuffix("-v1"))
    own = [(key, value) for key, value in env.kwargs.items() if key not in {*shared, "path"}]
    return ", ".join([name, *(_argument(key, value) for key, value in own)])


def _argument(name: str, value: Any) -> str:
    """Format an argument of an env; JSON of edits becomes text such as `pole x3`."""
    if name == "body":
        with suppress(msgspec.DecodeError):
            edits = msgspec.json.decode(str(value), type=list[dict[str, Any]])
            return ", ".join(map(_edit, edits))
    known = name in {"body", "lenses", "task"}
    return f"{'' if known else name.replace('_', ' ') + ' '}{_setting(value)}"


def _edit(edit: dict[str, Any]) -> str:
    """Format an edit: `leg x0.7` for a stretch, and `torso mass x2` for other simple edits."""
    kind = edit["edit"].replace("_", " ")
    names = [value for key, value in edit.items() if key != "edit" and isinstance(value, str)]
    numbers = [
        f"{_SIMPLE.get(key, f'{key} ')}{_setting(value)}"
        for key, value in edit.items()
        if not isinstance(value, str)
    ]
    if len(names) > 1 or not edit.keys() <= {"edit", "body", "element", *_SIMPLE}:
        return " ".join([kind, *names, *numbers])
    # `shank_*` is every shank.
    nouns = [name.removesuffix("*").removesuffix("_") for name in names]
    return " ".join(filter(None, [*nouns, "" if kind == "stretch" else kind, *numbers]))


def _cards(study: Study, measures: tuple[MeasureRow, ...]) -> list[dict[str, str]]:
    """Return the headline arm's gains and time to the last threshold, without undefined ones."""
    rows = [row for row in measures if row.arm == study.headline_arm]
    cards: list[dict[str, str]] = []
    for row in (rows[1], rows[0], rows[2], rows[-1]):
        if row.target == UNDEFINED:
            continue
        value, bracket, interval = row.target.partition(" [")
        value, _, missing = value.partition(" (")
        cards.append(
            {
                "label": row.measure,
                "value": value,
                "unit": "" if row.unit == "steps" else row.unit,
                "interval": f"[{interval}" if bracket else missing.rstrip(")"),
                "total": f"total steps: {row.total}",
            }
        )
    return cards


def _bodies(study: Study, pictures: Pictures, names: Mapping[str, str]) -> list[dict[str, Any]]:
    plan = study.plan
    ours = plan.body_map
    sides = (
        ("Source", plan.task.source, ours.source_observation, ours.source_action),
        ("Target", plan.task.target, ours.target_observation, ours.target_action),
    )
    return [
        {
            "picture": picture,
            "caption": f"{side}: {names[str(env)]} ({_plural(observation.size, 'observation')}, "
            f"{_plural(action.size, 'action')})",
            "alt": f"The body of {env}",
        }
        for picture, (side, env, observation, action) in zip(pictures, sides, strict=True)
    ]


def _plural(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _defined(row: MeasureRow) -> bool:
    return {row.target, row.total} != {UNDEFINED}


def _measure_table(arm: str, rows: tuple[MeasureRow, ...], notes: list[str]) -> dict[str, Any]:
    """Return the defined measures of one arm, and notes on its undefined measures."""
    cells: list[tuple[str, ...]] = []
    undefined: dict[str, list[str]] = {}
    for row in rows:
        if row.arm != arm:
            continue
        if _defined(row):
            mark = f"({notes.index(row.note) + 1})" if row.note else ""
            cells.append((row.measure, row.target, row.total, row.unit, row.method, mark))
        else:
            undefined.setdefault(row.note, []).append(row.measure)
    return {
        "caption": f"{arm.capitalize()} against scratch",
        "rows": cells,
        "undefined": [f"{'; '.join(names)}. {note}" for note, names in undefined.items()],
    }


def _terms(arms: tuple[ArmRow, ...]) -> dict[str, Any]:
    """Return a row of reward terms for each kind of run; without rows if the env reports none."""
    names = dict.fromkeys(name for row in arms for name in row.terms)
    return {
        "header": ("Runs", *(name.removeprefix("reward_") for name in names)),
        "rows": [
            (
                _ARMS.get(row.kind, row.kind),
                *(number(row.terms[name]) if name in row.terms else "none" for name in names),
            )
            for row in arms
            if names
        ],
    }


def _body_map(ours: BodyMap) -> dict[str, Any]:
    """Describe the map; entries that copy a feature of the same name are listed separately."""
    rows = ours.table()
    matched = [row for row in rows if row.why == SAME_NAME]
    groups: dict[tuple[str, str, str], list[str]] = {}
    for row in rows:
        if row.why != SAME_NAME:
            groups.setdefault((row.side, row.rule, row.why), []).append(row.entry)
    observations, actions = (
        " of ".join(str(sum(row.side == side for row in some)) for some in (matched, rows))
        for side in ("observation", "action")
    )
    return {
        "matched_observations": observations,
        "matched_actions": actions,
        "others": [
            (f"{side}: {', '.join(entries)}", rule, why)
            for (side, rule, why), entries in groups.items()
        ],
        "unused": _unused(ours),
        "matched": [(f"{row.side}: {row.entry}", row.rule, row.why) for row in matched],
    }


def _unused(ours: BodyMap) -> list[str]:
    """Return sentences that list target observations and source actions that no rule copies."""
    unseen = "Target observations that the source policy does not see"
    sides = (
        (unseen, ours.observation, ours.target_observation),
        ("Source actions that move nothing in the target", ours.action, ours.source_action),
    )
    sentences: list[str] = []
    for title, entries, layout in sides:
        copied = {entry.rule.feature for entry in entries if isinstance(entry.rule, Copy)}
        if left := [name for name in layout.names if name not in copied]:
            sentences.append(f"{title}: {', '.join(left)}.")
    return sentences


def _setting(value: Any) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(map(_setting, cast("list[Any]", value)))
    if isinstance(value, float):
        return f"{value:.15g}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _duration(seconds: float) -> str:
    if seconds < 100.0:
        return f"{number(seconds, 1)} s"
    minutes = seconds / 60.0
    return f"{number(minutes, 1)} min" if minutes < 100.0 else f"{number(minutes / 60.0, 1)} h"
