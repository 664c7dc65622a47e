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
images of an episode count, not a sample, and their standard deviation is the true one, where
LeRobot's squares overflow 8 bits.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.exports import decoded_steps, require_alike, value_names
from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.format import ExchangeEpisode, ExportContext, name_in
from shapechanger.demos.exchange.pictures import VideoWriter
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

INFO: Final = "meta/info.json"
TASKS: Final = "meta/tasks.parquet"
EPISODES: Final = "meta/episodes"

OURS: Final = "meta/shapechanger.json"
"""Shapechanger's own file, which LeRobot ignores."""

DONE: Final = name_in("lerobot", "truncated")
"""Whether an episode ended with a step, for any reason."""

_ACTION, _STATE, _CAMERA, _REWARD, _TERMINATED = (
    name_in("lerobot", field) for field in ("action", "state", "frame", "reward", "terminated")
)
_VERSION: Final = "v3.0"
_DATA_PATH: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO_PATH: Final = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_FILES_PER_CHUNK: Final = 1000
_DATA_FILE_MB: Final = 100
_VIDEO_FILE_MB: Final = 200
_MB: Final = 1 << 20
# LeRobot finds an image by its time in the file, in 32 bits and to 0.1 ms: enough for 1000 s.
_VIDEO_FILE_S: Final = 500.0
_ROWS: Final = 256  # In memory at once, because they may hold images.
_SMALLEST_FRACTION: Final = 10_000  # Denominator of a rate: 19.98 Hz is 999/50.
_QUANTILES: Final = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_COLOURS: Final = 3
_LEVELS: Final = 256
# LeRobot thins out large images for its statistics.
_LARGE_PICTURE: Final = 300
_THINNED_PICTURE: Final = 150

_Stats = dict[str, NDArray[Any]]


def write(episodes: Sequence[ExchangeEpisode], folder: Path, context: ExportContext) -> int:
    """Write episodes into an existing folder, as one dataset, and return the number of steps."""
    require_alike(episodes, "LeRobot")
    dataset = _Dataset(episodes[0].header, folder, context)
    try:
        for episode in episodes:
            header = episode.header
            said = header.notes.get("task") or header.env or header.body or "demonstration"
            dataset.add(episode, context.task or str(said))
    finally:
        dataset.close_files()
    dataset.write_meta()
    return dataset.steps


