"""What tendons that only pull can hold."""

from __future__ import annotations

from typing import Any, Final, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog, lsq_linear, nnls

__all__ = ["co_contraction", "hold", "spans_all_torques"]

# N·m. A hundredth of what a fingertip of 4 g in the air weighs about its joint.
_TOLERANCE_NM: Final = 1e-6
_LITTLE: Final = 1e-3
# N. The solver wants room between its bounds, however little.
_NOTHING: Final = 1e-9


def co_contraction(arms: ArrayLike) -> NDArray[np.float64] | None:
    """The smallest tensions, each at least 1, that move no joint; None if there are none.

    With such tensions, and moment arms of full rank, every torque can be made: whatever a tendon
    would have to push with is added to all.

    Args:
        arms: Torque about each joint for a newton of each tendon, m, (tendons, joints).

    Returns:
        Shape (tendons,), in multiples of the smallest.
    """
    r = np.asarray(arms, np.float64)
    # Scaled, so that the solver's tolerance is a millionth of a typical arm.
    scale = np.abs(r).max()
    if not scale > 0.0:
        return None
    found = cast(
        "Any",
        linprog(np.ones(len(r)), A_eq=r.T / scale, b_eq=np.zeros(r.shape[1]), bounds=(1.0, None)),
    )
    return np.asarray(found.x) if found.success else None


def spans_all_torques(arms: ArrayLike) -> bool:
    """Whether pulling alone gives every torque, as a finger needs that moves at will."""
    r = np.asarray(arms, np.float64)
    return bool(np.linalg.matrix_rank(r) == r.shape[1]) and co_contraction(r) is not None


def hold(
    arms: ArrayLike, torque: ArrayLike, least: ArrayLike, most: ArrayLike
) -> tuple[NDArray[np.float64], bool]:
    """Tensions that give a torque with as little co-contraction as can be, or come nearest to it.

    Args:
        arms: m, (tendons, joints).
        torque: N·m, (joints,).
        least: Smallest tensions, N, a number or (tendons,).
        most: Largest tensions, N, a number or (tendons,).

    Returns:
        Tensions, N, (tendons,), and whether they give the torque to within a µN·m.
    """
    r = np.asarray(arms, np.float64)
    low, high = (np.broadcast_to(np.asarray(b, np.float64), len(r)) for b in (least, most))
    wanted = np.asarray(torque, np.float64)
    # In mN·m; what the tensions weigh beside the torque only chooses among those that give it.
    matrix = np.concatenate([r.T * 1e3, _LITTLE * np.eye(len(r))])
    goal = np.concatenate([(wanted - r.T @ low) * 1e3, np.zeros(len(r))])
    above = np.asarray(cast("Any", nnls(matrix, goal))[0])
    if (above > high - low).any():
        bounds = (np.zeros(len(r)), np.maximum(high - low, _NOTHING))
        above = np.asarray(cast("Any", lsq_linear(matrix, goal, bounds=bounds, method="bvls")).x)
    tensions = low + above
    return tensions, bool(np.abs(r.T @ tensions - wanted).max() <= _TOLERANCE_NM)
