"""A diverging simulation ends its own episode only."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import shapechanger
from shapechanger.envs.vector import ThreadVectorEnv
from tests.envs.vector.sameness import MODES, require_same


@pytest.fixture(autouse=True)
def log_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change to a temporary folder, since MuJoCo writes a log file."""
    monkeypatch.chdir(tmp_path)


def _break(env: Any) -> None:
    env.unwrapped.data.qvel[0] = 1e12


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["Ant", "Hopper", "Hopper-v5", "InvertedPendulum"])
def test_other_envs_are_unaffected(name: str, mode: str, threads: int) -> None:
    whole, broken = (
        ThreadVectorEnv(
            [partial(gym.make, name if "-" in name else f"shapechanger/{name}-v1")] * 3,
            threads=threads,
            autoreset_mode=AutoresetMode(mode),
        )
        for _ in range(2)
    )
    for envs in (whole, broken):
        envs.reset(seed=0)
    _break(broken.envs[1])
    still = np.zeros(whole.action_space.shape, np.float32)
    expected, found = whole.step(still), broken.step(still)
    for one, other in zip(found[:4], expected[:4], strict=True):
        require_same(one[[0, 2]], other[[0, 2]])
    observations, rewards, terminated, _, infos = found
    assert terminated.tolist() == [False, True, False]
    assert rewards[1] == 0.0
    assert np.isfinite(observations).all()
    final = infos["final_info"] if mode == "SameStep" else infos
    assert final["diverged"].tolist() == final["_diverged"].tolist() == [False, True, False]
    if mode == "Disabled":
        broken.reset(options={"reset_mask": terminated})
    for _ in range(5):
        *_, infos = broken.step(still)
        assert "diverged" not in infos
    for envs in (whole, broken):
        envs.close()


class _Uncertain(gym.Env[Any, Any]):
    """Env with a non-finite observation in its second step, which it may report as divergence."""

    observation_space = gym.spaces.Box(-np.inf, np.inf, (2,), np.float64)
    action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, ends: tuple[bool, bool], reports: bool) -> None:
        self.ends = ends
        self.reports = reports

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        self.steps = 0
        return np.zeros(2), {}

    def step(self, action: Any) -> Any:
        self.steps += 1
        if self.steps != 2:
            return np.ones(2), 1.0, False, False, {}
        return np.array([1.0, np.nan]), 1.0, *self.ends, {"diverged": True} if self.reports else {}


@pytest.mark.parametrize("reports", [True, False])
@pytest.mark.parametrize("ends", [(False, False), (True, False), (False, True)])
@pytest.mark.parametrize("mode", MODES)
def test_an_observation_that_is_not_finite_ends_the_episode(
    mode: str, ends: tuple[bool, bool], reports: bool
) -> None:
    """The non-finite number is replaced by 0 in the last observation."""
    envs = ThreadVectorEnv(
        [lambda: _Uncertain(ends, reports)] * 2, threads=2, autoreset_mode=AutoresetMode(mode)
    )
    envs.reset()
    envs.step(np.zeros((2, 1)))
    observations, rewards, terminated, truncated, infos = envs.step(np.zeros((2, 1)))
    assert terminated.all()
    assert truncated.tolist() == [ends[1]] * 2
    assert rewards.tolist() == [0.0, 0.0]
    if mode == "SameStep":
        assert infos["final_info"]["diverged"].all()
        assert [final.tolist() for final in infos["final_obs"]] == [[1.0, 0.0]] * 2
        assert observations.tolist() == [[0.0, 0.0]] * 2
    else:
        assert infos["diverged"].all()
        assert observations.tolist() == [[1.0, 0.0]] * 2
    envs.close()


def test_divergence_is_found_without_autoreset() -> None:
    """A non-finite state ends the episode if MuJoCo's autoreset is disabled."""
    envs = shapechanger.make_vec("HalfCheetah", 2)
    envs.envs[0].unwrapped.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    envs.reset(seed=0)
    envs.step(np.zeros((2, 6)))
    envs.envs[0].unwrapped.data.qvel[:] = 1e30
    ended = False
    for _ in range(3):
        observations, rewards, terminated, _, infos = envs.step(np.zeros((2, 6)))
        assert np.isfinite(observations).all()
        assert np.isfinite(rewards).all()
        ended = ended or (bool(terminated[0]) and bool(infos["diverged"][0]))
        assert not terminated[1]
    assert ended
    envs.close()
