"""Export of recordings as LeRobot datasets, version 3.0.

```
data/chunk-000/file-000.parquet                                numbers, a row for each step
videos/observation.images.camera/chunk-000/file-000.mp4        pictures, one episode after another
meta/info.json, meta/stats.json                                rate, features, statistics
meta/tasks.parquet, meta/episodes/chunk-000/file-000.parquet   tasks, and where each episode is
meta/shapechanger.json                                         headers and drivers of the episodes
```

LeRobot takes the time of a step to be its number divided by the rate, so the robot's clock is not
kept. Numbers have 32 bits. A state that nothing measured is the middle of its range, because one
NaN would make all statistics of a dataset NaN.

Statistics have LeRobot's keys and its way to combine episodes (`compute_stats.py` of lerobot
0.4.4), with three differences: quantiles are exact where LeRobot's come from a histogram, all
pictures of an episode count, not a sample, and their standard deviation is the true one, where
LeRobot's squares overflow 8 bits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import groupby, islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver, EpisodeHeader
from shapechanger.demos.exchange.exporting import require_alike, value_names
from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.format import ExchangeEpisode, ExchangeStep
from shapechanger.demos.exchange.video import VideoWriter
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

INFO: Final = "meta/info.json"
TASKS: Final = "meta/tasks.parquet"
EPISODES: Final = "meta/episodes"

HEADERS: Final = "meta/shapechanger.json"
"""Shapechanger's own file, which LeRobot ignores."""

HEADERS_FORMAT: Final = 1
"""Version of that file."""

ACTION: Final = "action"
STATE: Final = "observation.state"
CAMERA: Final = "observation.images.camera"
REWARD: Final = "next.reward"
DONE: Final = "next.done"
TERMINATED: Final = "next.terminated"
DATA_PATH: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH: Final = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"

_VERSION: Final = "v3.0"
_FILES_PER_CHUNK: Final = 1000
_DATA_FILE_MB: Final = 100
_VIDEO_FILE_MB: Final = 200
_MB: Final = 1 << 20
# LeRobot finds a picture by its time in the file, in 32 bits and to 0.1 ms: enough for 1000 s.
_VIDEO_FILE_S: Final = 500.0
_ROWS: Final = 256  # In memory at once, because they may hold pictures.
_SMALLEST_FRACTION: Final = 10_000  # Denominator of a rate: 19.98 Hz is 999/50.
_QUANTILES: Final = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_COLOURS: Final = 3
_LEVELS: Final = 256
# LeRobot thins out large pictures for its statistics.
_LARGE_PICTURE: Final = 300
_THINNED_PICTURE: Final = 150

_Stats = dict[str, NDArray[Any]]


def write_lerobot(
    episodes: Sequence[ExchangeEpisode],
    folder: Path,
    *,
    task: str = "",
    images: bool = False,
    rewarded: bool = False,
) -> int:
    """Write episodes into an existing folder, as one dataset.

    Episodes without steps are left out, because LeRobot does not support them.

    Args:
        episodes: The episodes, with one layout, one rate and one picture size.
        folder: Where to write.
        task: What the robot does, in words; "" for what the episodes say.
        images: Whether to store pictures as they were recorded, in place of video.
        rewarded: Whether all steps have a reward, which is written then.

    Returns:
        Number of steps written.

    Raises:
        DemosError: If the episodes differ, or a step lacks a picture that others have.
        MissingExtra: If a package that is needed is not installed.
    """
    require_alike(episodes, "a LeRobot dataset")
    dataset = _Dataset(episodes[0].header, folder, images=images, rewarded=rewarded)
    try:
        for episode in episodes:
            dataset.add(episode, task or _task(episode.header))
    finally:
        dataset.close_files()
    if not dataset.episodes:
        raise DemosError("There are no steps to export.")
    dataset.write_meta()
    return dataset.steps


def _task(header: EpisodeHeader) -> str:
    """Return what the robot does, in words: the note of an import, or the name of the env."""
    return str(header.notes.get("task") or header.env or header.body or "demonstration")


