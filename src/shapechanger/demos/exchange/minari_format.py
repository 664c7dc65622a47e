"""What a Minari dataset of ours looks like: the names that writing and reading share.

An observation is the picture, the state, or a dictionary of both. A picture is stored as the bytes
of the JPEG that was recorded, which Minari decodes when it reads: nothing is encoded anew. Where
Minari does not store JPEG, for pictures below 32 pixels, they are stored as pixels and the bytes
beside them. Minari wants one observation more than there are steps: the last one is there twice.

The infos of a step, by name:

- `applied`, `wanted`: numbers as those of the action; `has_applied`, `has_wanted`: whether they are
  known. `driver`, `stop_reason`: text.
- `captured_ns`, `decided_ns`, `wall_ns`: times, and `UNKNOWN_NS` where nobody knows.
- `frame`: number of the picture in the episode, from 0, the same for steps that share one.
- `rewarded`: whether the reward is known; it is NaN if not.
- `more`: JSON of what has no place of its own: `terms`, `marks`, `dropped`.

The headers of the episodes, the layouts and the rate are in `metadata.json`.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.exchange.pictures import library
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

__all__ = [
    "DATA",
    "HEADERS",
    "HEADERS_FORMAT",
    "IMAGE",
    "JPEG",
    "MAIN",
    "METADATA",
    "STATE",
    "TIMES",
    "UNKNOWN_NS",
    "GrowingColumns",
    "Leaf",
    "box_of",
    "column",
    "data_folder",
    "grid_of",
    "is_picture",
    "layout_of",
    "leaves_of",
    "open_hdf5",
    "stored_as_jpeg",
]

DATA: Final = "data"
METADATA: Final = "metadata.json"
MAIN: Final = "main_data.hdf5"

IMAGE: Final = "image"
STATE: Final = "state"
JPEG: Final = "jpeg"

HEADERS: Final = "shapechanger"
"""Key of what only Shapechanger reads in `metadata.json`."""

HEADERS_FORMAT: Final = 1

TIMES: Final = ("captured_ns", "decided_ns", "wall_ns")

UNKNOWN_NS: Final = -(2**63)
"""A time that nobody knows, ns."""


def data_folder(folder: Path) -> Path | None:
    """The folder with the files of a Minari dataset: `data` in its own folder; None for none."""
    for place in (folder / DATA, folder):
        if (place / METADATA).is_file():
            return place
    return None


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


class GrowingColumns:
    """The columns of one group.

    Args:
        group: An open `h5py.Group`.
    """

    def __init__(self, group: Any) -> None:
        self._group = group

    def numbers(self, name: str, values: NDArray[Any]) -> None:
        """Append numbers, shape (n, ...)."""
        self._append(name, values, values.dtype)

    def texts(self, name: str, values: Sequence[str]) -> None:
        """Append texts; HDF5 cannot hold the letter NUL, which is left out."""
        column = np.empty(len(values), object)
        column[:] = [value.replace("\0", "") for value in values]
        self._append(name, column, library("h5py").string_dtype("utf-8"))

    def blobs(self, name: str, values: Sequence[bytes]) -> None:
        """Append bytes, each as its own array of uint8."""
        column = self._grown(name, len(values), (), library("h5py").vlen_dtype(np.dtype(np.uint8)))
        start = column.shape[0] - len(values)
        # One by one: h5py takes several arrays of one length for one array of two dimensions.
        for number, value in enumerate(values, start):
            column[number] = np.frombuffer(value, np.uint8)

    def repeat_last(self, name: str) -> None:
        """Append what a column ends with once more."""
        column = self._group[name]
        last = column[-1]
        column.resize(column.shape[0] + 1, axis=0)
        column[-1] = last

    def _append(self, name: str, values: NDArray[Any], dtype: Any) -> None:
        column = self._grown(name, len(values), values.shape[1:], dtype)
        column[column.shape[0] - len(values) :] = values

    def _grown(self, name: str, more: int, shape: tuple[int, ...], dtype: Any) -> Any:
        """A column with room for more entries at its end; it is made where it is missing."""
        if name not in self._group:
            self._group.create_dataset(
                name, shape=(0, *shape), maxshape=(None, *shape), dtype=dtype, chunks=True
            )
        column = self._group[name]
        column.resize(column.shape[0] + more, axis=0)
        return column


@contextmanager
def open_hdf5(path: Path) -> Generator[Any]:
    """A file that is open for reading, an `h5py.File`, until the block ends.

    Raises:
        DemosError: If it is no such file, or is damaged where it is read.
        MissingExtra: If h5py is not installed.
    """
    h5py = library("h5py")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise DemosError(f"{path} cannot be read, or is no whole HDF5 file: {error}.") from error
    try:
        yield file
    except (OSError, RuntimeError) as error:  # What h5py raises where bytes contradict each other.
        raise DemosError(f"{path} is damaged: {error}.") from error
    finally:
        file.close()


def column(file: Any, name: str, where: Path, length: int | None = None) -> Any:
    """A dataset in a file.

    Args:
        file: An open `h5py.File`.
        name: Its path in the file.
        where: The file.
        length: How many entries it has at least; None for any number.

    Raises:
        DemosError: If it is not there, or too short, or its content lies in another file.
    """
    h5py = library("h5py")
    found: Any = file
    for part in name.split("/"):
        link = found.get(part, getlink=True) if isinstance(found, h5py.Group) else None
        if isinstance(link, h5py.ExternalLink):
            raise DemosError(f"{where} has {name!r} in another file, which is not followed.")
        if link is None or (found := found.get(part)) is None:
            raise DemosError(f"{where} has no {name!r}, so the dataset is not whole.")
    if not isinstance(found, h5py.Dataset):
        raise DemosError(f"{where}: {name!r} is no array.")
    if found.external or found.is_virtual:
        raise DemosError(f"{where} has {name!r} in another file, which is not followed.")
    if length is not None and (not found.shape or found.shape[0] < length):
        have = found.shape[0] if found.shape else 0
        raise DemosError(f"{where}: {name!r} has {have} entries, and {length} are needed.")
    return found
