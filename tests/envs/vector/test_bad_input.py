"""Invalid input is refused before any env has moved."""

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
from shapechanger.errors import (
    BadAction,
    EnvArgumentError,
    SpaceMismatch,
    UnknownName,
    VectorEnvError,
)
from shapechanger.morphology import JointRange, Remove


@pytest.fixture
def ants() -> Iterator[ThreadVectorEnv]:
    envs = shapechanger.make_vec("Ant", 3, threads=2)
    envs.reset(seed=0)
    yield envs
    envs.close()


@pytest.mark.parametrize("count", [0, -1, 1.5, None])
def test_at_least_one_env_and_thread_are_needed(count: Any) -> None:
    """`make_vec` and `ThreadVectorEnv` refuse numbers that are not whole or below one."""
    with pytest.raises(VectorEnvError, match=f"at least one env, got {count}"):
        shapechanger.make_vec("Ant", count)
    with pytest.raises(VectorEnvError, match="at least one env, got 0"):
        ThreadVectorEnv([])
    with pytest.raises(VectorEnvError, match="at least one thread, got 0"):
        ThreadVectorEnv([lambda: gym.make("CartPole-v1")], threads=0)


@pytest.mark.parametrize(
    ("bodies", "sentence"),
    [
        (
            ["Ant", "ExtendedAnt"],
            r"space of env 1 \(.*body ExtendedAnt\) has foot_1/angle and not hip_2/angle like",
        ),
        (
            [[Remove("aux_1")], [Remove("aux_2")]],
            "observation space of env 1 .* has .*_1/.* and not .*_2/.* like env 0",
        ),
    ],
    ids=["size", "meaning"],
)
def test_bodies_must_share_their_spaces(bodies: list[Any], sentence: str) -> None:
    """The error names both envs; a narrower joint range is accepted."""
    shapechanger.make_vec("Ant", 2, bodies=["Ant", [JointRange("hip_1", -0.1, 0.1)]]).close()
    with pytest.raises(SpaceMismatch, match=sentence):
        shapechanger.make_vec("Ant", 2, bodies=bodies)


@pytest.mark.parametrize(
    ("env_id", "arguments", "sentence"),
    [
        ("BigAnd", {}, "Did you mean 'BigAnt'"),
        ("shapechanger/Nothing-v1", {}, "No environment matches 'Nothing'"),
        ("nowhere:Nothing-v1", {}, "No environment matches 'nowhere:Nothing-v1'"),
        ("Ant", {"autoreset_mode": "SomeStep"}, "Did you mean 'SameStep'"),
        ("Ant", {"backend": "wrap"}, r"No backend matches 'wrap'\. Did you mean 'warp'"),
        ("Ant", {"bodies": ["Ant"]}, "2 envs and 1 bodies"),
        ("Ant", {"threads": 0}, "at least one thread, got 0"),
        ("Ant", {"backend": "warp", "pool": []}, "a `pool` of some bodies"),
        (
            "Ant",
            {"backend": "warp", "bodies": ["Ant"] * 2, "pool": ["Ant"]},
            "either `bodies`, one per",
        ),
        ("Ant", {"backend": "warp", "threads": 2}, "takes no threads"),
        ("Ant", {"backend": "warp", "copy": False}, "always copies observations"),
        ("Ant", {"backend": "warp", "njmax": 0}, "needs at least one njmax, got 0"),
        (
            "Ant",
            {"backend": "warp", "render_mode": "rgb_array"},
            "no render_mode: a device cannot render",
        ),
        (
            "Ant",
            {"backend": "warp", "towards": "BigAnt"},
            "takes no towards: a reset does not draw",
        ),
        ("Ant", {"backend": "warp", "autoreset_mode": "Disabled"}, "no autoreset mode Disabled"),
        ("Ant", {"pool": ["Ant"]}, "backend='threads' takes no pool: use backend='warp'"),
        ("Ant", {"device": "cpu"}, "takes no device: use backend='warp'"),
        ("Ant", {"njmax": 3}, "backend='threads' takes no njmax"),
        ("Ant", {"reset_noise_scal": 0.1}, "Did you mean 'reset_noise_scale'"),
        ("Ant", {"reset_noise_scale": "much"}, "reset_noise_scale must be a number, got 'much'"),
    ],
)
def test_bad_arguments_are_refused(env_id: str, arguments: dict[str, Any], sentence: str) -> None:
    """Unknown names, wrong values, and arguments that a backend does not have are refused."""
    with pytest.raises((VectorEnvError, UnknownName, EnvArgumentError), match=sentence):
        shapechanger.make_vec(env_id, 2, **arguments)


