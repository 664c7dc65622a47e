"""Donkeycar tubs: import of versions 1 and 2, export of version 2.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, as in
Shapechanger. In the `user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In
the other modes `pilot/...` drives, except that in "local_angle" the throttle is the person's.

Version 2 is a folder with `manifest.json` (five lines of JSON: inputs, types, metadata, more
metadata, and an object with the catalogs), catalogs with a record per line, and `images/`. Deleted
indexes are values of the records' `_index`; `_timestamp_ms` is Unix time, and `_session_id` names
the start of the car. Version 1 has a file `record_N.json` per record, its picture next to it,
optionally `milliseconds` since the start, `meta.json`, and the deleted numbers in `exclude.json`.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py for version 2,
parts/datastore.py for version 1, at the commits 1e831b81, 38a1c2db and b253cef6.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from itertools import groupby, pairwise
from pathlib import Path, PurePath
from typing import Any, Final, NamedTuple, cast

import msgspec
from msgspec.structs import replace

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.drives import (
    SourceRecord,
    as_json,
    choose_camera,
    episode_of,
    features_of,
    iso_time,
    stretches,
    with_pictures,
)
from shapechanger.demos.exchange.exports import kept_steps
from shapechanger.demos.exchange.files import (
    cannot_read,
    is_inside,
    parse_json,
    read_bytes,
    read_json_object,
    read_text,
)
from shapechanger.demos.exchange.format import (
    COMMANDS,
    ExchangeEpisode,
    ExportContext,
    Format,
    ImportContext,
    counted,
    few,
    name_in,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

_ACTIONS: Final = Layout((COMMANDS["steering"], COMMANDS["throttle"]))
_AXES: Final = ("angle", "throttle")
_USER, _PILOT = ([f"{who}/{axis}" for axis in _AXES] for who in ("user", "pilot"))
_IMAGE, _MODE = name_in("tub", "frame"), name_in("tub", "driver")
_MANIFEST: Final = "manifest.json"
_IMAGES: Final = "images"
_LOOP_HZ: Final = "DRIVE_LOOP_HZ"  # Donkeycar's name of the rate.
_NS_PER_MS: Final = 1_000_000
_NS_PER_S: Final = 1_000_000_000
_PERSON_DRIVES: Final = "user"
_POLICY_DRIVES: Final = "local"
_POLICY_STEERS: Final = "local_angle"
_CATALOG_LENGTH: Final = 1000  # Records, as in Donkeycar.
_V1_TIME: Final = "milliseconds"
_MAX_TIME: Final = 1e15  # Larger numbers are not a time, in ms or s.
_MAX_NS: Final = 1 << 61  # Half of what a step can hold: version 1 adds two times.
_NUMBERS: Final = ("float", "int", "boolean")
_KINDS: Final[dict[type[object], str]] = {str: "str", bool: "boolean", int: "float", float: "float"}
_PICTURES: Final = ("image_array", "image")
_DEPTH: Final = "gray16_array"
_KNOWN: Final = (*_NUMBERS, *_PICTURES, _DEPTH, "str", "list", "vector", "nparray")
_ENDINGS: Final = (".jpg", ".jpeg", ".png", ".bmp")
_PICTURE_NUMBER: Final = re.compile(r"([0-9]{1,12})_")
_RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
_CATALOG_NAME: Final = re.compile(r"catalog_([0-9]{1,9})\.catalog")
_DAMAGED: Final = "that is not valid JSON"

_Fields = dict[str, Any]


class _Line(NamedTuple):
    """The fields of a record, its `_index` or the number of its file, and its time and session."""

    fields: _Fields
    number: int
    time_ns: int | None
    session: str = ""


class _Tub(NamedTuple):
    """The records of a tub that were not deleted, and its declarations."""

    inputs: dict[str, str]
    lines: list[_Line]
    deleted: int
    images: Path
    start_ns: int | None
    is_unix: bool  # Otherwise times begin at 0 with each start of the car.
    stated_hz: float | None


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a tub: its sessions, divided at pauses and where time jumps."""
    tub = (_read_v2 if (folder / _MANIFEST).is_file() else _read_v1)(folder, context)
    if tub.deleted:
        context.note(f"{counted(tub.deleted, 'record')} deleted in the tub, and not imported.")
    columns: dict[str, str] = {}  # The type of each that a record has, declared or by its values.
    for line in tub.lines:
        for name, value in line.fields.items():
            if not name.startswith("_") and name != _V1_TIME and columns.get(name) not in _KNOWN:
                declared = tub.inputs.get(name, "")
                columns[name] = declared if declared in _KNOWN else _kind_of(value)
    camera = _camera(columns, folder, context) if tub.lines else ""
    sensed = [
        name
        for name, kind in (tub.inputs or columns).items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    taken = {camera, _MODE, *sensed, *_USER, *_PILOT}
    if left := [f"{name} ({kind})" for name, kind in columns.items() if name and name not in taken]:
        context.note(f"Columns that are not imported: {', '.join(left)}.")
    records = [_record(line, sensed, camera, context) for line in tub.lines]
    if camera:
        _find_pictures(records, tub.images, context)
    records, size = with_pictures(records, "record", context)
    sessions = {line.number: line.session for line in tub.lines}
    parts = _parts(records, sessions, restarts=not tub.is_unix)
    for part, hz, has_times, timed in stretches(parts, "record", context, tub.stated_hz):
        began_ns = tub.start_ns
        for record in part:
            at_ns = record.step.captured_ns
            record.step = replace(record.step, wall_ns=at_ns if tub.is_unix else None)
        if timed and tub.is_unix:
            began_ns = part[0].step.captured_ns
        session = sessions[part[0].number]
        header = EpisodeHeader(
            action_layout=_ACTIONS.to_json(),
            state_layout=as_json([f for name in sensed for f in features_of(name, 1)]),
            image_size=size,
            control_hz=hz,
            body="car",
            clock="real" if timed else "none",
            source="tub",
            notes={"session": session} if session else {},
            created=iso_time(began_ns) if began_ns and (timed or not has_times) else "",
        )
        name = f"{folder}, from record {part[0].name}"
        yield episode_of(part, header, context, name=name, what="record")


def _kind_of(value: object) -> str:
    kind = _KINDS.get(type(value), "list")
    is_picture = kind == "str" and str(value).lower().endswith(_ENDINGS)
    return _PICTURES[0] if is_picture else kind


def _camera(columns: Mapping[str, str], folder: Path, context: ImportContext) -> str:
    """Return the column of the pictures; "" without pictures."""
    cameras = [name for name, kind in columns.items() if kind in _PICTURES]
    deep = [name for name, kind in columns.items() if kind == _DEPTH]
    if deep and not cameras and not context.camera:
        context.warn(
            f"The steps have no pictures, because those of {few(deep)} have 16 bits, as of depth, "
            "and only pictures of 8 bits can be imported."
        )
    if _IMAGE in cameras and not context.camera:
        return _IMAGE
    camera = choose_camera(folder, cameras, context)
    if camera not in {_IMAGE, context.camera}:
        context.note(f"The pictures come from the column {camera}.")
    return camera


def _record(
    line: _Line, sensed: Sequence[str], camera: str, context: ImportContext
) -> SourceRecord:
    """Return a record; it has a fault if it has no valid action."""
    mode = line.fields.get(_MODE, _PERSON_DRIVES)
    by_person = mode == _PERSON_DRIVES
    names = _USER if by_person else _PILOT
    if mode == _POLICY_STEERS:
        names = [_PILOT[0], _USER[1]]
    action, wanted, fault = _pair(line, names), None, ""
    if lacking := [name for name in names if line.fields.get(name) is None]:
        driver = "" if by_person else ", although a pilot drove"
        fault = f"without {' and '.join(lacking)}{driver}"
    elif action is None:
        fault = f"with {' or '.join(names)} that is not a number from -1 to 1"
    elif by_person:
        wanted = _pair(line, _PILOT)
        if wanted is None and None not in map(line.fields.get, _PILOT):
            reason = "of the pilot that is not a number from -1 to 1, while a person drove"
            context.leave_out("suggestion", reason, line.number)
    step = Step(
        action=action or (0.0, 0.0),
        driver="person" if by_person else "policy",
        wanted=wanted,
        state=tuple(_sensed(line.fields.get(name)) for name in sensed),
        captured_ns=line.time_ns,
    )
    name, frame = str(line.number), line.fields.get(camera)
    return SourceRecord(name=name, number=line.number, step=step, frame=frame, fault=fault)


def _pair(line: _Line, names: Sequence[str]) -> tuple[float, float] | None:
    """Return two numbers from -1 to 1; None for anything else."""
    values: list[Any] = [line.fields.get(name) for name in names]
    if all(type(value) in {int, float} and abs(value) <= 1.0 for value in values):
        return float(values[0]), float(values[1])
    return None


def _sensed(value: Any) -> float:
    """Return a sensor value; NaN for anything that is not a number."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # An integer of hundreds of digits.
        return math.nan


def _find_pictures(records: Sequence[SourceRecord], images: Path, context: ImportContext) -> None:
    """Find the picture of each record by its name, the `frame`; others get a fault."""
    shown = Counter(str(record.frame) for record in records if not record.fault)
    offsets: dict[int, int] = {}
    for record in records:
        name = record.frame
        if record.fault:
            continue
        if not name or not isinstance(name, str):
            record.fault = "without a picture"
            continue
        # Version 1 writes whole paths of the robot for the type "image".
        place = PurePath(name).name if PurePath(name).is_absolute() else name
        record.picture = images / place
        if not is_inside(images, place):
            record.fault = "with a picture name that leaves the folder"
        elif shown[name] > 1 and record.picture.is_file():
            record.fault = "with the picture of another record"
        elif (match := _PICTURE_NUMBER.match(name)) and int(match[1]) != record.number:
            offsets[record.number] = int(match[1]) - record.number
    if offsets:
        context.warn(
            f"{counted(len(offsets), 'record')} with the picture of another number, up to "
            f"{max(map(abs, offsets.values()))} off ({few(list(offsets))}): look whether they "
            "belong together."
        )


def _parts(
    records: Sequence[SourceRecord], sessions: Mapping[int, str], *, restarts: bool
) -> list[list[SourceRecord]]:
    """Return the records of each session, and of each start of the car if times restart with it."""
    parts: list[list[SourceRecord]] = []
    for record in records:
        before = parts[-1][-1] if parts else None
        was_ns, now_ns = before and before.step.captured_ns, record.step.captured_ns
        falls = was_ns is not None and now_ns is not None and now_ns < was_ns
        new = before is None or sessions[before.number] != sessions[record.number]
        if new or (restarts and falls):
            parts.append([])
        parts[-1].append(record)
    return parts


def _numbered(folder: Path, pattern: re.Pattern[str]) -> dict[int, str]:
    """Return the files whose names match, in the order of their numbers."""
    try:
        names = [child.name for child in folder.iterdir()]
    except OSError as error:
        raise cannot_read(folder, error) from error
    return dict(sorted((int(m[1]), m[0]) for m in map(pattern.fullmatch, names) if m))


def _read_v2(folder: Path, context: ImportContext) -> _Tub:
    path = folder / _MANIFEST
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
    _report_missing(records, deleted, catalogs.get("current_index"), context)
    return _Tub(
        inputs=_typed(inputs, types, path),
        lines=[record for record in records if record.number not in deleted],
        deleted=len(deleted & {record.number for record in records}),
        images=folder / _IMAGES,
        start_ns=_in_ns(more.get("created_at"), _NS_PER_S),
        is_unix=True,
        stated_hz=_stated_hz(metadata),
    )


def _read_catalog(path: Path, rows: list[tuple[int, _Fields]], context: ImportContext) -> None:
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


def _with_numbers(rows: Sequence[tuple[int, _Fields]], context: ImportContext) -> list[_Line]:
    """Return records in the order of their `_index`, without those whose number is unclear."""
    has_index = any("_index" in fields for _, fields in rows)
    records: list[_Line] = []
    for position, fields in rows:
        number = fields.get("_index") if has_index else position
        if type(number) is not int:
            context.leave_out("record", "without a valid _index", f"the one at position {position}")
            continue
        session = fields.get("_session_id")
        time_ns = _in_ns(fields.get("_timestamp_ms"), _NS_PER_MS)
        records.append(_Line(fields, number, time_ns, "" if session is None else str(session)))
    falls = [(a.number, b.number) for a, b in pairwise(records) if b.number < a.number]
    if falls:
        context.warn(
            f"The _index falls in {counted(len(falls), 'place')}, first from {falls[0][0]} to "
            f"{falls[0][1]}: the records are read in its order."
        )
    unique: list[_Line] = []
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
    records: Sequence[_Line], deleted: set[int], count: Any, context: ImportContext
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


def _read_v1(folder: Path, context: ImportContext) -> _Tub:
    path, exclude = folder / "meta.json", folder / "exclude.json"
    meta = read_json_object(path) if path.is_file() else {}
    deleted = set[int]()
    if exclude.is_file():
        gone = parse_json(read_text(exclude), str(exclude))
        deleted = set(_list(gone, int, f"numbers in {exclude}"))
    start_ns = _in_ns(meta.get("start"), _NS_PER_S)
    names = _numbered(folder, _RECORD_NAME)
    records: list[_Line] = []
    for number in sorted(names.keys() - deleted):
        if not is_inside(folder, names[number]):
            raise DemosError(f"{folder / names[number]} is a link that leaves the folder.")
        if (fields := _object(read_bytes(folder / names[number]))) is None:
            context.leave_out("record", _DAMAGED, number)
            continue
        time_ns = _in_ns(fields.get(_V1_TIME), _NS_PER_MS)
        time_ns = None if time_ns is None else time_ns + (start_ns or 0)
        records.append(_Line(fields, number, time_ns))
    return _Tub(
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


def _object(line: bytes) -> _Fields | None:
    value = _parsed(line)
    return cast("_Fields", value) if isinstance(value, dict) else None


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


def _stated_hz(metadata: _Fields) -> float | None:
    """Return the rate in the metadata of a tub; None if they do not state it."""
    with suppress(LookupError, TypeError, ValueError, OverflowError):
        hz = float(metadata[_LOOP_HZ])
        return hz if 0.0 < hz < math.inf else None
    return None


def _in_ns(value: Any, unit_ns: int) -> int | None:
    """Return a time as ns; None for anything that cannot be a time."""
    if type(value) not in {int, float}:
        return None
    in_ns = round(value * unit_ns) if abs(value) < _MAX_TIME else _MAX_NS
    return in_ns if abs(in_ns) < _MAX_NS else None


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes as the sessions of one tub of version 2.

    Actions of people, experts and programs become the user's, those of policies the pilot's. Steps
    of a simulated drive get the times of its own clock, since the recorder's tells how fast the
    simulation ran; steps without a time follow the one before at the rate of the episode.
    """
    states = [_state_names(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / _IMAGES).mkdir()
    records: list[_Fields] = []
    sessions: list[str] = []
    for number, episode in enumerate(episodes):
        began = _began(episode.header)
        sessions.append(f"{began:%y-%m-%d}_{number}")
        last_ns: int | None = None
        first_ns: int | None = None
        for step, jpeg in kept_steps(episode.rows):
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no picture: export it to csv.")
            first_ns = step.clock_ns if first_ns is None else first_ns
            last_ns = _time_ns(step, episode.header, began, first_ns, last_ns)
            name = f"{len(records)}_cam_image_array_.jpg"
            (folder / _IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            fields |= {_IMAGE: name, "_session_id": sessions[-1], "_index": len(records)}
            records.append(fields | {"_timestamp_ms": round(last_ns / _NS_PER_MS)})
    created_s = _began(episodes[0].header).timestamp()
    floats = ("user/angle", "user/throttle", "pilot/angle", "pilot/throttle", *states[0])
    inputs = {_IMAGE: "image_array", _MODE: "str"} | dict.fromkeys(floats, "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    rates = {episode.header.control_hz for episode in episodes}
    catalogs: _Fields = {"paths": _write_catalogs(folder, records, created_s)}
    catalogs |= {"current_index": len(records), "max_len": _CATALOG_LENGTH, "deleted_indexes": []}
    metadata = {_LOOP_HZ: f"{rates.pop():g}"} if len(rates) == 1 else {}
    more = {"created_at": created_s, "sessions": named}
    lines = (list(inputs), list(inputs.values()), metadata, more, catalogs)
    _write_lines(folder / _MANIFEST, [json.dumps(line) for line in lines])
    return len(records)


def _state_names(episode: ExchangeEpisode) -> tuple[str, ...]:
    """Return the names of the values of the state."""
    names = Layout.from_json(episode.header.action_layout).names
    if names != _ACTIONS.names:
        raise DemosError(
            f"The actions of {episode.name} are {', '.join(names)}, but those of a tub are "
            f"{', '.join(_ACTIONS.names)}: export it to minari or csv."
        )
    if not episode.header.state_layout:
        return ()
    state = Layout.from_json(episode.header.state_layout)
    if state.size != len(state):
        raise DemosError(f"The state of {episode.name} has array features: export it to csv.")
    return state.names


def _fields(step: Step, state: Sequence[str], where: str) -> _Fields:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    fields: _Fields = {_MODE: _POLICY_DRIVES if by_policy else _PERSON_DRIVES}
    # A tub always contains the user's action; while a policy drives, it is 0.
    user = (0.0, 0.0) if by_policy else step.action
    fields |= {f"user/{axis}": value for axis, value in zip(_AXES, user, strict=True)}
    pilot = step.action if by_policy else step.wanted
    if pilot is not None and all(abs(value) <= 1.0 for value in pilot):
        fields |= {f"pilot/{axis}": value for axis, value in zip(_AXES, pilot, strict=True)}
    known = zip(state, step.state, strict=True)
    return fields | {name: value for name, value in known if math.isfinite(value)}


def _time_ns(
    step: Step, header: EpisodeHeader, began: datetime, first_ns: int | None, last_ns: int | None
) -> int:
    """Return the Unix time of a step, ns, after the one before."""
    began_ns = round(began.timestamp() * _NS_PER_S)
    at_ns = step.wall_ns
    if header.clock == "twin" or (header.clock == "none" and header.env):  # Simulated.
        clock_ns = step.clock_ns
        at_ns = None if clock_ns is None else began_ns + clock_ns - cast("int", first_ns)
    if at_ns is None or (last_ns is not None and at_ns <= last_ns):
        return began_ns if last_ns is None else last_ns + round(_NS_PER_S / header.control_hz)
    return at_ns


def _began(header: EpisodeHeader) -> datetime:
    """Return when an episode began; the Unix epoch if unknown."""
    try:
        return datetime.fromisoformat(header.created)
    except ValueError:
        return datetime.fromtimestamp(0.0, UTC)


def _write_catalogs(folder: Path, records: Sequence[_Fields], created_s: float) -> list[str]:
    """Write the catalogs, each with its manifest; return the names of the catalogs."""
    paths: list[str] = []
    for number, start in enumerate(range(0, len(records), _CATALOG_LENGTH)):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) for record in part]
        name = f"catalog_{number}.catalog"
        paths.append(name)
        _write_lines(folder / name, lines)
        kept: _Fields = {"created_at": created_s, "path": f"{name}_manifest", "start_index": start}
        kept["line_lengths"] = [len(line) + 1 for line in lines]
        _write_lines(folder / f"{name}_manifest", [json.dumps(kept, sort_keys=True)])
    return paths


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


FORMAT: Final = Format(
    name="tub",
    title="Donkeycar",
    sign=f"{_MANIFEST} or record_0.json",
    detect=lambda path: (path / _MANIFEST).is_file() or bool(_numbered(path, _RECORD_NAME)),
    read=_read,
    write=_write,
    options=frozenset({"camera", "hz"}),
)
