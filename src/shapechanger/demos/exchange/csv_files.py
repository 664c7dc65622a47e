"""The columns of `steps.csv`, and how their cells are written and read.

Numbers are written so that reading gives the same number; an empty cell is nothing, `nan` is a
number that nobody measured. Texts are written as JSON, in quotes of its own: then no text can be
taken for a formula by a spreadsheet, and line ends and strange letters survive.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.exchange.places import cannot_read, inside, read_text
from shapechanger.demos.exchange.recorded import ExchangeStep, Recorded
from shapechanger.errors import DemosError, LayoutError, UnknownName
from shapechanger.layout import Layout

__all__ = [
    "FRAMES",
    "HEADER",
    "TABLE",
    "CsvColumns",
    "ReadRow",
    "read_csv",
    "tables_of",
    "write_csv",
]

_BEFORE: Final = ("step", "frame", "driver")
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
_VECTORS: Final = ("action", "applied", "wanted", "state")
_MOST_NAMED: Final = 5


@dataclass(frozen=True, slots=True)
class ReadRow:
    """One line that was read.

    Attributes:
        row: The step, without its picture.
        frame: File name of its picture; "" for none.
        number: Its number in the file from which it was exported.
    """

    row: ExchangeStep
    frame: str
    number: int


class CsvColumns:
    """The columns for the layouts of an episode.

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
        """One line.

        Args:
            row: The step.
            number: Its number.
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
        """Refuse a file with other columns.

        Raises:
            DemosError: If they are not these.
        """
        if tuple(found) == self.names:
            return
        missing = [name for name in self.names if name not in found]
        surplus = [name for name in found if name not in self.names]
        if missing or surplus:
            said = [f"lacks {', '.join(missing[:_MOST_NAMED])}"] if missing else []
            said += (
                [f"has {', '.join(map(repr, surplus[:_MOST_NAMED]))} too much"] if surplus else []
            )
            raise DemosError(f"{where} {' and '.join(said)}: the columns are those of header.json.")
        raise DemosError(f"{where} has its columns in another order than header.json.")

    def read(self, cells: Sequence[str], where: str) -> ReadRow:
        """A line as a step.

        Args:
            cells: As many as there are columns.
            where: What to call the line.

        Raises:
            DemosError: If a cell is not what its column holds.
        """
        if len(cells) != len(self.names):
            raise DemosError(f"{where} has {len(cells)} cells, and there are {len(self.names)}.")
        left = list(zip(self.names, cells, strict=True))

        def number(kind: type[float] | type[int]) -> Any:
            name, cell = left.pop(0)
            return _number(cell, kind, f"{where}: {name}") if cell else None

        def vector(name: str) -> tuple[float, ...] | None:
            values = [number(float) for _ in range(self._sizes[name])]
            if values and all(value is None for value in values):
                return None
            if None in values:
                raise DemosError(f"{where}: some numbers of {name} are empty, and others are not.")
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
        return ReadRow(
            ExchangeStep(step=step, jpeg=None, marks=marks, dropped=text(str)), frame, index
        )


def _places(layout: str) -> list[str]:
    """A name for each number of a layout."""
    return [
        feature.name if not feature.shape else f"{feature.name}[{place}]"
        for feature in Layout.from_json(layout)
        for place in range(feature.size)
    ]


def _number(cell: str, kind: type[float] | type[int], where: str) -> float | int:
    try:
        return kind(cell)
    except ValueError as error:
        what = "whole number" if kind is int else "number"
        raise DemosError(f"{where} is {cell!r}, which is no {what}.") from error


def _flag(cell: str, where: str) -> bool:
    word = cell.strip().lower()  # Spreadsheets write TRUE.
    if word not in {"true", "false", "1", "0"}:
        raise DemosError(f"{where}: {cell!r} is neither true nor false.")
    return word in {"true", "1"}


def _text(cell: str, kind: type, where: str) -> Any:
    try:
        value = json.loads(cell)
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{where} is no JSON: {cell[:60]!r}.") from error
    if not isinstance(value, kind):
        raise DemosError(f"{where} is {cell[:60]!r}, which is another kind of JSON.")
    return value


HEADER: Final = "header.json"
TABLE: Final = "steps.csv"
FRAMES: Final = "frames"


def write_csv(episodes: Sequence[Recorded], folder: Path) -> int:
    """Write episodes into a folder that is there.

    Returns:
        How many steps were written.
    """
    if len(episodes) == 1:
        return _write(episodes[0], folder)
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder / f"episode-{number:04d}"
        place.mkdir()
        steps += _write(episode, place)
    return steps


def _write(episode: Recorded, folder: Path) -> int:
    columns = CsvColumns(episode.header)
    header = episode.header.to_json() | {"outcome": episode.outcome}
    text = json.dumps(header, indent=1, ensure_ascii=False)
    (folder / HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
    (folder / FRAMES).mkdir()
    frame, number = "", 0
    with (folder / TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns.names)
        for number, row in enumerate(episode.rows, 1):
            if row.jpeg is not None:
                frame = f"{number - 1:06d}.jpg"
                (folder / FRAMES / frame).write_bytes(row.jpeg)
            writer.writerow(columns.cells(row, number - 1, frame))
    return number


def tables_of(folder: Path) -> list[Path]:
    """The folders with a `steps.csv`: the folder itself, or those in it.

    Raises:
        DemosError: If the folder cannot be read.
    """
    if (folder / TABLE).is_file():
        return [folder]
    try:
        return sorted(path for path in folder.iterdir() if (path / TABLE).is_file())
    except OSError as error:
        raise cannot_read(folder, error) from error


def read_csv(folder: Path) -> Iterator[Recorded]:
    """The episodes of a folder.

    Raises:
        DemosError: If something in it is not whole; the sentence says what.
    """
    for place in tables_of(folder):
        path = place / HEADER
        if not path.is_file():
            raise DemosError(
                f"There is no {HEADER} beside {place / TABLE}, which says what the numbers mean: "
                "put it back."
            )
        try:
            plain = json.loads(read_text(path))
        except (ValueError, RecursionError) as error:
            raise DemosError(f"{path} is no JSON: {error}.") from error
        if not isinstance(plain, dict):
            raise DemosError(f"{path} is no header.")
        fields = cast("dict[str, Any]", plain)
        try:
            header = EpisodeHeader.from_json(fields)
            columns = CsvColumns(header)
        except (DemosError, LayoutError) as error:
            raise DemosError(f"{path}: {error}") from error
        yield Recorded(
            header=header,
            rows=_rows(place, header, columns),
            name=str(place),
            outcome=str(fields.get("outcome", "")),
        )


def _rows(folder: Path, header: EpisodeHeader, columns: CsvColumns) -> Iterator[ExchangeStep]:
    path = folder / TABLE
    pictures = Pictures(header.image_size)
    reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    frame, before = "", -1
    try:
        columns.require(next(reader, list[str]()), str(path))
        for cells in reader:
            where = f"{path}, line {reader.line_num}"
            read = columns.read(cells, where)
            if read.number <= before:
                raise DemosError(f"{where}: step {read.number} comes after step {before}.")
            before = read.number
            jpeg = None
            if read.frame != frame:
                if header.image_size is None:
                    raise DemosError(f"{where} has a picture, and {HEADER} says there are none.")
                frame = read.frame
                jpeg = pictures.read(inside(folder / FRAMES, frame, where))
            yield ExchangeStep(
                step=read.row.step, jpeg=jpeg, marks=read.row.marks, dropped=read.row.dropped
            )
    except csv.Error as error:
        raise DemosError(
            f"{path}, line {reader.line_num}, is no line of a CSV: {error}."
        ) from error
