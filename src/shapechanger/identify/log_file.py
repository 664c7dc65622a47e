"""A log as one file: an `.npz` whose member `header` is JSON."""

from __future__ import annotations

import os
import zipfile
import zlib
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.lib.npyio import NpzFile

from shapechanger.errors import FingerError, OutputError
from shapechanger.identify.log import SIGNALS, FingerLog

__all__ = ["load_log", "save_log"]

_FORMAT: Final = "shapechanger finger log"
_VERSION: Final = 1


class _Header(msgspec.Struct, frozen=True, kw_only=True):
    """What the arrays do not say."""

    format: str
    version: int
    actions: str
    control_dt: float
    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    source: str = ""


def save_log(log: FingerLog, path: str | os.PathLike[str]) -> None:
    """Write a log; a file that is there already is replaced.

    Raises:
        OutputError: If the file cannot be written.
    """
    header = _Header(
        format=_FORMAT,
        version=_VERSION,
        actions=log.actions,
        control_dt=log.control_dt,
        joints=log.joints,
        tendons=log.tendons,
        source=log.source,
    )
    arrays = {name: getattr(log, name) for name in SIGNALS}
    said = np.frombuffer(msgspec.json.encode(header), np.uint8)
    try:
        with Path(path).open("wb") as file:  # Given a name, NumPy would add an ending to it.
            np.savez_compressed(file, header=said, **arrays)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from error


def load_log(path: str | os.PathLike[str]) -> FingerLog:
    """Read what `save_log` wrote.

    Raises:
        FingerError: If it is no log, is cut short, is of a later version, or says what no finger
            does; see `FingerLog`.
        UnknownName: If its mode of action is none.
    """
    name = Path(path).name
    try:
        with Path(path).open("rb") as raw:  # Of a damaged file NumPy forgets to close it.
            loaded: Any = np.load(raw, allow_pickle=False)
            if not isinstance(loaded, NpzFile):
                raise ValueError("an array, not a file of arrays")
            read: dict[str, Any] = {key: loaded[key] for key in loaded.files}
    except FileNotFoundError as error:
        raise FingerError(f"There is no file {path}.") from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FingerError(_not_whole(Path(path), name)) from error
    header = _header(name, read)
    missing = [key for key in SIGNALS if key not in read]
    if missing:
        raise FingerError(f"{name} is no whole log: it lacks {', '.join(missing)}.")
    try:
        arrays = {key: np.asarray(read[key], np.float64) for key in SIGNALS}
    except ValueError as error:
        raise FingerError(f"{name} is no log of a finger: its arrays hold no numbers.") from error
    if arrays["t"].ndim != 1:
        raise FingerError(f"{name} is no log of a finger: t is no list of times.")
    return FingerLog(
        **arrays,
        actions=header.actions,
        control_dt=header.control_dt,
        joints=header.joints,
        tendons=header.tendons,
        source=header.source,
    )


def _not_whole(path: Path, name: str) -> str:
    """Why a file cannot be read."""
    try:
        with path.open("rb") as file:
            begins_as_one = file.read(2) == b"PK"
    except OSError as error:
        return f"{name} cannot be read: {error.strerror}."
    if begins_as_one:
        return f"{name} is cut short or damaged: record it again."
    return f"{name} is no log of a finger; `shapechanger finger record` writes one."


def _header(name: str, read: dict[str, Any]) -> _Header:
    if "header" not in read:
        raise FingerError(f"{name} is no log of a finger: it has no header.")
    try:
        header = msgspec.json.decode(bytes(read["header"]), type=_Header)
    except (msgspec.MsgspecError, TypeError, ValueError) as error:
        raise FingerError(f"{name} is no log of a finger: its header says {error}.") from error
    if header.format != _FORMAT:
        raise FingerError(f"{name} is no log of a finger, but {header.format!r}.")
    if header.version > _VERSION:
        raise FingerError(
            f"{name} is of version {header.version}, and this Shapechanger reads up to {_VERSION}."
        )
    return header
