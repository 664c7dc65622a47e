"""Donkeycar's tubs: the records of a drive, with their pictures.

Version 2 is a folder with `manifest.json`, catalogs and `images/`. The manifest has five lines of
JSON: inputs, types, metadata, more metadata, and an object with `paths` (the catalogs in order),
`current_index`, `max_len` and `deleted_indexes`, which counts records over all catalogs. A catalog
has one JSON object a line; `_timestamp_ms` is Unix time, `_session_id` says which start of the car
it belongs to, and `cam/image_array` names a file in `images/`. Version 1 has a file
`record_N.json` for each record, its picture beside it, perhaps `milliseconds` since the start, and
`meta.json` with inputs, types and perhaps the Unix time of the start.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py (`Manifest`,
`ManifestIterator`, `Tub.write_record`) for version 2, parts/datastore.py for version 1, read at
the commits 1e831b81, 38a1c2db and b253cef6.

`user/angle` is -1 at the left and 1 at the right, `user/throttle` 1 forward: as here. In the
`user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In the other modes
`pilot/...` drives, except that in "local_angle" the throttle is the person's. Other inputs of the
types float, int and boolean become the state; a tub does not say in which unit.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.pictures import Pictures, size_of
from shapechanger.demos.exchange.places import cannot_read, inside, read_text
from shapechanger.demos.exchange.recorded import (
    ExchangeStep,
    Recorded,
    one_rate,
    rate_hz,
    require_order,
    seen,
    split_at_gaps,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

__all__ = [
    "ANGLE",
    "IMAGE",
    "IMAGES",
    "MANIFEST",
    "MODE",
    "RECORD_NAME",
    "THROTTLE",
    "TUB_ACTIONS",
    "USER",
    "TubRecord",
    "read_tub",
    "read_v1",
    "read_v2",
    "state_layout",
    "step_of",
    "write_tub",
]

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
class TubRecord:
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


def read_v2(folder: Path) -> tuple[dict[str, str], list[TubRecord]]:
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
    records: list[TubRecord] = []
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


def read_v1(folder: Path) -> tuple[dict[str, str], list[TubRecord]]:
    """The same for a tub of version 1."""
    try:
        found = [(m, path) for path in folder.iterdir() if (m := RECORD_NAME.fullmatch(path.name))]
    except OSError as error:
        raise cannot_read(folder, error) from error
    meta: dict[str, Any] = {}
    if (folder / META).is_file():
        meta = _object(read_text(folder / META), str(folder / META))
    start = _number(meta.get("start"))
    records: list[TubRecord] = []
    for _, path in sorted(found, key=lambda pair: int(pair[0][1])):
        where = str(path)
        fields = _object(read_text(inside(folder, path.name, where)), where)
        time_ms = _number(fields.get("milliseconds"))
        since_ns = None if start is None else round(start * _NS_PER_S)
        time_ns = None if time_ms is None else round(time_ms * _NS_PER_MS) + (since_ns or 0)
        records.append(TubRecord(fields, where, time_ns, is_unix=since_ns is not None))
    return _typed(meta.get("inputs", []), meta.get("types", []), folder / META), records


def _record_v2(fields: dict[str, Any], where: str) -> TubRecord:
    time_ms = _number(fields.get("_timestamp_ms"))
    time_ns = None if time_ms is None else round(time_ms) * round(_NS_PER_MS)
    session = fields.get("_session_id")
    return TubRecord(fields, where, time_ns, session="" if session is None else str(session))


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


IMAGE: Final = "cam/image_array"
MODE: Final = "user/mode"
ANGLE: Final = "angle"
THROTTLE: Final = "throttle"
USER: Final = "user"
"""The mode in which a person drives."""

TUB_ACTIONS: Final = Layout(
    (Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0))
)
"""What the numbers of an action mean."""

_ANGLE_BY_PILOT: Final = "local_angle"
_NUMBERS: Final = ("float", "int", "boolean")
_UNIT_UNKNOWN: Final = "?"


def state_layout(inputs: Mapping[str, str]) -> Layout | None:
    """The state in a tub with these inputs, by type; None where there is none."""
    names = [
        name
        for name, kind in inputs.items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    return Layout(tuple(Feature(name, _UNIT_UNKNOWN) for name in names)) if names else None


def step_of(record: TubRecord, state: Layout | None) -> Step:
    """A record as a step.

    Raises:
        DemosError: If it does not say how the car was driven.
    """
    user = _pair(record, "user")
    if user is None:
        raise DemosError(f"{record.where} has no user/angle and user/throttle.")
    pilot = _pair(record, "pilot")
    mode = record.fields.get(MODE, USER)
    action = user
    if mode != USER and pilot is not None:
        action = (pilot[0], user[1]) if mode == _ANGLE_BY_PILOT else pilot
    return Step(
        action=action,
        driver="person" if mode == USER else "policy",
        wanted=pilot if mode == USER else None,
        state=tuple(_sensed(record.fields.get(name)) for name in state.names) if state else (),
        wall_ns=record.time_ns if record.is_unix else None,
    )


def _pair(record: TubRecord, who: str) -> tuple[float, float] | None:
    """Angle and throttle; None where one of them is missing."""
    values = [record.fields.get(f"{who}/{what}") for what in (ANGLE, THROTTLE)]
    if None in values:
        return None
    for what, value in zip((ANGLE, THROTTLE), values, strict=True):
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1.0:
            raise DemosError(
                f"{record.where}: {who}/{what} is {value!r}, and it is a number from -1 to 1: mend "
                "or delete the record."
            )
    return float(values[0]), float(values[1])  # pyright: ignore[reportArgumentType]


def _sensed(value: Any) -> float:
    """A number that a sensor gave; NaN for none."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # A whole number of hundreds of digits.
        return math.nan


