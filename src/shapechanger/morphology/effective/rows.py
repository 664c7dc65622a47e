"""Collecting what is known about the elements of one kind, one field at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Element", "Fields", "Rows", "Section", "Value"]

Value = float | str
Fields = tuple[tuple[str, tuple[Value, ...]], ...]
Element = tuple[str, Fields]
Section = tuple[Element, ...]

_Bools = NDArray[np.bool_]


class Rows:
    """The elements of one kind, each with the fields gathered for it so far."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._rows: list[dict[str, tuple[Value, ...]]] = [{} for _ in names]

    def numbers(self, field: str, values: ArrayLike, where: _Bools | None = None) -> None:
        """Give each element, or each where `where` holds, its row of `values`.

        Args:
            field: What the numbers are.
            values: Numbers of any type, shape (n,) or (n, ...).
            where: Which elements have the field, shape (n,); all where None.
        """
        if not self._rows:
            return
        # Adding zero turns -0.0, which nothing distinguishes from 0.0, into 0.0.
        flat = np.asarray(values, np.float64).reshape(len(self._rows), -1) + 0.0
        present = [True] * len(self._rows) if where is None else where.tolist()
        for row, numbers, has in zip(self._rows, flat.tolist(), present, strict=True):
            if has:
                row[field] = tuple(numbers)

    def words(self, field: str, words: Iterable[str | tuple[Value, ...]]) -> None:
        """Give each element its word, or its words; an empty word is left out."""
        for row, word in zip(self._rows, words, strict=True):
            if word:
                row[field] = (word,) if isinstance(word, str) else word

    def parts(
        self, field: str, values: ArrayLike, starts: Sequence[int], counts: Sequence[int]
    ) -> None:
        """Give each element `counts` rows of `values` from `starts` on; none where it has none."""
        flat = np.asarray(values, np.float64) + 0.0
        for row, start, count in zip(self._rows, starts, counts, strict=True):
            if count > 0:
                row[field] = tuple(flat[start : start + count].ravel().tolist())

    def section(self, keep: _Bools | None = None, *, in_order: bool = False) -> Section:
        """The elements with their fields.

        Args:
            keep: Which elements to keep, shape (n,); all where None.
            in_order: Keep the model's order, because it decides what the numbers of a state or a
                control mean; sort by name otherwise.
        """
        kept = [True] * len(self._rows) if keep is None else keep.tolist()
        elements = [
            (name, tuple(row.items()))
            for name, row, wanted in zip(self._names, self._rows, kept, strict=True)
            if wanted
        ]
        return tuple(elements if in_order else sorted(elements))
