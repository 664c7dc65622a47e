"""File access for imports and exports: sources are never changed, targets appear atomically."""

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

from shapechanger.demos.episodes.files import (
    MAX_PICTURE_BYTES,
    MAX_TEXT_BYTES,
    read_file,
)
from shapechanger.demos.jpeg import decode_picture, picture_size
from shapechanger.errors import DemosError, MissingExtra, OutputError
from shapechanger.files import cannot_write

_SEPARATORS: Final = (",", "\t", ";")
_SEPARATOR_LINE: Final = re.compile(r"sep=([,;\t])")  # As Excel writes it.


def library(name: str, extra: str = "data") -> Any:
    """Import a module of a package that an extra installs.

    Args:
        name: Dotted name of the module.
        extra: Name of the extra.

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


def name_problem(name: str) -> str:
    """Return why a data set must not name a file like this, as part of a sentence; "" if it may."""
    if not name:
        return "is empty"
    if name in {".", ".."} or any(character in name for character in "/\\\0"):
        return "leaves the folder"
    return ""


def resolve_file(folder: Path, name: str, named_by: str) -> Path:
    """Return the path of a file that a data set names.

    Args:
        folder: The folder in which the file must lie.
        name: Its name according to the data set.
        named_by: Where the name stands, such as "labels.csv, line 3".

    Raises:
        DemosError: If there is no such file, or the name leads out of the folder.
    """
    path = folder / name
    problem = name_problem(name)
    if not problem and not path.resolve().is_relative_to(folder.resolve()):
        problem = "is a link that leaves the folder"
    if problem:
        raise DemosError(f"{named_by}: the name {name!r} {problem}.")
    if not path.is_file():
        raise DemosError(
            f"{named_by} names {name!r}, which is not in {folder}: restore it, or remove the lines "
            "that name it."
        )
    return path


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file without a byte order mark; line ends are kept.

    Raises:
        DemosError: If the file cannot be read, is too large, or is not UTF-8.
    """
    try:
        data = read_file(path, MAX_TEXT_BYTES)
        if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise DemosError(f"{path} is not text in UTF-8 but in UTF-16: save it as UTF-8.")
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DemosError(
            f"{path} is not text in UTF-8 (byte {error.start}): save it as UTF-8."
        ) from error
    except OSError as error:
        raise cannot_read(path, error) from error


def read_table(path: Path, columns: int) -> tuple[str, list[tuple[int, list[str]]]]:
    """Read a CSV file, also as spreadsheets write it: with semicolons or tabs, and blank lines.

    Args:
        path: The file.
        columns: Number of its columns.

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
        found = [mark for mark in _SEPARATORS if first.count(mark) >= columns - 1]
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

    Args:
        text: The JSON.
        where: How to name it in errors.

    Raises:
        DemosError: If it is not valid.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{where} is not valid JSON ({error}).") from error


def parse_json_object(text: str, where: str) -> dict[str, Any]:
    """Parse a JSON object.

    Args:
        text: The JSON.
        where: How to name it in errors.

    Raises:
        DemosError: If it is not valid, or not an object.
    """
    value = parse_json(text, where)
    if not isinstance(value, dict):
        raise DemosError(f"{where} is not a JSON object.")
    return cast("dict[str, Any]", value)


def cannot_read(path: Path, error: OSError) -> DemosError:
    """Return the error to raise when a file cannot be read.

    Args:
        path: The file.
        error: What the system said.
    """
    return DemosError(f"{path} cannot be read: {error.strerror or error}.")


class Pictures:
    """Reader of JPEGs that must be intact and of one size.

    Args:
        size: Width and height in pixels; None to take those of the first picture.

    Attributes:
        size: Width and height in pixels; None before the first picture.
    """

    def __init__(self, size: tuple[int, int] | None = None) -> None:
        self.size = size
        self._first = ""

    def read(self, path: Path) -> bytes:
        """Return the bytes of a picture.

        Raises:
            DemosError: If it cannot be read or decoded, is too large, or has another size.
        """
        try:
            jpeg = read_file(path, MAX_PICTURE_BYTES)
        except OSError as error:
            raise cannot_read(path, error) from error
        self.check(jpeg, str(path))
        return jpeg

    def check(self, jpeg: bytes, name: str) -> None:
        """Refuse a picture that is damaged or of another size.

        Args:
            jpeg: Its bytes.
            name: How to name the picture in errors.

        Raises:
            DemosError: If it is damaged or of another size.
        """
        size = picture_size(jpeg, name)
        if self.size is None:
            self.size, self._first = size, name
        if size != self.size:
            wanted = f"like {self._first}" if self._first else "like the others"
            raise DemosError(
                f"The picture {name} has {size[0]} x {size[1]} pixels, and not "
                f"{self.size[0]} x {self.size[1]} {wanted}: a data set has one size."
            )
        decode_picture(jpeg, name)
