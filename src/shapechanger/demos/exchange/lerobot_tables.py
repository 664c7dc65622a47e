"""Tables of LeRobot datasets: Parquet files of strangers, which may claim more than they hold."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import library
from shapechanger.errors import DemosError

MAX_UNPACKED: Final = 64 << 20
"""Bytes at once, and at least allowed for a file; see `MAX_PACKED`."""

MAX_PACKED: Final = 64
"""Largest share of unpacked bytes to those of a file: a few bytes of Parquet can claim any number
of values."""

_ROWS: Final = 256  # In memory at once; fewer if the values of a column are large.
_MAX_TEXT: Final = 4096  # Characters of a task.
_PLACE: Final = re.compile(r"\{(video_key|chunk_index|file_index)(?::0?(\d)d)?\}")


class UnpacksToTooMuch(DemosError):
    """A file claims far more than it holds: nothing of it is imported."""


def inside(folder: Path, name: str, named_by: Path) -> Path:
    """Return a file below a folder that a dataset names."""
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise DemosError(f"{named_by}: the name {name!r} leaves the folder.")
    if not path.is_file():
        raise DemosError(f"There is no {path}, which {named_by} names: restore it.")
    return path


def fill_place(template: object, info_path: Path, values: dict[str, Any]) -> str:
    """Fill in a path such as `data/chunk-{chunk_index:03d}/...`, without Python's own formats."""
    if not isinstance(template, str):
        raise DemosError(f"{info_path} does not say where the files are (data_path, video_path).")

    def filled(match: re.Match[str]) -> str:
        value = values.get(match[1], "")
        return str(value).rjust(int(match[2]), "0") if match[2] else str(value)

    return _PLACE.sub(filled, template)


@contextmanager
def open_parquet(path: Path) -> Generator[Any]:
    """Open a Parquet file as a `pyarrow.parquet.ParquetFile`."""
    arrow = library("pyarrow", "lerobot")
    parquet = library("pyarrow.parquet", "lerobot")
    try:
        # Without `buffer_size` a whole row group is in memory, which may be an episode of pictures.
        with parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            size = path.stat().st_size
            columns = list(_columns_of(file, range(file.metadata.num_row_groups)))
            claimed = sum(max(c.total_uncompressed_size, 8 * c.num_values) for c in columns)
            if claimed > MAX_UNPACKED + MAX_PACKED * size or file.metadata.num_rows > size:
                raise UnpacksToTooMuch(
                    f"{path} has {size} bytes, but claims to unpack to {claimed}."
                )
            yield file
    except (arrow.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise DemosError(f"{path} is not an intact Parquet file: {reason}.") from error


def _columns_of(file: Any, groups: Iterable[int]) -> Iterator[Any]:
    """Yield the metadata of each column of some row groups."""
    for number in groups:
        group = file.metadata.row_group(number)
        yield from (group.column(n) for n in range(group.num_columns))


def _batches(file: Any, columns: Sequence[str], groups: Sequence[int]) -> Iterator[Any]:
    """Yield the rows of some row groups, a few at a time."""
    # Many rows may share one large value, which is in memory once for each.
    sizes = (max(c.total_uncompressed_size, 8 * c.num_values) for c in _columns_of(file, groups))
    largest = max(sizes, default=1)
    rows = max(1, min(_ROWS, MAX_UNPACKED // max(1, largest)))
    return file.iter_batches(rows, row_groups=groups, columns=columns)


def table_rows(path: Path, columns: set[str] | None) -> list[dict[str, Any]]:
    """Return the rows of a table of `meta/`."""
    found: list[dict[str, Any]] = []
    with open_parquet(path) as file:
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


def vectors(column: Any, size: int, what: str) -> NDArray[np.float64]:
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
    found: dict[str, list[NDArray[np.float64]]] = {}
    with open_parquet(path) as file:
        known = [name for name in names if name in file.schema_arrow.names]
        for batch in _batches(file, known, range(file.metadata.num_row_groups)):
            for name in known:
                part = vectors(batch.column(name), 1, f"{path}: {name!r}")[:, 0]
                found.setdefault(name, []).append(part)
        columns = {name: np.concatenate(found.get(name, [np.empty(0)])) for name in known}
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
    with open_parquet(path) as file:
        wanted = [*sizes, *stored]
        if missing := [key for key in wanted if key not in file.schema_arrow.names]:
            raise DemosError(f"{path} has no column {missing[0]!r}, which meta/info.json names.")
        counts = [file.metadata.row_group(n).num_rows for n in range(file.metadata.num_row_groups)]
        starts = np.cumsum([0, *counts])
        groups = sorted({int(n) for n in np.searchsorted(starts, rows, "right") - 1})
        places = np.array(
            [row for n in groups for row in range(starts[n], starts[n + 1])], np.int64
        )
        done = 0
        for batch in _batches(file, wanted, groups):
            here = np.flatnonzero(np.isin(places[done : done + batch.num_rows], rows))
            done += batch.num_rows
            # Not of the pictures: a copy of them may not fit into memory.
            part = batch.select(list(sizes)).take(library("pyarrow", "lerobot").array(here))
            numbers = {
                key: vectors(part.column(key), size, f"{path}: {key!r}")
                for key, size in sizes.items()
            }
            for number, row in enumerate(here.tolist()):
                yield {key: values[number] for key, values in numbers.items()} | {
                    key: batch.column(key)[row].as_py() for key in stored
                }
            if places[done - 1] >= rows[-1]:
                return
