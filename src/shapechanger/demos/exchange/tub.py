"""Donkeycar tubs: import of versions 1 and 2, export of version 2.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, with
Shapechanger's signs. In the `user/mode` "user" a person drives, and `pilot/...` is the action that
a policy proposed. Otherwise the policy drives, but in "local_angle" the person sets the throttle.

Version 2 is a folder with `manifest.json` (five lines of JSON: inputs, types, metadata, more
metadata, and an object with the catalogs), catalogs with a record per line, and `images/`. Deleted
indexes are values of the records' `_index`; `_timestamp_ms` is Unix time, and a start of the car
begins a new `_session_id`. Version 1 has a file `record_N.json` per record, its image next to it,
optionally `milliseconds` since the start, `meta.json`, and the deleted numbers in `exclude.json`.

Source: github.com/autorope/donkeycar, donkeycar/parts/datastore_v2.py and tub_v2.py for version 2,
parts/datastore.py for version 1, at the commits 1e831b81, 38a1c2db and b253cef6.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path, PurePath
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, Struct, field, structs

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import base, files
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

_MANIFEST: Final = "manifest.json"
_IMAGES: Final = "images"
_LOOP_HZ: Final = "DRIVE_LOOP_HZ"  # Steps per second in Donkeycar's settings.
_RECORD_NAME: Final = re.compile(r"record_([0-9]{1,12})\.json")
_IMAGE_NUMBER: Final = re.compile(r"([0-9]{1,12})_")
_ACTIONS: Final = Layout((base.COMMANDS["steering"], base.COMMANDS["throttle"]))
_USER, _PILOT = ([f"{who}/{axis}" for axis in ("angle", "throttle")] for who in ("user", "pilot"))
_IMAGE, _MODE = base.COLUMNS["frame"]["tub"], base.COLUMNS["driver"]["tub"]
_CATALOG_LENGTH: Final = 1000  # Records of a catalog, as Donkeycar writes them.
_NS_PER_MS: Final = 1_000_000
_NS_PER_S: Final = 1_000_000_000
_NUMBERS: Final = ("float", "int", "boolean")
_PICTURES: Final = ("image_array", "image")
_DEPTH: Final = "gray16_array"

Fields = dict[str, Any]
Axis = Annotated[float, Meta(ge=-1.0, le=1.0)] | None
_MAX_MS: Final = 2 * 10**12
Time = Annotated[float, Meta(gt=-_MAX_MS, lt=_MAX_MS)] | None


class _Record(Struct):  # Columns that have the same meaning in all tubs.
    time_ms: Time = field(default=None, name="_timestamp_ms")
    mode: str = field(default="user", name=_MODE)
    user_angle: Axis = field(default=None, name=_USER[0])
    user_throttle: Axis = field(default=None, name=_USER[1])
    pilot_angle: Axis = field(default=None, name=_PILOT[0])
    pilot_throttle: Axis = field(default=None, name=_PILOT[1])


class _Catalogs(Struct):  # The last line of a manifest.
    paths: list[str]
    deleted_indexes: list[int] = []
    current_index: int = 0


class _Tub(Struct):
    """A tub; the first four fields are in the `meta.json` of version 1."""

    inputs: list[str] = []
    types: list[str] = []
    start: float | None = None  # Unix time, s.
    rate: Any = field(default=None, name=_LOOP_HZ)
    records: dict[int, Fields] = {}
    deleted: list[int] = []
    is_unix: bool = True  # Whether times are Unix times; otherwise 0 is the start of the car.


def _numbered(folder: Path) -> list[tuple[int, str]]:
    """Return the number and file name of each record in a tub of version 1."""
    names = (path.name for path in folder.glob("record_*.json"))
    return sorted((int(m[1]), m[0]) for m in map(_RECORD_NAME.fullmatch, names) if m)


def _read_v1(folder: Path, context: base.ImportContext) -> _Tub:
    """Read a tub of version 1; without Unix times, a session begins where time runs backwards."""
    path, exclude = folder / "meta.json", folder / "exclude.json"
    tub = files.read_json(path, _Tub) if path.is_file() else _Tub()
    tub.deleted = files.read_json(exclude, list[int]) if exclude.is_file() else []
    tub.records, tub.is_unix = {}, tub.start is not None
    starts, before_ms = 1, 0.0
    for number, name in _numbered(folder):
        text = files.read_bytes(files.inside(folder, name, folder))
        try:
            fields: Fields = files.parse_json(text, name, Fields)
        except DemosError:
            if number not in tub.deleted:
                context.report("left out", "damaged JSON", f"record {number}")
            continue
        time_ms = fields.pop("milliseconds", None)
        if type(time_ms) in {int, float} and abs(time_ms) < _MAX_MS:
            starts, before_ms = starts + (time_ms < before_ms), time_ms
            time_ms += 1e3 * (tub.start or 0.0)
        session = "" if tub.is_unix else f"start {starts}"
        tub.records[number] = fields | {"_timestamp_ms": time_ms, "_session_id": session}
    return tub


def _read_v2(folder: Path, context: base.ImportContext) -> _Tub:
    """Read a tub of version 2, with its records in the order of their `_index`."""
    path = folder / _MANIFEST
    lines = [*files.read_bytes(path).split(b"\n"), *[b""] * 5][:5]
    kinds = (list[str], list[str], Fields | list[tuple[str, Any]], Any, _Catalogs)
    inputs, types, metadata, _, catalogs = (
        files.parse_json(line, path, kind) for line, kind in zip(lines, kinds, strict=True)
    )
    if len(set(catalogs.paths)) < len(catalogs.paths):
        raise DemosError(f"{path} names a catalog twice in its paths.")
    found: dict[int, list[Fields]] = {}
    for name in catalogs.paths:
        try:
            text = files.read_bytes(files.inside(folder, name, path))
        except DemosError as error:
            context.report("left out", str(error).removesuffix("."), name)
            continue
        for number, line in enumerate(text.split(b"\n"), 1):
            try:
                if line.strip():
                    fields: Fields = files.parse_json(line, name, Fields)
                    index: int = files.converted(fields.get("_index"), int, name)
                    found.setdefault(index, []).append(fields)
            except DemosError:
                reason = "damaged JSON, or no valid _index"
                context.report("left out", reason, f"{name}, line {number}")
    if sorted(found) != list(found):
        text = "The _index does not always rise: the records are read in its order."
        context.report("warning", text)
    last = max([*found, catalogs.current_index - 1])
    if (missing := last + 1 - len(found)) > 0:
        context.report("note", f"{missing} of the records 0 to {last} are in no catalog.")
    if strange := [number for number in catalogs.deleted_indexes if number > last]:
        text = f"{len(strange)} of the deleted indexes belong to no record: {base.few(strange)}."
        context.report("warning", text)
    for number, same in found.items():
        if len(same) > 1:
            context.report("left out", "the _index of several records", f"record {number}")
    return _Tub(
        inputs=inputs,
        types=types,
        rate=dict(metadata).get(_LOOP_HZ),
        records={number: same[0] for number, same in sorted(found.items()) if len(same) == 1},
        deleted=catalogs.deleted_indexes,
    )


def _read(folder: Path, context: base.ImportContext) -> Iterator[base.ExchangeEpisode]:
    """Yield a tub's episodes: its sessions, divided at pauses and where time runs backwards."""
    is_v2 = (folder / _MANIFEST).is_file()
    tub = (_read_v2 if is_v2 else _read_v1)(folder, context)
    if len(tub.inputs) != len(tub.types):
        raise DemosError(f"{folder} has {len(tub.inputs)} inputs, but {len(tub.types)} types.")
    types, deleted = dict(zip(tub.inputs, tub.types, strict=True)), {*tub.deleted}
    kept = {n: fields for n, fields in tub.records.items() if n not in deleted}
    if gone := len(tub.records) - len(kept):
        context.report("note", f"Records that are deleted in the tub are not imported: {gone}.")
    there = list(dict.fromkeys(name for fields in kept.values() for name in fields))
    cameras = [name for name in there if types.get(name) in _PICTURES or name == _IMAGE]
    camera = _IMAGE if _IMAGE in cameras and not context.camera else ""
    camera = camera or base.choose_camera(folder, cameras, context)
    if not camera and _DEPTH in map(types.get, there):
        text = "The steps have no images, because images of 16 bits are not imported."
        context.report("warning", text)
    numeric = [name for name, kind in types.items() if name and kind in _NUMBERS]
    sensed = [name for name in numeric if not name.startswith(("user/", "pilot/", "_"))]
    taken = {camera, _MODE, *sensed, *_USER, *_PILOT}
    if left := [n for n in there if n not in taken and not n.startswith("_")]:
        context.report("note", f"Columns that are not imported: {', '.join(left)}.")
    records = [_record(number, fields, sensed) for number, fields in kept.items()]
    if camera:
        images = folder / _IMAGES if is_v2 else folder
        _find_images(records, [one.get(camera) for one in kept.values()], images, context)
    sessions = {number: str(fields.get("_session_id", "")) for number, fields in kept.items()}
    parts = [list(part) for _, part in groupby(records, lambda record: sessions[record.number])]
    states = [feature for name in sensed for feature in base.features_of(name, 1)]
    header = EpisodeHeader(
        action_layout=_ACTIONS, state_layout=Layout(tuple(states)), body="car", source="tub"
    )
    rate = _float(tub.rate)
    for part, head in base.drives(parts, header, context, rate if 0.0 < rate < math.inf else None):
        if head.clock == "real" and tub.is_unix:
            for record in part:
                record.step = structs.replace(record.step, wall_ns=record.step.captured_ns)
            at = datetime.fromtimestamp((part[0].step.wall_ns or 0) / _NS_PER_S, UTC)
            head = replace(head, created=at.isoformat(timespec="milliseconds"))
        if session := sessions[part[0].number]:
            head = replace(head, notes={"session": session})
        name = f"{folder}, from {part[0].name}"
        yield base.ExchangeEpisode(header=head, records=part, name=name)


