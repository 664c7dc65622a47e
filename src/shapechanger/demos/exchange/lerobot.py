"""Import of LeRobot datasets, version 3, from Shapechanger or from other programs.

In a dataset from another program, `action` becomes the action, the numbers of `observation.*` the
state, and one camera the image. The driver is assumed to be a person, who teleoperated the robot.

The `episode_index`, `frame_index`, `index` and `timestamp` of a row must agree with each other and
with the row of its episode in `meta/episodes`. The image of a step is the one that the video shows
at that time. Episodes with a contradiction are left out, because either side may be wrong.
"""

from __future__ import annotations

import glob
import math
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, product
from pathlib import Path
from typing import Annotated, Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver, EpisodeHeader, Step
from shapechanger.demos.exchange import base, files
from shapechanger.demos.exchange.lerobot_export import DONE, EPISODES, INFO, OURS, write
from shapechanger.demos.exchange.video import VideoTimes, read_pictures, read_times
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

_ACTION, _STATE, _REWARD, _TERMINATED = (
    base.COLUMNS[field]["lerobot"] for field in ("action", "state", "reward", "terminated")
)
# Largest difference between the times of a step and of its image, s: `tolerance_s` of lerobot
# 0.4.4. Rounding to 32 bits and to the ticks of the video is allowed in addition.
_TOLERANCE_S: Final = 1e-4
_ROUNDING: Final = 2.0**-23
_KEYS: Final = ("episode_index", "frame_index", "index", "timestamp")
_OBSERVATION: Final = "observation."
_CAMERAS: Final = "observation.images."
_NUMBERS: Final = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)")
_PLACE: Final = re.compile(r"\{(video_key|chunk_index|file_index)(?::0?(\d)d)?\}")
_MAX_PACKED: Final = 64  # Largest ratio of unpacked bytes to bytes of a file.
_MOST: Final = 1 << 20  # Largest number of steps of an episode, and of episodes.
_ROWS: Final = 256  # Rows in memory at once; fewer if the values of a column are large.

_Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=1e5)]


class _Feature(msgspec.Struct, kw_only=True):
    kind: str = msgspec.field(name="dtype")
    shape: tuple[Annotated[int, msgspec.Meta(ge=1)], ...]
    names: Any = None
    units: Any = None
    info: dict[str, Any] | None = None

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def is_image(self) -> bool:
        is_depth = any(map((self.info or {}).get, ("video.is_depth_map", "is_depth_map")))
        return self.kind in {"video", "image"} and not is_depth

    @property
    def is_number(self) -> bool:
        fits = len(self.shape) != 3 and self.size <= files.MAX_VALUES
        return fits and _NUMBERS.fullmatch(self.kind) is not None


class _Info(msgspec.Struct, kw_only=True):
    codebase_version: str
    fps: Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
    features: dict[str, _Feature]
    data_path: str
    video_path: str | None = None
    robot_type: str | None = None
    total_episodes: int
    total_frames: int


class _Entry(msgspec.Struct, kw_only=True):
    """A row of `meta/episodes`; the last four fields are columns of the video, if there is one."""

    episode_index: Annotated[int, msgspec.Meta(ge=0, lt=_MOST)]
    length: Annotated[int, msgspec.Meta(ge=1, lt=_MOST)]
    tasks: list[Annotated[str, msgspec.Meta(max_length=4096)]]
    dataset_from_index: int
    video_chunk: int = msgspec.field(name="chunk_index", default=0)
    video_file: int = msgspec.field(name="file_index", default=0)
    from_timestamp: _Seconds = 0.0
    to_timestamp: _Seconds = 0.0


