"""Index of a LeRobot dataset: which rows and which images belong to which step.

Steps are found by their keys. `episode_index` and `frame_index` say which step a row is, and
`timestamp`, added to the start of the episode in its video, which image it has. An episode whose
keys contradict each other, or its entry in `meta/episodes`, is left out: one of them is wrong, and
nothing says which.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import (
    UnpacksToTooMuch,
    all_rows,
    inside,
    is_inside,
    number_columns,
)
from shapechanger.demos.exchange.format import ImportContext, few
from shapechanger.demos.exchange.lerobot_export import EPISODES, INFO
from shapechanger.demos.exchange.pictures import VideoTimes, read_times
from shapechanger.errors import DemosError

TOLERANCE_S: Final = 1e-4
"""Largest difference between the time of a step and that of its image, s: `tolerance_s` of
lerobot 0.4.4. Rounding to 32 bits and to the ticks of the video is allowed in addition."""

_EPISODE, _FRAME, _TIME, _INDEX = "episode_index", "frame_index", "timestamp", "index"
_RATE: Final = 0.05  # Largest difference between the stated rate and that of the times, as a share.
_NS_PER_S: Final = 1e9
_SPAN: Final = ("from_timestamp", "to_timestamp")
_FILE: Final = ("chunk_index", "file_index")
_MAX_EPISODES: Final = 1 << 20
_PLACE: Final = re.compile(r"\{(video_key|chunk_index|file_index)(?::0?(\d)d)?\}")
_STEP: Final = np.dtype([(name, np.int64) for name in ("frame", "time_ns", "file", "row", "tick")])

_Place = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Located:
    """An episode whose keys agree.

    Attributes:
        number: Its `episode_index`.
        steps: Its steps in order, a structured array: `frame_index`, time since the start in ns,
            number of the file in `paths`, row in it, and time of the image in ticks.
        paths: All data files.
        video: The video; None without one.
        times: Its times; None without one.
    """

    number: int
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
        self._video = f"videos/{camera}" if camera else ""
        self._size = size
        self._context = context
        self._rate_hz = float(info["fps"])
        self.places, twice = self._read_places()
        self.steps = sum(place["length"] for place in self.places.values())
        self._named = {n: self._path("data", place) for n, place in self.places.items()}
        others = sorted((folder / "data").glob("*/*.parquet"))
        self._paths = list(dict.fromkeys([*self._named.values(), *others]))
        self._broken: dict[Path, str] = {}
        self._unknown: set[str] = set()
        keys = np.concatenate([np.empty((0, 6)), *map(self._read, range(len(self._paths)))])
        for column in sorted(self._unknown):
            context.leave_out("column", f"that {INFO} does not describe", column)
        self._order = np.lexsort((keys[:, 1], keys[:, 0]))
        self._keys = keys[self._order]
        numbers, starts, counts = np.unique(self._keys[:, 0], return_index=True, return_counts=True)
        ends = starts + counts
        self._spans = dict(zip(numbers.astype(int).tolist(), map(slice, starts, ends), strict=True))
        for path in self._broken.keys() - self._named.values():
            context.leave_out("file", "that cannot be read", path.relative_to(folder))
        for number in sorted(self._spans.keys() - self.places.keys() - twice):
            context.leave_out("episode", f"that {EPISODES} does not have", number)
        moved = [
            number
            for number, path in self._named.items()
            if number in self._spans
            and (self._keys[self._spans[number], 4] != self._paths.index(path)).any()
        ]
        if moved:
            context.warn(
                f"Rows of {len(moved)} episodes are in other files than {EPISODES} says: "
                f"{few(moved)}."
            )
        self._videos: dict[Path, VideoTimes | str] = {}
        self._filmed: dict[Path, list[_Place]] = defaultdict(list)
        self._overlaps: dict[int, str] = {}
        for place in self.places.values() if camera else ():
            self._filmed[self._path("video", place)].append(place)

    def _read_places(self) -> tuple[dict[int, _Place], set[int]]:
        """Return the rows of `meta/episodes` in order, and the numbers that are there twice."""
        paths = sorted((self._folder / EPISODES).glob("*/*.parquet"))
        if not paths:
            raise DemosError(f"There is no {EPISODES}/*/*.parquet in {self._folder}: restore it.")
        needed = {_EPISODE, "length", *(f"data/{key}" for key in _FILE)}
        if self._video:
            needed |= {f"{self._video}/{key}" for key in (*_FILE, *_SPAN)}
        more = {"tasks", "dataset_from_index", "dataset_to_index"}
        found: dict[int, _Place] = {}
        twice: set[int] = set()
        for path in paths:
            place = inside(self._folder, str(path.relative_to(self._folder)), path)
            for row in all_rows(place, needed | more):
                if missing := sorted(column for column in needed if row.get(column) is None):
                    raise DemosError(f"{path} has no {missing[0]!r}.")
                try:
                    row |= {
                        key: float(value) if key.endswith(_TIME) else int(value)
                        for key, value in row.items()
                        if key != "tasks" and value is not None
                    }
                except (TypeError, ValueError, OverflowError) as error:
                    raise DemosError(f"{path} has an index or a time that is no number.") from error
                twice |= {row[_EPISODE]} & found.keys()
                found[row[_EPISODE]] = row
        if not found or not 0 <= min(found) <= max(found) < _MAX_EPISODES:
            raise DemosError(f"{self._folder / EPISODES} has no episodes with numbers from 0.")
        for number in sorted(twice):
            self._context.leave_out("episode", f"that {EPISODES} has twice", number)
        for number in sorted(set(range(max(found))) - found.keys()):
            self._context.leave_out("episode", f"that {EPISODES} does not have", number)
        return {number: found[number] for number in sorted(found.keys() - twice)}, twice

    def _path(self, kind: str, place: _Place) -> Path:
        """Return a file that a template of `info.json` names, without Python's own formats."""
        template = self._info.get(f"{kind}_path")
        if not isinstance(template, str):
            raise DemosError(
                f"{self._folder / INFO} does not say where the files are (data_path, video_path)."
            )
        part = "data" if kind == "data" else self._video
        values = {"video_key": part.removeprefix("videos/")}
        values |= {key: str(place[f"{part}/{key}"]) for key in _FILE}
        name = _PLACE.sub(lambda match: values[match[1]].rjust(int(match[2] or 0), "0"), template)
        if not is_inside(self._folder, name):
            raise DemosError(f"{self._folder / INFO}: the name {name!r} leaves the folder.")
        return self._folder / name

    def _read(self, number: int) -> NDArray[np.float64]:
        """Return the keys of a file, its number and the numbers of its rows, shape (n, 6)."""
        path = self._paths[number]
        names = (_EPISODE, _FRAME, _TIME, _INDEX)
        try:
            name = str(path.relative_to(self._folder))
            keys, columns = number_columns(inside(self._folder, name, EPISODES), names)
            if missing := [key for key in names[:3] if key not in keys]:
                raise DemosError(f"{path} has no column {missing[0]!r}.")
            for key, values in keys.items():
                if not np.isfinite(values).all() or (key != _TIME and (values % 1.0).any()):
                    raise DemosError(f"{path} has a {key} that is empty or no number.")
        except UnpacksToTooMuch:
            raise
        except DemosError as error:
            self._broken[path] = str(error).removesuffix(".")
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
                steps = self._steps(number, place)
                located = Located(number, steps, self._paths)
                yield self._with_pictures(located, place) if self._video else located
            except _Contradiction as found:
                self._context.leave_out("episode", found.reason, f"{number}{found.size}")

    def _steps(self, number: int, place: _Place) -> NDArray[Any]:
        """Return the steps whose rows agree with each other and with `meta/episodes`."""
        length = place["length"]
        if (path := self._named[number]) in self._broken:
            raise _Contradiction(f"whose data cannot be read: {self._broken[path]}")
        if number not in self._spans:
            raise _Contradiction("without rows in the data")
        span = self._spans[number]
        _, steps, times_s, indexes, files, rows = self._keys[span].T
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
        first, end = place.get("dataset_from_index"), place.get("dataset_to_index")
        if first is not None and end is not None:
            if end - first != length:
                raise _Contradiction(
                    "whose length is not dataset_to_index - dataset_from_index",
                    f"{length} and {end - first}",
                )
            off = np.abs(np.nan_to_num(indexes - frames - first))
            if off.any():
                raise _Contradiction(
                    "whose index is not dataset_from_index + frame_index",
                    f"off by up to {off.max():.0f}",
                )
        self._require_times(number, frames, times_s)
        for missing in sorted(set(range(length)).difference(frames.tolist())):
            name = f"{missing} of episode {number}"
            self._context.leave_out("step", "without a row in the data", name)
        if (np.diff(self._order[span]) < 0).any():
            self._context.note("Rows are not in the order of frame_index: they are sorted by it.")
        nominal_s = frames / self._rate_hz
        exact = np.abs(times_s - nominal_s) <= _tolerance_s(times_s)
        found = np.zeros(len(frames), _STEP)
        found["frame"], found["file"], found["row"] = frames, files, rows
        chosen_s = np.asarray(np.where(exact, nominal_s, times_s), np.float64)
        found["time_ns"] = np.round(chosen_s * _NS_PER_S)
        return found

    def _require_times(
        self, number: int, frames: NDArray[np.int64], times_s: NDArray[np.float64]
    ) -> None:
        """Refuse times that contradict the number of the step or the rate."""
        rate_hz = self._rate_hz
        steps_s = np.diff(times_s)
        if (steps_s <= 0.0).any():
            at = int(steps_s.argmin())
            raise _Contradiction(
                "whose time runs backwards", f"{-steps_s[at]:.4g} s after step {frames[at]}"
            )
        off_s = times_s - frames / rate_hz
        if abs(off_s[0]) > 0.5 / rate_hz:
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
        if (most_s := float(np.abs(off_s).max())) > 0.5 / rate_hz:
            self._context.warn(
                f"The times of episode {number} differ from frame_index / fps by up to "
                f"{most_s:.3g} s: they are imported as they are."
            )

    def _span(self, place: _Place) -> tuple[float, float]:
        return place[f"{self._video}/from_timestamp"], place[f"{self._video}/to_timestamp"]

    def _period_s(self, times: VideoTimes) -> float:
        """Return the time from one image to the next, s; that of the steps for a single one."""
        steps_s = np.diff(times.seconds)
        return float(np.median(steps_s)) if len(steps_s) else 1.0 / self._rate_hz

    def _times(self, path: Path) -> VideoTimes | str:
        """Return the times of a video, or why its episodes are left out."""
        name = str(path.relative_to(self._folder))
        try:
            times = read_times(inside(self._folder, name, self._folder / EPISODES))
        except DemosError as error:
            return f"whose video cannot be read: {str(error).removesuffix('.')}"
        if self._size is not None and times.size != self._size:
            sizes = "{} x {} pixels, but meta/info.json says {} x {}"
            return f"whose images in {name} have {sizes.format(*times.size, *self._size)}"
        places = sorted(self._filmed[path], key=self._span)
        period_s = self._period_s(times)
        for one, two in pairwise(places):
            if (by_s := self._span(one)[1] - self._span(two)[0]) > 0.5 * period_s:
                for place in (one, two):
                    self._overlaps[place[_EPISODE]] = f"{by_s:.4g} s"
        shown_s, end_s = float(times.seconds[0]), float(times.seconds[-1])
        early_s = self._span(places[0])[0] - shown_s
        late_s = end_s + period_s - max(self._span(place)[1] for place in places)
        moved = "so that each step may have the image of another one"
        if early_s < -0.5 * period_s:
            return f"of {name}, which begins {-early_s:.4g} s later than {EPISODES} says, {moved}"
        for off_s, where in ((early_s, "begins earlier"), (late_s, "ends later")):
            if off_s > 0.5 * period_s:
                self._context.warn(
                    f"{name} {where} than its episodes in {EPISODES}, by {off_s:.4g} s."
                )
        if times.is_cut_off:
            reason = "that is cut off, without the images after that"
            self._context.leave_out("file", reason, name)
        elif late_s < -0.5 * period_s:
            steps_s = max(self._span(p)[0] + (p["length"] - 1) / self._rate_hz for p in places)
            if (by_s := steps_s - end_s) > 0.5 * period_s:
                return f"of {name}, which ends {by_s:.4g} s before its last step, {moved}"
            self._context.warn(f"{name} ends {-late_s:.4g} s earlier than {EPISODES} says.")
        return times

    def _with_pictures(self, located: Located, place: _Place) -> Located:
        """Return an episode with the image of each step, without steps that have none."""
        number, steps = located.number, located.steps
        path = self._path("video", place)
        if path not in self._videos:
            self._videos[path] = self._times(path)
        if isinstance(times := self._videos[path], str):
            raise _Contradiction(times)
        if by := self._overlaps.get(number):
            raise _Contradiction("whose part of a video overlaps with that of another", by)
        first_s, end_s = self._span(place)
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
        return Located(number, steps[shown], located.paths, path, times)


def _tolerance_s(times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much times in 32 bits may differ, s."""
    return TOLERANCE_S + np.spacing(np.abs(times_s).astype(np.float32)).astype(np.float64)
