"""Recording an env: decisions, outcomes, and failing disks."""

from __future__ import annotations

import math
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import TimeLimit

from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.episodes import (
    Episode,
    EpisodeMark,
    EpisodeWriter,
    Step,
    episodes_of,
    read_episode,
    repair,
    writer,
)
from shapechanger.demos.jpeg import decode_picture, encode_picture
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.errors import DemosError, LayoutError, OutputError
from tests.demos.corridor_env import SIZE, CorridorEnv, Shows
from tests.demos.episodes.making import header

FORWARD = np.array([0.5, 1.0], np.float32)


def drive(env: gym.Env[Any, Any], steps: int, seed: int | None = None) -> None:
    over = True
    for _ in range(steps):
        if over:
            env.reset(seed=seed)
        *_, terminated, truncated, _ = env.step(FORWARD)
        over = terminated or truncated


def only(recording: Path) -> Episode:
    (path,) = episodes_of(recording)
    return read_episode(path)


@pytest.mark.parametrize("shows", ["picture", "state", "both"])
def test_observations_are_paired_with_actions(shows: Shows, tmp_path: Path) -> None:
    with RecordEpisodes(CorridorEnv(shows), tmp_path) as env:
        drive(env, 30, seed=3)
        env.end()
    first = read_episode(episodes_of(tmp_path)[0])
    decided = [(s.action, s.driver, s.applied) for s in first.steps]
    assert decided == [((0.5, 1.0), "program", (0.5, 0.5))] * 20
    assert first.outcome == "collision"
    assert [s.terminated for s in first.steps] == [False] * 19 + [True]
    assert (first.header.seed, first.header.control_hz) == (3, 10.0)
    for number, step in enumerate(first.steps):
        way = 0.03 + 0.1 * number
        if shows != "picture":
            assert step.state == pytest.approx((way, 7.5), abs=1e-5)
        jpeg = first.jpeg(step)
        if shows == "state":
            assert jpeg is None
            continue
        assert jpeg is not None
        picture = decode_picture(jpeg, "it")
        assert picture.shape == (*SIZE, 3)
        assert picture[-4, 4] == pytest.approx(round(100 * way), abs=4)
        assert picture[4, 4, 0] == pytest.approx(250, abs=6), "red and blue must not be swapped"
    assert first.steps[0].reward == pytest.approx(0.1)
    assert first.steps[-1].terms["reward_collision"] == -10.0
    assert first.header.image_size == (None if shows == "state" else (32, 24))
    assert len(load_dataset(tmp_path, drivers=("program",))) == 30


def test_the_intended_action_is_recorded(tmp_path: Path) -> None:
    """An expert may execute another action, and a person may intervene."""
    inner = CorridorEnv("state")
    with RecordEpisodes(inner, tmp_path, driver="policy") as env:
        env.reset()
        env.decide(Step(action=(0.0, 0.5), driver="expert", wanted=(1.0, 1.0)))
        env.step(FORWARD)
        env.step(FORWARD)
        inner.more = {"intervene_action": np.array([-1.0, 0.25], np.float32)}
        env.step(FORWARD)
    assert [(step.driver, step.action, step.wanted) for step in only(tmp_path).steps] == [
        ("expert", (0.0, 0.5), (1.0, 1.0)),
        ("policy", (0.5, 1.0), None),
        ("person", (-1.0, 0.25), (0.5, 1.0)),
    ]
    assert only(tmp_path).steps[0].applied == (0.5, 0.5)


def test_bytes_and_times_of_the_env_are_kept_as_they_are(tmp_path: Path) -> None:
    inner: Any = CorridorEnv()
    inner.newest_jpeg = jpeg = encode_picture(inner.reset()[0]["image"], 50)
    inner.record_clock = "twin"
    inner.more = {"captured_ns": 1_000, "decided_ns": 1_500, "absent": ("battery",)}
    with RecordEpisodes(inner, tmp_path) as env:
        drive(env, 3)
    episode = only(tmp_path)
    assert [episode.jpeg(step) for step in episode.steps] == [jpeg] * 3
    assert {step.frame for step in episode.steps} == {"000000.jpg"}
    assert episode.header.clock == "twin"
    assert (episode.steps[1].captured_ns, episode.steps[1].decided_ns) == (1_000, 1_500)
    assert math.isnan(episode.steps[1].state[1])


def test_the_key_of_a_robot_is_not_recorded(tmp_path: Path) -> None:
    inner = CorridorEnv("state")
    inner.spec = EnvSpec("x/Y-v0", kwargs={"key": "5ec2e7", "shows": "state", "path": tmp_path})
    with RecordEpisodes(inner, tmp_path) as env:
        drive(env, 1)
    episode = only(tmp_path)
    assert episode.header.env == "x/Y-v0"
    assert episode.header.env_kwargs == {"shows": "state", "path": str(tmp_path)}
    assert "5ec2e7" not in (episode.path / "episode.json").read_text()


