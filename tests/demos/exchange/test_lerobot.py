"""LeRobot datasets: what an export keeps, and what an import takes or refuses."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from shapechanger.demos.episodes import Episode, Step
from shapechanger.demos.exchange import export_recording, import_recording, lerobot_export
from shapechanger.demos.jpeg import decode_picture, encode_picture
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout
from tests.demos.exchange.small import all_of, drive, header, picture, record

VIDEO = "videos/observation.images.camera/chunk-000/file-000.mp4"
DATA = "data/chunk-000/file-000.parquet"


def smooth(number: int, width: int = 64, height: int = 48) -> bytes:
    """Return an image that video keeps well: a gradient, brighter with each number."""
    ramp = np.linspace(0, 60, width)[None, :, None]
    pixels = np.broadcast_to(ramp + 5.0 * number, (height, width, 3))
    return encode_picture(pixels.astype(np.uint8))


def smooth_drive(data: Path, count: int = 30, **changes: Any) -> Path:
    """Record an episode with such images, two drivers, rewards and an end."""
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


def edit_info(folder: Path, **changes: Any) -> None:
    """Change a dataset's `info.json`, and make it one of others."""
    path = folder / "meta/info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    (folder / "meta/shapechanger.json").unlink(missing_ok=True)


def edit_features(folder: Path, **changes: Any) -> None:
    """Change features; None removes one."""
    features = json.loads((folder / "meta/info.json").read_text())["features"] | changes
    edit_info(folder, features={key: value for key, value in features.items() if value is not None})


def in_32_bits(values: tuple[float, ...]) -> list[float]:
    """Round numbers to 32 bits."""
    return np.array(values, np.float32).tolist()


def pictures_of(episode: Episode) -> list[np.ndarray]:
    """Decode the images of an episode."""
    return [decode_picture(episode.jpeg(step) or b"", "") for step in episode.steps]


@pytest.mark.parametrize("images", [False, True])
def test_a_round_trip(tmp_path: Path, images: bool) -> None:
    """Numbers come back in 32 bits, images exactly or nearly, the rest as it was."""
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
            assert (two.driver, two.terminated, two.truncated) == (
                one.driver,
                one.terminated,
                one.truncated,
            )
        jpegs = [[e.jpeg(step) for step in e.steps] for e in (before, after)]
        assert not images or jpegs[0] == jpegs[1]
        for one, two in zip(pictures_of(before), pictures_of(after), strict=True):
            # The next image is brighter by 5, so that none is taken for another.
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
    assert np.abs(first.astype(float) - second).mean() < 40.0  # Noise; other images: 85.


