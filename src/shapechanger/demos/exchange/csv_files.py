"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are written so that they are read back exactly; an empty cell is a missing value, `nan` a
value that nothing measured. Texts are written as JSON with its quotes, so that no spreadsheet takes
one for a formula, and line ends and other special characters survive.

Without a header, `steps.csv` is a table of others: its columns are known by their names or aliases
in `COLUMNS`, and its images lie in the same folder.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from itertools import chain
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.exports import value_names
from shapechanger.demos.exchange.files import (
    cannot_read,
    is_inside,
    read_json_object,
    read_table,
)
from shapechanger.demos.exchange.format import (
    COLUMNS,
    COMMANDS,
    Column,
    ExchangeEpisode,
    ExportContext,
    Format,
    ImportContext,
    fields_of,
    name_in,
)
from shapechanger.demos.exchange.imports import (
    SourceRecord,
    as_json,
    episode_of,
    features_of,
    stretches,
    with_pictures,
)
from shapechanger.errors import DemosError, LayoutError
from shapechanger.layout import Layout

_TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"
_VECTORS: Final = fields_of("action", "state")
_NAMES: Final = {column.field: column.names["csv"] for column in COLUMNS}
_MUST_BE: Final = {
    "index": "an integer",
    "time": "a time",
    "flag": "true or false",
    "text": "a JSON string",
    "terms": "a JSON object",
    "marks": "a JSON array",
}
_FLAGS: Final = {"true": True, "1": True, "false": False, "0": False}
_MAX_NAMED: Final = 5
_MAX_QUOTED: Final = 60
_MAX_TIME: Final = 1 << 62  # ns, as in a step.


def _tables_of(folder: Path) -> list[Path]:
    """Return the folders with a `steps.csv`: the folder itself, or its subfolders."""
    if (folder / _TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / _TABLE).is_file())
    except OSError as error:
        raise cannot_read(folder, error) from error


