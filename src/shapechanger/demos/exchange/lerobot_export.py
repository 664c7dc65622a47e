"""Export of recordings as LeRobot datasets, version 3.0.

```
data/chunk-000/file-000.parquet                                numbers, a row for each step
videos/observation.images.camera/chunk-000/file-000.mp4        images, one episode after another
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
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import groupby, islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.files import library, own_fields
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExportContext,
    decoded_steps,
    name_in,
    value_names,
)
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
_DATA_PATH: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO_PATH: Final = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_FILES_PER_CHUNK: Final = 1000
_DATA_FILE_MB: Final = 100
# LeRobot finds an image by its time in the file, in 32 bits and to 0.1 ms: enough for 1000 s.
_VIDEO_FILE_S: Final = 500.0
_ROWS: Final = 256  # In memory at once, because they may hold images.
_SMALLEST_FRACTION: Final = 10_000  # Denominator of a rate: 19.98 Hz is 999/50.
_QUANTILES: Final = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_COLOURS: Final = 3
_LEVELS: Final = 256

_Stats = dict[str, NDArray[Any]]


def write(episodes: Sequence[ExchangeEpisode], folder: Path, context: ExportContext) -> int:
    """Write episodes into an existing folder, as one dataset, and return the number of steps."""
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
        self._open_files()
        if task not in self._tasks:
            self._tasks.append(task)
        histograms = np.zeros((_LEVELS, _COLOURS), np.int64)
        steps = self._with_images(episode, histograms)
        parts: list[dict[str, NDArray[Any]]] = []
        drivers: list[str] = []
        while chunk := list(islice(steps, _ROWS)):
            parts.append(self._write_rows(chunk, len(drivers), task, episode.name))
            drivers += [step.driver for step, _ in chunk]
        numbers = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        stats = {key: _stats_of(values.astype(np.float64)) for key, values in numbers.items()}
        if self._size is not None:
            levels = np.repeat(np.arange(_LEVELS)[:, None] / (_LEVELS - 1), _COLOURS, axis=1)
            found = _stats_of(levels, histograms)
            stats[_CAMERA] = {name: value.reshape(-1, 1, 1) for name, value in found.items()}
            stats[_CAMERA]["count"] = np.array([len(drivers)])
        chunk_index, file_index = divmod(self._tables, _FILES_PER_CHUNK)
        place: dict[str, Any] = {
            "episode_index": len(self.places),
            "tasks": [task],
            "length": len(drivers),
            "data/chunk_index": chunk_index,
            "data/file_index": file_index,
            "dataset_from_index": self.steps,
            "dataset_to_index": self.steps + len(drivers),
        }
        if self._video is not None:
            end = self._video.frames
            chunk_index, file_index = divmod(self._videos, _FILES_PER_CHUNK)
            place |= {
                f"videos/{_CAMERA}/chunk_index": chunk_index,
                f"videos/{_CAMERA}/file_index": file_index,
                f"videos/{_CAMERA}/from_timestamp": float((end - len(drivers)) / self._rate),
                f"videos/{_CAMERA}/to_timestamp": float(end / self._rate),
            }
        for key, found in stats.items():
            place |= {f"stats/{key}/{name}": value.tolist() for name, value in found.items()}
        self.places.append(place | {f"meta/episodes/{kind}_index": 0 for kind in ("chunk", "file")})
        self._stats.append(stats)
        runs = [[driver, len(list(group))] for driver, group in groupby(drivers)]
        self._headers.append(own_fields(episode) | {"drivers": runs})
        self.steps += len(drivers)

    def _with_images(
        self, episode: ExchangeEpisode, histograms: NDArray[np.int64]
    ) -> Iterator[tuple[Step, bytes]]:
        """Yield steps with their images, and add the images to the video and the histograms."""
        shown, counts = np.empty(0, np.uint8), np.zeros_like(histograms)
        for row, jpeg, pixels in decoded_steps(episode.rows, self._size, episode.name, "LeRobot"):
            if pixels is not None:
                each = [
                    np.bincount(pixels[..., n].ravel(), minlength=_LEVELS) for n in range(_COLOURS)
                ]
                shown, counts = pixels, np.stack(each, axis=1)
            histograms += counts
            if self._video is not None:
                self._video.add(shown)
            yield row.step, jpeg

    def close_files(self) -> None:
        """Close the files of the numbers and the images."""
        for file in (self._table, self._video):
            if file is not None:
                file.close()
        self._table = self._video = None

    def write_meta(self) -> None:
        """Write `meta/`."""
        arrow, path = self._arrow, self._folder / EPISODES / "chunk-000/file-000.parquet"
        path.parent.mkdir(parents=True)
        self._parquet.write_table(arrow.Table.from_pylist(self.places), path)
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
        info: dict[str, Any] = {
            "codebase_version": "v3.0",
            "robot_type": self._header.body or self._header.robot or None,
            "total_episodes": len(self.places),
            "total_frames": self.steps,
            "total_tasks": len(self._tasks),
            "chunks_size": _FILES_PER_CHUNK,
            "data_files_size_in_mb": _DATA_FILE_MB,
            "video_files_size_in_mb": 200,  # For LeRobot, which continues the dataset.
            "fps": self._fps,
            "splits": {"train": f"0:{len(self.places)}"},
            "data_path": _DATA_PATH,
            "video_path": _VIDEO_PATH if self._filmed else None,
            "features": self._features,
        }
        own = {"format": 1, "episodes": self._headers}
        for name, value in (("meta/stats.json", stats), (OURS, own), (INFO, info)):
            text = json.dumps(value, indent=4, ensure_ascii=False, allow_nan=False)
            (self._folder / name).write_text(text, encoding="utf-8", errors="replace")

    def _describe(self) -> dict[str, dict[str, Any]]:
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
        arrow, kind, size = self._arrow, feature["dtype"], feature["shape"][0]
        if kind == "image":
            return arrow.struct([("bytes", arrow.binary()), ("path", arrow.string())])
        plain = arrow.bool_() if kind == "bool" else getattr(arrow, kind)()
        return plain if size == 1 else arrow.list_(plain, size)

    def _open_files(self) -> None:
        """Continue in new files once the present ones are full."""
        table, video = self._table, self._video
        if table is None or self._table_path.stat().st_size >= _DATA_FILE_MB << 20:
            if table is not None:
                table.close()
            self._tables += 1
            self._table_path = path = self._new_file(_DATA_PATH, self._tables)
            self._table = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        is_full = video is None or video.frames >= _VIDEO_FILE_S * self._rate
        if self._filmed and self._size is not None and is_full:
            if video is not None:
                video.close()
            self._videos += 1
            path = self._new_file(_VIDEO_PATH, self._videos)
            self._video = VideoWriter(path, self._size, self._rate)

    def _new_file(self, template: str, number: int) -> Path:
        chunk, file = divmod(number, _FILES_PER_CHUNK)
        name = template.format(video_key=_CAMERA, chunk_index=chunk, file_index=file)
        (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
        return self._folder / name

    def _write_rows(
        self, chunk: Sequence[tuple[Step, bytes]], first: int, task: str, name: str
    ) -> dict[str, NDArray[Any]]:
        """Append steps with their images, the first one with a number, and return their columns."""
        steps, frames = [step for step, _ in chunk], np.arange(first, first + len(chunk))
        columns: dict[str, NDArray[Any]] = {
            _ACTION: _in_32_bits([step.action for step in steps]),
            DONE: np.array([[step.terminated or step.truncated] for step in steps]),
            _TERMINATED: np.array([[step.terminated] for step in steps]),
            "timestamp": (frames / float(self._rate)).astype(np.float32)[:, None],
            "frame_index": frames[:, None],
            "episode_index": np.full((len(chunk), 1), len(self.places)),
            "index": frames[:, None] + self.steps,
            "task_index": np.full((len(chunk), 1), self._tasks.index(task)),
        }
        if self._states is not None:
            states = np.array([step.state for step in steps])
            middles = np.repeat([f.middle for f in self._states], [f.size for f in self._states])
            columns[_STATE] = _in_32_bits(np.where(np.isfinite(states), states, middles))
        if self._rewarded:
            columns[_REWARD] = _in_32_bits([[step.reward] for step in steps])
        for key, values in columns.items():
            if not np.isfinite(values).all():
                raise DemosError(
                    f"{name} has a number in {key} that is not finite in 32 bits: export it to csv."
                )
        stored: dict[str, Any] = {
            key: values[:, 0] if values.shape[1] == 1 else list(values)
            for key, values in columns.items()
        }
        stored[_CAMERA] = [
            {"bytes": jpeg, "path": f"frame-{number:06d}.jpg"}
            for number, (_, jpeg) in enumerate(chunk, first)
        ]
        arrays = [self._arrow.array(stored[field.name], field.type) for field in self._schema]
        self._table.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        return columns


def _in_32_bits(values: Any) -> NDArray[np.float32]:
    """Round numbers; what is too large becomes infinite, and is refused then."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float64).astype(np.float32)


def _vector(layout: Layout) -> dict[str, Any]:
    """Return the feature of a vector; the units are our own addition, which LeRobot ignores."""
    units = [feature.unit for feature in layout for _ in range(feature.size)]
    names = value_names(layout)
    return {"dtype": "float32", "shape": [layout.size], "names": names, "units": units}


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
    every = {name: np.stack([one[key][name] for one in episodes]) for name in episodes[0][key]}
    weights = every["count"][:, 0].reshape(-1)
    found = {name: np.average(values, axis=0, weights=weights) for name, values in every.items()}
    spread = every["std"] ** 2 + (every["mean"] - found["mean"]) ** 2
    return found | {
        "min": every["min"].min(axis=0),
        "max": every["max"].max(axis=0),
        "std": np.sqrt(np.average(spread, axis=0, weights=weights)),
        "count": every["count"].sum(axis=0),
    }
