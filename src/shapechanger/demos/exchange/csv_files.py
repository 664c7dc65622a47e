"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are written so that they are read back exactly; an empty cell is a missing value, `nan` a
value that nothing measured. Texts are written as JSON with its quotes, so that no spreadsheet takes
one for a formula, and line ends and other special characters survive.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Final, TypeVar, cast

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange.files import (
    Pictures,
    cannot_read,
    parse_json,
    parse_json_object,
    read_table,
    read_text,
    resolve_file,
)
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep, value_names
from shapechanger.errors import DemosError, LayoutError, UnknownName
from shapechanger.layout import Layout

_N = TypeVar("_N", int, float)

TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"

_VECTORS: Final = ("action", "applied", "wanted", "state")
_TIMES: Final = ("captured_ns", "decided_ns", "wall_ns")
_BEFORE_VECTORS: Final = ("step", "frame", "driver")
_AFTER_VECTORS: Final = (*_TIMES, "reward", "terms", "terminated", "truncated", "stop_reason")
_AFTER_STEP: Final = ("marks", "dropped")
_JSON_NAMES: Final = {dict: "object", list: "array", str: "string"}
_MAX_NAMED: Final = 5
_MAX_QUOTED: Final = 60


def write_csv(episodes: Sequence[ExchangeEpisode], folder: Path) -> int:
    """Write episodes into an existing folder; several episodes get a subfolder each.

    Args:
        episodes: The episodes.
        folder: Where to write.

    Returns:
        Number of steps written.
    """
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder if len(episodes) == 1 else folder / f"episode-{number:04d}"
        place.mkdir(exist_ok=True)
        steps += _write(episode, place)
    return steps


def is_csv(folder: Path) -> bool:
    """Return whether a folder has the format.

    Raises:
        DemosError: If the folder cannot be read.
    """
    return bool(_tables_of(folder))


