"""LeRobot datasets, version 3: our own with their layouts, and those of others.

Of a dataset of others, `action` becomes the action, the numbers of `observation.*` become the
state, and one camera the picture. Units are unknown and written "?", unless the feature states
them, and the driver is taken to be a person, who teleoperated the robot. Pictures that are stored
as JPEG are kept; videos and PNGs are encoded as JPEG of quality 100, which changes them slightly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, repeat
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from shapechanger.demos.episodes import DRIVERS, Driver, EpisodeHeader, Step
from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES
from shapechanger.demos.exchange.files import (
    MAX_FEATURES,
    MAX_PACKED,
    MAX_UNPACKED,
    MAX_VALUES,
    UNIT_UNKNOWN,
    UnpacksToTooMuch,
    all_rows,
    inside,
    own_headers,
    read_json_object,
    rows_at,
)
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExchangeStep,
    Format,
    ImportContext,
    name_in,
)
from shapechanger.demos.exchange.lerobot_export import DONE, EPISODES, INFO, OURS, TASKS, write
from shapechanger.demos.exchange.lerobot_index import LocatedEpisode, locate, read_places
from shapechanger.demos.exchange.pictures import PictureError, Pictures, as_jpeg, read_pictures
from shapechanger.demos.jpeg import MAX_PIXELS, encode_picture
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

_ACTION, _STATE, _REWARD, _TERMINATED = (
    name_in("lerobot", field) for field in ("action", "state", "reward", "terminated")
)
_OBSERVATION: Final = "observation."
_CAMERAS: Final = "observation.images."
_NUMBERS: Final = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)")
_BOOKKEEPING: Final = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_DEPTH: Final = ("video.is_depth_map", "is_depth_map")
_CHANNELS: Final = (1, 3, 4)
_AXES: Final = ["c", "h", "w"]
_MAX_STEPS: Final = 1 << 20  # Of an episode, of which a header names the drivers.


@dataclass(frozen=True, slots=True)
class _Feature:
    """A feature of `info.json`: its key, dtype and shape, and names and units of its values."""

    key: str
    kind: str
    shape: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    is_depth: bool

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def is_number(self) -> bool:
        """Whether its values are numbers, and not those of an image."""
        image = len(self.shape) == 3 or self.key.startswith(_CAMERAS)
        return not image and bool(_NUMBERS.fullmatch(self.kind)) and self.size <= MAX_VALUES

    @property
    def is_picture(self) -> bool:
        """Whether it is a camera's whose pictures can be imported."""
        return self.kind in {"video", "image"} and not self.is_depth

    def picture_size(self, path: Path) -> tuple[int, int]:
        """Return the width and height of its pictures, pixels, which are compared with it.

        Axes are found by their names if those fit, or else by the number of colours.
        """
        shape = self.shape if len(self.shape) == 3 else (*self.shape, 1)
        axes = [name[:1].lower() for name in self.names]
        if sorted(axes) == _AXES and len(shape) == 3 and shape[axes.index("c")] in _CHANNELS:
            channels, height, width = (shape[axes.index(axis)] for axis in _AXES)
        elif len(shape) == 3 and shape[2] in _CHANNELS:
            height, width, channels = shape
        else:
            channels, height, width = shape if len(shape) == 3 else (0, 0, 0)
        if channels not in _CHANNELS or height * width > MAX_PIXELS:
            raise DemosError(
                f"{path}: {self.key} has the shape {list(self.shape)}, not of a picture."
            )
        return width, height


def _read_features(info: Mapping[str, Any], path: Path) -> list[_Feature]:
    """Return the features of `info.json`."""
    plain = info.get("features")
    if not isinstance(plain, dict):
        raise DemosError(f"{path} has no features.")
    found: list[_Feature] = []
    for key, feature in cast("dict[str, Any]", plain).items():
        try:
            shape = tuple(int(n) for n in feature["shape"])
            kind, units = str(feature["dtype"]), feature.get("units")
            about: dict[str, Any] = feature | (feature.get("info") or {})
            is_depth = any(about.get(flag) for flag in _DEPTH)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise DemosError(f"{path}: the feature {key!r} has no dtype and shape.") from error
        too_large = key in {_ACTION, _STATE} and math.prod(shape) > MAX_VALUES
        if too_large or any(n < 1 for n in shape):
            raise DemosError(f"{path}: the feature {key!r} has the shape {list(shape)}.")
        stated = tuple(map(str, cast("list[Any]", units))) if isinstance(units, list) else ()
        names = _flat_names(about.get("names"))
        found.append(_Feature(key, kind, shape, names, stated, is_depth))
    return found


