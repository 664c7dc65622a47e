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

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.episodes.files import MAX_TEXT_BYTES, read_file
from shapechanger.demos.exchange.format import ExchangeEpisode
from shapechanger.errors import (
    DemosError,
    LayoutError,
    MissingExtra,
    OutputError,
    translate_errors,
)
from shapechanger.files import cannot_write
from shapechanger.layout import Layout

MAX_UNPACKED: Final = 64 << 20
"""Bytes in memory at once, and allowed for any file. An image of `MAX_PIXELS` has 48 MiB."""

MAX_PACKED: Final = 64
"""Largest share of unpacked bytes to those of a file."""

MAX_VALUES: Final = 1 << 17
"""Largest number of values of a feature."""

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
    with translate_errors(OSError, to=lambda error: cannot_write(out, error)):
        part.mkdir(parents=True)
    try:
        yield part
        with translate_errors(OSError, to=lambda error: cannot_write(out, error)):
            part.rename(out)
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


def read_bytes(path: Path) -> bytes:
    """Return the content of a regular file."""
    with translate_errors(OSError, to=lambda error: cannot_read(path, error)):
        return read_file(path, MAX_TEXT_BYTES)


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file without a byte order mark; line ends are kept."""
    data = read_bytes(path)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise DemosError(f"{path} is not text in UTF-8 but in UTF-16: save it as UTF-8.")
    why = "{} is not text in UTF-8 (byte {}): save it as UTF-8."
    with translate_errors(UnicodeDecodeError, to=lambda e: DemosError(why.format(path, e.start))):
        return data.decode("utf-8-sig")


def read_table(path: Path, columns: int = 1) -> tuple[str, list[tuple[int, list[str]]]]:
    """Read a CSV file, also as spreadsheets write it: with semicolons or tabs, and blank lines."""
    text = read_text(path)
    first = next((line for line in text.splitlines() if line.strip()), "")
    stated = _SEPARATOR_LINE.fullmatch(first.strip())
    found = [mark for mark in ",\t;" if first.count(mark) >= max(1, columns - 1)]
    # Decimal commas stand between semicolons, so the last one that fits separates.
    separator = stated[1] if stated else found[-1] if found else ","
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


def own_fields(episode: ExchangeEpisode) -> dict[str, Any]:
    """Return what `own_header` reads of an episode that is exported."""
    return episode.header.to_json() | {"outcome": episode.outcome}


def own_header(fields: object, where: object) -> tuple[EpisodeHeader, str]:
    """Return the header and the outcome of an episode that Shapechanger exported."""
    if not isinstance(fields, dict):
        raise DemosError(f"{where} has a header that is not a JSON object.")
    plain = cast("dict[str, Any]", fields)
    with translate_errors(
        DemosError, LayoutError, to=lambda error: DemosError(f"{where}: {error}")
    ):
        header = EpisodeHeader.from_json(plain)
        for layout in filter(None, (header.action_layout, header.state_layout)):
            Layout.from_json(layout)
    return header, str(plain.get("outcome", ""))


def own_episodes(section: object, where: object, count: int) -> list[Any]:
    """Return the `own_fields` of the `count` episodes of a dataset that Shapechanger exported."""
    fields = cast("dict[str, Any]", section) if isinstance(section, dict) else {}
    episodes = fields.get("episodes")
    if fields.get("format") != 1 or not isinstance(episodes, list):
        raise DemosError(
            f"{where} was written by another version of Shapechanger: this one reads format 1 only."
        )
    found = cast("list[Any]", episodes)
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
    with translate_errors(
        OSError, to=lambda error: DemosError(f"{path} is not an intact HDF5 file: {error}.")
    ):
        file = library("h5py").File(path, "r")
    try:
        yield file
    except (OSError, RuntimeError) as error:  # Raised by h5py for inconsistent bytes.
        raise DemosError(f"{path} is damaged: {error}.") from error
    finally:
        file.close()


def chunk_of(columns: Iterable[Any], most: int) -> int:
    """Return how many entries of columns to read at once: at most as many as fit, at least one."""
    return max(1, min(most, MAX_UNPACKED // max(1, sum(map(_row_bytes, columns)))))


def _row_bytes(column: Any) -> int:
    return math.prod(column.shape[1:]) * column.dtype.itemsize


def column(file: Any, name: str) -> Any:
    """Return an array in an open `h5py.File` by its path there; no link is followed."""
    h5py = library("h5py")
    where, found, link = file.filename, file, None
    for part in name.split("/"):
        link = found.get(part, getlink=True) if isinstance(found, h5py.Group) else None
        if isinstance(link, h5py.SoftLink):  # It may lead through a link to another file.
            raise DemosError(f"{where} has a link for {name!r}, and links are not followed.")
        if isinstance(link, h5py.ExternalLink):
            break
        if link is None or (found := found.get(part)) is None:
            raise DemosError(f"{where} has no {name!r}, so the dataset is incomplete.")
    is_array = isinstance(found, h5py.Dataset)
    if isinstance(link, h5py.ExternalLink) or (is_array and (found.external or found.is_virtual)):
        raise DemosError(f"{where} has {name!r} in another file, which is not opened.")
    if not is_array or not found.shape:
        raise DemosError(f"{where}: {name!r} is not an array.")
    # HDF5 unpacks whole chunks, and a step may claim any shape.
    unpacked = max(_row_bytes(found), math.prod(found.chunks or ()) * found.dtype.itemsize)
    if unpacked > MAX_UNPACKED:
        raise DemosError(
            f"{where}: {name!r} unpacks to {unpacked} bytes at once, more than the limit of "
            f"{MAX_UNPACKED}."
        )
    return found


def names_in(file: Any, *groups: str) -> list[str]:
    """Return the names in a group of groups; no link is followed."""
    h5py = library("h5py")
    found: Any = file
    for part in groups:
        is_there = isinstance(found.get(part, getlink=True), h5py.HardLink)
        if not is_there or not isinstance(found := found[part], h5py.Group):
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
        first, last = (int(n) for n in np.searchsorted(starts, rows[[0, -1]], "right") - 1)
        done = int(starts[first])
        for batch in _batches(file, wanted, range(first, last + 1)):
            here = rows[(rows >= done) & (rows < done + batch.num_rows)] - done
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
            if done > rows[-1]:
                return
