"""Meshes of quads with texture coordinates and light, and the solids made of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.textures import CELLS, ROWS

Array = NDArray[np.float64]

# The corners of a quad are counter-clockwise seen from its front.
_TRIANGLES: Final = np.array([[0, 1, 2], [0, 2, 3]])
# A mirrored quad has the opposite order.
_MIRRORED: Final = np.array([[0, 2, 1], [0, 3, 2]])
_DOWN: Final = np.array([1.0, 1.0, -1.0])


@dataclass(slots=True)
class QuadMesh:
    """Quads with texture coordinates and light.

    Each has four corners, counter-clockwise seen from its front; its back is invisible. Texture
    coordinates are u to the right and v down, from 0 to 1.
    """

    _corners: list[Array] = field(default_factory=list[Array])
    _uvs: list[Array] = field(default_factory=list[Array])
    _lights: list[Array] = field(default_factory=list[Array])
    _reflected: list[bool] = field(default_factory=list[bool])

    def add(
        self, corners: Array, uvs: Array, lights: Array | float = 1.0, *, reflected: bool = True
    ) -> None:
        """Add n quads.

        Args:
            corners: Corners, m, (n, 4, 3).
            uvs: Texture coordinates of the corners, (n, 4, 2).
            lights: Brightness of each corner, 0 to 1, (n, 4); or of all of them.
            reflected: Whether a glossy ground shows them; False for what is hidden there.
        """
        self._reflected.append(reflected)
        self._corners.append(corners)
        self._uvs.append(uvs)
        self._lights.append(np.broadcast_to(np.asarray(lights, float), corners.shape[:2]))

    def add_grid(self, points: Array, uvs: Array, lights: Array) -> None:
        """Add the cells of a grid whose rows go up and whose columns go right, seen from its front.

        Args:
            points: Grid points, m, (rows, columns, 3).
            uvs: Their texture coordinates, (rows, columns, 2).
            lights: Their brightness, 0 to 1, (rows, columns).
        """
        self.add(_grid_cells(points), _grid_cells(uvs), _grid_cells(lights))

    def __bool__(self) -> bool:
        return bool(self._corners)

    def arrays(self, mirrored: bool) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Points, m, (m, 3), texture coordinates, (m, 2), lights, (m,), and triangles, (k, 3).

        Args:
            mirrored: Whether to add a copy mirrored below the ground, for a glossy ground.
        """
        points = np.concatenate(self._corners).reshape(-1, 3)
        uvs = np.concatenate(self._uvs).reshape(-1, 2)
        lights = np.concatenate(self._lights).reshape(-1)
        first = np.arange(0, len(points), 4)[:, None, None]
        triangles = (first + _TRIANGLES).reshape(-1, 3)
        if mirrored:
            counts = [len(corners) for corners in self._corners]
            shown = np.repeat(np.repeat(self._reflected, counts), 4)
            first = np.arange(len(points), len(points) + int(shown.sum()), 4)[:, None, None]
            triangles = np.concatenate([triangles, (first + _MIRRORED).reshape(-1, 3)])
            points = np.concatenate([points, points[shown] * _DOWN])
            uvs = np.concatenate([uvs, uvs[shown]])
            lights = np.concatenate([lights, lights[shown]])
        return points, uvs, lights, triangles


# Margin of a texture cell, so that its neighbours do not bleed into it at a distance.
_INSET: Final = 0.08
_SIDES: Final = 10
# Corners of a cube from -1 to 1: four sides and the top, counter-clockwise from the lower left.
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
    mesh: QuadMesh, middle: Array, half: Array, yaw: float, material: str, light: float
) -> None:
    """Add an upright box.

    Args:
        mesh: Mesh to extend.
        middle: Its centre, m, (3,).
        half: Half sizes, m, (3,).
        yaw: Rotation about the vertical axis, rad.
        material: Cell of the texture.
        light: Brightness, 0 to 1.
    """
    cos, sin = np.cos(yaw), np.sin(yaw)
    corners = _BOX * half @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + middle
    lights = np.repeat(_BOX_LIGHT[:, None], 4, axis=1) * light
    lights[:4, :2] *= _FOOT
    square = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
    mesh.add(corners, np.tile(cell(material, square), (5, 1, 1)), lights)


def add_turned(
    mesh: QuadMesh, x: float, y: float, profile: Array, material: str, light: float
) -> None:
    """Add a solid of revolution.

    Args:
        mesh: Mesh to extend.
        x: Position of its axis, m.
        y: Position of its axis, m.
        profile: Radius and height from below, m, (n, 2).
        material: Cell of the texture.
        light: Brightness, 0 to 1.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.empty((len(profile), _SIDES + 1, 3))
    points[..., :2] = profile[:, None, :1] * ring + (x, y)
    points[..., 2] = profile[:, None, 1]
    rise = profile[:, 1] - profile[0, 1]
    uvs = np.empty((len(profile), _SIDES + 1, 2))
    uvs[..., 0] = np.abs(2.0 * angle / (2.0 * np.pi) - 1.0)
    uvs[..., 1] = 1.0 - (rise / max(float(rise[-1]), 1e-6))[:, None]
    lights = np.tile(light * (0.82 + 0.18 * np.cos(angle - 0.7)), (len(profile), 1))
    lights[0] *= _FOOT
    mesh.add_grid(points, cell(material, uvs), lights)


def cell(material: str, uvs: Array) -> Array:
    """Texture coordinates within a cell, as coordinates within the whole texture."""
    row, column = divmod(CELLS[material], ROWS)
    return (np.array([column, row]) + _INSET + (1.0 - 2.0 * _INSET) * uvs) / ROWS


def _grid_cells(grid: Array) -> Array:
    """Values at the corners of each cell of a grid (rows, columns, ...): (n, 4, ...)."""
    corners = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    return np.stack(corners, axis=2).reshape(-1, 4, *grid.shape[2:])
