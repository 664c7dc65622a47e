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
from decimal import Decimal
from itertools import chain
from pathlib import Path
from typing import Any, Final, cast

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import files, imports
from shapechanger.demos.exchange.format import (
    COLUMNS,
    COMMANDS,
    ExchangeEpisode,
    ExportContext,
    Format,
    ImportContext,
    value_names,
)
from shapechanger.demos.exchange.imports import SourceRecord
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

_TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"
_NAMES: Final = {field: column.names["csv"] for field, column in COLUMNS.items()}
_VECTORS: Final = [f for f, column in COLUMNS.items() if column.kind in {"action", "state"}]
_MUST_BE: Final = {"index": "an integer", "time": "a time", "flag": "true or false"}
_JSON: Final[dict[str, tuple[Any, str]]] = {
    "terms": (dict[str, float], "a JSON object of numbers"),
    "marks": (list[str], "a JSON array of strings"),
    "stop_reason": (str, "a JSON string"),
    "dropped": (str, "a JSON string"),
}
_MAX_TIME: Final = 1 << 62  # ns, as in a step.


def _tables_of(folder: Path) -> list[Path]:
    """Return the folders with a `steps.csv`: the folder itself, or its subfolders."""
    if (folder / _TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / _TABLE).is_file())
    except OSError as error:
        raise files.cannot_read(folder, error) from error


