"""Envs on a device take the same steps as CPU envs, within stated tolerances."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from shapechanger.envs.warp import WarpVectorEnv
from tests.envs.warp.side_by_side import (
    BODIES,
    OBSERVATION_TOLERANCE,
    REWARD_TOLERANCE,
    WORLDS,
    apart,
    many,
    names_of,
    set_all,
    tolerance,
    visited,
)

ROUNDS = 3


@pytest.fixture(scope="module", params=BODIES)
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[WarpVectorEnv, list[Any]]]:
    worlds, alone = many(request.param)
    for env in alone:
        env.reset(seed=0)
    yield worlds, alone
    worlds.close()
    for env in alone:
        env.close()


def test_a_step_from_the_same_state_has_the_same_results(
    pair: tuple[WarpVectorEnv, list[Any]],
) -> None:
    """Observation, reward, reward terms and end equal the CPU env's, for each body."""
    worlds, alone = pair
    assert len(worlds.batches) == 1
    rng = np.random.default_rng(0)
    states = [visited(env, rng, ROUNDS) for env in alone]
    for place in range(ROUNDS):
        set_all(worlds, alone, [each[place] for each in states])
        actions = rng.uniform(-1.0, 1.0, worlds.action_space.shape).astype(np.float32)
        _, rewards, terminated, truncated, infos = worlds.step(actions)
        assert not truncated.any()
        for i, env in enumerate(alone):
            observation, reward, ended, _, info = env.step(actions[i])
            # The observation of an ended episode is in `final_obs`; the env has restarted.
            assert apart(infos["final_obs"][i], observation) < tolerance(worlds)
            assert apart(rewards[i], reward) < REWARD_TOLERANCE
            assert bool(terminated[i]) == ended
            assert names_of(infos) == set(info)
            told = infos["final_info"] if ended else infos
            for name, value in info.items():
                assert apart(told[name][i], value) < REWARD_TOLERANCE, name
                assert told[f"_{name}"][i]


def test_starts_follow_the_rules_of_the_cpu_env(pair: tuple[WarpVectorEnv, list[Any]]) -> None:
    """Start states fit the CPU env's rules, with the same observations, layouts and infos."""
    worlds, alone = pair
    observations, infos = worlds.reset(seed=5)
    assert worlds.observation_layout == alone[0].observation_layout
    assert worlds.action_layout == alone[0].action_layout
    assert worlds.observation_space.contains(observations.cpu().numpy())
    assert worlds.action_space.shape == (WORLDS, worlds.action_layout.size)
    batch = worlds.batches[0]
    for i, env in enumerate(alone):
        qpos, qvel = (x[i].double().cpu().numpy() for x in (batch.qpos, batch.qvel))
        env.reset()
        np.testing.assert_allclose(env.start_rules().feasible(qpos, env.data), qpos, atol=2e-6)
        assert np.abs(qvel).max() < 6.0 * env._reset_noise_scale
        env.reset()
        env.set_state(qpos, qvel)
        assert apart(observations[i], env._get_obs()) < OBSERVATION_TOLERANCE
        for name, value in env._get_reset_info().items():
            assert apart(infos[name][i], value) < OBSERVATION_TOLERANCE, name
