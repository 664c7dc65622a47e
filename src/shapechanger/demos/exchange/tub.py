"""Tubs of Donkeycar: records of a drive, with their pictures.

Version 2 is a folder with `manifest.json`, catalogs and `images/`. The manifest has five lines of
JSON: inputs, types, metadata, more metadata, and an object with `paths` (the catalogs in order),
`current_index`, `max_len` and `deleted_indexes`, which counts records over all catalogs. A catalog
has one JSON object per line; `_timestamp_ms` is Unix time, `_session_id` names the start of the car
that it belongs to, and `cam/image_array` names a file in `images/`. Version 1 has a file
`record_N.json` per record, its picture beside it, optionally `milliseconds` since the start, and
`meta.json` with inputs, types and optionally the Unix time of the start.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py (`Manifest`,
`ManifestIterator`, `Tub.write_record`) for version 2, parts/datastore.py for version 1, read at
the commits 1e831b81, 38a1c2db and b253cef6.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, as in
Shapechanger. In the `user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In
the other modes `pilot/...` drives, except that in "local_angle" the throttle is the person's. Other
inputs of the types float, int and boolean become the state; tubs do not contain their units.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.files import (
    Pictures,
    cannot_read,
    parse_json,
    parse_json_object,
    read_text,
    resolve_file,
)
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.recorded import (
    ExchangeEpisode,
    ExchangeStep,
    kept_steps,
    rate_hz,
    require_order,
    split_at_gaps,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

MANIFEST: Final = "manifest.json"

_IMAGES: Final = "images"
_META: Final = "meta.json"
_RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
_MANIFEST_LINES: Final = 5

_IMAGE: Final = "cam/image_array"
_MODE: Final = "user/mode"
_PERSON_DRIVES: Final = "user"
_POLICY_STEERS: Final = "local_angle"
_POLICY_DRIVES: Final = "local"
_AXES: Final = ("angle", "throttle")
_NUMBERS: Final = ("float", "int", "boolean")
_UNIT_UNKNOWN: Final = "?"
_ACTIONS: Final = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))

_CATALOG_LENGTH: Final = 1000  # Records, as in Donkeycar.
_MIN_RATE_RECORDS: Final = 10  # A shorter drive is not evidence of its rate.
# Measured rates of one setting differ slightly, those of two settings by at least a third.
_RATE_RATIO: Final = 1.3
_MAX_TIME: Final = 1e15  # Larger numbers are not a time, in ms or s.
_NS_PER_MS: Final = 1_000_000
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class _Record:
    """One record of a tub.

    Attributes:
        fields: Its content.
        where: How to name it in errors.
        time_ns: When it was made, ns; None if unknown.
        is_unix: Whether `time_ns` is Unix time, and not time since some start.
        session: Its session; "" for none.
    """

    fields: dict[str, Any]
    where: str
    time_ns: int | None = None
    is_unix: bool = True
    session: str = ""


def is_tub(folder: Path) -> bool:
    """Return whether a folder is a tub.

    Raises:
        DemosError: If the folder cannot be read.
    """
    try:
        return (folder / MANIFEST).is_file() or any(
            _RECORD_NAME.fullmatch(child.name) for child in folder.iterdir()
        )
    except OSError as error:
        raise cannot_read(folder, error) from error


def read_tub(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a tub: its sessions, or its drives where it has no sessions.

    Records that are marked as deleted are left out.

    Raises:
        DemosError: If something is damaged, missing or contradictory.
    """
    newer = (folder / MANIFEST).is_file()
    inputs, records = (_read_v2 if newer else _read_v1)(folder)
    images = folder / _IMAGES if newer else folder
    if not records:
        raise DemosError(f"The tub {folder} has no records that are not deleted.")
    shown = [record.fields[_IMAGE] for record in records if _IMAGE in record.fields]
    if len(set(map(str, shown))) < len(shown):
        raise DemosError(f"Two records of the tub {folder} name one picture: delete one of them.")
    state = _state_layout(inputs)
    pictures = Pictures()
    if _IMAGE in records[0].fields:
        pictures.read(_picture(images, records[0]))
    size = pictures.size
    drives = list(_drives(records, in_order=newer))
    rates = [rate_hz(_times_ns(drive)) for drive in drives]
    _require_one_rate(
        {
            hz: drive[0].where
            for hz, drive in zip(rates, drives, strict=True)
            if len(_times_ns(drive)) >= _MIN_RATE_RECORDS
        }
    )
    for drive, hz in zip(drives, rates, strict=True):
        session = drive[0].session
        header = EpisodeHeader(
            action_layout=_ACTIONS.to_json(),
            state_layout="" if state is None else state.to_json(),
            image_size=size,
            control_hz=hz,
            body="car",
            clock="none",
            source="tub",
            notes={"session": session} if session else {},
        )
        rows = _rows(images, drive, state, pictures)
        yield ExchangeEpisode(header=header, rows=rows, name=drive[0].where)


