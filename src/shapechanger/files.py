"""Atomic writes, text from users, and reads whose errors name the file."""

from __future__ import annotations

import codecs
import errno
import os
import re
import stat
import tomllib
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from shapechanger.errors import (
    CorruptStudy,
    OutputError,
    ShapechangerError,
    StudyError,
    UnknownName,
)

_T = TypeVar("_T")


def place_of(text: str, error: Exception) -> str:
    """Return the line of a TOML text that an error is about, such as `, line 3`; empty if unknown.

    The error is an unknown name, or its message contains a path of msgspec, such as `$.gamma`.
    """
    setting = re.search(r"\$\.(\w+)", str(error))
    name = error.name if isinstance(error, UnknownName) else setting and setting[1]
    word = re.compile(rf"(?<![\w-]){re.escape(name)}(?![\w-])") if name else None
    lines = enumerate(text.splitlines(), 1)
    found = next((at for at, line in lines if word and word.search(line.partition("#")[0])), None)
    return f", line {found}" if found else ""


def read_text(path: Path) -> str:
    """Read a text file of a user, in UTF-8 with or without a byte-order mark.

    Raises ValueError for other encodings; its message is the end of a sentence.
    """
    data = path.read_bytes()
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        is_utf_16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        found = "it is UTF-16" if is_utf_16 else f"byte {error.start} is not UTF-8"
        raise ValueError(f"{found}, so save it as UTF-8") from None


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a file of at most `most` bytes, which need not be trusted.

    Raises OSError for larger files, and for pipes and devices, which may never end.
    """
    # Opened without blocking, because opening a pipe without a writer would block.
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    with open(fd, "rb") as file:
        found = os.fstat(fd)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "it is not a regular file")
        if found.st_size > most:
            raise OSError(
                errno.EFBIG, f"it has {found.st_size} bytes, more than the limit of {most}"
            )
        return file.read(found.st_size)


def make_folder(folder: Path) -> None:
    """Make a folder and its parents; raise OutputError unless it is writable."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()


def require_file(path: Path) -> None:
    """Make the folder of a file; raise OutputError unless the file can be written."""
    if path.is_dir():
        raise OutputError(f"Cannot write {path}: it is a folder.")
    make_folder(path.parent)


def write_atomic(path: Path, content: bytes, mode: int | None = None) -> None:
    """Replace a file and flush it to disk; after an OutputError it is complete, old or new.

    `mode` sets the permissions of the new file; None keeps the old file's.
    """
    with writing(path):
        if mode is None and path.exists():
            mode = path.stat().st_mode & 0o7777
        _write(path, content, mode)


def write_new(path: Path, content: bytes, mode: int | None = None) -> None:
    """Write a new file completely or not at all; raise OSError if it exists.

    A missing folder is made. `mode` sets the file's permissions; None for the process's default.
    """
    if os.path.lexists(path):
        raise FileExistsError(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(path, content, mode)


def _write(path: Path, content: bytes, mode: int | None) -> None:
    # The name contains the process id, because two processes may write the same file.
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    part.unlink(missing_ok=True)
    try:
        # The file is created with its mode, so that other users can never read a private file.
        fd = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666 if mode is None else mode)
        with os.fdopen(fd, "wb") as file:
            if mode is not None:
                part.chmod(mode)  # Undoes the effect of the umask.
            file.write(content)
            file.flush()
            os.fsync(fd)
        part.replace(path)
        # Flush the folder too, so that the new name survives a power failure.
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON, atomically; raise OutputError if that fails."""
    write_atomic(path, msgspec.json.format(msgspec.json.encode(value), indent=1) + b"\n")


def append_line(path: Path, value: Any) -> None:
    """Append a line of JSON to a file; raise OutputError if that fails."""
    with writing(path), path.open("ab") as file:
        file.write(msgspec.json.encode(value) + b"\n")


def read_json(path: Path, kind: type[_T], remedy: str) -> _T:
    """Read a value from a file of `write_json`.

    Raises CorruptStudy, whose message ends with `remedy`, if the file cannot be read as `kind`.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind, dec_hook=from_builtins)
    except (OSError, msgspec.MsgspecError, ValueError) as error:
        raise CorruptStudy(f"{path} cannot be read ({error}): {remedy}.") from error


def from_builtins(kind: Any, value: Any) -> Any:
    """Convert a value with its class's method `from_builtins`; a `dec_hook` of msgspec."""
    return kind.from_builtins(value)


def converted(
    value: Any, kind: Any, error: type[ShapechangerError], failure: str, *, strict: bool = True
) -> Any:
    """Convert builtins to a type that msgspec supports; `failure` begins the error's message."""
    try:
        return msgspec.convert(value, kind, strict=strict)
    except msgspec.ValidationError as cause:
        raise error(f"{failure}: {str(cause).rstrip('.')}.") from cause


def decoded(text: str | bytes, kind: type[_T], error: type[ShapechangerError], failure: str) -> _T:
    """Decode JSON to a type that msgspec supports; `failure` begins the error's message."""
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError) as cause:
        raise error(f"{failure}: {str(cause).rstrip('.')}.") from cause


def read_toml(path: Path, kind: str, known: Iterable[str]) -> tuple[str, dict[str, Any]]:
    """Return the text of a user's TOML file, and its content.

    `kind` names the kind of file in errors, and `known` has the names that exist without a file.
    """
    try:
        text = read_text(path)
        return text, tomllib.loads(text)
    except FileNotFoundError:
        raise UnknownName(kind, str(path), known) from None
    except (OSError, ValueError) as error:  # TOMLDecodeError is a ValueError.
        raise StudyError(f"The {kind} {path} cannot be read: {error}.") from error


@contextmanager
def reading(path: Path, error: type[ShapechangerError]) -> Generator[None]:
    """Convert OSErrors of a block to errors of this class that name the file."""
    try:
        yield
    except OSError as cause:
        raise error(f"{path} cannot be read: {cause.strerror or cause}.") from cause


@contextmanager
def writing(path: Path) -> Generator[None]:
    """Convert OSErrors of a block to OutputErrors that name the file or folder `path`."""
    try:
        yield
    except OutputError:  # OutputError is a subclass of OSError.
        raise
    except OSError as error:
        raise cannot_write(path, error) from error


def cannot_write(path: Path, error: OSError) -> OutputError:
    """Return the error to raise when a file cannot be written."""
    return OutputError(f"Cannot write {path}: {error.strerror or error}.")
