"""One table that names the columns of a step in all formats, with their units and aliases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from shapechanger.layout import Feature

Kind = Literal["action", "state", "picture", "time", "number", "flag", "text", "json", "index"]


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a step.

    Attributes:
        field: Its name in a step.
        kind: Its type; "action" and "state" are vectors, "time" is a whole number of ns.
        names: Its name in each format that has it.
        aliases: Names in tables of others, each with its factor to the unit of the field.
    """

    field: str
    kind: Kind
    names: Mapping[str, str]
    aliases: Mapping[str, float] = field(default_factory=dict[str, float])


def _column(
    field: str, kind: Kind, aliases: Mapping[str, float] | None = None, **names: str
) -> Column:
    return Column(field, kind, names, aliases or {})


COLUMNS: Final = (
    _column("step", "index", csv="step", lerobot="frame_index", tub="_index", mcap="step"),
    _column(
        "frame",
        "picture",
        dict.fromkeys(("file", "image", "picture", "filename"), 1.0),
        csv="frame",
        minari="observations/image",
        lerobot="observation.images.camera",
        tub="cam/image_array",
        mcap="/camera",
    ),
    _column("driver", "text", csv="driver", minari="infos/driver", tub="user/mode", mcap="/step"),
    _column(
        "action",
        "action",
        csv="action/",
        minari="actions",
        lerobot="action",
        tub="user/, pilot/",
        mcap="/action",
    ),
    _column("applied", "action", csv="applied/", minari="infos/applied", mcap="/applied"),
    _column(
        "wanted",
        "action",
        csv="wanted/",
        minari="infos/wanted",
        tub="pilot/",
        mcap="/wanted",
    ),
    _column(
        "state",
        "state",
        csv="state/",
        minari="observations/state",
        lerobot="observation.state",
        tub="other numbers",
        mcap="/state",
    ),
    _column(
        "captured_ns",
        "time",
        {"timestamp": 1e9, "time": 1e9, "time_s": 1e9, "timestamp_ms": 1e6, "milliseconds": 1e6},
        csv="captured_ns",
        minari="infos/captured_ns",
        lerobot="timestamp",
        tub="_timestamp_ms",
        mcap="log time",
    ),
    _column("decided_ns", "time", csv="decided_ns", minari="infos/decided_ns", mcap="log time"),
    _column(
        "wall_ns",
        "time",
        csv="wall_ns",
        minari="infos/wall_ns",
        tub="_timestamp_ms",
        mcap="/step",
    ),
    _column(
        "reward",
        "number",
        csv="reward",
        minari="rewards",
        lerobot="next.reward",
        mcap="/reward",
    ),
    _column("terms", "json", csv="terms", minari="infos/more", mcap="/reward"),
    _column(
        "terminated",
        "flag",
        {"done": 1.0},
        csv="terminated",
        minari="terminations",
        lerobot="next.terminated",
        mcap="/step",
    ),
    _column(
        "truncated",
        "flag",
        csv="truncated",
        minari="truncations",
        lerobot="next.done",
        mcap="/step",
    ),
    _column("stop_reason", "text", csv="stop_reason", minari="infos/stop_reason", mcap="/step"),
    _column("marks", "json", csv="marks", minari="infos/more", mcap="/step"),
    _column("dropped", "text", csv="dropped", minari="infos/more", mcap="/step"),
)
"""All columns of a step, in the order of `steps.csv`."""

BY_FIELD: Final = {column.field: column for column in COLUMNS}

COMMANDS: Final = {
    "steering": Feature("steering", "1", -1.0, 1.0),
    "angle": Feature("steering", "1", -1.0, 1.0),
    "throttle": Feature("throttle", "1", -1.0, 1.0),
    **{key: Feature(key, "1", 0.0, 1.0) for key in ("forward", "backward", "right", "left")},
}
"""Values of an action by their names in tables of others; a key that is held is 1."""


def fields_of(*kinds: Kind) -> tuple[str, ...]:
    """Return the names of the fields of some kinds."""
    return tuple(column.field for column in COLUMNS if column.kind in kinds)


def name_in(form: str, field: str) -> str:
    """Return the name of a field in a format."""
    return BY_FIELD[field].names[form]


def as_markdown() -> str:
    """Return the table for the documentation."""
    forms = ("csv", "minari", "lerobot", "tub", "mcap")
    lines = [("Field", *forms), ("---",) * (1 + len(forms))]
    for column in COLUMNS:
        named = (f"`{name}`" if (name := column.names.get(form)) else "" for form in forms)
        lines.append((f"`{column.field}`", *named))
    return "\n".join(f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in lines)
