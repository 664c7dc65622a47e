"""Boxes and turned bodies as patches."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.paint.things import CELLS, ROWS
from shapechanger.worlds.scene.patches import Array, Patches

__all__ = ["add_box", "add_turned"]

# What of a cell is left out at its edges, so that far away its neighbours do not shine through.
_INSET: Final = 0.08
_SIDES: Final = 10
# Corners of a cube from -1 to 1: the four sides and the top, each counter-clockwise from outside
# and from its lower left; nothing that stands is seen from below.
_BOX: Final = np.array(
    [
        [(1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)],
        [(1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1)],
        [(-1, 1, -1), (-1, -1, -1), (-1, -1, 1), (-1, 1, 1)],
        [(-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)],
        [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
    ],
    float,
)
_BOX_LIGHT: Final = np.array([0.9, 0.75, 0.7, 0.85, 1.0])
_FOOT: Final = 0.75


def add_box(
    patches: Patches, middle: Array, half: Array, yaw: float, stuff: str, light: float
) -> None:
    """An upright box around `middle` (3,) with half sizes (3,), m, turned by `yaw`."""
    corners = _turned(_BOX * half, yaw) + middle
    lights = np.repeat(_BOX_LIGHT[:, None], 4, axis=1) * light
    lights[:4, :2] *= _FOOT
    patches.add(corners, np.tile(_cell(stuff, _square()), (5, 1, 1)), lights)


def add_turned(
    patches: Patches, x: float, y: float, profile: Array, stuff: str, light: float
) -> None:
    """A body turned on a lathe: `profile` (n, 2) is its radius and height, m, going up."""
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.empty((len(profile), _SIDES + 1, 3))
    points[..., :2] = profile[:, None, :1] * ring + (x, y)
    points[..., 2] = profile[:, None, 1]
    rise = profile[:, 1] - profile[0, 1]
    places = np.empty((len(profile), _SIDES + 1, 2))
    places[..., 0] = np.abs(2.0 * angle / (2.0 * np.pi) - 1.0)
    places[..., 1] = 1.0 - (rise / max(float(rise[-1]), 1e-6))[:, None]
    lights = np.empty((len(profile), _SIDES + 1, 1))
    lights[..., 0] = light * (0.82 + 0.18 * np.cos(angle - 0.7))
    lights[0] *= _FOOT
    patches.add(_grid(points), _cell(stuff, _grid(places)), _grid(lights)[..., 0])


def _square() -> Array:
    return np.array([[(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]])


def _cell(stuff: str, places: Array) -> Array:
    """Places from 0 to 1 within the cell of a stuff, as places within the whole picture."""
    row, column = divmod(CELLS[stuff], ROWS)
    return (np.array([column, row]) + _INSET + (1.0 - 2.0 * _INSET) * places) / ROWS


def _turned(corners: Array, yaw: float) -> Array:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return corners @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _grid(grid: Array) -> Array:
    corners = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    return np.stack(corners, axis=2).reshape(-1, 4, grid.shape[-1])
