"""`ThreadVectorEnv` gives the results of Gymnasium's `SyncVectorEnv`, to the last bit."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import shapechanger
from shapechanger.envs import CATALOGUE
from shapechanger.envs.vector import ThreadVectorEnv
from tests.envs.vector.sameness import MODES, play_side_by_side, random_bodies, require_same

# Env, autoreset mode and number of threads, with each pair of these; the slow test has all triples.
_QUICK = [
    ("shapechanger/Ant-v1", "NextStep", 1),
    ("shapechanger/Ant-v1", "SameStep", 2),
    ("shapechanger/ExtendedAnt-v1", "Disabled", 2),
    ("shapechanger/InvertedPendulum-v1", "Disabled", 1),
    ("shapechanger/InvertedPendulum-v1", "NextStep", 2),
    ("shapechanger/BigInvertedPendulum-v1", "SameStep", 1),
]


def _pair(env_id: str, bodies: list[Any], threads: int, mode: str, **more: Any) -> tuple[Any, Any]:
    ours = shapechanger.make_vec(
        env_id, len(bodies), threads=threads, bodies=bodies, autoreset_mode=mode, **more
    )
    theirs = SyncVectorEnv(
        [partial(gym.make, env_id, body=body, **more) for body in bodies],
        autoreset_mode=AutoresetMode(mode),
    )
    return ours, theirs


def _compare(env_id: str, threads: int, mode: str, steps: int, clock: int) -> int:
    bodies = [gym.spec(env_id).kwargs.get("body"), *random_bodies(env_id, 5)]
    ours, theirs = _pair(env_id, bodies, threads, mode, max_episode_steps=clock)
    try:
        return play_side_by_side(ours, theirs, steps, mode)
    finally:
        ours.close()
        theirs.close()


@pytest.mark.parametrize(("env_id", "mode", "threads"), _QUICK)
def test_results_equal_gymnasiums(env_id: str, mode: str, threads: int) -> None:
    """Five random bodies and the plain one agree, through terminations and truncations."""
    assert _compare(env_id, threads, mode, steps=200, clock=90) >= 12


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("env_id", CATALOGUE)
def test_results_of_every_env_equal_gymnasiums(env_id: str, mode: str) -> None:
    for threads in (1, 2):
        assert _compare(env_id, threads, mode, steps=1000, clock=300) >= 18


@pytest.mark.parametrize(
    "seed", [None, 7, [3, 1, 2], [5, None, 6]], ids=["none", "one", "each", "some"]
)
def test_seeds_are_distributed_as_in_gymnasium(seed: Any) -> None:
    """An int counts up, a list has one seed per env, and None continues."""
    ours, theirs = _pair(
        "shapechanger/InvertedPendulum-v1", ["InvertedPendulum"] * 3, 2, "NextStep"
    )
    for envs in (ours, theirs):
        envs.reset(seed=[10, 20, 30])
    require_same(ours.reset(seed=seed), theirs.reset(seed=seed))
    assert ours.np_random_seed == theirs.np_random_seed
    assert [generator.random() for generator in ours.np_random] == [
        generator.random() for generator in theirs.np_random
    ]
    ours.close()
    theirs.close()


def test_options_reach_every_env() -> None:
    """A new body for all envs, or for the envs of a mask, gives Gymnasium's results."""
    ours, theirs = _pair("shapechanger/Ant-v1", ["Ant"] * 3, 2, "Disabled")
    mask = np.array([True, False, True])
    for options in ({"body": "BigAnt"}, {"body": "AmputatedAnt", "reset_mask": mask}):
        results = [envs.reset(seed=4, options=dict(options)) for envs in (ours, theirs)]
        require_same(*results)
    require_same(ours.get_attr("body"), theirs.get_attr("body"))
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3, 8)).astype(np.float32)
    for action in actions:
        require_same(ours.step(action), theirs.step(action))
    ours.close()
    theirs.close()


def test_external_envs_are_stepped() -> None:
    def make() -> gym.Env[Any, Any]:
        env = gym.make("Hopper-v5", max_episode_steps=25)
        return gym.wrappers.TransformReward(env, lambda reward: 2.0 * reward)

    ours = ThreadVectorEnv([make] * 3, threads=2, autoreset_mode=AutoresetMode.SAME_STEP)
    theirs = SyncVectorEnv([make] * 3, autoreset_mode=AutoresetMode.SAME_STEP)
    assert play_side_by_side(ours, theirs, 60, "SameStep") > 3
    ours.close()
    theirs.close()
