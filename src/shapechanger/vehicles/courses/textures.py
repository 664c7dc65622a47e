"""Textures by name, drawn from a seed by `paint`, and sheets with a cell for each material."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import UnknownName
from shapechanger.vehicles.courses import paint

ROWS: Final = 4
"""Number of cells in a row of the obstacles' texture, and of rows."""

_CELL: Final = 64
# Colour of each cell.
_COLOURS: Final[Mapping[str, tuple[float, float, float]]] = MappingProxyType(
    {
        "wood": (0.52, 0.34, 0.18),
        "dark wood": (0.26, 0.12, 0.07),
        "cardboard": (0.66, 0.52, 0.34),
        "metal": (0.50, 0.52, 0.52),
        "leaves": (0.19, 0.36, 0.12),
        "clay": (0.58, 0.30, 0.18),
        "cone": (0.92, 0.36, 0.06),
        "post": (0.80, 0.78, 0.70),
        "cabinet": (0.45, 0.47, 0.42),
        "crate": (0.60, 0.45, 0.26),
        "bark": (0.30, 0.22, 0.15),
        "buoy": (0.85, 0.14, 0.08),
        "hull": (0.86, 0.87, 0.88),
        "bin": (0.16, 0.22, 0.20),
        "black": (0.07, 0.07, 0.06),
        "lamp": (1.0, 1.0, 0.96),
    }
)

# The same for what stands or floats behind quays, beyond the vehicle's reach.
_HARBOUR_COLOURS: Final[Mapping[str, tuple[float, float, float]]] = MappingProxyType(
    {
        "white hull": (0.88, 0.89, 0.90),
        "blue hull": (0.10, 0.22, 0.44),
        "green hull": (0.08, 0.30, 0.22),
        "red hull": (0.58, 0.12, 0.08),
        "deck": (0.66, 0.52, 0.34),
        "cabin": (0.90, 0.89, 0.85),
        "panes": (0.10, 0.15, 0.19),
        "spar": (0.72, 0.72, 0.70),
        "canvas": (0.16, 0.30, 0.55),
        "iron": (0.13, 0.12, 0.12),
        "rubber": (0.06, 0.06, 0.06),
        "rust": (0.42, 0.22, 0.12),
        "house": (0.82, 0.78, 0.68),
        "gable": (0.62, 0.28, 0.18),
        "roof": (0.46, 0.20, 0.14),
        "tower": (0.90, 0.88, 0.84),
    }
)

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
            paint.plaster,
            paint.panel,
            paint.door,
            paint.window,
            paint.brick,
            paint.board,
            paint.glass,
            paint.floor,
            paint.ceiling,
            paint.hedge,
            paint.fence,
            paint.shed,
            paint.quay,
            paint.rock,
            paint.asphalt,
            paint.grass,
            paint.water,
            paint.sea,
            paint.paving,
            paint.shore,
            paint.sky,
            things,
            harbour,
        )
    }
)
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
