"""Parquet files of strangers, which may claim more than they hold."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import (
    MAX_PACKED,
    MAX_UNPACKED,
    UnpacksToTooMuch,
    library,
)
from shapechanger.errors import DemosError

_ROWS: Final = 256  # In memory at once; fewer if the values of a column are large.
_MAX_TEXT: Final = 4096  # Characters.


@contextmanager
def _opened(path: Path) -> Generator[Any]:
    """Open a Parquet file as a `pyarrow.parquet.ParquetFile`."""
    arrow = library("pyarrow", "lerobot")
    parquet = library("pyarrow.parquet", "lerobot")
    try:
        # Without `buffer_size` a whole row group is in memory, which may be an episode of pictures.
        with parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            size = path.stat().st_size
            claimed = sum(_sizes_of(file, range(file.metadata.num_row_groups)))
            if claimed > MAX_UNPACKED + MAX_PACKED * size or file.metadata.num_rows > size:
                raise UnpacksToTooMuch(
                    f"{path} has {size} bytes, but claims to unpack to {claimed}."
                )
            yield file
    except (arrow.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise DemosError(f"{path} is not an intact Parquet file: {reason}.") from error


def _sizes_of(file: Any, groups: Iterable[int]) -> Iterator[int]:
    """Yield the size of each column of some row groups, bytes."""
    for group in map(file.metadata.row_group, groups):
        for column in map(group.column, range(group.num_columns)):
            yield max(column.total_uncompressed_size, 8 * column.num_values)


def _batches(file: Any, columns: Sequence[str], groups: Sequence[int]) -> Iterator[Any]:
    """Yield the rows of some row groups, a few at a time."""
    # Many rows may share one large value, which is in memory once for each.
    largest = max(_sizes_of(file, groups), default=1)
    rows = max(1, min(_ROWS, MAX_UNPACKED // max(1, largest)))
    return file.iter_batches(rows, row_groups=groups, columns=columns)


def all_rows(path: Path, columns: set[str] | None) -> list[dict[str, Any]]:
    """Return the rows of a small table.

    Args:
        path: The file.
        columns: Names of the columns to read, if they are there; None for all.

    Raises:
        DemosError: If it is damaged, or has a very long text.
    """
    found: list[dict[str, Any]] = []
    with _opened(path) as file:
        known = set(file.schema_arrow.names)
        wanted = sorted(known if columns is None else columns & known)
        for batch in _batches(file, wanted, range(file.metadata.num_row_groups)):
            for row in cast("list[dict[str, Any]]", batch.to_pylist()):
                if any(len(text) > _MAX_TEXT for text in _texts(row)):
                    raise DemosError(f"{path} has a text of more than {_MAX_TEXT} characters.")
                found.append(row)
    return found


def _texts(row: dict[str, Any]) -> Iterator[str]:
    """Yield the texts of a row, also those in lists."""
    for value in row.values():
        values = cast("list[Any]", value) if isinstance(value, list) else [value]
        yield from (text for text in values if isinstance(text, str))


def _vectors(column: Any, size: int, what: str) -> NDArray[np.float64]:
    """Return the numbers of a column, shape (n, size)."""
    types = library("pyarrow.types", "lerobot")
    rows = len(column)
    values: Any = getattr(column, "storage", column)  # Of arrays in an extension type.
    even = not types.is_list(values.type) or len(np.unique(values.value_lengths())) == 1
    while types.is_list(values.type) or types.is_fixed_size_list(values.type):
        values = values.flatten()
    if even and len(values) == rows * size:
        try:
            return np.asarray(values.to_numpy(zero_copy_only=False), np.float64).reshape(rows, size)
        except (TypeError, ValueError) as error:
            raise DemosError(f"{what} is not numeric ({error}).") from error
    raise DemosError(f"{what} does not have {size} numbers in each row.")


def number_columns(
    path: Path, names: Sequence[str]
) -> tuple[dict[str, NDArray[np.float64]], set[str]]:
    """Return columns of single numbers, shape (n,) each, and the names of all columns.

    Those that the file lacks are left out.
    """
    with _opened(path) as file:
        known = [name for name in names if name in file.schema_arrow.names]
        parts: dict[str, list[NDArray[np.float64]]] = {name: [np.empty(0)] for name in known}
        for batch in _batches(file, known, range(file.metadata.num_row_groups)):
            for name in known:
                parts[name].append(_vectors(batch.column(name), 1, f"{path}: {name!r}")[:, 0])
        columns = {name: np.concatenate(found) for name, found in parts.items()}
        return columns, set(file.schema_arrow.names)


def rows_at(
    path: Path, rows: NDArray[np.int64], sizes: Mapping[str, int], stored: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Yield some rows of a file, in its order: vectors, and pictures as stored.

    Args:
        path: The file.
        rows: Positions of the rows, in ascending order.
        sizes: Number of values of each column of numbers.
        stored: Names of other columns.

    Raises:
        DemosError: If a column is missing, or has other values.
    """
    with _opened(path) as file:
        wanted = [*sizes, *stored]
        if missing := [key for key in wanted if key not in file.schema_arrow.names]:
            raise DemosError(f"{path} has no column {missing[0]!r}, which meta/info.json names.")
        counts = [file.metadata.row_group(n).num_rows for n in range(file.metadata.num_row_groups)]
        starts = np.cumsum([0, *counts])
        groups = sorted({int(n) for n in np.searchsorted(starts, rows, "right") - 1})
        places = np.array([r for n in groups for r in range(starts[n], starts[n + 1])], np.int64)
        done = 0
        for batch in _batches(file, wanted, groups):
            here = np.flatnonzero(np.isin(places[done : done + batch.num_rows], rows))
            done += batch.num_rows
            # Not of the pictures: a copy of them may not fit into memory.
            part = batch.select(list(sizes)).take(library("pyarrow", "lerobot").array(here))
            numbers = {
                key: _vectors(part.column(key), size, f"{path}: {key!r}")
                for key, size in sizes.items()
            }
            for number, row in enumerate(here.tolist()):
                vectors = {key: values[number] for key, values in numbers.items()}
                yield vectors | {key: batch.column(key)[row].as_py() for key in stored}
            if places[done - 1] >= rows[-1]:
                return
