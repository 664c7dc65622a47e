"""Textures by name, drawn from a seed by `paint`, and sheets with a cell for each material."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
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
    """Paint a texture, or take it from the cache.

    Args:
        name: One of `PAINTERS`.
        seed: Seed, >= 0.

    Returns:
        Texture, uint8, (H, W, 3), with the top row first; it is read-only.

    Raises:
        UnknownName: If the texture is unknown.
    """
    if name not in PAINTERS:
        raise UnknownName("texture", name, PAINTERS)
    rng = np.random.default_rng([seed, crc32(name.encode())])
    image = np.clip(PAINTERS[name](rng), 0.0, 1.0)
    result = (image * 255.0 + 0.5).astype(np.uint8)
    result.flags.writeable = False
    return result
