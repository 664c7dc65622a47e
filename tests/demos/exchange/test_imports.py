"""Imports of tables, tubs and Minari datasets, and exports that Minari itself loads."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import h5py
import minari
import numpy as np
import pytest
import simplejpeg
from minari.data_collector import EpisodeBuffer

from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.exchange import (
    ImportContext,
    export_recording,
    find_format,
    import_episodes,
    import_recording,
)
from shapechanger.errors import DemosError
from tests.demos.exchange.small import (
    all_of,
    drive,
    findings_of,
    keys_folder,
    picture,
    snapshot,
    tub_folder,
)


def test_a_csv_table_of_another_program(tmp_path: Path) -> None:
    folder = keys_folder(tmp_path / "keys")
    before = snapshot(folder)
    assert find_format(folder) == "csv"
    done = import_recording(folder, tmp_path / "data")
    assert (done.episodes, done.steps, done.pictures) == (1, 3, 3)
    (episode,) = all_of(tmp_path / "data")
    layout = episode.header.action_layout
    assert layout.names == ("forward", "backward", "right", "left")
    assert {(feature.low, feature.high) for feature in layout} == {(0.0, 1.0)}
    assert [step.action for step in episode.steps] == [(1, 0, 0, 0), (0, 0, 0, 1), (0, 0, 0, 0)]
    assert [step.captured_ns for step in episode.steps] == [
        1_499_144_070_100_000_000 + n * 100_000_000 for n in range(3)
    ]
    assert [episode.jpeg(step) for step in episode.steps] == [picture(n) for n in range(3)]
    assert (episode.header.control_hz, episode.header.source) == (10.0, "csv")
    assert {step.driver for step in episode.steps} == {"person"}
    assert "are left out." in findings_of(import_recording(folder, tmp_path / "slow", hz=5.0))
    assert {step.clock_ns for step in all_of(tmp_path / "slow")[0].steps} == {None}
    assert snapshot(folder) == before


def test_a_csv_table_with_states_and_semicolons(tmp_path: Path) -> None:
    (tmp_path / "table").mkdir()
    (tmp_path / "table/steps.csv").write_text(
        "Angle;throttle;state/speed;lap;done\n0.5;1;2.25;7;0\n-1;0;nan;8;1\noops;0;1;8;0\n0,5;0;1;8;0\n"
    )
    done = import_recording(tmp_path / "table", tmp_path / "data", hz=20.0)
    text = findings_of(done)
    assert "note: Columns that are not imported: lap." in text
    assert "line 4 of table, line 5 of table: it is invalid (Expected `float`" in text
    (episode,) = all_of(tmp_path / "data")
    assert episode.header.action_layout.names == ("steering", "throttle")
    assert [step.action for step in episode.steps] == [(0.5, 1.0), (-1.0, 0.0)]
    assert episode.steps[0].state == (2.25,)
    assert [step.terminated for step in episode.steps] == [False, True]


_RECORDS: list[dict[str, Any]] = [
    {"user/angle": -1.0, "user/throttle": 0.5, "_timestamp_ms": 1000, "_session_id": "21-06-25_0"},
    {"user/angle": 0.0, "user/throttle": 0.5, "_timestamp_ms": 1050, "_session_id": "21-06-25_0"},
    {"user/angle": 0.1, "user/throttle": 0.5, "_timestamp_ms": 1100, "_session_id": "21-06-25_0"},
    {"user/angle": 0.5, "user/throttle": 1.0, "_timestamp_ms": 900, "_session_id": "21-06-25_1"},
    {
        "user/angle": 0.25,
        "user/throttle": 1,
        "user/mode": "local_angle",
        "pilot/angle": -0.5,
        "pilot/throttle": 0.125,
        "imu/gyr_z": 2.5,
        "_timestamp_ms": 950,
        "_session_id": "21-06-25_1",
    },
]


def test_a_tub(tmp_path: Path) -> None:
    """Sessions become episodes, deleted records are skipped, and pilot records are a policy's."""
    folder = tub_folder(tmp_path / "tub", _RECORDS, [1], {"imu/gyr_z": "float", "lap": "str"})
    before = snapshot(folder)
    assert find_format(folder) == "tub"
    import_recording(folder, tmp_path / "data")
    first, second = all_of(tmp_path / "data")
    assert [step.action for step in first.steps] == [(-1.0, 0.5), (0.1, 0.5)]
    assert [first.jpeg(step) for step in first.steps] == [picture(0), picture(2)]
    assert [step.wall_ns for step in first.steps] == [1_000_000_000, 1_100_000_000]
    assert [step.action for step in second.steps] == [(0.5, 1.0), (-0.5, 1.0)]
    assert [step.driver for step in second.steps] == ["person", "policy"]
    assert second.header.state_layout.names == ("imu/gyr_z",)
    assert math.isnan(second.steps[0].state[0])
    assert second.steps[1].state == (2.5,)
    assert second.header.notes == {"session": "21-06-25_1"}
    assert snapshot(folder) == before


