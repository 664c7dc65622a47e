"""A path that was recorded: a CSV of `t,x,y,z`."""

from __future__ import annotations

import csv
import io
import math
import os
import pathlib
from collections.abc import Sequence
from typing import Final

import numpy as np

from shapechanger.errors import PathError
from shapechanger.tasks.paths.path import CLOSED_M, Path, Points, Times
from shapechanger.tasks.paths.speed import jumps, too_fast
from shapechanger.tasks.paths.spline import Spline

__all__ = ["from_csv"]

_COLUMNS: Final = ("t", "x", "y", "z")
_HEADER: Final = "the columns are t, x, y and z"
_FEWEST_ROWS: Final = 3  # A spline of two would be a line.
_GAP: Final = 5.0  # Times the median step.


def from_csv(path: str | os.PathLike[str]) -> Path:
    """The path in a CSV file.

    Its first line names the columns `t`, `x`, `y` and `z`, in any order: time in s, position in the
    frame of the finger in m. The steps in time may differ. Between the rows the path is a cubic
    spline: velocity and acceleration are continuous. Time counts from the first row. A path that
    ends within 0.1 mm of where it begins is closed, and repeats: the spline is periodic, and goes
    through the middle of its first and last point. Another one ends with its last row.

    Args:
        path: The file, in UTF-8. Empty lines are skipped.

    Raises:
        PathError: If the file cannot be read, lacks a column, has another one or one twice, or has
            fewer than three rows; if a cell is no finite number; if time runs backwards or stands
            still; if a step in time is more than five times the median one; if the point is faster
            than `FASTEST_MPS`. The sentence names the line.
    """
    name = os.fspath(path)
    lines, rows = _rows(name, _text(name))
    if len(rows) < _FEWEST_ROWS:
        raise PathError(f"{name} has too few rows: {len(rows)}, and a path needs {_FEWEST_ROWS}.")
    table = np.array(rows)
    times, points = table[:, 0] - table[0, 0], table[:, 1:]
    where = [f"{name}, line {line}" for line in lines]
    _require_steady(table[:, 0], where)
    _require_slow(times, points, where)
    closed = math.dist(points[0], points[-1]) <= CLOSED_M
    if closed:
        points[[0, -1]] = (points[0] + points[-1]) / 2.0
    return Path(Spline.through(times, points, closed), float(times[-1]), closed)


def _text(name: str) -> str:
    try:
        return pathlib.Path(name).read_text(encoding="utf-8-sig")  # Spreadsheets write the mark.
    except OSError as error:
        raise PathError(f"{name} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise PathError(f"{name} is no text in UTF-8: {error.reason}.") from error


def _rows(name: str, text: str) -> tuple[list[int], list[list[float]]]:
    """Line numbers and rows of t, x, y, z."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    lines: list[int] = []
    rows: list[list[float]] = []
    order: list[int] | None = None
    try:
        for cells in reader:
            if not cells:
                continue
            where = f"{name}, line {reader.line_num}"
            if order is None:
                order = _order([cell.strip() for cell in cells], where)
                continue
            if len(cells) != len(_COLUMNS):
                raise PathError(f"{where} has {len(cells)} cells, and there are four columns.")
            rows.append(
                [_number(cells[place], c, where) for c, place in zip(_COLUMNS, order, strict=True)]
            )
            lines.append(reader.line_num)
    except csv.Error as error:
        raise PathError(f"{name}, line {reader.line_num}, is no line of a CSV: {error}.") from error
    if order is None:
        raise PathError(f"{name} is empty: {_HEADER}.")
    return lines, rows


def _order(found: Sequence[str], where: str) -> list[int]:
    """Where in a line t, x, y and z are."""
    missing = [name for name in _COLUMNS if name not in found]
    surplus = [name for name in found if name not in _COLUMNS]
    twice = [name for name in _COLUMNS if found.count(name) > 1]
    said = [f"lacks {', '.join(missing)}"] if missing else []
    said += [f"has {', '.join(map(repr, surplus))} too much"] if surplus else []
    said += [f"has {', '.join(twice)} twice"] if twice else []
    if said:
        raise PathError(f"{where} {' and '.join(said)}: {_HEADER}.")
    return [found.index(name) for name in _COLUMNS]


def _number(cell: str, column: str, where: str) -> float:
    try:
        number = float(cell)
    except ValueError as error:
        raise PathError(f"{where}: {column} is {cell!r}, which is no number.") from error
    if not math.isfinite(number):
        raise PathError(f"{where}: {column} is {cell!r}, which is not finite.")
    return number


def _require_steady(times: Times, where: Sequence[str]) -> None:
    """Refuse time that does not run on, and gaps in it; `where` names each row."""
    steps = np.diff(times)
    for i in np.flatnonzero(steps <= 0.0).tolist():
        how = "stands still" if steps[i] == 0.0 else "runs backwards"
        raise PathError(f"{where[i + 1]}: time {how}, from {times[i]!s} s to {times[i + 1]!s} s.")
    median = float(np.median(steps))
    for i in np.flatnonzero(steps > _GAP * median).tolist():
        raise PathError(
            f"{where[i + 1]}: {steps[i]:.3g} s have passed since the row before, a gap: the median "
            f"is {median:.3g} s, and {_GAP:g} times as much is allowed."
        )


def _require_slow(times: Times, points: Points, where: Sequence[str]) -> None:
    """Refuse jumps; `where` names each row."""
    for i in range(1, len(where)):
        seconds, distance = float(times[i] - times[i - 1]), math.dist(points[i], points[i - 1])
        if jumps(distance, seconds):
            raise PathError(
                f"{where[i]}: {too_fast(distance, seconds)}; t must be in s, and x, y, z in m."
            )