def _columns(header: EpisodeHeader) -> dict[str, list[str]]:
    """Return the names of the columns of each field of a step, in order."""
    of_action = value_names(Layout.from_json(header.action_layout))
    of_state = value_names(Layout.from_json(header.state_layout)) if header.state_layout else []
    values = {"action": of_action, "state": of_state}
    return {
        column.field: [column.names["csv"] + name for name in values.get(column.kind, [""])]
        for column in COLUMNS
    }


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes; several episodes get a subfolder each."""
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder if len(episodes) == 1 else folder / f"episode-{number:04d}"
        (place / _FRAMES).mkdir(parents=True)
        steps += _write_episode(episode, place)
    return steps


def _write_episode(episode: ExchangeEpisode, folder: Path) -> int:
    columns = _columns(episode.header)
    header = episode.header.to_json() | {"outcome": episode.outcome}
    text = json.dumps(header, indent=1, ensure_ascii=False)
    (folder / _HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
    frame, number = "", 0
    with (folder / _TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(chain.from_iterable(columns.values()))
        for number, row in enumerate(episode.rows, 1):
            if row.jpeg is not None:
                frame = f"{number - 1:06d}.jpg"
                (folder / _FRAMES / frame).write_bytes(row.jpeg)
            cells = [str(number - 1), frame, row.step.driver]
            for field, names in list(columns.items())[3:]:
                value = getattr(row if field in {"marks", "dropped"} else row.step, field)
                if field in _VECTORS:
                    cells += [""] * len(names) if value is None else map(_cell, value)
                elif field == "dropped" and value is not None:
                    cells.append(json.dumps(value))
                else:
                    cells.append(_cell(value))
            writer.writerow(cells)
    return number


def _cell(value: Any) -> str:
    """Return a cell; an empty one for None, and for an empty text, list or dictionary."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return repr(value)
        case dict():  # JSON has neither NaN nor infinity.
            numbers = cast("dict[str, float]", value)
            value = {n: v if math.isfinite(v) else repr(v) for n, v in numbers.items()}
        case _:
            pass
    return json.dumps(value) if value else ""


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a folder."""
    for place in _tables_of(folder):
        path = place / _HEADER
        if path.is_file():
            yield _own(place, path, context)
        else:
            yield from _others(place, context)


def _own(folder: Path, path: Path, context: ImportContext) -> ExchangeEpisode:
    """Return the episode of a folder that Shapechanger exported."""
    if context.hz is not None:
        raise DemosError("The format csv states the rate itself: leave out --hz.")
    fields = read_json_object(path)
    try:
        header = EpisodeHeader.from_json(fields)
        columns = _columns(header)
    except (DemosError, LayoutError) as error:
        raise DemosError(f"{path}: {error}") from error
    table = _Table(folder / _TABLE, columns, context)
    expected = list(chain.from_iterable(columns.values()))
    if table.names != expected:
        missing = [name for name in expected if name not in table.names]
        surplus = [repr(name) for name in table.names if name not in expected]
        problems = [f"lacks {', '.join(missing[:_MAX_NAMED])}"] if missing else []
        problems += [f"has the unknown {', '.join(surplus[:_MAX_NAMED])}"] if surplus else []
        what = " and ".join(problems) or "has its columns in another order"
        raise DemosError(f"{table.path} {what}: the columns must be those of {_HEADER}.")
    records = table.records(folder / _FRAMES)
    if header.image_size is None and any(record.frame for record in records):
        raise DemosError(f"{table.path} has images, but {path} has no image_size.")
    outcome = str(fields.get("outcome", ""))
    return episode_of(records, header, context, name=str(folder), what="line", outcome=outcome)


def _others(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a table without a header."""
    table = _Table(folder / _TABLE, {}, context)
    known = [_known_name(name) for name in table.names]
    table.names = [name for name, _ in known]
    table.factors = dict(known)
    values = {
        field: [name for name in table.names if name.startswith(_NAMES[field])]
        for field in _VECTORS
    }
    if not values["action"]:
        raise DemosError(
            f"There is no {_HEADER} next to {table.path}, and no column of an action: restore it, "
            f"or name columns action/NAME, or {', '.join(COMMANDS)}."
        )
    table.columns = {field: values.get(field, [name]) for field, name in _NAMES.items()}
    taken = set(chain.from_iterable(table.columns.values()))
    if others := [name for name in table.names if name not in taken]:
        context.note(f"Columns that are not imported: {', '.join(others)}.")
    if len(set(table.names)) < len(table.names):
        raise DemosError(f"{table.path} has two columns of one name: rename one of them.")
    records, size = with_pictures(table.records(folder), "line", context)

    def layout(field: str) -> str:
        names = [name.removeprefix(_NAMES[field]) for name in values[field]]
        return as_json([COMMANDS.get(name) or features_of(name, 1)[0] for name in names])

    for part, hz, _, timed in stretches([records] if records else [], "line", context):
        header = EpisodeHeader(
            action_layout=layout("action"),
            state_layout=layout("state"),
            image_size=size,
            control_hz=hz,
            clock="real" if timed else "none",
            source="csv",
        )
        name = f"{folder}, from {part[0].name}"
        yield episode_of(part, header, context, name=name, what="line")


def _known_name(name: str) -> tuple[str, int]:
    """Return the name of a column of others as in `steps.csv`, and its factor to that unit."""
    plain = name.strip().lower()
    if plain in COMMANDS:
        return name_in("csv", "action") + COMMANDS[plain].name, 1
    for column in COLUMNS:
        if plain in column.aliases:
            return column.names["csv"], int(column.aliases[plain])
    return name.strip(), 1


