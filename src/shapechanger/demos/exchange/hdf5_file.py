"""Reads HDF5 files of others: what is not there is said in words, and nothing leads elsewhere."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from shapechanger.demos.exchange.libraries import library
from shapechanger.errors import DemosError

__all__ = ["column", "open_hdf5"]


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
