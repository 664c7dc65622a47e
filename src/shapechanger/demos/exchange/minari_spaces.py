"""Spaces of Minari datasets: their parts, and what those are called."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import library, parse_json
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.minari_files import MAX_UNPACKED
from shapechanger.demos.jpeg import MAX_PIXELS
from shapechanger.errors import DemosError, MissingExtra
from shapechanger.layout import Feature, Layout

_UNIT_UNKNOWN: Final = "?"
_MAX_FEATURES: Final = 512  # A larger space becomes one array feature.
_MAX_VALUES: Final = 1 << 17  # Of a layout.
_MIN_PICTURE: Final = 8  # Pixels. A smaller grid is a map, not a picture.
_CHANNELS: Final = (1, 3)


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
    space = leaf.space
    about = f"{leaf.name or 'the observation'} ({space})"
    if not isinstance(
        space, spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary
    ):
        context.note(f"The observation {about} is not imported.")
        return False
    shape = space.shape or ()
    deep = isinstance(space, spaces.Box) and cast("Any", space).dtype in (
        np.uint16,
        np.int16,
        np.uint32,
    )
    if deep and len(shape) in {2, 3} and min(shape[:2]) >= _MIN_PICTURE:
        context.leave_out("observation", "with pictures of an unknown kind or of depth", about)
        return False
    if math.prod(shape) > _MAX_VALUES:
        context.leave_out("observation", f"of more than {_MAX_VALUES} values", about)
        return False
    return True


def read_space(metadata: dict[str, Any], name: str, path: Path) -> spaces.Space[Any]:
    """Return a space of the metadata.

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
        return library("minari.serialization").deserialize_space(text)
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


def leaves_of(space: spaces.Space[Any], path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """Yield the leaves of a tree of spaces, in the order and with the keys of Minari's files."""
    if isinstance(space, spaces.Dict):
        parts = cast("dict[str, spaces.Space[Any]]", cast("Any", space).spaces)
        for key, inner in parts.items():
            yield from leaves_of(inner, (*path, key))
    elif isinstance(space, spaces.Tuple):
        for number, inner in enumerate(
            cast("tuple[spaces.Space[Any], ...]", cast("Any", space).spaces)
        ):
            yield from leaves_of(inner, (*path, f"_index_{number}"))
    else:
        yield Leaf(path, space)


def layout_of(leaves: list[Leaf], what: str) -> Layout:
    """Return a layout for the values of some leaves, in order.

    Args:
        leaves: The leaves.
        what: What they belong to, "action" or "observation".
    """
    features: list[Feature] = []
    for leaf in leaves:
        low, high = _bounds(leaf, what)
        name = leaf.name or what
        if low.size == 1:
            features.append(Feature(name, _UNIT_UNKNOWN, float(low[0]), float(high[0])))
        elif low.size > _MAX_FEATURES:
            block = (int(low.size),)
            features.append(
                Feature(name, _UNIT_UNKNOWN, float(low.min()), float(high.max()), shape=block)
            )
        else:
            features += [
                Feature(f"{name}/{number}", _UNIT_UNKNOWN, float(lowest), float(highest))
                for number, (lowest, highest) in enumerate(zip(low, high, strict=True))
            ]
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
            low = np.zeros(space.shape).ravel()
            high = np.ones(space.shape).ravel()
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
