"""Paths that a fingertip follows: shapes, functions of time, and recorded tables.

Positions are in the finger's frame: x distal, y radial, z dorsal, in metres from the knuckle (the
MCP joint). Times are in s. `FingerTrack-v1` refuses paths that the nominal finger cannot follow.

>>> from shapechanger.finger.paths import as_path
>>> path = as_path({"kind": "circle", "radius": 0.01, "hz": 1.0})
>>> path.at([0.0, 0.5]).round(3).tolist()
[[0.06, 0.0, -0.045], [0.04, 0.0, -0.045]]
"""

from __future__ import annotations

import csv
import inspect
import io
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from numbers import Real
from pathlib import Path, PurePath
from typing import Any, Final, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from shapechanger.errors import PathError, require_known
from shapechanger.files import read_text
from shapechanger.finger.parameters import as_numbers

Vector = tuple[float, float, float]
"""x, y and z."""

Array = NDArray[np.float64]

CLOSED_M: Final = 1e-4
"""Largest distance between the two ends of a closed path, m."""


@dataclass(frozen=True, slots=True)
class FingertipPath:
    """Path that a fingertip follows; create it with the functions of this module.

    A closed path is periodic, also before 0 s. An open path begins at 0 s and ends at `duration_s`.
    Before its beginning and after its end, the point is at rest.

    Attributes:
        position: Function that maps times from 0 to `duration_s`, s, shape (n,), to positions, m,
            shape (n, 3).
        duration_s: Period of a closed path, or duration of an open one, s, above 0; infinite for an
            endless function.
        closed: Whether the path is periodic.
    """

    position: Callable[[Array], Array]
    duration_s: float
    closed: bool

    def at(self, t: ArrayLike) -> Array:
        """Return the positions of the point at times.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Positions in the finger's frame, m, shape (..., 3).

        Raises:
            PathError: If a time is not finite, or a function returns no position for it.
        """
        times = np.asarray(t, dtype=np.float64)
        if not np.isfinite(times).all():
            raise PathError("Times of a path must be finite, got NaN or infinity.")
        flat = times.ravel()
        within = np.mod(flat, self.duration_s) if self.closed else flat.clip(0.0, self.duration_s)
        return self.position(within).reshape(*times.shape, 3)


FASTEST_MPS: Final = 2.0
"""Speed limit of paths, m/s: 20 rad/s at 0.1 m. A faster path likely has a jump or wrong units."""


def _require_slow(where: str, first: Array, last: Array, seconds: float) -> None:
    """Raise a PathError if two points are farther apart than `FASTEST_MPS` allows."""
    distance = math.dist(first, last)
    if distance > FASTEST_MPS * seconds:
        raise PathError(
            f"{where}: the point moves {distance:.3g} m in {seconds:.3g} s, but must not be "
            f"faster than {FASTEST_MPS:g} m/s. Times must be in s, and x, y, z in m."
        )


@dataclass(frozen=True, slots=True)
class Harmonics:
    """Motion as a Fourier series.

    At the angle a = 2π `hz` t + `phase`, rad, the point is at, m,
    `centre` + Σ (cos(k a) `cosines[k - 1]` + sin(k a) `sines[k - 1]`), with k = 1, 2, …
    """

    hz: float
    phase: float
    centre: Vector
    cosines: tuple[Vector, ...]
    sines: tuple[Vector, ...]

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Return the positions, or their derivative of an order, at times, s, shape (n,)."""
        multiples = np.arange(1.0, len(self.cosines) + 1.0)
        rates = math.tau * self.hz * multiples  # rad/s, shape (k,).
        # Each derivative of a sine or cosine is a quarter turn ahead, times the rate.
        angles = rates * t[:, None] + self.phase * multiples + order * math.pi / 2.0
        grown = rates**order
        points = (grown * np.cos(angles)) @ np.array(self.cosines)
        points += (grown * np.sin(angles)) @ np.array(self.sines)
        if order == 0:
            points += self.centre
        return points


_CENTRE: Final = (0.050, 0.0, -0.045)
_RADIAL: Final = (0.0, 1.0, 0.0)


def circle(
    radius: float = 0.012,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
) -> FingertipPath:
    """Return a circle at constant speed.

    With `phase` 0 the path begins on its distal side, or on its dorsal side if `normal` points
    along x. It turns around `normal` by the right-hand rule: by default first towards the palm.

    Args:
        radius: Radius, m, above 0.
        centre: Centre in the finger's frame, m.
        hz: Turns per second, above 0.
        normal: Normal of the circle's plane, of any length except 0.
        phase: Phase at 0 s, rad.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    radius = _number("The radius of a circle", radius, 0.0)
    along, across, _ = _axes(normal)
    return _closed("circle", hz, phase, centre, [radius * along], [radius * across])