def test_the_outcome_of_an_episode(tmp_path: Path) -> None:
    inner = CorridorEnv("state")
    with RecordEpisodes(TimeLimit(inner, 2), tmp_path / "time") as env:
        drive(env, 2)
        inner.more = {"truncated_because": "The robot was disarmed."}
        drive(env, 2)
        drive(env, 1)
        env.reset()
    outcomes = [read_episode(path).outcome for path in episodes_of(tmp_path / "time")]
    assert outcomes == ["time", "The robot was disarmed.", ""]


def test_an_episode_begins_with_its_first_step(tmp_path: Path) -> None:
    with RecordEpisodes(CorridorEnv("state"), tmp_path / "data") as env:
        env.reset()
        with pytest.raises(DemosError, match="No episode is being recorded"):
            env.mark()
        assert not (tmp_path / "data").exists()
        drive(env, 8)
        env.mark("here")
    assert only(tmp_path / "data").marks == (EpisodeMark(7, "here"),)


@contextmanager
def small_files(size: int) -> Iterator[None]:
    """Limit the size of files, to simulate a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("size", [100, 4_000])
def test_a_step_that_cannot_be_written_stops_the_env(size: int, tmp_path: Path) -> None:
    """A step cannot be written on a full disk, or if time runs backwards."""
    inner = CorridorEnv("state")
    with RecordEpisodes(inner, tmp_path) as env:
        env.reset()
        env.step(FORWARD)
        with small_files(size), pytest.raises(OutputError, match=r"Cannot write .*steps"):
            list(map(env.step, 19 * [FORWARD]))
        assert inner.done[-2:] == [[0.5, 1.0], [0.0, 0.0]]
        with pytest.raises(gym.error.ResetNeeded):
            env.step(FORWARD)
    path = episodes_of(tmp_path)[0]
    repair(path)
    assert len(read_episode(path).steps) == len(inner.done) - 2
    inner.more = {"captured_ns": 2_000}
    with RecordEpisodes(inner, tmp_path) as env:
        drive(env, 1)
        inner.more = {"captured_ns": 1_000}
        env.step(FORWARD)
        with pytest.raises(DemosError, match="time runs backwards"):
            env.step(FORWARD)
    assert inner.done[-2:] == [[0.5, 1.0], [0.0, 0.0]]
    assert len(read_episode(episodes_of(tmp_path)[1]).steps) == 2


def test_a_full_episode_goes_on_in_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "FULL_BYTES", 1500)
    with RecordEpisodes(CorridorEnv("both"), tmp_path) as env:
        drive(env, 20, seed=3)
    episodes = [read_episode(path) for path in episodes_of(tmp_path)]
    assert env.episodes == len(episodes) > 2
    assert [e.header.seed for e in episodes] == [3] + [None] * (len(episodes) - 1)
    assert sum(len(e.steps) for e in episodes) == env.steps == 20
    assert all(e.jpeg(step) for e in episodes for step in e.steps)
    assert [e.outcome for e in episodes] == ["continued"] * (len(episodes) - 1) + ["collision"]


def test_an_env_does_not_move_if_its_recording_is_in_use(tmp_path: Path) -> None:
    inner = CorridorEnv("state")
    with EpisodeWriter.create(tmp_path, header(), spare_bytes=0):
        env = RecordEpisodes(inner, tmp_path)
        env.reset()
        with pytest.raises(DemosError, match="in use by another recorder"):
            env.step(FORWARD)
    assert inner.done == []


def test_an_env_that_fails_leaves_a_closed_episode(tmp_path: Path) -> None:
    class Failing(CorridorEnv):
        error: type[BaseException] = KeyboardInterrupt

        def step(self, action: Any) -> Any:
            if len(self.done) % 3 == 2:
                self.done.append([])
                raise self.error
            return super().step(action)

    inner = Failing("state")
    with RecordEpisodes(inner, tmp_path) as env:
        for error in (KeyboardInterrupt, RuntimeError):
            inner.error = error
            with pytest.raises(error):
                drive(env, 3)
    episodes = [read_episode(path) for path in episodes_of(tmp_path)]
    found = [(e.closed, e.outcome, len(e.steps)) for e in episodes]
    assert found == [(True, "stopped", 2), (True, "failed", 2)]


def test_unsuitable_envs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LayoutError, match="CartPole-v1 publishes no observation_layout"):
        RecordEpisodes(gym.make("CartPole-v1"), tmp_path)
    sound = gym.spaces.Dict({"sound": gym.spaces.Box(-1.0, 1.0, (2,))})
    for kind, space, name in (
        ("state", gym.spaces.Discrete(2), "observation_space"),
        ("sound", sound, "observation_space"),
        ("action", gym.spaces.Box(-1.0, 1.0, (3,)), "action_space"),
    ):
        odd: Any = CorridorEnv("both")
        setattr(odd, name, space)
        with pytest.raises(DemosError, match=f"The {kind} space of CorridorEnv is "):
            RecordEpisodes(odd, tmp_path)
