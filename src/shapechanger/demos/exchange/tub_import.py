"""Import of Donkeycar tubs, versions 1 and 2; `tub_files` describes the format.

`user/angle` is -1 at the left and 1 at the right, and a `user/throttle` of 1 is forward, as in
Shapechanger. In the `user/mode` "user" a person drives, and `pilot/...` is what a policy wanted. In
the other modes `pilot/...` drives, except that in "local_angle" the throttle is the person's. Other
inputs of the types float, int and boolean become the state; tubs do not contain their units.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path, PurePath
from typing import Any, Final

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.importing import ImportContext, counted, few
from shapechanger.demos.exchange.pictures import check_pictures, read_picture
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep
from shapechanger.demos.exchange.times import TimedDrive, TimeReport, choose_rates, iso_time
from shapechanger.demos.exchange.tub_export import ACTIONS, AXES, IMAGE, MODE, PERSON_DRIVES
from shapechanger.demos.exchange.tub_files import Tub, TubRecord, read_tub_files
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

_POLICY_STEERS: Final = "local_angle"
_NUMBERS: Final = ("float", "int", "boolean")
_PICTURES: Final = ("image_array", "image")
_DEPTH: Final = "gray16_array"
_KNOWN: Final = (*_NUMBERS, *_PICTURES, _DEPTH, "str", "list", "vector", "nparray")
_V1_TIME: Final = "milliseconds"
_ENDINGS: Final = (".jpg", ".jpeg", ".png", ".bmp")
_PICTURE_NUMBER: Final = re.compile(r"([0-9]{1,12})_")
_UNIT_UNKNOWN: Final = "?"


@dataclass(frozen=True, slots=True)
class _Row:
    """A record that can be imported; without a path it has no picture."""

    record: TubRecord
    step: Step
    path: Path | None


def read_tub(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a tub: its sessions, divided at pauses and where time jumps.

    Args:
        folder: The tub.
        context: Options and findings. Its `camera` is a column such as "cam/image_array".

    Raises:
        DemosError: If the manifest contradicts itself, or a name leads out of the folder.
        UnknownName: If there is no such camera.
    """
    tub = read_tub_files(folder, context)
    if not tub.records:
        return
    columns = _columns(tub)
    camera = _camera(columns, folder, context)
    state = _state_layout(tub.inputs or columns)
    _note_other_columns(columns, camera, state, context)
    rows = [
        _Row(record, step, None)
        for record in tub.records
        if (step := _step(record, state, context)) is not None
    ]
    size = None
    if camera:
        rows, size = _with_pictures(rows, tub.images, camera, context)
    if not rows:
        return
    parts = list(_drives(rows, restarts=tub.restarts))
    times = [_times_ns(part, context) for part in parts]
    drives = [
        TimedDrive(known, [row.record.number for row in part], f"record {part[0].record.number}")
        for part, known in zip(parts, times, strict=True)
    ]
    rates, believed = choose_rates(drives, context, tub.stated_hz)
    report = TimeReport(context)
    for part, known, hz in zip(parts, times, rates, strict=True):
        names = [str(row.record.number) for row in part]
        timed = bool(known) and believed
        for place in report.split(known, names, hz) if timed else [slice(None)]:
            at_ns = known[place] if timed else []
            header = EpisodeHeader(
                action_layout=ACTIONS.to_json(),
                state_layout="" if state is None else state.to_json(),
                image_size=size,
                control_hz=hz,
                body="car",
                clock="real" if timed else "none",
                source="tub",
                notes={"session": session} if (session := part[0].record.session) else {},
                created=_created(tub, at_ns) if timed or not known else "",
            )
            yield ExchangeEpisode(
                header=header,
                rows=_steps(part[place], at_ns, is_unix=tub.is_unix),
                name=f"{folder}, from record {part[place][0].record.number}",
            )
    report.finish()


def _columns(tub: Tub) -> dict[str, str]:
    """Return the type of each column that a record has, declared or by its values."""
    columns: dict[str, str] = {}
    for record in tub.records:
        for name, value in record.fields.items():
            if name.startswith("_") or name == _V1_TIME or columns.get(name) in _KNOWN:
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
        case str() if value.lower().endswith(_ENDINGS):
            return _PICTURES[0]
        case str():
            return "str"
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
    if len(cameras) > 1 and IMAGE not in cameras:
        raise DemosError(
            f"{folder} has {len(cameras)} cameras ({', '.join(cameras)}), but an episode has one: "
            f"choose with --camera, such as --camera {cameras[0]}."
        )
    if len(cameras) == 1 and cameras[0] != IMAGE:
        context.note(f"The pictures are those of the column {cameras[0]}.")
    return IMAGE if IMAGE in cameras else "".join(cameras)


def _note_other_columns(
    columns: Mapping[str, str], camera: str, state: Layout | None, context: ImportContext
) -> None:
    taken = {camera, MODE, *(state.names if state else ())}
    taken |= {f"{actor}/{axis}" for actor in ("user", "pilot") for axis in AXES}
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
    return Layout(tuple(Feature(name, _UNIT_UNKNOWN) for name in names)) if names else None


