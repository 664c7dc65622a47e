"""Columns of an HDF5 file that grow chunk by chunk, so that no episode must fit into memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.libraries import library

__all__ = ["GrowingColumns"]


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
