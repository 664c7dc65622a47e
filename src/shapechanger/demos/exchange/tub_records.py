"""Read the records of Donkeycar tubs of versions 1 and 2, which `tub` converts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from shapechanger.demos.exchange import files
from shapechanger.demos.exchange.format import ImportContext, counted, few
from shapechanger.demos.exchange.imports import unreadable
from shapechanger.errors import DemosError, translate_errors

MANIFEST: Final = "manifest.json"
IMAGES: Final = "images"
LOOP_HZ: Final = "DRIVE_LOOP_HZ"  # Donkeycar's name of the rate.
RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
NS_PER_MS: Final = 1_000_000
NS_PER_S: Final = 1_000_000_000
_CATALOG_NAME: Final = re.compile(r"catalog_([0-9]{1,9})\.catalog")
_MAX_TIME: Final = 1e15  # Larger numbers are not a time, in ms or s.
_MAX_NS: Final = 1 << 61
_DAMAGED: Final = "that is not valid JSON"

Fields = dict[str, Any]


class Tub(NamedTuple):
    """A tub; each record has a number as `_index`, and no other one has it."""

    inputs: dict[str, str]
    records: list[Fields]
    deleted: int
    images: Path
    start_ns: int | None
    is_unix: bool  # Otherwise times begin at 0 with each start of the car.
    stated_hz: float | None


def numbered(folder: Path, pattern: re.Pattern[str]) -> dict[int, str]:
    """Return the files whose names match, in the order of their numbers."""
    with translate_errors(OSError, to=lambda error: files.cannot_read(folder, error)):
        names = [child.name for child in folder.iterdir()]
    return dict(sorted((int(m[1]), m[0]) for m in map(pattern.fullmatch, names) if m))


def read_v2(folder: Path, context: ImportContext) -> Tub:
    """Read a tub of version 2: its manifest, and the catalogs that it names."""
    path = folder / MANIFEST
    lines = [line.strip(b"\0\r ") for line in files.read_bytes(path).split(b"\n")]
    lines = (lines + [b""] * 5)[:5]
    inputs, types = (_parsed(line, list) for line in lines[:2])
    metadata, more, catalogs = (_parsed(line, dict) or Fields() for line in lines[2:])
    if inputs is None or types is None:
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
    rows: list[Fields] = []
    for name in dict.fromkeys(names):
        if not name or not files.is_inside(folder, name):
            raise DemosError(f"{path}: the catalog {name!r} leaves the folder.")
        rows += _read_catalog(folder / name, context)
    records = _in_order(rows, deleted, catalogs.get("current_index"), context)
    kept = [fields for fields in records if fields["_index"] not in deleted]
    return Tub(
        inputs=_typed(inputs, types, path),
        records=kept,
        deleted=len(records) - len(kept),
        images=folder / IMAGES,
        start_ns=in_ns(more.get("created_at"), NS_PER_S),
        is_unix=True,
        stated_hz=_stated_hz(metadata),
    )


def _read_catalog(path: Path, context: ImportContext) -> Iterator[Fields]:
    if not path.is_file():
        context.leave_out("catalog", "that is missing", path.name)
        return
    try:
        lines = files.read_bytes(path).split(b"\n")
    except DemosError as error:
        context.leave_out("catalog", unreadable(error), path.name)
        return
    for number, line in enumerate(lines, 1):
        if (fields := _parsed(line, dict)) is not None:
            yield fields
        elif line.strip():
            reason = _DAMAGED if line.strip(b"\0\r") else "of NUL bytes, as after a power cut"
            context.leave_out("line", reason, f"{path.name}, line {number}")


def _in_order(
    rows: Sequence[Fields], deleted: set[int], count: Any, context: ImportContext
) -> list[Fields]:
    """Return records in the order of their `_index`, without those whose number is unclear."""
    records: list[Fields] = []
    for position, fields in enumerate(rows):
        if type(fields.get("_index")) is int:
            records.append(fields)
        else:
            context.leave_out("record", "without a valid _index", f"the one at position {position}")
    numbers = [fields["_index"] for fields in records]
    if falls := [(one, two) for one, two in pairwise(numbers) if two < one]:
        context.warn(
            f"The _index falls in {counted(len(falls), 'place')}, first from {falls[0][0]} to "
            f"{falls[0][1]}: the records are read in its order."
        )
    unique: list[Fields] = []
    index = itemgetter("_index")
    for number, group in groupby(sorted(records, key=index), key=index):
        first, *others = group
        # Of those with one number and different content, nothing says which one counts.
        unclear = any(fields != first for fields in others)
        reason = "with the _index of another record" if unclear else "that repeats another"
        for _ in (first, *others) if unclear else others:
            context.leave_out("record", reason, number)
        unique += [] if unclear else [first]
    last = max(numbers, default=-1)
    if type(count) is int:
        last = max(last, min(count, last + 1_000_000) - 1)
    ends = pairwise([-1, *sorted(set(numbers)), last + 1])
    if gaps := [(one + 1, two - 1) for one, two in ends if two - one > 1]:
        missing = sum(end - start + 1 for start, end in gaps)
        named = few([f"{start} to {end}" if end > start else f"{start}" for start, end in gaps])
        context.note(f"{missing} of the records 0 to {last} are in no catalog: {named}.")
    if strange := sorted(number for number in deleted.difference(numbers) if number > last):
        context.warn(f"{len(strange)} of the deleted indexes belong to no record: {few(strange)}.")
    return unique


def read_v1(folder: Path, context: ImportContext) -> Tub:
    """Read a tub of version 1, which has a file for each record, with the names of version 2."""
    path, exclude = folder / "meta.json", folder / "exclude.json"
    meta = files.read_json_object(path) if path.is_file() else {}
    gone: Any = []
    if exclude.is_file():
        gone = files.parse_json(files.read_text(exclude), str(exclude))
    deleted = set(_list(gone, int, f"numbers in {exclude}"))
    start_ns = in_ns(meta.get("start"), NS_PER_S)
    names = numbered(folder, RECORD_NAME)
    records: list[Fields] = []
    for number in sorted(names.keys() - deleted):
        if not files.is_inside(folder, names[number]):
            raise DemosError(f"{folder / names[number]} is a link that leaves the folder.")
        if (fields := _parsed(files.read_bytes(folder / names[number]), dict)) is None:
            context.leave_out("record", _DAMAGED, number)
            continue
        since_ns = in_ns(fields.pop("milliseconds", None), NS_PER_MS)
        time_ms = None if since_ns is None else (since_ns + (start_ns or 0)) / NS_PER_MS
        records.append(fields | {"_index": number, "_timestamp_ms": time_ms})
    return Tub(
        inputs=_typed(meta.get("inputs", []), meta.get("types", []), path),
        records=records,
        deleted=len(deleted & names.keys()),
        images=folder,
        start_ns=start_ns,
        is_unix=start_ns is not None,
        stated_hz=_stated_hz(meta),
    )


def _parsed(line: bytes, kind: type[Any]) -> Any:
    """Return the value of a line of JSON; None if it is damaged or of another kind."""
    with suppress(DemosError, UnicodeDecodeError):
        value = files.parse_json(line.decode("utf-8-sig"), "a line")
        return value if isinstance(value, kind) else None
    return None


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


def in_ns(value: Any, unit_ns: int) -> int | None:
    """Return a time as ns; None for anything that cannot be a time."""
    if type(value) not in {int, float}:
        return None
    in_ns = round(value * unit_ns) if abs(value) < _MAX_TIME else _MAX_NS
    return in_ns if abs(in_ns) < _MAX_NS else None