def figure_eight(
    size: float = 0.024,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
    depth: float = 0.0,
) -> FingertipPath:
    """Return a horizontal figure eight: a lemniscate of Gerono, flat or bent.

    With `phase` 0 it begins at its crossing, towards the distal loop. Seen against `normal`, it
    runs clockwise around the distal loop and counter-clockwise around the other loop.

    Args:
        size: Length along x, or along the direction of the plane nearest to x, m, above 0. The
            width is half the length.
        centre: Centre in the finger's frame, m.
        hz: Periods per second, above 0; one period covers both loops.
        normal: Normal of the plane, of any length except 0.
        phase: Phase at 0 s, rad.
        depth: Extent along `normal`, m: both loops are bent by half of `depth` towards `normal`,
            and the crossing by half of `depth` away; 0 for a flat path.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    size = _number("The size of a figure eight", size, 0.0)
    depth = _number("The depth of a figure eight", depth)
    along, across, out = _axes(normal)
    sines = [size / 2.0 * along, size / 4.0 * across]
    return _closed("figure eight", hz, phase, centre, [np.zeros(3), -depth / 2.0 * out], sines)


def line(
    start: Vector = (0.060, 0.0, -0.040),
    end: Vector = (0.040, 0.0, -0.050),
    hz: float = 0.5,
) -> FingertipPath:
    """Return a straight line, traversed back and forth in harmonic motion.

    Args:
        start: First end in the finger's frame, m.
        end: Other end, m, different from `start`.
        hz: Periods per second, above 0; one period covers both directions.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    first = np.array(_vector("The start of a line", start))
    last = np.array(_vector("The end of a line", end))
    if np.array_equal(first, last):
        raise PathError(f"The ends of a line must differ, got {start!r} twice.")
    middle = first / 2.0 + last / 2.0
    return _closed("line", hz, 0.0, tuple(middle), [first - middle], [np.zeros(3)])


def _number(name: str, value: Any, above: float = -math.inf) -> float:
    """Return a finite number, or raise a PathError that begins with `name`."""
    found = float(value) if isinstance(value, Real) else math.nan
    if isinstance(value, bool) or not above < found < math.inf:
        beyond = " above 0" if above == 0.0 else ""
        raise PathError(f"{name} must be a finite number{beyond}, got {value!r}.")
    return found


def _vector(name: str, value: Any) -> Array:
    """Return three finite numbers, or raise a PathError that begins with `name`."""
    numbers = as_numbers(value)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise PathError(f"{name} must be three finite numbers (x, y, z), got {value!r}.")
    return numbers


def _axes(normal: Vector) -> list[Array]:
    """Return right-handed unit vectors: two in a plane, the first near x, and its normal."""
    out = _vector("The normal of a plane", normal).copy()
    if not out.any():
        raise PathError("The normal of a plane must not be (0, 0, 0): it has no direction.")
    out /= np.abs(out).max()  # Without this, the squares of small numbers may be 0.
    out /= np.linalg.norm(out)
    along = np.eye(3)[0] - out[0] * out
    if np.linalg.norm(along) < 1e-6:
        along = np.eye(3)[2] - out[2] * out
    along /= np.linalg.norm(along)
    return [along, np.cross(out, along), out]


def _closed(
    kind: str,
    hz: float,
    phase: float,
    centre: Vector,
    cosines: list[Array],
    sines: list[Array],
) -> FingertipPath:
    """Return a closed path as `Harmonics`; `kind` names the shape in messages."""
    hz = _number(f"The hz of a {kind}", hz, 0.0)
    plain: list[Any] = [_vector(f"The centre of a {kind}", centre), *cosines, *sines]
    middle, *rows = (tuple(row.tolist()) for row in plain)
    n = len(cosines)
    phase = _number(f"The phase of a {kind}", phase)
    motion = Harmonics(hz, phase, middle, tuple(rows[:n]), tuple(rows[n:]))
    path = FingertipPath(motion, duration_s=1.0 / hz, closed=True)
    with np.errstate(over="ignore", invalid="ignore"):
        around = motion(np.linspace(0.0, path.duration_s, 721), 1)
        fastest = np.hypot(np.hypot(around[:, 0], around[:, 1]), around[:, 2]).max()
    if not fastest <= FASTEST_MPS:
        raise PathError(
            f"A {kind} must not be faster than {FASTEST_MPS:g} m/s, got {fastest:.3g} m/s: make "
            "it smaller, or hz lower."
        )
    return path


# Duration for which a function is checked, s, and the number of steps in this time.
_TRIAL_S: Final = 10.0
_TRIALS: Final = 5000


def from_callable(function: Callable[[float], ArrayLike]) -> FingertipPath:
    """Create an endless path from a function of time.

    Args:
        function: Maps a time in s, from 0 on, to x, y and z in the finger's frame, m. It must be
            deterministic. Its first 10 s are checked at 500 points per second.

    Raises:
        PathError: If the function does not return three finite numbers, or moves faster than
            `FASTEST_MPS` from one checked point to the next.
    """
    path = FingertipPath(partial(_points, function), math.inf, closed=False)
    times = np.linspace(0.0, _TRIAL_S, _TRIALS + 1)
    points = path.at(times)
    for i, t in enumerate(times[:-1]):
        where = f"At {t:.6g} s the path jumps"
        _require_slow(where, points[i], points[i + 1], _TRIAL_S / _TRIALS)
    return path


