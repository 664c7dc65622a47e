"""Export of recordings as LeRobot datasets, version 3.0.

```
data/chunk-000/file-000.parquet                                numbers, a row for each step
videos/observation.images.camera/chunk-000/file-000.mp4        images, one episode after another
meta/info.json, meta/stats.json                                rate, features, statistics
meta/tasks.parquet, meta/episodes/chunk-000/file-000.parquet   tasks, and where each episode is
meta/shapechanger.json                                         headers and drivers of the episodes
```

LeRobot computes the time of a step from its number and the rate, so the robot's clock is not kept.
With `images`, the images are in the table instead of videos. Actions, states and rewards have 32
bits. A state that was not measured becomes the middle of its range, because one NaN would make all
statistics of a dataset NaN.

Statistics have LeRobot's keys (`compute_stats.py` of lerobot 0.4.4); docs/exchange.md lists how
their numbers differ.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import groupby, islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.base import COLUMNS, ExchangeEpisode, ExportContext, decoded_images
from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.video import VideoWriter
from shapechanger.errors import DemosError
from shapechanger.layout import value_names

INFO: Final = "meta/info.json"
EPISODES: Final = "meta/episodes"

OURS: Final = "meta/shapechanger.json"
"""Shapechanger's own file, which LeRobot ignores."""

DONE: Final = COLUMNS["truncated"]["lerobot"]
"""Column that is true for the last step of an episode that ended, for any reason."""

_ACTION, _STATE, _CAMERA, _REWARD, _TERMINATED = (
    COLUMNS[field]["lerobot"] for field in ("action", "state", "frame", "reward", "terminated")
)
_DATA_PATH: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO_PATH: Final = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
# LeRobot finds an image by its time in the file, a 32-bit number that must be right within 0.1 ms,
# as it is for the first 1000 s.
_VIDEO_FILE_S: Final = 500.0
_ROWS: Final = 256  # Rows in memory at once, which may have images.
_SMALLEST_FRACTION: Final = 10_000  # Largest denominator of a rate: 19.98 Hz is 999/50.
_INDEX: Final = "__index_level_0__"  # Index column of pandas, with which LeRobot reads the tasks.
_QUANTILES: Final = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_LEVELS: Final = 256

_Columns = dict[str, NDArray[Any]]


def write(episodes: Sequence[ExchangeEpisode], folder: Path, context: ExportContext) -> int:
    """Write episodes into an existing folder, as one dataset, and return the number of steps."""
    dataset = _Dataset(episodes[0].header, folder, context)
    for episode in episodes:
        dataset.add(episode)
    dataset.finish()
    return dataset.steps