def _flat_names(plain: Any) -> tuple[str, ...]:
    """Return names that are a list, lists in a dictionary, or a dictionary of their positions.

    All three are used: `["pan", "tilt"]`, `{"motors": ["pan", "tilt"]}`, `{"pan": 0, "tilt": 1}`.
    """
    if isinstance(plain, dict):
        named = cast("dict[str, Any]", plain)
        if sorted(map(repr, named.values())) == sorted(map(repr, range(len(named)))):
            return tuple(sorted(named, key=lambda name: named[name]))
        return tuple(chain.from_iterable(map(_flat_names, named.values())))
    return tuple(map(str, cast("list[Any]", plain))) if isinstance(plain, list) else ()


@dataclass(frozen=True, slots=True)
class _Kept:
    """The features that are imported; `columns` has those of single numbers."""

    action: _Feature
    states: tuple[_Feature, ...]
    picture: _Feature | None
    columns: frozenset[str]


def _chosen(features: Sequence[_Feature], context: ImportContext, path: Path) -> _Kept:
    """Choose features, and report the others."""
    numbers = {feature.key: feature for feature in features if feature.is_number}
    if _ACTION not in numbers:
        raise DemosError(f"{path} has no numeric feature {_ACTION!r}: there is no action.")
    states = [f for key, f in numbers.items() if key.startswith(_OBSERVATION)]
    states.sort(key=lambda feature: feature.key != _STATE)  # Stable: the state first.
    single = {key for key, feature in numbers.items() if feature.size == 1}
    columns = frozenset({_REWARD, DONE, _TERMINATED} & single)
    picture = _camera([f for f in features if f.is_picture], context.camera, path.parent.parent)
    taken = {_ACTION, *(f.key for f in states), *columns, *_BOOKKEEPING}
    for feature in features:
        if feature.key in taken or feature is picture:
            continue
        about = f"{feature.key} ({feature.kind}, {' x '.join(map(str, feature.shape))})"
        image = len(feature.shape) > 1 or feature.key.startswith(_CAMERAS) or feature.is_depth
        if feature.is_number or feature.is_picture or not image:
            context.note(f"The feature {about} is not imported.")
        else:
            context.leave_out("feature", "with pictures of an unknown kind or of depth", about)
    return _Kept(numbers[_ACTION], tuple(states), picture, columns)


def _camera(cameras: Sequence[_Feature], camera: str, folder: Path) -> _Feature | None:
    """Return the chosen camera, or the only one."""
    known = {feature.key.removeprefix(_CAMERAS): feature for feature in cameras}
    if camera:
        name = camera.removeprefix(_CAMERAS)
        if name not in known:
            raise UnknownName(f"camera of {folder}", camera, known)
        return known[name]
    if len(known) > 1:
        raise DemosError(
            f"{folder} has {len(known)} cameras ({', '.join(known)}), but an episode has one: "
            f"choose with --camera, such as --camera {next(iter(known))}."
        )
    return next(iter(known.values()), None)


def _layout(features: Sequence[_Feature], context: ImportContext) -> str:
    """Return a layout for the values of features, in order, with their names and units."""
    found: list[Feature] = []
    for feature in features:
        key = feature.key.removeprefix(_OBSERVATION)
        prefix = "" if feature.key in {_ACTION, _STATE} else f"{key}/"
        named = tuple(prefix + name for name in feature.names)
        units = feature.units
        if len(units) != feature.size or not all(units):
            units = (UNIT_UNKNOWN,) * feature.size
        if len(set(named)) != feature.size or not all(feature.names):
            if named:
                context.note(
                    f"The {len(set(named))} names of {feature.key} do not fit its {feature.size} "
                    "values, which are numbered."
                )
            if feature.size > MAX_FEATURES:
                unit = units[0] if len(set(units)) == 1 else UNIT_UNKNOWN
                found.append(Feature(key, unit, shape=(feature.size,)))
                continue
            many = feature.size > 1
            named = tuple(f"{key}/{n}" for n in range(feature.size)) if many else (key,)
        found += [Feature(name, unit) for name, unit in zip(named, units, strict=True)]
    if len({feature.name for feature in found}) < len(found):
        context.note("Names of several features are the same: their values are numbered.")
        found = [Feature(f"value/{n}", UNIT_UNKNOWN) for n in range(sum(f.size for f in found))]
    return Layout(tuple(found)).to_json() if found else ""