def write_tub(episodes: Sequence[ExchangeEpisode], folder: Path) -> int:
    """Write episodes into an existing folder, as the sessions of one tub of version 2.

    Actions of people, experts and programs become the user's, those of policies the pilot's. Steps
    of a simulated drive get the times of its own clock, since the recorder's tells how fast the
    simulation ran; steps without a time follow the one before at the rate of the episode.

    Args:
        episodes: The episodes.
        folder: Where to write.

    Returns:
        Number of steps written.

    Raises:
        DemosError: If the actions are not steering and throttle, or a step has no picture.
    """
    states = [_state_names(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / _IMAGES).mkdir()
    records: list[dict[str, Any]] = []
    sessions: list[str] = []
    for number, episode in enumerate(episodes):
        sessions.append(f"{_created(episode.header):%y-%m-%d}_{number}")
        timestamp_ms = _timestamps_ms(episode.header)
        for step, jpeg in kept_steps(episode.rows):
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no picture: export it to csv.")
            name = f"{len(records)}_cam_image_array_.jpg"
            (folder / _IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            fields |= {_IMAGE: name, "_session_id": sessions[-1], "_index": len(records)}
            records.append(fields | {"_timestamp_ms": timestamp_ms(step)})
    created_s = _created(episodes[0].header).timestamp()
    paths = _write_catalogs(folder, records, created_s)
    inputs = {_IMAGE: "image_array", "user/angle": "float", "user/throttle": "float", _MODE: "str"}
    inputs |= {"pilot/angle": "float", "pilot/throttle": "float"}
    inputs |= dict.fromkeys(states[0], "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    lines: tuple[object, ...] = (
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


def _require_one_rate(drives: Mapping[float, str]) -> None:
    """Refuse drives whose rates differ by more than measurement explains, by rate, Hz."""
    if drives and max(drives) > _RATE_RATIO * min(drives):
        slow, fast = min(drives), max(drives)
        raise DemosError(
            f"The drive from {drives[slow]} has {slow:.3g} steps a second, but the drive from "
            f"{drives[fast]} {fast:.3g}, and a data set has one rate: put the records of each "
            "rate into a tub of their own."
        )


def _read_v2(folder: Path) -> tuple[dict[str, str], list[_Record]]:
    """Return the inputs with their types, and the records that are not deleted."""
    path = folder / MANIFEST
    lines = read_text(path).splitlines()
    if len(lines) < _MANIFEST_LINES:
        raise DemosError(
            f"{path} has {len(lines)} lines, but the manifest of a tub has {_MANIFEST_LINES}."
        )
    inputs, types, *_ = (
        parse_json(line, f"{path}, line {n}") for n, line in enumerate(lines[:4], 1)
    )
    catalogs = parse_json_object(lines[4], f"{path}, line {_MANIFEST_LINES}")
    gone = _list(catalogs.get("deleted_indexes", []), f"deleted_indexes in {path}")
    deleted = {index for index in gone if isinstance(index, int)}
    records: list[_Record] = []
    index = 0
    names = [str(name) for name in _list(catalogs.get("paths"), f"paths in {path}")]
    if len(set(names)) < len(names):
        raise DemosError(f"{path} names a catalog twice in its paths: remove one of the two.")
    for name in names:
        catalog = resolve_file(folder, name, str(path))
        for number, line in enumerate(read_text(catalog).splitlines(), 1):
            if not line.strip():
                continue
            where = f"{catalog}, line {number}"
            index += 1
            if index - 1 in deleted:
                continue
            fields = parse_json_object(line, where)
            time_ms = _time(fields.get("_timestamp_ms"))
            time_ns = None if time_ms is None else round(time_ms) * _NS_PER_MS
            session = fields.get("_session_id")
            records.append(
                _Record(fields, where, time_ns, session="" if session is None else str(session))
            )
    return _typed(inputs, types, path), records


def _read_v1(folder: Path) -> tuple[dict[str, str], list[_Record]]:
    """Return the inputs with their types, and the records."""
    try:
        found = [(m, path) for path in folder.iterdir() if (m := _RECORD_NAME.fullmatch(path.name))]
    except OSError as error:
        raise cannot_read(folder, error) from error
    meta: dict[str, Any] = {}
    if (folder / _META).is_file():
        meta = parse_json_object(read_text(folder / _META), str(folder / _META))
    start = _time(meta.get("start"))
    start_ns = None if start is None else round(start * _NS_PER_S)
    records: list[_Record] = []
    for _, path in sorted(found, key=lambda pair: int(pair[0][1])):
        where = str(path)
        fields = parse_json_object(read_text(resolve_file(folder, path.name, where)), where)
        time_ms = _time(fields.get("milliseconds"))
        time_ns = None if time_ms is None else round(time_ms * _NS_PER_MS) + (start_ns or 0)
        records.append(_Record(fields, where, time_ns, is_unix=start_ns is not None))
    return _typed(meta.get("inputs", []), meta.get("types", []), folder / _META), records


def _typed(inputs: Any, types: Any, path: Path) -> dict[str, str]:
    names, kinds = _list(inputs, f"inputs in {path}"), _list(types, f"types in {path}")
    if len(names) != len(kinds):
        raise DemosError(f"{path} has {len(names)} inputs, but {len(kinds)} types.")
    return {str(name): str(kind) for name, kind in zip(names, kinds, strict=True)}


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise DemosError(f"The {what} must be a list.")
    return cast("list[Any]", value)


def _time(value: Any) -> float | None:
    """Return a number that can be a time; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) < _MAX_TIME else None


def _state_layout(inputs: Mapping[str, str]) -> Layout | None:
    """Return the layout of the state in a tub with these inputs, by type; None without a state."""
    names = [
        name
        for name, kind in inputs.items()
        if name and kind in _NUMBERS and not name.startswith(("user/", "pilot/", "_"))
    ]
    return Layout(tuple(Feature(name, _UNIT_UNKNOWN) for name in names)) if names else None


def _rows(
    images: Path, drive: Sequence[_Record], state: Layout | None, pictures: Pictures
) -> Iterator[ExchangeStep]:
    pictured = _IMAGE in drive[0].fields
    for record in drive:
        if (record.fields.get(_IMAGE) is not None) != pictured:
            raise DemosError(
                f"{record.where} has {'no' if pictured else 'a'} picture ({_IMAGE}), but "
                f"{drive[0].where} has {'one' if pictured else 'none'}: delete the records "
                "without one."
            )
        jpeg = pictures.read(_picture(images, record)) if pictured else None
        yield ExchangeStep(step=_step(record, state), jpeg=jpeg)


def _picture(images: Path, record: _Record) -> Path:
    return resolve_file(images, str(record.fields[_IMAGE]), record.where)


def _step(record: _Record, state: Layout | None) -> Step:
    """Return a record as a step."""
    user = _pair(record, "user")
    if user is None:
        raise DemosError(f"{record.where} has no user/angle and user/throttle.")
    pilot = _pair(record, "pilot")
    mode = record.fields.get(_MODE, _PERSON_DRIVES)
    action = user
    if mode != _PERSON_DRIVES and pilot is not None:
        action = (pilot[0], user[1]) if mode == _POLICY_STEERS else pilot
    return Step(
        action=action,
        driver="person" if mode == _PERSON_DRIVES else "policy",
        wanted=pilot if mode == _PERSON_DRIVES else None,
        state=tuple(_sensed(record.fields.get(name)) for name in state.names) if state else (),
        wall_ns=record.time_ns if record.is_unix else None,
    )


def _pair(record: _Record, actor: str) -> tuple[float, float] | None:
    """Return the angle and the throttle of "user" or "pilot"; None if either is missing."""
    values: list[float] = []
    for axis in _AXES:
        value = record.fields.get(f"{actor}/{axis}")
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1.0:
            raise DemosError(
                f"{record.where}: {actor}/{axis} is {value!r}, but must be a number from -1 to 1: "
                "correct or delete the record."
            )
        values.append(float(value))
    return values[0], values[1]


def _sensed(value: Any) -> float:
    """Return a sensor value; NaN for anything that is not a number."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # An integer of hundreds of digits.
        return math.nan


def _drives(records: Sequence[_Record], *, in_order: bool) -> Iterator[Sequence[_Record]]:
    """Yield the records of each episode.

    Args:
        records: All records, in order.
        in_order: Whether time must not run backwards. The milliseconds of version 1 restart at
            each start of the car, which begins a new drive then.
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
                "move the records after that to a tub of their own",
            )
            yield drive[part]


def _times_ns(drive: Sequence[_Record]) -> list[int]:
    """Return the time of each record, ns; an empty list if one is unknown."""
    times = [record.time_ns for record in drive if record.time_ns is not None]
    return times if len(times) == len(drive) else []


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


def _timestamps_ms(header: EpisodeHeader) -> Callable[[Step], int]:
    """Return a function that maps each step of an episode, in order, to its Unix time, ms.

    The times always increase.
    """
    simulated = header.clock == "twin"
    created_ns = round(_created(header).timestamp() * _NS_PER_S)
    began_ns: int | None = None
    last_ns: int | None = None

    def timestamp_ms(step: Step) -> int:
        nonlocal began_ns, last_ns
        at_ns = step.wall_ns
        if simulated:
            clock_ns = step.clock_ns
            began_ns = clock_ns if began_ns is None else began_ns
            at_ns = None if clock_ns is None else created_ns + clock_ns - cast("int", began_ns)
        if at_ns is None or (last_ns is not None and at_ns <= last_ns):
            period_ns = round(_NS_PER_S / header.control_hz)
            at_ns = created_ns if last_ns is None else last_ns + period_ns
        last_ns = at_ns
        return round(at_ns / _NS_PER_MS)

    return timestamp_ms


def _created(header: EpisodeHeader) -> datetime:
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
