"""Donkeycar tubs: import of versions 1 and 2.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, as in
Shapechanger. In the `user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In
the other modes `pilot/...` drives, except that in "local_angle" the throttle is the person's.

Version 2 is a folder with `manifest.json` (five lines of JSON: inputs, types, metadata, more
metadata, and an object with the catalogs), catalogs with a record per line, and `images/`. Deleted
indexes are values of the records' `_index`; `_timestamp_ms` is Unix time, and `_session_id` names
the start of the car. Version 1 has a file `record_N.json` per record, its picture beside it,
optionally `milliseconds` since the start, `meta.json`, and the deleted numbers in `exclude.json`.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py for version 2,
parts/datastore.py for version 1, at the commits 1e831b81, 38a1c2db and b253cef6.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path, PurePath
from typing import Any, Final, NamedTuple, TypeVar, cast

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.files import (
    UNIT_UNKNOWN,
    cannot_read,
    is_inside,
    parse_json,
    read_bytes,
    read_json_object,
    read_text,
)
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExchangeStep,
    Format,
    ImportContext,
    counted,
    few,
)
from shapechanger.demos.exchange.pictures import check_pictures, read_picture
from shapechanger.demos.exchange.times import TimedDrive, choose_rates, iso_time, split_at_jumps
from shapechanger.demos.exchange.tub_export import (
    ACTIONS,
    AXES,
    IMAGE,
    IMAGES,
    LOOP_HZ,
    MANIFEST,
    MODE,
    NS_PER_MS,
    NS_PER_S,
    PERSON_DRIVES,
    write,
)
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

_POLICY_STEERS: Final = "local_angle"
_V1_TIME: Final = "milliseconds"
_MAX_TIME: Final = 1e15  # Larger numbers are not a time, in ms or s.
_MAX_NS: Final = 1 << 61  # Half of what a step can hold: version 1 adds two times.
_NUMBERS: Final = ("float", "int", "boolean")
_PICTURES: Final = ("image_array", "image")
_DEPTH: Final = "gray16_array"
_KNOWN: Final = (*_NUMBERS, *_PICTURES, _DEPTH, "str", "list", "vector", "nparray")
_ENDINGS: Final = (".jpg", ".jpeg", ".png", ".bmp")
_PICTURE_NUMBER: Final = re.compile(r"([0-9]{1,12})_")
_RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
_CATALOG_NAME: Final = re.compile(r"catalog_([0-9]{1,9})\.catalog")
_DAMAGED: Final = "that is not valid JSON"

_Fields = dict[str, Any]
_T = TypeVar("_T", int, str)


class _Record(NamedTuple):
    """A record with its `_index` or the number of its file; its time and picture if known."""

    fields: _Fields
    number: int
    time_ns: int | None
    session: str = ""
    step: Step | None = None
    path: Path | None = None


class _Tub(NamedTuple):
    """The records of a tub that were not deleted, and its declarations."""

    inputs: dict[str, str]
    records: list[_Record]
    deleted: int
    images: Path
    start_ns: int | None
    is_unix: bool  # Otherwise times begin at 0 with each start of the car.
    stated_hz: float | None


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a tub: its sessions, divided at pauses and where time jumps."""
    tub = (_read_v2 if (folder / MANIFEST).is_file() else _read_v1)(folder, context)
    if tub.deleted:
        context.note(f"{counted(tub.deleted, 'record')} deleted in the tub, and not imported.")
    if not tub.records:
        return
    columns: dict[str, str] = {}  # The type of each that a record has, declared or by its values.
    for record in tub.records:
        for name, value in record.fields.items():
            if not name.startswith("_") and name != _V1_TIME and columns.get(name) not in _KNOWN:
                declared = tub.inputs.get(name, "")
                columns[name] = declared if declared in _KNOWN else _kind_of(value)
    camera = _camera(columns, folder, context)
    sensed = [
        name
        for name, kind in (tub.inputs or columns).items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    state = Layout(tuple(Feature(name, UNIT_UNKNOWN) for name in sensed)) if sensed else None
    taken = {
        camera,
        MODE,
        *sensed,
        *(f"{who}/{axis}" for who in ("user", "pilot") for axis in AXES),
    }
    if left := [f"{name} ({kind})" for name, kind in columns.items() if name and name not in taken]:
        context.note(f"Columns that are not imported: {', '.join(left)}.")
    records, size = [record for r in tub.records if (record := _driven(r, sensed, context))], None
    if camera:
        records, size = _with_pictures(records, tub.images, camera, context)
    if not records:
        return
    parts = list(_drives(records, restarts=not tub.is_unix))
    times = [_times_ns(part, context) for part in parts]
    numbers = [[record.number for record in part] for part in parts]
    drives = [
        TimedDrive(known, part, f"record {part[0]}")
        for known, part in zip(times, numbers, strict=True)
    ]
    rates, believed = choose_rates(drives, context, tub.stated_hz)
    if not believed:
        drives = [replace(drive, times_ns=()) for drive in drives]
    places = split_at_jumps(drives, [list(map(str, part)) for part in numbers], rates, context)
    for part, known, hz, split in zip(parts, times, rates, places, strict=True):
        timed = bool(known) and believed
        for place in split:
            began_ns = known[place][0] if timed and tub.is_unix else tub.start_ns
            header = EpisodeHeader(
                action_layout=ACTIONS.to_json(),
                state_layout="" if state is None else state.to_json(),
                image_size=size,
                control_hz=hz,
                body="car",
                clock="real" if timed else "none",
                source="tub",
                notes={"session": part[0].session} if part[0].session else {},
                created=iso_time(began_ns) if began_ns and (timed or not known) else "",
            )
            yield ExchangeEpisode(
                header=header,
                rows=_steps(part[place], timed=timed, is_unix=tub.is_unix),
                name=f"{folder}, from record {part[place][0].number}",
            )


def _steps(records: Sequence[_Record], *, timed: bool, is_unix: bool) -> Iterator[ExchangeStep]:
    for record in records:
        at_ns = record.time_ns if timed else None
        wall_ns = at_ns if is_unix else None
        step = msgspec.structs.replace(
            cast("Step", record.step), captured_ns=at_ns, wall_ns=wall_ns
        )
        yield ExchangeStep(step=step, jpeg=read_picture(record.path)[0] if record.path else None)


def _kind_of(value: Any) -> str:
    if isinstance(value, str):
        return _PICTURES[0] if value.lower().endswith(_ENDINGS) else "str"
    if isinstance(value, bool):
        return "boolean"
    return "float" if isinstance(value, int | float) else "list"


def _camera(columns: Mapping[str, str], folder: Path, context: ImportContext) -> str:
    """Return the column of the pictures; "" without pictures."""
    cameras = [name for name, kind in columns.items() if kind in _PICTURES]
    deep = [name for name, kind in columns.items() if kind == _DEPTH]
    if context.camera:
        if context.camera not in cameras:
            raise UnknownName(f"camera of {folder}", context.camera, cameras)
        return context.camera
    if not cameras and deep:
        context.warn(
            f"The steps have no pictures, because those of {few(deep)} have 16 bits, as of depth, "
            "and only pictures of 8 bits can be imported."
        )
    if len(cameras) > 1 and IMAGE not in cameras:
        raise DemosError(
            f"{folder} has {len(cameras)} cameras ({', '.join(cameras)}), but an episode has one: "
            f"choose with --camera, such as --camera {cameras[0]}."
        )
    if len(cameras) == 1 and cameras[0] != IMAGE:
        context.note(f"The pictures are those of the column {cameras[0]}.")
    return IMAGE if IMAGE in cameras else "".join(cameras)


def _driven(record: _Record, sensed: Sequence[str], context: ImportContext) -> _Record | None:
    """Return a record with its step; None, with a finding, if it has no valid action."""
    mode = record.fields.get(MODE, PERSON_DRIVES)
    by_person = mode == PERSON_DRIVES
    actors = ("user" if by_person else "pilot",) * 2
    if mode == _POLICY_STEERS:
        actors = ("pilot", "user")
    names = [f"{actor}/{axis}" for actor, axis in zip(actors, AXES, strict=True)]
    lacking = [name for name in names if record.fields.get(name) is None]
    action = _pair(record, names)
    if lacking or action is None:
        reason = f"with {' or '.join(names)} that is not a number from -1 to 1"
        if lacking:
            driver = "" if by_person else ", although a pilot drove"
            reason = f"without {' and '.join(lacking)}{driver}"
        context.leave_out("record", reason, record.number)
        return None
    wanted, suggested = None, [f"pilot/{axis}" for axis in AXES]
    if by_person:
        wanted = _pair(record, suggested)
        if wanted is None and None not in map(record.fields.get, suggested):
            reason = "of the pilot that is not a number from -1 to 1, while a person drove"
            context.leave_out("suggestion", reason, record.number)
    state = tuple(_sensed(record.fields.get(name)) for name in sensed)
    driver = "person" if by_person else "policy"
    return record._replace(step=Step(action=action, driver=driver, wanted=wanted, state=state))


def _pair(record: _Record, names: Sequence[str]) -> tuple[float, float] | None:
    """Return two numbers from -1 to 1; None for anything else."""
    values: list[Any] = [record.fields.get(name) for name in names]
    if all(type(value) in {int, float} and abs(value) <= 1.0 for value in values):
        return float(values[0]), float(values[1])
    return None


def _sensed(value: Any) -> float:
    """Return a sensor value; NaN for anything that is not a number."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # An integer of hundreds of digits.
        return math.nan


def _with_pictures(
    records: Sequence[_Record], images: Path, camera: str, context: ImportContext
) -> tuple[list[_Record], tuple[int, int] | None]:
    """Return the records whose pictures can be imported, and the size of these."""
    shown = Counter(str(record.fields.get(camera)) for record in records)
    found: list[_Record] = []
    offsets: dict[int, int] = {}
    for record in records:
        number, name = record.number, record.fields.get(camera)
        if not name or not isinstance(name, str):
            context.leave_out("record", "without a picture", number)
            continue
        # Version 1 writes whole paths of the robot for the type "image".
        place = PurePath(name).name if PurePath(name).is_absolute() else name
        if not is_inside(images, place):
            context.leave_out("record", "with a picture name that leaves the folder", number)
        elif shown[name] > 1 and (images / place).is_file():
            context.leave_out("record", "with the picture of another record", number)
        else:
            found.append(record._replace(path=images / place))
            if (match := _PICTURE_NUMBER.match(name)) and int(match[1]) != number:
                offsets[number] = int(match[1]) - number
    if offsets:
        context.warn(
            f"{counted(len(offsets), 'record')} with the picture of another number, up to "
            f"{max(map(abs, offsets.values()))} off ({few(list(offsets))}): look whether they "
            "belong together."
        )
    pictures = [(cast("Path", record.path), str(record.number)) for record in found]
    good, size = check_pictures(pictures, "record", context)
    return [record for record, is_good in zip(found, good, strict=True) if is_good], size


def _drives(records: Sequence[_Record], *, restarts: bool) -> Iterator[list[_Record]]:
    """Yield the records of each session, and of each start of the car if times restart with it."""
    for _, session in groupby(records, key=lambda record: record.session):
        drive: list[_Record] = []
        for record in session:
            before_ns, now_ns = drive[-1].time_ns if drive else None, record.time_ns
            if restarts and now_ns is not None and before_ns is not None and now_ns < before_ns:
                yield drive
                drive = []
            drive.append(record)
        yield drive


def _times_ns(drive: Sequence[_Record], context: ImportContext) -> list[int]:
    """Return the time of each record, ns; an empty list if one is unknown."""
    times = [record.time_ns for record in drive if record.time_ns is not None]
    if 0 < len(times) < len(drive):
        context.warn(
            f"{len(drive) - len(times)} of the {len(drive)} records from {drive[0].number} have no "
            "valid time: the times of the others are left out."
        )
    return times if len(times) == len(drive) else []


def _numbered(folder: Path, pattern: re.Pattern[str]) -> dict[int, str]:
    """Return the files whose names match, in the order of their numbers."""
    try:
        names = [child.name for child in folder.iterdir()]
    except OSError as error:
        raise cannot_read(folder, error) from error
    return dict(sorted((int(m[1]), m[0]) for m in map(pattern.fullmatch, names) if m))


def _read_v2(folder: Path, context: ImportContext) -> _Tub:
    path = folder / MANIFEST
    lines = [line.strip(b"\0\r ") for line in read_bytes(path).split(b"\n")]
    inputs, types, metadata, more, catalogs = map(_parsed, (lines + [b""] * 5)[:5])
    if not isinstance(inputs, list) or not isinstance(types, list):
        context.warn(f"{path} is damaged: the columns are those that the records have.")
        inputs = types = []
    known = _object(catalogs) or {}
    if known:
        names = _list(known.get("paths"), str, f"paths in {path}")
        gone = known.get("deleted_indexes", [])
        deleted = set(_list(gone, int, f"deleted_indexes in {path}"))
    else:
        deleted, names = set[int](), [*_numbered(folder, _CATALOG_NAME).values()]
        context.warn(
            f"{path} is damaged: all catalogs in the folder are read, and records that were "
            "deleted cannot be told from the others."
        )
    if len(set(names)) < len(names):
        context.warn(f"{path} names a catalog twice in its paths: it is read once.")
    rows: list[tuple[int, _Fields]] = []
    for name in dict.fromkeys(names):
        if not name or not is_inside(folder, name):
            raise DemosError(f"{path}: the catalog {name!r} leaves the folder.")
        _read_catalog(folder / name, rows, context)
    records = _with_numbers(rows, context)
    _report_missing(records, deleted, known.get("current_index"), context)
    return _Tub(
        inputs=_typed(inputs, types, path),
        records=[record for record in records if record.number not in deleted],
        deleted=len(deleted & {record.number for record in records}),
        images=folder / IMAGES,
        start_ns=_in_ns((_object(more) or {}).get("created_at"), NS_PER_S),
        is_unix=True,
        stated_hz=_stated_hz(metadata),
    )


def _read_catalog(path: Path, rows: list[tuple[int, _Fields]], context: ImportContext) -> None:
    """Append the records of a catalog, each with its number by counting."""
    if not path.is_file():
        context.leave_out("catalog", "that is missing", path.name)
        return
    beside = path.with_suffix(".catalog_manifest")
    about = _object(_parsed(read_bytes(beside))) if beside.is_file() else None
    start = (about or {}).get("start_index")
    if type(start) is not int:
        start = rows[-1][0] + 1 if rows else 0
    try:
        lines = read_bytes(path).split(b"\n")
    except DemosError as error:
        context.leave_out("catalog", f"that cannot be read ({error})", path.name)
        return
    whole = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    for position, (number, line) in enumerate(whole, start):
        if (fields := _object(_parsed(line))) is not None:
            rows.append((position, fields))
        else:
            reason = _DAMAGED if line.strip(b"\0\r") else "of NUL bytes, as after a power cut"
            context.leave_out("line", reason, f"{path.name}, line {number}")


def _with_numbers(rows: Sequence[tuple[int, _Fields]], context: ImportContext) -> list[_Record]:
    """Return records in the order of their `_index`, without those whose number is unclear."""
    has_index = any("_index" in fields for _, fields in rows)
    records: list[_Record] = []
    for position, fields in rows:
        number = fields.get("_index") if has_index else position
        if type(number) is not int:
            context.leave_out("record", "without a valid _index", f"the one at position {position}")
            continue
        session = fields.get("_session_id")
        time_ns = _in_ns(fields.get("_timestamp_ms"), NS_PER_MS)
        records.append(_Record(fields, number, time_ns, "" if session is None else str(session)))
    falls = [(a.number, b.number) for a, b in pairwise(records) if b.number < a.number]
    if falls:
        context.warn(
            f"The _index falls in {counted(len(falls), 'place')}, first from {falls[0][0]} to "
            f"{falls[0][1]}: the records are read in its order."
        )
    unique: list[_Record] = []
    ordered = sorted(records, key=lambda record: record.number)
    for number, group in groupby(ordered, key=lambda record: record.number):
        first, *others = group
        same = sum(record.fields == first.fields for record in others)
        for _ in range(same):
            context.leave_out("record", "that repeats another", number)
        if same == len(others):
            unique.append(first)
            continue
        # Of those with one number and different content, nothing says which one counts.
        for _ in range(1 + len(others) - same):
            context.leave_out("record", "with the _index of another record", number)
    return unique


def _report_missing(
    records: Sequence[_Record], deleted: set[int], count: Any, context: ImportContext
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


def _read_v1(folder: Path, context: ImportContext) -> _Tub:
    path, exclude = folder / "meta.json", folder / "exclude.json"
    meta = read_json_object(path) if path.is_file() else {}
    deleted = set[int]()
    if exclude.is_file():
        gone = parse_json(read_text(exclude), str(exclude))
        deleted = set(_list(gone, int, f"numbers in {exclude}"))
    start_ns = _in_ns(meta.get("start"), NS_PER_S)
    names = _numbered(folder, _RECORD_NAME)
    records: list[_Record] = []
    for number in sorted(names.keys() - deleted):
        record_path = folder / names[number]
        if not is_inside(folder, names[number]):
            raise DemosError(f"{record_path} is a link that leaves the folder.")
        if (fields := _object(_parsed(read_bytes(record_path)))) is None:
            context.leave_out("record", _DAMAGED, number)
            continue
        time_ns = _in_ns(fields.get(_V1_TIME), NS_PER_MS)
        time_ns = None if time_ns is None else time_ns + (start_ns or 0)
        records.append(_Record(fields, number, time_ns))
    return _Tub(
        inputs=_typed(meta.get("inputs", []), meta.get("types", []), path),
        records=records,
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


def _object(value: Any) -> _Fields | None:
    return cast("_Fields", value) if isinstance(value, dict) else None


def _typed(inputs: Any, types: Any, path: Path) -> dict[str, str]:
    names, kinds = _list(inputs, str, f"inputs in {path}"), _list(types, str, f"types in {path}")
    if len(names) != len(kinds):
        raise DemosError(f"{path} has {len(names)} inputs, but {len(kinds)} types.")
    return dict(zip(names, kinds, strict=True))


def _list(value: Any, kind: type[_T], what: str) -> list[_T]:
    try:
        return msgspec.convert(value, list[kind])
    except msgspec.ValidationError as error:
        raise DemosError(f"The {what} must be a list of {kind.__name__}: {error}.") from error


def _stated_hz(metadata: Any) -> float | None:
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


FORMAT: Final = Format(
    name="tub",
    title="Donkeycar",
    sign=f"{MANIFEST} or record_0.json",
    detect=lambda path: (path / MANIFEST).is_file() or bool(_numbered(path, _RECORD_NAME)),
    read=_read,
    write=write,
    options=frozenset({"camera", "hz"}),
)
