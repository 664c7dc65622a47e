"""One table that names the columns of a step in all formats, with their units and aliases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, cast

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
    aliases: Mapping[str, float]


_FORMATS: Final = ("csv", "minari", "lerobot", "tub", "mcap")
_NAMES: Final = """
step        | index   | step        |                    | frame_index               | _index          | /step
frame       | picture | frame       | observations/image | observation.images.camera | cam/image_array | /camera
driver      | text    | driver      | infos/driver       |                           | user/mode       | /step
action      | action  | action/     | actions            | action                    | user/, pilot/   | /action
applied     | action  | applied/    | infos/applied      |                           |                 | /applied
wanted      | action  | wanted/     | infos/wanted       |                           | pilot/          | /wanted
state       | state   | state/      | observations/state | observation.state         | other numbers   | /state
captured_ns | time    | captured_ns | infos/captured_ns  | timestamp                 | _timestamp_ms   | log time
decided_ns  | time    | decided_ns  | infos/decided_ns   |                           |                 | log time
wall_ns     | time    | wall_ns     | infos/wall_ns      |                           | _timestamp_ms   | /step
reward      | number  | reward      | rewards            | next.reward               |                 | /reward
terms       | json    | terms       | infos/more         |                           |                 | /reward
terminated  | flag    | terminated  | terminations       | next.terminated           |                 | /step
truncated   | flag    | truncated   | truncations        | next.done                 |                 | /step
stop_reason | text    | stop_reason | infos/stop_reason  |                           |                 | /step
marks       | json    | marks       | infos/more         |                           |                 | /step
dropped     | text    | dropped     | infos/more         |                           |                 | /step
"""  # noqa: E501
_ALIASES: Final[dict[str, dict[str, float]]] = {
    "frame": dict.fromkeys(("file", "image", "picture", "filename"), 1.0),
    "captured_ns": {"timestamp": 1e9, "time": 1e9, "timestamp_ms": 1e6, "milliseconds": 1e6},
    "terminated": {"done": 1.0},
}


def _column(line: str) -> Column:
    field, kind, *names = (cell.strip() for cell in line.split("|"))
    named = {form: name for form, name in zip(_FORMATS, names, strict=True) if name}
    return Column(field, cast("Kind", kind), named, _ALIASES.get(field, {}))


COLUMNS: Final = tuple(map(_column, _NAMES.strip().splitlines()))
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
    lines = [("Field", *_FORMATS), ("---",) * (1 + len(_FORMATS))]
    for column in COLUMNS:
        named = (f"`{name}`" if (name := column.names.get(form)) else "" for form in _FORMATS)
        lines.append((f"`{column.field}`", *named))
    return "\n".join(f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in lines)