class _Dataset:
    def __init__(self, header: EpisodeHeader, folder: Path, context: ExportContext) -> None:
        self.steps = 0
        self._arrow = library("pyarrow", "lerobot")
        self._parquet = library("pyarrow.parquet", "lerobot")
        self._folder = folder
        self._context = context
        self._header = header
        self._is_filmed = header.image_size is not None and not context.images
        self._rate = Fraction(header.control_hz).limit_denominator(_SMALLEST_FRACTION)
        self._fps = self._rate.numerator if self._rate.denominator == 1 else float(self._rate)
        self._tasks: list[str] = []
        self._places: list[dict[str, Any]] = []  # A row of `meta/episodes` for each episode.
        self._headers: list[dict[str, Any]] = []
        self._parts: list[_Columns] = []  # The numbers of all steps.
        self._levels = np.zeros((_LEVELS, 3), np.int64)  # Number of pixels with each level.
        self._table: Any = None
        self._videos: list[VideoWriter] = []

    def add(self, episode: ExchangeEpisode) -> None:
        """Append an episode."""
        header = episode.header
        said = header.notes.get("task") or header.env or header.body or "demonstration"
        task = self._context.task or str(said)
        self._tasks += [] if task in self._tasks else [task]
        video = self._new_video() if self._is_filmed else None
        levels = np.zeros_like(self._levels)
        steps = self._with_images(episode, video, levels)
        parts: list[_Columns] = []
        drivers: list[str] = []
        while chunk := list(islice(steps, _ROWS)):
            columns = self._columns([step for step, _ in chunk], len(drivers), task)
            self._write_rows(columns, [jpeg for _, jpeg in chunk], episode.name)
            parts.append(columns)
            drivers += [step.driver for step, _ in chunk]
        count = len(drivers)
        place: dict[str, Any] = {
            "episode_index": len(self._places),
            "tasks": [task],
            "length": count,
            "dataset_from_index": self.steps,
            "dataset_to_index": self.steps + count,
        }
        for part in ("data", "meta/episodes"):
            place |= {f"{part}/chunk_index": 0, f"{part}/file_index": 0}
        if video is not None:
            part = dict[str, float](chunk_index=0, file_index=len(self._videos) - 1)
            part["from_timestamp"] = float((video.frames - count) / self._rate)
            part["to_timestamp"] = float(video.frames / self._rate)
            place |= {f"videos/{_CAMERA}/{name}": value for name, value in part.items()}
        for key, found in _statistics(parts, levels).items():
            place |= {f"stats/{key}/{name}": value for name, value in found.items()}
        self._places.append(place)
        self._parts += parts
        self._levels += levels
        runs = [[driver, len(list(group))] for driver, group in groupby(drivers)]
        about = {"outcome": episode.outcome, "drivers": runs}
        self._headers.append(header.to_json() | about)
        self.steps += count

    def _new_video(self) -> VideoWriter:
        """Return the video for the next episode: the last one, or a new one if that is full."""
        for last in self._videos[-1:]:
            if last.frames < _VIDEO_FILE_S * self._rate:
                return last
            last.close()
        where = {"video_key": _CAMERA, "chunk_index": 0, "file_index": len(self._videos)}
        path = self._folder / _VIDEO_PATH.format(**where)
        path.parent.mkdir(parents=True, exist_ok=True)
        size = self._header.image_size or (0, 0)
        self._videos.append(VideoWriter(path, size, self._rate))
        return self._videos[-1]

    def _with_images(
        self, episode: ExchangeEpisode, video: VideoWriter | None, levels: NDArray[np.int64]
    ) -> Iterator[tuple[Step, bytes | None]]:
        """Yield steps with their JPEGs, and add the images to the video and to `levels`."""
        shown, counts = np.empty(0, np.uint8), np.zeros_like(levels)
        for record, pixels in decoded_images(episode, "LeRobot"):
            if pixels is not None:
                colours = pixels.reshape(-1, 3).T
                counts = np.stack([np.bincount(c, minlength=_LEVELS) for c in colours], axis=1)
                shown = pixels
            levels += counts
            if video is not None:
                video.add(shown)
            yield record.step, record.jpeg

    def _columns(self, steps: Sequence[Step], first: int, task: str) -> _Columns:
        """Return the columns of steps, shape (n, k) each; `first` is the number of the first."""
        frames = np.arange(first, first + len(steps))[:, None]
        columns: _Columns = {_ACTION: _in_32_bits([step.action for step in steps])}
        if layout := self._header.state_layout:
            states = np.array([step.state for step in steps])
            middles = np.repeat([f.middle for f in layout], [f.size for f in layout])
            columns[_STATE] = _in_32_bits(np.where(np.isfinite(states), states, middles))
        if self._context.rewarded:
            columns[_REWARD] = _in_32_bits([[step.reward] for step in steps])
        return columns | {
            DONE: np.array([[step.terminated or step.truncated] for step in steps]),
            _TERMINATED: np.array([[step.terminated] for step in steps]),
            "timestamp": (frames / float(self._rate)).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full_like(frames, len(self._places)),
            "index": frames + self.steps,
            "task_index": np.full_like(frames, self._tasks.index(task)),
        }

    def _write_rows(self, columns: _Columns, jpegs: Sequence[bytes | None], name: str) -> None:
        """Append rows to the table; the first call creates the table."""
        arrow = self._arrow
        stored: dict[str, Any] = {}
        for key, values in columns.items():
            if not np.isfinite(values).all():
                raise DemosError(f"{name} has a number in {key} that is not finite in 32 bits.")
            size, flat = values.shape[1], arrow.array(values.ravel())
            lists = arrow.FixedSizeListArray
            stored[key] = flat if size == 1 else lists.from_arrays(flat, size)
        if self._header.image_size is not None and not self._is_filmed:
            first = columns["frame_index"][0, 0]
            names = [f"frame-{number:06d}.jpg" for number, _ in enumerate(jpegs, first)]
            parts = [arrow.array(jpegs, arrow.binary()), arrow.array(names)]
            stored[_CAMERA] = arrow.StructArray.from_arrays(parts, ["bytes", "path"])
        table = arrow.table(stored)
        if self._table is None:
            path = self._folder / _DATA_PATH.format(chunk_index=0, file_index=0)
            path.parent.mkdir(parents=True)
            self._features = self._described(columns)
            self._table = self._parquet.ParquetWriter(path, table.schema)
        self._table.write_table(table)

    def _described(self, columns: _Columns) -> dict[str, dict[str, Any]]:
        """Return the features for `info.json`, with types and sizes from the columns."""
        found: dict[str, dict[str, Any]] = {
            key: {"dtype": str(values.dtype), "shape": [values.shape[1]], "names": None}
            for key, values in columns.items()
        }
        header = self._header
        for key, layout in ((_ACTION, header.action_layout), (_STATE, header.state_layout)):
            if layout:  # The units are our own addition, which LeRobot ignores.
                units = [feature.unit for feature in layout for _ in range(feature.size)]
                found[key] |= {"names": value_names(layout), "units": units}
        if self._header.image_size is not None:
            width, height = self._header.image_size
            found[_CAMERA] = {
                "dtype": "video" if self._is_filmed else "image",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
            }
            about = {"height": height, "width": width, "codec": "h264", "pix_fmt": "yuv420p"}
            about |= {"is_depth_map": False, "fps": self._fps, "channels": 3}
            info = {f"video.{key}": value for key, value in about.items()} | {"has_audio": False}
            found[_CAMERA] |= {"info": info} if self._is_filmed else {}
        return found

    def finish(self) -> None:
        """Close the files, and write `meta/`."""
        for file in (self._table, *self._videos[-1:]):
            file.close()
        arrow, path = self._arrow, self._folder / EPISODES / "chunk-000/file-000.parquet"
        path.parent.mkdir(parents=True)
        self._parquet.write_table(arrow.Table.from_pylist(self._places), path)
        kind = {"pandas_type": "unicode", "numpy_type": "object", "metadata": None}
        about = {"name": None, "field_name": _INDEX} | kind
        pandas = {"index_columns": [_INDEX], "column_indexes": [], "columns": [about]}
        tasks = arrow.table({"task_index": range(len(self._tasks)), _INDEX: self._tasks})
        tasks = tasks.replace_schema_metadata({"pandas": json.dumps(pandas)})
        self._parquet.write_table(tasks, self._folder / "meta/tasks.parquet")
        stats = _statistics(self._parts, self._levels)
        info: dict[str, Any] = {
            "codebase_version": "v3.0",
            "robot_type": self._header.body or self._header.robot or None,
            "total_episodes": len(self._places),
            "total_frames": self.steps,
            "total_tasks": len(self._tasks),
            "chunks_size": 1000,  # LeRobot needs this and the next two to append episodes.
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._fps,
            "splits": {"train": f"0:{len(self._places)}"},
            "data_path": _DATA_PATH,
            "video_path": _VIDEO_PATH if self._is_filmed else None,
            "features": self._features,
        }
        own = {"format": 1, "episodes": self._headers}
        for name, value in (("meta/stats.json", stats), (OURS, own), (INFO, info)):
            text = json.dumps(value, indent=4, ensure_ascii=False, allow_nan=False)
            (self._folder / name).write_text(text, encoding="utf-8", errors="replace")


