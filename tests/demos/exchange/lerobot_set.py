"""LeRobot datasets by the documented layout of version 3.0, written without our own exporter."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from shapechanger.demos.exchange import ImportContext
from shapechanger.demos.exchange.lerobot import FORMAT
from shapechanger.demos.jpeg import decode_picture
from tests.demos.exchange.small import read_whole

SIZE = 32
CAMERA = "observation.images.front"
VIDEO = f"videos/{CAMERA}/chunk-000/file-000.mp4"
DATA = "data/chunk-000/file-000.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_LEVELS = 6  # Difference in brightness between successive images.

Change = Callable[[list[dict[str, Any]]], list[dict[str, Any]] | None]


def shown_in(jpeg: bytes) -> int:
    """Return the number of an image, from its brightness."""
    return round(float(decode_picture(jpeg, "").mean()) / _LEVELS)


def write_video(path: Path, numbers: Sequence[int], fps: float, *options: str) -> None:
    """Encode images whose brightness shows their number."""
    path.parent.mkdir(parents=True, exist_ok=True)
    raw = b"".join(np.full((SIZE, SIZE, 3), _LEVELS * n, np.uint8).tobytes() for n in numbers)
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{SIZE}x{SIZE}", "-r", f"{fps}"]
    coding = ["-c:v", "libx264", "-pix_fmt", "yuv420p", *options]
    ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *source, "-i", "-"]
    subprocess.run([*ffmpeg, *coding, str(path)], input=raw, check=True)


def write_set(
    folder: Path,
    *,
    lengths: Sequence[int] = (8, 8),
    fps: float = 20,
    video_fps: float | None = None,
    pictures: Sequence[int] | None = None,
    options: Sequence[str] = (),
    rows: Change | None = None,
    places: Change | None = None,
    features: Mapping[str, Any] | None = None,
    columns: Mapping[str, pa.Array] | None = None,
    info: Mapping[str, Any] | None = None,
    video: bool = True,
) -> Path:
    """Write a dataset in which the first value of the action and the image show the step's number.

    Episodes have these lengths. The video shows the images of the numbers `pictures`, by default
    one for each step, and is encoded with these options of FFmpeg. `rows` and `places` change the
    rows of the data and of `meta/episodes`; `features`, `columns` and `info` add to them.
    """
    total = sum(lengths)
    numbers = [(e, n) for e, length in enumerate(lengths) for n in range(length)]
    data: list[dict[str, Any]] | None = [
        {
            "action": [float(index), 0.5],
            "observation.state": [float(index)],
            "timestamp": np.float32(n / fps),
            "frame_index": n,
            "episode_index": e,
            "index": index,
            "task_index": 0,
        }
        for index, (e, n) in enumerate(numbers)
    ]
    data = data if rows is None else rows(data) or data
    table = pa.Table.from_pylist(data)
    for name, column in (columns or {}).items():
        table = table.append_column(name, column)
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta/episodes/chunk-000").mkdir(parents=True)
    pq.write_table(table, folder / DATA)
    about = {
        "action": {"dtype": "float32", "shape": [2], "names": ["pan", "tilt"]},
        "observation.state": {"dtype": "float32", "shape": [1], "names": None},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    }
    keys = ("frame_index", "episode_index", "index", "task_index")
    about |= {key: {"dtype": "int64", "shape": [1], "names": None} for key in keys}
    if video:
        axes = ["height", "width", "channels"]
        about[CAMERA] = {"dtype": "video", "shape": [SIZE, SIZE, 3], "names": axes}
    described = {
        "codebase_version": "v3.0",
        "robot_type": "arm",
        "total_episodes": len(lengths),
        "total_frames": total,
        "fps": fps,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": about | dict(features or {}),
    } | dict(info or {})
    (folder / "meta/info.json").write_text(json.dumps(described))
    entries: list[dict[str, Any]] = []
    start = 0
    for number, length in enumerate(lengths):
        entry = {"episode_index": number, "tasks": ["drive"], "length": length}
        entry |= {"data/chunk_index": 0, "data/file_index": 0}
        entry |= {"dataset_from_index": start, "dataset_to_index": start + length}
        if video:
            entry |= {f"videos/{CAMERA}/chunk_index": 0, f"videos/{CAMERA}/file_index": 0}
            entry[f"videos/{CAMERA}/from_timestamp"] = start / fps
            entry[f"videos/{CAMERA}/to_timestamp"] = (start + length) / fps
        entries.append(entry)
        start += length
    entries = entries if places is None else places(entries) or entries
    pq.write_table(pa.Table.from_pylist(entries), folder / EPISODES)
    if video:
        shown = range(total) if pictures is None else pictures
        write_video(folder / VIDEO, shown, video_fps or fps, *options)
    return folder


def pairs_of(folder: Path, camera: str = "") -> tuple[list[list[tuple[int, int]]], ImportContext]:
    """Return pairs of the numbers of step and image for each episode, and the findings.

    A step without an image has the image number -1.
    """
    read, context = read_whole(folder, FORMAT, camera)
    shown = {one.jpeg: shown_in(one.jpeg) for part in read for one in part if one.jpeg}
    pairs = [[(int(o.step.action[0]), shown.get(o.jpeg or b"", -1)) for o in p] for p in read]
    return list(filter(None, pairs)), context