class _Dataset:
    """A dataset that is being written.

    Args:
        header: Header of any episode.
        folder: An existing, empty folder.
        images: Whether pictures are stored in the tables.
        rewarded: Whether there are rewards.

    Attributes:
        episodes: A row for each episode, with what LeRobot wants to know of it.
        steps: Number of steps written.
    """

    def __init__(
        self, header: EpisodeHeader, folder: Path, *, images: bool, rewarded: bool
    ) -> None:
        self.episodes: list[dict[str, Any]] = []
        self.steps = 0
        self._arrow = library("pyarrow", "lerobot")
        self._parquet = library("pyarrow.parquet", "lerobot")
        self._folder = folder
        self._header = header
        self._actions = Layout.from_json(header.action_layout)
        self._states = Layout.from_json(header.state_layout) if header.state_layout else None
        self._size = header.image_size
        self._images, self._rewarded = images, rewarded
        self._rate = Fraction(header.control_hz).limit_denominator(_SMALLEST_FRACTION)
        self._tasks: list[str] = []
        self._stats: list[dict[str, _Stats]] = []
        self._headers: list[dict[str, Any]] = []
        self._features = self._describe()
        self._schema = self._arrow.schema(
            [(key, self._type(feature)) for key, feature in self._stored().items()]
        )
        self._table: Any = None
        self._table_path = folder / DATA_PATH.format(chunk_index=0, file_index=0)
        self._tables = -1
        self._video: VideoWriter | None = None
        self._videos = -1

    @property
    def _fps(self) -> int | float:
        """Steps per second."""
        return self._rate.numerator if self._rate.denominator == 1 else float(self._rate)

    def add(self, episode: ExchangeEpisode, task: str) -> None:
        """Append an episode; one without steps is left out."""
        rows = iter(episode.rows)
        if (first := next(rows, None)) is None:
            return
        if task not in self._tasks:
            self._tasks.append(task)
        self._open_files()
        written = _Written(self.steps, self._tasks.index(task))
        chunk, picture = [first], None
        while chunk:
            picture = self._add(episode.name, chunk, written, picture)
            chunk = list(islice(rows, _ROWS))
        numbers = {key: np.concatenate(parts) for key, parts in written.numbers.items()}
        stats = {key: _number_stats(values) for key, values in numbers.items()}
        if self._size is not None:
            stats[CAMERA] = _picture_stats(written.histograms, written.steps)
        place = {"data/chunk_index": self._tables // _FILES_PER_CHUNK}
        self.episodes.append(
            {
                "episode_index": len(self.episodes),
                "tasks": [task],
                "length": written.steps,
                **place,
                "data/file_index": self._tables % _FILES_PER_CHUNK,
                "dataset_from_index": self.steps,
                "dataset_to_index": self.steps + written.steps,
                **self._video_place(written.steps),
                **{
                    f"stats/{key}/{name}": value.tolist()
                    for key, found in stats.items()
                    for name, value in found.items()
                },
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
        self._stats.append(stats)
        runs = [[driver, len(list(group))] for driver, group in groupby(written.drivers)]
        self._headers.append(
            episode.header.to_json() | {"outcome": episode.outcome, "drivers": runs}
        )
        self.steps += written.steps

    def close_files(self) -> None:
        """Close the files of the numbers and the pictures."""
        if self._table is not None:
            self._table.close()
            self._table = None
        if self._video is not None:
            self._video.close()
            self._video = None

    def write_meta(self) -> None:
        """Write `meta/`."""
        arrow = self._arrow
        (self._folder / EPISODES / "chunk-000").mkdir(parents=True)
        self._parquet.write_table(
            arrow.Table.from_pylist(self.episodes),
            self._folder / EPISODES / "chunk-000" / "file-000.parquet",
        )
        # LeRobot reads this table with pandas, which finds the task of a row in its index.
        tasks = arrow.table(
            {
                "task_index": arrow.array(range(len(self._tasks)), arrow.int64()),
                "__index_level_0__": arrow.array(self._tasks, arrow.string()),
            }
        )
        columns = [
            {"name": "task_index", "field_name": "task_index", "pandas_type": "int64"}
            | {"numpy_type": "int64", "metadata": None},
            {"name": None, "field_name": "__index_level_0__", "pandas_type": "unicode"}
            | {"numpy_type": "object", "metadata": None},
        ]
        index = {"index_columns": ["__index_level_0__"], "column_indexes": [], "columns": columns}
        tasks = tasks.replace_schema_metadata({"pandas": json.dumps(index)})
        self._parquet.write_table(tasks, self._folder / TASKS)
        stats = {
            key: {name: value.tolist() for name, value in _combined(self._stats, key).items()}
            for key in self._features
        }
        self._write_json("meta/stats.json", stats)
        self._write_json(HEADERS, {"format": HEADERS_FORMAT, "episodes": self._headers})
        header = self._header
        self._write_json(
            INFO,
            {
                "codebase_version": _VERSION,
                "robot_type": header.body or header.robot or None,
                "total_episodes": len(self.episodes),
                "total_frames": self.steps,
                "total_tasks": len(self._tasks),
                "chunks_size": _FILES_PER_CHUNK,
                "data_files_size_in_mb": _DATA_FILE_MB,
                "video_files_size_in_mb": _VIDEO_FILE_MB,
                "fps": self._fps,
                "splits": {"train": f"0:{len(self.episodes)}"},
                "data_path": DATA_PATH,
                "video_path": None if self._size is None or self._images else VIDEO_PATH,
                "features": self._features,
            },
        )

    def _describe(self) -> dict[str, dict[str, Any]]:
        """Return the features of `info.json`."""
        found: dict[str, dict[str, Any]] = {ACTION: _vector(self._actions)}
        if self._states is not None:
            found[STATE] = _vector(self._states)
        if self._size is not None:
            width, height = self._size
            found[CAMERA] = {
                "dtype": "image" if self._images else "video",
                "shape": [height, width, _COLOURS],
                "names": ["height", "width", "channels"],
            }
            if not self._images:
                found[CAMERA]["info"] = {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": VideoWriter.CODEC,
                    "video.pix_fmt": VideoWriter.PIXELS,
                    "video.is_depth_map": False,
                    "video.fps": self._fps,
                    "video.channels": _COLOURS,
                    "has_audio": False,
                }
        kinds = {REWARD: "float32"} if self._rewarded else {}
        kinds |= {DONE: "bool", TERMINATED: "bool", "timestamp": "float32"}
        kinds |= dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")
        plain = {key: {"dtype": kind, "shape": [1], "names": None} for key, kind in kinds.items()}
        return found | plain

    def _stored(self) -> dict[str, dict[str, Any]]:
        """Return the features that are columns of the tables."""
        return {key: ft for key, ft in self._features.items() if ft["dtype"] != "video"}

    def _type(self, feature: Mapping[str, Any]) -> Any:
        """Return the type of the column of a feature."""
        arrow, kind, size = self._arrow, feature["dtype"], feature["shape"][0]
        if kind == "image":
            return arrow.struct([("bytes", arrow.binary()), ("path", arrow.string())])
        plain = arrow.bool_() if kind == "bool" else getattr(arrow, kind)()
        return plain if size == 1 else arrow.list_(plain, size)

    def _open_files(self) -> None:
        """Continue in new files once the present ones are full."""
        full = self._table is None or self._table_path.stat().st_size >= _DATA_FILE_MB * _MB
        if full:
            if self._table is not None:
                self._table.close()
            self._tables += 1
            chunk, file = divmod(self._tables, _FILES_PER_CHUNK)
            path = self._folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._table_path = path
            self._table = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        if self._size is None or self._images:
            return
        video = self._video
        if video is not None:
            if video.bytes_written < _VIDEO_FILE_MB * _MB and video.seconds < _VIDEO_FILE_S:
                return
            video.close()
        self._videos += 1
        chunk, file = divmod(self._videos, _FILES_PER_CHUNK)
        names = {"video_key": CAMERA, "chunk_index": chunk, "file_index": file}
        path = self._folder / VIDEO_PATH.format(**names)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._video = VideoWriter(path, self._size, self._rate)

    def _video_place(self, steps: int) -> dict[str, Any]:
        """Return where the video of the newest episode is."""
        if self._video is None:
            return {}
        chunk, file = divmod(self._videos, _FILES_PER_CHUNK)
        end = self._video.frames
        return {
            f"videos/{CAMERA}/chunk_index": chunk,
            f"videos/{CAMERA}/file_index": file,
            f"videos/{CAMERA}/from_timestamp": float((end - steps) / self._rate),
            f"videos/{CAMERA}/to_timestamp": float(end / self._rate),
        }

    def _add(
        self, name: str, rows: Sequence[ExchangeStep], written: _Written, shown: _Picture | None
    ) -> _Picture | None:
        """Append some steps; return the picture of the last one."""
        steps = [row.step for row in rows]
        start, count = written.steps, len(rows)
        frames = np.arange(start, start + count)
        done = [[step.terminated or step.truncated] for step in steps]
        columns: dict[str, NDArray[Any]] = {
            ACTION: _in_32_bits([step.action for step in steps]),
            DONE: np.array(done),
            TERMINATED: np.array([[step.terminated] for step in steps]),
            "timestamp": (frames / float(self._rate)).astype(np.float32)[:, None],
            "frame_index": frames[:, None],
            "episode_index": np.full((count, 1), len(self.episodes)),
            "index": frames[:, None] + written.first,
            "task_index": np.full((count, 1), written.task),
        }
        if self._states is not None:
            states = np.array([step.state for step in steps])
            middles = np.repeat([f.middle for f in self._states], [f.size for f in self._states])
            states = np.where(np.isfinite(states), states, middles)
            columns[STATE] = _in_32_bits(states)
        if self._rewarded:
            columns[REWARD] = _in_32_bits([[step.reward] for step in steps])
        for key, values in columns.items():
            if not np.isfinite(values).all():
                raise DemosError(
                    f"{name} has a number in {key} that is not finite in 32 bits: export it to csv."
                )
            written.numbers.setdefault(key, []).append(values)
        jpegs: list[dict[str, Any]] = []
        if self._size is not None:
            for number, row in enumerate(rows, start):
                where = f"of step {number} of {name}"
                if row.jpeg is not None:
                    shown = _picture(row.jpeg, where, self._size)
                if shown is None:
                    raise DemosError(
                        f"There is no picture {where}, but LeRobot needs one at every step: drop "
                        "the steps before the first picture, or export to csv."
                    )
                written.histograms += shown.histograms
                if self._video is not None:
                    self._video.add(shown.pixels)
                jpegs.append({"bytes": shown.jpeg, "path": f"frame-{number:06d}.jpg"})
        arrow = self._arrow
        arrays: list[Any] = []
        for column in self._schema:
            if column.name == CAMERA:
                arrays.append(arrow.array(jpegs, column.type))
            else:
                plain = columns[column.name]
                values: Any = plain[:, 0] if plain.shape[1] == 1 else list(plain)
                arrays.append(arrow.array(values, column.type))
        self._table.write_table(arrow.Table.from_arrays(arrays, schema=self._schema))
        written.steps += count
        written.drivers.extend(step.driver for step in steps)
        return shown

    def _write_json(self, name: str, value: Any) -> None:
        text = json.dumps(value, indent=4, ensure_ascii=False, allow_nan=False)
        (self._folder / name).write_text(text, encoding="utf-8", errors="replace")


def _in_32_bits(values: Any) -> NDArray[np.float32]:
    """Round numbers; what is too large becomes infinite, and is refused then."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float64).astype(np.float32)


def _vector(layout: Layout) -> dict[str, Any]:
    """Return the feature of a vector; the units are our own addition, which LeRobot ignores."""
    units = [feature.unit for feature in layout for _ in range(feature.size)]
    names = value_names(layout)
    return {"dtype": "float32", "shape": [layout.size], "names": names, "units": units}


@dataclass(slots=True)
class _Written:
    """What was written of the newest episode.

    Attributes:
        first: Number of its first step in the dataset.
        task: Number of its task.
        steps: Number of steps.
        numbers: Columns of numbers, in parts of shape (n, k).
        histograms: Number of pixels of each value, shape (3, 256).
        drivers: Driver of each step.
    """

    first: int
    task: int
    steps: int = 0
    numbers: dict[str, list[NDArray[Any]]] = field(default_factory=dict[str, list[NDArray[Any]]])
    histograms: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((_COLOURS, _LEVELS), np.int64)
    )
    drivers: list[Driver] = field(default_factory=list[Driver])


@dataclass(frozen=True, slots=True)
class _Picture:
    """A picture as JPEG, as pixels of shape (H, W, 3), and as a histogram of each colour."""

    jpeg: bytes
    pixels: NDArray[np.uint8]
    histograms: NDArray[np.int64]


def _picture(jpeg: bytes, where: str, size: tuple[int, int]) -> _Picture:
    pixels = decode_picture(jpeg, where)
    height, width, _ = pixels.shape
    if (width, height) != size:
        raise DemosError(
            f"The picture {where} has {width} x {height} pixels, and not {size[0]} x {size[1]} "
            "like the others: a LeRobot dataset has one size."
        )
    thinned = pixels
    if max(width, height) >= _LARGE_PICTURE:
        stride = max(1, (width if width > height else height) // _THINNED_PICTURE)
        thinned = pixels[::stride, ::stride]
    colours = range(_COLOURS)
    counts = [np.bincount(thinned[..., colour].ravel(), minlength=_LEVELS) for colour in colours]
    return _Picture(jpeg, pixels, np.array(counts))


def _number_stats(values: NDArray[Any]) -> _Stats:
    """Return the statistics of the columns of an episode, shape (n, k): (k,) each."""
    numbers = values.astype(np.float64)
    quantiles = np.quantile(numbers, list(_QUANTILES.values()), axis=0, method="inverted_cdf")
    return {
        "min": numbers.min(axis=0),
        "max": numbers.max(axis=0),
        "mean": numbers.mean(axis=0),
        "std": numbers.std(axis=0),
        "count": np.array([len(numbers)]),
        **dict(zip(_QUANTILES, quantiles, strict=True)),
    }


def _picture_stats(histograms: NDArray[np.int64], count: int) -> _Stats:
    """Return the statistics of each colour from 0 to 1, shape (3, 1, 1) each.

    Args:
        histograms: Number of pixels of each value, shape (3, 256).
        count: Number of pictures.
    """
    levels = np.arange(_LEVELS) / (_LEVELS - 1)
    shares = histograms / histograms.sum(axis=1, keepdims=True)
    below = shares.cumsum(axis=1)
    mean = shares @ levels
    present = histograms > 0
    found = {
        "min": levels[present.argmax(axis=1)],
        "max": levels[_LEVELS - 1 - present[:, ::-1].argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt((shares * (levels - mean[:, None]) ** 2).sum(axis=1)),
        **{name: levels[(below >= q).argmax(axis=1)] for name, q in _QUANTILES.items()},
    }
    stats = {name: value.reshape(_COLOURS, 1, 1) for name, value in found.items()}
    return stats | {"count": np.array([count])}


def _combined(episodes: Sequence[Mapping[str, _Stats]], key: str) -> _Stats:
    """Return the statistics of a feature over all episodes, each weighted by its count."""
    stats = [episode[key] for episode in episodes]
    counts = np.array([found["count"][0] for found in stats], np.float64)
    weights = counts / counts.sum()

    def mean(values: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return np.tensordot(weights, np.stack(values), axes=1)

    centre = mean([found["mean"] for found in stats])
    spread = mean([found["std"] ** 2 + (found["mean"] - centre) ** 2 for found in stats])
    return {
        "min": np.min([found["min"] for found in stats], axis=0),
        "max": np.max([found["max"] for found in stats], axis=0),
        "mean": centre,
        "std": np.sqrt(spread),
        "count": np.array([math.fsum(counts)], np.int64),
        **{name: mean([found[name] for found in stats]) for name in _QUANTILES},
    }