def _columns(header: EpisodeHeader) -> dict[str, list[str]]:
    """Return the names of the columns of each field of a step, in order."""
    states = Layout.from_json(header.state_layout) if header.state_layout else ()
    actions = Layout.from_json(header.action_layout)
    values = {"action": value_names(actions), "state": value_names(states)}
    return {
        field: [_NAMES[field] + name for name in values.get(column.kind, [""])]
        for field, column in COLUMNS.items()
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
    text = json.dumps(files.own_fields(episode), indent=1, ensure_ascii=False)
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
    for place in _tables_of(folder):
        if (place / _HEADER).is_file():
            yield _own(place, context)
        else:
            yield from _others(place, context)


def _own(folder: Path, context: ImportContext) -> ExchangeEpisode:
    if context.hz is not None:
        raise DemosError("The format csv states the rate itself: leave out --hz.")
    path = folder / _HEADER
    header, outcome = files.own_header(files.read_json_object(path), path)
    columns = _columns(header)
    expected = list(chain.from_iterable(columns.values()))
    table = _Table(folder / _TABLE, context, len(expected))
    table.columns = columns
    if table.names != expected:
        missing = [name for name in expected if name not in table.names]
        surplus = [repr(name) for name in table.names if name not in expected]
        problems = [f"lacks {', '.join(missing[:5])}"] if missing else []
        problems += [f"has the unknown {', '.join(surplus[:5])}"] if surplus else []
        what = " and ".join(problems) or "has its columns in another order"
        raise DemosError(f"{table.path} {what}: the columns must be those of {_HEADER}.")
    records = table.records(folder / _FRAMES)
    if header.image_size is None and any(record.frame for record in records):
        raise DemosError(f"{table.path} has images, but {path} has no image_size.")
    rows = imports.rows_of(records, header.image_size, context, "line")
    return ExchangeEpisode(header=header, rows=rows, name=str(folder), outcome=outcome)


def _others(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a table without a header."""
    table = _Table(folder / _TABLE, context)
    table.factors = dict(map(_known_name, table.names))
    table.names = [_known_name(name)[0] for name in table.names]
    for field, name in _NAMES.items():
        known = [other for other in table.names if other.startswith(name)]
        table.columns[field] = known if field in _VECTORS else [name]
    if not table.columns["action"]:
        raise DemosError(
            f"There is no {_HEADER} next to {table.path}, and no column of an action: restore it, "
            f"or name columns action/NAME, or {', '.join(COMMANDS)}."
        )
    taken = set(chain.from_iterable(table.columns.values()))
    if others := [name for name in table.names if name not in taken]:
        context.note(f"Columns that are not imported: {', '.join(others)}.")
    if len(set(table.names)) < len(table.names):
        raise DemosError(f"{table.path} has two columns of one name: rename one of them.")
    records, size = imports.with_pictures(table.records(folder), "line", context)
    layouts: list[str] = []
    for field in ("action", "state"):
        names = [name.removeprefix(_NAMES[field]) for name in table.columns[field]]
        features = [COMMANDS.get(name) or imports.features_of(name, 1)[0] for name in names]
        layouts.append(imports.as_json(features))
    for part, hz, timed in imports.stretches([records] if records else [], "line", context):
        header = EpisodeHeader(
            action_layout=layouts[0],
            state_layout=layouts[1],
            image_size=size,
            control_hz=hz,
            clock="real" if timed else "none",
            source="csv",
        )
        rows = imports.rows_of(part, size, context, "line")
        yield ExchangeEpisode(header=header, rows=rows, name=f"{folder}, from {part[0].name}")


def _known_name(name: str) -> tuple[str, int]:
    """Return the name of a column of others as in `steps.csv`, and its factor to that unit."""
    plain = name.strip().lower()
    if plain in COMMANDS:
        return _NAMES["action"] + COMMANDS[plain].name, 1
    for field, column in COLUMNS.items():
        if plain in column.aliases:
            return _NAMES[field], column.aliases[plain]
    return name.strip(), 1


class _Table:
    """A `steps.csv`.

    With another separator than commas, numbers may have decimal commas.

    Attributes:
        path: The file.
        names: Names of its columns.
        columns: Names of the columns of each field of a step.
        factors: Factors to ns; only of a table of others, which may lack columns.
    """

    def __init__(self, path: Path, context: ImportContext, columns: int = 1) -> None:
        self._separator, table = files.read_table(path, columns)
        self.path = path
        self.names = table[0][1] if table else []
        self.columns: dict[str, list[str]] = {}
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
            record.picture = frames / frame if frame else None
            if frame and not files.is_inside(frames, frame):
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
        fields = {field: self._value(field, found) for field in COLUMNS}
        number = position if self.factors else fields["step"]
        if number is None or fields["action"] is None:
            raise DemosError(f"the {'step' if number is None else 'action'} is empty.")
        marks, dropped, frame, _ = map(fields.pop, ("marks", "dropped", "frame", "step"))
        if fields["state"] is None:
            fields["state"] = (math.nan,) * len(self.columns["state"])
        known = {field: value for field, value in fields.items() if value is not None}
        known.setdefault("driver", "person" if self.factors else "")
        return SourceRecord(
            name=name,
            step=Step(**known),
            number=number,
            frame=frame or "",
            marks=tuple(marks or ()),
            dropped=dropped,
        )

    def _value(self, field: str, cells: Mapping[str, str]) -> Any:
        names = self.columns[field]
        if field not in _VECTORS:
            cell = cells.get(names[0], "")
            must_be_there = COLUMNS[field].kind == "flag" and not self.factors
            return self._parsed(field, names[0], cell) if cell or must_be_there else None
        values = [self._parsed(field, name, cells[name]) for name in names if cells[name]]
        if values and len(values) < len(names):
            raise DemosError(f"some values of {field} are empty, but not all.")
        return tuple(values) or None

    def _parsed(self, field: str, name: str, cell: str) -> Any:
        kind, factor = COLUMNS[field].kind, self.factors.get(name, 1)
        plain = cell.strip() if self._separator == "," else cell.strip().replace(",", ".")
        try:
            if field in _JSON:
                return msgspec.json.decode(cell, type=_JSON[field][0], strict=False)
            if kind in {"text", "picture"}:
                return cell
            if kind == "flag":  # Spreadsheets write TRUE.
                return msgspec.convert(plain, bool, strict=False)
            if kind not in {"time", "index"}:
                return float(plain)
            value = Decimal(plain) * factor
            if abs(value) <= _MAX_TIME and (factor > 1 or value == value.to_integral_value()):
                return int(value)
        except (ValueError, ArithmeticError, RecursionError, msgspec.MsgspecError):
            pass
        expected = _JSON[field][1] if field in _JSON else _MUST_BE.get(kind, "a number")
        raise DemosError(f"{name} must be {expected}, got {cell[:60]!r}.")


FORMAT: Final = Format(
    name="csv",
    title="CSV",
    sign=_TABLE,
    detect=lambda folder: bool(_tables_of(folder)),
    read=_read,
    write=_write,
    options=frozenset({"dropped", "hz"}),
)
