"""A smooth line through a lane whose edges are known: the least bent one between bounds.

The points of the line are `middle + offset * left`, so how much it bends, the sum of its squared
second differences, is a quadratic function of the offsets, and the best offsets between bounds are
a convex problem. Racing lines are found like this: F. Braghin et al., "Race driver model",
Computers and Structures 86 (2008); A. Heilmeier et al., "Minimum curvature trajectory planning",
Vehicle System Dynamics 58 (2020).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["least_bent"]

ROUNDS: Final = 150
RELAXATION: Final = 1.6
"""S. Boyd et al., "Distributed Optimization and Statistical Learning via the Alternating Direction
Method of Multipliers" (2011), section 3.4.3: 1.5 to 1.8 converge faster than 1."""


def least_bent(
    middle: NDArray[np.float64],
    left: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    wish: NDArray[np.float64],
    pull: float,
) -> NDArray[np.float64]:
    """Offsets of a closed line that bends little.

    Args:
        middle: (N, 2) points, m, evenly spaced.
        left: (N, 2) direction in which each may be moved.
        low: (N,) smallest offset of each, m.
        high: (N,) largest offset of each, m.
        wish: (N,) offset that each would have, m.
        pull: How much a line is bent for the wish: 1/m^4, a curvature of 1/m costs as much as being
            `1 / sqrt(pull)` m away.

    Returns:
        (N,) offsets within the bounds.
    """
    count = len(middle)
    step = float(np.linalg.norm(np.roll(middle, -1, axis=0) - middle, axis=1).mean())
    bend = (
        np.roll(np.eye(count), 1, axis=1) + np.roll(np.eye(count), -1, axis=1) - 2 * np.eye(count)
    )
    bend /= step**2
    gram = bend.T @ bend
    quadratic = gram * (left @ left.T) + pull * np.eye(count)
    linear = np.einsum("ij,ij->i", left, gram @ middle) - pull * wish
    # Scaled form of the alternating direction method: a step without bounds, a step onto them.
    weight = 10.0 * pull + 1.0
    inverse = np.linalg.inv(quadratic + weight * np.eye(count))
    bounded = np.clip(wish, low, high)
    debt = np.zeros(count)
    for _ in range(ROUNDS):
        free = inverse @ (weight * (bounded - debt) - linear)
        free = RELAXATION * free + (1 - RELAXATION) * bounded
        bounded = np.clip(free + debt, low, high)
        debt += free - bounded
    # The rest exactly: whoever lies on a bound stays there.
    moves = (bounded > low + 1e-6) & (bounded < high - 1e-6)
    if moves.any():
        fixed = quadratic[np.ix_(moves, ~moves)] @ bounded[~moves]
        bounded[moves] = np.linalg.solve(quadratic[np.ix_(moves, moves)], -linear[moves] - fixed)
    return np.clip(bounded, low, high)