def _float(value: Any) -> float:
    """Return a number; NaN for other values and for numbers that are too large."""
    with suppress(TypeError, ValueError, OverflowError):
        return float(value)
    return math.nan


def _record(number: int, fields: Fields, sensed: Sequence[str]) -> base.ExchangeRecord:
    """Return a record, with a fault if its action is missing or invalid."""
    known, fault = _Record(), ""
    try:
        known = msgspec.convert(fields, _Record)
    except msgspec.ValidationError as error:
        fault = f"an invalid value ({error})"
    pilot = (known.pilot_angle, known.pilot_throttle)
    action = {
        "user": (known.user_angle, known.user_throttle),
        "local_angle": (known.pilot_angle, known.user_throttle),
    }.get(known.mode, pilot)
    by_person = known.mode == "user"
    if None in action:
        fault = fault or f"no action in the mode {known.mode!r}"
    step = Step(
        action=(action[0] or 0.0, action[1] or 0.0),
        driver="person" if by_person else "policy",
        wanted=(pilot[0] or 0.0, pilot[1] or 0.0) if by_person and None not in pilot else None,
        state=tuple(_float(fields.get(name)) for name in sensed),
        captured_ns=None if known.time_ms is None else 1000 * round(1e3 * known.time_ms),
    )
    return base.ExchangeRecord(name=f"record {number}", number=number, step=step, fault=fault)


