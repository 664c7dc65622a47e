"""What nobody can step is refused in words, before anything has moved."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import shapechanger
from shapechanger.envs.vector import ThreadVectorEnv
from shapechanger.errors import BadAction, SpaceMismatch, UnknownName, VectorEnvError
from shapechanger.morphology import JointRange, Remove


@pytest.fixture
def ants() -> Iterator[ThreadVectorEnv]:
    """Three ants and two threads, reset."""
    envs = shapechanger.make_vec("Ant", 3, threads=2)
    envs.reset(seed=0)
    yield envs
    envs.close()


@pytest.mark.parametrize("count", [0, -1, 1.5, None])
def test_there_is_at_least_one_env_and_one_thread(count: Any) -> None:
    """The message names what there is too little of."""
    with pytest.raises(VectorEnvError, match=f"at least one env, got {count}"):
        shapechanger.make_vec("Ant", count)
    if count is not None:
        with pytest.raises(VectorEnvError, match=f"at least one thread, got {count}"):
            shapechanger.make_vec("Ant", 2, threads=count)
    with pytest.raises(VectorEnvError, match="at least one env, got 0"):
        gym.make_vec("shapechanger/Ant-v1", num_envs=0)
    with pytest.raises(VectorEnvError, match="at least one env"):
        ThreadVectorEnv([])


def test_each_env_has_one_body() -> None:
    """Neither more nor fewer."""
    with pytest.raises(VectorEnvError, match="3 envs and 2 bodies"):
        shapechanger.make_vec("Ant", 3, bodies=["Ant", "BigAnt"])


@pytest.mark.parametrize(
    ("bodies", "sentence"),
    [
        (
            ["Ant", "ExtendedAnt"],
            r"observation space of env 1 \(.*body ExtendedAnt\) has 137 numbers, .* env 0 .* 105",
        ),
        (
            ["Ant", "Ant", [JointRange("hip_1", -0.1, 0.1)]],
            None,
        ),
        (
            [[Remove("aux_1")], [Remove("aux_2")]],
            "observation space of env 1 .* has '.*_1.*' where that of env 0 .* has '.*_2.*'",
        ),
    ],
    ids=["size", "same", "meaning"],
)
def test_bodies_share_their_spaces(bodies: list[Any], sentence: str | None) -> None:
    """The message names both envs; a narrower joint changes no space."""
    if sentence is None:
        shapechanger.make_vec("Ant", len(bodies), bodies=bodies).close()
        return
    with pytest.raises(SpaceMismatch, match=sentence):
        shapechanger.make_vec("Ant", len(bodies), bodies=bodies)


def test_unknown_ids_and_modes_are_told_what_there_is() -> None:
    """With the nearest spelling."""
    with pytest.raises(UnknownName, match="Did you mean 'BigAnt'"):
        shapechanger.make_vec("BigAnd", 2)
    with pytest.raises(UnknownName, match="shapechanger/Nothing-v1"):
        shapechanger.make_vec("shapechanger/Nothing-v1", 2)
    with pytest.raises(UnknownName, match="Did you mean 'SameStep'"):
        shapechanger.make_vec("Ant", 2, autoreset_mode="SomeStep")


def test_spaces_are_boxes() -> None:
    """Anything else is for Gymnasium's own."""
    with pytest.raises(VectorEnvError, match="action space of a vector env must be a Box"):
        ThreadVectorEnv([lambda: gym.make("CartPole-v1")])


def _with(place: tuple[int, ...], value: float) -> Any:
    actions = np.zeros((3, 8), np.float32)
    actions[place] = value
    return actions