def test_spaces_must_be_boxes() -> None:
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
        (np.zeros((3, 7)), r"shape \(3, 8\), got \(3, 7\)"),
        (np.zeros((2, 8)), r"shape \(3, 8\), got \(2, 8\)"),
        ([np.zeros(8), np.zeros(8), np.zeros(9)], r"shape \(8,\) each: "),
        (np.zeros(24), r"shape \(3, 8\), got \(24,\)"),
        (0.0, r"shape \(3, 8\), got \(\)"),
        (np.full((3, 8), "left"), "Actions must be numbers"),
    ],
    ids=["nan", "inf", "narrow", "few", "ragged", "flat", "number", "words"],
)
def test_invalid_actions_are_refused(ants: ThreadVectorEnv, actions: Any, sentence: str) -> None:
    """No env has moved; the error names the env of a number that is not finite."""
    before = [env.unwrapped.data.time for env in ants.envs]
    with pytest.raises(BadAction, match=sentence):
        ants.step(actions)
    assert [env.unwrapped.data.time for env in ants.envs] == before
    ants.step(np.zeros((3, 8), np.float32))


@pytest.mark.parametrize("mode", [None, "NextStep", "SameStep", "Disabled"])
def test_actions_are_ignored_only_at_an_autoreset_in_the_next_step(mode: str | None) -> None:
    given = {} if mode is None else {"autoreset_mode": mode}
    envs = shapechanger.make_vec("InvertedPendulum", 2, max_episode_steps=2, **given)
    envs.reset(seed=0)
    for _ in range(2):
        *_, truncated, _ = envs.step(np.zeros((2, 1), np.float32))
    assert truncated.all()
    if mode in (None, "NextStep"):
        envs.step(np.full((2, 1), np.nan, np.float32))
    with pytest.raises(BadAction, match="env 0"):
        envs.step(np.full((2, 1), np.nan, np.float32))
    envs.close()


@pytest.mark.parametrize(
    ("mask", "error", "sentence"),
    [
        ([True, False, True], TypeError, "not of list"),
        (np.array([1, 0, 1]), TypeError, "not of int64"),
        (np.array([True]), ValueError, r"shape \(3,\).*got \[ True\]"),
        (np.zeros(3, np.bool_), ValueError, "select an env, got"),
    ],
)
def test_invalid_masks_are_refused(
    ants: ThreadVectorEnv, mask: Any, error: type[Exception], sentence: str
) -> None:
    """The errors have Gymnasium's types."""
    with pytest.raises(error, match=sentence):
        ants.reset(options={"reset_mask": mask})


def test_wrong_numbers_of_seeds_and_values_are_refused(ants: ThreadVectorEnv) -> None:
    with pytest.raises(VectorEnvError, match="3 envs and 2 seeds"):
        ants.reset(seed=[1, 2])
    with pytest.raises(VectorEnvError, match="3 envs and 2 values"):
        ants.set_attr("speed", [1, 2])


@pytest.mark.parametrize(
    "seed",
    [-1, 2**63 - 2, 2**64, 1.5, True, "123", b"123", np.float32(3.0), [0, 1, -1], [0, 1, 2**63]],
)
def test_invalid_seeds_are_refused(ants: ThreadVectorEnv, seed: Any) -> None:
    """Seeds must be whole numbers from 0 to the largest signed 64-bit integer."""
    before = ants.reset(seed=3)[0].copy()
    with pytest.raises(
        VectorEnvError, match=r"A seed must be a whole number from 0 to 92\d+, got "
    ):
        ants.reset(seed=seed)
    np.testing.assert_array_equal(ants.reset(seed=3)[0], before)


def test_reset_is_needed_first() -> None:
    envs = shapechanger.make_vec("Ant", 2)
    with pytest.raises(gym.error.ResetNeeded, match="call `reset` first"):
        envs.step(np.zeros((2, 8)))
    with pytest.raises(gym.error.ResetNeeded, match="without a mask"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.close()


def test_ended_envs_must_be_reset() -> None:
    """In Disabled mode the error names the envs that have ended."""
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


def test_a_closed_vector_env_refuses_calls() -> None:
    """Closing is idempotent; later calls raise ClosedEnvironmentError."""
    envs = shapechanger.make_vec("Ant", 2, threads=2)
    envs.reset(seed=0)
    envs.close()
    envs.close()
    for call in (lambda: envs.step(np.zeros((2, 8))), envs.reset, envs.render):
        with pytest.raises(gym.error.ClosedEnvironmentError, match="make another one"):
            call()