# A drive of a few records says nothing about its rate.
_LONG_ENOUGH = 10


def read_tub(folder: Path) -> Iterator[Recorded]:
    """The episodes of a tub: its sessions, or its drives where it has no sessions.

    Records that are marked as deleted are left out.

    Raises:
        DemosError: If the tub is not whole; the sentence says what to do.
    """
    newer = (folder / MANIFEST).is_file()
    inputs, records = (read_v2 if newer else read_v1)(folder)
    images = folder / IMAGES if newer else folder
    if not records:
        raise DemosError(f"The tub {folder} has no records that are not deleted.")
    state = state_layout(inputs)
    size = _size(images, records[0])
    drives = list(_drives(records, in_order=newer))
    rates = [rate_hz(_times_ns(drive)) for drive in drives]
    long = [n for n, drive in enumerate(drives) if len(_times_ns(drive)) >= _LONG_ENOUGH]
    one_rate(
        [rates[n] for n in long],
        [f"The drive from {drives[n][0].where}" for n in long],
        "put the records of each rate into a tub of their own",
    )
    pictures = Pictures(size)
    for drive, hz in zip(drives, rates, strict=True):
        session = drive[0].session
        header = EpisodeHeader(
            action_layout=TUB_ACTIONS.to_json(),
            state_layout="" if state is None else state.to_json(),
            image_size=size,
            control_hz=hz,
            body="car",
            clock="none",
            source="tub",
            notes={"session": session} if session else {},
        )
        yield Recorded(
            header=header, rows=_rows(images, drive, state, pictures), name=drive[0].where
        )


def _rows(
    images: Path, drive: Sequence[TubRecord], state: Layout | None, pictures: Pictures
) -> Iterator[ExchangeStep]:
    pictured = IMAGE in drive[0].fields
    for record in drive:
        name = record.fields.get(IMAGE)
        if (name is not None) != pictured:
            raise DemosError(
                f"{record.where} has {'no' if pictured else 'a'} picture ({IMAGE}), and "
                f"{drive[0].where} has {'one' if pictured else 'none'}: delete the records "
                "without one."
            )
        jpeg = pictures.read(inside(images, str(name), record.where)) if pictured else None
        yield ExchangeStep(step=step_of(record, state), jpeg=jpeg)


def _drives(records: Sequence[TubRecord], *, in_order: bool) -> Iterator[Sequence[TubRecord]]:
    """The records of each episode.

    Args:
        records: All of them, in order.
        in_order: Whether the time must not run backwards. The milliseconds of version 1 begin anew
            with each start of the car, which is a new drive then.
    """
    for session, group in groupby(records, key=lambda record: record.session):
        drive = list(group)
        times_ns = _times_ns(drive)
        if session or not times_ns:
            parts = [slice(0, len(drive))]
        elif in_order:
            parts = split_at_gaps(times_ns) if sorted(times_ns) == times_ns else [slice(None)]
        else:
            starts = [0] + [n + 1 for n, (a, b) in enumerate(pairwise(times_ns)) if b < a]
            parts = [
                slice(first + part.start, first + part.stop)
                for first, last in pairwise([*starts, len(drive)])
                for part in split_at_gaps(times_ns[first:last])
            ]
        for part in parts:
            require_order(
                _times_ns(drive[part]),
                [record.where for record in drive[part]],
                "put the records after that into a tub of their own",
            )
            yield drive[part]


def _times_ns(drive: Sequence[TubRecord]) -> list[int]:
    """When each record was made, ns; nothing if one of them does not say."""
    times = [record.time_ns for record in drive if record.time_ns is not None]
    return times if len(times) == len(drive) else []


def _size(images: Path, record: TubRecord) -> tuple[int, int] | None:
    """Width and height of the first picture; None where there is none."""
    if IMAGE not in record.fields:
        return None
    path = inside(images, str(record.fields[IMAGE]), record.where)
    try:
        return size_of(path.read_bytes(), str(path))
    except OSError as error:
        raise cannot_read(path, error) from error


