"""LeRobot datasets: exports, and imports of exported datasets."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from shapechanger.demos.episodes import Episode, Step
from shapechanger.demos.exchange import export_recording, import_recording, lerobot_export
from shapechanger.demos.jpeg import decode_picture, encode_picture
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout
from tests.demos.exchange.small import all_of, drive, header, picture, record

DATA = "data/chunk-000/file-000.parquet"


def smooth(number: int, width: int = 64, height: int = 48) -> bytes:
    """Return a gradient, which video keeps well; a higher number is brighter."""
    ramp = np.linspace(0, 60, width)[None, :, None]
    pixels = np.broadcast_to(ramp + 5.0 * number, (height, width, 3))
    return encode_picture(pixels.astype(np.uint8))


def smooth_drive(data: Path, count: int = 30, **changes: Any) -> Path:
    """Record an episode with gradients as images, two drivers, rewards and an end."""
    steps = [
        (
            Step(
                action=(n / 100, -1 / 3),
                driver="policy" if n < 3 else "person",
                state=(n / 7, 20.0),
                reward=n / 3,
                terminated=n == count - 1,
            ),
            smooth(n),
        )
        for n in range(count)
    ]
    return record(data, header(image_size=(64, 48), **changes), steps, "time")


def in_32_bits(values: tuple[float, ...]) -> list[float]:
    return np.array(values, np.float32).tolist()


def pictures_of(episode: Episode) -> list[np.ndarray]:
    return [decode_picture(episode.jpeg(step) or b"", "") for step in episode.steps]


@pytest.mark.parametrize("images", [False, True])
def test_a_round_trip(tmp_path: Path, images: bool) -> None:
    """Numbers are rounded to 32 bits, video is nearly the same; headers and drivers are kept."""
    smooth_drive(tmp_path / "data", 30, seed=7, env="shapechanger/Car-v1")
    smooth_drive(tmp_path / "data", 4)
    done = export_recording(tmp_path / "data", tmp_path / "out", "lerobot", images=images)
    assert (done.episodes, done.steps) == (2, 34)
    assert import_recording(tmp_path / "out", tmp_path / "back").format == "lerobot"
    for before, after in zip(all_of(tmp_path / "data"), all_of(tmp_path / "back"), strict=True):
        kept = ("action_layout", "state_layout", "image_size", "control_hz", "seed", "created")
        assert all(getattr(before.header, n) == getattr(after.header, n) for n in kept)
        assert (after.outcome, after.header.clock) == ("time", "real")
        assert [step.captured_ns for step in after.steps[:3]] == [0, 50_000_000, 100_000_000]
        assert len(after.steps) == len(before.steps)
        for one, two in zip(before.steps, after.steps, strict=True):
            assert list(two.action) == in_32_bits(one.action)
            assert list(two.state) == in_32_bits(one.state)
            assert two.reward == np.float32(one.reward)
            for name in ("driver", "terminated", "truncated"):
                assert getattr(two, name) == getattr(one, name)
        jpegs = [[e.jpeg(step) for step in e.steps] for e in (before, after)]
        assert not images or jpegs[0] == jpegs[1]
        for one, two in zip(pictures_of(before), pictures_of(after), strict=True):
            # Successive images differ by 5, so this test detects a wrong image.
            assert np.abs(one.astype(float) - two).mean() < 2.0


def test_long_episodes_and_several_videos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lerobot_export, "_VIDEO_FILE_S", 1.0)
    for count in (300, 3, 30, 25):
        drive(tmp_path / "data", count)
    export_recording(tmp_path / "data", tmp_path / "out", "lerobot")
    assert len(list((tmp_path / "out/videos").rglob("*.mp4"))) == 3
    import_recording(tmp_path / "out", tmp_path / "back")
    before, after = all_of(tmp_path / "data"), all_of(tmp_path / "back")
    actions = [[step.action[0] for step in episode.steps] for episode in after]
    expected = [in_32_bits(tuple(s.action[0] for s in e.steps)) for e in before]
    assert actions == expected
    first, second = pictures_of(before[2])[0], pictures_of(after[2])[0]
    # The images are noise: two different images have a mean difference of 85.
    assert np.abs(first.astype(float) - second).mean() < 40.0


def test_the_metadata(tmp_path: Path) -> None:
    """The metadata have the rate, names, units, tasks, positions and statistics."""
    smooth_drive(tmp_path / "data", 30)
    smooth_drive(tmp_path / "data", 10, body="car")
    export_recording(tmp_path / "data", tmp_path / "out", "lerobot", task="Drive.")
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_frames"]) == ("v3.0", 20, 40)
    assert isinstance(info["fps"], int)
    assert info["features"]["action"]["names"] == ["steering", "throttle"]
    assert info["features"]["observation.state"]["units"] == ["m/s", "°C"]
    assert info["features"]["observation.images.camera"]["shape"] == [48, 64, 3]
    tasks = pq.read_table(tmp_path / "out/meta/tasks.parquet").to_pylist()
    assert tasks == [{"task_index": 0, "__index_level_0__": "Drive."}]
    rows = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    spans = [(row["dataset_from_index"], row["dataset_to_index"]) for row in rows]
    assert spans == [(0, 30), (30, 40)]
    video = "videos/observation.images.camera"
    assert [row[f"{video}/from_timestamp"] for row in rows] == [0.0, 1.5]
    table = pq.read_table(tmp_path / "out" / DATA).to_pydict()
    assert table["timestamp"] == in_32_bits(tuple(n / 20 for n in [*range(30), *range(10)]))
    stats = json.loads((tmp_path / "out/meta/stats.json").read_text())
    steering = np.array([*range(30), *range(10)]) / 100
    assert stats["action"]["mean"][0] == pytest.approx(steering.mean(), abs=1e-7)
    assert stats["action"]["std"][0] == pytest.approx(steering.std(), abs=1e-7)
    assert stats["action"]["count"] == [40]
    every = np.concatenate([pictures_of(episode) for episode in all_of(tmp_path / "data")]) / 255
    camera = stats["observation.images.camera"]
    assert np.squeeze(camera["mean"]) == pytest.approx(every.mean(axis=(0, 1, 2)), abs=1e-9)
    assert np.squeeze(camera["std"]) == pytest.approx(every.std(axis=(0, 1, 2)), abs=1e-9)
    assert np.squeeze(camera["max"]) == pytest.approx(every.max(axis=(0, 1, 2)))
    assert np.squeeze(rows[0][f"stats/{'observation.images.camera'}/q50"]).shape == (3,)


def test_missing_values_and_odd_rates(tmp_path: Path) -> None:
    layout = Layout((Feature("far", "m", 0.0, 4.0), Feature("map", "1", shape=(3,))))
    steps = [
        (Step(action=(0.0, 0.0), driver="person", state=(np.nan, 1.0, np.inf, 3.0)), None),
        (Step(action=(0.0, 0.0), driver="person", state=(1.0,) * 4, reward=1.0), None),
    ]
    what = header(state_layout=layout, image_size=None, control_hz=12.5)
    record(tmp_path / "data", what, steps)
    export_recording(tmp_path / "data", tmp_path / "out", "lerobot")
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (info["fps"], info["video_path"]) == (12.5, None)
    assert info["features"]["observation.state"]["names"] == ["far", "map[0]", "map[1]", "map[2]"]
    assert "next.reward" not in info["features"]
    import_recording(tmp_path / "out", tmp_path / "back")
    (episode,) = all_of(tmp_path / "back")
    assert episode.steps[0].state == (2.0, 1.0, 0.0, 3.0)
    assert (episode.header.control_hz, episode.header.image_size) == (12.5, None)


def first_without_picture(data: Path) -> None:
    step = Step(action=(0.0, 0.0), driver="person", state=(0.0, 0.0))
    record(data, header(), [(step, None), (step, picture(0))])


def with_a_large_number(data: Path) -> None:
    step = Step(action=(1e39, 0.0), driver="person", state=(0.0, 0.0))
    record(data, header(), [(step, picture(0))])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda data: drive(data, image_size=(41, 32)), "41 x 32 pixels: export them with"),
        (first_without_picture, "no image of step 0"),
        (with_a_large_number, "number in action that is not finite in 32 bits"),
    ],
)
def test_refused_exports_leave_no_folder(
    tmp_path: Path, make: Callable[[Path], object], message: str
) -> None:
    make(tmp_path / "data")
    with pytest.raises(DemosError, match=message):
        export_recording(tmp_path / "data", tmp_path / "out", "lerobot")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_a_shapechanger_json_that_does_not_match_is_refused(tmp_path: Path) -> None:
    smooth_drive(tmp_path / "data", 2)
    export_recording(tmp_path / "data", tmp_path / "set", "lerobot")
    own = tmp_path / "set/meta/shapechanger.json"
    about = json.loads(own.read_text())
    (episode,) = about["episodes"]
    for changes, problem in (
        ({"episodes": []}, "is of another dataset"),
        ({"format": 2}, "Invalid enum value 2"),
        ({"episodes": [7]}, "Expected `object`, got `int`"),
        ({"episodes": [episode | {"drivers": [["nobody", 2]]}]}, "Invalid enum value"),
        ({"episodes": [episode | {"image_size": [40, 32]}]}, "is of another dataset"),
    ):
        own.write_text(json.dumps(about | changes))
        with pytest.raises(DemosError, match=problem):
            import_recording(tmp_path / "set", tmp_path / "back")
    # Drivers of steps beyond the end of the episode are ignored, and not expanded in memory.
    runs = {"drivers": [["policy", 1 << 30]]}
    own.write_text(json.dumps(about | {"episodes": [episode | runs]}))
    import_recording(tmp_path / "set", tmp_path / "back")
    assert {step.driver for step in all_of(tmp_path / "back")[0].steps} == {"policy"}
