"""Closed loops on a grid: the outlines that corridors and channels follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cell", "grown", "outline", "spread"]

Cell = tuple[int, int]
"""Column and row of a square."""

_SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))


def grown(rng: np.random.Generator, size: int) -> frozenset[Cell]:
    """`size` squares that hang together by their sides, grown one by one from the first.

    The set may have holes and squares that touch by a corner only; `outline` refuses those.
    """
    cells: set[Cell] = {(0, 0)}
    while len(cells) < size:
        around = sorted({(x + i, y + j) for x, y in cells for i, j in _SIDES} - cells)
        cells.add(around[int(rng.integers(len(around)))])
    return frozenset(cells)


def outline(cells: frozenset[Cell]) -> NDArray[np.int64] | None:
    """Grid points round the squares, counter-clockwise, each one step from the next, shape (n, 2).

    None where the outline meets itself or is in several pieces: no lane could follow it.
    """
    edges: dict[Cell, Cell] = {}
    count = 0
    for x, y in cells:
        corners = ((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1))
        for side, (i, j) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if (x + i, y + j) not in cells:
                edges[corners[side]] = corners[(side + 1) % 4]
                count += 1
    if len(edges) != count:  # Two edges leave one point: squares touch by a corner.
        return None
    first = min(edges)
    loop = [first]
    while (point := edges[loop[-1]]) != first:
        loop.append(point)
    return np.array(loop) if len(loop) == count else None


def spread(
    rng: np.random.Generator, loop: NDArray[np.int64], shortest_m: float, longest_m: float
) -> NDArray[np.float64]:
    """The loop in metres, each row and column of the grid as wide as chance wills, shape (n, 2)."""
    steps = rng.uniform(shortest_m, longest_m, size=(2, int(np.ptp(loop)) + 2))
    lines = np.cumsum(steps, axis=1)
    shifted = loop - loop.min(axis=0)
    return np.stack([lines[0, shifted[:, 0]], lines[1, shifted[:, 1]]], axis=1)
