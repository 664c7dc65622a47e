"""Read and write files of datasets: sources stay unchanged, targets are complete or absent.

Reads are limited to `MAX_TEXT_BYTES` of text, `MAX_PICTURE_BYTES` and `MAX_PIXELS` of an image,
`MAX_UNPACKED` of compressed data, and regular files inside the folder. All functions raise
`DemosError` for invalid input, and `MissingExtra` for a package that is not installed.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Literal

import msgspec

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.episodes.records import MAX_TEXT_BYTES
from shapechanger.demos.exchange.format import ExchangeEpisode
from shapechanger.errors import (
    DemosError,
    LayoutError,
    MissingExtra,
    OutputError,
    translate_errors,
)
from shapechanger.files import read_file, writing

MAX_UNPACKED: Final = 64 << 20
"""Bytes in memory at once, and allowed for any file. An image of `MAX_PIXELS` has 48 MiB."""

MAX_VALUES: Final = 1 << 17
"""Largest number of values of a feature."""

_SEPARATOR_LINE: Final = re.compile(r"sep=([,;\t])")  # First line that Excel may write.


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
        with writing(out):
            part.mkdir(parents=True)
        yield part
        with writing(out):
            part.rename(out)
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        with suppress(OSError):  # A folder that is not empty stays.
            for parent in made:
                parent.rmdir()
        if isinstance(error, DemosError | OutputError) and str(part) in str(error):
            # Name the folder that the user asked for.
            raise type(error)(str(error).replace(str(part), str(out))) from error
        raise


def is_inside(folder: Path, name: str) -> bool:
    """Return whether a name, after resolving links, is a path inside a folder."""
    try:
        return (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):  # The name has a NUL, or is too long.
        return False


def inside(folder: Path, name: str, named_by: object) -> Path:
    """Return the path of a regular file inside a folder.

    Args:
        folder: The folder.
        name: Name of the file according to the dataset.
        named_by: Where the dataset has the name, such as "steps.csv, line 3".
    """
    if not name or not is_inside(folder, name):
        raise DemosError(f"{named_by}: the name {name!r} leaves the folder.")
    if not (folder / name).is_file():
        raise DemosError(f"There is no {folder / name}, which {named_by} names: restore it.")
    return folder / name


def read_bytes(path: Path) -> bytes:
    """Return the content of a regular file."""
    with translate_errors(OSError, to=lambda error: cannot_read(path, error)):
        return read_file(path, MAX_TEXT_BYTES)


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file without a byte order mark; line ends are kept."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DemosError(
            f"{path} is not text in UTF-8 (byte {error.start}): save it as UTF-8."
        ) from error


def read_table(path: Path, columns: int = 1) -> tuple[str, list[tuple[int, list[str]]]]:
    """Read a CSV file, also from spreadsheets with semicolons or tabs, and with blank lines."""
    text = read_text(path)
    first = next((line for line in text.splitlines() if line.strip()), "")
    stated = _SEPARATOR_LINE.fullmatch(first.strip())
    found = [mark for mark in ",\t;" if first.count(mark) >= max(1, columns - 1)]
    # A file with decimal commas is separated by semicolons, so the last mark that fits is used.
    separator = stated[1] if stated else found[-1] if found else ","
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=separator)
    try:
        lines = [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except csv.Error as error:
        raise DemosError(f"{path}, line {reader.line_num}, is not valid CSV: {error}.") from error
    return separator, lines[1:] if stated else lines


class _OwnEpisodes(msgspec.Struct):
    """Our own part of a dataset: the header of each episode, with its outcome."""

    format: Literal[1]
    episodes: list[dict[str, Any]]


def converted(plain: Any, kind: Any, where: object, *, strict: bool = True) -> Any:
    """Return what a file holds as a type that msgspec knows."""
    try:
        return msgspec.convert(plain, kind, strict=strict)
    except msgspec.ValidationError as error:
        raise DemosError(f"{where} is damaged: {error}.") from error


def parse_json(text: str | bytes, where: object, kind: Any) -> Any:
    """Parse JSON of a type that msgspec knows."""
    try:
        plain = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{where} is damaged: not valid JSON ({error}).") from error
    return converted(plain, kind, where)


def read_json(path: Path, kind: Any = dict[str, Any]) -> Any:
    """Read a file of JSON."""
    return parse_json(read_text(path), path, kind)


def own_fields(episode: ExchangeEpisode) -> dict[str, Any]:
    """Return the fields of an exported episode that `own_header` reads."""
    return episode.header.to_json() | {"outcome": episode.outcome}


def own_header(fields: dict[str, Any], where: object) -> tuple[EpisodeHeader, str]:
    """Return the header and the outcome of an episode that Shapechanger exported."""
    with translate_errors(DemosError, LayoutError, to=lambda e: DemosError(f"{where}: {e}")):
        return EpisodeHeader.from_json(fields), str(fields.get("outcome", ""))


def own_episodes(section: Any, where: object, count: int) -> list[dict[str, Any]]:
    """Return the `own_fields` of the `count` episodes of a dataset that Shapechanger exported."""
    own: _OwnEpisodes = converted(section, _OwnEpisodes, where)
    if len(own.episodes) != count:
        raise DemosError(
            f"{where} describes {len(own.episodes)} episodes, and the dataset has {count}: remove "
            "it if the dataset was edited."
        )
    return own.episodes


def cannot_read(path: Path, error: OSError) -> DemosError:
    """Return the error to raise when a file cannot be read."""
    return DemosError(f"{path} cannot be read: {error.strerror or error}.")