def read_lerobot(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset."""
    path = folder / INFO
    info = read_json_object(path)
    version = str(info.get("codebase_version", "unknown"))
    if not version.startswith("v3."):
        raise DemosError(
            f"{folder} has version {version} of LeRobot's format, and only 3 can be imported: "
            "convert it with `python -m lerobot.datasets.v30.convert_dataset_v21_to_v30` of "
            "lerobot 0.4, which converts v2.1."
        )
    kept = _chosen(_read_features(info, path), context, path)
    rate = info.get("fps")
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < math.inf:
        raise DemosError(f"{path}: fps must be a positive number, got {rate!r}.")
    camera = kept.picture
    header = EpisodeHeader(
        action_layout=_layout([kept.action], context),
        state_layout=_layout(kept.states, context),
        image_size=None if camera is None else camera.picture_size(path),
        control_hz=float(rate),
        robot=str(info.get("robot_type") or ""),
        source="lerobot",
        notes={"dataset": folder.resolve().name}
        | ({} if camera is None else {"camera": camera.key}),
    )
    rows = all_rows(inside(folder, TASKS, path), None) if (folder / TASKS).is_file() else []
    texts = [[value for value in row.values() if isinstance(value, str)] for row in rows]
    tasks = [text[0] for text in texts if text]
    video = camera.key if camera is not None and camera.kind == "video" else ""
    places, twice = read_places(folder, video, context)
    total = sum(place["length"] for place in places)
    for key, count in (("total_episodes", len(places)), ("total_frames", total)):
        if info.get(key, count) != count:
            context.warn(f"{INFO} has {key} {info[key]}, and {EPISODES} {count}.")
    ours = _own_headers(folder, places[-1]["episode_index"] + 1 if places else 0)
    unpacked: dict[Path, int] = {}
    for located in locate(folder, info, places, twice, video, header.image_size, context):
        number, task = located.number, located.place.get("tasks")
        about, drivers, outcome = header, list[Driver](), ""
        said = ", ".join(map(str, cast("list[Any]", task))) if isinstance(task, list) else ""
        if said or len(tasks) == 1:
            about = replace(about, notes=about.notes | {"task": said or tasks[0]})
        if ours:
            about, drivers = _own_header(ours[number], about, f"{folder / OURS}, episode {number}")
            outcome = str(ours[number].get("outcome", ""))
        yield ExchangeEpisode(
            header=about,
            rows=_rows(located, kept, about, drivers, context, unpacked),
            name=f"{folder}, episode {number}",
            outcome=outcome,
        )


def _own_headers(folder: Path, count: int) -> list[dict[str, Any]]:
    """Return the headers of a dataset that Shapechanger exported; [] for one of others."""
    path = folder / OURS
    if not path.is_file():
        return []
    headers = own_headers(read_json_object(path), path)
    if len(headers) != count:
        raise DemosError(
            f"{path} describes {len(headers)} episodes, and the dataset has {count}: remove it if "
            "the dataset was edited."
        )
    return headers


def _own_header(
    plain: dict[str, Any], found: EpisodeHeader, where: str
) -> tuple[EpisodeHeader, list[Driver]]:
    """Return the header of an own episode, and the driver of each step."""
    try:
        header = EpisodeHeader.from_json(plain)
        runs = [(str(driver), int(count)) for driver, count in plain.get("drivers", [])]
    except (DemosError, TypeError, ValueError) as error:
        raise DemosError(f"{where}: {error}") from error
    drivers: list[Driver] = []
    for driver, count in runs:
        if driver not in DRIVERS:
            raise DemosError(f"{where}: {UnknownName('driver', driver, DRIVERS)}")
        if not 0 <= count <= _MAX_STEPS - len(drivers):
            raise DemosError(f"{where}: {count} steps of a driver cannot be.")
        drivers.extend(driver for _ in range(count))
    ours, theirs = ((one.action_size, one.state_size, one.image_size) for one in (header, found))
    if ours != theirs:
        raise DemosError(
            f"{where} is of another dataset, with other actions, states or pictures: remove the "
            "file if the dataset was edited."
        )
    # The times are those of the dataset.
    clock = "real" if header.clock == "none" else header.clock
    return replace(header, clock=clock, notes=found.notes | header.notes), drivers


def _rows(
    located: LocatedEpisode,
    kept: _Kept,
    header: EpisodeHeader,
    drivers: Sequence[Driver],
    context: ImportContext,
    unpacked: dict[Path, int],
) -> Iterator[ExchangeStep]:
    """Yield the steps of an episode; `unpacked` counts the bytes of pictures of each file."""
    pictures = _pictures(located, kept, header, unpacked)
    frames = located.frames.tolist()
    left_from, reason = 0, ""
    shown: bytes | None = None
    try:
        for number, (row, picture) in enumerate(pictures):
            frame, left_from = int(frames[number]), number + 1
            fault = picture if isinstance(picture, str) else ""
            if not fault and not np.isfinite(row[_ACTION]).all():
                fault = "with an action that is not finite"
            if fault:
                context.leave_out("step", fault, f"{frame} of episode {located.number}")
                continue
            reward = float(row[_REWARD][0]) if _REWARD in row else math.nan
            done = DONE in row and bool(row[DONE][0])
            ended = bool(row[_TERMINATED][0]) if _TERMINATED in row else done
            step = Step(
                action=tuple(row[_ACTION].tolist()),
                driver=drivers[frame] if frame < len(drivers) else "person",
                state=tuple(value for f in kept.states for value in row[f.key].tolist()),
                captured_ns=int(located.times_ns[number]),
                reward=None if math.isnan(reward) else reward,
                terminated=ended,
                truncated=done and not ended,
            )
            jpeg = cast("bytes | None", picture)
            yield ExchangeStep(step=step, jpeg=None if jpeg is shown else jpeg)
            shown = jpeg
    except UnpacksToTooMuch:
        raise
    except DemosError as error:
        reason = f"that cannot be read: {str(error).removesuffix('.')}"
    for frame in frames[left_from:]:
        context.leave_out("step", reason, f"{frame} of episode {located.number}")


def _pictures(
    located: LocatedEpisode, kept: _Kept, header: EpisodeHeader, unpacked: dict[Path, int]
) -> Iterator[tuple[dict[str, Any], bytes | str | None]]:
    """Yield the numbers of each step, and its picture as JPEG or why it has none."""
    feature, size = kept.picture, header.image_size
    rows = _in_order(located, kept)
    if feature is None or size is None:
        yield from zip(rows, repeat(None))
        return
    if located.video is not None and located.times is not None:
        wanted = located.ticks.tolist()
        shown = read_pictures(located.video, located.times, wanted, size) if wanted else ()
        yield from zip(rows, map(encode_picture, shown), strict=True)
        return
    check = Pictures(size)
    paths = [path for path, _, _ in located.rows_by_file()]
    most = MAX_UNPACKED + MAX_PACKED * sum(path.stat().st_size for path in paths)
    read, picture = b"", cast("bytes | str", "")
    for row in rows:
        data = _stored(row[feature.key])
        if data != read or not data:  # Else the steps share a picture.
            unpacked[paths[0]] = unpacked.get(paths[0], 0) + len(data)
            if unpacked[paths[0]] > most:  # One picture can stand in any number of rows.
                raise UnpacksToTooMuch(f"{paths[0]} unpacks to more than {most} bytes of pictures.")
            read, picture = data, _as_jpeg(data, check)
        yield row, picture


def _as_jpeg(data: bytes, check: Pictures) -> bytes | str:
    """Return a picture of a table as JPEG, or why it is left out."""
    if not data:
        return "whose picture is not in the table"
    if len(data) > MAX_PICTURE_BYTES:
        return f"with a picture of more than {MAX_PICTURE_BYTES} bytes"
    try:
        jpeg = as_jpeg(data, "A picture")
        check.check(jpeg, "in the table", decode=jpeg is data)
    except PictureError as error:
        return error.reason
    except DemosError as error:
        return f"with a picture that cannot be taken: {str(error).removesuffix('.')}"
    return jpeg


def _in_order(located: LocatedEpisode, kept: _Kept) -> Iterator[dict[str, Any]]:
    """Yield the features of each step in order: vectors, and pictures as stored."""
    sizes = {f.key: f.size for f in (kept.action, *kept.states)} | dict.fromkeys(kept.columns, 1)
    stored = [kept.picture.key] if kept.picture is not None and kept.picture.kind == "image" else []
    waiting: dict[int, dict[str, Any]] = {}  # Rows of a file that is not in order.
    due = held = 0
    for path, places, rows in located.rows_by_file():
        for place, row in zip(places.tolist(), rows_at(path, rows, sizes, stored), strict=True):
            waiting[place] = row
            held += sum(len(_stored(row[key])) for key in stored)
            while due in waiting:
                row = waiting.pop(due)
                held -= sum(len(_stored(row[key])) for key in stored)
                yield row
                due += 1
            if held > MAX_UNPACKED:  # Many rows may share one large value.
                raise DemosError(f"{path} has pictures too far out of order: sort its rows.")


def _stored(value: Any) -> bytes:
    """Return the bytes of a picture of a table; b"" if it has none."""
    data = cast("dict[str, Any]", value).get("bytes") if isinstance(value, dict) else None
    return data if isinstance(data, bytes) else b""


FORMAT: Final = Format(
    name="lerobot",
    title="LeRobot",
    sign=INFO,
    detect=lambda folder: (folder / INFO).is_file(),
    read=read_lerobot,
    write=write,
    options=frozenset({"camera", "task", "images"}),
    consecutive=True,
    timed=False,
)
