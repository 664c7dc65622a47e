"""Spaces of Minari datasets: of others as features of a layout and images, and our own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.exchange.files import MAX_UNPACKED, MAX_VALUES, library, parse_json
from shapechanger.demos.exchange.format import ImportContext
from shapechanger.demos.exchange.imports import features_of
from shapechanger.demos.jpeg import MAX_PIXELS, is_grey, picture_size
from shapechanger.errors import DemosError, MissingExtra
from shapechanger.layout import Feature, Layout

_MIN_PICTURE: Final = 8  # Pixels. A smaller grid is a map, not an image.
_BRIGHTEST: Final = 255
_CHANNELS: Final = (1, 3)
_DEEP: Final = (np.uint16, np.int16, np.uint32)


def leaves_in(metadata: dict[str, Any], name: str, path: Path) -> dict[str, spaces.Space[Any]]:
    """Return the spaces without subspaces in a space of the metadata, by their paths there."""
    text = metadata.get(name)
    if not isinstance(text, str):
        raise DemosError(
            f"{path} has no {name}, so its values cannot be interpreted: create the dataset again "
            "with this space."
        )
    if _largest(parse_json(text, f"The {name} in {path}")) > MAX_UNPACKED:
        raise DemosError(f"The {name} in {path} claims more than {MAX_UNPACKED} values.")
    try:
        return dict(_leaves(library("minari.serialization").deserialize_space(text)))
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


def _leaves(space: spaces.Space[Any], path: str = "") -> Iterator[tuple[str, spaces.Space[Any]]]:
    """Yield the leaves of a tree of spaces, in the order and with the keys of Minari's files."""
    parts: dict[str, spaces.Space[Any]] = {}
    if isinstance(space, spaces.Dict):
        parts = cast("Any", space).spaces
    elif isinstance(space, spaces.Tuple):
        parts = {f"_index_{n}": inner for n, inner in enumerate(cast("Any", space).spaces)}
    else:
        yield path, space
    for key, inner in parts.items():
        yield from _leaves(inner, f"{path}/{key}" if path else key)


def is_imported(name: str, space: spaces.Space[Any], context: ImportContext) -> bool:
    """Return whether a part of an observation is numbers; others are reported."""
    shape, about = space.shape or (), f"{name or 'the observation'} ({space})"
    numbers = spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary
    deep = isinstance(space, spaces.Box) and cast("Any", space).dtype in _DEEP
    if not isinstance(space, numbers):
        context.note(f"The observation {about} is not imported.")
    elif deep and len(shape) in {2, 3} and min(shape[:2]) >= _MIN_PICTURE:
        context.leave_out("observation", "with images of an unknown kind or of depth", about)
    elif math.prod(shape) > MAX_VALUES:
        context.leave_out("observation", f"of more than {MAX_VALUES} values", about)
    else:
        return True
    return False


def features(name: str, space: spaces.Space[Any], what: str) -> list[Feature]:
    """Return the features of the values of a leaf, of an "action" or "observation"."""
    match space:
        case spaces.Box():
            low, high = space.low, space.high
        case spaces.Discrete():
            low, high = space.start, space.start + space.n - 1
        case spaces.MultiDiscrete():
            low, high = space.start, space.start + space.nvec - 1
        case spaces.MultiBinary():
            low, high = np.zeros(space.shape), np.ones(space.shape)
        case _:
            raise DemosError(
                f"The {what} has {name or 'a space'!r} of the type {type(space).__name__}, "
                "which cannot be imported: use Box, Discrete, MultiDiscrete or MultiBinary."
            )
    lows, highs = (np.ravel(np.asarray(end, np.float64)).tolist() for end in (low, high))
    if not lows:
        raise DemosError(f"The {what} has {name or 'a space'!r} without any values.")
    return features_of(name or what, len(lows), low=lows, high=highs)


def picture_size_of(space: spaces.Space[Any]) -> tuple[int, int] | None:
    """Return the width and height of the images of a space; None if it has no images."""
    shape = space.shape or ()
    if not isinstance(space, spaces.Box) or cast("Any", space).dtype != np.uint8:
        return None
    if len(shape) == 3 and _colours_first(shape):
        shape = shape[1:]
    elif len(shape) != 2 and (len(shape) != 3 or shape[2] not in _CHANNELS):
        return None
    height, width = shape[:2]
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The images of the dataset have {width} x {height} pixels, more than the limit of "
            f"{MAX_PIXELS}: make them smaller."
        )
    return (width, height) if min(height, width) >= _MIN_PICTURE else None


def _colours_first(shape: tuple[int, ...]) -> bool:
    """Return whether the first of three axes counts the colours."""
    return shape[0] in _CHANNELS and shape[2] not in _CHANNELS


def pixels_of(stored: Any, size: tuple[int, int] | None) -> NDArray[np.uint8] | None:
    """Return an image with its three colours last; None if it has another size or type."""
    pixels = np.asarray(stored)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and _colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        return None
    return np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels


def box_of(layout: str) -> spaces.Box:
    """Return the space of the values of a layout, in 64 bits, so that nothing is rounded."""
    named = Layout.from_json(layout)
    return spaces.Box(named.low, named.high, dtype=np.float64)


def space_of(
    header: EpisodeHeader, jpeg: bytes | None, name: str
) -> tuple[spaces.Space[Any], spaces.Box | None]:
    """Return the space of all observations by the first image, and its part of the images."""
    state = box_of(header.state_layout) if header.state_layout else None
    picture = None
    if jpeg is not None or header.image_size is not None:
        where = f"of the first step of {name}"
        width, height = header.image_size or picture_size(jpeg or b"", where)
        grey = bool(jpeg) and is_grey(jpeg, where)
        shape = (height, width) if grey else (height, width, 3)
        picture = spaces.Box(0, _BRIGHTEST, shape, np.uint8)
    if picture is not None and state is not None:
        return spaces.Dict({"image": picture, "state": state}), picture
    if picture is None and state is None:
        raise DemosError(
            f"{name} has neither images nor a state, so it has no observations for Minari: "
            "export it to csv."
        )
    return cast("spaces.Space[Any]", state if picture is None else picture), picture
