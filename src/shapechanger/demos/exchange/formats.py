"""The formats of others, and how they are told apart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal

from shapechanger.demos.episodes.files import is_episode
from shapechanger.demos.exchange import csv_files as csv_out
from shapechanger.demos.exchange import minari_format as minari_files
from shapechanger.demos.exchange.csv_files import tables_of
from shapechanger.demos.exchange.keys_2017 import LABELS
from shapechanger.demos.exchange.places import cannot_read
from shapechanger.demos.exchange.tub import MANIFEST, RECORD_NAME
from shapechanger.errors import DemosError, UnknownName

__all__ = ["FORMATS", "Format", "find_format", "require_format"]

Format = Literal["2017", "tub", "minari", "csv"]

FORMATS: Final[tuple[Format, ...]] = ("2017", "tub", "minari", "csv")

_WHAT: Final = (
    f"{LABELS} beside JPEGs (2017), {MANIFEST} or record_0.json (tub), data/"
    f"{minari_files.METADATA} (minari), or {csv_out.TABLE} (csv)"
)


def find_format(path: Path) -> Format:
    """Which format a folder has.

    Raises:
        DemosError: If there is no such folder, or it has none of the formats, or several; the
            sentence says what there is.
    """
    _require_folder(path)
    if _is_recording(path):
        raise DemosError(f"{path} is a recording already: use it as it is.")
    found = _formats_of(path)
    if len(found) > 1:
        raise DemosError(
            f"{path} looks like {' and '.join(found)}: say which with --format, such as --format "
            f"{found[0]}."
        )
    if found:
        return found[0]
    try:
        within = [(child, _formats_of(child)) for child in sorted(path.iterdir()) if child.is_dir()]
        anything = any(path.iterdir())
    except OSError as error:
        raise cannot_read(path, error) from error
    for child, formats in within:
        if formats:
            raise DemosError(
                f"{path} has none of the formats, but {child} in it is {formats[0]}: import that."
            )
    have = "has" if anything else "is empty; it has"
    raise DemosError(f"{path} {have} nothing that can be imported, which is {_WHAT}.")


def require_format(name: str, path: Path) -> Format:
    """The format of this name, or the one that a folder has for "auto".

    Raises:
        UnknownName: If there is no such format.
        DemosError: If the folder has not this format.
    """
    if name == "auto":
        return find_format(path)
    for known in FORMATS:
        if name == known:
            _require_folder(path)
            if known not in _formats_of(path):
                raise DemosError(f"{path} is not {known}: look for {_WHAT}, or leave --format out.")
            return known
    raise UnknownName("format", name, ("auto", *FORMATS))


def _require_folder(path: Path) -> None:
    if not path.exists():
        raise DemosError(f"There is no {path}.")
    if not path.is_dir():
        raise DemosError(f"{path} is a file: give the folder that it is in, {path.parent}.")


def _is_recording(path: Path) -> bool:
    try:
        return is_episode(path) or any(is_episode(child) for child in path.iterdir())
    except OSError as error:
        raise cannot_read(path, error) from error


def _formats_of(path: Path) -> list[Format]:
    found: dict[Format, Callable[[Path], bool]] = {
        "2017": lambda place: (place / LABELS).is_file(),
        "tub": _is_tub,
        "minari": lambda place: minari_files.data_folder(place) is not None,
        "csv": lambda place: bool(tables_of(place)),
    }
    return [name for name, fits in found.items() if fits(path)]


def _is_tub(path: Path) -> bool:
    try:
        return (path / MANIFEST).is_file() or any(
            RECORD_NAME.fullmatch(child.name) for child in path.iterdir()
        )
    except OSError as error:
        raise cannot_read(path, error) from error
