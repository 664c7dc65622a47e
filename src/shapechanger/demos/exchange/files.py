"""Files of datasets: sources stay unchanged, targets appear whole, and one budget limits all reads.

The budget is `MAX_TEXT_BYTES` of text, `MAX_PICTURE_BYTES` and `MAX_PIXELS` of an image,
`MAX_UNPACKED` of anything compressed, and regular files inside the folder only. All functions raise
`DemosError` for what they refuse, and `MissingExtra` for a package that is not installed.
"""

from __future__ import annotations

import codecs
import csv
import io
import json
import math
import os
import re
import secrets
import shutil
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes.files import MAX_TEXT_BYTES, read_file
from shapechanger.errors import DemosError, MissingExtra, OutputError
from shapechanger.files import cannot_write

MAX_UNPACKED: Final = 64 << 20
"""Bytes in memory at once, and allowed for any file. An image of `MAX_PIXELS` has 48 MiB."""

MAX_PACKED: Final = 64
"""Largest share of unpacked bytes to those of a file."""

MAX_VALUES: Final = 1 << 17
"""Largest number of values of a feature."""

MAX_FEATURES: Final = 512
"""Largest number of features that values become one by one; more become one array feature."""

UNIT_UNKNOWN: Final = "?"

_SEPARATORS: Final = (",", "\t", ";")
_SEPARATOR_LINE: Final = re.compile(r"sep=([,;\t])")  # As Excel writes it.
_ROWS: Final = 256  # Of Parquet in memory at once; fewer if the values of a column are large.
_MAX_TEXT: Final = 4096  # Characters of a text in Parquet.


class UnpacksToTooMuch(DemosError):
    """A file claims far more than it holds: nothing of it is imported."""


def library(name: str, extra: str = "data") -> Any:
    """Import a module of a package that an extra installs."""
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtra(name.split(".")[0], extra) from error


@contextmanager
def new_folder(out: Path, source: Path | None = None) -> Generator[Path]:
    """Create a folder that is renamed to `out` on success and removed on failure.

    Args:
        out: The folder to create; it must not exist.
        source: The folder that is read meanwhile, if any; `out` must not lie in it.

    Yields:
        A hidden folder next to `out` to write to.
    """
    if os.path.lexists(out):
        raise DemosError(f"{out} exists already: choose another name, or move it away.")
    if source is not None and out.resolve().is_relative_to(source.resolve()):
        raise DemosError(f"{out} lies in {source}, which is never changed: choose another place.")
    made = [parent for parent in out.absolute().parents if not parent.exists()]
    part = out.with_name(f".{out.name}.{secrets.token_hex(4)}.part")
    try:
        part.mkdir(parents=True)
    except OSError as error:
        raise cannot_write(out, error) from error
    try:
        yield part
        try:
            part.rename(out)
        except OSError as error:
            raise cannot_write(out, error) from error
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        if isinstance(error, DemosError | OutputError) and str(part) in str(error):
            # Name the folder that the user asked for.
            raise type(error)(str(error).replace(str(part), str(out))) from error
        raise


def is_inside(folder: Path, name: str) -> bool:
    """Return whether a name, with all links, leads to a place below a folder."""
    try:
        return (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):  # A NUL, or too long.
        return False


def inside(folder: Path, name: str, named_by: object) -> Path:
    """Return the path of a regular file below a folder that a data set names.

    Args:
        folder: The folder.
        name: Its name according to the data set.
        named_by: Where the name stands, such as "steps.csv, line 3".
    """
    if not name or not is_inside(folder, name):
        problem = "leaves the folder" if name else "is empty"
        raise DemosError(f"{named_by}: the name {name!r} {problem}.")
    if not (folder / name).is_file():
        raise DemosError(
            f"There is no {folder / name}: {named_by} names {name!r}, which is not in {folder}. "
            "Restore it."
        )
    return folder / name


def read_bytes(path: Path, most: int = MAX_TEXT_BYTES) -> bytes:
    """Return the content of a regular file."""
    try:
        return read_file(path, most)
    except OSError as error:
        raise cannot_read(path, error) from error


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file without a byte order mark; line ends are kept."""
    data = read_bytes(path)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise DemosError(f"{path} is not text in UTF-8 but in UTF-16: save it as UTF-8.")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DemosError(
            f"{path} is not text in UTF-8 (byte {error.start}): save it as UTF-8."
        ) from error


def read_table(path: Path, columns: int = 1) -> tuple[str, list[tuple[int, list[str]]]]:
    """Read a CSV file, also as spreadsheets write it: with semicolons or tabs, and blank lines."""
    text = read_text(path)
    first = next((line for line in text.splitlines() if line.strip()), "")
    stated = _SEPARATOR_LINE.fullmatch(first.strip())
    found = [mark for mark in _SEPARATORS if first.count(mark) >= max(1, columns - 1)]
    # Decimal commas stand between semicolons, so the last one that fits separates.
    separator = stated[1] if stated else found[-1] if found else _SEPARATORS[0]
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=separator)
    lines: list[tuple[int, list[str]]] = []
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells) and (lines or not stated or reader.line_num > 1):
                lines.append((reader.line_num, cells))
    except csv.Error as error:
        raise DemosError(f"{path}, line {reader.line_num}, is not valid CSV: {error}.") from error
    return separator, lines


def parse_json(text: str, where: str) -> Any:
    """Parse JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{where} is not valid JSON ({error}).") from error


