"""Textures by name, drawn from a seed by `paint`, and meshes of quads with texture coordinates."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Final
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import UnknownName
from shapechanger.vehicles.bodies.visuals import read_mtl
from shapechanger.vehicles.courses import paint

ROWS: Final = 4
"""Number of cells in a row of the obstacles' texture, and of rows."""

_CELL: Final = 64
_MESHES: Final = Path(__file__).parent / "meshes"
# Colours of the cells of the two sheets.
_COLOURS: Final = read_mtl(_MESHES / "things.mtl")
_HARBOUR_COLOURS: Final = read_mtl(_MESHES / "harbour.mtl")

CELLS: Final[Mapping[str, int]] = MappingProxyType(
    {name: i for sheet in (_COLOURS, _HARBOUR_COLOURS) for i, name in enumerate(sheet)}
)
"""Index of each cell in its texture, "things" or "harbour", row by row from the top left."""


def things(rng: np.random.Generator) -> paint.Field:
    """Texture of all obstacles, with one cell for each material, (256, 256, 3)."""
    return _sheet(_COLOURS, rng)


def harbour(rng: np.random.Generator) -> paint.Field:
    """Texture of boats, quay fittings and houses, with one cell for each material."""
    return _sheet(_HARBOUR_COLOURS, rng)


def _sheet(
    colours: Mapping[str, tuple[float, float, float]], rng: np.random.Generator
) -> paint.Field:
    """Cells of these colours, (256, 256, 3)."""
    image = np.zeros((ROWS * _CELL, ROWS * _CELL, 3), np.float32)
    for name, colour in colours.items():
        row, column = divmod(CELLS[name], ROWS)
        cell = image[row * _CELL : (row + 1) * _CELL, column * _CELL : (column + 1) * _CELL]
        cell[:] = _cell(name, colour, rng)
    return image


def _cell(name: str, colour: ArrayLike, rng: np.random.Generator) -> paint.Field:
    """One cell, (64, 64, 3)."""
    cell = paint.plain(colour, _CELL, _CELL)
    if name == "lamp":
        return cell
    cell *= 1.0 + rng.uniform(-0.1, 0.1, 3).astype(np.float32)
    cell *= 1.0 + 0.04 * paint.grain(rng, _CELL, _CELL)[..., None]
    if name == "leaves":
        cell *= 1.0 + 0.35 * paint.clouds(rng, _CELL, _CELL, 10, 10, 2)[..., None]
    elif name in ("wood", "dark wood", "bark"):
        cell *= 1.0 + 0.12 * paint.clouds(rng, _CELL, _CELL, 16, 2, 2)[..., None]
    elif name == "cone":
        cell[24:38] = (0.92, 0.92, 0.88)
    elif name == "post":
        cell[14:24] = cell[40:50] = (0.75, 0.12, 0.08)
    elif name == "cabinet":
        cell[:, 31:33] *= 0.4
        cell[28:36, 26:28] = cell[28:36, 36:38] = 0.75
        cell[:4] *= 1.3
        cell[-4:] *= 0.5
    elif name == "crate":
        cell[np.arange(_CELL) % 13 < 2] *= 0.3
        cell[:, 8:13] *= 0.8
        cell[:, -13:-8] *= 0.8
    elif name == "cardboard":
        cell[30:34] *= 1.2
        cell[8:20, 10:26] *= 0.7
    elif name == "hull":
        cell[10:18] = (0.16, 0.24, 0.46)
        cell[50:] *= 0.6
    elif name == "buoy":
        cell[26:40] = (0.90, 0.90, 0.86)
    elif name == "bin":
        cell[6:10] *= 2.2
    elif name.endswith(" hull"):
        cell[6:12] = 0.85 if name != "white hull" else (0.14, 0.20, 0.40)
        cell[50:] = (0.30, 0.10, 0.08)  # Antifouling at the waterline.
    elif name == "cabin":
        cell[14:34, 8:56] = (0.10, 0.15, 0.19)
        cell[14:34, 22:25] = cell[14:34, 39:42] = colour
    elif name == "house":
        for column in (8, 26, 44):
            cell[12:26, column : column + 10] = cell[38:52, column : column + 10] = 0.22
    elif name == "tower":
        cell[8:20] = cell[32:44] = cell[56:] = (0.70, 0.10, 0.08)
    return cell


PAINTERS: Final[Mapping[str, Callable[[np.random.Generator], paint.Field]]] = MappingProxyType(
    {
        painter.__name__: painter
        for painter in (
            paint.plaster, paint.panel, paint.door, paint.window, paint.brick, paint.board,
            paint.glass, paint.floor, paint.ceiling, paint.hedge, paint.fence, paint.shed,
            paint.quay, paint.rock, paint.asphalt, paint.grass, paint.water, paint.sea,
            paint.paving, paint.shore, paint.sky, things, harbour,
        )
    }
)  # fmt: skip
"""Painters of the textures by name."""

# Size of the cache: a texture set has at most ten textures, and each world a dozen sets.
_KEPT: Final = 400


@functools.lru_cache(_KEPT)
def texture(name: str, seed: int) -> NDArray[np.uint8]:
    """Paint a texture, read-only, (H, W, 3), with the top row first, or take it from the cache."""
    if name not in PAINTERS:
        raise UnknownName("texture", name, PAINTERS)
    rng = np.random.default_rng([seed, crc32(name.encode())])
    image = np.clip(PAINTERS[name](rng), 0.0, 1.0)
    result = (image * 255.0 + 0.5).astype(np.uint8)
    result.flags.writeable = False
    return result


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

        Corners are (n, 4, 3), m, texture coordinates (n, 4, 2), and lights, 0 to 1, (n, 4). What is
        not `reflected` is hidden in a glossy ground.
        """
        self._reflected.append(reflected)
        self._corners.append(corners)
        self._uvs.append(uvs)
        self._lights.append(np.broadcast_to(np.asarray(lights, float), corners.shape[:2]))

    def add_grid(self, points: Array, uvs: Array, lights: Array) -> None:
        """Add the cells of a grid whose rows go up and whose columns go right, seen from its front.

        Its arrays have the shapes (rows, columns, 3), (rows, columns, 2) and (rows, columns).
        """
        self.add(_grid_cells(points), _grid_cells(uvs), _grid_cells(lights))

    def __bool__(self) -> bool:
        return bool(self._corners)

    def arrays(self, mirrored: bool) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Points, m, (m, 3), texture coordinates, (m, 2), lights, (m,), and triangles, (k, 3).

        `mirrored` adds a copy below the ground, for a glossy ground.
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
    """Add an upright box with a centre and half sizes, m, (3,), in a cell of the texture."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    corners = _BOX * half @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + middle
    lights = np.repeat(_BOX_LIGHT[:, None], 4, axis=1) * light
    lights[:4, :2] *= _FOOT
    square = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
    mesh.add(corners, np.tile(cell(material, square), (5, 1, 1)), lights)


def add_turned(
    mesh: QuadMesh, x: float, y: float, profile: Array, material: str, light: float
) -> None:
    """Add a solid of revolution around (x, y), m; its profile is radius and height, m, (n, 2)."""
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
