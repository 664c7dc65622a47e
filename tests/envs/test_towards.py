"""`towards`: each reset draws a body on the way to another one."""

from __future__ import annotations

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest

import shapechanger
from shapechanger.errors import SpaceMismatch, UnknownName
from shapechanger.transfer.env_ref import env_traits


def _heights(env: gym.Env[object, object], seeds: list[int | None]) -> list[float]:
    heights: list[float] = []
    for seed in seeds:
        env.reset(seed=seed)
        heights.append(env.unwrapped.standing_height)  # type: ignore[attr-defined]
    return heights


def test_each_reset_draws_a_body_between_the_two() -> None:
    """The seed decides which; without one the draws go on."""
    small, big = (
        _heights(gym.make("shapechanger/Ant-v1", body=body), [0])[0] for body in ("Ant", "BigAnt")
    )
    env = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    seeds: list[int | None] = [1, None, None, 2]
    drawn = _heights(env, seeds)
    assert all(small <= height <= big for height in drawn)
    assert len(set(drawn)) == 4
    again = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    assert _heights(again, seeds) == drawn


def test_a_reset_may_still_name_the_body() -> None:
    """For once."""
    env = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    env.reset(seed=0, options={"body": "BigAnt"})
    (big,) = _heights(gym.make("shapechanger/BigAnt-v1"), [0])
    assert env.unwrapped.standing_height == big  # type: ignore[attr-defined]
    assert _heights(env, [0])[0] < big


def test_copies_draw_the_same() -> None:
    """Pickles and specs hold both ends, not the body of the moment."""
    env = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    drawn = _heights(env, [3, 4])
    assert env.spec is not None
    for other in (gym.make(copy.deepcopy(env.spec)), pickle.loads(pickle.dumps(env.unwrapped))):
        assert _heights(other, [3, 4]) == drawn


def test_the_envs_of_a_vector_draw_each_their_own() -> None:
    """As single envs with their seeds do."""
    envs = shapechanger.make_vec("shapechanger/Ant-v1", 3, towards="BigAnt", fast_model=False)
    envs.reset(seed=5)
    drawn = [env.unwrapped.standing_height for env in envs.envs]
    single = gym.make("shapechanger/Ant-v1", towards="BigAnt", fast_model=False)
    assert drawn == _heights(single, [5, 6, 7])
    envs.close()


def test_a_pole_has_a_way_too() -> None:
    """Every family has one."""
    env = gym.make("shapechanger/InvertedPendulum-v1", towards="BigInvertedPendulum")
    lengths = set[float]()
    for seed in range(3):
        env.reset(seed=seed)
        lengths.add(float(env.unwrapped.model.geom("cpole").size[1]))  # type: ignore[attr-defined]
    assert len(lengths) == 3
    assert all(0.3 <= length <= 0.6 for length in lengths)


def test_what_cannot_be_a_way_is_refused() -> None:
    """A body that does not exist, and one of other spaces."""
    with pytest.raises(UnknownName, match="BigAnt"):
        gym.make("shapechanger/Ant-v1", towards="BigAntt")
    with pytest.raises(UnknownName, match="towards"):
        gym.make("shapechanger/Ant-v1", toward="BigAnt")
    env = gym.make("shapechanger/Ant-v1", towards="ExtendedAnt", fast_model=False)
    with pytest.raises((SpaceMismatch, UnknownName)):
        env.reset(seed=0)


def test_two_bodies_without_another_id_have_the_same_layouts() -> None:
    """So that methods for equal spaces take them."""
    traits = [env_traits(gym.make(f"shapechanger/{name}-v1")) for name in ("Ant", "BigAnt")]
    assert traits[0].observation_layout == traits[1].observation_layout
    assert np.array_equal(traits[0].action_layout.low, traits[1].action_layout.low)
