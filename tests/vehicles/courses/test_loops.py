"""Loops on a grid."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.vehicles.courses.geometry import grow_cells, scale_grid, trace_outline


def test_outlines_are_counter_clockwise() -> None:
    """The outline of an L of three cells has eight sides."""
    loop = trace_outline(frozenset({(0, 0), (1, 0), (0, 1)}))
    assert loop is not None
    corners = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 1)]
    assert [tuple(point) for point in loop] == corners


@pytest.mark.parametrize(
    "cells",
    [
        frozenset({(0, 0), (1, 1)}),
        frozenset({(x, y) for x in range(3) for y in range(3)} - {(1, 1)}),
        frozenset({(0, 0), (5, 5)}),
    ],
    ids=["a corner touches", "a hole", "two pieces"],
)
def test_self_touching_outlines_are_refused(cells: frozenset[tuple[int, int]]) -> None:
    """Outlines in several parts, or that touch themselves, return None."""
    assert trace_outline(cells) is None


@pytest.mark.parametrize("seed", range(20))
def test_grown_cells_are_connected(seed: int) -> None:
    """Accepted outlines have unit steps and no repeated point."""
    rng = np.random.default_rng(seed)
    cells = grow_cells(rng, 6)
    assert len(cells) == 6
    loop = trace_outline(cells)
    if loop is None:
        return
    steps = np.abs(np.diff(loop, axis=0, append=loop[:1])).sum(axis=1)
    assert (steps == 1).all()
    assert len({tuple(point) for point in loop}) == len(loop)
    metres = scale_grid(rng, loop, 4.0, 6.0)
    apart = np.hypot(*np.diff(metres, axis=0, append=metres[:1]).T)
    assert apart.min() >= 4.0
    assert apart.max() <= 6.0