def _in_32_bits(values: Any) -> NDArray[np.float32]:
    """Round numbers to 32 bits; numbers that are too large become infinite."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float64).astype(np.float32)


def _statistics(
    parts: Sequence[_Columns], levels: NDArray[np.int64]
) -> dict[str, dict[str, list[Any]]]:
    """Return the statistics of columns, and of images from the numbers of pixels by level."""
    found: dict[str, dict[str, list[Any]]] = {}
    for key in parts[0]:
        values = np.concatenate([part[key] for part in parts]).astype(np.float64)
        numbers = _stats_of(values, np.ones(values.shape, np.int64))
        found[key] = {name: value.tolist() for name, value in numbers.items()}
        found[key]["count"] = [len(values)]
    if levels.any():
        values = np.repeat(np.arange(_LEVELS)[:, None] / (_LEVELS - 1), 3, axis=1)
        colours = _stats_of(values, levels)
        found[_CAMERA] = {name: value.reshape(3, 1, 1).tolist() for name, value in colours.items()}
        found[_CAMERA]["count"] = found[_ACTION]["count"]
    return found


def _stats_of(values: NDArray[np.float64], weights: NDArray[np.int64]) -> _Columns:
    """Return weighted statistics of columns, shape (k,) each; both arrays have shape (n, k)."""
    mean = np.average(values, axis=0, weights=weights)
    quantiles = np.quantile(
        values, list(_QUANTILES.values()), axis=0, method="inverted_cdf", weights=weights
    )
    return {
        "min": values.min(axis=0, where=weights > 0, initial=np.inf),
        "max": values.max(axis=0, where=weights > 0, initial=-np.inf),
        "mean": mean,
        "std": np.sqrt(np.average((values - mean) ** 2, axis=0, weights=weights)),
        **dict(zip(_QUANTILES, quantiles, strict=True)),
    }
