"""LeRobot datasets, version 3: our own with their layouts, and those of others.

Of a dataset of others, `action` becomes the action, the numbers of `observation.*` become the
state, and one camera the image. Units are unknown and written "?", unless the feature states
them, and the driver is taken to be a person, who teleoperated the robot. Images that are stored
as JPEG are kept; videos and PNGs are encoded as JPEG of quality 100, which changes them slightly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, repeat
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver, EpisodeHeader, Step
from shapechanger.demos.exchange import files, imports
from shapechanger.demos.exchange.format import ExchangeEpisode, Format, ImportContext, name_in
from shapechanger.demos.exchange.imports import SourceRecord
from shapechanger.demos.exchange.lerobot_export import DONE, EPISODES, INFO, OURS, TASKS, write
from shapechanger.demos.exchange.lerobot_index import Index, Located
from shapechanger.demos.exchange.pictures import read_pictures
from shapechanger.demos.jpeg import MAX_PIXELS
from shapechanger.errors import DemosError
from shapechanger.layout import Feature

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


class _Feature(msgspec.Struct, kw_only=True):
    """A feature of `info.json`."""

    key: str = ""
    kind: str = msgspec.field(name="dtype")
    shape: tuple[Annotated[int, msgspec.Meta(ge=1)], ...]
    names: Any = None
    units: Any = None
    info: dict[str, Any] | None = None
    depth: Any = msgspec.field(default=None, name="is_depth_map")
    video_depth: Any = msgspec.field(default=None, name="video.is_depth_map")

    @property
    def is_depth(self) -> bool:
        about = self.info or {}
        return bool(self.depth or self.video_depth) or any(map(about.get, _DEPTH))

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def is_image(self) -> bool:
        """Whether it is an image of any kind, also as numbers."""
        return len(self.shape) == 3 or self.key.startswith(_CAMERAS)

    @property
    def is_number(self) -> bool:
        """Whether its values are numbers, and not those of an image."""
        plain = bool(_NUMBERS.fullmatch(self.kind)) and self.size <= files.MAX_VALUES
        return plain and not self.is_image

    @property
    def is_picture(self) -> bool:
        """Whether it is a camera's whose images can be imported."""
        return self.kind in {"video", "image"} and not self.is_depth

    def picture_size(self, path: Path) -> tuple[int, int]:
        """Return the width and height of its images, pixels, which are compared with it.

        Axes are found by their names if those fit, or else by the number of colours.
        """
        shape = (self.shape if len(self.shape) == 3 else (*self.shape, 1, 0, 0))[:3]
        axes = [name[:1].lower() for name in self.names]
        if sorted(axes) == _AXES and shape[axes.index("c")] in _CHANNELS:
            channels, height, width = (shape[axes.index(axis)] for axis in _AXES)
        elif shape[2] in _CHANNELS:
            height, width, channels = shape
        else:
            channels, height, width = shape
        if channels not in _CHANNELS or not 0 < height * width <= MAX_PIXELS:
            raise DemosError(
                f"{path}: {self.key} has the shape {list(self.shape)}, not of an image."
            )
        return width, height


def _read_features(info: Mapping[str, Any], path: Path) -> list[_Feature]:
    try:
        found = msgspec.convert(info.get("features"), dict[str, _Feature])
    except msgspec.ValidationError as error:
        raise DemosError(f"{path}: the features are invalid ({error}).") from error
    for key, feature in found.items():
        feature.key, feature.names = key, _flat_names(feature.names)
        if key in {_ACTION, _STATE} and feature.size > files.MAX_VALUES:
            raise DemosError(f"{path}: the feature {key!r} has the shape {list(feature.shape)}.")
    return list(found.values())


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


class _Kept(NamedTuple):
    """The features that are imported; `columns` has those of single numbers."""

    action: _Feature
    states: tuple[_Feature, ...]
    camera: _Feature | None
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
    cameras = {f.key.removeprefix(_CAMERAS): f for f in features if f.is_picture}
    context.camera = context.camera.removeprefix(_CAMERAS)
    camera = cameras.get(imports.choose_camera(path.parent.parent, list(cameras), context))
    taken = {_ACTION, *(f.key for f in states), *columns, *_BOOKKEEPING}
    for feature in features:
        if feature.key in taken or feature is camera:
            continue
        about = f"{feature.key} ({feature.kind}, {' x '.join(map(str, feature.shape))})"
        image = len(feature.shape) > 1 or feature.is_image or feature.is_depth
        if feature.is_number or feature.is_picture or not image:
            context.note(f"The feature {about} is not imported.")
        else:
            context.leave_out("feature", "with images of an unknown kind or of depth", about)
    return _Kept(numbers[_ACTION], tuple(states), camera, columns)


