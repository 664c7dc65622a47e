"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are written so that they are read back exactly; an empty cell is a missing value, `nan` a
value that nothing measured. Texts are written as JSON with its quotes, so that no spreadsheet takes
one for a formula, and line ends and other special characters survive.

Without a header, `steps.csv` is a table of others: its columns are known by their names or aliases
in `columns`, and its pictures lie beside it.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar, cast

from msgspec import structs

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES
from shapechanger.demos.exchange.files import (
    UNIT_UNKNOWN,
    cannot_read,
    inside,
    parse_json,
    read_bytes,
    read_json_object,
    read_table,
)
from shapechanger.demos.exchange.format import (
    BY_FIELD,
    COLUMNS,
    COMMANDS,
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    Format,
    ImportContext,
    fields_of,
    name_in,
    value_names,
)
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.exchange.times import TimedDrive, choose_rates, split_at_jumps
from shapechanger.demos.jpeg import picture_size
from shapechanger.errors import DemosError, LayoutError, UnknownName
from shapechanger.layout import Feature, Layout

_TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"
_JSON_TYPES: Final[dict[str, tuple[type, str]]] = {
    "terms": (dict, "object"),
    "marks": (list, "array"),
    "stop_reason": (str, "string"),
    "dropped": (str, "string"),
}
_MAX_NAMED: Final = 5
_MAX_QUOTED: Final = 60
_MAX_TIME: Final = 4e9  # In the unit of the column, of which ns fit into 64 bits.

_N = TypeVar("_N", int, float)


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
                if BY_FIELD[field].kind in {"action", "state"}:
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
        case tuple():
            value = list(cast("tuple[str, ...]", value))
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
        if not path.is_file():
            yield from _read_others(place, context)
            continue
        if context.hz is not None:
            raise DemosError("The format csv states the rate itself: leave out --hz.")
        fields = read_json_object(path)
        try:
            header = EpisodeHeader.from_json(fields)
            columns = _columns(header)
        except (DemosError, LayoutError) as error:
            raise DemosError(f"{path}: {error}") from error
        names = list(chain.from_iterable(columns.values()))
        lines = _lines(place, columns, names, None, context)
        yield ExchangeEpisode(
            header=header,
            rows=_with_pictures(lines, place / _FRAMES, header, context),
            name=str(place),
            outcome=str(fields.get("outcome", "")),
        )


