"""Minari datasets of other projects: intact episodes are imported, and others are reported."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import h5py
import numpy as np
import pytest
from minari.serialization import serialize_space

from shapechanger.demos.exchange import ImportContext, import_recording
from shapechanger.demos.exchange.minari import FORMAT
from tests.demos.exchange.small import all_of, findings_of, read_whole

STATE = gym.spaces.Box(-1.0, 1.0, (2,))
STEPS = 4


def write_set(
    folder: Path,
    observed: gym.Space[Any] = STATE,
    change: Callable[[h5py.File], object] = lambda file: None,
    episodes: int = 2,
    **metadata: Any,
) -> Path:
    """Write a dataset whose actions count its steps, with random observations."""
    place = folder / "data"
    place.mkdir(parents=True)
    described = {
        "dataset_id": "others/set-v0",
        "data_format": "hdf5",
        "total_episodes": episodes,
        "total_steps": episodes * STEPS,
        "observation_space": serialize_space(observed),
        "action_space": serialize_space(gym.spaces.Box(-99.0, 99.0, (1,))),
        "jpeg_encoding": False,
    }
    (place / "metadata.json").write_text(json.dumps(described | metadata))
    with h5py.File(place / "main_data.hdf5", "w") as file:
        for number in range(episodes):
            group = file.create_group(f"episode_{number}")
            group.attrs["total_steps"] = STEPS
            actions = np.arange(STEPS, dtype=float)[:, None] + STEPS * number
            group.create_dataset("actions", data=actions, maxshape=(None, 1))
            group["rewards"] = np.ones(STEPS)
            group["terminations"] = np.zeros(STEPS, bool)
            group["truncations"] = np.arange(STEPS) == STEPS - 1
            _observe(group, "observations", observed)
        change(file)
    return folder


def _observe(group: h5py.Group, name: str, space: gym.Space[Any]) -> None:
    if isinstance(space, gym.spaces.Dict):
        for key, inner in space.items():
            _observe(group, f"{name}/{key}", inner)
    elif isinstance(space, gym.spaces.Text):
        group[name] = ["word"] * (STEPS + 1)
    else:
        space.seed(0)
        group[name] = np.array([space.sample() for _ in range(STEPS + 1)])


def actions_of(folder: Path) -> tuple[list[list[int]], ImportContext]:
    """Return the actions of each episode, and the findings."""
    episodes, context = read_whole(folder, FORMAT)
    return [[int(one.step.action[0]) for one in records] for records in episodes], context


BOTH = [[0, 1, 2, 3], [4, 5, 6, 7]]


def removed(name: str) -> Callable[[h5py.File], object]:
    return lambda file: file["episode_1"].__delitem__(name)


def resized(length: int) -> Callable[[h5py.File], object]:
    return lambda file: file["episode_1/actions"].resize(length, axis=0)


def endless(file: h5py.File) -> None:
    file["episode_1/actions"][2] = np.inf


@pytest.mark.parametrize(
    ("change", "expected", "finding"),
    [
        (removed("actions"), BOTH[:1], "left out: episode_1 of main_data.hdf5: .* no 'actions'"),
        (removed("rewards"), BOTH[:1], "has no 'rewards'"),
        (resized(5), BOTH[:1], "actions' has 5 entries for 4 steps"),
        (resized(3), BOTH[:1], "actions' has 3 entries for"),
        (removed("observations"), BOTH[:1], "has no 'observations'"),
        (
            lambda file: file["episode_1"].attrs.__setitem__("total_steps", 9),
            BOTH[:1],
            "episode_1 has 4 steps, but its total_steps is 9",
        ),
        (lambda file: file.__delitem__("episode_1"), BOTH[:1], "has no episode_1"),
        (endless, [[0, 1, 2, 3], [4, 5, 7]], "step 2 of episode_1: its action is .inf."),
    ],
)
def test_intact_episodes_are_imported(
    tmp_path: Path, change: Callable[[h5py.File], object], expected: list[list[int]], finding: str
) -> None:
    folder = write_set(tmp_path / "set", change=change)
    found, context = actions_of(folder)
    assert found == expected
    assert re.search(finding, findings_of(context))


def test_episodes_beyond_the_stated_number_are_reported(tmp_path: Path) -> None:
    _, context = actions_of(write_set(tmp_path / "set", total_episodes=1))
    assert "warning: total_episodes is 1, and main_data.hdf5 has 2" in findings_of(context)


def test_parts_of_observations_are_imported_or_named(tmp_path: Path) -> None:
    observed = gym.spaces.Dict(
        {
            "depth": gym.spaces.Box(0, 65535, (16, 24, 1), np.uint16),
            "flat": gym.spaces.Box(0, 65535, (16, 24), np.uint16),
            "camera": gym.spaces.Box(0, 255, (16, 24, 3), np.uint8),
            "mission": gym.spaces.Text(9),
            "near": STATE,
            "points": gym.spaces.Box(-1.0, 1.0, (300, 500)),
            "switches": gym.spaces.MultiBinary(3),
        }
    )
    done = import_recording(write_set(tmp_path / "set", observed), tmp_path / "back")
    assert done.pictures == 2 * STEPS
    header = all_of(tmp_path / "back")[0].header
    assert header.state_layout.names == ("near/0", "near/1")
    kinds = {"depth": "Box", "flat": "Box", "points": "Box", "mission": "Text"}
    kinds["switches"] = "MultiBinary"
    text = findings_of(done)
    assert all(f"The observation {name} ({kind} " in text for name, kind in kinds.items())
    assert text.count("is not imported") == len(kinds)