class _Dataset:
    def __init__(self, folder: Path, context: base.ImportContext) -> None:
        self._folder, self._context, path = folder, context, folder / INFO
        self._info: _Info = files.read_json(path, _Info)
        features, version = self._info.features, self._info.codebase_version
        if not version.startswith("v3."):
            raise DemosError(
                f"{folder} has version {version} of LeRobot's format, but only 3 can be imported: "
                "convert 2.1 by lerobot.datasets.v30.convert_dataset_v21_to_v30 of lerobot 0.4."
            )
        sizes = {key: one.size for key, one in features.items() if one.is_number}
        if _ACTION not in sizes:
            raise DemosError(f"{path} has no numeric feature {_ACTION!r} to import as action.")
        states = [k for k in sizes if k.startswith(_OBSERVATION) and not k.startswith(_CAMERAS)]
        self._states = sorted(states, key=lambda key: key != _STATE)  # The state first.
        single = [key for key in (_REWARD, DONE, _TERMINATED) if sizes.get(key) == 1]
        self._sizes = {key: sizes[key] for key in (_ACTION, *states)}
        self._sizes |= dict.fromkeys((*single, *_KEYS), 1)
        cameras = {k.removeprefix(_CAMERAS): k for k, one in features.items() if one.is_image}
        context.camera = context.camera.removeprefix(_CAMERAS)
        camera = cameras.get(base.choose_camera(folder, list(cameras), context), "")
        self._size = files.image_size(features[camera].shape, (1, 3, 4)) if camera else None
        if camera and self._size is None:
            shape = list(features[camera].shape)
            raise DemosError(f"{path}: {camera} has the shape {shape}, not the shape of an image.")
        self._stored = [camera] if camera and features[camera].kind == "image" else []
        self._video = f"videos/{camera}/" if camera and not self._stored else ""
        for key, one in features.items():
            if key not in {*self._sizes, camera, "task_index"}:
                about = f"{key} ({one.kind}, {' x '.join(map(str, one.shape))})"
                context.report("note", f"The feature {about} is not imported.")
        notes = {"dataset": folder.resolve().name} | ({"camera": camera} if camera else {})
        self._header = EpisodeHeader(
            action_layout=self._layout([_ACTION]),
            state_layout=self._layout(self._states),
            image_size=self._size,
            control_hz=self._info.fps,
            robot=self._info.robot_type or "",
            source="lerobot",
            notes=notes,
        )
        self._entries = self._read_entries()
        self._most_bytes = files.MAX_UNPACKED  # Limit on all images in the tables together.
        self._rows = self._find_rows()
        self._videos: dict[str, VideoTimes | DemosError] = {}

    def read(self) -> Iterator[base.ExchangeEpisode]:
        """Yield the episodes; iterating the records of one with contradictions raises an error."""
        path, header = self._folder / OURS, self._header
        section = files.read_json(path) if path.is_file() else None
        own = files.own_episodes(section, path, max(self._entries) + 1, header)
        for number, entry in self._entries.items():
            head, outcome, drivers = own[number] if own else (header, "", iter(()))
            task = {"task": ", ".join(entry.tasks)} if entry.tasks else {}
            clock = "real" if head.clock == "none" else head.clock  # The dataset has times.
            head = replace(head, clock=clock, notes=header.notes | task | head.notes)
            records, name = self._records(entry, drivers), f"episode {number}"
            yield base.ExchangeEpisode(header=head, records=records, name=name, outcome=outcome)

    def _layout(self, keys: Sequence[str]) -> Layout:
        """Return the layout of the values of features, with their names and units."""
        found: list[Feature] = []
        for key in keys:
            feature, short = self._info.features[key], key.removeprefix(_OBSERVATION)
            prefix = "" if key in {_ACTION, _STATE} else f"{short}/"
            names = [name and prefix + name for name in _flat_names(feature.names)]
            if names and (len(set(names)) != feature.size or not all(names)):
                text = f"The names of {key} do not fit its {feature.size} values: using numbers."
                self._context.report("note", text)
                names = []
            units = _flat_names(feature.units)
            found += base.features_of(short, feature.size, names=names, units=units)
        return Layout(tuple(found))

    def _read_entries(self) -> dict[int, _Entry]:
        """Return the rows of `meta/episodes` in order, keyed by number of the episode."""
        fields = _Entry.__struct_encode_fields__[: None if self._video else 4]
        names = [name if n < 4 else self._video + name for n, name in enumerate(fields)]
        entries: list[_Entry] = []
        for path in sorted((self._folder / EPISODES).glob("*/*.parquet")):
            files.inside(self._folder, str(path.relative_to(self._folder)), path)
            for batch in _batches(path, names):
                rows = batch.rename_columns(list(fields)).to_pylist()
                entries += files.converted(rows, list[_Entry], path, strict=False)
        found = {entry.episode_index: entry for entry in entries}
        if not found or len(found) < len(entries):
            raise DemosError(f"{self._folder / EPISODES} does not have each episode once.")
        totals = self._info.total_episodes, self._info.total_frames
        if totals != (count := (len(entries), sum(entry.length for entry in entries))):
            text = f"{INFO} has {totals} episodes and steps, and {EPISODES} {count}."
            self._context.report("warning", text)
        return dict(sorted(found.items()))

    def _find_rows(self) -> dict[float, list[Path]]:
        """Return the files with rows of each episode, keyed by number of the episode.

        All files are searched, because LeRobot's converter to version 3 wrote wrong numbers of
        files to `meta/episodes` (LeRobot's issue 2401).
        """
        found, columns = defaultdict[float, list[Path]](list), set[str]()
        pattern = _PLACE.sub("*", glob.escape(self._info.data_path))
        for name in sorted(glob.glob(pattern, root_dir=self._folder)):
            try:
                path = files.inside(self._folder, name, INFO)
                batches = [_vectors(batch, _KEYS[0], 1) for batch in _batches(path, _KEYS[:1])]
                columns |= set(files.library("pyarrow.parquet", "lerobot").read_schema(path).names)
            except DemosError as error:
                self._context.report("left out", str(error).removesuffix("."), name)
                continue
            for number in {number for batch in batches for number in np.unique(batch).tolist()}:
                found[number].append(path)
            self._most_bytes += _MAX_PACKED * path.stat().st_size
        for column in sorted(columns - self._info.features.keys()):
            if not column.startswith("__index_level_"):  # Index columns of pandas.
                self._context.report("note", f"The column {column} is not imported.")
        for number in sorted(found.keys() - self._entries.keys()):
            self._context.report("left out", f"{EPISODES} does not have it", f"episode {number:g}")
        return found

    def _video_name(self, entry: _Entry) -> str:
        """Return the path of an episode's video by the template of `info.json`.

        `str.format` is not used, because the template is untrusted.
        """
        about = {"chunk_index": str(entry.video_chunk), "file_index": str(entry.video_file)}
        about["video_key"] = self._video.removeprefix("videos/").rstrip("/")
        template = self._info.video_path or ""
        return _PLACE.sub(lambda at: about[at[1]].rjust(int(at[2] or 0), "0"), template)

    def _times(self, name: str) -> VideoTimes:
        """Read the times of a video; refuse a video that does not fit its episodes."""
        times = read_times(files.inside(self._folder, name, self._folder / EPISODES))
        if times.size != self._size:
            raise DemosError(f"{name} has images of {times.size} pixels, not {self._size}.")
        entries = (one for one in self._entries.values() if self._video_name(one) == name)
        spans_s = np.array(sorted((one.from_timestamp, one.to_timestamp) for one in entries))
        steps_s = np.diff(times.seconds)
        half_s = 0.5 * float(np.median(steps_s)) if len(steps_s) else 0.5 / self._info.fps
        shown_s = times.seconds[[0, -1]] + [0.0, 2.0 * half_s]
        stated_s = spans_s[[0, -1], [0, 1]]
        lost_s = (shown_s - stated_s) * [1.0, -1.0]  # Missing time at the start and at the end.
        (first, last), (start, end) = shown_s, stated_s
        about = f"{name} shows {first:.4g} to {last:.4g} s, but {EPISODES} states "
        about += f"{start:.4g} to {end:.4g} s"
        # After a lost image, the later images are shifted, and it is unknown which one was lost.
        if lost_s.max() > half_s:
            raise DemosError(f"{about}.")
        if lost_s.min() < -half_s:
            self._context.report("warning", f"There are more images: {about}.")
        if (np.diff(spans_s.ravel()) < -half_s).any():
            raise DemosError(f"Parts of {name} overlap, or end before they begin.")
        return times

    def _filmed(self, entry: _Entry) -> Iterator[NDArray[np.uint8]]:
        """Yield the image of each step of an episode; refuse an episode with a missing image."""
        name = self._video_name(entry)
        if name not in self._videos:
            try:
                self._videos[name] = self._times(name)
            except DemosError as error:  # The next episode of this video is refused at once.
                self._videos[name] = error
        times = self._videos[name]
        if isinstance(times, DemosError):
            raise times
        at_s = entry.from_timestamp + np.arange(entry.length) / self._info.fps
        most_s = _TOLERANCE_S + _ROUNDING * at_s + 0.5 * float(times.tick_s)
        nearest = np.searchsorted((times.seconds[1:] + times.seconds[:-1]) / 2.0, at_s)
        off_s = np.abs(times.seconds[nearest] - at_s)
        if not (off_s <= most_s).all() or at_s[-1] > entry.to_timestamp - 2.0 * most_s[-1]:
            raise DemosError(f"{name} lacks an image at the time of a step.")
        return read_pictures(self._folder / name, times, times.ticks[nearest])

    def _records(self, entry: _Entry, drivers: Iterator[Driver]) -> Iterator[base.ExchangeRecord]:
        """Yield the records of an episode; refuse rows with unexpected keys."""
        number, rate_hz, first = entry.episode_index, self._info.fps, entry.dataset_from_index
        images = self._filmed(entry) if self._video else None
        where, done, read = f"episode {number}", 0, b""
        paths, names = self._rows.get(number, []), [*self._sizes, *self._stored]
        for batch in chain.from_iterable(_batches(path, names, number) for path in paths):
            columns = {key: _vectors(batch, key, size) for key, size in self._sizes.items()}
            rows = np.flatnonzero(columns[_KEYS[0]] == number)
            frames = np.arange(done, done + len(rows))
            done += len(rows)
            keys = np.hstack([columns[key][rows] for key in _KEYS])
            right = [np.full_like(frames, number), frames, frames + first, frames / rate_hz]
            right = np.stack(right, axis=1)
            if done > entry.length or not np.allclose(keys, right, _ROUNDING, _TOLERANCE_S):
                raise DemosError(f"The keys of {where} do not fit {EPISODES}.")
            for frame, row in zip(frames.tolist(), rows.tolist(), strict=True):
                one = {key: values[row].tolist() for key, values in columns.items()}
                (reward,), (is_done,) = one.get(_REWARD, [math.nan]), one.get(DONE, [0.0])
                (ended,) = one.get(_TERMINATED, [is_done])
                image = next(images) if images else None
                for name in self._stored:
                    match batch.column(name)[row].as_py():
                        case {"bytes": bytes() as image}:
                            pass
                        case _:
                            image = b""
                    self._most_bytes -= 0 if image == read else len(image)
                    read = image
                    if self._most_bytes < 0:
                        raise DemosError(f"{where} has images of far more bytes than its files.")
                yield base.ExchangeRecord(
                    name=f"step {frame} of {where}",
                    step=Step(
                        action=tuple(one[_ACTION]),
                        driver=next(drivers, None) or "person",
                        state=tuple(value for key in self._states for value in one[key]),
                        captured_ns=round(frame / rate_hz * 1e9),
                        reward=None if math.isnan(reward) else reward,
                        terminated=bool(ended),
                        truncated=bool(is_done and not ended),
                    ),
                    image=image,
                    frame=frame if self._video else None,
                )
        if done < entry.length:
            raise DemosError(f"The data have {done} of the {entry.length} rows of {where}.")


