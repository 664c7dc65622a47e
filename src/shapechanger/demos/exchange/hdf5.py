"""HDF5 files of strangers, which may claim more than they hold."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from shapechanger.demos.exchange.files import MAX_UNPACKED, library
from shapechanger.errors import DemosError


@contextmanager
def open_hdf5(path: Path) -> Generator[Any]:
    """Open an HDF5 file for reading, as an `h5py.File`."""
    h5py = library("h5py")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise DemosError(f"{path} is not an intact HDF5 file: {error}.") from error
    try:
        yield file
    except (OSError, RuntimeError) as error:  # Raised by h5py for inconsistent bytes.
        raise DemosError(f"{path} is damaged: {error}.") from error
    finally:
        file.close()


def _row_bytes(column: Any) -> int:
    """Return the memory of one entry of a dataset, bytes."""
    return math.prod(column.shape[1:]) * column.dtype.itemsize


def chunk_of(columns: Iterable[Any], most: int) -> int:
    """Return how many entries of columns to read at once: at most as many as fit, at least one."""
    return max(1, min(most, MAX_UNPACKED // max(1, sum(map(_row_bytes, columns)))))


def column(file: Any, name: str, length: int = 0) -> Any:
    """Return a dataset in an HDF5 file; no link is followed.

    Args:
        file: An open `h5py.File`.
        name: Path of the dataset in the file.
        length: Minimum number of entries.

    Raises:
        DemosError: If it is missing, elsewhere, too short, or unpacks to too much.
    """
    h5py = library("h5py")
    where, found = file.filename, file
    for part in name.split("/"):
        link = found.get(part, getlink=True) if isinstance(found, h5py.Group) else None
        if isinstance(link, h5py.ExternalLink):
            raise DemosError(f"{where} has {name!r} in another file, which is not opened.")
        if isinstance(link, h5py.SoftLink):  # It may lead through a link to another file.
            raise DemosError(f"{where} has a link for {name!r}, and links are not followed.")
        if link is None or (found := found.get(part)) is None:
            raise DemosError(f"{where} has no {name!r}, so the dataset is incomplete.")
    if not isinstance(found, h5py.Dataset):
        raise DemosError(f"{where}: {name!r} is not an array.")
    if found.external or found.is_virtual:
        raise DemosError(f"{where} has {name!r} in another file, which is not opened.")
    # HDF5 unpacks whole chunks, and a step may claim any shape.
    unpacked = max(_row_bytes(found), math.prod(found.chunks or ()) * found.dtype.itemsize)
    if unpacked > MAX_UNPACKED:
        raise DemosError(
            f"{where}: {name!r} unpacks to {unpacked} bytes at once, more than the limit of "
            f"{MAX_UNPACKED}."
        )
    if not found.shape or found.shape[0] < length:
        have = found.shape[0] if found.shape else 0
        raise DemosError(f"{where}: {name!r} has {have} entries, but {length} are needed.")
    return found


def names_in(file: Any, *groups: str) -> list[str]:
    """Return the names in a group of groups; no link is followed."""
    h5py = library("h5py")
    found: Any = file
    for part in groups:
        if not isinstance(found.get(part, getlink=True), h5py.HardLink):
            return []
        found = found[part]
        if not isinstance(found, h5py.Group):
            return []
    return [str(name) for name in found]
