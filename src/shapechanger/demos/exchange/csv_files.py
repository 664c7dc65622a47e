"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are written so that they are read back exactly; an empty cell is a missing value, `nan` a
value that nothing measured. Texts are written as JSON with its quotes, so that no spreadsheet takes
one for a formula, and line ends and other special characters survive.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange.files import (
    Pictures,
    cannot_read,
    parse_json,
    parse_json_object,
    read_text,
    resolve_file,
)
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep
from shapechanger.errors import DemosError, LayoutError, UnknownName
from shapechanger.layout import Layout

TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"

_BEFORE: Final = ("step", "frame", "driver")
_VECTORS: Final = ("action", "applied", "wanted", "state")
_TIMES: Final = ("captured_ns", "decided_ns", "wall_ns")
_AFTER: Final = (
    *_TIMES,
    "reward",
    "terms",
    "terminated",
    "truncated",
    "stop_reason",
    "marks",
    "dropped",
)
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
    if len(episodes) == 1:
        return _write(episodes[0], folder)
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder / f"episode-{number:04d}"
        place.mkdir()
        steps += _write(episode, place)
    return steps


def is_csv(folder: Path) -> bool:
    """Return whether a folder has the format.

    Raises:
        DemosError: If the folder cannot be read.
    """
    return bool(_tables_of(folder))


def read_csv(folder: Path) -> Iterator[ExchangeEpisode]:
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
            columns = _Columns(header)
        except (DemosError, LayoutError) as error:
            raise DemosError(f"{path}: {error}") from error
        yield ExchangeEpisode(
            header=header,
            rows=_rows(place, header, columns),
            name=str(place),
            outcome=str(fields.get("outcome", "")),
        )


def _write(episode: ExchangeEpisode, folder: Path) -> int:
    columns = _Columns(episode.header)
    header = episode.header.to_json() | {"outcome": episode.outcome}
    text = json.dumps(header, indent=1, ensure_ascii=False)
    (folder / _HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
    (folder / _FRAMES).mkdir()
    frame, number = "", 0
    with (folder / TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns.names)
        for number, row in enumerate(episode.rows, 1):
            if row.jpeg is not None:
                frame = f"{number - 1:06d}.jpg"
                (folder / _FRAMES / frame).write_bytes(row.jpeg)
            writer.writerow(columns.cells(row, number - 1, frame))
    return number


def _tables_of(folder: Path) -> list[Path]:
    """Return the folders with a `steps.csv`: the folder itself, or its subfolders.

    Raises:
        DemosError: If the folder cannot be read.
    """
    if (folder / TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / TABLE).is_file())
    except OSError as error:
        raise cannot_read(folder, error) from error


def _rows(folder: Path, header: EpisodeHeader, columns: _Columns) -> Iterator[ExchangeStep]:
    path = folder / TABLE
    pictures = Pictures(header.image_size)
    reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    shown, before = "", -1
    try:
        columns.require(next(reader, list[str]()), str(path))
        for cells in reader:
            where = f"{path}, line {reader.line_num}"
            row, frame, number = columns.parse(cells, where)
            if number <= before:
                raise DemosError(f"{where}: step {number} comes after step {before}.")
            before = number
            jpeg = None
            if frame != shown:
                if header.image_size is None:
                    raise DemosError(f"{where} has a picture, but {_HEADER} has no image_size.")
                shown = frame
                jpeg = pictures.read(resolve_file(folder / _FRAMES, frame, where))
            yield replace(row, jpeg=jpeg)
    except csv.Error as error:
        raise DemosError(f"{path}, line {reader.line_num}, is not valid CSV: {error}.") from error