def test_minari_recovers_the_env(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    arguments = {"image": False, "world": "yard"}
    drive(tmp_path / "one", env="shapechanger/Car-v1", env_kwargs=arguments)
    export_recording(tmp_path / "one", tmp_path / "one-v0", "minari")
    env = minari.load_dataset("one-v0").recover_environment()
    try:
        assert env.spec.id == "shapechanger/Car-v1"
        assert env.unwrapped.world.course.world == "yard"
    finally:
        env.close()
    drive(tmp_path / "two", env="shapechanger/Car-v1")
    drive(tmp_path / "two", env="shapechanger/Tank-v1")
    export_recording(tmp_path / "two", tmp_path / "two-v0", "minari")
    assert minari.load_dataset("two-v0").env_spec is None


def test_minari_loads_an_export(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Minari itself loads all pixels and values, by the name of the dataset."""
    drive(tmp_path / "data", 5)
    drive(tmp_path / "data", 3)
    export_recording(tmp_path / "data", tmp_path / "sets/corridor-v0", "minari")
    assert sorted(p.name for p in (tmp_path / "sets").iterdir()) == ["corridor-v0"]
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    dataset = minari.load_dataset("corridor-v0")
    assert (dataset.total_episodes, dataset.total_steps) == (2, 8)
    assert list(minari.list_local_datasets()) == ["corridor-v0"]
    metadata = dataset.storage.metadata
    assert metadata["author"] == {"Ada"}
    assert metadata["control_hz"] == 20.0
    assert [f["name"] for f in metadata["action_layout"]["features"]] == ["steering", "throttle"]
    episode = dataset[0]
    assert len(episode) == 5
    for n, pixels in enumerate(episode.observations["image"][:-1]):
        np.testing.assert_array_equal(pixels, simplejpeg.decode_jpeg(picture(n)))
    assert len(episode.observations["image"]) == len(episode.observations["state"]) == 6
    states = episode.observations["state"][:-1]
    np.testing.assert_array_equal(states, [(n / 7, math.nan) for n in range(5)])
    np.testing.assert_array_equal(episode.actions, [(0.1 * n, 1 / 3) for n in range(5)])
    assert episode.truncations.tolist() == [False] * 4 + [True]
    drivers = [json.loads(text)["step"]["driver"] for text in episode.infos["step"]]
    assert drivers == ["person"] * 5
    assert dataset.observation_space["image"].contains(episode.observations["image"][0])


@pytest.mark.parametrize("jpeg", [True, False])
def test_images_of_a_dataset_that_minari_wrote(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jpeg: bool
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    pixels = np.zeros((3, 40, 48, 3), np.uint8)
    pixels[:, :, :, 0] = np.arange(48) * 5
    pixels[:, :, :, 2] = 120
    buffer = EpisodeBuffer(
        observations={"camera": pixels, "goal": np.full((3, 2), 0.5), "at": np.arange(3)},
        actions=np.array([1, 2]),
        rewards=[1.0, 1.0],
        terminations=[False, True],
        truncations=[False, False],
        infos={},
    )
    camera, goal = gym.spaces.Box(0, 255, (40, 48, 3), np.uint8), gym.spaces.Box(-1, 1, (2,))
    observed = {"camera": camera, "goal": goal, "at": gym.spaces.Discrete(9)}
    with pytest.warns(UserWarning, match="is set to None|env_spec is None"):
        minari.create_dataset_from_buffers(
            "others/set-v3",
            [buffer],
            observation_space=gym.spaces.Dict(observed),
            action_space=gym.spaces.Discrete(3, start=1),
            jpeg_encoding=jpeg,
        )
    path = tmp_path / "others/set-v3"
    assert find_format(path) == "minari"
    import_recording(path, tmp_path / "data")
    (episode,) = all_of(tmp_path / "data")
    assert episode.header.state_layout.names == ("at", "goal/0", "goal/1")
    (action,) = episode.header.action_layout
    assert (action.low, action.high) == (1.0, 3.0)
    assert [step.action for step in episode.steps] == [(1.0,), (2.0,)]
    assert [step.state for step in episode.steps] == [(0.0, 0.5, 0.5), (1.0, 0.5, 0.5)]
    assert episode.steps[-1].terminated
    assert episode.header.image_size == (48, 40)
    stored = episode.jpeg(episode.steps[0])
    assert stored is not None
    far = np.abs(simplejpeg.decode_jpeg(stored).astype(int) - pixels[0])
    assert far.max() <= (24 if jpeg else 3)
    if jpeg:
        with h5py.File(path / "data/main_data.hdf5") as file:
            assert stored == bytes(file["episode_0/observations/camera"][0])


def test_an_incomplete_source_is_refused_or_its_faults_are_collected(tmp_path: Path) -> None:
    records = [r | {"_timestamp_ms": 1000 + 50 * n} for n, r in enumerate(_RECORDS[:3] * 4)]
    folder = tub_folder(tmp_path / "tub", records)
    (folder / "images/4_cam_image_array_.jpg").write_bytes(b"")
    with pytest.raises(DemosError, match=r"is incomplete .*record 4: an empty image"):
        list(import_episodes(folder))
    with pytest.raises(DemosError, match="import it with `shapechanger demos import`"):
        load_dataset(folder)
    context = ImportContext()
    (episode,) = import_episodes(folder, context=context)
    assert len(list(episode.records)) == 11
    assert findings_of(context) == "left out: record 4: an empty image"
    csv = tmp_path / "csv"
    drive(tmp_path / "data")
    export_recording(tmp_path / "data", csv, "csv")
    with pytest.raises(DemosError, match="leave out --hz"):
        import_recording(csv, tmp_path / "out", hz=20.0)
    with pytest.raises(DemosError, match="csv has no option 'camera', unlike tub, lerobot"):
        import_recording(csv, tmp_path / "out", camera="front")