def _flat_names(plain: Any) -> tuple[str, ...]:
    """Return the names of a feature's values in any of the three forms that datasets use.

    The forms are `["pan", "tilt"]`, `{"motors": ["pan", "tilt"]}` and `{"pan": 0, "tilt": 1}`.
    """
    if isinstance(plain, dict):
        named = cast("dict[str, Any]", plain)
        if sorted(map(repr, named.values())) == sorted(map(repr, range(len(named)))):
            return tuple(sorted(named, key=lambda name: named[name]))
        return tuple(chain.from_iterable(map(_flat_names, named.values())))
    return tuple(map(str, cast("list[Any]", plain))) if isinstance(plain, list) else ()


def _batches(path: Path, columns: Sequence[str], number: float | None = None) -> Iterator[Any]:
    """Yield a few rows of a Parquet file at a time; skip groups without episode `number`."""
    arrow, parquet = (files.library(name, "lerobot") for name in ("pyarrow", "pyarrow.parquet"))
    try:
        # Without these options, a whole row group is read at once, which may have many images.
        with parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            about, size, largest, claimed = file.metadata, path.stat().st_size, 1, 0
            if missing := [key for key in columns if key not in file.schema_arrow.names]:
                raise DemosError(f"{path} has no column {missing[0]!r}.")
            groups = list(range(about.num_row_groups))
            for group, place in product(tuple(groups), range(about.num_columns)):
                part = about.row_group(group).column(place)
                unpacked = max(part.total_uncompressed_size, 8 * part.num_values)
                claimed += unpacked
                if part.path_in_schema.startswith(tuple(columns)):
                    largest = max(largest, unpacked)
                span = part.statistics if part.path_in_schema == _KEYS[0] else None
                if number is not None and span is not None and span.has_min_max:
                    groups = [n for n in groups if n != group or span.min <= number <= span.max]
            if claimed > files.MAX_UNPACKED + _MAX_PACKED * size or about.num_rows > size:
                text = f"{size} bytes, but claims {about.num_rows} rows of {claimed} bytes"
                raise DemosError(f"{path} has {text}.")
            # Many rows may share one large value, of which each row has a copy in memory.
            rows = max(1, min(_ROWS, files.MAX_UNPACKED // largest))
            yield from file.iter_batches(rows, row_groups=groups, columns=columns)
    except (arrow.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise DemosError(f"{path} is not an intact Parquet file: {reason}.") from error


def _vectors(batch: Any, key: str, size: int) -> NDArray[np.float64]:
    """Return the numbers of a column, shape (n, size)."""
    try:
        return np.array(batch.column(key).to_pylist(), np.float64).reshape(batch.num_rows, size)
    except (TypeError, ValueError) as error:
        raise DemosError(f"A row of {key!r} does not have {size} numbers.") from error


FORMAT: Final = base.Format(
    name="lerobot",
    title="LeRobot",
    sign=INFO,
    detect=lambda folder: (folder / INFO).is_file(),
    read=lambda folder, context: _Dataset(folder, context).read(),
    write=write,
    options=frozenset({"camera", "task", "images"}),
    consecutive=True,
    timed=False,
)
