"""Index of a LeRobot dataset: which rows and which images belong to which step.

Steps are found by their keys. `episode_index` and `frame_index` say which step a row is, and
`timestamp`, added to the start of the episode in its video, which image it has. An episode whose
keys contradict each other, or its entry in `meta/episodes`, is left out: one of them is wrong, and
nothing says which.
"""

from __future__ import annotations

import glob
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange import files
from shapechanger.demos.exchange.format import ImportContext
from shapechanger.demos.exchange.imports import unreadable
from shapechanger.demos.exchange.lerobot_export import EPISODES, INFO
from shapechanger.demos.exchange.pictures import VideoTimes, read_times
from shapechanger.errors import DemosError

TOLERANCE_S: Final = 1e-4
"""Largest difference between the time of a step and that of its image, s: `tolerance_s` of
lerobot 0.4.4. Rounding to 32 bits and to the ticks of the video is allowed in addition."""

_EPISODE, _FRAME, _TIME, _INDEX = "episode_index", "frame_index", "timestamp", "index"
_RATE: Final = 0.05  # Largest difference between the stated rate and that of the times, as a share.
_NS_PER_S: Final = 1e9
_MAX_EPISODES: Final = 1 << 20
_PLACE: Final = re.compile(r"\{(video_key|chunk_index|file_index)(?::0?(\d)d)?\}")
_STEP: Final = np.dtype([(name, np.int64) for name in ("frame", "time_ns", "file", "row", "tick")])


class EpisodeEntry(msgspec.Struct, kw_only=True):
    """A row of `meta/episodes`."""

    number: int = msgspec.field(name="episode_index")
    length: int
    tasks: Any = None
    first: int | None = msgspec.field(default=None, name="dataset_from_index")
    end: int | None = msgspec.field(default=None, name="dataset_to_index")


class _FilmedEntry(EpisodeEntry):
    """The same with the part of the video."""

    chunk_index: int
    file_index: int
    from_timestamp: float
    to_timestamp: float


@dataclass(frozen=True, slots=True)
class Located:
    """An episode whose keys agree.

    Attributes:
        place: Its row of `meta/episodes`.
        steps: Its steps in order, a structured array: `frame_index`, time since the start in ns,
            number of the file in `paths`, row in it, and time of the image in ticks.
        paths: All data files.
        video: The video; None without one.
        times: Its times; None without one.
    """

    place: EpisodeEntry
    steps: NDArray[Any]
    paths: Sequence[Path]
    video: Path | None = None
    times: VideoTimes | None = None

    def rows_by_file(self) -> Iterator[tuple[Path, NDArray[np.int64], NDArray[np.int64]]]:
        """Yield each file with positions of steps, and their rows there, which ascend."""
        for file in np.unique(self.steps["file"]).tolist():
            here = np.flatnonzero(self.steps["file"] == file)
            here = here[np.argsort(self.steps["row"][here])]
            yield self.paths[file], here, self.steps["row"][here]


class _Contradiction(Exception):
    """Why an episode is left out: a reason that fits the plural, and the size of the difference."""

    def __init__(self, reason: str, size: str = "") -> None:
        super().__init__(reason)
        self.reason = reason
        self.size = f" ({size})" if size else ""


