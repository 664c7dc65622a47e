"""Long walls are split into panels and pieces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from shapechanger.vehicles.courses.channel import BankKind, build_banks
from shapechanger.vehicles.courses.corridor import DOOR_M, FRAME_M, RECESS_M, panel_walls
from shapechanger.vehicles.courses.course import Wall
from shapechanger.vehicles.courses.geometry import arc_lengths

_CORNERS = np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 15.0), (0.0, 15.0)])


def length(wall: Wall) -> float:
    """Return the length of a wall, m."""
    return float(np.hypot(*np.subtract(wall.end, wall.start)))


def closed(walls: tuple[Wall, ...]) -> bool:
    """Return whether each wall begins where the previous one ends."""
    pairs = zip(walls, (*walls[1:], walls[0]), strict=True)
    return all(np.allclose(one.end, after.start, atol=1e-9) for one, after in pairs)


@pytest.mark.parametrize("seed", range(8))
def test_long_walls_of_a_corridor_are_split_by_panels(seed: int) -> None:
    """Panels have the width of their kind, with 0.4 to 2.4 m of plaster between them."""
    rng = np.random.default_rng(seed)
    walls = panel_walls(rng, _CORNERS, np.ones(4, np.int64), 2.5)
    assert closed(walls)
    assert {wall.height for wall in walls} == {2.5}
    panels = {
        "door": (DOOR_M + 2 * FRAME_M, DOOR_M + 2 * FRAME_M),
        "window": (1.0, 2.0),
        "board": (1.0, 2.4),
        "glass": (0.8, 1.6),
    }
    assert sum(wall.surface in panels for wall in walls) > 10
    for before, wall in zip((walls[-1], *walls[:-1]), walls, strict=True):
        if wall.surface in panels:
            low, high = panels[wall.surface]
            assert low - 1e-9 <= length(wall) <= high + 1e-9
            if length(before) != pytest.approx(RECESS_M):  # Doors may be recessed.
                assert before.surface == "plaster"
                assert 0.4 - 1e-9 <= length(before) <= 2.4 + 1e-9
    # A leg ends in plaster that is too short for another panel.
    assert max(length(wall) for wall in walls) < 2.4 + 2.4 + 0.3


def test_banks_are_split_into_pieces_of_their_kind() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    route = 10.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    kinds = (
        BankKind("hedge", 0.6, (3.0, 6.0), 1.0, (0.9, 1.9)),
        BankKind("shed", 0.4, (2.0, 4.0), 1.6, (2.1, 2.5)),
    )
    banks = build_banks(np.random.default_rng(0), route, np.full(400, 2.0), kinds)
    for walls, radius in zip(banks, (8.0, 12.0), strict=True):
        assert closed(walls)
        around = arc_lengths(np.array([wall.start for wall in walls]))[-1]
        assert around == pytest.approx(2.0 * np.pi * radius, rel=0.01)
        scale = around / sum(1.0 if w.surface == "hedge" else 1.6 for w in walls)
        assert scale == pytest.approx(1.0, abs=0.04)
        for wall in walls:
            kind = kinds[wall.surface == "shed"]
            assert length(wall) == pytest.approx(scale * kind.piece, rel=0.02)
            assert kind.height[0] <= wall.height <= kind.height[1]
            distances = np.hypot(*np.transpose([wall.start, wall.end]))
            np.testing.assert_allclose(distances, radius, rtol=0.01)
        # A run has at least two pieces of sheds and three of hedges, except where it closes.
        surfaces = [wall.surface for wall in walls]
        changes = sum(a != b for a, b in pairwise(surfaces))
        assert 2 <= changes < len(walls) / 2
