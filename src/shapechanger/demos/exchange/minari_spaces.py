"""From layouts to Gymnasium's spaces, and back as far as that goes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

__all__ = ["Leaf", "box_of", "grid_of", "is_picture", "layout_of", "leaves_of", "stored_as_jpeg"]

_UNIT_UNKNOWN: Final = "?"
_MOST_FEATURES: Final = 512
_SMALLEST_PICTURE: Final = 8  # Pixels. A smaller grid is a map, not a picture.
_SMALLEST_JPEG: Final = 32  # Pixels. Minari stores smaller pictures as they are.
_COLOURS: Final = (1, 3)
_BRIGHTEST: Final = 255


@dataclass(frozen=True, slots=True)
class Leaf:
    """A space that holds no others, in a tree of spaces.

    Attributes:
        path: Keys that lead to it, as in the file; none for the tree itself.
        space: The space.
    """

    path: tuple[str, ...]
    space: spaces.Space[Any]

    @property
    def name(self) -> str:
        """The path as one word; "" for the tree itself."""
        return "/".join(self.path)


def box_of(layout: Layout) -> spaces.Box:
    """The space of the numbers of a layout; in 64 bits, so that nothing is rounded."""
    return spaces.Box(layout.low, layout.high, dtype=np.float64)


def grid_of(width: int, height: int, *, grey: bool) -> spaces.Box:
    """The space of pictures."""
    shape = (height, width) if grey else (height, width, 3)
    return spaces.Box(0, _BRIGHTEST, shape, np.uint8)


def stored_as_jpeg(space: spaces.Space[Any]) -> bool:
    """Whether Minari stores a space as JPEG: `is_image_space` of minari_storage.py."""
    if not isinstance(space, spaces.Box):
        return False
    box = cast("Any", space)
    return (
        len(box.shape) in {2, 3}
        and min(box.shape[:2]) >= _SMALLEST_JPEG
        and box.dtype == np.uint8
        and bool(np.all(box.low == 0))
        and bool(np.all(box.high == _BRIGHTEST))
    )


def is_picture(space: spaces.Space[Any]) -> bool:
    """Whether a space is one of pictures, with the colours last or first."""
    if not isinstance(space, spaces.Box) or cast("Any", space).dtype != np.uint8:
        return False
    shape = space.shape
    if len(shape) == 3 and shape[0] in _COLOURS and shape[2] not in _COLOURS:
        return min(shape[1:]) >= _SMALLEST_PICTURE
    if len(shape) == 3 and shape[2] not in _COLOURS:
        return False
    return len(shape) in {2, 3} and min(shape[:2]) >= _SMALLEST_PICTURE


def leaves_of(space: spaces.Space[Any], path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """The leaves of a tree of spaces, in the order and with the keys of Minari's files."""
    if isinstance(space, spaces.Dict):
        parts = cast("dict[str, spaces.Space[Any]]", cast("Any", space).spaces)
        for key, inner in parts.items():
            yield from leaves_of(inner, (*path, key))
    elif isinstance(space, spaces.Tuple):
        parts = cast("tuple[spaces.Space[Any], ...]", cast("Any", space).spaces)
        for number, inner in enumerate(parts):
            yield from leaves_of(inner, (*path, f"_index_{number}"))
    else:
        yield Leaf(path, space)


def layout_of(leaves: list[Leaf], what: str) -> Layout:
    """A layout for the numbers of some leaves, one after the other; nobody says their units.

    Args:
        leaves: The leaves.
        what: What they are of, "action" or "observation".

    Raises:
        DemosError: If one of them holds no numbers.
    """
    features: list[Feature] = []
    for leaf in leaves:
        low, high = _bounds(leaf, what)
        name = leaf.name or what
        if low.size == 1:
            features.append(Feature(name, _UNIT_UNKNOWN, float(low[0]), float(high[0])))
        elif low.size > _MOST_FEATURES:
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
    """Smallest and largest values of the numbers of a leaf, shape (n,) each."""
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
                f"The {what} has {leaf.name or 'a space'!r} of the kind {type(space).__name__}, "
                "and those that can be imported are Box, Discrete, MultiDiscrete and MultiBinary."
            )
    if low.size == 0:
        raise DemosError(f"The {what} has {leaf.name or 'a space'!r} without any number.")
    return low.astype(np.float64), high.astype(np.float64)
