"""The arithmetic of a map: each number is one other number times a scale, or a constant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import SpaceMismatch
from shapechanger.transfer.body_map.entries import Entry, Side
from shapechanger.transfer.body_map.rules import Hold, Learn, Take, Zero

__all__ = ["Gather"]


@dataclass(frozen=True, slots=True)
class Gather:
    """What fills each number of a flat vector.

    A number that is taken with scale 1 is copied to the last bit.

    Attributes:
        kind: What the vectors that go in are, for messages.
        n_over: How many numbers go in.
        rows: Places that are taken from the input, shape (n_taken,).
        columns: For each of them the place in the input, shape (n_taken,).
        scale: For each of them the factor, shape (n_taken,).
        offset: The constant at every place, 0 where it is taken, shape (n_into,).
    """

    kind: str
    n_over: int
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    scale: NDArray[np.float64]
    offset: NDArray[np.float64]

    @classmethod
    def of(cls, side: Side, entries: Sequence[Entry]) -> Gather:
        """The arithmetic of one half of a map."""
        into, over = side.into.slices, side.over.slices
        rows: list[int] = []
        columns: list[int] = []
        scale: list[float] = []
        offset = np.zeros(side.into.size)
        for entry in entries:
            place = into[entry.feature]
            match entry.rule:
                case Take(feature, factor):
                    taken = over[feature]
                    rows += range(place.start, place.stop)
                    columns += range(taken.start, taken.stop)
                    scale += [factor] * (place.stop - place.start)
                case Hold(value):
                    offset[place] = value
                case Zero() | Learn():
                    pass
        return cls(
            kind=side.over_kind,
            n_over=side.over.size,
            rows=np.asarray(rows, dtype=np.intp),
            columns=np.asarray(columns, dtype=np.intp),
            scale=np.asarray(scale, dtype=np.float64),
            offset=offset,
        )

    def __call__(self, values: ArrayLike) -> NDArray[Any]:
        """Fill a vector for each vector given.

        Args:
            values: Shape (..., n_over).

        Returns:
            A new array of shape (..., n_into): float32 for float32, float64 for float64 and for
            integers that float32 cannot hold.

        Raises:
            SpaceMismatch: If the last axis has another length.
        """
        given = np.asarray(values)
        if given.shape[-1:] != (self.n_over,):
            raise SpaceMismatch(
                f"The layout holds {self.n_over} numbers, one or more to a {self.kind}: "
                f"the last axis must have that length, and the shape given is {given.shape}."
            )
        dtype = np.result_type(given.dtype, np.float32)
        filled = np.empty((*given.shape[:-1], self.offset.size), dtype)
        filled[...] = self.offset
        filled[..., self.rows] = given[..., self.columns] * self.scale
        return filled

    def matrix(self) -> NDArray[np.float64]:
        """The linear part, shape (n_into, n_over)."""
        dense = np.zeros((self.offset.size, self.n_over))
        dense[self.rows, self.columns] = self.scale
        return dense
