"""Paths from functions, CSV files, names and settings."""

from __future__ import annotations

import csv
import inspect
import io
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, Final, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from shapechanger.errors import PathError, UnknownName
from shapechanger.finger.parameters import as_numbers
from shapechanger.finger.paths.path import (
    CLOSED_M,
    FingertipPath,
    Points,
    Times,
    circle,
    curve_3d,
    figure_eight,
    line,
    positive,
    too_fast,
)

# Checked time of an endless function, s; rate and number of the checked points.
_CHECKED_S: Final = 10.0
_CHECKED_HZ: Final = 500.0
_FEWEST_CHECKED: Final = 200
_MOST_CHECKED: Final = 10_000
# Number of the roughest intervals that are bisected, and the shortest time that they are cut to, s.
_SUSPECTS: Final = 16
_SHORTEST_S: Final = 1e-6


@dataclass(frozen=True, slots=True)
class _Function:
    """Positions by a function of one time in s, which returns x, y and z in m."""

    function: Callable[[float], ArrayLike]

    def __call__(self, t: Times) -> Points:
        return np.array([self.point(float(now)) for now in t]).reshape(-1, 3)

    def point(self, t: float) -> Points:
        """Return the position at one time, m, shape (3,)."""
        given = self.function(t)
        point = as_numbers(given)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise PathError(
                "The function of a path must return three finite numbers (x, y, z) in m, and at "
                f"{t:.6g} s it returned {given!r}."
            )
        return point


def from_callable(
    function: Callable[[float], ArrayLike],
    duration_s: float | None = None,
    period_s: float | None = None,
) -> FingertipPath:
    """Create a path from a function of time.

    The function is sampled 500 times per second, at most 10 000 times, and more densely where it is
    least smooth. This finds jumps of 0.01 mm, except in rough functions.

    Args:
        function: Maps a time in s, from 0 to the end, to x, y and z in the finger's frame, m. It
            must be deterministic.
        duration_s: End of the path, s, above 0; the point rests there afterwards.
        period_s: Period, s, above 0; the point must be back after it, within 0.1 mm. Give only one
            of the two; without either, the path is endless, and its first 10 s are checked.

    Raises:
        PathError: If the function does not return three finite numbers, jumps, is faster than
            `FASTEST_MPS`, or is not back after `period_s`; if a time is not a finite number above
            0, or both are given.
    """
    if duration_s is not None and period_s is not None:
        raise PathError(
            "A path ends after duration_s or repeats after period_s; give only one of them."
        )
    length = math.inf
    if duration_s is not None:
        length = positive("duration_s", duration_s)
    if period_s is not None:
        length = positive("period_s", period_s)
    motion = _Function(function)
    _require_continuous(motion, length)
    if period_s is not None:
        apart = math.dist(motion.point(0.0), motion.point(length))
        if apart > CLOSED_M:
            raise PathError(
                f"After its period of {length:.6g} s the path is {apart * 1e3:.3g} mm from its "
                f"beginning, and {CLOSED_M * 1e3:g} mm are allowed: give another period_s, or "
                "duration_s for an open path."
            )
    return FingertipPath(motion, length, closed=period_s is not None)


def _require_continuous(motion: _Function, duration_s: float) -> None:
    """Check a function for jumps."""
    length = _CHECKED_S if math.isinf(duration_s) else duration_s
    n = round(min(max(length * _CHECKED_HZ, _FEWEST_CHECKED), _MOST_CHECKED))
    times = np.linspace(0.0, length, n + 1)
    points = motion(times)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(points, axis=0)
        around = np.vstack([steps[:1], steps, steps[-1:]])
        roughness = np.linalg.norm(steps - (around[:-2] + around[2:]) / 2.0, axis=1)
        fastest = int(np.argmax(np.linalg.norm(steps, axis=1)))
    for i in (fastest, *np.argsort(roughness)[-_SUSPECTS:].tolist()):
        _require_no_jump(motion, float(times[i]), float(times[i + 1]))


def _require_no_jump(motion: _Function, start: float, end: float) -> None:
    """Bisect an interval, s, towards its largest change: only a jump does not shrink."""
    first, last = motion.point(start), motion.point(end)
    while True:
        distance = math.dist(first, last)
        if reason := too_fast(distance, end - start):
            raise PathError(f"At {start:.6g} s the path jumps: {reason}.")
        middle = start / 2.0 + end / 2.0
        if end - start < _SHORTEST_S or not start < middle < end:
            return
        between = motion.point(middle)
        if math.dist(first, between) > math.dist(between, last):
            end, last = middle, between
        else:
            start, first = middle, between


_COLUMNS: Final = ("t", "x", "y", "z")
_HEADER: Final = "the columns are t, x, y and z"
_FEWEST_ROWS: Final = 3  # A spline of two would be a line.
_GAP: Final = 5.0  # Times the median step.


def from_csv(path: str | os.PathLike[str]) -> FingertipPath:
    """Read a path from a CSV file.

    The first line names the columns `t`, `x`, `y` and `z`, in any order: time in s, position in the
    finger's frame in m. Time steps may vary. A cubic spline connects the rows, with continuous
    velocity and acceleration. Time counts from the first row. A path that ends within 0.1 mm of its
    beginning is closed: its spline is periodic, and passes through the middle of the first and last
    point. An open path ends with its last row.

    Args:
        path: The file, in UTF-8; empty lines are skipped.

    Raises:
        PathError: If the file cannot be read, has missing, unknown or repeated columns, or fewer
            than three rows; if a cell is not a finite number; if time does not increase; if a time
            step is more than five times the median; or if the point is faster than `FASTEST_MPS`.
            The message names the line.
    """
    name = os.fspath(path)
    where, rows = _rows(name)
    if len(rows) < _FEWEST_ROWS:
        raise PathError(f"{name} has too few rows: {len(rows)}, and a path needs {_FEWEST_ROWS}.")
    table = np.array(rows)
    times, points = table[:, 0] - table[0, 0], table[:, 1:]
    _require_steady(table[:, 0], where)
    _require_slow(times, points, where)
    closed = math.dist(points[0], points[-1]) <= CLOSED_M
    if closed:
        points[[0, -1]] = (points[0] + points[-1]) / 2.0
    spline = CubicSpline(times, points, bc_type="periodic" if closed else "natural")
    return FingertipPath(cast("Any", spline), float(times[-1]), closed)