def _read_others(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episode of a table without a header, unless it is empty."""
    path = folder / _TABLE
    _, lines = read_table(path)
    named = [_known_name(name) for name in (lines[0][1] if lines else [])]
    found = [name for name, _ in named]
    prefix = {field: name_in("csv", field) for field in fields_of("action", "state")}
    values = {
        field: [name for name in found if name.startswith(start)] for field, start in prefix.items()
    }
    if not values["action"]:
        raise DemosError(
            f"There is no {_HEADER} beside {path}, and no column of an action: restore it, or name "
            f"columns action/NAME, or {', '.join(COMMANDS)}."
        )
    columns = {c.field: values.get(c.field, [c.names["csv"]]) for c in COLUMNS}
    known = set(chain.from_iterable(columns.values()))
    if others := [name for name in found if name not in known]:
        context.note(f"Columns that are not imported: {', '.join(others)}.")
    if len(set(found)) < len(found):
        raise DemosError(f"{path} has two columns of one name: rename one of them.")
    parsed = list(_lines(folder, columns, found, dict(named), context))
    if not parsed:
        return
    times = [line.step.captured_ns for line in parsed if line.step.captured_ns is not None]
    timed = len(times) == len(parsed)
    drive = TimedDrive(times if timed else (), [line.number for line in parsed], "line 2")
    (hz,), believed = choose_rates([drive], context)
    if not (timed and believed):
        drive = replace(drive, times_ns=())
        parsed = [one._replace(step=structs.replace(one.step, captured_ns=None)) for one in parsed]
    size = None
    if shown := next((line.frame for line in parsed if line.frame), ""):
        size = picture_size(read_bytes(inside(folder, shown, path), MAX_PICTURE_BYTES), shown)

    def layout(field: str) -> str:
        names = [name.removeprefix(prefix[field]) for name in values[field]]
        features = (COMMANDS.get(name, Feature(name, UNIT_UNKNOWN)) for name in names)
        return Layout(tuple(features)).to_json() if names else ""

    header = EpisodeHeader(
        action_layout=layout("action"),
        state_layout=layout("state"),
        image_size=size,
        control_hz=hz,
        clock="real" if timed and believed else "none",
        source="csv",
    )
    names = [line.where.rpartition(", ")[2] for line in parsed]
    (places,) = split_at_jumps([drive], [names], [hz], context)
    for place in places:
        rows = _with_pictures(parsed[place], folder, header, context)
        name = f"{folder}, from {names[place.start]}"
        yield ExchangeEpisode(header=header, rows=rows, name=name)


def _known_name(name: str) -> tuple[str, float]:
    """Return the name of a column of others as in `steps.csv`, and its factor to that unit."""
    plain = name.strip().lower()
    if plain in COMMANDS:
        return name_in("csv", "action") + COMMANDS[plain].name, 1.0
    for column in COLUMNS:
        if plain in column.aliases:
            return column.names["csv"], column.aliases[plain]
    return name.strip(), 1.0


class _Line(NamedTuple):
    """A line of a table, its number among them, and how to name it in errors."""

    number: int
    step: Step
    frame: str
    where: str
    marks: tuple[str, ...]
    dropped: str | None


def _with_pictures(
    lines: Iterable[_Line], frames: Path, header: EpisodeHeader, context: ImportContext
) -> Iterator[ExchangeStep]:
    """Yield the steps of lines, each with its picture; the others are left out."""
    pictures = Pictures(header.image_size)
    shown, known = "", set[str]()
    for line in lines:
        jpeg = None
        try:
            if line.frame != shown:
                if header.image_size is None:
                    raise DemosError(
                        f"{line.where} has a picture, but {_HEADER} has no image_size."
                    )
                if line.frame in known:
                    raise DemosError(
                        f"{line.where} returns to the picture {line.frame!r} of an earlier step."
                    )
                path = inside(frames, line.frame, line.where)
                jpeg = read_bytes(path, MAX_PICTURE_BYTES)
                pictures.check(jpeg, str(path))
        except DemosError as error:
            _leave_out(context, error, line.where)
            continue
        shown = line.frame
        known.add(shown)
        yield ExchangeStep(step=line.step, jpeg=jpeg, marks=line.marks, dropped=line.dropped)


def _leave_out(context: ImportContext, error: DemosError, where: str) -> None:
    table = where.rpartition(", ")[0]
    context.leave_out("line", f"of {table}", str(error).removeprefix(f"{table}, ")[:-1])


def _lines(
    folder: Path,
    columns: dict[str, list[str]],
    names: Sequence[str],
    factors: Mapping[str, float] | None,
    context: ImportContext,
) -> Iterator[_Line]:
    """Yield the lines of a table that can be read; the others are left out.

    `columns` are those of each field of a step, `names` those of the table, in order, and `factors`
    those of the columns of others; None for a table of Shapechanger.
    """
    path = folder / _TABLE
    separator, table = read_table(path, len(names))
    found = table[0][1] if table else []
    if factors is None and found != list(names):
        missing = [name for name in names if name not in found]
        surplus = [repr(name) for name in found if name not in names]
        problems = [f"lacks {', '.join(missing[:_MAX_NAMED])}"] if missing else []
        problems += [f"has the unknown {', '.join(surplus[:_MAX_NAMED])}"] if surplus else []
        what = " and ".join(problems) or "has its columns in another order"
        raise DemosError(f"{path} {what}: the columns must be those of {_HEADER}.")
    before = -1
    for position, (line, cells) in enumerate(table[1:]):
        where = f"{path}, line {line}"
        try:
            if len(cells) != len(names):
                hint = " (decimal commas need another separator)" if separator == "," else ""
                raise DemosError(f"{where} has {len(cells)} cells instead of {len(names)}{hint}.")
            row = _Row(dict(zip(names, cells, strict=True)), where, separator)
            number = row.number("step", int) if factors is None else position
            if number is None:
                raise DemosError(f"{where}: step is empty.")
            if number <= before:
                raise DemosError(f"{where}: step {number} comes after step {before}.")
            parsed = row.line(number, columns, factors or {})
        except DemosError as error:
            _leave_out(context, error, where)
            continue
        before = number
        yield parsed


@dataclass(frozen=True, slots=True)
class _Row:
    """The cells of a line by the names of their columns.

    With another separator than commas, numbers may have decimal commas.
    """

    cells: dict[str, str]
    where: str
    separator: str

    def line(
        self, number: int, columns: dict[str, list[str]], factors: Mapping[str, float]
    ) -> _Line:
        """Return the parsed line; a table of others, which has factors, may lack columns."""
        driver = self.cells.get("driver") or ("person" if factors else "")
        if driver not in DRIVERS:
            raise DemosError(f"{self.where}: {UnknownName('driver', driver, DRIVERS)}")
        fields: dict[str, Any] = {}
        for column in COLUMNS:
            name = column.names["csv"]
            match column.kind:
                case "action" | "state":
                    values = self._vector(column.field, columns[column.field])
                    fields[column.field] = values if column.kind == "state" else values or None
                case "time":
                    fields[column.field] = self._time(name, factors)
                case "number":
                    fields[column.field] = self.number(name, float)
                case "flag":
                    fields[column.field] = self._flag(name, "false" if factors else "")
                case "json" | "text" if name in _JSON_TYPES:
                    fields[column.field] = self._json(name)
                case _:
                    pass
        if fields["action"] is None:
            raise DemosError(f"{self.where}: the action is empty.")
        if not all(map(math.isfinite, fields["action"])):
            raise DemosError(f"{self.where}: the action is not finite.")
        if fields["state"] is None:
            fields["state"] = (math.nan,) * len(columns["state"])
        fields["stop_reason"] = fields["stop_reason"] or ""
        terms = cast("dict[str, Any]", fields["terms"] or {})
        fields["terms"] = {n: self._parsed(str(v), float, "terms") for n, v in terms.items()}
        marks = tuple(map(str, fields.pop("marks") or ()))
        dropped = fields.pop("dropped")
        step = Step(driver=driver, **fields)
        return _Line(number, step, self.cells.get("frame", ""), self.where, marks, dropped)

    def number(self, name: str, kind: type[_N]) -> _N | None:
        """Return the number in a column; None for an empty cell."""
        cell = self.cells.get(name, "")
        return self._parsed(cell, kind, name) if cell else None

    def _time(self, name: str, factors: Mapping[str, float]) -> int | None:
        """Return a time, ns; those of others may have another unit, and digits after the point."""
        cell = self.cells.get(name, "")
        if name not in factors or not cell:
            return self.number(name, int)
        try:
            value = Decimal(cell if self.separator == "," else cell.replace(",", "."))
            if not value.is_finite() or abs(value) > _MAX_TIME:
                raise DemosError(f"{self.where}: {name} must be a time, got {cell!r}.")
        except InvalidOperation as error:
            raise DemosError(f"{self.where}: {name} must be a number, got {cell!r}.") from error
        return int(value * int(factors[name]))

    def _json(self, name: str) -> Any:
        """Return the JSON in a column; None for an empty cell."""
        if not (cell := self.cells.get(name, "")):
            return None
        kind, word = _JSON_TYPES[name]
        value = parse_json(cell, f"{self.where}: {name}: {cell[:_MAX_QUOTED]!r}")
        if not isinstance(value, kind):
            raise DemosError(
                f"{self.where}: {name} must be a JSON {word}, got {cell[:_MAX_QUOTED]!r}."
            )
        return value

    def _vector(self, field: str, columns: Sequence[str]) -> tuple[float, ...] | None:
        values = [self.number(column, float) for column in columns]
        known = tuple(value for value in values if value is not None)
        if known and len(known) < len(values):
            raise DemosError(f"{self.where}: some values of {field} are empty, but not all.")
        return known if known or not columns else None

    def _parsed(self, text: str, kind: type[_N], name: str) -> _N:
        try:
            return kind(text if self.separator == "," else text.replace(",", "."))
        except ValueError as error:
            what = "an integer" if kind is int else "a number"
            raise DemosError(f"{self.where}: {name} must be {what}, got {text!r}.") from error

    def _flag(self, name: str, default: str) -> bool:
        word = (self.cells.get(name) or default).strip().lower()  # Spreadsheets write TRUE.
        if word not in {"true", "false", "1", "0"}:
            raise DemosError(f"{self.where}: expected true or false, got {self.cells[name]!r}.")
        return word in {"true", "1"}


FORMAT: Final = Format(
    name="csv",
    title="CSV",
    sign=_TABLE,
    detect=lambda folder: bool(_tables_of(folder)),
    read=_read,
    write=_write,
    options=frozenset({"dropped", "hz"}),
)
