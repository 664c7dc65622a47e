"""A path: where a point should be at any time, and how fast it goes there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import PathError
from shapechanger.tasks.paths.asked import positive

__all__ = ["CLOSED_M", "Motion", "Path", "Points", "Times", "sample"]

Times = NDArray[np.float64]
"""Seconds, shape (n,)."""

Points = NDArray[np.float64]
"""Positions in m, or their derivatives by time, shape (n, 3)."""

CLOSED_M: Final = 1e-4
"""How far from its beginning a path may end that counts as closed, m."""


class Motion(Protocol):
    """How a point moves from 0 s until its path ends, or begins again."""

    def derivative(self, t: Times, order: int) -> Points:
        """Position, velocity or acceleration.

        Args:
            t: Times from 0 to the end, both included, s, shape (n,).
            order: 0 for positions in m, 1 for m/s, 2 for m/s².

        Returns:
            A new array, shape (n, 3).
        """
        ...


@dataclass(frozen=True, slots=True)
class Path:
    """A path that a fingertip follows; the functions of this package make them.

    A closed path repeats for ever, to both sides of 0 s. Another one begins at 0 s and ends at
    `duration_s`: before and after the point stays where it begins and ends.

    Attributes:
        motion: How the point moves meanwhile.
        duration_s: How long once round takes, or the path until it ends, s, above 0; infinite for
            a function that goes on for ever without repeating itself.
        closed: Whether it repeats.
    """

    motion: Motion
    duration_s: float
    closed: bool

    @property
    def period_s(self) -> float | None:
        """After how long it repeats, s; None for a path that does not."""
        return self.duration_s if self.closed else None

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """Where the point is.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Positions in the frame of the finger, m: the shape of `t` and three more, (..., 3).

        Raises:
            PathError: If a time is not finite, or a function has no position to it.
        """
        return self._derivative(t, 0)

    def velocity(self, t: ArrayLike) -> NDArray[np.float64]:
        """How fast the point moves, and whither; 0 before a path begins and after it ended.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Velocities, m/s, shape (..., 3).

        Raises:
            PathError: As `at`.
        """
        return self._derivative(t, 1)

    def acceleration(self, t: ArrayLike) -> NDArray[np.float64]:
        """How the velocity changes; 0 before a path begins and after it ended.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Accelerations, m/s², shape (..., 3).

        Raises:
            PathError: As `at`.
        """
        return self._derivative(t, 2)

    def _derivative(self, t: ArrayLike, order: int) -> NDArray[np.float64]:
        times = np.asarray(t, dtype=np.float64)
        if not np.isfinite(times).all():
            raise PathError("A path is asked for finite times in s, got NaN or infinity.")
        flat = times.ravel()
        within = np.mod(flat, self.duration_s) if self.closed else flat.clip(0.0, self.duration_s)
        points = self.motion.derivative(within, order)
        if order and not self.closed:
            points[within != flat] = 0.0
        return points.reshape(*times.shape, 3)


def sample(
    path: Path, hz: float, duration_s: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and points of a path, evenly and from end to end.

    Args:
        path: What is sampled.
        hz: Samples in a second, above 0. Where they do not fit into the time they come a little
            closer together, so that beginning and end are both among them.
        duration_s: How long, s, above 0; once round, or until the path ends, if left out.

    Returns:
        Times from 0 on, s, shape (n,), and positions, m, shape (n, 3), with n at least 2.

    Raises:
        PathError: If `hz` or `duration_s` is no finite number above 0, or is left out for a path
            that goes on for ever.
    """
    hz = positive("hz", hz)
    length = path.duration_s if duration_s is None else positive("duration_s", duration_s)
    if math.isinf(length):
        raise PathError("This path neither ends nor repeats: say for how long, with duration_s.")
    steps = max(1, math.ceil(length * hz - 1e-9))  # 1.1 s at 50 Hz are 55.00000000000001 steps.
    times = np.linspace(0.0, length, steps + 1)
    return times, path.at(times)
