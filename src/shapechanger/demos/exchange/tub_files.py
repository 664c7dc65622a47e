"""Files of a Donkeycar tub: the records that were not deleted, in the order of their numbers.

Version 2 is a folder with `manifest.json`, catalogs and `images/`. The manifest has five lines of
JSON: inputs, types, metadata, more metadata, and an object with `paths` (the catalogs in order),
`current_index`, `max_len` and `deleted_indexes`, which are values of the records' `_index`. A
catalog has one JSON object per line; `_timestamp_ms` is Unix time, `_session_id` names the start of
the car that it belongs to, and `cam/image_array` names a file in `images/`. Beside a catalog,
`NAME.catalog_manifest` has its `start_index` and the lengths of its lines. Version 1 has a file
`record_N.json` per record, its picture beside it, optionally `milliseconds` since the start,
`meta.json` with inputs, types and optionally the Unix time of the start, and `exclude.json` with
the numbers of deleted records.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py for version 2,
parts/datastore.py for version 1, at the commits 1e831b81, 38a1c2db and b253cef6.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import Step
from shapechanger.demos.exchange.files import (
    cannot_read,
    is_inside,
    parse_json,
    parse_json_object,
    read_bytes,
    read_text,
)
from shapechanger.demos.exchange.format import ImportContext, counted, few
from shapechanger.errors import DemosError

MANIFEST: Final = "manifest.json"
IMAGES: Final = "images"
LOOP_HZ: Final = "DRIVE_LOOP_HZ"  # Donkeycar's name of the rate.
V1_TIME: Final = "milliseconds"
NS_PER_MS: Final = 1_000_000
NS_PER_S: Final = 1_000_000_000

_RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
_CATALOG_NAME: Final = re.compile(r"catalog_([0-9]{1,9})\.catalog")
_DAMAGED: Final = "that is not valid JSON"
_MAX_TIME: Final = 1e15  # Larger numbers are not a time, in ms or s.
_MAX_NS: Final = 1 << 61  # Half of what a step can hold: version 1 adds two times.


@dataclass(frozen=True, slots=True)
class TubRecord:
    """A record with its `_index` or the number of its file; its time and picture if known."""

    fields: dict[str, Any]
    number: int
    time_ns: int | None
    session: str = ""
    step: Step | None = None
    path: Path | None = None


@dataclass(frozen=True, slots=True)
class Tub:
    """The records of a tub that were not deleted, and its declarations.

    Times are Unix times if `is_unix`, or begin at 0 with each start of the car.
    """

    inputs: dict[str, str]
    records: list[TubRecord]
    images: Path
    start_ns: int | None
    is_unix: bool
    stated_hz: float | None


def is_tub(folder: Path) -> bool:
    """Return whether a folder is a tub."""
    return (folder / MANIFEST).is_file() or any(map(_RECORD_NAME.fullmatch, _children(folder)))


def _children(folder: Path) -> list[str]:
    try:
        return [child.name for child in folder.iterdir()]
    except OSError as error:
        raise cannot_read(folder, error) from error


def _numbered(folder: Path, pattern: re.Pattern[str]) -> dict[int, str]:
    """Return the files whose names match, in the order of their numbers."""
    found = {int(m[1]): m[0] for m in map(pattern.fullmatch, _children(folder)) if m}
    return dict(sorted(found.items()))


def read_files(folder: Path, context: ImportContext) -> Tub:
    """Read the records of a tub; lines that are not whole are left out.

    Raises:
        DemosError: If the manifest contradicts itself, or a name leads out of the folder.
    """
    return (_read_v2 if (folder / MANIFEST).is_file() else _read_v1)(folder, context)


def _read_v2(folder: Path, context: ImportContext) -> Tub:
    path = folder / MANIFEST
    lines = [line.strip(b"\0\r ") for line in read_bytes(path).split(b"\n")]
    inputs, types, metadata, more, catalogs = map(_parsed, (lines + [b""] * 5)[:5])
    if not isinstance(inputs, list) or not isinstance(types, list):
        context.warn(f"{path} is damaged: the columns are those that the records have.")
        inputs = types = []
    known = cast("dict[str, Any]", catalogs) if isinstance(catalogs, dict) else {}
    if known:
        names = [str(name) for name in _list(known.get("paths"), f"paths in {path}")]
        deleted = _numbers(known.get("deleted_indexes", []), f"deleted_indexes in {path}")
    else:
        deleted, names = set[int](), [*_numbered(folder, _CATALOG_NAME).values()]
        context.warn(
            f"{path} is damaged: all catalogs in the folder are read, and records that were "
            "deleted cannot be told from the others."
        )
    if len(set(names)) < len(names):
        context.warn(f"{path} names a catalog twice in its paths: it is read once.")
    rows: list[tuple[int, dict[str, Any]]] = []
    for name in dict.fromkeys(names):
        if not name or not is_inside(folder, name):
            raise DemosError(f"{path}: the catalog {name!r} leaves the folder.")
        _read_catalog(folder / name, rows, context)
    records = _with_numbers(rows, context)
    _report_missing(records, deleted, known.get("current_index"), context)
    _note_deleted(len(deleted & {record.number for record in records}), context)
    created = cast("dict[str, Any]", more).get("created_at") if isinstance(more, dict) else None
    return Tub(
        inputs=_typed(inputs, types, path),
        records=[record for record in records if record.number not in deleted],
        images=folder / IMAGES,
        start_ns=_in_ns(created, NS_PER_S),
        is_unix=True,
        stated_hz=_stated_hz(metadata),
    )


def _read_catalog(
    path: Path, rows: list[tuple[int, dict[str, Any]]], context: ImportContext
) -> None:
    """Append the records of a catalog, each with its number by counting."""
    if not path.is_file():
        context.leave_out("catalog", "that is missing", path.name)
        return
    beside = path.with_suffix(".catalog_manifest")
    about = _parsed(read_bytes(beside)) if beside.is_file() else None
    start = cast("dict[str, Any]", about).get("start_index") if isinstance(about, dict) else None
    if not isinstance(start, int) or isinstance(start, bool):
        start = rows[-1][0] + 1 if rows else 0
    try:
        lines = read_bytes(path).split(b"\n")
    except DemosError as error:
        context.leave_out("catalog", f"that cannot be read ({error})", path.name)
        return
    whole = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    for position, (number, line) in enumerate(whole, start):
        fields = _parsed(line)
        if isinstance(fields, dict):
            rows.append((position, cast("dict[str, Any]", fields)))
        else:
            reason = _DAMAGED if line.strip(b"\0\r") else "of NUL bytes, as after a power cut"
            context.leave_out("line", reason, f"{path.name}, line {number}")


def _with_numbers(
    rows: Sequence[tuple[int, dict[str, Any]]], context: ImportContext
) -> list[TubRecord]:
    """Return records in the order of their `_index`, without those whose number is unclear."""
    has_index = any("_index" in fields for _, fields in rows)
    records: list[TubRecord] = []
    for position, fields in rows:
        number = fields.get("_index") if has_index else position
        if isinstance(number, bool) or not isinstance(number, int):
            context.leave_out("record", "without a valid _index", f"the one at position {position}")
            continue
        session = fields.get("_session_id")
        time_ns = _in_ns(fields.get("_timestamp_ms"), NS_PER_MS)
        records.append(TubRecord(fields, number, time_ns, "" if session is None else str(session)))
    falls = [(a.number, b.number) for a, b in pairwise(records) if b.number < a.number]
    if falls:
        context.warn(
            f"The _index falls in {counted(len(falls), 'place')}, first from {falls[0][0]} to "
            f"{falls[0][1]}: the records are read in its order."
        )
    unique: list[TubRecord] = []
    ordered = sorted(records, key=lambda record: record.number)
    for number, group in groupby(ordered, key=lambda record: record.number):
        first, *others = group
        same = [record for record in others if record.fields == first.fields]
        for _ in same:
            context.leave_out("record", "that repeats another", number)
        if len(same) == len(others):
            unique.append(first)
            continue
        # Of those with one number and different content, nothing says which one counts.
        for _ in range(1 + len(others) - len(same)):
            context.leave_out("record", "with the _index of another record", number)
    return unique


def _note_deleted(count: int, context: ImportContext) -> None:
    if count:
        context.note(f"{counted(count, 'record')} deleted in the tub, and not imported.")


def _report_missing(
    records: Sequence[TubRecord], deleted: set[int], count: Any, context: ImportContext
) -> None:
    """Report numbers that the manifest has and no record."""
    numbers = {record.number for record in records}
    last = max(numbers, default=-1)
    if isinstance(count, int) and not isinstance(count, bool):
        last = max(last, min(count, last + 1_000_000) - 1)
        if last >= count:
            context.warn(
                f"The manifest counts {count} records, and the last one has the _index {last}."
            )
    missing = [number for number in range(last + 1) if number not in numbers]
    if missing:
        runs = [
            [number for _, number in run]
            for _, run in groupby(enumerate(missing), key=lambda pair: pair[1] - pair[0])
        ]
        named = few([f"{r[0]} to {r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs])
        context.note(f"{len(missing)} of the records 0 to {last} are in no catalog: {named}.")
    if strange := sorted(deleted - numbers - set(missing)):
        context.warn(f"{len(strange)} of the deleted indexes belong to no record: {few(strange)}.")


def _read_v1(folder: Path, context: ImportContext) -> Tub:
    path, exclude = folder / "meta.json", folder / "exclude.json"
    meta = parse_json_object(read_text(path), str(path)) if path.is_file() else {}
    deleted = set[int]()
    if exclude.is_file():
        deleted = _numbers(parse_json(read_text(exclude), str(exclude)), f"numbers in {exclude}")
    start_ns = _in_ns(meta.get("start"), NS_PER_S)
    names = _numbered(folder, _RECORD_NAME)
    _note_deleted(len(deleted & names.keys()), context)
    records: list[TubRecord] = []
    for number in sorted(names.keys() - deleted):
        record_path = folder / names[number]
        if not is_inside(folder, names[number]):
            raise DemosError(f"{record_path} is a link that leaves the folder.")
        fields = _parsed(read_bytes(record_path))
        if not isinstance(fields, dict):
            context.leave_out("record", _DAMAGED, number)
            continue
        time_ns = _in_ns(cast("dict[str, Any]", fields).get(V1_TIME), NS_PER_MS)
        if time_ns is not None:
            time_ns += start_ns or 0
        records.append(TubRecord(cast("dict[str, Any]", fields), number, time_ns))
    return Tub(
        inputs=_typed(meta.get("inputs", []), meta.get("types", []), path),
        records=records,
        images=folder,
        start_ns=start_ns,
        is_unix=start_ns is not None,
        stated_hz=_stated_hz(meta),
    )


def _parsed(line: bytes) -> Any:
    """Return the value of a line of JSON; None if it is damaged."""
    try:
        return parse_json(line.decode("utf-8-sig"), "a line")
    except (DemosError, UnicodeDecodeError):
        return None


def _typed(inputs: Any, types: Any, path: Path) -> dict[str, str]:
    names, kinds = _list(inputs, f"inputs in {path}"), _list(types, f"types in {path}")
    if len(names) != len(kinds):
        raise DemosError(f"{path} has {len(names)} inputs, but {len(kinds)} types.")
    return {str(name): str(kind) for name, kind in zip(names, kinds, strict=True)}


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise DemosError(f"The {what} must be a list.")
    return cast("list[Any]", value)


def _numbers(value: Any, what: str) -> set[int]:
    numbers = _list(value, what)
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int):
            raise DemosError(f"The {what} must be integers, got {number!r}.")
    return set(numbers)


def _stated_hz(metadata: Any) -> float | None:
    """Return the rate in the metadata of a tub; None if they do not state it."""
    try:
        hz = float(metadata[LOOP_HZ])
    except (LookupError, TypeError, ValueError, OverflowError):
        return None
    return hz if 0.0 < hz < math.inf else None


def _in_ns(value: Any, unit_ns: int) -> int | None:
    """Return a time as ns; None for anything that cannot be a time."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    in_ns = round(value * unit_ns) if abs(value) < _MAX_TIME else _MAX_NS
    return in_ns if abs(in_ns) < _MAX_NS else None
