"""LeRobot reads datasets that Shapechanger exports, and Shapechanger those that LeRobot writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from demos.exchange.small import all_of, header, record
from lerobot.datasets.compute_stats import compute_episode_stats
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from shapechanger.demos.episodes import Step
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.demos.jpeg import decode_picture, encode_picture

# LeRobot's default reader needs FFmpeg libraries in the system.
READER = "pyav"
CAMERA = "observation.images.camera"
NUMBERS = ("action", "observation.state", "next.reward")


def smooth(number: int, width: int = 64, height: int = 48) -> np.ndarray:
    """Return an image that changes little in video: a gradient, brighter by 5 per number."""
    ramp = np.linspace(0, 60, width)[None, :, None]
    return np.broadcast_to(ramp + 5.0 * number, (height, width, 3)).astype(np.uint8)


def smooth_drive(data: Path, count: int, hz: float, *, rewarded: bool = True) -> None:
    """Record an episode of these images."""
    rng = np.random.default_rng(count)
    steps = [
        (
            Step(
                action=tuple(rng.uniform(-1, 1, 2)),
                driver="person",
                state=tuple(rng.normal(size=2)),
                reward=n / 3 if rewarded else None,
                terminated=n == count - 1,
            ),
            encode_picture(smooth(n)),
        )
        for n in range(count)
    ]
    record(data, header(image_size=(64, 48), control_hz=hz), steps)


@pytest.mark.parametrize("hz", [20.0, 12.5])
@pytest.mark.parametrize("images", [False, True])
def test_lerobot_reads_an_export(tmp_path: Path, images: bool, hz: float) -> None:
    """LeRobot reads all frames, states, actions, rewards, times and tasks, and windows of steps."""
    for count in (30, 12):
        smooth_drive(tmp_path / "data", count, hz)
    export_recording(tmp_path / "data", tmp_path / "set", "lerobot", task="Drive.", images=images)
    dataset = LeRobotDataset("ours/set", root=tmp_path / "set", video_backend=READER)
    assert (len(dataset), dataset.num_episodes, dataset.fps) == (42, 2, hz)
    assert dataset.features["action"]["names"] == ["steering", "throttle"]
    number = 0
    for episode_index, episode in enumerate(all_of(tmp_path / "data")):
        for frame, step in enumerate(episode.steps):
            item = dataset[number]
            assert item["action"].tolist() == np.float32(step.action).tolist()
            assert item["observation.state"].tolist() == np.float32(step.state).tolist()
            assert item["next.reward"].item() == np.float32(step.reward)
            assert item["next.done"].item() == step.terminated
            assert item["timestamp"].item() == np.float32(frame / hz)
            where = ("episode_index", "frame_index", "index", "task_index")
            assert [item[key].item() for key in where] == [episode_index, frame, number, 0]
            assert item["task"] == "Drive."
            seen = item[CAMERA].numpy().transpose(1, 2, 0) * 255
            pixels = decode_picture(episode.jpeg(step) or b"", "")
            # The next image is brighter by 5. Decoders of JPEG differ by rounding.
            assert np.abs(seen - pixels).mean() < (0.2 if images else 2.0)
            number += 1
    windows = LeRobotDataset(
        "ours/set",
        root=tmp_path / "set",
        video_backend=READER,
        delta_timestamps={CAMERA: [-1 / hz, 0.0], "action": [0.0, 1 / hz]},
    )
    window = windows[35]
    assert window[CAMERA].shape == (2, 3, 48, 64)
    assert window["action"][1].tolist() == dataset[36]["action"].tolist()


def test_statistics_equal_lerobots(tmp_path: Path) -> None:
    """Statistics of numbers equal LeRobot's of one long episode; those of images equal NumPy's."""
    for count in (30, 12):
        smooth_drive(tmp_path / "data", count, 20.0)
    export_recording(tmp_path / "data", tmp_path / "set", "lerobot", images=True)
    dataset = LeRobotDataset("ours/set", root=tmp_path / "set")
    kinds = {key: dataset.features[key] for key in (*NUMBERS, "timestamp", "index")}
    rows = dataset.hf_dataset.with_format("numpy")[:]
    expected = compute_episode_stats({key: np.stack(rows[key]) for key in kinds}, kinds)
    for key in kinds:
        ours = dataset.meta.stats[key]
        span = np.max(expected[key]["max"] - expected[key]["min"])
        assert ours.keys() == expected[key].keys()
        for name, value in expected[key].items():
            assert ours[name].shape == value.shape
            # LeRobot computes quantiles from a histogram of 5000 bins, in 32 bits.
            bound = span / 5000 if name.startswith("q") else 1e-5 * span
            assert np.abs(ours[name] - value).max() <= bound + 1e-6, (key, name)
    every = np.stack([dataset[n][CAMERA].numpy() for n in range(42)])
    camera: dict[str, Any] = dataset.meta.stats[CAMERA]
    assert camera["mean"] == pytest.approx(every.mean(axis=(0, 2, 3))[:, None, None], abs=1e-3)
    assert camera["std"] == pytest.approx(every.std(axis=(0, 2, 3))[:, None, None], abs=1e-3)


@pytest.mark.parametrize("kind", ["video", "image", "none"])
def test_datasets_of_lerobot_are_imported(tmp_path: Path, kind: str) -> None:
    """Steps, names, tasks and the selected camera of two are imported."""
    names = ["pan.pos", "tilt.pos"]
    features: dict[str, Any] = {
        "action": {"dtype": "float32", "shape": (2,), "names": names},
        "observation.state": {"dtype": "float32", "shape": (3,), "names": None},
    }
    if kind != "none":
        picture = {"dtype": kind, "shape": (48, 64, 3), "names": ["height", "width", "channels"]}
        features |= {f"observation.images.{name}": picture for name in ("front", "wrist")}
    dataset = LeRobotDataset.create(
        "theirs/set", fps=15, features=features, root=tmp_path / "set", use_videos=kind == "video"
    )
    rng = np.random.default_rng(0)
    expected: list[tuple[list[float], list[float], np.ndarray]] = []
    for count, task in ((20, "Pick."), (9, "Place.")):
        for n in range(count):
            action, state = rng.normal(size=2), rng.normal(size=3)
            frame = {
                "action": action.astype(np.float32),
                "observation.state": state.astype(np.float32),
                "task": task,
            }
            if kind != "none":
                frame["observation.images.front"] = smooth(n)
                frame["observation.images.wrist"] = 255 - smooth(n)
            expected.append(
                (
                    frame["action"].tolist(),
                    frame["observation.state"].tolist(),
                    255 - smooth(n),
                )
            )
            dataset.add_frame(frame)
        dataset.save_episode()
    dataset.finalize()
    done = import_recording(
        tmp_path / "set", tmp_path / "data", camera="" if kind == "none" else "wrist"
    )
    assert (done.format, done.episodes, done.steps) == ("lerobot", 2, 29)
    episodes = all_of(tmp_path / "data")
    assert [episode.header.notes["task"] for episode in episodes] == ["Pick.", "Place."]
    assert episodes[0].header.action_layout.names == tuple(names)
    assert episodes[0].header.control_hz == 15.0
    steps = [(episode, step) for episode in episodes for step in episode.steps]
    for (episode, step), (action, state, pixels) in zip(steps, expected, strict=True):
        assert (list(step.action), list(step.state)) == (action, state)
        jpeg = episode.jpeg(step)
        assert (jpeg is None) == (kind == "none")
        if jpeg is not None:
            seen = decode_picture(jpeg, "").astype(float)
            assert np.abs(seen - pixels).mean() < (1.0 if kind == "image" else 2.5)


@pytest.mark.parametrize("images", [False, True])
def test_lerobot_continues_an_export(tmp_path: Path, images: bool) -> None:
    """LeRobot adds an episode to an export; without `meta/shapechanger.json` both are imported."""
    # LeRobot 0.4.4 cannot add a single number of 32 bits that is not in a vector.
    smooth_drive(tmp_path / "data", 5, 20.0, rewarded=False)
    export_recording(tmp_path / "data", tmp_path / "set", "lerobot", task="A.", images=images)
    resume = getattr(LeRobotDataset, "resume", LeRobotDataset)  # `resume` exists since 0.6.
    dataset = resume("ours/set", root=tmp_path / "set")
    for n in range(4):
        dataset.add_frame(
            {
                "action": np.array([n, 0.5], np.float32),
                "observation.state": np.zeros(2, np.float32),
                CAMERA: smooth(n),
                "next.done": np.array([n == 3]),
                "next.terminated": np.array([False]),
                "task": "B.",
            }
        )
    dataset.save_episode()
    dataset.finalize()
    again = LeRobotDataset("ours/set", root=tmp_path / "set", video_backend=READER)
    assert (len(again), again.num_episodes) == (9, 2)
    assert again[8]["task"] == "B."
    assert again.meta.stats["action"]["count"].tolist() == [9]
    (tmp_path / "set/meta/shapechanger.json").unlink()
    assert import_recording(tmp_path / "set", tmp_path / "back").steps == 9
    last = all_of(tmp_path / "back")[1]
    assert last.header.notes["task"] == "B."
    assert [step.action[0] for step in last.steps] == [0.0, 1.0, 2.0, 3.0]
    seen = [decode_picture(last.jpeg(step) or b"", "").astype(float) for step in last.steps]
    assert all(np.abs(pixels - smooth(n)).mean() < 2.5 for n, pixels in enumerate(seen))


def test_info_has_the_keys_of_lerobot(tmp_path: Path) -> None:
    """`info.json` has the keys and paths that LeRobot writes."""
    smooth_drive(tmp_path / "data", 5, 20.0)
    export_recording(tmp_path / "data", tmp_path / "ours", "lerobot")
    LeRobotDataset.create(
        "theirs/set", fps=20, features={}, root=tmp_path / "theirs", use_videos=True
    )
    ours, theirs = (
        json.loads((tmp_path / name / "meta/info.json").read_text()) for name in ("ours", "theirs")
    )
    assert ours.keys() == theirs.keys()
    assert (ours["data_path"], ours["video_path"]) == (theirs["data_path"], theirs["video_path"])