def _rows(name: str) -> tuple[list[str], list[list[float]]]:
    """Return the file and line of each row, and its t, x, y and z."""
    try:
        text = Path(name).read_text("utf-8-sig")  # Spreadsheets write a mark.
    except OSError as error:
        raise PathError(f"{name} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise PathError(f"{name} is not UTF-8 text: {error.reason}.") from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        found = [(f"{name}, line {reader.line_num}", cells) for cells in reader if cells]
    except csv.Error as error:
        raise PathError(f"{name}, line {reader.line_num}, is not valid CSV: {error}.") from error
    if not found:
        raise PathError(f"{name} is empty: {_HEADER}.")
    (first, cells), *body = found
    header = [cell.strip() for cell in cells]
    if sorted(header) != sorted(_COLUMNS):
        raise PathError(f"{first} names the columns {', '.join(header)}: {_HEADER}.")
    rows: list[list[float]] = []
    for where, cells in body:
        if len(cells) != len(_COLUMNS):
            raise PathError(f"{where} has {len(cells)} cells, and there are four columns.")
        row = dict(zip(header, cells, strict=True))
        for column, cell in row.items():
            if not (found := as_numbers(cell)).size or not np.isfinite(found):
                raise PathError(f"{where}: {column} is {cell!r}, which is not a finite number.")
        rows.append([float(row[column]) for column in _COLUMNS])
    return [where for where, _ in body], rows


def _require_steady(times: Times, where: Sequence[str]) -> None:
    """Refuse times that do not increase, and gaps."""
    steps = np.diff(times)
    for i in np.flatnonzero(steps <= 0.0).tolist():
        how = "stands still" if steps[i] == 0.0 else "runs backwards"
        raise PathError(f"{where[i + 1]}: time {how}, from {times[i]!s} s to {times[i + 1]!s} s.")
    median = float(np.median(steps))
    for i in np.flatnonzero(steps > _GAP * median).tolist():
        raise PathError(
            f"{where[i + 1]}: the time step of {steps[i]:.3g} s is a gap: the median is "
            f"{median:.3g} s, and {_GAP:g} times as much is allowed."
        )


def _require_slow(times: Times, points: Points, where: Sequence[str]) -> None:
    """Refuse jumps."""
    for i in range(1, len(where)):
        seconds, distance = float(times[i] - times[i - 1]), math.dist(points[i], points[i - 1])
        if reason := too_fast(distance, seconds):
            raise PathError(f"{where[i]}: {reason}; t must be in s, and x, y, z in m.")


PathSource = FingertipPath | str | PurePath | Mapping[str, Any] | Callable[[float], ArrayLike]
"""A path, the name of a shape, a CSV file, a name with settings, or a function of time."""

_MAKERS: Final[dict[str, Callable[..., FingertipPath]]] = {
    "circle": circle,
    "figure-eight": figure_eight,
    "line": line,
    "curve": curve_3d,
}

KINDS: Final = tuple(_MAKERS)
"""Names of the shapes."""

_KIND: Final = "kind"
_FILE: Final = ".csv"


def as_path(value: PathSource) -> FingertipPath:
    """Return a path from any of its sources.

    Args:
        value: A path; the name of a shape, one of `KINDS`; a mapping with that name as "kind" and
            with arguments of the function that makes the shape, such as
            `{"kind": "circle", "radius": 0.01, "hz": 1.0}`; the name of a file that ends in .csv,
            as `from_csv` reads it; or a function for `from_callable`, endless.

    Raises:
        UnknownName: If there is no such shape, or it has no such setting.
        PathError: If it is not one of these, or the path is invalid.
    """
    given: Any = value  # May be anything where nothing checks types.
    if isinstance(given, FingertipPath):
        return given
    if isinstance(given, (str, PurePath)) and str(given).lower().endswith(_FILE):
        return from_csv(given)
    if isinstance(given, PurePath):
        raise PathError(f"A path file must end in {_FILE}, got {str(given)!r}.")
    if isinstance(given, str):
        return _with_settings({_KIND: given})
    if isinstance(given, Mapping):
        return _with_settings(dict(cast("Mapping[Any, Any]", given)))
    if callable(given):
        return from_callable(cast("Callable[[float], ArrayLike]", given))
    raise PathError(
        f"A path must be one of {', '.join(KINDS)}, such a name with settings, a {_FILE} file or a "
        f"function of time, got {given!r}."
    )


def _with_settings(settings: dict[Any, Any]) -> FingertipPath:
    if _KIND not in settings:
        raise PathError(
            f'A path with settings needs the key "{_KIND}", one of {", ".join(KINDS)}, got '
            f"{settings!r}."
        )
    kind = str(settings.pop(_KIND))
    if kind not in _MAKERS:
        raise UnknownName("path", kind, KINDS)
    maker = _MAKERS[kind]
    known = tuple(inspect.signature(maker).parameters)
    for name in settings:
        if name not in known:
            raise UnknownName(f"setting of {kind!r}", str(name), known)
    return maker(**settings)
