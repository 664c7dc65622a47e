"""Read the records of Donkeycar tubs of versions 1 and 2, which `tub` converts."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import msgspec

from shapechanger.demos.exchange.files import (
    cannot_read,
    is_inside,
    parse_json,
    read_bytes,
    read_json_object,
    read_text,
)
from shapechanger.demos.exchange.format import ImportContext, counted, few
from shapechanger.errors import DemosError

MANIFEST: Final = "manifest.json"
IMAGES: Final = "images"
LOOP_HZ: Final = "DRIVE_LOOP_HZ"  # Donkeycar's name of the rate.
NS_PER_MS: Final = 1_000_000
NS_PER_S: Final = 1_000_000_000
V1_TIME: Final = "milliseconds"
_MAX_TIME: Final = 1e15  # Larger numbers are not a time, in ms or s.
_MAX_NS: Final = 1 << 61  # Half of what a step can hold: version 1 adds two times.
RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
_CATALOG_NAME: Final = re.compile(r"catalog_([0-9]{1,9})\.catalog")
_DAMAGED: Final = "that is not valid JSON"

Fields = dict[str, Any]


class Line(NamedTuple):
    """The fields of a record, its `_index` or the number of its file, and its time and session."""

    fields: Fields
    number: int
    time_ns: int | None
    session: str = ""


class Tub(NamedTuple):
    """The records of a tub that were not deleted, and its declarations."""

    inputs: dict[str, str]
    lines: list[Line]
    deleted: int
    images: Path
    start_ns: int | None
    is_unix: bool  # Otherwise times begin at 0 with each start of the car.
    stated_hz: float | None


def numbered(folder: Path, pattern: re.Pattern[str]) -> dict[int, str]:
    """Return the files whose names match, in the order of their numbers."""
    try:
        names = [child.name for child in folder.iterdir()]
    except OSError as error:
        raise cannot_read(folder, error) from error
    return dict(sorted((int(m[1]), m[0]) for m in map(pattern.fullmatch, names) if m))


def read_v2(folder: Path, context: ImportContext) -> Tub:
    """Read a tub of version 2: its manifest, and the catalogs that it names."""
    path = folder / MANIFEST
    lines = [line.strip(b"\0\r ") for line in read_bytes(path).split(b"\n")]
    inputs, types, *others = (lines + [b""] * 5)[:5]
    inputs, types = _parsed(inputs), _parsed(types)
    metadata, more, catalogs = (_object(line) or {} for line in others)
    if not isinstance(inputs, list) or not isinstance(types, list):
        context.warn(f"{path} is damaged: the columns are those that the records have.")
        inputs = types = []
    if catalogs:
        names = _list(catalogs.get("paths"), str, f"paths in {path}")
        gone = catalogs.get("deleted_indexes", [])
        deleted = set(_list(gone, int, f"deleted_indexes in {path}"))
    else:
        deleted, names = set[int](), [*numbered(folder, _CATALOG_NAME).values()]
        context.warn(
            f"{path} is damaged: all catalogs in the folder are read, and records that were "
            "deleted cannot be told from the others."
        )
    if len(set(names)) < len(names):
        context.warn(f"{path} names a catalog twice in its paths: it is read once.")
    rows: list[tuple[int, Fields]] = []
    for name in dict.fromkeys(names):
        if not name or not is_inside(folder, name):
            raise DemosError(f"{path}: the catalog {name!r} leaves the folder.")
        _read_catalog(folder / name, rows, context)
    records = _with_numbers(rows, context)
    _report_missing(records, deleted, catalogs.get("current_index"), context)
    return Tub(
        inputs=_typed(inputs, types, path),
        lines=[record for record in records if record.number not in deleted],
        deleted=len(deleted & {record.number for record in records}),
        images=folder / IMAGES,
        start_ns=_in_ns(more.get("created_at"), NS_PER_S),
        is_unix=True,
        stated_hz=_stated_hz(metadata),
    )


def _read_catalog(path: Path, rows: list[tuple[int, Fields]], context: ImportContext) -> None:
    """Append the records of a catalog, each with its number by counting."""
    if not path.is_file():
        context.leave_out("catalog", "that is missing", path.name)
        return
    manifest = path.with_suffix(".catalog_manifest")
    about = (_object(read_bytes(manifest)) if manifest.is_file() else None) or {}
    start = about.get("start_index")
    if type(start) is not int:
        start = rows[-1][0] + 1 if rows else 0
    try:
        lines = read_bytes(path).split(b"\n")
    except DemosError as error:
        context.leave_out("catalog", f"that cannot be read ({error})", path.name)
        return
    whole = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    for position, (number, line) in enumerate(whole, start):
        if (fields := _object(line)) is not None:
            rows.append((position, fields))
        else:
            reason = _DAMAGED if line.strip(b"\0\r") else "of NUL bytes, as after a power cut"
            context.leave_out("line", reason, f"{path.name}, line {number}")


def _with_numbers(rows: Sequence[tuple[int, Fields]], context: ImportContext) -> list[Line]:
    """Return records in the order of their `_index`, without those whose number is unclear."""
    has_index = any("_index" in fields for _, fields in rows)
    records: list[Line] = []
    for position, fields in rows:
        number = fields.get("_index") if has_index else position
        if type(number) is not int:
            context.leave_out("record", "without a valid _index", f"the one at position {position}")
            continue
        session = fields.get("_session_id")
        time_ns = _in_ns(fields.get("_timestamp_ms"), NS_PER_MS)
        records.append(Line(fields, number, time_ns, "" if session is None else str(session)))
    falls = [(a.number, b.number) for a, b in pairwise(records) if b.number < a.number]
    if falls:
        context.warn(
            f"The _index falls in {counted(len(falls), 'place')}, first from {falls[0][0]} to "
            f"{falls[0][1]}: the records are read in its order."
        )
    unique: list[Line] = []
    ordered = sorted(records, key=lambda record: record.number)
    for number, group in groupby(ordered, key=lambda record: record.number):
        first, *others = group
        odd = [record for record in others if record.fields != first.fields]
        for _ in others[len(odd) :]:
            context.leave_out("record", "that repeats another", number)
        # Of those with one number and different content, nothing says which one counts.
        for _ in (first, *odd) if odd else ():
            context.leave_out("record", "with the _index of another record", number)
        unique += [] if odd else [first]
    return unique


def _report_missing(
    records: Sequence[Line], deleted: set[int], count: Any, context: ImportContext
) -> None:
    """Report numbers that the manifest has and no record."""
    numbers = {record.number for record in records}
    last = max(numbers, default=-1)
    if type(count) is int:
        last = max(last, min(count, last + 1_000_000) - 1)
        if last >= count:
            context.warn(
                f"The manifest counts {count} records, and the last one has the _index {last}."
            )
    ends = pairwise([-1, *sorted(numbers), last + 1])
    if gaps := [(one + 1, two - 1) for one, two in ends if two - one > 1]:
        missing = sum(end - start + 1 for start, end in gaps)
        named = few([f"{start} to {end}" if end > start else f"{start}" for start, end in gaps])
        context.note(f"{missing} of the records 0 to {last} are in no catalog: {named}.")
    if strange := sorted(number for number in deleted - numbers if not 0 <= number <= last):
        context.warn(f"{len(strange)} of the deleted indexes belong to no record: {few(strange)}.")


def read_v1(folder: Path, context: ImportContext) -> Tub:
    """Read a tub of version 1: a file for each record."""
    path, exclude = folder / "meta.json", folder / "exclude.json"
    meta = read_json_object(path) if path.is_file() else {}
    deleted = set[int]()
    if exclude.is_file():
        gone = parse_json(read_text(exclude), str(exclude))
        deleted = set(_list(gone, int, f"numbers in {exclude}"))
    start_ns = _in_ns(meta.get("start"), NS_PER_S)
    names = numbered(folder, RECORD_NAME)
    records: list[Line] = []
    for number in sorted(names.keys() - deleted):
        if not is_inside(folder, names[number]):
            raise DemosError(f"{folder / names[number]} is a link that leaves the folder.")
        if (fields := _object(read_bytes(folder / names[number]))) is None:
            context.leave_out("record", _DAMAGED, number)
            continue
        time_ns = _in_ns(fields.get(V1_TIME), NS_PER_MS)
        time_ns = None if time_ns is None else time_ns + (start_ns or 0)
        records.append(Line(fields, number, time_ns))
    return Tub(
        inputs=_typed(meta.get("inputs", []), meta.get("types", []), path),
        lines=records,
        deleted=len(deleted & names.keys()),
        images=folder,
        start_ns=start_ns,
        is_unix=start_ns is not None,
        stated_hz=_stated_hz(meta),
    )


def _parsed(line: bytes) -> Any:
    """Return the value of a line of JSON; None if it is damaged."""
    with suppress(DemosError, UnicodeDecodeError):
        return parse_json(line.decode("utf-8-sig"), "a line")
    return None


def _object(line: bytes) -> Fields | None:
    value = _parsed(line)
    return cast("Fields", value) if isinstance(value, dict) else None


def _typed(inputs: Any, types: Any, path: Path) -> dict[str, str]:
    names, kinds = _list(inputs, str, f"inputs in {path}"), _list(types, str, f"types in {path}")
    if len(names) != len(kinds):
        raise DemosError(f"{path} has {len(names)} inputs, but {len(kinds)} types.")
    return dict(zip(names, kinds, strict=True))


def _list(value: Any, kind: Any, what: str) -> list[Any]:
    try:
        return msgspec.convert(value, list[kind])
    except msgspec.ValidationError as error:
        raise DemosError(f"The {what} must be a list of {kind.__name__}: {error}.") from error


def _stated_hz(metadata: Fields) -> float | None:
    """Return the rate in the metadata of a tub; None if they do not state it."""
    with suppress(LookupError, TypeError, ValueError, OverflowError):
        hz = float(metadata[LOOP_HZ])
        return hz if 0.0 < hz < math.inf else None
    return None


def _in_ns(value: Any, unit_ns: int) -> int | None:
    """Return a time as ns; None for anything that cannot be a time."""
    if type(value) not in {int, float}:
        return None
    in_ns = round(value * unit_ns) if abs(value) < _MAX_TIME else _MAX_NS
    return in_ns if abs(in_ns) < _MAX_NS else None
