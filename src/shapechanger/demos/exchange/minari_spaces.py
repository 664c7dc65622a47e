"""Spaces of Minari datasets: their parts, and what those are called."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import (
    MAX_FEATURES,
    MAX_UNPACKED,
    MAX_VALUES,
    UNIT_UNKNOWN,
    library,
    parse_json,
)
from shapechanger.demos.exchange.format import ImportContext
from shapechanger.demos.jpeg import MAX_PIXELS
from shapechanger.errors import DemosError, MissingExtra
from shapechanger.layout import Feature, Layout

_MIN_PICTURE: Final = 8  # Pixels. A smaller grid is a map, not a picture.
_MIN_JPEG: Final = 32
_BRIGHTEST: Final = 255
_CHANNELS: Final = (1, 3)
_DEEP: Final = (np.uint16, np.int16, np.uint32)


@dataclass(frozen=True, slots=True)
class Leaf:
    """A space without subspaces, in a tree of spaces.

    Attributes:
        path: Keys that lead to it, as in the file; () for the tree itself.
        space: The space.
    """

    path: tuple[str, ...]
    space: spaces.Space[Any]

    @property
    def name(self) -> str:
        """The path as one word; "" for the tree itself."""
        return "/".join(self.path)


def is_imported(leaf: Leaf, context: ImportContext) -> bool:
    """Return whether a part of an observation is numbers; others are reported."""
    space, shape = leaf.space, leaf.space.shape or ()
    about = f"{leaf.name or 'the observation'} ({space})"
    numbers = spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary
    if not isinstance(space, numbers):
        context.note(f"The observation {about} is not imported.")
        return False
    deep = isinstance(space, spaces.Box) and cast("Any", space).dtype in _DEEP
    if deep and len(shape) in {2, 3} and min(shape[:2]) >= _MIN_PICTURE:
        context.leave_out("observation", "with pictures of an unknown kind or of depth", about)
    elif math.prod(shape) > MAX_VALUES:
        context.leave_out("observation", f"of more than {MAX_VALUES} values", about)
    else:
        return True
    return False


def read_leaves(metadata: dict[str, Any], name: str, path: Path) -> list[Leaf]:
    """Return the leaves of a space of the metadata.

    Args:
        metadata: Content of the metadata file.
        name: Key of the space.
        path: The metadata file, for errors.

    Raises:
        DemosError: If it is missing, invalid, or of too many values.
        MissingExtra: If Minari is not installed.
    """
    text = metadata.get(name)
    if not isinstance(text, str):
        raise DemosError(
            f"{path} has no {name}, so its values cannot be interpreted: create the dataset again "
            "with this space."
        )
    if _largest(parse_json(text, f"The {name} in {path}")) > MAX_UNPACKED:
        raise DemosError(f"The {name} in {path} claims more than {MAX_UNPACKED} values.")
    try:
        return list(_leaves(library("minari.serialization").deserialize_space(text)))
    except MissingExtra:
        raise
    except Exception as error:  # Its errors for invalid text are not documented.
        raise DemosError(f"The {name} in {path} cannot be read: {error}.") from error


def _largest(space: Any) -> int:
    """Return the number of values that the shapes in the JSON of a space claim."""
    if isinstance(space, list):
        return sum(map(_largest, cast("list[Any]", space)))
    if not isinstance(space, dict):
        return 0
    fields = cast("dict[str, Any]", space)
    shape = cast("list[Any]", s) if isinstance(s := fields.get("shape"), list) else []
    own = math.prod(n for n in shape if isinstance(n, int))
    return own + sum(_largest(value) for key, value in fields.items() if key != "shape")


def _leaves(space: spaces.Space[Any], path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """Yield the leaves of a tree of spaces, in the order and with the keys of Minari's files."""
    parts: dict[str, spaces.Space[Any]] = {}
    if isinstance(space, spaces.Dict):
        parts = cast("Any", space).spaces
    elif isinstance(space, spaces.Tuple):
        parts = {f"_index_{n}": inner for n, inner in enumerate(cast("Any", space).spaces)}
    else:
        yield Leaf(path, space)
    for key, inner in parts.items():
        yield from _leaves(inner, (*path, key))


def layout_of(leaves: Sequence[Leaf], what: str) -> Layout:
    """Return a layout for the values of leaves, of an "action" or "observation", in order."""
    features: list[Feature] = []
    for leaf in leaves:
        low, high = _bounds(leaf, what)
        name = leaf.name or what
        if low.size > MAX_FEATURES:
            least, most = float(low.min()), float(high.max())
            features.append(Feature(name, UNIT_UNKNOWN, least, most, shape=(int(low.size),)))
            continue
        for number, (least, most) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
            numbered = name if low.size == 1 else f"{name}/{number}"
            features.append(Feature(numbered, UNIT_UNKNOWN, least, most))
    return Layout(tuple(features))


def _bounds(leaf: Leaf, what: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounds of the values of a leaf, shape (n,) each."""
    space = leaf.space
    match space:
        case spaces.Box():
            low, high = space.low.ravel(), space.high.ravel()
        case spaces.Discrete():
            low, high = np.array([space.start]), np.array([space.start + space.n - 1])
        case spaces.MultiDiscrete():
            low, high = space.start.ravel(), (space.start + space.nvec - 1).ravel()
        case spaces.MultiBinary():
            low, high = np.zeros(space.shape).ravel(), np.ones(space.shape).ravel()
        case _:
            raise DemosError(
                f"The {what} has {leaf.name or 'a space'!r} of the type {type(space).__name__}, "
                "which cannot be imported: use Box, Discrete, MultiDiscrete or MultiBinary."
            )
    if low.size == 0:
        raise DemosError(f"The {what} has {leaf.name or 'a space'!r} without any values.")
    return low.astype(np.float64), high.astype(np.float64)


def picture_size(space: spaces.Space[Any]) -> tuple[int, int] | None:
    """Return the width and height of the pictures of a space; None if it has no pictures."""
    shape = space.shape or ()
    if not isinstance(space, spaces.Box) or cast("Any", space).dtype != np.uint8:
        return None
    if len(shape) == 3 and colours_first(shape):
        shape = shape[1:]
    elif len(shape) != 2 and (len(shape) != 3 or shape[2] not in _CHANNELS):
        return None
    height, width = shape[:2]
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The pictures of the dataset have {width} x {height} pixels, more than the limit of "
            f"{MAX_PIXELS}: make them smaller."
        )
    return (width, height) if min(height, width) >= _MIN_PICTURE else None


def colours_first(shape: tuple[int, ...]) -> bool:
    """Return whether the first of three axes is that of the colours."""
    return shape[0] in _CHANNELS and shape[2] not in _CHANNELS


def stored_as_jpeg(space: spaces.Space[Any]) -> bool:
    """Return whether Minari stores a space as JPEG: `is_image_space` of its minari_storage.py."""
    if not isinstance(space, spaces.Box):
        return False
    box = cast("Any", space)
    return (
        len(box.shape) in {2, 3}
        and min(box.shape[:2]) >= _MIN_JPEG
        and box.dtype == np.uint8
        and bool(np.all(box.low == 0) and np.all(box.high == _BRIGHTEST))
    )