def _find_images(
    records: list[base.ExchangeRecord], names: list[Any], images: Path, context: base.ImportContext
) -> None:
    """Set each record's image from its name, or a fault if the name is missing, wrong or shared."""
    shown = Counter(str(name) for name, one in zip(names, records, strict=True) if not one.fault)
    for record, name in zip(records, names, strict=True):
        if record.fault:
            continue
        if not name or not isinstance(name, str):
            record.fault = "no image"
            continue
        # For the type "image", version 1 writes absolute paths on the robot.
        place = PurePath(name).name if PurePath(name).is_absolute() else name
        record.frame, record.image = name, images / place
        if not files.is_inside(images, place):
            record.fault = "an image name that leaves the folder"
        elif shown[name] > 1 and record.image.is_file():
            record.fault = "the image of several records"
        elif (match := _IMAGE_NUMBER.match(name)) and int(match[1]) != record.number:
            context.report("warning", "the image of another number", record.name)


def _write(episodes: Sequence[base.ExchangeEpisode], folder: Path, _: base.ExportContext) -> int:
    """Write episodes as the sessions of one tub of version 2."""
    states = episodes[0].header.state_layout
    (folder / _IMAGES).mkdir()
    records: list[Fields] = []
    sessions: list[str] = []
    for episode in episodes:
        header = episode.header
        fits = header.action_layout.names == _ACTIONS.names and header.state_layout == states
        if not fits or states.size != len(states):
            text = f"a tub has the action {', '.join(_ACTIONS.names)}, and a state of the same "
            text += "single numbers in all episodes"
            raise DemosError(f"{episode.name} does not fit: {text}; export it to minari or csv.")
        at = _began(header)
        sessions.append(f"{at:%y-%m-%d}_{len(sessions)}")
        for step, jpeg, time_ns in _timed(episode, round(at.timestamp() * _NS_PER_S)):
            index, fields = len(records), _fields(step, states.names, episode.name)
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no image: export it to csv.")
            name = f"{index}_cam_image_array_.jpg"
            (folder / _IMAGES / name).write_bytes(jpeg)
            fields |= {_IMAGE: name, "_session_id": sessions[-1], "_index": index}
            records.append(fields | {"_timestamp_ms": round(time_ns / _NS_PER_MS)})
    created = {"created_at": _began(episodes[0].header).timestamp()}
    paths: list[str] = []
    for start in range(0, len(records), _CATALOG_LENGTH):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(one, allow_nan=False, sort_keys=True) + "\n" for one in part]
        paths.append(f"catalog_{len(paths)}.catalog")
        (folder / paths[-1]).write_text("".join(lines), encoding="utf-8", newline="\n")
        kept = {"line_lengths": list(map(len, lines)), **created}
        kept |= {"path": f"{paths[-1]}_manifest", "start_index": start}
        (folder / f"{paths[-1]}_manifest").write_text(json.dumps(kept) + "\n")
    types = {_IMAGE: "image_array", _MODE: "str"}
    types |= dict.fromkeys((*_USER, *_PILOT, *states.names), "float")
    rates = {episode.header.control_hz for episode in episodes}
    metadata = {_LOOP_HZ: f"{rates.pop():g}"} if len(rates) == 1 else {}
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    catalogs = {"paths": paths, "current_index": len(records), "max_len": _CATALOG_LENGTH}
    more = {**created, "sessions": named}
    ends = (list(types), list(types.values()), metadata, more, catalogs | {"deleted_indexes": []})
    (folder / _MANIFEST).write_text("".join(json.dumps(line) + "\n" for line in ends))
    return len(records)


