"""Procedural textures: upright images of shape (H, W, 3), 0 to 1, painted from a seed."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import require_known

Field = NDArray[np.floating[Any]]
"""Image, (H, W, 3), or one channel, (H, W); large ones have single precision."""


def clouds(
    rng: np.random.Generator, height: int, width: int, rows: int, columns: int, octaves: int = 3
) -> Field:
    """Soft random patches with mean 0 and standard deviation 1, which tile seamlessly.

    An image of height x width pixels has rows x columns patches. Each octave has twice as many
    patches as the last, half as strong.
    """
    total = np.zeros((height, width), np.float32)
    for octave in range(octaves):
        down, across = min(rows << octave, height), min(columns << octave, width)
        knots = rng.standard_normal((down, across)).astype(np.float32)
        total += _stretch(_stretch(knots, height).T, width).T * np.float32(0.5**octave)
    return (total - total.mean()) / (total.std() + np.float32(1e-6))


def grain(rng: np.random.Generator, height: int, width: int) -> Field:
    """White noise, (height, width), with mean 0 and standard deviation 1."""
    return rng.standard_normal((height, width), np.float32)


def blend(ground: Field, colour: tuple[float, float, float], share: Field | float) -> Field:
    """Paint a colour over an image, (H, W, 3), with an opacity from 0 to 1, (H, W) or a number."""
    over = np.asarray(share, np.float32)[..., None]
    return ground + over * (np.asarray(colour, np.float32) - ground)


def _stretch(knots: Field, size: int) -> Field:
    """Columns of `knots`, (k, n), interpolated smoothly and periodically to (size, n)."""
    count = len(knots)
    place = np.arange(size, dtype=np.float32) * np.float32(count / size)
    below = place.astype(np.intp)
    part = place - below
    smooth = (part * part * (3.0 - 2.0 * part))[:, None].astype(np.float32)
    return knots[below % count] * (1.0 - smooth) + knots[(below + 1) % count] * smooth


_Range = tuple[float, float]
_SIZE, _TALL = 256, 512
_SKIRTING: Final = 0.05  # Height of a skirting board divided by the height of its wall.
_DARK: Final = (0.24, 0.22, 0.16)
_FRAME: Final = (0.24, 0.22, 0.19)
_STEEL: Final = (0.75, 0.75, 0.72)


def plain(colour: ArrayLike, height: int = _SIZE, width: int = _SIZE) -> Field:
    """Return an image of one colour, (height, width, 3)."""
    return np.tile(np.asarray(colour, np.float32), (height, width, 1))


def plaster(rng: np.random.Generator) -> Field:
    """Painted wall with a dark skirting board, and often a socket or a notice."""
    height = width = _SIZE
    image = plain(np.array([0.83, 0.79, 0.62]) + rng.uniform(-0.05, 0.05, 3))
    image *= 1.0 + 0.03 * clouds(rng, height, width, 2, 3)[..., None]
    up = np.linspace(1.0, 0.0, height, dtype=np.float32)[:, None, None]
    image *= 0.86 + 0.14 * up  # Brighter near the lamps.
    if rng.random() < 0.7:
        x = int(rng.integers(10, width - 20))
        image[int(height * 0.84) : int(height * 0.88), x : x + 5] *= 0.62
    if rng.random() < 0.8:
        x = int(rng.integers(10, width - 50))
        top, bottom = int(height * 0.28), int(height * 0.5)
        image[top:bottom, x : x + 34] = _FRAME
        image[top + 3 : bottom - 3, x + 3 : x + 31] = rng.uniform(0.45, 0.9, 3)
        image[top + 8 : bottom - 12, x + 8 : x + 26] *= rng.uniform(0.5, 1.1)
    edge = int(height * (1.0 - _SKIRTING))
    image[edge:] = np.asarray(_DARK, np.float32) * rng.uniform(0.8, 1.7)
    image[edge : edge + 2] *= 1.5  # The edge of the board catches the light.
    image[-2:] *= 0.5
    return image


def panel(rng: np.random.Generator) -> Field:
    """Wall with orange wooden panels and a skirting board."""
    image = plaster(rng) * np.asarray((0.92, 0.62, 0.40), np.float32)
    image *= 1.0 + 0.04 * clouds(rng, _SIZE, _SIZE, 2, 40, 2)[..., None]
    image[:, ::64] *= 0.8
    return image


def door(rng: np.random.Generator) -> Field:
    """Wooden door in its frame with a handle, and sometimes panels, a kick plate or a window."""
    height, width = _TALL, _SIZE
    hue = np.array([0.46, 0.26, 0.12]) * rng.uniform(0.75, 1.25) + rng.uniform(-0.04, 0.04, 3)
    image = plain(hue, height, width)
    image *= 1.0 + 0.10 * clouds(rng, height, width, 2, 24, 2)[..., None]
    if rng.random() < 0.5:  # Panels.
        for top, bottom in ((0.10, 0.42), (0.52, 0.88)):
            rows = slice(int(top * height), int(bottom * height))
            image[rows, 60:196] *= 0.82
            image[rows, 60:64] *= 0.6
            image[rows, 192:196] *= 1.25
    if rng.random() < 0.4:
        image[60:220, 165:195] = (0.10, 0.12, 0.11)
        image[60:220, 165:168] = _STEEL
    if rng.random() < 0.4:
        image[int(0.86 * height) : -4, 34:222] = np.asarray(_STEEL, np.float32) * 0.8
    image[int(0.54 * height) : int(0.57 * height), 48:66] = _STEEL
    image[int(0.50 * height) : int(0.62 * height), 46:54] = _STEEL
    frame = np.asarray(_FRAME, np.float32) * rng.uniform(0.7, 1.6)
    image[:, :24] = image[:, -24:] = image[:26] = frame
    image[:, 24:28] = image[:, -28:-24] = image[26:30] = 0.04
    image[:, 20:24] *= 1.4
    image[-5:] = 0.03
    return image


def window(rng: np.random.Generator) -> Field:
    """Tall panes at night with faint reflections."""
    height = width = _SIZE
    image = plain((0.035, 0.04, 0.04), height, width)
    glint = np.clip(clouds(rng, height, width, 6, 4), 0.0, 3.0)
    image += 0.03 * glint[..., None]
    for _ in range(4):
        y, x = int(rng.integers(10, 150)), int(rng.integers(20, 220))
        image[y : y + 3, x : x + 12] += rng.uniform(0.2, 0.6)
    bar = np.asarray((0.62, 0.62, 0.55), np.float32)
    for row in (0.0, 0.3, 0.62, 0.9):
        image[int(row * height) : int(row * height) + 6] = bar
    for column in (0.0, 0.5):
        image[:, int(column * width) : int(column * width) + 6] = bar
    image[int(0.93 * height) :] = _DARK
    return image


def _stones(
    rng: np.random.Generator, rows: int, columns: int, shades: _Range, joints: _Range
) -> tuple[Field, Field]:
    """Brightness of stones, in the range `shades`, and mask of the joints between them.

    Every other row is offset by half a stone. `joints` are height and width of the joints, as
    shares of a stone's.
    """
    y = np.arange(_SIZE)[:, None] * rows / _SIZE
    x = np.arange(_SIZE)[None, :] * columns / _SIZE + 0.5 * (y.astype(int) % 2)
    number = y.astype(int) * columns + x.astype(int) % columns
    shade = rng.uniform(*shades, rows * columns).astype(np.float32)[number]
    joint = ((y % 1.0) < joints[0]) | ((x % 1.0) < joints[1])
    return shade[..., None], joint.astype(np.float32)


def brick(rng: np.random.Generator) -> Field:
    """Courses of red brick."""
    shade, joint = _stones(rng, 24, 5, (0.65, 1.2), (0.14, 0.05))
    image = np.asarray((0.58, 0.26, 0.14), np.float32) * shade
    image *= 1.0 + 0.10 * grain(rng, _SIZE, _SIZE)[..., None]
    return blend(image, (0.62, 0.55, 0.42), joint)


def board(rng: np.random.Generator) -> Field:
    """Whiteboard with writing on a painted wall."""
    image, height, width = plaster(rng), _SIZE, _SIZE
    top, bottom = int(0.14 * height), int(0.62 * height)
    image[top - 3 : bottom + 3, 12:-12] = np.asarray(_STEEL, np.float32) * 0.7
    image[top:bottom, 16:-16] = (0.86, 0.88, 0.82)
    for _ in range(7):
        y, x = int(rng.integers(top + 6, bottom - 6)), int(rng.integers(24, width - 90))
        length = int(rng.integers(20, 70))
        image[y : y + 2, x : x + length] = rng.uniform(0.1, 0.6, 3)
    return image


def glass(rng: np.random.Generator) -> Field:
    """Glass partition in a steel frame: dim, slightly green, brighter above."""
    image = plain((0.30, 0.36, 0.32))
    up = np.linspace(1.3, 0.6, _SIZE, dtype=np.float32)[:, None, None]
    image *= up * (1.0 + 0.08 * clouds(rng, _SIZE, _SIZE, 1, 5)[..., None])
    image[:8] = image[-10:] = image[:, :6] = image[:, -6:] = np.asarray(_STEEL, np.float32) * 0.6
    return image


def fence(rng: np.random.Generator) -> Field:
    """Eight upright planks with gaps, and rails behind them."""
    planks = 8
    wide = _SIZE // planks
    shade = np.repeat(rng.uniform(0.75, 1.15, planks).astype(np.float32), wide)
    image = np.asarray((0.56, 0.43, 0.29), np.float32) * shade[None, :, None]
    image = image * (1.0 + 0.10 * clouds(rng, _SIZE, _SIZE, 2, 48, 2)[..., None])
    image[:, np.arange(_SIZE) % wide < 3] = (0.10, 0.09, 0.06)
    for row in (0.2, 0.75):
        image[int(row * _SIZE) : int(row * _SIZE) + 3] *= 0.7
    image[-14:] *= 0.6
    return image


def shed(rng: np.random.Generator) -> Field:
    """Painted horizontal boards above a plinth."""
    hue = np.array([(0.50, 0.16, 0.11), (0.25, 0.34, 0.42), (0.42, 0.40, 0.33)][rng.integers(3)])
    image = plain(hue)
    image *= 1.0 + 0.07 * clouds(rng, _SIZE, _SIZE, 40, 3, 2)[..., None]
    image[np.arange(_SIZE) % 16 < 2] *= 0.55
    image[-20:] = (0.34, 0.33, 0.31)
    return image


def quay(rng: np.random.Generator) -> Field:
    """Stone blocks, pale above, green and wet below."""
    shade, joint = _stones(rng, 4, 3, (0.82, 1.12), (0.05, 0.03))
    image = np.asarray((0.60, 0.57, 0.51), np.float32) * shade
    image *= 1.0 + 0.09 * clouds(rng, _SIZE, _SIZE, 10, 10, 3)[..., None]
    image = blend(image, (0.25, 0.24, 0.21), joint)
    edge = 0.70 + 0.04 * clouds(rng, 1, _SIZE, 1, 8, 2)
    down = np.linspace(0.0, 1.0, _SIZE, dtype=np.float32)[:, None]
    return blend(image, (0.13, 0.17, 0.10), np.clip((down - edge) * 8.0, 0.0, 0.85))


def asphalt(rng: np.random.Generator) -> Field:
    """Worn asphalt, 3 m wide, with stones, cracks and leaves."""
    image = plain((0.40, 0.39, 0.37), _TALL, _TALL)
    image *= 1.0 + 0.11 * clouds(rng, _TALL, _TALL, 4, 4, 4)[..., None]
    image *= 1.0 + 0.13 * grain(rng, _TALL, _TALL)[..., None]
    cracks = np.abs(clouds(rng, _TALL, _TALL, 4, 4, 3)) < 0.025
    image = blend(image, (0.16, 0.16, 0.15), cracks.astype(np.float32) * 0.8)
    leaves = clouds(rng, _TALL, _TALL, 64, 64, 1) > 2.4
    return blend(image, (0.42, 0.30, 0.12), leaves.astype(np.float32))


def sea(rng: np.random.Generator) -> Field:
    """Deep green water, 3 m wide: wavelets before the wind, whose crests mirror the sky."""
    y, x = np.mgrid[:_TALL, :_TALL].astype(np.float32) * np.float32(2.0 * np.pi / _TALL)
    height = np.zeros((_TALL, _TALL), np.float32)
    wind = rng.uniform(-np.pi, np.pi)
    for _ in range(40):
        # Whole numbers of waves, so that the texture repeats without a seam.
        angle, waves = wind + rng.normal(0.0, 0.55), float(np.exp(rng.uniform(1.2, 3.9)))
        across, down = round(waves * float(np.cos(angle))), round(waves * float(np.sin(angle)))
        swing = np.sin(across * x + down * y + np.float32(rng.uniform(0.0, 2.0 * np.pi)))
        height += swing * np.float32(waves**-0.35)
    height += 0.25 * clouds(rng, _TALL, _TALL, 32, 32, 2) * height.std()
    height = (height - height.mean()) / height.std()
    image = np.asarray((0.16, 0.29, 0.31), np.float32) * (1.0 + 0.20 * height[..., None])
    image *= 1.0 + 0.08 * clouds(rng, _TALL, _TALL, 3, 3, 2)[..., None]
    image = blend(image, (0.46, 0.60, 0.66), np.clip(height - 0.7, 0.0, 1.0) * 0.55)
    return blend(image, (0.90, 0.95, 0.97), np.clip(height - 2.0, 0.0, 1.0) * 0.9)


def paving(rng: np.random.Generator) -> Field:
    """Slabs of concrete on a quay, 2.4 m wide, with a pale edge of stone along the water."""
    columns = 4
    x = np.arange(_SIZE)[None, :] * columns / _SIZE
    shade = rng.uniform(0.86, 1.1, columns).astype(np.float32)[x.astype(int)]
    image = np.asarray((0.50, 0.48, 0.44), np.float32) * shade[..., None]
    image = image * (1.0 + 0.08 * clouds(rng, _SIZE, _SIZE, 8, 24, 3)[..., None])
    image *= 1.0 + 0.05 * grain(rng, _SIZE, _SIZE)[..., None]
    image[:, (x[0] % 1.0) < 0.03] *= 0.55
    edge = int(0.72 * _SIZE)
    image[edge:] *= np.asarray((1.26, 1.25, 1.22), np.float32)
    image[edge : edge + 6] *= 0.55
    return image


def shore(rng: np.random.Generator) -> Field:
    """Far shore in haze, half a circle wide: sand, fields, woods and blue hills."""
    height, width = 64, _TALL
    up = np.linspace(1.0, 0.0, height, dtype=np.float32)[:, None]
    line = 0.18 * clouds(rng, 1, width, 1, 14, 3)
    image = plain((0.42, 0.52, 0.60), height, width)
    image *= 1.0 + 0.04 * clouds(rng, height, width, 3, 40, 2)[..., None]
    for level, colour in ((0.62, (0.34, 0.44, 0.42)), (0.42, (0.30, 0.42, 0.24))):
        image = blend(image, colour, np.clip((level + line - up) * 14.0, 0.0, 1.0))
        line = np.roll(line, width // 3, axis=1)
    woods = np.clip(clouds(rng, height, width, 6, 90, 2) - 0.2, 0.0, 1.0)
    image = blend(image, (0.16, 0.26, 0.15), woods * np.clip((0.5 - up) * 6.0, 0.0, 1.0))
    return blend(image, (0.66, 0.60, 0.46), np.clip((0.06 - up) * 40.0, 0.0, 1.0))


_SKY_SIZE: Final = 64
_ZENITH: Final = np.array([0.36, 0.55, 0.82], np.float32)
_HORIZON: Final = np.array([0.80, 0.86, 0.90], np.float32)
# Faces of the skybox in MuJoCo's order: direction of the middle, of the columns, and of the rows
# from the last to the first. Determined by rendering: seen from within, columns run to the left.
_FACES: Final = (
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
)


def sky(rng: np.random.Generator) -> Field:
    """Sky as six faces, (6 * size, size, 3): blue above, pale at the horizon, mirrored below it."""
    across = (np.arange(_SKY_SIZE, dtype=np.float32) + 0.5) * (2.0 / _SKY_SIZE) - 1.0
    field = clouds(rng, 256, 256, 4, 4, 5)
    cover = rng.uniform(-0.3, 0.9)
    faces: list[Field] = []
    for ahead, right, up in np.asarray(_FACES, np.float32):
        rays = ahead + across[None, :, None] * right - across[:, None, None] * up
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        height = np.abs(rays[..., 2])  # The mirror image in water is below the horizon.
        image = _HORIZON + (_ZENITH - _HORIZON) * np.sqrt(height)[..., None]
        # A layer of clouds seen from below; its height is 40 pixels of the field.
        place = rays[..., :2] / np.maximum(height, 0.08)[..., None] * 40.0
        column, row = (np.mod(place[..., i], 256).astype(np.intp) for i in (0, 1))
        share = np.clip(field[row, column] * 0.5 + cover, 0.0, 1.0)
        share = share * np.clip(height * 4.0, 0.0, 1.0) * 0.8
        faces.append(image + share[..., None] * (0.92 - image))
    return np.concatenate(faces)


_CELL, _ROWS = 64, 4
_LAYERED, _SHEETS = (
    tomllib.loads(Path(__file__).with_name(name).read_text("utf-8"))
    for name in ("layers.toml", "cells.toml")
)


def _layered(
    rng: np.random.Generator,
    colour: ArrayLike,
    size: int = _SIZE,
    hue: float = 0.0,
    layers: Sequence[Mapping[str, Any]] = (),
    fill: Sequence[Any] = (),
    times: Sequence[Any] = (),
    light: tuple[float, float] | None = None,
) -> Field:
    """Texture of layers; `layers.toml` describes them."""
    image = plain(np.add(colour, rng.uniform(-hue, hue, 3)) if hue else colour, size, size)
    fields: list[Field] = []
    for layer in layers:
        if "of" in layer:
            fields.append(fields[int(layer["of"])])
        elif "clouds" in layer:
            fields.append(clouds(rng, size, size, *layer["clouds"]))
        else:
            fields.append(grain(rng, size, size))
        field = np.clip(fields[-1], *layer.get("limits", (-np.inf, np.inf)))
        if "times" in layer:
            image *= 1.0 + layer["times"] * field[..., None]
        else:
            opacity = np.clip(field - layer["above"], 0.0, 1.0) * layer["share"]
            image = blend(image, layer["colour"], opacity)
    for top, bottom, left, right, *value in fill:
        image[top:bottom, left:right] = value
    for top, bottom, left, right, factor in times:
        image[top:bottom, left:right] *= factor
    if light:
        image *= np.linspace(*light, size, dtype=np.float32)[:, None, None]
    return image


def _sheet(rng: np.random.Generator, name: str) -> Field:
    """Texture of many solids, with one cell for each material in `cells.toml`, (256, 256, 3)."""
    image = np.zeros((_ROWS * _CELL, _ROWS * _CELL, 3), np.float32)
    for i, cell in enumerate(_SHEETS[name].values()):
        row, column = (_CELL * k for k in divmod(i, _ROWS))
        colour = np.asarray(cell["colour"], np.float32)
        layers: list[Mapping[str, Any]] = []
        if not cell.get("even"):
            colour = colour * (1.0 + rng.uniform(-0.1, 0.1, 3).astype(np.float32))
            layers = [{"times": 0.04}]
        if "patches" in cell:
            strength, *shape = cell["patches"]
            layers.append({"clouds": shape, "times": strength})
        fill, times = cell.get("fill", ()), cell.get("times", ())
        painted = _layered(rng, colour, _CELL, layers=layers, fill=fill, times=times)
        image[row : row + _CELL, column : column + _CELL] = painted
    return image


PAINTERS: Final[Mapping[str, Callable[[np.random.Generator], Field]]] = MappingProxyType(
    {
        painter.__name__: painter
        for painter in (
            plaster, panel, door, window, brick, board, glass, fence, shed, quay, asphalt, sea,
            paving, shore, sky,
        )
    }
    | {name: functools.partial(_layered, **layered) for name, layered in _LAYERED.items()}
    | {name: functools.partial(_sheet, name=name) for name in _SHEETS}
)  # fmt: skip
"""Painters of the textures, keyed by name."""


@functools.lru_cache(400)  # A set has at most ten textures, and each world a dozen sets.
def texture(name: str, seed: int) -> NDArray[np.uint8]:
    """Paint a texture, read-only, (H, W, 3), with the top row first, or take it from the cache."""
    require_known("texture", PAINTERS, name)
    rng = np.random.default_rng([seed, crc32(name.encode())])
    image = np.clip(PAINTERS[name](rng), 0.0, 1.0)
    result = (image * 255.0 + 0.5).astype(np.uint8)
    result.flags.writeable = False
    return result
