"""Reads the files of a tub, of both versions: see `tub`."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.exchange.places import cannot_read, inside, read_text
from shapechanger.errors import DemosError

__all__ = ["IMAGES", "MANIFEST", "RECORD_NAME", "Record", "read_v1", "read_v2"]

MANIFEST: Final = "manifest.json"
IMAGES: Final = "images"
META: Final = "meta.json"
RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")

_MANIFEST_LINES: Final = 5
_NS_PER_MS: Final = 1e6
_NS_PER_S: Final = 1e9

# Larger numbers are no time, in ms or in s.
_NO_TIME: Final = 1e15


@dataclass(frozen=True, slots=True)
class Record:
    """One record of a tub.

    Attributes:
        fields: What it says.
        where: What to call it.
        time_ns: When it was made, ns; None where it does not say.
        is_unix: Whether that is Unix time, and not time since some start.
        session: Its session; "" for none.
    """

    fields: dict[str, Any]
    where: str
    time_ns: int | None = None
    is_unix: bool = True
    session: str = ""


def read_v2(folder: Path) -> tuple[dict[str, str], list[Record]]:
    """The inputs of a tub of version 2 with their types, and the records that are not deleted.

    Raises:
        DemosError: If something in it is not whole.
    """
    path = folder / MANIFEST
    lines = read_text(path).splitlines()
    if len(lines) < _MANIFEST_LINES:
        raise DemosError(
            f"{path} has {len(lines)} lines, and the manifest of a tub has {_MANIFEST_LINES}."
        )
    inputs, types, *_, catalogs = (_json(line, f"{path}, line {n}") for n, line in _few(lines))
    if not isinstance(catalogs, dict):
        raise DemosError(f"{path}, line {_MANIFEST_LINES}, does not say which catalogs there are.")
    fields = cast("dict[str, Any]", catalogs)
    names = _list(fields.get("paths"), f"the paths in {path}")
    deleted = set(_list(fields.get("deleted_indexes", []), f"the deleted_indexes in {path}"))
    records: list[Record] = []
    index = 0
    for name in names:
        catalog = inside(folder, str(name), str(path))
        for number, line in enumerate(read_text(catalog).splitlines(), 1):
            if not line.strip():
                continue
            where = f"{catalog}, line {number}"
            if index not in deleted:
                records.append(_record_v2(_object(line, where), where))
            index += 1
    return _typed(inputs, types, path), records


def read_v1(folder: Path) -> tuple[dict[str, str], list[Record]]:
    """The same for a tub of version 1."""
    try:
        found = [(m, path) for path in folder.iterdir() if (m := RECORD_NAME.fullmatch(path.name))]
    except OSError as error:
        raise cannot_read(folder, error) from error
    meta: dict[str, Any] = {}
    if (folder / META).is_file():
        meta = _object(read_text(folder / META), str(folder / META))
    start = _number(meta.get("start"))
    records: list[Record] = []
    for _, path in sorted(found, key=lambda pair: int(pair[0][1])):
        where = str(path)
        fields = _object(read_text(inside(folder, path.name, where)), where)
        time_ms = _number(fields.get("milliseconds"))
        since_ns = None if start is None else round(start * _NS_PER_S)
        time_ns = None if time_ms is None else round(time_ms * _NS_PER_MS) + (since_ns or 0)
        records.append(Record(fields, where, time_ns, is_unix=since_ns is not None))
    return _typed(meta.get("inputs", []), meta.get("types", []), folder / META), records


def _record_v2(fields: dict[str, Any], where: str) -> Record:
    time_ms = _number(fields.get("_timestamp_ms"))
    time_ns = None if time_ms is None else round(time_ms) * round(_NS_PER_MS)
    session = fields.get("_session_id")
    return Record(fields, where, time_ns, session="" if session is None else str(session))


def _few(lines: list[str]) -> list[tuple[int, str]]:
    return list(enumerate(lines[:_MANIFEST_LINES], 1))


def _typed(inputs: Any, types: Any, path: Path) -> dict[str, str]:
    names, kinds = _list(inputs, f"the inputs in {path}"), _list(types, f"the types in {path}")
    if len(names) != len(kinds):
        raise DemosError(f"{path} has {len(names)} inputs and {len(kinds)} types.")
    return {str(name): str(kind) for name, kind in zip(names, kinds, strict=True)}


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise DemosError(f"{what[0].upper()}{what[1:]} are no list.")
    return cast("list[Any]", value)


def _object(text: str, where: str) -> dict[str, Any]:
    value = _json(text, where)
    if not isinstance(value, dict):
        raise DemosError(f"{where} is no JSON object: restore it, or take it out.")
    return cast("dict[str, Any]", value)


def _json(text: str, where: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DemosError(
            f"{where} is not whole ({error}): restore it, or take it out of the tub."
        ) from error


def _number(value: Any) -> float | None:
    """A number that can be a time; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) < _NO_TIME else None