def _layout(features: Sequence[_Feature], context: ImportContext) -> str:
    """Return a layout for the values of features, in order, with their names and units."""
    found: list[Feature] = []
    for feature in features:
        key = feature.key.removeprefix(_OBSERVATION)
        prefix = "" if feature.key in {_ACTION, _STATE} else f"{key}/"
        stated = feature.units
        units = list(map(str, cast("list[Any]", stated))) if isinstance(stated, list) else []
        named = tuple(prefix + name for name in feature.names)
        if len(set(named)) != feature.size or not all(feature.names):
            if named:
                context.note(
                    f"The {len(set(named))} names of {feature.key} do not fit its {feature.size} "
                    "values, which are numbered."
                )
            named = ()
        found += imports.features_of(key, feature.size, names=named, units=units)
    if len({feature.name for feature in found}) < len(found):
        context.note("Names of several features are the same: their values are numbered.")
        found = imports.features_of("value", sum(feature.size for feature in found))
    return imports.as_json(found)


def _read(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    path = folder / INFO
    info = files.read_json_object(path)
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
    camera = kept.camera
    notes = {"dataset": folder.resolve().name}
    header = EpisodeHeader(
        action_layout=_layout([kept.action], context),
        state_layout=_layout(kept.states, context),
        image_size=None if camera is None else camera.picture_size(path),
        control_hz=float(rate),
        robot=str(info.get("robot_type") or ""),
        source="lerobot",
        notes=notes if camera is None else notes | {"camera": camera.key},
    )
    has_tasks = (folder / TASKS).is_file()
    rows = files.all_rows(files.inside(folder, TASKS, path), None) if has_tasks else []
    texts = [[value for value in row.values() if isinstance(value, str)] for row in rows]
    tasks = [text[0] for text in texts if text]
    video = camera.key if camera is not None and camera.kind == "video" else ""
    index = Index(folder, info, video, header.image_size, context)
    for key, count in (("total_episodes", len(index.places)), ("total_frames", index.steps)):
        if info.get(key, count) != count:
            context.warn(f"{INFO} has {key} {info[key]}, and {EPISODES} {count}.")
    ours: list[Any] = []
    if (folder / OURS).is_file():
        count = max(index.places, default=-1) + 1
        ours = files.own_episodes(files.read_json_object(folder / OURS), folder / OURS, count)
    unpacked: dict[Path, int] = {}
    for located in index.locate():
        number, task = located.place.number, located.place.tasks
        about, drivers, outcome = header, list[Driver](), ""
        said = ", ".join(map(str, cast("list[Any]", task))) if isinstance(task, list) else ""
        if said or len(tasks) == 1:
            about = replace(about, notes=about.notes | {"task": said or tasks[0]})
        if ours:
            about, outcome, drivers = _own(
                ours[number], about, f"{folder / OURS}, episode {number}"
            )
        records = _records(located, kept, about, drivers, unpacked)
        rest = [f"{frame} of episode {number}" for frame in located.steps["frame"].tolist()]
        rows = imports.rows_of(records, about.image_size, context, "step", rest)
        name = f"{folder}, episode {number}"
        yield ExchangeEpisode(header=about, rows=rows, name=name, outcome=outcome)


def _own(plain: Any, found: EpisodeHeader, where: str) -> tuple[EpisodeHeader, str, list[Driver]]:
    """Return the header and the outcome of an own episode, and the driver of each step."""
    header, outcome = files.own_header(plain, where)
    try:
        runs = msgspec.convert(plain.get("drivers", []), list[tuple[Driver, int]])
    except msgspec.ValidationError as error:
        raise DemosError(f"{where}: the drivers are invalid ({error}).") from error
    if any(count < 0 for _, count in runs) or sum(count for _, count in runs) > _MAX_STEPS:
        raise DemosError(f"{where}: the drivers have less than no step, or more than {_MAX_STEPS}.")
    drivers: list[Driver] = [driver for driver, count in runs for _ in range(count)]
    ours, theirs = ((one.action_size, one.state_size, one.image_size) for one in (header, found))
    if ours != theirs:
        raise DemosError(
            f"{where} is of another dataset, with other actions, states or images: remove the "
            "file if the dataset was edited."
        )
    # The times come from the dataset.
    clock = "real" if header.clock == "none" else header.clock
    return replace(header, clock=clock, notes=found.notes | header.notes), outcome, drivers


def _records(
    located: Located,
    kept: _Kept,
    header: EpisodeHeader,
    drivers: Sequence[Driver],
    unpacked: dict[Path, int],
) -> Iterator[SourceRecord]:
    """Yield the records of an episode; `unpacked` counts the bytes of images of each file."""
    stored = kept.camera.key if kept.camera is not None and kept.camera.kind == "image" else ""
    times = located.times
    videos: Iterator[NDArray[np.uint8] | None] = repeat(None, len(located.steps))
    if located.video is not None and times is not None and header.image_size is not None:
        ticks = located.steps["tick"].tolist()
        videos = read_pictures(located.video, times, ticks, header.image_size)
    paths = [path for path, _, _ in located.rows_by_file()]
    first, sizes = paths[0], sum(path.stat().st_size for path in paths)
    most = files.MAX_UNPACKED + files.MAX_PACKED * sizes
    read = b""
    rows = _in_order(located, kept, stored)
    for step, row, picture in zip(located.steps, rows, videos, strict=True):
        frame = int(step["frame"])
        reward = float(row[_REWARD][0]) if _REWARD in row else math.nan
        done = DONE in row and bool(row[DONE][0])
        ended = bool(row[_TERMINATED][0]) if _TERMINATED in row else done
        record = SourceRecord(
            name=f"{frame} of episode {located.place.number}",
            step=Step(
                action=tuple(row[_ACTION].tolist()),
                driver=drivers[frame] if frame < len(drivers) else "person",
                state=tuple(value for f in kept.states for value in row[f.key].tolist()),
                captured_ns=int(step["time_ns"]),
                reward=None if math.isnan(reward) else reward,
                terminated=ended,
                truncated=done and not ended,
            ),
            picture=picture,
            frame=None if picture is None else frame,
        )
        if stored:
            record.picture = data = _bytes(row[stored])
            unpacked[first] = unpacked.get(first, 0) + (len(data) if data != read else 0)
            if unpacked[first] > most:  # One image can stand in any number of rows.
                raise files.UnpacksToTooMuch(
                    f"{first} unpacks to more than {most} bytes of images."
                )
            read = data
            record.fault = "" if data else "whose image is not in the table"
        yield record


def _in_order(located: Located, kept: _Kept, stored: str) -> Iterator[dict[str, Any]]:
    """Yield the features of each step in order: vectors, and the image as stored."""
    sizes = {f.key: f.size for f in (kept.action, *kept.states)} | dict.fromkeys(kept.columns, 1)
    waiting: dict[int, dict[str, Any]] = {}  # Rows of a file that is not in order.
    due = held = 0
    for path, places, rows in located.rows_by_file():
        found = files.rows_at(path, rows, sizes, [stored] if stored else [])
        for place, row in zip(places.tolist(), found, strict=True):
            waiting[place] = row
            held += len(_bytes(row.get(stored)))
            while due in waiting:
                row = waiting.pop(due)
                held -= len(_bytes(row.get(stored)))
                yield row
                due += 1
            if held > files.MAX_UNPACKED:  # Many rows may share one large value.
                raise DemosError(f"{path} has images too far out of order: sort its rows.")


def _bytes(value: Any) -> bytes:
    data = cast("dict[str, Any]", value).get("bytes") if isinstance(value, dict) else None
    return data if isinstance(data, bytes) else b""


FORMAT: Final = Format(
    name="lerobot",
    title="LeRobot",
    sign=INFO,
    detect=lambda folder: (folder / INFO).is_file(),
    read=_read,
    write=write,
    options=frozenset({"camera", "task", "images"}),
    consecutive=True,
    timed=False,
)
