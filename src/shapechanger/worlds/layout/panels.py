"""Walls of an office corridor: plaster with doors, windows, boards, and corners of brick."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Surface, Wall
from shapechanger.worlds.layout.chance import picked

__all__ = ["DOOR_M", "FRAME_M", "RECESS_M", "panelled"]

DOOR_M: Final = 0.9
"""Width of a door; its wall is wider by a frame at each side."""

FRAME_M: Final = 0.06
"""Width of the frame of a door."""

RECESS_M: Final = 0.15
"""How deep some doors stand back from the wall."""

_PLAIN_M = (0.4, 2.4)

# What is let into the plaster: how often, and how wide, m.
_PANELS: tuple[tuple[Surface, float, tuple[float, float]], ...] = (
    ("door", 0.5, (DOOR_M + 2 * FRAME_M, DOOR_M + 2 * FRAME_M)),
    ("window", 0.2, (1.0, 2.0)),
    ("board", 0.18, (1.0, 2.4)),
    ("glass", 0.12, (0.8, 1.6)),
)
_HOW_OFTEN = [share for _, share, _ in _PANELS]

_Point = NDArray[np.float64]


def panelled(
    rng: np.random.Generator, corners: NDArray[np.float64], bends: NDArray[np.int64], height: float
) -> tuple[Wall, ...]:
    """The walls round a closed line of corners, free space at the left hand.

    Args:
        rng: Chance.
        corners: Shape (n, 2), m; each leg is at least 1.5 m long and at a right angle to the next.
        bends: At each corner 1 where it stands out into the lane, -1 where it is a nook.
        height: Of the walls, m.
    """
    n = len(corners)
    # Nooks are cut off and edges taken off by this much, mostly not at all.
    cut = np.where(rng.random(n) < 0.3, rng.uniform(0.2, 0.5, n), 0.0)
    brick = np.where((bends > 0) & (rng.random(n) < 0.35), rng.uniform(0.3, 0.8, n), 0.0)
    walls: list[Wall] = []
    for k in range(n):
        after = (k + 1) % n
        ahead = corners[after] - corners[k]
        length = float(np.hypot(*ahead))
        ahead /= length
        start, end = corners[k] + ahead * cut[k], corners[after] - ahead * cut[after]
        first, last = start + ahead * brick[k], end - ahead * brick[after]
        if brick[k] > 0.0:
            walls.append(_wall(start, first, height, "brick"))
        walls.extend(_leg(rng, first, last, height))
        if brick[after] > 0.0:
            walls.append(_wall(last, end, height, "brick"))
        if cut[after] > 0.0:
            beyond = corners[(k + 2) % n] - corners[after]
            beyond /= np.hypot(*beyond)
            surface: Surface = "brick" if brick[after] > 0.0 else "plaster"
            walls.append(_wall(end, corners[after] + beyond * cut[after], height, surface))
    return tuple(walls)


def _leg(rng: np.random.Generator, start: _Point, end: _Point, height: float) -> Iterator[Wall]:
    """Plaster from one point to another, with what is let into it."""
    length = float(np.hypot(*(end - start)))
    ahead = (end - start) / length
    back = np.array([ahead[1], -ahead[0]]) * RECESS_M  # Away from the lane.
    done = start
    t = float(rng.uniform(*_PLAIN_M))
    while True:
        surface, _, bounds = _PANELS[picked(rng, _HOW_OFTEN)]
        wide = float(rng.uniform(*bounds))
        recessed = surface == "door" and rng.random() < 0.4
        gap = float(rng.uniform(*_PLAIN_M))
        if t + wide + 0.3 > length:
            break
        near, far = start + ahead * t, start + ahead * (t + wide)
        yield _wall(done, near, height, "plaster")
        if recessed:
            yield _wall(near, near + back, height, "plaster")
            yield _wall(near + back, far + back, height, surface)
            yield _wall(far + back, far, height, "plaster")
        else:
            yield _wall(near, far, height, surface)
        done, t = far, t + wide + gap
    yield _wall(done, end, height, "plaster")


def _wall(start: _Point, end: _Point, height: float, surface: Surface) -> Wall:
    return Wall((float(start[0]), float(start[1])), (float(end[0]), float(end[1])), height, surface)
