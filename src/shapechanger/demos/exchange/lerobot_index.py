"""Index of a LeRobot dataset: which rows and which pictures belong to which step.

Steps are found by their keys. `episode_index` and `frame_index` say which step a row is, and
`timestamp`, added to the start of the episode in its video, which picture it has. An episode whose
keys contradict each other, or its entry in `meta/episodes`, is left out: one of them is wrong, and
nothing says which.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, cast

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
"""Largest difference between the time of a step and that of its picture, s: `tolerance_s` of
lerobot 0.4.4. Rounding to 32 bits and to the ticks of the video is allowed in addition."""

_EPISODE, _FRAME, _TIME, _INDEX = "episode_index", "frame_index", "timestamp", "index"
_RATE: Final = 0.05  # Largest difference between the stated rate and that of the times, as a share.
_NS_PER_S: Final = 1e9
_SPAN: Final = ("from_timestamp", "to_timestamp")
_FILE: Final = ("chunk_index", "file_index")
_MAX_EPISODES: Final = 1 << 20
_PLACE: Final = re.compile(r"\{(video_key|chunk_index|file_index)(?::0?(\d)d)?\}")

Place = dict[str, Any]
"""A row of `meta/episodes`."""


@dataclass(frozen=True, slots=True)
class LocatedEpisode:
    """An episode whose keys agree: arrays with an entry for each step.

    Attributes:
        place: Its row of `meta/episodes`.
        frames: The `frame_index`, ascending.
        times_ns: Time since the start.
        files: The file, of `paths`.
        rows: The row in its file.
        paths: All data files.
        video: The video; None without one.
        times: Its times; None without one.
        ticks: Time of the picture in the video.
    """

    place: Place
    frames: NDArray[np.int64]
    times_ns: NDArray[np.int64]
    files: NDArray[np.int64]
    rows: NDArray[np.int64]
    paths: Sequence[Path]
    video: Path | None = None
    times: VideoTimes | None = None
    ticks: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    @property
    def number(self) -> int:
        """Its `episode_index`."""
        return self.place[_EPISODE]

    def rows_by_file(self) -> Iterator[tuple[Path, NDArray[np.int64], NDArray[np.int64]]]:
        """Yield each file with positions of steps, and their rows there, which ascend."""
        for file in np.unique(self.files).tolist():
            here = np.flatnonzero(self.files == file)
            here = here[np.argsort(self.rows[here])]
            yield self.paths[file], here, self.rows[here]


class _Contradiction(Exception):
    """Why an episode is left out: a reason that fits the plural, and the size of the difference."""

    def __init__(self, reason: str, size: str = "") -> None:
        super().__init__(reason)
        self.reason = reason
        self.size = f" ({size})" if size else ""


def read_places(folder: Path, camera: str, context: ImportContext) -> tuple[list[Place], set[int]]:
    """Return the rows of `meta/episodes` in order, and the numbers that are there twice.

    `camera` is the key of the video that is imported; "" without one.
    """
    paths = sorted((folder / EPISODES).glob("*/*.parquet"))
    if not paths:
        raise DemosError(f"There is no {EPISODES}/*/*.parquet in {folder}: restore it.")
    needed = {_EPISODE, "length", *(f"data/{key}" for key in _FILE)}
    if camera:
        needed |= {f"videos/{camera}/{key}" for key in (*_FILE, *_SPAN)}
    more = {"tasks", "dataset_from_index", "dataset_to_index"}
    found: dict[int, Place] = {}
    twice: set[int] = set()
    for path in paths:
        for row in all_rows(inside(folder, str(path.relative_to(folder)), path), needed | more):
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
        raise DemosError(f"{folder / EPISODES} has no episodes with numbers from 0.")
    for number in sorted(twice):
        context.leave_out("episode", f"that {EPISODES} has twice", number)
    for number in sorted(set(range(max(found))) - found.keys()):
        context.leave_out("episode", f"that {EPISODES} does not have", number)
    return [found[number] for number in sorted(found.keys() - twice)], twice


def locate(
    folder: Path,
    info: Mapping[str, Any],
    places: Sequence[Place],
    twice: Set[int],
    camera: str,
    size: tuple[int, int] | None,
    context: ImportContext,
) -> Iterator[LocatedEpisode]:
    """Yield the episodes whose keys agree; the others are reported."""
    tables = _Tables(folder, info, places, twice, context)
    videos = _Videos(folder, info, places, camera, size) if camera else None
    for place in places:
        try:
            located = tables.locate(place, context)
            yield located if videos is None else videos.locate(located, context)
        except _Contradiction as found:
            context.leave_out("episode", found.reason, f"{place[_EPISODE]}{found.size}")


def _named(folder: Path, info: Mapping[str, Any], key: str, values: Mapping[str, Any]) -> Path:
    """Return the file that a template of `info.json` names, without Python's own formats."""
    template = info.get(key)
    if not isinstance(template, str):
        raise DemosError(
            f"{folder / INFO} does not say where the files are (data_path, video_path)."
        )

    def filled(match: re.Match[str]) -> str:
        value = str(values.get(match[1], ""))
        return value.rjust(int(match[2]), "0") if match[2] else value

    name = _PLACE.sub(filled, template)
    if not is_inside(folder, name):
        raise DemosError(f"{folder / INFO}: the name {name!r} leaves the folder.")
    return folder / name