_CATALOG_LENGTH: Final = 1000  # Records, as Donkeycar has it.
_PILOT: Final = "local"
_TUB_OUT_NS_PER_MS: Final = 1_000_000
_MS_PER_S: Final = 1000.0


def write_tub(episodes: Sequence[Recorded], folder: Path) -> int:
    """Write episodes into a folder that is there, as the sessions of one tub.

    What people, experts and programs did is the user's in a tub, and what policies did the
    pilot's. Steps whose time nobody knows get times from the rate of the episode.

    Returns:
        How many steps were written.

    Raises:
        DemosError: If an episode has other actions than steering and throttle, or a step has no
            picture.
    """
    states = [_require(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / IMAGES).mkdir()
    records: list[dict[str, Any]] = []
    sessions: list[str] = []
    for number, episode in enumerate(episodes):
        sessions.append(f"{_created(episode.header):%y-%m-%d}_{number}")
        for step, jpeg in seen(episode.rows):
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no picture: export it to csv.")
            name = f"{len(records)}_cam_image_array_.jpg"
            (folder / IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            records.append(
                fields
                | {IMAGE: name, "_session_id": sessions[-1], "_index": len(records)}
                | {"_timestamp_ms": _time_ms(step, episode.header, len(records))}
            )
    created_s = _created(episodes[0].header).timestamp()
    paths = _write_catalogs(folder, records, created_s)
    inputs = {IMAGE: "image_array", "user/angle": "float", "user/throttle": "float", MODE: "str"}
    inputs |= {"pilot/angle": "float", "pilot/throttle": "float"}
    inputs |= dict.fromkeys(states[0], "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    lines: Iterable[object] = (
        list(inputs),
        list(inputs.values()),
        {},
        {"created_at": created_s, "sessions": named},
        {
            "paths": paths,
            "current_index": len(records),
            "max_len": _CATALOG_LENGTH,
            "deleted_indexes": [],
        },
    )
    _write_lines(folder / MANIFEST, [json.dumps(line) for line in lines])
    return len(records)


def _require(episode: Recorded) -> tuple[str, ...]:
    """The names of the state of an episode that a tub can hold."""
    names = Layout.from_json(episode.header.action_layout).names
    if names != TUB_ACTIONS.names:
        raise DemosError(
            f"The actions of {episode.name} are {', '.join(names)}, and those of a tub "
            f"{', '.join(TUB_ACTIONS.names)}: export it to minari or csv."
        )
    if not episode.header.state_layout:
        return ()
    state = Layout.from_json(episode.header.state_layout)
    if state.size != len(state):
        raise DemosError(f"The state of {episode.name} has blocks of numbers: export it to csv.")
    return state.names


def _fields(step: Step, state: Sequence[str], where: str) -> dict[str, Any]:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    fields: dict[str, Any] = {MODE: _PILOT if by_policy else USER}
    # A tub always says what the user held; while a policy drives, that is nothing.
    fields |= _tub_out_pair("user", (0.0, 0.0) if by_policy else step.action)
    pilot = step.action if by_policy else step.wanted
    if pilot is not None and all(abs(value) <= 1.0 for value in pilot):
        fields |= _tub_out_pair("pilot", pilot)
    known = zip(state, step.state, strict=True)
    return fields | {name: value for name, value in known if math.isfinite(value)}


def _tub_out_pair(who: str, values: Sequence[float]) -> dict[str, float]:
    return {f"{who}/angle": values[0], f"{who}/throttle": values[1]}


def _time_ms(step: Step, header: EpisodeHeader, number: int) -> int:
    """Unix time of a step, ms."""
    if step.wall_ns is not None:
        return step.wall_ns // _TUB_OUT_NS_PER_MS
    return round((_created(header).timestamp() + number / header.control_hz) * _MS_PER_S)


def _created(header: EpisodeHeader) -> datetime:
    """When an episode began; the beginning of Unix time where it does not say."""
    try:
        return datetime.fromisoformat(header.created)
    except ValueError:
        return datetime.fromtimestamp(0.0, UTC)


def _write_catalogs(folder: Path, records: Sequence[dict[str, Any]], created_s: float) -> list[str]:
    """Write the records, and beside each catalog what Donkeycar keeps of its lines."""
    paths: list[str] = []
    for number, start in enumerate(range(0, len(records), _CATALOG_LENGTH)):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) for record in part]
        paths.append(f"catalog_{number}.catalog")
        _write_lines(folder / paths[-1], lines)
        beside = f"catalog_{number}.catalog_manifest"
        kept = {
            "created_at": created_s,
            "line_lengths": [len(line) + 1 for line in lines],
            "path": beside,
            "start_index": start,
        }
        _write_lines(folder / beside, [json.dumps(kept, sort_keys=True)])
    return paths


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")