def test_the_metadata(tmp_path: Path) -> None:
    """Rate, names, units, tasks, places and statistics."""
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
    what = header(state_layout=layout.to_json(), image_size=None, control_hz=12.5)
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


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (lambda data: drive(data, image_size=(41, 32)), {}, "41 x 32 pixels: export them with"),
        (first_without_picture, {}, "no image of step 0"),
        (lambda data: drive(data), {"dropped": True}, "cannot mark excluded steps"),
        (
            lambda data: record(
                data, header(), [(Step(action=(1e39, 0.0), driver="person", state=(0.0,) * 2),
                                  picture(0))]
            ),
            {},
            "number in action that is not finite in 32 bits",
        ),
    ],
)  # fmt: skip
def test_refused_exports(
    tmp_path: Path, make: Callable[[Path], object], options: dict[str, Any], message: str
) -> None:
    """One sentence, and nothing is left behind."""
    make(tmp_path / "data")
    with pytest.raises(DemosError, match=message):
        export_recording(tmp_path / "data", tmp_path / "out", "lerobot", **options)
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of one episode with a video."""
    place = tmp_path_factory.mktemp("exported")
    smooth_drive(place / "data", 12)
    export_recording(place / "data", place / "set", "lerobot", task="Drive home.")
    return place / "set"


@pytest.fixture
def dataset(exported: Path, tmp_path: Path) -> Path:
    """A copy of it, to change."""
    shutil.copytree(exported, tmp_path / "set")
    return tmp_path / "set"


def test_a_dataset_of_others(dataset: Path, tmp_path: Path) -> None:
    """Names come from the features where they have any; the driver is a person."""
    edit_features(
        dataset,
        action={"dtype": "float32", "shape": [2], "names": {"motors": ["pan", "tilt"]}},
        **{"observation.state": {"dtype": "float32", "shape": [2], "names": None}},
    )
    import_recording(dataset, tmp_path / "back")
    (episode,) = all_of(tmp_path / "back")
    plain = episode.header
    assert Layout.from_json(plain.action_layout).names == ("pan", "tilt")
    assert Layout.from_json(plain.state_layout).names == ("state/0", "state/1")
    assert {feature.unit for feature in Layout.from_json(plain.state_layout)} == {"?"}
    assert {step.driver for step in episode.steps} == {"person"}
    assert plain.notes == {
        "dataset": "set", "camera": "observation.images.camera", "task": "Drive home.",
    }  # fmt: skip
    assert episode.steps[-1].terminated


def test_one_of_several_cameras(dataset: Path, tmp_path: Path) -> None:
    """Several cameras need a choice; its name may be short or complete."""
    camera = {"dtype": "video", "shape": [48, 64, 3], "names": ["height", "width", "channels"]}
    edit_features(dataset, **{"observation.images.wrist": camera})
    with pytest.raises(DemosError, match=r"2 cameras \(camera, wrist\).*--camera camera"):
        import_recording(dataset, tmp_path / "back")
    with pytest.raises(UnknownName, match="Did you mean 'wrist'"):
        import_recording(dataset, tmp_path / "back", camera="wirst")
    import_recording(dataset, tmp_path / "back", camera="camera")
    import_recording(dataset, tmp_path / "again", camera="observation.images.camera")


def cut(name: str, size: int) -> Callable[[Path], None]:
    """Return a change that cuts a file."""

    def change(folder: Path) -> None:
        (folder / name).write_bytes((folder / name).read_bytes()[:size])

    return change


def playlist(folder: Path) -> None:
    """Replace the video by a playlist that names another file."""
    (folder / VIDEO).write_text("#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n")


def outside(folder: Path) -> None:
    """Move a file out of the dataset, and link to it."""
    shutil.move(folder / DATA, folder.parent / "moved.parquet")
    (folder / DATA).symlink_to(folder.parent / "moved.parquet")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: edit_info(f, codebase_version="v2.1"), "version v2.1.*convert_dataset_v21"),
        (lambda f: edit_info(f, fps=0), r"Expected `float` > 0.0 - at `\$.fps`"),
        (lambda f: edit_info(f, features=[]), "Expected `object`, got `array`.*features"),
        (lambda f: edit_info(f, data_path="../../{chunk_index}"), "leaves the folder"),
        (lambda f: edit_info(f, data_path="{chunk_index:99d}"), "There is no .*99d"),
        (lambda f: edit_info(f, data_path=None), "Expected `str`, got `null`.*data_path"),
        (lambda f: edit_info(f, data_path=""), "There is no"),
        (lambda f: edit_info(f, data_path="**/*"), r"There is no .*\[\*\]"),
        (lambda f: edit_features(f, action=None), "no numeric feature 'action'"),
        (lambda f: edit_features(f, action={"dtype": "float32"}), "required field `shape`"),
        (
            lambda f: edit_features(f, action={"dtype": "float32", "shape": [3]}),
            "'action' does not have 3 numbers in each row",
        ),
        (
            lambda f: edit_features(f, **{"observation.x": {"dtype": "int64", "shape": [1]}}),
            "no column 'observation.x'",
        ),
        (
            lambda f: edit_features(
                f, **{"observation.images.camera": {"dtype": "video", "shape": [32, 64, 3]}}
            ),
            r"have \(64, 48\) pixels, not \(64, 32\)",
        ),
        (cut(DATA, 300), "not an intact Parquet file"),
        (playlist, "whose video cannot be read: .*is damaged"),
        (outside, "leaves the folder"),
        (
            lambda f: shutil.rmtree(f / "meta/episodes"),
            "meta/episodes does not have each episode once",
        ),
        (
            lambda f: (f / "meta/shapechanger.json").write_text('{"format": 1, "episodes": []}'),
            "describes 0 episodes, and the dataset has 1",
        ),
        (
            lambda f: (f / "meta/shapechanger.json").write_text('{"format": 2}'),
            "another version of Shapechanger",
        ),
    ],
)
def test_refused_imports(
    dataset: Path, tmp_path: Path, change: Callable[[Path], object], message: str
) -> None:
    """One sentence, and nothing is left behind."""
    change(dataset)
    with pytest.raises(DemosError, match=message):
        import_recording(dataset, tmp_path / "back")
    assert not [path.name for path in tmp_path.iterdir() if "back" in path.name]