def _step(record: TubRecord, state: Layout | None, context: ImportContext) -> Step | None:
    """Return a record as a step; None, with a finding, if it has no valid action."""
    mode = record.fields.get(MODE, PERSON_DRIVES)
    by_person = mode == PERSON_DRIVES
    sources = ("user", "user") if by_person else ("pilot", "pilot")
    if mode == _POLICY_STEERS:
        sources = ("pilot", "user")
    names = [f"{actor}/{axis}" for actor, axis in zip(sources, AXES, strict=True)]
    values = [record.fields.get(name) for name in names]
    if None in values:
        lacks = " and ".join(n for n, value in zip(names, values, strict=True) if value is None)
        driver = "" if by_person else ", although a pilot drove"
        context.leave_out("record", f"without {lacks}{driver}", record.number)
        return None
    action = _pair(values)
    if action is None:
        reason = f"with {' or '.join(names)} that is not a number from -1 to 1"
        context.leave_out("record", reason, record.number)
        return None
    wanted = None
    if by_person:
        suggested = [record.fields.get(f"pilot/{axis}") for axis in AXES]
        wanted = _pair(suggested)
        if wanted is None and None not in suggested:
            reason = "of the pilot that is not a number from -1 to 1, while a person drove"
            context.leave_out("suggestion", reason, record.number)
    return Step(
        action=action,
        driver="person" if by_person else "policy",
        wanted=wanted,
        state=tuple(_sensed(record.fields.get(name)) for name in state.names) if state else (),
    )


def _pair(values: Sequence[Any]) -> tuple[float, float] | None:
    """Return two numbers from -1 to 1; None for anything else."""
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1.0:
            return None
    return float(values[0]), float(values[1])


def _sensed(value: Any) -> float:
    """Return a sensor value; NaN for anything that is not a number."""
    try:
        return float(value) if isinstance(value, bool | int | float) else math.nan
    except OverflowError:  # An integer of hundreds of digits.
        return math.nan


def _with_pictures(
    rows: Sequence[_Row], images: Path, camera: str, context: ImportContext
) -> tuple[list[_Row], tuple[int, int] | None]:
    """Return the rows whose pictures can be imported, and the size of these."""
    shown = Counter(str(row.record.fields.get(camera)) for row in rows)
    found: list[_Row] = []
    offsets: dict[int, int] = {}
    for row in rows:
        number, name = row.record.number, row.record.fields.get(camera)
        if not name or not isinstance(name, str):
            context.leave_out("record", "without a picture", number)
        elif (path := _inside(images, name)) is None:
            context.leave_out("record", "with a picture name that leaves the folder", number)
        elif shown[name] > 1 and path.is_file():
            context.leave_out("record", "with the picture of another record", number)
        else:
            found.append(replace(row, path=path))
            if (match := _PICTURE_NUMBER.match(name)) and int(match[1]) != number:
                offsets[number] = int(match[1]) - number
    if offsets:
        context.warn(
            f"{counted(len(offsets), 'record')} with the picture of another number, up to "
            f"{max(map(abs, offsets.values()))} off ({few(list(offsets))}): look whether they "
            "belong together."
        )
    paths = [row.path for row in found if row.path is not None]
    names = [str(row.record.number) for row in found]
    good, size = check_pictures(paths, names, "record", context)
    return [row for row, is_good in zip(found, good, strict=True) if is_good], size


def _inside(images: Path, name: str) -> Path | None:
    """Return the path of a picture; None if it leaves the folder."""
    pure = PurePath(name)
    # Version 1 writes whole paths of the robot for the type "image".
    path = images / (pure.name if pure.is_absolute() else pure)
    try:
        inside = path.resolve().is_relative_to(images.resolve())
    except (OSError, ValueError):  # A NUL, or too long.
        return None
    return path if inside else None


def _drives(rows: Sequence[_Row], *, restarts: bool) -> Iterator[list[_Row]]:
    """Yield the rows of each session, and of each start of the car if times start again with it."""
    for _, session in groupby(rows, key=lambda row: row.record.session):
        drive: list[_Row] = []
        for row in session:
            now_ns, before_ns = row.record.time_ns, drive[-1].record.time_ns if drive else None
            if restarts and now_ns is not None and before_ns is not None and now_ns < before_ns:
                yield drive
                drive = []
            drive.append(row)
        yield drive


def _times_ns(drive: Sequence[_Row], context: ImportContext) -> list[int]:
    """Return the time of each record, ns; an empty list if one is unknown."""
    times = [row.record.time_ns for row in drive if row.record.time_ns is not None]
    if len(times) == len(drive):
        return times
    if times:
        context.warn(
            f"{len(drive) - len(times)} of the {len(drive)} records from "
            f"{drive[0].record.number} have no valid time: the times of the others are left out."
        )
    return []


def _created(tub: Tub, times_ns: Sequence[int]) -> str:
    """Return when an episode began, ISO 8601; "" if unknown."""
    began_ns = times_ns[0] if times_ns and tub.is_unix else tub.start_ns
    return "" if began_ns is None else iso_time(began_ns)


def _steps(
    rows: Sequence[_Row], times_ns: Sequence[int], *, is_unix: bool
) -> Iterator[ExchangeStep]:
    """Yield the steps; without times they have none."""
    for number, row in enumerate(rows):
        step = row.step
        if times_ns:
            at_ns = times_ns[number]
            step = replace(step, captured_ns=at_ns, wall_ns=at_ns if is_unix else None)
        yield ExchangeStep(step=step, jpeg=None if row.path is None else read_picture(row.path)[0])
