"""`towards`: each reset draws a body between two bodies."""

from __future__ import annotations

import copy
import pickle

import gymnasium as gym
import pytest

import shapechanger
from shapechanger.errors import SpaceMismatch, UnknownName


def _heights(env: gym.Env[object, object], seeds: list[int | None]) -> list[float]:
    heights: list[float] = []
    for seed in seeds:
        env.reset(seed=seed)
        heights.append(env.unwrapped.standing_height)  # type: ignore[attr-defined]
    return heights


def test_each_reset_draws_a_body_between_the_two() -> None:
    """The seed determines the body; without a seed the generator continues."""
    small, big = (
        _heights(gym.make("shapechanger/Ant-v1", body=body), [0])[0] for body in ("Ant", "BigAnt")
    )
    env = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    seeds: list[int | None] = [1, None, None, 2]
    drawn = _heights(env, seeds)
    assert all(small <= height <= big for height in drawn)
    assert len(set(drawn)) == 4
    assert env.spec is not None
    # Pickles and specs store the two bodies to draw between, not the body drawn last.
    for again in (gym.make(copy.deepcopy(env.spec)), pickle.loads(pickle.dumps(env.unwrapped))):
        assert _heights(again, seeds) == drawn


def test_a_given_body_overrides_towards() -> None:
    env = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    env.reset(seed=0, options={"body": "BigAnt"})
    (big,) = _heights(gym.make("shapechanger/BigAnt-v1"), [0])
    assert env.unwrapped.standing_height == big  # type: ignore[attr-defined]
    assert _heights(env, [0])[0] < big


def test_vector_envs_draw_one_body_per_env() -> None:
    envs = shapechanger.make_vec("shapechanger/Ant-v1", 3, towards="BigAnt", fast_model=False)
    envs.reset(seed=5)
    drawn = [env.unwrapped.standing_height for env in envs.envs]
    single = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    assert drawn == _heights(single, [5, 6, 7])
    envs.close()


def test_an_invalid_towards_is_refused() -> None:
    """Unknown bodies, and bodies of other spaces, are refused."""
    with pytest.raises(UnknownName, match="BigAnt"):
        gym.make("shapechanger/Ant-v1", towards="BigAntt")
    with pytest.raises(UnknownName, match="towards"):
        gym.make("shapechanger/Ant-v1", toward="BigAnt")
    env = gym.make("shapechanger/Ant-v1", towards="ExtendedAnt", fast_model=False)
    with pytest.raises((SpaceMismatch, UnknownName)):
        env.reset(seed=0)
