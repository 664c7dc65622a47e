"""Recording a remote env in the program."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.demos.recording import RecordEpisodes
from tests.robot.client.robot import Robot

pytestmark = pytest.mark.realtime

Run = Callable[..., Robot]


def test_frames_are_recorded_as_they_were_received(run: Run, tmp_path: Path) -> None:
    robot = run(arm_by_itself=True)
    options: dict[str, Any] = {"pace": "lockstep", "state": True} | robot.arguments
    with gym.make("shapechanger/RemoteVehicle-v1", **options) as made:
        env = RecordEpisodes(made, tmp_path, driver="person")
        env.reset()
        sent = [env.unwrapped.newest_jpeg]
        for _ in range(5):
            env.step(np.array([0.0, 0.5], np.float32))
            sent.append(env.unwrapped.newest_jpeg)
        env.end()
    (path,) = episodes_of(tmp_path)
    episode = read_episode(path)
    assert [episode.jpeg(step) for step in episode.steps] == sent[:5]
    assert episode.header.clock == robot.clock
    assert [s.captured_ns for s in episode.steps] == sorted(
        {s.captured_ns for s in episode.steps if s.captured_ns}
    )
    assert episode.steps[-1].applied == (0.0, 0.5)
    assert len(episode.steps[0].state) == 4
