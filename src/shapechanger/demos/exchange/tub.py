"""Donkeycar tubs: import of versions 1 and 2, export of version 2.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, as in
Shapechanger. In the `user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In
the other modes `pilot/...` drives, except that in "local_angle" the throttle is the person's.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path, PurePath
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.columns import COMMANDS, name_in
from shapechanger.demos.exchange.files import UNIT_UNKNOWN, is_inside
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    Format,
    ImportContext,
    counted,
    few,
    kept_steps,
)
from shapechanger.demos.exchange.pictures import check_pictures, read_picture
from shapechanger.demos.exchange.times import TimedDrive, choose_rates, iso_time, split_at_jumps
from shapechanger.demos.exchange.tub_files import (
    IMAGES,
    LOOP_HZ,
    MANIFEST,
    NS_PER_MS,
    NS_PER_S,
    V1_TIME,
    Tub,
    TubRecord,
    is_tub,
    read_files,
)
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

_ACTIONS: Final = Layout((COMMANDS["steering"], COMMANDS["throttle"]))
_AXES: Final = ("angle", "throttle")
_IMAGE: Final = name_in("tub", "frame")
_MODE: Final = name_in("tub", "driver")
_PERSON_DRIVES: Final = "user"
_POLICY_DRIVES: Final = "local"
_POLICY_STEERS: Final = "local_angle"
_CATALOG_LENGTH: Final = 1000  # Records, as in Donkeycar.
_NUMBERS: Final = ("float", "int", "boolean")
_PICTURES: Final = ("image_array", "image")
_DEPTH: Final = "gray16_array"
_KNOWN: Final = (*_NUMBERS, *_PICTURES, _DEPTH, "str", "list", "vector", "nparray")
_ENDINGS: Final = (".jpg", ".jpeg", ".png", ".bmp")
_PICTURE_NUMBER: Final = re.compile(r"([0-9]{1,12})_")


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a tub: its sessions, divided at pauses and where time jumps."""
    tub = read_files(folder, context)
    if not tub.records:
        return
    columns = _columns(tub)
    camera = _camera(columns, folder, context)
    state = _state_layout(tub.inputs or columns)
    _note_other_columns(columns, camera, state, context)
    records, size = [record for r in tub.records if (record := _driven(r, state, context))], None
    if camera:
        records, size = _with_pictures(records, tub.images, camera, context)
    if not records:
        return
    parts = list(_drives(records, restarts=not tub.is_unix))
    times = [_times_ns(part, context) for part in parts]
    names = [[str(record.number) for record in part] for part in parts]
    drives = [
        TimedDrive(known, [record.number for record in part], f"record {part[0].number}")
        for part, known in zip(parts, times, strict=True)
    ]
    rates, believed = choose_rates(drives, context, tub.stated_hz)
    if not believed:
        drives = [replace(drive, times_ns=()) for drive in drives]
    places = split_at_jumps(drives, names, rates, context)
    for part, known, hz, split in zip(parts, times, rates, places, strict=True):
        timed = bool(known) and believed
        for place in split:
            began_ns = known[place][0] if timed and tub.is_unix else tub.start_ns
            header = EpisodeHeader(
                action_layout=_ACTIONS.to_json(),
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


def _columns(tub: Tub) -> dict[str, str]:
    """Return the type of each column that a record has, declared or by its values."""
    columns: dict[str, str] = {}
    for record in tub.records:
        for name, value in record.fields.items():
            if name.startswith("_") or name == V1_TIME or columns.get(name) in _KNOWN:
                continue
            declared, found = tub.inputs.get(name, ""), _kind_of(value)
            columns[name] = declared if declared in _KNOWN else found
    return columns


def _kind_of(value: Any) -> str:
    match value:
        case bool():
            return "boolean"
        case int() | float():
            return "float"
        case str():
            return _PICTURES[0] if value.lower().endswith(_ENDINGS) else "str"
        case _:
            return "list"


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
    if len(cameras) > 1 and _IMAGE not in cameras:
        raise DemosError(
            f"{folder} has {len(cameras)} cameras ({', '.join(cameras)}), but an episode has one: "
            f"choose with --camera, such as --camera {cameras[0]}."
        )
    if len(cameras) == 1 and cameras[0] != _IMAGE:
        context.note(f"The pictures are those of the column {cameras[0]}.")
    return _IMAGE if _IMAGE in cameras else "".join(cameras)


def _note_other_columns(
    columns: Mapping[str, str], camera: str, state: Layout | None, context: ImportContext
) -> None:
    taken = {camera, _MODE, *(state.names if state else ())}
    taken |= {f"{actor}/{axis}" for actor in ("user", "pilot") for axis in _AXES}
    left = [f"{name} ({kind})" for name, kind in columns.items() if name and name not in taken]
    if left:
        context.note(f"Columns that are not imported: {', '.join(left)}.")


def _state_layout(inputs: Mapping[str, str]) -> Layout | None:
    """Return the layout of the state in a tub with these inputs, by type; None without a state."""
    names = [
        name
        for name, kind in inputs.items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    return Layout(tuple(Feature(name, UNIT_UNKNOWN) for name in names)) if names else None


def _driven(record: TubRecord, state: Layout | None, context: ImportContext) -> TubRecord | None:
    """Return a record with its step; None, with a finding, if it has no valid action."""
    mode = record.fields.get(_MODE, _PERSON_DRIVES)
    by_person = mode == _PERSON_DRIVES
    actors = ("user" if by_person else "pilot",) * 2
    if mode == _POLICY_STEERS:
        actors = ("pilot", "user")
    names = [f"{actor}/{axis}" for actor, axis in zip(actors, _AXES, strict=True)]
    lacking = [name for name in names if record.fields.get(name) is None]
    action = _pair(record, names)
    if lacking or action is None:
        reason = f"with {' or '.join(names)} that is not a number from -1 to 1"
        if lacking:
            driver = "" if by_person else ", although a pilot drove"
            reason = f"without {' and '.join(lacking)}{driver}"
        context.leave_out("record", reason, record.number)
        return None
    wanted, suggested = None, [f"pilot/{axis}" for axis in _AXES]
    if by_person:
        wanted = _pair(record, suggested)
        if wanted is None and None not in map(record.fields.get, suggested):
            reason = "of the pilot that is not a number from -1 to 1, while a person drove"
            context.leave_out("suggestion", reason, record.number)
    driver = "person" if by_person else "policy"
    sensed = tuple(_sensed(record.fields.get(name)) for name in state.names) if state else ()
    return replace(record, step=Step(action=action, driver=driver, wanted=wanted, state=sensed))


def _pair(record: TubRecord, names: Sequence[str]) -> tuple[float, float] | None:
    """Return two numbers from -1 to 1; None for anything else."""
    values = [record.fields.get(name) for name in names]
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1.0:
            return None
    return float(cast("float", values[0])), float(cast("float", values[1]))


def _sensed(value: Any) -> float:
    """Return a sensor value; NaN for anything that is not a number."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # An integer of hundreds of digits.
        return math.nan


def _with_pictures(
    records: Sequence[TubRecord], images: Path, camera: str, context: ImportContext
) -> tuple[list[TubRecord], tuple[int, int] | None]:
    """Return the records whose pictures can be imported, and the size of these."""
    shown = Counter(str(record.fields.get(camera)) for record in records)
    found: list[TubRecord] = []
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
            found.append(replace(record, path=images / place))
            if (match := _PICTURE_NUMBER.match(name)) and int(match[1]) != number:
                offsets[number] = int(match[1]) - number
    if offsets:
        context.warn(
            f"{counted(len(offsets), 'record')} with the picture of another number, up to "
            f"{max(map(abs, offsets.values()))} off ({few(list(offsets))}): look whether they "
            "belong together."
        )
    paths = [record.path for record in found if record.path is not None]
    good, size = check_pictures(paths, [str(record.number) for record in found], "record", context)
    return [record for record, is_good in zip(found, good, strict=True) if is_good], size


def _drives(records: Sequence[TubRecord], *, restarts: bool) -> Iterator[list[TubRecord]]:
    """Yield the records of each session, and of each start of the car if times restart with it."""
    for _, session in groupby(records, key=lambda record: record.session):
        drive: list[TubRecord] = []
        for record in session:
            before_ns = drive[-1].time_ns if drive else None
            now_ns = record.time_ns
            if restarts and now_ns is not None and before_ns is not None and now_ns < before_ns:
                yield drive
                drive = []
            drive.append(record)
        yield drive


def _times_ns(drive: Sequence[TubRecord], context: ImportContext) -> list[int]:
    """Return the time of each record, ns; an empty list if one is unknown."""
    times = [record.time_ns for record in drive if record.time_ns is not None]
    if 0 < len(times) < len(drive):
        context.warn(
            f"{len(drive) - len(times)} of the {len(drive)} records from {drive[0].number} have no "
            "valid time: the times of the others are left out."
        )
    return times if len(times) == len(drive) else []


def _steps(records: Sequence[TubRecord], *, timed: bool, is_unix: bool) -> Iterator[ExchangeStep]:
    for record in records:
        at_ns = record.time_ns if timed else None
        step = replace(
            cast("Step", record.step), captured_ns=at_ns, wall_ns=at_ns if is_unix else None
        )
        jpeg = None if record.path is None else read_picture(record.path)[0]
        yield ExchangeStep(step=step, jpeg=jpeg)


def _write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes as the sessions of one tub of version 2.

    Actions of people, experts and programs become the user's, those of policies the pilot's. Steps
    of a simulated drive get the times of its own clock, since the recorder's tells how fast the
    simulation ran; steps without a time follow the one before at the rate of the episode.
    """
    states = [_state_names(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / IMAGES).mkdir()
    records: list[dict[str, Any]] = []
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
            (folder / IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            fields |= {_IMAGE: name, "_session_id": sessions[-1], "_index": len(records)}
            records.append(fields | {"_timestamp_ms": round(last_ns / NS_PER_MS)})
    created_s = _began(episodes[0].header).timestamp()
    inputs = {_IMAGE: "image_array", "user/angle": "float", "user/throttle": "float", _MODE: "str"}
    inputs |= {"pilot/angle": "float", "pilot/throttle": "float"}
    inputs |= dict.fromkeys(states[0], "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    rates = {episode.header.control_hz for episode in episodes}
    catalogs = {
        "paths": _write_catalogs(folder, records, created_s),
        "current_index": len(records),
        "max_len": _CATALOG_LENGTH,
        "deleted_indexes": [],
    }
    lines: tuple[object, ...] = (
        list(inputs),
        list(inputs.values()),
        {LOOP_HZ: f"{rates.pop():g}"} if len(rates) == 1 else {},
        {"created_at": created_s, "sessions": named},
        catalogs,
    )
    _write_lines(folder / MANIFEST, [json.dumps(line) for line in lines])
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


def _fields(step: Step, state: Sequence[str], where: str) -> dict[str, Any]:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    fields: dict[str, Any] = {_MODE: _POLICY_DRIVES if by_policy else _PERSON_DRIVES}
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
    began_ns = round(began.timestamp() * NS_PER_S)
    at_ns = step.wall_ns
    if header.clock == "twin" or (header.clock == "none" and header.env):  # Simulated.
        clock_ns = step.clock_ns
        at_ns = None if clock_ns is None else began_ns + clock_ns - cast("int", first_ns)
    if at_ns is None or (last_ns is not None and at_ns <= last_ns):
        return began_ns if last_ns is None else last_ns + round(NS_PER_S / header.control_hz)
    return at_ns


def _began(header: EpisodeHeader) -> datetime:
    """Return when an episode began; the Unix epoch if unknown."""
    try:
        return datetime.fromisoformat(header.created)
    except ValueError:
        return datetime.fromtimestamp(0.0, UTC)


def _write_catalogs(folder: Path, records: Sequence[dict[str, Any]], created_s: float) -> list[str]:
    """Write the catalogs, each with its manifest; return the names of the catalogs."""
    paths: list[str] = []
    for number, start in enumerate(range(0, len(records), _CATALOG_LENGTH)):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) for record in part]
        paths.append(f"catalog_{number}.catalog")
        _write_lines(folder / paths[-1], lines)
        beside = f"{paths[-1]}_manifest"
        kept: dict[str, Any] = {"created_at": created_s, "path": beside, "start_index": start}
        kept["line_lengths"] = [len(line) + 1 for line in lines]
        _write_lines(folder / beside, [json.dumps(kept, sort_keys=True)])
    return paths


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


FORMAT: Final = Format(
    name="tub",
    title="Donkeycar",
    sign=f"{MANIFEST} or record_0.json",
    detect=is_tub,
    read=_read,
    write=_write,
    options=frozenset({"camera", "hz"}),
)
