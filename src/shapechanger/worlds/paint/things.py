"""One picture with a cell for each stuff that things are made of."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from shapechanger.worlds.paint.noise import Field, clouds, grain

__all__ = ["CELLS", "ROWS", "stuffs"]

ROWS: Final = 4
"""Cells in a row of the picture, and rows."""

_CELL: Final = 64
# The colour of each stuff.
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

CELLS: Final[Mapping[str, int]] = MappingProxyType({name: i for i, name in enumerate(_COLOURS)})
"""Where each stuff is: row by row from the top left."""


def stuffs(rng: np.random.Generator) -> Field:
    """All stuffs in one picture, shape (256, 256, 3), 0 to 1."""
    image = np.zeros((ROWS * _CELL, ROWS * _CELL, 3), np.float32)
    for name, colour in _COLOURS.items():
        row, column = divmod(CELLS[name], ROWS)
        cell = image[row * _CELL : (row + 1) * _CELL, column * _CELL : (column + 1) * _CELL]
        cell[:] = _cell(name, np.asarray(colour, np.float32), rng)
    return image


def _cell(name: str, colour: Field, rng: np.random.Generator) -> Field:
    """One stuff, shape (64, 64, 3)."""
    cell = np.tile(colour, (_CELL, _CELL, 1))
    if name == "lamp":
        return cell
    cell *= 1.0 + rng.uniform(-0.1, 0.1, 3).astype(np.float32)
    cell *= 1.0 + 0.04 * grain(rng, _CELL, _CELL)[..., None]
    if name == "leaves":
        cell *= 1.0 + 0.35 * clouds(rng, _CELL, _CELL, 10, 10, 2)[..., None]
    elif name in ("wood", "dark wood", "bark"):
        cell *= 1.0 + 0.12 * clouds(rng, _CELL, _CELL, 16, 2, 2)[..., None]
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
    return cell