class _Columns:
    """Columns of `steps.csv` for the layouts of an episode.

    Attributes:
        names: Their names in order.
    """

    def __init__(self, header: EpisodeHeader) -> None:
        action = _places(header.action_layout)
        places = {"state": _places(header.state_layout) if header.state_layout else []}
        self._sizes = {name: len(places.get(name, action)) for name in _VECTORS}
        self.names: tuple[str, ...] = (
            *_BEFORE,
            *(f"{name}/{place}" for name in _VECTORS for place in places.get(name, action)),
            *_AFTER,
        )

    def cells(self, row: ExchangeStep, number: int, frame: str) -> list[str]:
        """Return the cells of one line.

        Args:
            row: The step.
            number: Number of the step in the file.
            frame: File name of its picture; "" for none.
        """
        step = row.step
        cells = [str(number), frame, step.driver]
        for name in _VECTORS:
            values = cast("tuple[float, ...] | None", getattr(step, name))
            cells += (
                [""] * self._sizes[name] if values is None else [repr(float(v)) for v in values]
            )
        for name in _TIMES:
            value = getattr(step, name)
            cells.append("" if value is None else str(value))
        cells.append("" if step.reward is None else repr(float(step.reward)))
        terms = {n: v if math.isfinite(v) else repr(v) for n, v in step.terms.items()}
        cells.append(json.dumps(terms) if terms else "")
        cells += [str(step.terminated).lower(), str(step.truncated).lower()]
        cells.append(json.dumps(step.stop_reason) if step.stop_reason else "")
        cells.append(json.dumps(list(row.marks)) if row.marks else "")
        cells.append("" if row.dropped is None else json.dumps(row.dropped))
        return cells

    def require(self, found: Sequence[str], where: str) -> None:
        """Refuse a table with other columns.

        Args:
            found: Names of the columns that were found.
            where: How to name the table in errors.

        Raises:
            DemosError: If the columns differ.
        """
        if tuple(found) == self.names:
            return
        missing = [name for name in self.names if name not in found]
        surplus = [repr(name) for name in found if name not in self.names]
        problems = [f"lacks {', '.join(missing[:_MAX_NAMED])}"] if missing else []
        problems += [f"has the unknown {', '.join(surplus[:_MAX_NAMED])}"] if surplus else []
        what = " and ".join(problems) or "has its columns in another order"
        raise DemosError(f"{where} {what}: the columns must be those of {_HEADER}.")

    def parse(self, cells: Sequence[str], where: str) -> tuple[ExchangeStep, str, int]:
        """Parse the cells of one line.

        Args:
            cells: One cell per column.
            where: How to name the line in errors.

        Returns:
            The step without its picture, the file name of the picture ("" for none), and the
            number of the step in the file.

        Raises:
            DemosError: If a cell is invalid.
        """
        if len(cells) != len(self.names):
            raise DemosError(f"{where} has {len(cells)} cells instead of {len(self.names)}.")
        left = list(zip(self.names, cells, strict=True))

        def number(kind: type[float] | type[int]) -> Any:
            name, cell = left.pop(0)
            return _number(cell, kind, f"{where}: {name}") if cell else None

        def vector(name: str) -> tuple[float, ...] | None:
            values = [number(float) for _ in range(self._sizes[name])]
            if values and all(value is None for value in values):
                return None
            if None in values:
                raise DemosError(f"{where}: some values of {name} are empty, but not all.")
            return tuple(values)

        def text(kind: type) -> Any:
            name, cell = left.pop(0)
            return _text(cell, kind, f"{where}: {name}") if cell else None

        index = number(int)
        frame, driver = left.pop(0)[1], left.pop(0)[1]
        if driver not in DRIVERS:
            raise DemosError(f"{where}: {UnknownName('driver', driver, DRIVERS)}")
        action = vector("action")
        if index is None or action is None:
            raise DemosError(f"{where}: {'step' if index is None else 'the action'} is empty.")
        applied, wanted, state = vector("applied"), vector("wanted"), vector("state")
        times = {name: number(int) for name in _TIMES}
        reward = number(float)
        terms = cast("dict[str, Any]", text(dict) or {})
        step = Step(
            action=action,
            driver=driver,
            applied=applied,
            wanted=wanted,
            state=state if state is not None else (math.nan,) * self._sizes["state"],
            **times,
            reward=reward,
            terms={
                name: _number(str(value), float, f"{where}: {name}")
                for name, value in terms.items()
            },
            terminated=_flag(left.pop(0)[1], where),
            truncated=_flag(left.pop(0)[1], where),
            stop_reason=text(str) or "",
        )
        marks = tuple(str(mark) for mark in text(list) or ())
        return ExchangeStep(step=step, jpeg=None, marks=marks, dropped=text(str)), frame, index


def _places(layout: str) -> list[str]:
    """Return a name for each value of a layout."""
    return [
        feature.name if not feature.shape else f"{feature.name}[{place}]"
        for feature in Layout.from_json(layout)
        for place in range(feature.size)
    ]


def _number(cell: str, kind: type[float] | type[int], where: str) -> float | int:
    try:
        return kind(cell)
    except ValueError as error:
        what = "an integer" if kind is int else "a number"
        raise DemosError(f"{where} must be {what}, got {cell!r}.") from error


def _flag(cell: str, where: str) -> bool:
    word = cell.strip().lower()  # Spreadsheets write TRUE.
    if word not in {"true", "false", "1", "0"}:
        raise DemosError(f"{where}: expected true or false, got {cell!r}.")
    return word in {"true", "1"}


def _text(cell: str, kind: type, where: str) -> Any:
    value = parse_json(cell, f"{where}: {cell[:_MAX_QUOTED]!r}")
    if not isinstance(value, kind):
        raise DemosError(f"{where} must be a JSON {_JSON_NAMES[kind]}, got {cell[:_MAX_QUOTED]!r}.")
    return value