class _Tables:
    """The keys of all rows of the data files, sorted by episode and frame."""

    def __init__(
        self,
        folder: Path,
        info: Mapping[str, Any],
        places: Sequence[Place],
        twice: Set[int],
        context: ImportContext,
    ) -> None:
        self._folder = folder
        self._rate_hz = float(info["fps"])
        self._broken: dict[Path, str] = {}
        self._named = {
            place[_EPISODE]: _named(
                folder, info, "data_path", {key: place[f"data/{key}"] for key in _FILE}
            )
            for place in places
        }
        others = sorted((folder / "data").glob("*/*.parquet"))
        self._paths = list(dict.fromkeys([*self._named.values(), *others]))
        known = {"data": set(cast("dict[str, Any]", info["features"])), "unknown": set[str]()}
        parts = [self._read(n, path, known) for n, path in enumerate(self._paths)]
        for column in sorted(known["unknown"]):
            context.leave_out("column", f"that {INFO} does not describe", column)
        keys = np.concatenate([np.empty((0, 6)), *parts])
        order = np.lexsort((keys[:, 1], keys[:, 0]))
        self._keys = keys[order]
        self._order = order
        numbers, starts, counts = np.unique(self._keys[:, 0], return_index=True, return_counts=True)
        self._spans = {
            int(number): slice(int(start), int(start + count))
            for number, start, count in zip(numbers, starts, counts, strict=True)
        }
        for path in self._broken.keys() - self._named.values():
            context.leave_out("file", "that cannot be read", path.relative_to(folder))
        for number in sorted(self._spans.keys() - self._named.keys() - twice):
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

    def _read(self, number: int, path: Path, known: dict[str, set[str]]) -> NDArray[np.float64]:
        """Return the keys of a file, its number and the numbers of its rows, shape (n, 6)."""
        names = (_EPISODE, _FRAME, _TIME, _INDEX)
        try:
            inside(self._folder, str(path.relative_to(self._folder)), self._folder / EPISODES)
            keys, columns = number_columns(path, names)
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
        unknown = columns - known["data"]
        known["unknown"] |= {c for c in unknown if not c.startswith("__index_level_")}  # Of pandas.
        count = len(keys[_EPISODE])
        keys.setdefault(_INDEX, np.full(count, np.nan))
        about = [np.full(count, float(number)), np.arange(float(count))]
        return np.column_stack([*(keys[name] for name in names), *about])

    def locate(self, place: Place, context: ImportContext) -> LocatedEpisode:
        """Return an episode whose rows agree with each other and with `meta/episodes`."""
        number, length = place[_EPISODE], place["length"]
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
        self._require_times(number, frames, times_s, context)
        for missing in sorted(set(range(length)).difference(frames.tolist())):
            context.leave_out("step", "without a row in the data", f"{missing} of episode {number}")
        if (np.diff(self._order[span]) < 0).any():
            context.note("Rows are not in the order of frame_index: they are sorted by it.")
        nominal_s = frames / self._rate_hz
        exact = np.abs(times_s - nominal_s) <= _tolerance_s(times_s)
        chosen_s = np.asarray(np.where(exact, nominal_s, times_s), np.float64)
        times_ns = np.asarray(np.round(chosen_s * _NS_PER_S), np.int64)
        return LocatedEpisode(
            place, frames, times_ns, files.astype(np.int64), rows.astype(np.int64), self._paths
        )

    def _require_times(
        self,
        number: int,
        frames: NDArray[np.int64],
        times_s: NDArray[np.float64],
        context: ImportContext,
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
            context.warn(
                f"The times of episode {number} differ from frame_index / fps by up to "
                f"{most_s:.3g} s: they are imported as they are."
            )


def _tolerance_s(times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much times in 32 bits may differ, s."""
    return TOLERANCE_S + np.spacing(np.abs(times_s).astype(np.float32)).astype(np.float64)


class _Videos:
    """The videos of one camera."""

    def __init__(
        self,
        folder: Path,
        info: Mapping[str, Any],
        places: Sequence[Place],
        camera: str,
        size: tuple[int, int] | None,
    ) -> None:
        self._folder = folder
        self._key = f"videos/{camera}"
        self._size = size
        self._rate_hz = float(info["fps"])
        self._read: dict[Path, VideoTimes | str] = {}
        self._paths: dict[int, Path] = {}
        self._places: dict[Path, list[Place]] = defaultdict(list)
        self._overlaps: dict[int, str] = {}
        for place in places:
            values = {name: place[f"{self._key}/{name}"] for name in _FILE}
            path = _named(folder, info, "video_path", {"video_key": camera, **values})
            self._paths[place[_EPISODE]] = path
            self._places[path].append(place)

    def _span(self, place: Place) -> tuple[float, float]:
        return place[f"{self._key}/from_timestamp"], place[f"{self._key}/to_timestamp"]

    def _period_s(self, times: VideoTimes) -> float:
        """Return the time from one picture to the next, s; that of the steps for a single one."""
        if len(times.ticks) > 1:
            return float(np.median(np.diff(times.seconds)))
        return 1.0 / self._rate_hz

    def _times(self, path: Path, context: ImportContext) -> VideoTimes | str:
        """Return the times of a video, or why its episodes are left out."""
        name = str(path.relative_to(self._folder))
        try:
            times = read_times(inside(self._folder, name, self._folder / EPISODES))
        except DemosError as error:
            return f"whose video cannot be read: {str(error).removesuffix('.')}"
        if self._size is not None and times.size != self._size:
            sizes = "{} x {} pixels, but meta/info.json says {} x {}"
            return f"whose pictures in {name} have {sizes.format(*times.size, *self._size)}"
        places = sorted(self._places[path], key=self._span)
        period_s = self._period_s(times)
        for one, two in pairwise(places):
            if (by_s := self._span(one)[1] - self._span(two)[0]) > 0.5 * period_s:
                for place in (one, two):
                    self._overlaps[place[_EPISODE]] = f"{by_s:.4g} s"
        shown_s, end_s = float(times.seconds[0]), float(times.seconds[-1])
        early_s = self._span(places[0])[0] - shown_s
        late_s = end_s + period_s - max(self._span(place)[1] for place in places)
        moved = "so that each step may have the picture of another one"
        if early_s < -0.5 * period_s:
            return f"of {name}, which begins {-early_s:.4g} s later than {EPISODES} says, {moved}"
        for off_s, where in ((early_s, "begins earlier"), (late_s, "ends later")):
            if off_s > 0.5 * period_s:
                context.warn(f"{name} {where} than its episodes in {EPISODES}, by {off_s:.4g} s.")
        if times.is_cut_off:
            context.leave_out("file", "that is cut off, without the pictures after that", name)
        elif late_s < -0.5 * period_s:
            steps_s = max(self._span(p)[0] + (p["length"] - 1) / self._rate_hz for p in places)
            if steps_s > end_s + 0.5 * period_s:
                by_s = steps_s - end_s
                return f"of {name}, which ends {by_s:.4g} s before its last step, {moved}"
            context.warn(f"{name} ends {-late_s:.4g} s earlier than {EPISODES} says.")
        return times

    def locate(self, located: LocatedEpisode, context: ImportContext) -> LocatedEpisode:
        """Return an episode with the picture of each step, without steps that have none."""
        path = self._paths[located.number]
        if path not in self._read:
            self._read[path] = self._times(path, context)
        if isinstance(times := self._read[path], str):
            raise _Contradiction(times)
        if by := self._overlaps.get(located.number):
            raise _Contradiction("whose part of a video overlaps with that of another", by)
        first_s, end_s = self._span(located.place)
        at_s = first_s + located.times_ns / _NS_PER_S
        most_s = _tolerance_s(at_s) + 0.5 * float(times.tick_s)
        period_s = self._period_s(times)
        newest_s = float(times.seconds[-1])
        if at_s[-1] > min(end_s - 2.0 * most_s[-1], newest_s + 0.5 * period_s):
            # If a picture is lost, the ones after it moved up; which one is unknown.
            have_s = max(0.0, min(end_s, newest_s + period_s) - first_s)
            raise _Contradiction(
                "with fewer pictures than steps",
                f"{have_s:.4g} s of video, and a last step at {at_s[-1] - first_s:.4g} s",
            )
        after = np.searchsorted(times.seconds, at_s).clip(max=len(times.ticks) - 1)
        both = np.stack([np.maximum(after - 1, 0), after])
        offs_s = np.abs(times.seconds[both] - at_s)
        nearest = np.asarray(np.where(offs_s[0] < offs_s[1], both[0], both[1]), np.int64)
        off_s = offs_s.min(axis=0)
        shown = off_s <= most_s
        if 2 * np.count_nonzero(shown) <= len(shown):
            raise _Contradiction(
                "without a picture at the time of most steps",
                f"{np.count_nonzero(~shown)} of {len(shown)}, by up to {off_s.max():.3g} s",
            )
        for frame, by_s in zip(located.frames[~shown], off_s[~shown], strict=True):
            context.leave_out(
                "step",
                f"without a picture within {TOLERANCE_S * 1e3:g} ms",
                f"{frame} of episode {located.number} ({by_s:.3g} s)",
            )
        return replace(
            located,
            frames=located.frames[shown],
            times_ns=located.times_ns[shown],
            files=located.files[shown],
            rows=located.rows[shown],
            video=path,
            times=times,
            ticks=times.ticks[nearest[shown]],
        )