def read_json_object(path: Path) -> dict[str, Any]:
    """Read a file that holds a JSON object."""
    value = parse_json(read_text(path), str(path))
    if not isinstance(value, dict):
        raise DemosError(f"{path} is not a JSON object.")
    return cast("dict[str, Any]", value)


def own_headers(section: object, where: object, count: int) -> list[dict[str, Any]]:
    """Return the headers of the `count` episodes of a data set that Shapechanger exported."""
    fields = cast("dict[str, Any]", section) if isinstance(section, dict) else {}
    headers = fields.get("episodes")
    if fields.get("format") != 1 or not isinstance(headers, list):
        raise DemosError(
            f"{where} was written by another version of Shapechanger: this one reads format 1 only."
        )
    found = cast("list[Any]", headers)
    if not all(isinstance(header, dict) for header in found):
        raise DemosError(f"{where} has a header that is not a JSON object.")
    if len(found) != count:
        raise DemosError(
            f"{where} describes {len(found)} episodes, and the dataset has {count}: remove it if "
            "the dataset was edited."
        )
    return found


def cannot_read(path: Path, error: OSError) -> DemosError:
    """Return the error to raise when a file cannot be read."""
    return DemosError(f"{path} cannot be read: {error.strerror or error}.")


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


@contextmanager
def _open_parquet(path: Path) -> Generator[Any]:
    """Open a Parquet file as a `pyarrow.parquet.ParquetFile`."""
    arrow = library("pyarrow", "lerobot")
    try:
        # Without `buffer_size` a whole row group is in memory, which may be an episode of images.
        opened = library("pyarrow.parquet", "lerobot").ParquetFile
        with opened(path, pre_buffer=False, buffer_size=1 << 20) as file:
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


def _batches(file: Any, columns: Sequence[str], groups: Sequence[int]) -> Any:
    """Return the rows of some row groups, a few at a time."""
    # Many rows may share one large value, which is in memory once for each.
    largest = max(_sizes_of(file, groups), default=1)
    rows = max(1, min(_ROWS, MAX_UNPACKED // max(1, largest)))
    return file.iter_batches(rows, row_groups=groups, columns=columns)


def all_rows(path: Path, columns: set[str] | None) -> list[dict[str, Any]]:
    """Return the rows of a small Parquet table."""
    found: list[dict[str, Any]] = []
    with _open_parquet(path) as file:
        known = set(file.schema_arrow.names)
        groups = range(file.metadata.num_row_groups)
        for batch in _batches(file, sorted(columns & known if columns else known), groups):
            for row in cast("list[dict[str, Any]]", batch.to_pylist()):
                for value in row.values():  # A text, or a list of texts.
                    texts = cast("list[Any]", value) if isinstance(value, list) else [value]
                    if any(isinstance(text, str) and len(text) > _MAX_TEXT for text in texts):
                        raise DemosError(f"{path} has a text of more than {_MAX_TEXT} characters.")
                found.append(row)
    return found


def _vectors(column: Any, size: int, what: str) -> NDArray[np.float64]:
    """Return the numbers of a column, shape (n, size)."""
    types = library("pyarrow.types", "lerobot")
    rows = len(column)
    values: Any = getattr(column, "storage", column)  # Of arrays in an extension type.
    even = not types.is_list(values.type) or len(np.unique(values.value_lengths())) <= 1
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
    """Return Parquet columns of single numbers, shape (n,) each, and the names of all columns.

    Columns that the file lacks are left out.
    """
    with _open_parquet(path) as file:
        columns = set(file.schema_arrow.names)
        table = file.read(columns=[name for name in names if name in columns])
        found = {
            name: _vectors(table.column(name).combine_chunks(), 1, f"{path}: {name!r}")[:, 0]
            for name in table.column_names
        }
        return found, columns


def rows_at(
    path: Path, rows: NDArray[np.int64], sizes: Mapping[str, int], stored: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Yield some rows of a Parquet file, in its order: vectors, and images as stored."""
    with _open_parquet(path) as file:
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
            # Not of the images: a copy of them may not fit into memory.
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
