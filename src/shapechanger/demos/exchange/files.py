"""File access for imports and exports: sources are never changed, targets appear atomically.

Files of strangers are read here, within one budget: `MAX_TEXT_BYTES` of text, `MAX_PICTURE_BYTES`
and `MAX_PIXELS` of a picture, `MAX_UNPACKED` of anything compressed, regular files inside the
folder only.
"""

from __future__ import annotations

import codecs
import csv
import io
import json
import os
import re
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes.files import MAX_TEXT_BYTES, read_file
from shapechanger.errors import DemosError, MissingExtra, OutputError
from shapechanger.files import cannot_write

MAX_UNPACKED: Final = 64 << 20
"""Bytes in memory at once, and allowed for any file. A picture of `MAX_PIXELS` has 48 MiB."""

MAX_PACKED: Final = 64
"""Largest share of unpacked bytes to those of a file."""

MAX_VALUES: Final = 1 << 17
"""Largest number of values of a feature."""

MAX_FEATURES: Final = 512
"""Largest number of features that values become one by one; more become one array feature."""

UNIT_UNKNOWN: Final = "?"

_SEPARATORS: Final = (",", "\t", ";")
_SEPARATOR_LINE: Final = re.compile(r"sep=([,;\t])")  # As Excel writes it.


class UnpacksToTooMuch(DemosError):
    """A file claims far more than it holds: nothing of it is imported."""


def library(name: str, extra: str = "data") -> Any:
    """Import a module of a package that an extra installs.

    Raises:
        MissingExtra: If it is not installed.
    """
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
        A hidden folder beside `out` to write to.

    Raises:
        DemosError: If `out` exists, or lies in `source`.
        OutputError: If it cannot be written.
    """
    if os.path.lexists(out):
        raise DemosError(f"{out} exists already: choose another name, or move it away.")
    if source is not None and out.resolve().is_relative_to(source.resolve()):
        raise DemosError(f"{out} lies in {source}, which is never changed: choose another place.")
    made = [parent for parent in out.absolute().parents if not parent.exists()]
    part = out.with_name(f".{out.name}.{secrets.token_hex(4)}.part")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part.mkdir()
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

    Raises:
        DemosError: If there is no such file, or the name leads out of the folder.
    """
    path = folder / name
    if not name or not is_inside(folder, name):
        problem = "leaves the folder" if name else "is empty"
        raise DemosError(f"{named_by}: the name {name!r} {problem}.")
    if not path.is_file():
        raise DemosError(
            f"There is no {path}: {named_by} names {name!r}, which is not in {folder}. Restore it."
        )
    return path


def read_bytes(path: Path, most: int = MAX_TEXT_BYTES) -> bytes:
    """Return the content of a regular file.

    Raises:
        DemosError: If it cannot be read, or is too large.
    """
    try:
        return read_file(path, most)
    except OSError as error:
        raise cannot_read(path, error) from error


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file without a byte order mark; line ends are kept.

    Raises:
        DemosError: If the file cannot be read, is too large, or is not UTF-8.
    """
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
    """Read a CSV file, also as spreadsheets write it: with semicolons or tabs, and blank lines.

    Args:
        path: The file.
        columns: Least number of its columns.

    Returns:
        What separates the cells, and the number and the cells of each line that is not blank.

    Raises:
        DemosError: If the file cannot be read, or is not CSV.
    """
    text = read_text(path)
    first = next((line for line in text.splitlines() if line.strip()), "")
    stated = _SEPARATOR_LINE.fullmatch(first.strip())
    separator = stated[1] if stated else _SEPARATORS[0]
    if not stated:
        found = [mark for mark in _SEPARATORS if first.count(mark) >= max(1, columns - 1)]
        # Decimal commas stand between semicolons, so the last one that fits separates.
        separator = found[-1] if found else _SEPARATORS[0]
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
    """Parse JSON.

    Raises:
        DemosError: If it is not valid; `where` names it.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{where} is not valid JSON ({error}).") from error


def parse_json_object(text: str, where: str) -> dict[str, Any]:
    """Parse a JSON object.

    Raises:
        DemosError: If it is not valid, or not an object; `where` names it.
    """
    value = parse_json(text, where)
    if not isinstance(value, dict):
        raise DemosError(f"{where} is not a JSON object.")
    return cast("dict[str, Any]", value)


def own_headers(section: object, where: object) -> list[dict[str, Any]]:
    """Return the headers of the episodes of a data set that Shapechanger exported.

    Args:
        section: Shapechanger's part of the metadata.
        where: The file that it is in.

    Raises:
        DemosError: If another version wrote them.
    """
    fields = cast("dict[str, Any]", section) if isinstance(section, dict) else {}
    headers = fields.get("episodes")
    if fields.get("format") != 1 or not isinstance(headers, list):
        raise DemosError(
            f"{where} was written by another version of Shapechanger: this one reads format 1 only."
        )
    plain = cast("list[Any]", headers)
    if not all(isinstance(header, dict) for header in plain):
        raise DemosError(f"{where} has a header that is not a JSON object.")
    return plain


def cannot_read(path: Path, error: OSError) -> DemosError:
    """Return the error to raise when a file cannot be read."""
    return DemosError(f"{path} cannot be read: {error.strerror or error}.")
