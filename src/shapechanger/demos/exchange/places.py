"""Folders that are read and never changed, and folders that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from shapechanger.errors import DemosError, OutputError

__all__ = ["MAX_TEXT", "cannot_read", "inside", "new_folder", "read_text", "refuse_name"]

MAX_TEXT: Final = 1 << 30
"""Bytes of the largest text file that is read; a longer one is none."""


@contextmanager
def new_folder(out: Path, source: Path) -> Generator[Path]:
    """A folder to write to, which becomes `out` when the block ends, and is gone if it fails.

    Args:
        out: The folder to make; nothing is there yet.
        source: What is read meanwhile; `out` must not lie in it.

    Yields:
        A hidden folder beside `out`.

    Raises:
        DemosError: If `out` exists, or lies in `source`.
        OutputError: If it cannot be written.
    """
    if os.path.lexists(out):
        raise DemosError(f"{out} exists already: choose another name, or move it away.")
    if out.resolve().is_relative_to(source.resolve()):
        raise DemosError(f"{out} lies in {source}, which stays as it is: choose another place.")
    made = [parent for parent in out.absolute().parents if not parent.exists()]
    part = out.with_name(f".{out.name}.{secrets.token_hex(4)}.part")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part.mkdir()
    except OSError as error:
        raise OutputError(f"Cannot write {out}: {error.strerror or error}.") from error
    try:
        yield part
        try:
            part.rename(out)
        except OSError as error:
            raise OutputError(f"Cannot write {out}: {error.strerror or error}.") from error
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        if isinstance(error, DemosError | OutputError) and str(part) in str(error):
            # The user knows the folder by the name that it would have had.
            raise type(error)(str(error).replace(str(part), str(out))) from error
        raise


def refuse_name(name: str) -> str:
    """Why a file cannot have this name, in words; "" if it can.

    What a data set says about its files must not lead to another folder.
    """
    if not name:
        return "is empty"
    if name in {".", ".."} or any(character in name for character in "/\\\0"):
        return "leaves the folder"
    return ""


def inside(folder: Path, name: str, said_by: str) -> Path:
    """The file of this name in a folder.

    Args:
        folder: The folder.
        name: Its name, as a data set says it.
        said_by: Who says so, such as "labels.csv, line 3".

    Raises:
        DemosError: If there is none, or it lies somewhere else.
    """
    why = refuse_name(name)
    path = folder / name if not why else folder
    if not why and not path.resolve().is_relative_to(folder.resolve()):
        why = "is a link that leaves the folder"
    if why:
        raise DemosError(f"{said_by}: the name {name!r} {why}; files lie beside what names them.")
    if not path.is_file():
        raise DemosError(
            f"{said_by} names {name!r}, which is not in {folder}: put it back, or take out the "
            "lines that name it."
        )
    return path


def read_text(path: Path, most: int = MAX_TEXT) -> str:
    """The text of a file in UTF-8, with or without a byte order mark; line ends are left alone.

    Raises:
        DemosError: If it is no such file.
    """
    try:
        size = path.stat().st_size
        if size > most:
            raise DemosError(f"{path} has {size} bytes, and at most {most} are read.")
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DemosError(
            f"{path} is not text in UTF-8 (byte {error.start}): save it as UTF-8."
        ) from error
    except OSError as error:
        raise cannot_read(path, error) from error


def cannot_read(path: Path, error: OSError) -> DemosError:
    """What to say when a file cannot be read."""
    return DemosError(f"{path} cannot be read: {error.strerror or error}.")