class Index:
    """The entries of `meta/episodes`, and the keys of all rows and images.

    Args:
        folder: The dataset.
        info: Its `info.json`.
        camera: Key of the video that is imported; "" without one.
        size: Width and height of its images, pixels.
        context: Collects what is left out.

    Attributes:
        places: The rows of `meta/episodes` by their `episode_index`, in order.
        steps: Number of steps that they state.
    """

    def __init__(
        self,
        folder: Path,
        info: Mapping[str, Any],
        camera: str,
        size: tuple[int, int] | None,
        context: ImportContext,
    ) -> None:
        self._folder = folder
        self._info = info
        self._video = f"videos/{camera}/" if camera else ""
        self._size = size
        self._context = context
        self._rate_hz = float(info["fps"])
        self.places, twice = self._read_places()
        self.steps = sum(place.length for place in self.places.values())
        self._paths = self._data_files()
        self._unknown: set[str] = set()
        keys = np.concatenate([np.empty((0, 6)), *map(self._read, range(len(self._paths)))])
        for column in sorted(self._unknown):
            context.leave_out("column", f"that {INFO} does not describe", column)
        self._order = np.lexsort((keys[:, 1], keys[:, 0]))
        self._keys = keys[self._order]
        numbers, starts, counts = np.unique(self._keys[:, 0], return_index=True, return_counts=True)
        ends = starts + counts
        self._spans = dict(zip(numbers.astype(int).tolist(), map(slice, starts, ends), strict=True))
        for number in sorted(self._spans.keys() - self.places.keys() - twice):
            context.leave_out("episode", f"that {EPISODES} does not have", number)
        self._videos: dict[Path, VideoTimes | str] = {}
        self._filmed: dict[Path, list[_FilmedEntry]] = defaultdict(list)
        self._overlaps: dict[int, str] = {}
        for place in self.places.values():
            if isinstance(place, _FilmedEntry):
                self._filmed[self._video_path(place)].append(place)

    def _read_places(self) -> tuple[dict[int, EpisodeEntry], set[int]]:
        """Return the rows of `meta/episodes` in order, and the numbers that are there twice."""
        paths = sorted((self._folder / EPISODES).glob("*/*.parquet"))
        if not paths:
            raise DemosError(f"There is no {EPISODES}/*/*.parquet in {self._folder}: restore it.")
        kind = _FilmedEntry if self._video else EpisodeEntry
        own = {field.encode_name for field in msgspec.structs.fields(EpisodeEntry)}
        names = own | {self._video + name for name in _FilmedEntry.__struct_fields__ if self._video}
        found: dict[int, EpisodeEntry] = {}
        twice: set[int] = set()
        for path in paths:
            inner = files.inside(self._folder, str(path.relative_to(self._folder)), path)
            for row in files.all_rows(inner, names):
                plain = {name.removeprefix(self._video): value for name, value in row.items()}
                try:
                    place = msgspec.convert(plain, kind, strict=False)
                except msgspec.ValidationError as error:
                    raise DemosError(f"{path} is not a table of episodes: {error}.") from error
                twice |= {place.number} & found.keys()
                found[place.number] = place
        if not found or not 0 <= min(found) <= max(found) < _MAX_EPISODES:
            raise DemosError(f"{self._folder / EPISODES} has no episodes with numbers from 0.")
        for number in sorted(twice):
            self._context.leave_out("episode", f"that {EPISODES} has twice", number)
        for number in sorted(set(range(max(found))) - found.keys()):
            self._context.leave_out("episode", f"that {EPISODES} does not have", number)
        return {number: found[number] for number in sorted(found.keys() - twice)}, twice

    def _data_files(self) -> list[Path]:
        """Return the files that fit the template of `info.json`."""
        pattern = self._named("data_path")
        found = sorted(glob.glob(pattern, root_dir=self._folder))
        if not found:
            raise DemosError(f"There is no {self._folder / pattern}: restore it.")
        return [self._folder / name for name in found]

    def _video_path(self, place: _FilmedEntry) -> Path:
        values = {name: str(getattr(place, name)) for name in ("chunk_index", "file_index")}
        key = self._video.removeprefix("videos/").rstrip("/")
        return self._folder / self._named("video_path", values | {"video_key": key})

    def _named(self, key: str, values: Mapping[str, str] | None = None) -> str:
        """Fill in a template of `info.json`, without Python's own formats, or make it a glob."""
        template = self._info.get(key)
        if not isinstance(template, str):
            raise DemosError(
                f"{self._folder / INFO} does not say where the files are (data_path, video_path)."
            )
        if values is None:
            name = _PLACE.sub("*", glob.escape(template))
        else:
            name = _PLACE.sub(lambda at: values[at[1]].rjust(int(at[2] or 0), "0"), template)
        if not files.is_inside(self._folder, name):
            raise DemosError(f"{self._folder / INFO}: the name {name!r} leaves the folder.")
        return name

    def _read(self, number: int) -> NDArray[np.float64]:
        """Return the keys of a file, its number and the numbers of its rows, shape (n, 6)."""
        path = self._paths[number]
        names = (_EPISODE, _FRAME, _TIME, _INDEX)
        inner = str(path.relative_to(self._folder))
        try:
            keys, columns = files.number_columns(files.inside(self._folder, inner, INFO), names)
            if missing := [key for key in names[:3] if key not in keys]:
                raise DemosError(f"{path} has no column {missing[0]!r}.")
            for key, values in keys.items():
                if not np.isfinite(values).all() or (key != _TIME and (values % 1.0).any()):
                    raise DemosError(f"{path} has a {key} that is empty or no number.")
        except files.UnpacksToTooMuch:
            raise
        except DemosError as error:
            self._context.leave_out("file", unreadable(error), inner)
            return np.empty((0, 6))
        unknown = columns - self._info["features"].keys()
        self._unknown |= {c for c in unknown if not c.startswith("__index_level_")}  # Of pandas.
        count = len(keys[_EPISODE])
        keys.setdefault(_INDEX, np.full(count, np.nan))
        about = [np.full(count, float(number)), np.arange(float(count))]
        return np.column_stack([*(keys[name] for name in names), *about])

    def locate(self) -> Iterator[Located]:
        """Yield the episodes whose keys agree; the others are reported."""
        for number, place in self.places.items():
            try:
                located = Located(place, self._steps(place), self._paths)
                filmed = isinstance(place, _FilmedEntry)
                yield self._with_pictures(located, place) if filmed else located
            except _Contradiction as found:
                self._context.leave_out("episode", found.reason, f"{number}{found.size}")

    def _steps(self, place: EpisodeEntry) -> NDArray[Any]:
        """Return the steps whose rows agree with each other and with `meta/episodes`."""
        length, rate_hz = place.length, self._rate_hz
        if place.number not in self._spans:
            raise _Contradiction("without rows in the data")
        span = self._spans[place.number]
        _, steps, times_s, indexes, paths, rows = self._keys[span].T
        frames = steps.astype(np.int64)
        again = frames[1:][np.diff(frames) == 0]
        if again.size:
            raise _Contradiction("with a frame_index that is there twice", f"{again[0]}")
        if frames[0] < 0 or frames[-1] >= length or 2 * len(frames) < length:
            raise _Contradiction(
                f"with another length than {EPISODES} says",
                f"{len(frames)} rows with a frame_index up to {frames[-1]}, and a length of "
                f"{length}",
            )
        if place.first is not None and place.end is not None:
            if place.end - place.first != length:
                raise _Contradiction(
                    "whose length is not dataset_to_index - dataset_from_index",
                    f"{length} and {place.end - place.first}",
                )
            off = np.abs(np.nan_to_num(indexes - frames - place.first))
            if off.any():
                raise _Contradiction(
                    "whose index is not dataset_from_index + frame_index",
                    f"off by up to {off.max():.0f}",
                )
        steps_s = np.diff(times_s)
        if (steps_s <= 0.0).any():
            at = int(steps_s.argmin())
            raise _Contradiction(
                "whose time runs backwards", f"{-steps_s[at]:.4g} s after step {frames[at]}"
            )
        nominal_s = frames / rate_hz
        off_s = np.abs(times_s - nominal_s)
        if off_s[0] > 0.5 / rate_hz:
            raise _Contradiction(
                "whose time does not begin at 0", f"{times_s[0]:.6g} s at step {frames[0]}"
            )
        if len(frames) > 1:
            measured_hz = 1.0 / float(np.median(steps_s / np.diff(frames)))
            if abs(measured_hz / rate_hz - 1.0) > _RATE:
                raise _Contradiction(
                    f"with another rate than the {rate_hz:g} Hz of {INFO}",
                    f"{measured_hz:.4g} Hz by the times",
                )
        if (most_s := float(off_s.max())) > 0.5 / rate_hz:
            self._context.warn(
                f"The times of episode {place.number} differ from frame_index / fps by up to "
                f"{most_s:.3g} s: they are imported as they are."
            )
        for missing in sorted(set(range(length)).difference(frames.tolist())):
            name = f"{missing} of episode {place.number}"
            self._context.leave_out("step", "without a row in the data", name)
        if (np.diff(self._order[span]) < 0).any():
            self._context.note("Rows are not in the order of frame_index: they are sorted by it.")
        found = np.zeros(len(frames), _STEP)
        found["frame"], found["file"], found["row"] = frames, paths, rows
        exact = off_s <= _tolerance_s(times_s)
        chosen_s = np.asarray(np.where(exact, nominal_s, times_s), np.float64)
        found["time_ns"] = np.round(chosen_s * _NS_PER_S)
        return found

    def _period_s(self, times: VideoTimes) -> float:
        """Return the time from one image to the next, s; that of the steps for a single one."""
        steps_s = np.diff(times.seconds)
        return float(np.median(steps_s)) if len(steps_s) else 1.0 / self._rate_hz

    def _times(self, path: Path) -> VideoTimes | str:
        """Return the times of a video, or why its episodes are left out."""
        name = str(path.relative_to(self._folder))
        try:
            times = read_times(files.inside(self._folder, name, self._folder / EPISODES))
        except DemosError as error:
            return f"whose video cannot be read: {str(error).removesuffix('.')}"
        if self._size is not None and times.size != self._size:
            sizes = "{} x {} pixels, but meta/info.json says {} x {}"
            return f"whose images in {name} have {sizes.format(*times.size, *self._size)}"
        places = sorted(self._filmed[path], key=lambda p: (p.from_timestamp, p.to_timestamp))
        period_s = self._period_s(times)
        for one, two in pairwise(places):
            if (by_s := one.to_timestamp - two.from_timestamp) > 0.5 * period_s:
                self._overlaps |= dict.fromkeys((one.number, two.number), f"{by_s:.4g} s")
        shown_s, end_s = float(times.seconds[0]), float(times.seconds[-1])
        early_s = places[0].from_timestamp - shown_s
        late_s = end_s + period_s - max(place.to_timestamp for place in places)
        moved = "so that each step may have the image of another one"
        if early_s < -0.5 * period_s:
            return f"of {name}, which begins {-early_s:.4g} s later than {EPISODES} says, {moved}"
        for off_s, where in ((early_s, "begins earlier"), (late_s, "ends later")):
            if off_s > 0.5 * period_s:
                self._context.warn(
                    f"{name} {where} than its episodes in {EPISODES}, by {off_s:.4g} s."
                )
        if times.is_cut_off:
            self._context.leave_out("file", "that is cut off, without the images after that", name)
        elif late_s < -0.5 * period_s:
            steps_s = max(p.from_timestamp + (p.length - 1) / self._rate_hz for p in places)
            if (by_s := steps_s - end_s) > 0.5 * period_s:
                return f"of {name}, which ends {by_s:.4g} s before its last step, {moved}"
            self._context.warn(f"{name} ends {-late_s:.4g} s earlier than {EPISODES} says.")
        return times

    def _with_pictures(self, located: Located, place: _FilmedEntry) -> Located:
        """Return an episode with the image of each step, without steps that have none."""
        number, steps = place.number, located.steps
        path = self._video_path(place)
        if path not in self._videos:
            self._videos[path] = self._times(path)
        if isinstance(times := self._videos[path], str):
            raise _Contradiction(times)
        if by := self._overlaps.get(number):
            raise _Contradiction("whose part of a video overlaps with that of another", by)
        first_s, end_s = place.from_timestamp, place.to_timestamp
        at_s = first_s + steps["time_ns"] / _NS_PER_S
        most_s = _tolerance_s(at_s) + 0.5 * float(times.tick_s)
        period_s = self._period_s(times)
        newest_s = float(times.seconds[-1])
        if at_s[-1] > min(end_s - 2.0 * most_s[-1], newest_s + 0.5 * period_s):
            # If an image is lost, the ones after it moved up; which one is unknown.
            have_s = max(0.0, min(end_s, newest_s + period_s) - first_s)
            raise _Contradiction(
                "with fewer images than steps",
                f"{have_s:.4g} s of video, and a last step at {at_s[-1] - first_s:.4g} s",
            )
        after = np.searchsorted(times.seconds, at_s).clip(max=len(times.ticks) - 1)
        both = np.stack([np.maximum(after - 1, 0), after])
        offs_s = np.abs(times.seconds[both] - at_s)
        off_s = offs_s.min(axis=0)
        steps["tick"] = times.ticks[np.where(offs_s[0] < offs_s[1], both[0], both[1])]
        shown = off_s <= most_s
        if 2 * np.count_nonzero(shown) <= len(shown):
            raise _Contradiction(
                "without an image at the time of most steps",
                f"{np.count_nonzero(~shown)} of {len(shown)}, by up to {off_s.max():.3g} s",
            )
        for frame, by_s in zip(steps["frame"][~shown], off_s[~shown], strict=True):
            self._context.leave_out(
                "step",
                f"without an image within {TOLERANCE_S * 1e3:g} ms",
                f"{frame} of episode {number} ({by_s:.3g} s)",
            )
        return Located(place, steps[shown], located.paths, path, times)


def _tolerance_s(times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much times in 32 bits may differ, s."""
    return TOLERANCE_S + np.spacing(np.abs(times_s).astype(np.float32)).astype(np.float64)
