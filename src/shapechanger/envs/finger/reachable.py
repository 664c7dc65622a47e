"""Whether the finger can follow a path: is every point in its reach, and are its tendons enough?"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger.anatomy import LEAST_TENSION_N, MOMENT_ARMS, MOST_TENSION_N
from shapechanger.embodiments.finger.balance import hold
from shapechanger.envs.finger.inverse import angles_for
from shapechanger.envs.finger.postures import moving_torque
from shapechanger.errors import PathError
from shapechanger.tasks.paths import Path, sample

__all__ = ["beginning_if_reachable", "require_reachable"]

_CHECK_HZ: Final = 50.0
# A path that goes on for ever is looked at for so long, s.
_LOOK_S: Final = 60.0
# How far off a point may be that counts as reached, m: a tenth of what counts as success.
_OFF_M: Final = 0.0005
_LOOKS: Final = 20


def beginning_if_reachable(path: Path, looks: int) -> NDArray[np.float64] | None:
    """Angles that begin a path, rad, (4,); None for one that the nominal finger cannot follow.

    Args:
        path: In the finger's axes, m.
        looks: At how many points it is looked at, about.
    """
    times, points = sample(path, looks / path.duration_s)
    angles, left = _angles_along(points)
    return None if left is not None or _weakness(times, angles) else angles[0]


def require_reachable(path: Path) -> NDArray[np.float64]:
    """Let pass a path that the nominal finger can follow.

    Args:
        path: In the finger's axes, m.

    Returns:
        Angles that begin it, rad, (4,).

    Raises:
        PathError: If a point is out of reach, and where and by how much; or if the tendons cannot
            move the finger as fast, and what is missing.
    """
    times, points = sample(path, _CHECK_HZ, min(path.duration_s, _LOOK_S))
    angles, left = _angles_along(points)
    if left is not None:
        # Where it is farthest off says more than where it leaves.
        later = range(left, len(points), max(1, len(points) // _LOOKS))
        worst, k = max((angles_for(points[k])[1], k) for k in later)
        raise PathError(
            f"The path leaves what the finger reaches: at {times[k]:.2f} s it is at "
            f"{_in_mm(points[k])} mm, {worst * 1e3:.1f} mm beyond. "
            "The knuckle is at (0, 0, 0); x points to the tip, y to the thumb, z to the back."
        )
    if weakness := _weakness(times, angles):
        t, missing = weakness
        raise PathError(
            f"The tendons are too weak for the path: at {t:.2f} s a joint lacks "
            f"{missing * 1e3:.1f} mN·m. Make it slower."
        )
    return angles[0]


def _angles_along(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], int | None]:
    """Angles for each point, rad, (n, 4), and which point is the first out of reach, if any is."""
    angles = np.empty((len(points), 4))
    near: NDArray[np.float64] | None = None
    for i, point in enumerate(points):
        near, off = angles_for(point, near)
        angles[i] = near
        if off > _OFF_M:
            return angles, i
    return angles, None


def _weakness(
    times: NDArray[np.float64], angles: NDArray[np.float64]
) -> tuple[float, float] | None:
    """When the tendons are too weak, s, and what a joint lacks, N·m; None if never."""
    speeds: NDArray[np.float64] = np.asarray(np.gradient(angles, times, axis=0))
    accelerations: NDArray[np.float64] = np.asarray(np.gradient(speeds, times, axis=0))
    for t, q, speed, acceleration in zip(times, angles, speeds, accelerations, strict=True):
        torque = moving_torque(q, speed, acceleration)
        tensions, is_enough = hold(MOMENT_ARMS, torque, LEAST_TENSION_N, MOST_TENSION_N)
        if not is_enough:
            return float(t), float(np.abs(torque - MOMENT_ARMS.T @ tensions).max())
    return None


def _in_mm(point: NDArray[np.float64]) -> str:
    return "({:.1f}, {:.1f}, {:.1f})".format(*(1e3 * point))
