"""Donkeycar tubs: import of versions 1 and 2, export of version 2.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, as in
Shapechanger. In the `user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In
the other modes `pilot/...` drives, except that in "local_angle" the throttle is the person's.

Version 2 is a folder with `manifest.json` (five lines of JSON: inputs, types, metadata, more
metadata, and an object with the catalogs), catalogs with a record per line, and `images/`. Deleted
indexes are values of the records' `_index`; `_timestamp_ms` is Unix time, and `_session_id` names
the start of the car. Version 1 has a file `record_N.json` per record, its image next to it,
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
from itertools import chain
from pathlib import Path, PurePath
from typing import Any, Final

from msgspec.structs import replace

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import files, imports
from shapechanger.demos.exchange.format import (
    COMMANDS,
    ExchangeEpisode,
    ExportContext,
    Format,
    ImportContext,
    counted,
    few,
    kept_steps,
    name_in,
)
from shapechanger.demos.exchange.imports import SourceRecord
from shapechanger.demos.exchange.tub_records import (
    IMAGES,
    LOOP_HZ,
    MANIFEST,
    NS_PER_MS,
    NS_PER_S,
    RECORD_NAME,
    Fields,
    in_ns,
    numbered,
    read_v1,
    read_v2,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

_PICTURE_NUMBER: Final = re.compile(r"([0-9]{1,12})_")
_ACTIONS: Final = Layout((COMMANDS["steering"], COMMANDS["throttle"]))
_USER, _PILOT = ([f"{who}/{axis}" for axis in ("angle", "throttle")] for who in ("user", "pilot"))
_IMAGE, _MODE = name_in("tub", "frame"), name_in("tub", "driver")
_PERSON_DRIVES: Final = "user"
_CATALOG_LENGTH: Final = 1000  # Records, as in Donkeycar.
_NUMBERS: Final = ("float", "int", "boolean")
_KINDS: Final[dict[type[object], str]] = {str: "str", bool: "boolean", int: "float", float: "float"}
_PICTURES: Final = ("image_array", "image")
_DEPTH: Final = "gray16_array"
_KNOWN: Final = (*_NUMBERS, *_PICTURES, _DEPTH, "str", "list", "vector", "nparray")
_ENDINGS: Final = (".jpg", ".jpeg", ".png", ".bmp")


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a tub: its sessions, divided at pauses and where time jumps."""
    tub = (read_v2 if (folder / MANIFEST).is_file() else read_v1)(folder, context)
    if tub.deleted:
        context.note(f"{counted(tub.deleted, 'record')} deleted in the tub, and not imported.")
    columns: dict[str, str] = {}  # The type of each that a record has, declared or by its values.
    for name, value in chain.from_iterable(fields.items() for fields in tub.records):
        if not name.startswith("_") and columns.get(name) not in _KNOWN:
            declared = tub.inputs.get(name, "")
            columns[name] = declared if declared in _KNOWN else _kind_of(value)
    camera = _camera(columns, folder, context) if tub.records else ""
    sensed = [
        name
        for name, kind in (tub.inputs or columns).items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    taken = {"", camera, _MODE, *sensed, *_USER, *_PILOT}
    if left := [f"{name} ({kind})" for name, kind in columns.items() if name not in taken]:
        context.note(f"Columns that are not imported: {', '.join(left)}.")
    records = [_record(fields, sensed, camera, context) for fields in tub.records]
    if camera:
        _find_pictures(records, tub.images, context)
    records, size = imports.with_pictures(records, "record", context)
    sessions = {fields["_index"]: str(fields.get("_session_id", "")) for fields in tub.records}
    parts = _parts(records, sessions, restarts=not tub.is_unix)
    states = [feature for name in sensed for feature in imports.features_of(name, 1)]
    for part, hz, timed in imports.stretches(parts, "record", context, tub.stated_hz):
        began_ns = part[0].step.captured_ns if timed and tub.is_unix else tub.start_ns
        for record in part:
            wall_ns = record.step.captured_ns if tub.is_unix else None
            record.step = replace(record.step, wall_ns=wall_ns)
        session = sessions[part[0].number]
        header = EpisodeHeader(
            action_layout=_ACTIONS.to_json(),
            state_layout=imports.as_json(states),
            image_size=size,
            control_hz=hz,
            body="car",
            clock="real" if timed else "none",
            source="tub",
            notes={"session": session} if session else {},
            created=_iso_time(began_ns) if began_ns else "",
        )
        name = f"{folder}, from record {part[0].name}"
        rows = imports.rows_of(part, size, context, "record")
        yield ExchangeEpisode(header=header, rows=rows, name=name)


def _kind_of(value: object) -> str:
    kind = _KINDS.get(type(value), "list")
    is_picture = kind == "str" and str(value).lower().endswith(_ENDINGS)
    return _PICTURES[0] if is_picture else kind


def _iso_time(unix_ns: int) -> str:
    """Return a Unix time as ISO 8601 in UTC; "" if it is beyond the calendar."""
    with suppress(OverflowError, ValueError, OSError):
        return datetime.fromtimestamp(unix_ns / NS_PER_S, UTC).isoformat(timespec="milliseconds")
    return ""


def _camera(columns: Mapping[str, str], folder: Path, context: ImportContext) -> str:
    """Return the column of the images; "" without images."""
    cameras = [name for name, kind in columns.items() if kind in _PICTURES]
    deep = [name for name, kind in columns.items() if kind == _DEPTH]
    if deep and not cameras and not context.camera:
        context.warn(
            f"The steps have no images, because those of {few(deep)} have 16 bits, as of depth, "
            "and only images of 8 bits can be imported."
        )
    if _IMAGE in cameras and not context.camera:
        return _IMAGE
    camera = imports.choose_camera(folder, cameras, context)
    if camera not in {_IMAGE, context.camera}:
        context.note(f"The images come from the column {camera}.")
    return camera


def _record(
    fields: Fields, sensed: Sequence[str], camera: str, context: ImportContext
) -> SourceRecord:
    """Return a record; it has a fault if it has no valid action."""
    mode = fields.get(_MODE, _PERSON_DRIVES)
    by_person = mode == _PERSON_DRIVES
    names = _USER if by_person else _PILOT
    if mode == "local_angle":
        names = [_PILOT[0], _USER[1]]
    action, wanted, fault = _pair(fields, names), None, ""
    if lacking := [name for name in names if fields.get(name) is None]:
        driver = "" if by_person else ", although a pilot drove"
        fault = f"without {' and '.join(lacking)}{driver}"
    elif action is None:
        fault = f"with {' or '.join(names)} that is not a number from -1 to 1"
    elif by_person:
        wanted = _pair(fields, _PILOT)
        if wanted is None and None not in map(fields.get, _PILOT):
            reason = "of the pilot that is not a number from -1 to 1, while a person drove"
            context.leave_out("suggestion", reason, fields["_index"])
    step = Step(
        action=action or (0.0, 0.0),
        driver="person" if by_person else "policy",
        wanted=wanted,
        state=tuple(_sensed(fields.get(name)) for name in sensed),
        captured_ns=in_ns(fields.get("_timestamp_ms"), NS_PER_MS),
    )
    number, frame = fields["_index"], fields.get(camera)
    return SourceRecord(name=str(number), number=number, step=step, frame=frame, fault=fault)


def _pair(fields: Fields, names: Sequence[str]) -> tuple[float, float] | None:
    """Return two numbers from -1 to 1; None for anything else."""
    values: list[Any] = [fields.get(name) for name in names]
    if all(type(value) in {int, float} and abs(value) <= 1.0 for value in values):
        return float(values[0]), float(values[1])
    return None


def _sensed(value: Any) -> float:
    """Return a sensor value; NaN for anything that is not a number."""
    with suppress(OverflowError):  # An integer of hundreds of digits.
        return float(value) if isinstance(value, bool | int | float) else math.nan
    return math.nan


def _find_pictures(records: Sequence[SourceRecord], images: Path, context: ImportContext) -> None:
    """Find the image of each record by its name, the `frame`; others get a fault."""
    shown = Counter(str(record.frame) for record in records if not record.fault)
    offsets: dict[int, int] = {}
    for record in records:
        name = record.frame
        if record.fault:
            continue
        if not name or not isinstance(name, str):
            record.fault = "without an image"
            continue
        # Version 1 writes whole paths of the robot for the type "image".
        place = PurePath(name).name if PurePath(name).is_absolute() else name
        record.picture = images / place
        if not files.is_inside(images, place):
            record.fault = "with an image name that leaves the folder"
        elif shown[name] > 1 and record.picture.is_file():
            record.fault = "with the image of another record"
        elif (match := _PICTURE_NUMBER.match(name)) and int(match[1]) != record.number:
            offsets[record.number] = int(match[1]) - record.number
    if offsets:
        context.warn(
            f"{counted(len(offsets), 'record')} with the image of another number, up to "
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


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes as the sessions of one tub of version 2.

    Actions of people, experts and programs become the user's, those of policies the pilot's.
    """
    states = [_state_names(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / IMAGES).mkdir()
    records: list[Fields] = []
    began = [_began(episode.header) for episode in episodes]
    sessions = [f"{at:%y-%m-%d}_{number}" for number, at in enumerate(began)]
    for episode, at, session in zip(episodes, began, sessions, strict=True):
        for step, jpeg, time_ns in _timed(episode, round(at.timestamp() * NS_PER_S)):
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no image: export it to csv.")
            name = f"{len(records)}_cam_image_array_.jpg"
            (folder / IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            fields |= {_IMAGE: name, "_session_id": session, "_index": len(records)}
            records.append(fields | {"_timestamp_ms": round(time_ns / NS_PER_MS)})
    created_s = began[0].timestamp()
    inputs = {_IMAGE: "image_array", _MODE: "str"}
    inputs |= dict.fromkeys((*_USER, *_PILOT, *states[0]), "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    rates = {episode.header.control_hz for episode in episodes}
    catalogs: Fields = {"paths": _write_catalogs(folder, records, created_s)}
    catalogs |= {"current_index": len(records), "max_len": _CATALOG_LENGTH, "deleted_indexes": []}
    metadata = {LOOP_HZ: f"{rates.pop():g}"} if len(rates) == 1 else {}
    more = {"created_at": created_s, "sessions": named}
    lines = (list(inputs), list(inputs.values()), metadata, more, catalogs)
    _write_lines(folder / MANIFEST, [json.dumps(line) for line in lines])
    return len(records)


def _state_names(episode: ExchangeEpisode) -> tuple[str, ...]:
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


def _fields(step: Step, state: Sequence[str], where: str) -> Fields:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    # A tub always contains the user's action; while a policy drives, it is 0.
    user, pilot = ((0.0, 0.0), step.action) if by_policy else (step.action, step.wanted)
    fields: Fields = {_MODE: "local" if by_policy else _PERSON_DRIVES}
    fields |= dict(zip(_USER, user, strict=True))
    if pilot is not None and all(abs(value) <= 1.0 for value in pilot):
        fields |= dict(zip(_PILOT, pilot, strict=True))
    known = zip(state, step.state, strict=True)
    return fields | {name: value for name, value in known if math.isfinite(value)}


def _timed(episode: ExchangeEpisode, began_ns: int) -> Iterator[tuple[Step, bytes | None, int]]:
    """Yield the steps with their images and Unix times, ns, each after the one before.

    Steps of a simulated drive get the times of its own clock, since the recorder's tells how fast
    the simulation ran; steps without a time follow the one before at the rate of the episode.
    """
    header = episode.header
    is_simulated = header.clock == "twin" or (header.clock == "none" and header.env)
    first_ns: int | None = None
    last_ns: int | None = None
    for step, jpeg in kept_steps(episode.rows):
        at_ns, clock_ns = step.wall_ns, step.clock_ns
        first_ns = clock_ns if first_ns is None else first_ns
        if is_simulated:
            at_ns = None if clock_ns is None else began_ns + clock_ns - (first_ns or 0)
        if at_ns is None or (last_ns is not None and at_ns <= last_ns):
            at_ns = began_ns if last_ns is None else last_ns + round(NS_PER_S / header.control_hz)
        last_ns = at_ns
        yield step, jpeg, at_ns


def _began(header: EpisodeHeader) -> datetime:
    try:
        return datetime.fromisoformat(header.created)
    except ValueError:
        return datetime.fromtimestamp(0.0, UTC)


def _write_catalogs(folder: Path, records: Sequence[Fields], created_s: float) -> list[str]:
    """Write the catalogs, each with its manifest; return the names of the catalogs."""
    paths: list[str] = []
    for number, start in enumerate(range(0, len(records), _CATALOG_LENGTH)):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) for record in part]
        name = f"catalog_{number}.catalog"
        paths.append(name)
        _write_lines(folder / name, lines)
        kept: Fields = {"created_at": created_s, "path": f"{name}_manifest", "start_index": start}
        kept["line_lengths"] = [len(line) + 1 for line in lines]
        _write_lines(folder / f"{name}_manifest", [json.dumps(kept, sort_keys=True)])
    return paths


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


FORMAT: Final = Format(
    name="tub",
    title="Donkeycar",
    sign=f"{MANIFEST} or record_0.json",
    detect=lambda path: (path / MANIFEST).is_file() or bool(numbered(path, RECORD_NAME)),
    read=_read,
    write=_write,
    options=frozenset({"camera", "hz"}),
)