def _fields(step: Step, state: Sequence[str], where: str) -> Fields:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    # A tub always contains the user's action; while a policy drives, it is 0.
    user, pilot = ((0.0, 0.0), step.action) if by_policy else (step.action, step.wanted)
    fields: Fields = {_MODE: "local" if by_policy else "user"} | dict(zip(_USER, user, strict=True))
    if pilot is not None and all(abs(value) <= 1.0 for value in pilot):
        fields |= dict(zip(_PILOT, pilot, strict=True))
    known = zip(state, step.state, strict=True)
    return fields | {name: value for name, value in known if math.isfinite(value)}


def _timed(
    episode: base.ExchangeEpisode, began_ns: int
) -> Iterator[tuple[Step, bytes | None, int]]:
    """Yield the steps with their images and ascending Unix times, ns.

    In a simulation, times are of the simulated clock, because the recorder's times depend on the
    speed of the simulation. A step without a time follows the step before after one period.
    """
    header = episode.header
    is_simulated = header.clock == "twin" or (header.clock == "none" and header.env)
    period_ns, first_ns = round(_NS_PER_S / header.control_hz), None
    last_ns = began_ns - period_ns
    for number, record in enumerate(episode.records):
        at_ns, clock_ns = record.step.wall_ns, record.step.clock_ns
        first_ns = clock_ns if first_ns is None else first_ns
        if is_simulated:
            at_ns = None if clock_ns is None else began_ns + clock_ns - (first_ns or 0)
        if at_ns is None or (number and at_ns <= last_ns):
            at_ns = last_ns + period_ns
        last_ns = at_ns
        yield record.step, record.jpeg, at_ns


def _began(header: EpisodeHeader) -> datetime:
    with suppress(ValueError):
        return datetime.fromisoformat(header.created)
    return datetime.fromtimestamp(0.0, UTC)


FORMAT: Final = base.Format(
    name="tub",
    title="Donkeycar",
    sign=f"{_MANIFEST} or record_0.json",
    detect=lambda folder: (folder / _MANIFEST).is_file() or bool(_numbered(folder)),
    read=_read,
    write=_write,
    options=frozenset({"camera", "hz"}),
)
