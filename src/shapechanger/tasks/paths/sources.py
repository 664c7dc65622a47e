"""Paths from functions, CSV files, names and settings."""

from __future__ import annotations

import csv
import inspect
import io
import math
import os
import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any, Final, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import PathError, UnknownName
from shapechanger.tasks.paths.path import (
    CLOSED_M,
    FingertipPath,
    Points,
    Times,
    jumps,
    positive,
    too_fast,
)
from shapechanger.tasks.paths.shapes import circle, curve_3d, figure_eight, line

_STEP_S: Final = 1e-3  # Of differences: the error at 5 Hz is a millionth of the velocity.
_NODES: Final = np.arange(-2.0, 3.0)
# Values at the nodes become coefficients of the polynomial through them, shape (5, 5).
_COEFFICIENTS: Final = np.linalg.inv(np.vander(_NODES, increasing=True))

# How a function is checked: over all its time, or as much of it where it never ends; ...
_CHECKED_S: Final = 10.0
_CHECKED_HZ: Final = 500.0
_FEWEST_CHECKED: Final = 200
_MOST_CHECKED: Final = 10_000
# ... and where it is least smooth, down to such a short time.
_SUSPECTS: Final = 16
_SHORTEST_S: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Function:
    """Motion by a function, with derivatives by differences.

    Attributes:
        function: Maps a time in s to x, y and z in m.
        duration_s: End of its domain, s, above 0; infinite for none.
    """

    function: Callable[[float], ArrayLike]
    duration_s: float

    def derivative(self, t: Times, order: int) -> Points:
        """Return position, velocity or acceleration, as in `PathMotion`.

        Args:
            t: Times, s, shape (n,).
            order: 0, 1 or 2.

        Raises:
            PathError: If the function does not return three finite numbers.
        """
        if order == 0:
            return np.array([self.point(float(now)) for now in t]).reshape(-1, 3)
        # A polynomial through five points around the time. At both ends of the domain the time is
        # not in their middle.
        step = min(_STEP_S, self.duration_s / 4.0)
        middle = t.clip(2.0 * step, self.duration_s - 2.0 * step)
        nodes = (middle + step * _NODES[:, None]).clip(0.0, self.duration_s)
        values = self.derivative(nodes.ravel(), 0).reshape(5, -1, 3)
        u = (t - middle) / step
        ones, zeros = np.ones_like(u), np.zeros_like(u)
        powers = {
            1: np.stack([zeros, ones, 2.0 * u, 3.0 * u**2, 4.0 * u**3]),
            2: np.stack([zeros, zeros, 2.0 * ones, 6.0 * u, 12.0 * u**2]),
        }
        return np.einsum("kn,kj,jnd->nd", powers[order] / step**order, _COEFFICIENTS, values)

    def point(self, t: float) -> Points:
        """Return the position at one time, m, shape (3,).

        Raises:
            PathError: If the function does not return three finite numbers.
        """
        given = self.function(t)
        try:
            point = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            point = np.empty(0)
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
    least smooth. This finds jumps of 0.01 mm, except in rough functions. Velocity and acceleration
    are differences over 4 ms, so the function should be smooth at that scale.

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
    motion = Function(function, length)
    _require_continuous(motion)
    if period_s is not None:
        apart = math.dist(motion.point(0.0), motion.point(length))
        if apart > CLOSED_M:
            raise PathError(
                f"After its period of {length:.6g} s the path is {apart * 1e3:.3g} mm from its "
                f"beginning, and {CLOSED_M * 1e3:g} mm are allowed: give another period_s, or "
                "duration_s for an open path."
            )
    return FingertipPath(motion, length, closed=period_s is not None)


