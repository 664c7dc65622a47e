"""Reading and writing numbers that lie far apart in memory in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Rows", "Scattered"]

# Which rows are meant; None for all.
Rows = NDArray[np.intp] | None

_BYTES = 8


class Scattered:
    """Many small arrays, wherever they lie, as the rows of one.

    To look at one array after another costs more than the numbers in them, so it is computed once
    how far each number lies from the lowest one.

    Args:
        rows: For each row its arrays, contiguous, with items of 8 bytes; all rows have as many
            numbers. They are kept, and with them the memory that is read and written.
    """

    def __init__(self, rows: Sequence[Sequence[NDArray[Any]]]) -> None:
        self._arrays = [array for row in rows for array in row if array.size]
        places = np.array([np.concatenate([_addresses(array) for array in row]) for row in rows])
        lowest = min(self._arrays, key=_address)
        self._places = (places - _address(lowest)) // _BYTES
        # Only places that belong to one of the arrays are ever touched.
        self._memory = np.lib.stride_tricks.as_strided(
            lowest.reshape(-1)[:1].view(np.float64),
            shape=(int(self._places.max()) + 1,),
            strides=(_BYTES,),
        )

    def read(self, rows: Rows = None) -> NDArray[np.float64]:
        """The bits of what the arrays hold now, shape (rows, numbers of one)."""
        places = self._places if rows is None else self._places[rows]
        read = np.empty(places.shape)
        # With any other mode NumPy reads into memory of its own first.
        self._memory.take(places, out=read, mode="clip")
        return read

    def write(self, values: NDArray[Any], rows: Rows = None) -> None:
        """Put float64 numbers, shape (rows, numbers of one), where the arrays lie."""
        self._memory[self._places if rows is None else self._places[rows]] = values


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


def _addresses(array: NDArray[Any]) -> NDArray[np.int64]:
    """The address of each item."""
    return _address(array) + _BYTES * np.arange(array.size, dtype=np.int64)
