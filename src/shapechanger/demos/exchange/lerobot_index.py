"""Index of a LeRobot dataset: which rows and which pictures belong to which step.

Steps are found by their keys. `episode_index` and `frame_index` say which step a row is, and
`timestamp`, added to the start of the episode in its video, which picture it has. An episode whose
keys contradict each other, or its entry in `meta/episodes`, is left out: one of them is wrong, and
nothing says which.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange import lerobot_export as names
from shapechanger.demos.exchange.format import ImportContext, few
from shapechanger.demos.exchange.lerobot_tables import (
    UnpacksToTooMuch,
    fill_place,
    inside,
    number_columns,
    table_rows,
)
from shapechanger.demos.exchange.video import VideoTimes, read_times
from shapechanger.errors import DemosError

TOLERANCE_S: Final = 1e-4
"""Largest difference between the time of a step and that of its picture, s: `tolerance_s` of
lerobot 0.4.4. Rounding to 32 bits and to the ticks of the video is allowed in addition."""

_TIME: Final = "timestamp"
_INDEX: Final = "index"  # Only checked.
_KEYS: Final = ("episode_index", "frame_index", _TIME, _INDEX)
_RATE: Final = 0.05  # Largest difference between the stated rate and that of the times, as a share.
_NS_PER_S: Final = 1e9
_EPISODE: Final = "episode"
_SPAN: Final = ("from_timestamp", "to_timestamp")
_MAX_EPISODES: Final = 1 << 20
_DATA_INDEXES: Final = ("data/chunk_index", "data/file_index")


@dataclass(frozen=True, slots=True)
class LocatedEpisode:
    """An episode whose keys agree.

    Attributes:
        number: Its `episode_index`.
        place: Its row of `meta/episodes`.
        frames: The `frame_index` of each step, ascending, shape (n,).
        times_ns: Time of each step since the start, shape (n,).
        rows: For each file the positions in `frames`, and the rows in the file, ascending.
        video: The video; None without one.
        times: Its times; None without one.
        ticks: Time of each picture in the video, shape (n,).
    """

    number: int
    place: dict[str, Any]
    frames: NDArray[np.int64]
    times_ns: NDArray[np.int64]
    rows: dict[Path, tuple[NDArray[np.int64], NDArray[np.int64]]]
    video: Path | None = None
    times: VideoTimes | None = None
    ticks: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))


def read_places(
    folder: Path, camera: str, context: ImportContext
) -> tuple[list[dict[str, Any]], set[int]]:
    """Return the rows of `meta/episodes` in order, and the numbers that are there twice.

    Args:
        folder: Folder of the dataset.
        camera: Key of the video that is imported; "" without one.
        context: Findings of the import.

    Raises:
        DemosError: If there is none, or a column is missing.
    """
    paths = sorted((folder / names.EPISODES).glob("*/*.parquet"))
    if not paths:
        raise DemosError(f"There is no {names.EPISODES}/*/*.parquet in {folder}: restore it.")
    needed = {"episode_index", "length", *_DATA_INDEXES}
    more = {"tasks", "dataset_from_index", "dataset_to_index"}
    if camera:
        needed |= {f"videos/{camera}/{key}" for key in ("chunk_index", "file_index", *_SPAN)}
    found: dict[int, dict[str, Any]] = {}
    twice: set[int] = set()
    for path in paths:
        for row in table_rows(inside(folder, str(path.relative_to(folder)), path), needed | more):
            if missing := sorted(column for column in needed if row.get(column) is None):
                raise DemosError(f"{path} has no {missing[0]!r}.")
            try:
                row |= {
                    key: float(value) if key.endswith("timestamp") else int(value)
                    for key, value in row.items()
                    if key != "tasks" and value is not None
                }
            except (TypeError, ValueError, OverflowError) as error:
                raise DemosError(f"{path} has an index or a time that is no number.") from error
            number = row["episode_index"]
            twice |= {number} & found.keys()
            found[number] = row
    if not found or not 0 <= min(found) <= max(found) < _MAX_EPISODES:
        raise DemosError(f"{folder / names.EPISODES} has no episodes with numbers from 0.")
    for number in sorted(twice):
        context.leave_out(_EPISODE, f"that {names.EPISODES} has twice", number)
    for number in sorted(set(range(max(found))) - found.keys()):
        context.leave_out(_EPISODE, f"that {names.EPISODES} does not have", number)
    return [found[number] for number in sorted(found.keys() - twice)], twice


def locate(
    folder: Path,
    info: Mapping[str, Any],
    places: Sequence[dict[str, Any]],
    twice: Set[int],
    camera: str,
    size: tuple[int, int] | None,
    context: ImportContext,
) -> Iterator[LocatedEpisode]:
    """Yield the episodes whose keys agree; the others are reported.

    Args:
        folder: Folder of the dataset.
        info: Content of `info.json`.
        places: Rows of `meta/episodes`.
        twice: Numbers of episodes that are there twice.
        camera: Key of the video that is imported; "" without one.
        size: Width and height of the pictures, pixels; None without any.
        context: Findings of the import.

    Raises:
        DemosError: If `info.json` leads out of the folder.
    """
    tables = _Tables(folder, info, places, twice, context)
    videos = _Videos(folder, info, places, camera, size) if camera else None
    rate_hz = float(info["fps"])
    for place in places:
        number = place["episode_index"]
        try:
            located = _with_rows(tables, place, rate_hz, context)
            yield located if videos is None else _with_pictures(videos, located, context)
        except _Contradiction as found:
            size_of = f" ({found.size})" if found.size else ""
            context.leave_out(_EPISODE, found.reason, f"{number}{size_of}")


class _Contradiction(Exception):
    """Why an episode is left out: a reason that fits the plural, and the size of the difference."""

    def __init__(self, reason: str, size: str = "") -> None:
        super().__init__(reason)
        self.reason = reason
        self.size = size


class _Tables:
    """The keys of all rows of the data files."""

    def __init__(
        self,
        folder: Path,
        info: Mapping[str, Any],
        places: Sequence[dict[str, Any]],
        twice: Set[int],
        context: ImportContext,
    ) -> None:
        self.parts: dict[int, list[tuple[Path, NDArray[np.int64]]]] = defaultdict(list)
        self.keys: dict[Path, dict[str, NDArray[np.float64]]] = {}
        self._broken: dict[Path, str] = {}
        self._described = set(cast("dict[str, Any]", info["features"]))
        self._context = context
        self._unknown: set[str] = set()
        self._named: dict[int, Path] = {}
        path = folder / names.INFO
        for place in places:
            indexes = {key.removeprefix("data/"): place[key] for key in _DATA_INDEXES}
            name = fill_place(info.get("data_path"), path, indexes)
            self._named[place["episode_index"]] = folder / name
            if not (folder / name).resolve().is_relative_to(folder.resolve()):
                inside(folder, name, path)  # Raises.
        others = sorted((folder / "data").glob("*/*.parquet"))
        for one in dict.fromkeys([*self._named.values(), *others]):
            self._read(folder, one)
        for one in self._broken.keys() - self._named.values():
            context.leave_out("file", "that cannot be read", one.relative_to(folder))
        for number in sorted(self.parts.keys() - self._named.keys() - twice):
            context.leave_out(_EPISODE, f"that {names.EPISODES} does not have", number)
        moved = [
            number
            for number, named in self._named.items()
            if any(one != named for one, _ in self.parts.get(number, ()))
        ]
        if moved:
            context.warn(
                f"Rows of {len(moved)} episodes are in other files than {names.EPISODES} says: "
                f"{few(moved)}."
            )

    def of(self, number: int) -> list[tuple[Path, NDArray[np.int64]]]:
        """Return the files and the rows of an episode."""
        named = self._named[number]
        if named in self._broken:
            raise _Contradiction(f"whose data cannot be read: {self._broken[named]}")
        if number not in self.parts:
            raise _Contradiction("without rows in the data")
        return self.parts[number]

    def _read(self, folder: Path, path: Path) -> None:
        name = path.relative_to(folder)
        try:
            inside(folder, str(name), folder / names.EPISODES)
            keys, columns = number_columns(path, _KEYS)
            if missing := [key for key in _KEYS if key not in keys and key != _INDEX]:
                raise DemosError(f"{path} has no column {missing[0]!r}.")
            for key, values in keys.items():
                if not np.isfinite(values).all() or (key != _TIME and (values % 1.0).any()):
                    raise DemosError(f"{path} has a {key} that is empty or no number.")
        except UnpacksToTooMuch:
            raise
        except DemosError as error:
            self._broken[path] = str(error).removesuffix(".")
            return
        for column in sorted(columns - self._described - self._unknown):
            if column.startswith("__index_level_"):  # Of pandas.
                continue
            self._unknown.add(column)
            self._context.leave_out("column", f"that {names.INFO} does not describe", column)
        self.keys[path] = keys
        owners = keys["episode_index"].astype(np.int64)
        order = np.argsort(owners, kind="stable")
        numbers, starts = np.unique(owners[order], return_index=True)
        for number, rows in zip(numbers, np.split(order, starts[1:]), strict=False):
            self.parts[int(number)].append((path, rows))


def _with_rows(
    tables: _Tables, place: dict[str, Any], rate_hz: float, context: ImportContext
) -> LocatedEpisode:
    """Return an episode whose rows agree with each other and with `meta/episodes`."""
    number, length = place["episode_index"], place["length"]
    parts = tables.of(number)

    def joined(key: str) -> NDArray[np.float64]:
        return np.concatenate([tables.keys[path][key][rows] for path, rows in parts])

    frames = joined("frame_index").astype(np.int64)
    order = np.argsort(frames, kind="stable")
    frames, times_s = frames[order], joined(_TIME)[order]
    again = frames[1:][np.diff(frames) == 0]
    if again.size:
        raise _Contradiction("with a frame_index that is there twice", f"{again[0]}")
    if frames[0] < 0 or frames[-1] >= length or 2 * len(frames) < length:
        raise _Contradiction(
            f"with another length than {names.EPISODES} says",
            f"{len(frames)} rows with a frame_index up to {frames[-1]}, and a length of {length}",
        )
    if {"dataset_from_index", "dataset_to_index"} <= place.keys():
        span = place["dataset_to_index"] - place["dataset_from_index"]
        if span != length:
            raise _Contradiction(
                "whose length is not dataset_to_index - dataset_from_index", f"{length} and {span}"
            )
        if all(_INDEX in tables.keys[path] for path, _ in parts):
            off = joined(_INDEX)[order] - frames - place["dataset_from_index"]
            if off.any():
                raise _Contradiction(
                    "whose index is not dataset_from_index + frame_index",
                    f"off by up to {np.abs(off).max():.0f}",
                )
    _require_times(frames, times_s, rate_hz, number, context)
    for missing in sorted(set(range(length)).difference(frames.tolist())):
        context.leave_out("step", "without a row in the data", f"{missing} of episode {number}")
    if (np.diff(order) < 0).any():
        context.note("Rows are not in the order of frame_index: they are sorted by it.")
    starts = np.cumsum([0, *(len(rows) for _, rows in parts)])
    places = np.empty(len(order), np.int64)
    places[order] = np.arange(len(order))
    rows = {path: (places[starts[n] : starts[n + 1]], part) for n, (path, part) in enumerate(parts)}
    nominal_s = frames / rate_hz
    exact = np.abs(times_s - nominal_s) <= _tolerance_s(times_s)
    times_ns = np.round(np.where(exact, nominal_s, times_s) * _NS_PER_S).astype(np.int64)
    return LocatedEpisode(number, place, frames, times_ns, rows)


def _require_times(
    frames: NDArray[np.int64],
    times_s: NDArray[np.float64],
    rate_hz: float,
    number: int,
    context: ImportContext,
) -> None:
    """Refuse times that contradict the number of the step or the rate."""
    steps_s = np.diff(times_s)
    if (steps_s <= 0.0).any():
        at = int(steps_s.argmin())
        raise _Contradiction(
            "whose time runs backwards", f"{-steps_s[at]:.4g} s after step {frames[at]}"
        )
    off_s = times_s - frames / rate_hz
    if abs(off_s[0]) > 0.5 / rate_hz:
        raise _Contradiction(
            "whose time does not begin at 0",
            f"{times_s[0]:.6g} s at step {frames[0]}",
        )
    if len(frames) > 1:
        measured_hz = 1.0 / float(np.median(steps_s / np.diff(frames)))
        if abs(measured_hz / rate_hz - 1.0) > _RATE:
            raise _Contradiction(
                f"with another rate than the {rate_hz:g} Hz of {names.INFO}",
                f"{measured_hz:.4g} Hz by the times",
            )
    if (most_s := float(np.abs(off_s).max())) > 0.5 / rate_hz:
        context.warn(
            f"The times of episode {number} differ from frame_index / fps by up to {most_s:.3g} s: "
            "they are imported as they are."
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
        places: Sequence[dict[str, Any]],
        camera: str,
        size: tuple[int, int] | None,
    ) -> None:
        self.key = f"videos/{camera}"
        self._folder = folder
        self._size = size
        self.rate_hz = float(info["fps"])
        self._read: dict[str, VideoTimes | str] = {}
        self._names: dict[int, str] = {}
        self._places: dict[str, list[dict[str, Any]]] = defaultdict(list)
        self._overlaps: dict[int, str] = {}
        for place in places:
            values = {name: place[f"{self.key}/{name}"] for name in ("chunk_index", "file_index")}
            path = folder / names.INFO
            name = fill_place(info.get("video_path"), path, {"video_key": camera, **values})
            if not (folder / name).resolve().is_relative_to(folder.resolve()):
                inside(folder, name, path)  # Raises.
            self._names[place["episode_index"]] = name
            self._places[name].append(place)

    def of(self, place: dict[str, Any], context: ImportContext) -> tuple[Path, VideoTimes]:
        """Return the video of an episode, and its times."""
        name = self._names[place["episode_index"]]
        if name not in self._read:
            self._read[name] = self._times(name, context)
        times = self._read[name]
        if isinstance(times, str):
            raise _Contradiction(times)
        if by_s := self._overlaps.get(place["episode_index"]):
            raise _Contradiction("whose part of a video overlaps with that of another", by_s)
        return self._folder / name, times

    def _span(self, place: dict[str, Any]) -> tuple[float, float]:
        return place[f"{self.key}/from_timestamp"], place[f"{self.key}/to_timestamp"]

    def _times(self, name: str, context: ImportContext) -> VideoTimes | str:
        """Return the times of a video, or why its episodes are left out."""
        try:
            times = read_times(inside(self._folder, name, self._folder / names.EPISODES))
        except DemosError as error:
            return f"whose video cannot be read: {str(error).removesuffix('.')}"
        if self._size is not None and times.size != self._size:
            width, height = times.size
            return (
                f"whose pictures in {name} have {width} x {height} pixels, but meta/info.json says "
                f"{self._size[0]} x {self._size[1]}"
            )
        places = sorted(self._places[name], key=self._span)
        period_s = _period_s(times, self.rate_hz)
        for one, two in pairwise(places):
            if (by_s := self._span(one)[1] - self._span(two)[0]) > 0.5 * period_s:
                for place in (one, two):
                    self._overlaps[place["episode_index"]] = f"{by_s:.4g} s"
        first_s = self._span(places[0])[0]
        last_s = max(self._span(place)[1] for place in places)
        early_s = first_s - float(times.seconds[0])
        late_s = float(times.seconds[-1]) + period_s - last_s
        if early_s < -0.5 * period_s:
            return (
                f"of {name}, which begins {-early_s:.4g} s later than {names.EPISODES} says, so "
                "that each step may have the picture of another one"
            )
        for off_s, where in ((early_s, "begins earlier"), (late_s, "ends later")):
            if off_s > 0.5 * period_s:
                context.warn(
                    f"{name} {where} than its episodes in {names.EPISODES}, by {off_s:.4g} s."
                )
        if times.is_cut_off:
            context.leave_out("file", "that is cut off, without the pictures after that", name)
        elif late_s < -0.5 * period_s:
            step_s = 1.0 / self.rate_hz
            steps_s = max(self._span(p)[0] + (p["length"] - 1) * step_s for p in places)
            if steps_s > float(times.seconds[-1]) + 0.5 * period_s:
                return (
                    f"of {name}, which ends {steps_s - float(times.seconds[-1]):.4g} s before its "
                    "last step, so that each step may have the picture of another one"
                )
            context.warn(f"{name} ends {-late_s:.4g} s earlier than {names.EPISODES} says.")
        return times


def _period_s(times: VideoTimes, rate_hz: float) -> float:
    """Return the time from one picture to the next, s; that of the steps for a single picture."""
    return float(np.median(np.diff(times.seconds))) if len(times.ticks) > 1 else 1.0 / rate_hz


def _with_pictures(
    videos: _Videos, located: LocatedEpisode, context: ImportContext
) -> LocatedEpisode:
    """Return an episode with the picture of each step, without steps that have none."""
    path, times = videos.of(located.place, context)
    first_s, end_s = (located.place[f"{videos.key}/{name}"] for name in _SPAN)
    tick_s = float(times.tick_s)
    at_s = first_s + located.times_ns / _NS_PER_S
    most_s = _tolerance_s(at_s) + 0.5 * tick_s
    period_s = _period_s(times, videos.rate_hz)
    if at_s[-1] > min(end_s - 2.0 * most_s[-1], times.seconds[-1] + 0.5 * period_s):
        # If a picture is lost, the ones after it moved up; which one is unknown.
        have_s = min(end_s, float(times.seconds[-1]) + period_s) - first_s
        raise _Contradiction(
            "with fewer pictures than steps",
            f"{max(0.0, have_s):.4g} s of video, and a last step at {at_s[-1] - first_s:.4g} s",
        )
    newest = len(times.ticks) - 1
    after = np.asarray(np.searchsorted(times.seconds, at_s), np.int64).clip(max=newest)
    before = np.maximum(after - 1, 0)
    off_s, earlier_s = np.abs(times.seconds[after] - at_s), np.abs(times.seconds[before] - at_s)
    nearest = np.where(earlier_s < off_s, before, after)
    off_s = np.minimum(off_s, earlier_s)
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
    # Positions of the steps that stay.
    moved = np.cumsum(shown) - 1
    rows = {
        file: (moved[places[shown[places]]], part[shown[places]])
        for file, (places, part) in located.rows.items()
    }
    return LocatedEpisode(
        located.number,
        located.place,
        located.frames[shown],
        located.times_ns[shown],
        {file: part for file, part in rows.items() if len(part[0])},
        path,
        times,
        times.ticks[nearest[shown]],
    )