def _require_continuous(motion: Function) -> None:
    """Check a function for jumps.

    Raises:
        PathError: If it jumps.
    """
    length = _CHECKED_S if math.isinf(motion.duration_s) else motion.duration_s
    n = round(min(max(length * _CHECKED_HZ, _FEWEST_CHECKED), _MOST_CHECKED))
    times = np.linspace(0.0, length, n + 1)
    points = motion.derivative(times, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(points, axis=0)
        around = np.vstack([steps[:1], steps, steps[-1:]])
        roughness = np.linalg.norm(steps - (around[:-2] + around[2:]) / 2.0, axis=1)
        fastest = int(np.argmax(np.linalg.norm(steps, axis=1)))
    for i in (fastest, *np.argsort(roughness)[-_SUSPECTS:].tolist()):
        _require_no_jump(motion, float(times[i]), float(times[i + 1]))


def _require_no_jump(motion: Function, start: float, end: float) -> None:
    """Bisect an interval towards its largest change: only a jump does not shrink.

    Args:
        motion: The motion.
        start: Beginning of the interval, s.
        end: End of the interval, s.

    Raises:
        PathError: If it contains a jump.
    """
    first, last = motion.point(start), motion.point(end)
    while True:
        distance = math.dist(first, last)
        if jumps(distance, end - start):
            raise PathError(f"At {start:.6g} s the path jumps: {too_fast(distance, end - start)}.")
        middle = start / 2.0 + end / 2.0
        if end - start < _SHORTEST_S or not start < middle < end:
            return
        between = motion.point(middle)
        if math.dist(first, between) > math.dist(between, last):
            end, last = middle, between
        else:
            start, first = middle, between


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """Cubic spline with continuous velocity and acceleration; create it with `through`.

    Formulas and names follow Press et al., Numerical Recipes, 3rd edition (2007), sections 2.4 and
    3.3.

    Attributes:
        knots: Times of the points, s, increasing from 0, shape (n,), with n at least 3.
        points: m, shape (n, 3).
        bends: Accelerations at the points, m/s², shape (n, 3); linear in between.
    """

    knots: Times = field(repr=False)
    points: Points = field(repr=False)
    bends: Points = field(repr=False)

    @classmethod
    def through(cls, knots: Times, points: Points, periodic: bool) -> Spline:
        """Return the spline through points.

        Args:
            knots: Their times, s, increasing from 0, shape (n,), with n at least 3.
            points: m, shape (n, 3). For a periodic spline the last equals the first.
            periodic: Whether velocity and acceleration are equal at both ends; otherwise the
                acceleration is 0 there ("natural" spline).
        """
        knots, points = knots.copy(), points.copy()
        bends = _bends(knots, points, periodic)
        for array in (knots, points, bends):
            array.setflags(write=False)
        return cls(knots, points, bends)

    def derivative(self, t: Times, order: int) -> Points:
        """Return position, velocity or acceleration, as in `PathMotion`.

        Args:
            t: Times, s, shape (n,).
            order: 0, 1 or 2.
        """
        piece = (np.searchsorted(self.knots, t, side="right") - 1).clip(0, len(self.knots) - 2)
        h = (self.knots[piece + 1] - self.knots[piece])[:, None]
        b = (t - self.knots[piece])[:, None] / h  # Elapsed fraction of the piece, 0 to 1.
        a = 1.0 - b
        y0, y1 = self.points[piece], self.points[piece + 1]
        m0, m1 = self.bends[piece], self.bends[piece + 1]
        if order == 0:
            return a * y0 + b * y1 + ((a**3 - a) * m0 + (b**3 - b) * m1) * h**2 / 6.0
        if order == 1:
            return (y1 - y0) / h + ((3.0 * b**2 - 1.0) * m1 - (3.0 * a**2 - 1.0) * m0) * h / 6.0
        return a * m0 + b * m1


def _bends(knots: Times, points: Points, periodic: bool) -> Points:
    """Return the accelerations at the knots that make the velocity continuous, m/s², (n, 3).

    Inside, h[i-1] m[i-1] + 2 (h[i-1] + h[i]) m[i] + h[i] m[i+1] = 6 (slope[i] - slope[i-1]). The
    acceleration at both ends is one unknown: 0 in a natural spline; in a periodic one the same
    equation holds across the seam, on which all others depend linearly.
    """
    h = np.diff(knots)
    slopes = np.diff(points, axis=0) / h[:, None]
    right = np.zeros(
        (len(h) - 1, 4)
    )  # Three columns for the points, one for the unknown at the ends.
    right[:, :3] = 6.0 * np.diff(slopes, axis=0)
    right[0, 3] -= h[0]
    right[-1, 3] -= h[-1]  # With three points, the inner one has the unknown on both sides.
    solved = _tridiagonal(2.0 * (h[:-1] + h[1:]), h[1:-1], right)
    alone, influence = solved[:, :3], solved[:, 3:]
    end = np.zeros(3)
    if periodic:
        seam = 6.0 * (slopes[0] - slopes[-1]) - h[0] * alone[0] - h[-1] * alone[-1]
        end = seam / (2.0 * (h[0] + h[-1]) + h[0] * influence[0] + h[-1] * influence[-1])
    return np.vstack([end, alone + influence * end, end])


def _tridiagonal(
    diagonal: NDArray[np.float64], beside: NDArray[np.float64], right: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solve a symmetric tridiagonal system.

    Args:
        diagonal: Shape (n,); each larger than the sum of the numbers beside it.
        beside: Off-diagonal, shape (n - 1,).
        right: Right-hand sides, shape (n, k).

    Returns:
        Shape (n, k).
    """
    pivots, solved = diagonal.copy(), right.copy()
    for i in range(1, len(pivots)):
        factor = beside[i - 1] / pivots[i - 1]
        pivots[i] -= factor * beside[i - 1]
        solved[i] -= factor * solved[i - 1]
    solved[-1] /= pivots[-1]
    for i in range(len(pivots) - 2, -1, -1):
        solved[i] = (solved[i] - beside[i] * solved[i + 1]) / pivots[i]
    return solved


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
    return FingertipPath(Spline.through(times, points, closed), float(times[-1]), closed)


def _text(name: str) -> str:
    try:
        return pathlib.Path(name).read_text("utf-8-sig")  # Spreadsheets write a mark.
    except OSError as error:
        raise PathError(f"{name} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise PathError(f"{name} is not UTF-8 text: {error.reason}.") from error


def _rows(name: str, text: str) -> tuple[list[int], list[list[float]]]:
    """Return line numbers, and rows of t, x, y and z."""
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
        raise PathError(f"{name}, line {reader.line_num}, is not valid CSV: {error}.") from error
    if order is None:
        raise PathError(f"{name} is empty: {_HEADER}.")
    return lines, rows


def _order(found: Sequence[str], where: str) -> list[int]:
    """Return the columns of t, x, y and z."""
    missing = [name for name in _COLUMNS if name not in found]
    surplus = [name for name in found if name not in _COLUMNS]
    twice = [name for name in _COLUMNS if found.count(name) > 1]
    problems = [f"lacks {', '.join(missing)}"] if missing else []
    problems += [f"has the unknown columns {', '.join(map(repr, surplus))}"] if surplus else []
    problems += [f"has {', '.join(twice)} twice"] if twice else []
    if problems:
        raise PathError(f"{where} {' and '.join(problems)}: {_HEADER}.")
    return [found.index(name) for name in _COLUMNS]


def _number(cell: str, column: str, where: str) -> float:
    try:
        number = float(cell)
    except ValueError as error:
        raise PathError(f"{where}: {column} is {cell!r}, which is not a number.") from error
    if not math.isfinite(number):
        raise PathError(f"{where}: {column} is {cell!r}, which is not finite.")
    return number


def _require_steady(times: Times, where: Sequence[str]) -> None:
    """Refuse times that do not increase, and gaps.

    Args:
        times: Times of the rows, s.
        where: File and line of each row, for messages.

    Raises:
        PathError: If time stands still, runs backwards or has a gap.
    """
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
    """Refuse jumps.

    Args:
        times: Times of the rows, s.
        points: Their points, m.
        where: File and line of each row, for messages.

    Raises:
        PathError: If the point is faster than `FASTEST_MPS`.
    """
    for i in range(1, len(where)):
        seconds, distance = float(times[i] - times[i - 1]), math.dist(points[i], points[i - 1])
        if jumps(distance, seconds):
            raise PathError(
                f"{where[i]}: {too_fast(distance, seconds)}; t must be in s, and x, y, z in m."
            )


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
        PathError: If it is none of these, or the path is invalid.
    """
    given: Any = value  # May be anything where nothing checks types.
    if isinstance(given, FingertipPath):
        return given
    if isinstance(given, (str, PurePath)) and str(given).lower().endswith(_FILE):
        return from_csv(given)
    if isinstance(given, PurePath):
        raise PathError(f"A path file must end in {_FILE}, got {str(given)!r}.")
    if isinstance(given, str):
        return _maker(given)()
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
    maker = _maker(kind)
    known = tuple(inspect.signature(maker).parameters)
    for name in settings:
        if name not in known:
            raise UnknownName(f"setting of {kind!r}", str(name), known)
    return maker(**settings)


def _maker(kind: str) -> Callable[..., FingertipPath]:
    if kind not in _MAKERS:
        raise UnknownName("path", kind, KINDS)
    return _MAKERS[kind]
