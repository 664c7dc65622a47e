"""Textures made of numbers: no picture is stored or copied from anywhere."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import UnknownName
from shapechanger.worlds.paint import indoor, outdoor
from shapechanger.worlds.paint.noise import Field
from shapechanger.worlds.paint.sky import sky
from shapechanger.worlds.paint.things import stuffs

__all__ = ["PAINTERS", "texture"]

PAINTERS: Final[Mapping[str, Callable[[np.random.Generator], Field]]] = MappingProxyType(
    {
        "plaster": indoor.plaster,
        "panel": indoor.panel,
        "door": indoor.door,
        "window": indoor.window,
        "brick": indoor.brick,
        "board": indoor.board,
        "glass": indoor.glass,
        "floor": indoor.floor,
        "ceiling": indoor.ceiling,
        "hedge": outdoor.hedge,
        "fence": outdoor.fence,
        "shed": outdoor.shed,
        "quay": outdoor.quay,
        "rock": outdoor.rock,
        "asphalt": outdoor.asphalt,
        "grass": outdoor.grass,
        "water": outdoor.water,
        "sky": sky,
        "things": stuffs,
    }
)
"""What paints each texture."""

# A set of textures has at most ten of these, and there are a dozen sets per world to draw from.
_KEPT: Final = 400


@functools.lru_cache(_KEPT)
def texture(name: str, seed: int) -> NDArray[np.uint8]:
    """A texture, shape (H, W, 3), upright: the first row is the top. It cannot be written to.

    Raises:
        UnknownName: If nothing paints `name`.
    """
    if name not in PAINTERS:
        raise UnknownName("texture", name, PAINTERS)
    rng = np.random.default_rng([seed, crc32(name.encode())])
    image = np.clip(PAINTERS[name](rng), 0.0, 1.0)
    result = (image * 255.0 + 0.5).astype(np.uint8)
    result.flags.writeable = False
    return result
