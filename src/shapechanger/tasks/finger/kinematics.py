"""Where the fingertip is, by the angles of the joints.

Axes: x points to the tip of the straight finger, y to the thumb, z to the back of the hand; the
origin is the knuckle. Flexion and radial abduction are positive. The order of angles is knuckle
flexion, knuckle abduction, middle joint, end joint; the knuckle flexes before it abducts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["fingertip", "fingertip_jacobian"]


def fingertip(angles: ArrayLike, phalanges: Sequence[float]) -> NDArray[np.float64]:
    """Place of the fingertip, m, shape (..., 3).

    Args:
        angles: rad, (..., 4).
        phalanges: Lengths of the proximal, middle and distal phalanx, m.
    """
    q = np.asarray(angles, np.float64)
    flexion, abduction = q[..., 0], q[..., 1]
    along, down = _in_plane(q, phalanges)
    ahead = along * np.cos(abduction)
    return np.stack(
        [
            ahead * np.cos(flexion) - down * np.sin(flexion),
            along * np.sin(abduction),
            -ahead * np.sin(flexion) - down * np.cos(flexion),
        ],
        axis=-1,
    )


def fingertip_jacobian(angles: ArrayLike, phalanges: Sequence[float]) -> NDArray[np.float64]:
    """How the fingertip moves with each angle, m/rad, shape (..., 3, 4)."""
    q = np.asarray(angles, np.float64)
    flexion, abduction, middle, end = (q[..., j] for j in range(4))
    along, down = _in_plane(q, phalanges)
    both = middle + end
    zero = np.zeros_like(flexion)
    # (d along, d down) with each angle; and what abduction turns aside.
    end_along, end_down = -phalanges[2] * np.sin(both), phalanges[2] * np.cos(both)
    middle_along = end_along - phalanges[1] * np.sin(middle)
    middle_down = end_down + phalanges[1] * np.cos(middle)
    cos, sin = np.cos(flexion), np.sin(flexion)
    ahead = along * np.cos(abduction)
    aside = -along * np.sin(abduction)

    def turned(d_ahead: NDArray[np.float64], d_y: NDArray[np.float64], d_down: NDArray[np.float64]):
        return np.stack([d_ahead * cos - d_down * sin, d_y, -d_ahead * sin - d_down * cos], axis=-1)

    columns = [
        np.stack([-ahead * sin - down * cos, zero, -ahead * cos + down * sin], axis=-1),
        turned(aside, along * np.cos(abduction), zero),
        turned(middle_along * np.cos(abduction), middle_along * np.sin(abduction), middle_down),
        turned(end_along * np.cos(abduction), end_along * np.sin(abduction), end_down),
    ]
    return np.stack(columns, axis=-1)


def _in_plane(
    q: NDArray[np.float64], phalanges: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far the tip is along the proximal phalanx, and how far towards the palm, m."""
    proximal, middle, distal = phalanges
    both = q[..., 2] + q[..., 3]
    along = proximal + middle * np.cos(q[..., 2]) + distal * np.cos(both)
    return along, middle * np.sin(q[..., 2]) + distal * np.sin(both)
