"""Pilots: who decides while an env is recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shapechanger.demos.dataset import load_dataset
from shapechanger.demos.drivers import (
    CorrectedPilot,
    ExpertPilot,
    Gate,
    GateRule,
    PolicyPilot,
    record_steps,
)
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.demos.recording import RecordEpisodes
from tests.demos.corridor_env import AlwaysForward, CorridorEnv

AWAY = np.array([-1.0, 0.5], np.float32)


def test_an_expert_is_recorded_with_its_intention(tmp_path: Path) -> None:
    inner = CorridorEnv("state")
    with RecordEpisodes(inner, tmp_path) as env:
        record_steps(env, ExpertPilot(AlwaysForward()), 50, seed=5)
    episodes = [read_episode(path) for path in episodes_of(tmp_path)]
    assert sum(len(episode.steps) for episode in episodes) == 50
    assert [episode.header.seed for episode in episodes] == [5, 6]
    assert inner.done[0] == [0.25, 0.5]
    assert episodes[0].steps[0].action == (0.0, 0.5)
    assert episodes[0].steps[0].driver == "expert"
    assert episodes[0].outcome == "collision"
    assert all(episode.closed for episode in episodes)


def test_only_corrections_are_learned_from(tmp_path: Path) -> None:
    gate = Gate(GateRule(apart=0.5, apart_s=0.15), 0.1)
    pilot = CorrectedPilot(lambda seen: AWAY, AlwaysForward(), gate)
    with RecordEpisodes(CorridorEnv("state"), tmp_path) as env:
        record_steps(env, pilot, 10, seed=0)
    (path,) = episodes_of(tmp_path)
    episode = read_episode(path)
    assert [s.driver for s in episode.steps] == ["policy"] + ["expert"] * 9
    assert episode.steps[0].action == (-1.0, 0.5)
    assert episode.steps[1].action == (0.0, 0.5)
    assert episode.steps[1].wanted == (-1.0, 0.5)
    assert episode.steps[1].applied == (0.0, 0.25), (
        "the expert must not make mistakes while correcting"
    )
    assert [mark.step for mark in episode.marks] == [1]
    assert len(load_dataset(tmp_path)) == 9


def test_policy_steps_are_not_loaded_by_default(tmp_path: Path) -> None:
    with RecordEpisodes(CorridorEnv("state"), tmp_path) as env:
        record_steps(env, PolicyPilot(lambda seen: AWAY), 4, seed=0)
    assert len(load_dataset(tmp_path, drivers=("policy",))) == 4
    with pytest.raises(ValueError, match="no step of expert or person"):
        load_dataset(tmp_path)


def test_ctrl_c_closes_the_episode(tmp_path: Path) -> None:
    """The episode is complete, with the outcome "stopped"."""

    def act(seen: object) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
        if env.steps == 3:
            raise KeyboardInterrupt
        return AWAY

    with RecordEpisodes(CorridorEnv("state"), tmp_path) as env, pytest.raises(KeyboardInterrupt):
        record_steps(env, PolicyPilot(act), 10, seed=0)
    (path,) = episodes_of(tmp_path)
    episode = read_episode(path)
    assert (episode.closed, episode.outcome, len(episode.steps)) == (True, "stopped", 3)