class _Dataset:
    """A dataset that is being written into an empty folder; `places` has a row for each episode."""

    def __init__(self, header: EpisodeHeader, folder: Path, context: ExportContext) -> None:
        self.places: list[dict[str, Any]] = []
        self.steps = 0
        self._arrow = library("pyarrow", "lerobot")
        self._parquet = library("pyarrow.parquet", "lerobot")
        self._folder = folder
        self._header = header
        self._states = Layout.from_json(header.state_layout) if header.state_layout else None
        self._size = header.image_size
        self._filmed = header.image_size is not None and not context.images
        self._rewarded = context.rewarded
        self._rate = Fraction(header.control_hz).limit_denominator(_SMALLEST_FRACTION)
        self._fps = self._rate.numerator if self._rate.denominator == 1 else float(self._rate)
        self._tasks: list[str] = []
        self._stats: list[dict[str, _Stats]] = []
        self._headers: list[dict[str, Any]] = []
        self._features = self._describe()
        stored = {key: about for key, about in self._features.items() if about["dtype"] != "video"}
        self._schema = self._arrow.schema([(key, self._type(ft)) for key, ft in stored.items()])
        self._table: Any = None
        self._table_path = folder
        self._tables = self._videos = -1
        self._video: VideoWriter | None = None

    def add(self, episode: ExchangeEpisode, task: str) -> None:
        """Append an episode."""
        steps: list[Step] = []
        stored: list[dict[str, Any]] = []
        parts: list[dict[str, NDArray[Any]]] = []
        shown, counts = np.empty(0, np.uint8), np.zeros((_LEVELS, _COLOURS), np.int64)
        histograms = np.zeros_like(counts)
        rows = decoded_steps(episode.rows, self._size, episode.name, "LeRobot")
        self._open_files()
        for number, (row, jpeg, pixels) in enumerate(rows):
            if pixels is not None:
                shown, counts = pixels, _histograms(pixels)
            histograms += counts
            if self._video is not None:
                self._video.add(shown)
            steps.append(row.step)
            stored.append({"bytes": jpeg, "path": f"frame-{number:06d}.jpg"})
            if len(stored) == _ROWS:
                parts.append(self._write_rows(steps, stored, task, episode.name))
        if stored:
            parts.append(self._write_rows(steps, stored, task, episode.name))
        numbers = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        stats = {key: _stats_of(values.astype(np.float64)) for key, values in numbers.items()}
        if self._size is not None:
            levels = np.repeat(np.arange(_LEVELS)[:, None] / (_LEVELS - 1), _COLOURS, axis=1)
            found = _stats_of(levels, histograms)
            stats[_CAMERA] = {name: value.reshape(-1, 1, 1) for name, value in found.items()}
            stats[_CAMERA]["count"] = np.array([len(steps)])
        place: dict[str, Any] = {
            "episode_index": len(self.places),
            "tasks": [task],
            "length": len(steps),
            "data/chunk_index": self._tables // _FILES_PER_CHUNK,
            "data/file_index": self._tables % _FILES_PER_CHUNK,
            "dataset_from_index": self.steps,
            "dataset_to_index": self.steps + len(steps),
        }
        if self._video is not None:
            end = self._video.frames
            place |= {
                f"videos/{_CAMERA}/chunk_index": self._videos // _FILES_PER_CHUNK,
                f"videos/{_CAMERA}/file_index": self._videos % _FILES_PER_CHUNK,
                f"videos/{_CAMERA}/from_timestamp": float((end - len(steps)) / self._rate),
                f"videos/{_CAMERA}/to_timestamp": float(end / self._rate),
            }
        place |= {
            f"stats/{key}/{name}": value.tolist()
            for key, found in stats.items()
            for name, value in found.items()
        }
        place |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        self.places.append(place)
        self._stats.append(stats)
        runs = [[who, len(list(group))] for who, group in groupby(step.driver for step in steps)]
        self._headers.append(
            episode.header.to_json() | {"outcome": episode.outcome, "drivers": runs}
        )
        self.steps += len(steps)

    def close_files(self) -> None:
        """Close the files of the numbers and the images."""
        for file in (self._table, self._video):
            if file is not None:
                file.close()
        self._table = self._video = None

    def write_meta(self) -> None:
        """Write `meta/`."""
        arrow = self._arrow
        (self._folder / EPISODES / "chunk-000").mkdir(parents=True)
        self._parquet.write_table(
            arrow.Table.from_pylist(self.places),
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
        self._write_json(OURS, {"format": 1, "episodes": self._headers})
        info: dict[str, Any] = {
            "codebase_version": _VERSION,
            "robot_type": self._header.body or self._header.robot or None,
            "total_episodes": len(self.places),
            "total_frames": self.steps,
            "total_tasks": len(self._tasks),
            "chunks_size": _FILES_PER_CHUNK,
            "data_files_size_in_mb": _DATA_FILE_MB,
            "video_files_size_in_mb": _VIDEO_FILE_MB,
            "fps": self._fps,
            "splits": {"train": f"0:{len(self.places)}"},
            "data_path": _DATA_PATH,
            "video_path": _VIDEO_PATH if self._filmed else None,
            "features": self._features,
        }
        self._write_json(INFO, info)

    def _describe(self) -> dict[str, dict[str, Any]]:
        """Return the features of `info.json`."""
        found = {_ACTION: _vector(Layout.from_json(self._header.action_layout))}
        if self._states is not None:
            found[_STATE] = _vector(self._states)
        if self._size is not None:
            width, height = self._size
            found[_CAMERA] = {
                "dtype": "video" if self._filmed else "image",
                "shape": [height, width, _COLOURS],
                "names": ["height", "width", "channels"],
            }
            about = {
                "video.height": height,
                "video.width": width,
                "video.codec": VideoWriter.CODEC,
                "video.pix_fmt": VideoWriter.PIXELS,
                "video.is_depth_map": False,
                "video.fps": self._fps,
                "video.channels": _COLOURS,
                "has_audio": False,
            }
            found[_CAMERA] |= {"info": about} if self._filmed else {}
        kinds = {_REWARD: "float32"} if self._rewarded else {}
        kinds |= {DONE: "bool", _TERMINATED: "bool", "timestamp": "float32"}
        kinds |= dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")
        plain = {key: {"dtype": kind, "shape": [1], "names": None} for key, kind in kinds.items()}
        return found | plain

    def _type(self, feature: Mapping[str, Any]) -> Any:
        """Return the type of the column of a feature."""
        arrow, kind, size = self._arrow, feature["dtype"], feature["shape"][0]
        if kind == "image":
            return arrow.struct([("bytes", arrow.binary()), ("path", arrow.string())])
        plain = arrow.bool_() if kind == "bool" else getattr(arrow, kind)()
        return plain if size == 1 else arrow.list_(plain, size)

    def _next_file(self, template: str, number: int) -> Path:
        chunk, file = divmod(number, _FILES_PER_CHUNK)
        names = {"video_key": _CAMERA, "chunk_index": chunk, "file_index": file}
        path = self._folder / template.format(**names)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _open_files(self) -> None:
        """Continue in new files once the present ones are full."""
        table, video = self._table, self._video
        if table is None or self._table_path.stat().st_size >= _DATA_FILE_MB * _MB:
            if table is not None:
                table.close()
            self._tables += 1
            self._table_path = path = self._next_file(_DATA_PATH, self._tables)
            self._table = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        full = video is None or (
            video.bytes_written >= _VIDEO_FILE_MB * _MB
            or video.frames >= _VIDEO_FILE_S * self._rate
        )
        if self._filmed and self._size is not None and full:
            if video is not None:
                video.close()
            self._videos += 1
            path = self._next_file(_VIDEO_PATH, self._videos)
            self._video = VideoWriter(path, self._size, self._rate)

    def _write_rows(
        self, steps: Sequence[Step], stored: list[dict[str, Any]], task: str, name: str
    ) -> dict[str, NDArray[Any]]:
        """Append the newest steps, those with the `stored` images, and return their columns."""
        count, end = len(stored), len(steps)
        newest, frames = steps[end - count :], np.arange(end - count, end)
        if task not in self._tasks:
            self._tasks.append(task)
        columns: dict[str, NDArray[Any]] = {
            _ACTION: _in_32_bits([step.action for step in newest]),
            DONE: np.array([[step.terminated or step.truncated] for step in newest]),
            _TERMINATED: np.array([[step.terminated] for step in newest]),
            "timestamp": (frames / float(self._rate)).astype(np.float32)[:, None],
            "frame_index": frames[:, None],
            "episode_index": np.full((count, 1), len(self.places)),
            "index": frames[:, None] + self.steps,
            "task_index": np.full((count, 1), self._tasks.index(task)),
        }
        if self._states is not None:
            states = np.array([step.state for step in newest])
            middles = np.repeat([f.middle for f in self._states], [f.size for f in self._states])
            columns[_STATE] = _in_32_bits(np.where(np.isfinite(states), states, middles))
        if self._rewarded:
            columns[_REWARD] = _in_32_bits([[step.reward] for step in newest])
        for key, values in columns.items():
            if not np.isfinite(values).all():
                raise DemosError(
                    f"{name} has a number in {key} that is not finite in 32 bits: export it to csv."
                )
        arrays: list[Any] = []
        for column in self._schema:
            plain = columns.get(column.name)
            values: Any = stored if plain is None else list(plain)
            if plain is not None and plain.shape[1] == 1:
                values = plain[:, 0]
            arrays.append(self._arrow.array(values, column.type))
        self._table.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        stored.clear()
        return columns

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


def _histograms(pixels: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the number of pixels of each value, shape (256, 3)."""
    height, width, _ = pixels.shape
    if max(width, height) >= _LARGE_PICTURE:
        stride = max(1, max(width, height) // _THINNED_PICTURE)
        pixels = pixels[::stride, ::stride]
    counts = [np.bincount(pixels[..., n].ravel(), minlength=_LEVELS) for n in range(_COLOURS)]
    return np.stack(counts, axis=1)


def _stats_of(values: NDArray[Any], weights: NDArray[np.int64] | None = None) -> _Stats:
    """Return the statistics of columns, shape (n, k), with the weight of each value: (k,) each."""
    present = np.ones(values.shape, bool) if weights is None else weights > 0
    mean = np.average(values, axis=0, weights=weights)
    quantiles = np.quantile(
        values, list(_QUANTILES.values()), axis=0, method="inverted_cdf", weights=weights
    )
    return {
        "min": values.min(axis=0, where=present, initial=np.inf),
        "max": values.max(axis=0, where=present, initial=-np.inf),
        "mean": mean,
        "std": np.sqrt(np.average((values - mean) ** 2, axis=0, weights=weights)),
        "count": np.array([len(values)]),
        **dict(zip(_QUANTILES, quantiles, strict=True)),
    }


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
        "count": np.array([counts.sum()], np.int64),
        **{name: mean([found[name] for found in stats]) for name in _QUANTILES},
    }