def read_csv(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a folder.

    Raises:
        DemosError: If a file is missing or damaged.
    """
    for place in _tables_of(folder):
        path = place / _HEADER
        if not path.is_file():
            raise DemosError(
                f"There is no {_HEADER} beside {place / TABLE}, which defines its columns: restore "
                "it."
            )
        fields = parse_json_object(read_text(path), str(path))
        try:
            header = EpisodeHeader.from_json(fields)
            columns = _columns(header)
        except (DemosError, LayoutError) as error:
            raise DemosError(f"{path}: {error}") from error
        yield ExchangeEpisode(
            header=header,
            rows=_rows(place, header, columns, context),
            name=str(place),
            outcome=str(fields.get("outcome", "")),
        )


def _tables_of(folder: Path) -> list[Path]:
    """Return the folders with a `steps.csv`: the folder itself, or its subfolders."""
    if (folder / TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / TABLE).is_file())
    except OSError as error:
        raise cannot_read(folder, error) from error


def _columns(header: EpisodeHeader) -> dict[str, list[str]]:
    """Return the names of the columns of each field of a step, in order."""
    of_action = value_names(Layout.from_json(header.action_layout))
    of_state = value_names(Layout.from_json(header.state_layout)) if header.state_layout else []
    vectors = {
        name: [f"{name}/{place}" for place in (of_state if name == "state" else of_action)]
        for name in _VECTORS
    }
    before = {name: [name] for name in _BEFORE_VECTORS}
    return before | vectors | {name: [name] for name in (*_AFTER_VECTORS, *_AFTER_STEP)}


def _write(episode: ExchangeEpisode, folder: Path) -> int:
    columns = _columns(episode.header)
    header = episode.header.to_json() | {"outcome": episode.outcome}
    text = json.dumps(header, indent=1, ensure_ascii=False)
    (folder / _HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
    (folder / _FRAMES).mkdir()
    frame, number = "", 0
    with (folder / TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(chain.from_iterable(columns.values()))
        for number, row in enumerate(episode.rows, 1):
            if row.jpeg is not None:
                frame = f"{number - 1:06d}.jpg"
                (folder / _FRAMES / frame).write_bytes(row.jpeg)
            step = row.step
            cells = [str(number - 1), frame, step.driver]
            for name in _VECTORS:
                values = getattr(step, name)
                cells += [""] * len(columns[name]) if values is None else map(_cell, values)
            cells += [_cell(getattr(step, name)) for name in _AFTER_VECTORS]
            dropped = "" if row.dropped is None else json.dumps(row.dropped)
            writer.writerow([*cells, _cell(list(row.marks)), dropped])
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


def _rows(
    folder: Path, header: EpisodeHeader, columns: dict[str, list[str]], context: ImportContext
) -> Iterator[ExchangeStep]:
    path = folder / TABLE
    pictures = Pictures(header.image_size)
    names = list(chain.from_iterable(columns.values()))
    separator, table = read_table(path, len(names))
    _require_columns(table[0][1] if table else [], names, str(path))
    shown, before = "", -1
    frames: set[str] = set()
    for line, cells in table[1:]:
        where = f"{path}, line {line}"
        try:
            if len(cells) != len(names):
                hint = " (decimal commas need another separator)" if separator == "," else ""
                raise DemosError(f"{where} has {len(cells)} cells instead of {len(names)}{hint}.")
            row = _Row(dict(zip(names, cells, strict=True)), where, separator)
            number = row.number("step", int)
            if number is None:
                raise DemosError(f"{where}: step is empty.")
            if number <= before:
                raise DemosError(f"{where}: step {number} comes after step {before}.")
            step, frame, jpeg = row.step(columns), row.cells["frame"], None
            if frame != shown:
                if header.image_size is None:
                    raise DemosError(f"{where} has a picture, but {_HEADER} has no image_size.")
                if frame in frames:
                    raise DemosError(
                        f"{where} returns to the picture {frame!r} of an earlier step."
                    )
                jpeg = pictures.read(resolve_file(folder / _FRAMES, frame, where))
            marks = tuple(map(str, row.json("marks", list) or ()))
            dropped = row.json("dropped", str)
        except DemosError as error:
            context.leave_out("line", f"of {path}", str(error).removeprefix(f"{path}, ")[:-1])
            continue
        before, shown = number, frame
        frames.add(frame)
        yield ExchangeStep(step=step, jpeg=jpeg, marks=marks, dropped=dropped)


def _require_columns(found: Sequence[str], names: Sequence[str], where: str) -> None:
    """Refuse a table with other columns."""
    if list(found) == list(names):
        return
    missing = [name for name in names if name not in found]
    surplus = [repr(name) for name in found if name not in names]
    problems = [f"lacks {', '.join(missing[:_MAX_NAMED])}"] if missing else []
    problems += [f"has the unknown {', '.join(surplus[:_MAX_NAMED])}"] if surplus else []
    what = " and ".join(problems) or "has its columns in another order"
    raise DemosError(f"{where} {what}: the columns must be those of {_HEADER}.")


@dataclass(frozen=True, slots=True)
class _Row:
    """One line of `steps.csv`.

    Attributes:
        cells: The cells by the name of their column.
        where: How to name the line in errors.
        separator: What separates the cells; other than commas, numbers may have decimal commas.
    """

    cells: dict[str, str]
    where: str
    separator: str

    def step(self, columns: dict[str, list[str]]) -> Step:
        """Return the step; `columns` are those of each of its fields."""
        driver = self.cells["driver"]
        if driver not in DRIVERS:
            raise DemosError(f"{self.where}: {UnknownName('driver', driver, DRIVERS)}")
        vectors = {name: self._vector(name, columns[name]) for name in _VECTORS}
        if vectors["action"] is None:
            raise DemosError(f"{self.where}: the action is empty.")
        if vectors["state"] is None:
            vectors["state"] = (math.nan,) * len(columns["state"])
        terms = cast("dict[str, Any]", self.json("terms", dict) or {})
        fields: dict[str, Any] = {
            **vectors,
            **{name: self.number(name, int) for name in _TIMES},
            "reward": self.number("reward", float),
            "terms": {name: self._parsed(str(v), float, name) for name, v in terms.items()},
            "terminated": self._flag("terminated"),
            "truncated": self._flag("truncated"),
            "stop_reason": self.json("stop_reason", str) or "",
        }
        return Step(driver=driver, **fields)

    def number(self, name: str, kind: type[_N]) -> _N | None:
        """Return the number in a column; None for an empty cell."""
        cell = self.cells[name]
        return self._parsed(cell, kind, name) if cell else None

    def json(self, name: str, kind: type) -> Any:
        """Return the JSON of a type in a column; None for an empty cell."""
        cell = self.cells[name]
        if not cell:
            return None
        value = parse_json(cell, f"{self.where}: {name}: {cell[:_MAX_QUOTED]!r}")
        if not isinstance(value, kind):
            raise DemosError(
                f"{self.where}: {name} must be a JSON {_JSON_NAMES[kind]}, got "
                f"{cell[:_MAX_QUOTED]!r}."
            )
        return value

    def _vector(self, name: str, columns: Sequence[str]) -> tuple[float, ...] | None:
        values = [self.number(column, float) for column in columns]
        known = tuple(value for value in values if value is not None)
        if known and len(known) < len(values):
            raise DemosError(f"{self.where}: some values of {name} are empty, but not all.")
        return known if known or not columns else None

    def _parsed(self, text: str, kind: type[_N], name: str) -> _N:
        try:
            return kind(text if self.separator == "," else text.replace(",", "."))
        except ValueError as error:
            what = "an integer" if kind is int else "a number"
            raise DemosError(f"{self.where}: {name} must be {what}, got {text!r}.") from error

    def _flag(self, name: str) -> bool:
        word = self.cells[name].strip().lower()  # Spreadsheets write TRUE.
        if word not in {"true", "false", "1", "0"}:
            raise DemosError(f"{self.where}: expected true or false, got {self.cells[name]!r}.")
        return word in {"true", "1"}