@pytest.mark.parametrize(
    ("actions", "sentence"),
    [
        (_with((1, 3), np.nan), "action of env 1 has numbers that are not finite"),
        (_with((2, 0), np.inf), "action of env 2 has numbers that are not finite"),
        (np.zeros((3, 7)), r"action of env 0 has shape \(7,\), not \(8,\)"),
        (np.zeros((2, 8)), "3 envs and 2 actions"),
        ([np.zeros(8), np.zeros(8), np.zeros(9)], r"action of env 2 has shape \(9,\), not \(8,\)"),
        (np.zeros(24), "3 envs and 24 actions"),
        (0.0, r"one row per env, shape \(3, 8\)"),
        (np.full((3, 8), "left"), "Actions must be numbers"),
    ],
    ids=["nan", "inf", "narrow", "few", "ragged", "flat", "number", "words"],
)
def test_bad_actions_move_nothing(ants: ThreadVectorEnv, actions: Any, sentence: str) -> None:
    """The env is named, and all envs are where they were."""
    before = [env.unwrapped.data.time for env in ants.envs]
    with pytest.raises(BadAction, match=sentence):
        ants.step(actions)
    assert [env.unwrapped.data.time for env in ants.envs] == before
    ants.step(np.zeros((3, 8), np.float32))


def test_the_action_of_an_env_that_is_about_to_start_again_does_not_count() -> None:
    """In Gymnasium's default mode it is ignored, and a policy may have nothing to say there."""
    envs = shapechanger.make_vec("InvertedPendulum", 2, max_episode_steps=2)
    envs.reset(seed=0)
    for _ in range(2):
        *_, truncated, _ = envs.step(np.zeros((2, 1), np.float32))
    assert truncated.all()
    envs.step(np.full((2, 1), np.nan, np.float32))
    with pytest.raises(BadAction, match="env 0"):
        envs.step(np.full((2, 1), np.nan, np.float32))
    envs.close()


@pytest.mark.parametrize(
    ("mask", "error", "sentence"),
    [
        ([True, False, True], TypeError, "not a list"),
        (np.array([1, 0, 1]), TypeError, "not of int64"),
        (np.array([True]), ValueError, r"shape \(3,\), not \(1,\)"),
        (np.zeros(3, np.bool_), ValueError, "true for no env"),
    ],
)
def test_bad_masks(ants: ThreadVectorEnv, mask: Any, error: type[Exception], sentence: str) -> None:
    """The kinds of errors are Gymnasium's."""
    with pytest.raises(error, match=sentence):
        ants.reset(options={"reset_mask": mask})


def test_bad_seeds_and_values(ants: ThreadVectorEnv) -> None:
    """As many as envs."""
    with pytest.raises(VectorEnvError, match="3 envs and 2 seeds"):
        ants.reset(seed=[1, 2])
    with pytest.raises(VectorEnvError, match="3 envs and 2 values"):
        ants.set_attr("speed", [1, 2])


def test_before_the_first_reset_nothing_steps() -> None:
    """And a mask cannot leave out what has never started."""
    envs = shapechanger.make_vec("Ant", 2)
    with pytest.raises(gym.error.ResetNeeded, match="call `reset` first"):
        envs.step(np.zeros((2, 8)))
    with pytest.raises(gym.error.ResetNeeded, match="without a mask"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.close()


def test_what_nobody_resets_does_not_step() -> None:
    """The message says which envs, and how."""
    envs = shapechanger.make_vec(
        "InvertedPendulum", 2, autoreset_mode=AutoresetMode.DISABLED, max_episode_steps=1
    )
    envs.reset(seed=0)
    envs.step(np.zeros((2, 1)))
    with pytest.raises(gym.error.ResetNeeded, match=re.escape("envs 0, 1 have ended")):
        envs.step(np.zeros((2, 1)))
    envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(gym.error.ResetNeeded, match=re.escape("envs 1 have ended")):
        envs.step(np.zeros((2, 1)))
    envs.close()


def test_closing_twice_is_fine_and_stepping_after_is_not() -> None:
    """The message says what to do."""
    envs = shapechanger.make_vec("Ant", 2, threads=2)
    envs.reset(seed=0)
    envs.close()
    envs.close()
    for call in (lambda: envs.step(np.zeros((2, 8))), envs.reset, envs.render):
        with pytest.raises(gym.error.ClosedEnvironmentError, match="make another one"):
            call()
