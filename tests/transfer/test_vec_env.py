"""`ThreadVecEnv` against Stable-Baselines3's `DummyVecEnv`."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from shapechanger.contract.env_ref import EnvRef
from shapechanger.transfer.learners.vec_env import ThreadVecEnv, training_vec_env
from tests.envs.vector.sameness import require_same

_PENDULUM = "shapechanger/InvertedPendulum-v1"


def _pair(env_id: str, threads: int, **more: Any) -> tuple[Any, Any]:
    ours = ThreadVecEnv(env_id, 3, threads=threads, **more)
    return ours, DummyVecEnv([lambda: gym.make(env_id, **more)] * 3)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("env_id", [_PENDULUM, "shapechanger/Ant-v1", "shapechanger/Hopper-v1"])
def test_results_equal_those_of_sb3(env_id: str, threads: int) -> None:
    """Observations, rewards, ends and infos are equal, also in VecMonitor."""
    ours, theirs = (VecMonitor(one) for one in _pair(env_id, threads, max_episode_steps=60))
    for one in (ours, theirs):
        one.seed(5)
    require_same(ours.reset(), theirs.reset())
    require_same(ours.reset_infos, theirs.reset_infos)
    rng, ended = np.random.default_rng(0), 0
    space = ours.action_space
    for _ in range(150):
        actions = rng.uniform(space.low, space.high, (3, *space.shape)).astype(np.float32)
        (found, expected) = (one.step(actions) for one in (ours, theirs))
        for one in (found, expected):
            for info in one[3]:
                info.get("episode", {}).pop("t", None)  # Wall-clock time.
        require_same(found, expected)
        require_same(ours.reset_infos, theirs.reset_infos)
        ended += int(found[2].sum())
    assert ended >= 6
    ours.close()
    theirs.close()
    ours.close()


def test_options_are_each_envs_own() -> None:
    ours, theirs = _pair("shapechanger/Ant-v1", 2)
    for one in (ours, theirs):
        one.seed(1)
        one.set_options([{"body": "BigAnt"}, {}, {"body": "AmputatedAnt"}])
    require_same(ours.reset(), theirs.reset())
    require_same(ours.get_attr("body"), theirs.get_attr("body"))
    require_same(ours.reset()[1].shape, theirs.reset()[1].shape)
    ours.close()
    theirs.close()


def test_foreign_envs_use_dummy_vec_env() -> None:
    for env_id, kind in ((_PENDULUM, ThreadVecEnv), ("CartPole-v1", DummyVecEnv)):
        envs = training_vec_env(EnvRef(env_id), 2, 1)
        assert type(envs) is kind
        envs.close()
    envs = training_vec_env(EnvRef(f"shapechanger:{_PENDULUM}", {"max_episode_steps": 3}), 2, None)
    assert isinstance(envs, ThreadVecEnv)
    envs.close()