def _points(function: Callable[[float], ArrayLike], t: Array) -> Array:
    """Return the positions, m, (n, 3), that a function gives for times, s, (n,)."""
    found: list[Array] = []
    for now in t.tolist():
        given = function(now)
        point = as_numbers(given)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise PathError(
                "The function of a path must return three finite numbers (x, y, z) in m, but at "
                f"{now:.6g} s it returned {given!r}."
            )
        found.append(point)
    return np.array(found).reshape(-1, 3)


def from_csv(path: str | os.PathLike[str]) -> FingertipPath:
    """Read a path from a CSV file.

    The first line names the columns `t`, `x`, `y` and `z`, in any order: time in s, position in the
    finger's frame in m. Time steps may vary. A cubic spline connects the rows, with continuous
    velocity and acceleration. Time starts at the first row. A path that ends within 0.1 mm of its
    beginning is closed: its spline is periodic, and passes through the point midway between the
    first and the last row. An open path ends with the last row.

    Args:
        path: The file, in UTF-8; empty lines are skipped.

    Raises:
        PathError: If the file cannot be read, has missing, unknown or repeated columns, or fewer
            than three rows; if a cell is not a finite number; if time does not increase; if a time
            step is more than five times the median; or if the point is faster than `FASTEST_MPS`.
            A message about a row names its line.
    """
    name = os.fspath(path)
    try:
        reader = csv.reader(io.StringIO(read_text(Path(name)), newline=""), strict=True)
        lines = [(f"{name}, line {reader.line_num}", cells) for cells in reader if cells]
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", error)
        raise PathError(f"{name} cannot be read: {reason}.") from error
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    if sorted(header) != ["t", "x", "y", "z"]:
        raise PathError(
            f"{name} names the columns {', '.join(header) or 'none'} in its first line: they must "
            "be t, x, y and z."
        )
    for where, cells in lines[1:]:
        numbers = as_numbers(cells)
        if numbers.shape != (4,) or not np.isfinite(numbers).all():
            raise PathError(f"{where}: a row must be four finite numbers, got {','.join(cells)!r}.")
    if len(lines) < 4:  # A spline of two rows would be a line.
        raise PathError(f"{name} must have at least 3 rows, got {len(lines) - 1}.")
    table = np.array([cells for _, cells in lines[1:]], np.float64)
    table = table[:, [header.index(column) for column in "txyz"]]
    times, points = table[:, 0] - table[0, 0], table[:, 1:]
    steps = np.diff(table[:, 0])
    longest = 5.0 * float(np.median(steps))
    for i, (step, (where, _)) in enumerate(zip(steps.tolist(), lines[2:], strict=True)):
        if not 0.0 < step <= longest:
            raise PathError(
                f"{where}: time must increase, by at most five times the median step; here it goes "
                f"from {table[i, 0]!s} s to {table[i + 1, 0]!s} s."
            )
        _require_slow(where, points[i], points[i + 1], float(times[i + 1] - times[i]))
    closed = math.dist(points[0], points[-1]) <= CLOSED_M
    if closed:
        points[[0, -1]] = (points[0] + points[-1]) / 2.0
    spline = CubicSpline(times, points, bc_type="periodic" if closed else "natural")
    return FingertipPath(cast("Any", spline), float(times[-1]), closed)


PathSource = FingertipPath | str | PurePath | Mapping[str, Any] | Callable[[float], ArrayLike]
"""A path, the name of a shape, a shape with settings, a CSV file, or a function of time."""

_SHAPES: Final[dict[str, Callable[..., FingertipPath]]] = {
    "circle": circle,
    "figure-eight": figure_eight,
    "line": line,
    "curve": partial(figure_eight, depth=0.008),
}

KINDS: Final = tuple(_SHAPES)
"""Names of the shapes."""


def as_path(value: PathSource) -> FingertipPath:
    """Return the path that a value describes.

    Args:
        value: A path; the name of a shape, one of `KINDS`; a mapping with such a name as "kind" and
            with arguments of the function that makes the shape, such as
            `{"kind": "circle", "radius": 0.01, "hz": 1.0}`; the name of a .csv file for `from_csv`;
            or a function for `from_callable`, which makes an endless path.

    Raises:
        UnknownName: If the name of the shape or of a setting is unknown.
        PathError: If the value has another type, or the path is invalid.
    """
    given: Any = value
    if isinstance(given, FingertipPath):
        return given
    if isinstance(given, (str, PurePath)) and str(given).lower().endswith(".csv"):
        return from_csv(given)
    if isinstance(given, str):
        given = {"kind": given}
    if isinstance(given, Mapping) and "kind" in given:
        settings = dict(cast("Mapping[str, Any]", given))
        kind = str(settings.pop("kind"))
        require_known("path", KINDS, kind)
        known = inspect.signature(_SHAPES[kind]).parameters
        require_known(f"setting of {kind!r}", known, *settings)
        return _SHAPES[kind](**settings)
    if callable(cast("Any", given)):
        return from_callable(cast("Callable[[float], ArrayLike]", given))
    raise PathError(
        f'A path must be one of {", ".join(KINDS)}, a mapping with such a name as "kind", a .csv '
        f"file or a function of time, got {given!r}."
    )