class _Table:
    """A `steps.csv`.

    With another separator than commas, numbers may have decimal commas.

    Attributes:
        path: The file.
        names: Names of its columns.
        columns: Those of each field of a step.
        factors: Factors to ns; only of a table of others, which may lack columns.
    """

    def __init__(
        self, path: Path, columns: Mapping[str, Sequence[str]], context: ImportContext
    ) -> None:
        expected = sum(map(len, columns.values()))
        self._separator, table = read_table(path, expected or 1)
        self.path = path
        self.names = table[0][1] if table else []
        self.columns = columns
        self.factors: Mapping[str, int] = {}
        self._lines = table[1:]
        self._context = context

    def records(self, frames: Path) -> list[SourceRecord]:
        """Return the lines that can be read, with their images; the others are left out."""
        found: list[SourceRecord] = []
        before, shown, known = -1, "", set[str]()
        for position, (line, cells) in enumerate(self._lines):
            try:
                record = self._record(f"line {line}", position, cells)
                if record.number <= before:
                    raise DemosError(f"step {record.number} comes after step {before}.")
            except DemosError as error:
                reason = str(error).removesuffix(".")
                self._context.leave_out("line", f"of {self.path}", f"line {line}: {reason}")
                continue
            before = record.number
            found.append(record)
            frame = cast("str", record.frame)
            if frame:
                record.picture = frames / frame
            if frame and not is_inside(frames, frame):
                record.fault = "with an image name that leaves the folder"
            elif frame != shown and frame in known:
                record.fault = f"that returns to the image {frame!r} of an earlier step"
            elif not frame and shown:
                record.fault = "without an image"
            else:
                shown = frame
                known.add(frame)
        return found

    def _record(self, name: str, position: int, cells: Sequence[str]) -> SourceRecord:
        if len(cells) != len(self.names):
            hint = " (decimal commas need another separator)" if self._separator == "," else ""
            raise DemosError(f"{len(cells)} cells instead of {len(self.names)}{hint}.")
        found = dict(zip(self.names, cells, strict=True))
        fields = {column.field: self._value(column, found) for column in COLUMNS}
        number = position if self.factors else fields["step"]
        if number is None or fields["action"] is None:
            raise DemosError(f"the {'step' if number is None else 'action'} is empty.")
        marks, dropped = fields.pop("marks"), fields.pop("dropped")
        frame = fields.pop("frame") or ""
        del fields["step"]
        fields["driver"] = fields["driver"] or ("person" if self.factors else "")
        if fields["state"] is None:
            fields["state"] = (math.nan,) * len(self.columns["state"])
        known = {field: value for field, value in fields.items() if value is not None}
        try:
            terms = {term: float(value) for term, value in known.pop("terms", {}).items()}
        except (ValueError, TypeError) as error:
            raise DemosError(f"terms must be numbers ({error}).") from error
        return SourceRecord(
            name=name,
            step=Step(terms=terms, **known),
            number=number,
            frame=frame,
            marks=tuple(map(str, marks or ())),
            dropped=dropped,
        )

    def _value(self, column: Column, cells: Mapping[str, str]) -> Any:
        """Return the value of a field; None for empty cells."""
        names = self.columns[column.field]
        if column.field not in _VECTORS:
            cell = cells.get(names[0], "")
            if column.kind == "flag" and not cell and not self.factors:
                cell = "an empty cell"
            return self._parsed(column, names[0], cell) if cell else None
        values = [self._parsed(column, name, cells[name]) for name in names if cells[name]]
        if values and len(values) < len(names):
            raise DemosError(f"some values of {column.field} are empty, but not all.")
        return tuple(values) if values or (column.kind == "state" and not names) else None

    def _parsed(self, column: Column, name: str, cell: str) -> Any:
        plain = cell if self._separator == "," else cell.replace(",", ".")
        factor = self.factors.get(name, 1)
        expected = _MUST_BE.get(column.kind, "a number")
        try:
            match column.kind:
                case "text" | "json" if name not in {"driver"}:
                    expected = _MUST_BE.get(column.field, expected)
                    value = json.loads(cell)
                    kind = {"terms": dict, "marks": list}.get(column.field, str)
                    if isinstance(value, kind):
                        return cast("Any", value)
                case "text" | "picture":
                    return cell
                case "flag":
                    return _FLAGS[cell.strip().lower()]  # Spreadsheets write TRUE.
                case "time" | "index":
                    value = Decimal(plain) * factor
                    whole = factor > 1 or value == value.to_integral_value()
                    if abs(value) <= _MAX_TIME and whole:
                        return int(value)
                case _:
                    return float(plain)
        except (ValueError, KeyError, InvalidOperation, RecursionError) as error:
            why = f"{name} must be {expected}, got {cell[:_MAX_QUOTED]!r}."
            raise DemosError(why) from error
        raise DemosError(f"{name} must be {expected}, got {cell[:_MAX_QUOTED]!r}.")


FORMAT: Final = Format(
    name="csv",
    title="CSV",
    sign=_TABLE,
    detect=lambda folder: bool(_tables_of(folder)),
    read=_read,
    write=_write,
    options=frozenset({"dropped", "hz"}),
)
