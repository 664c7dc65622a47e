"""Invalid actions, steps before a reset, time limits, and diverging simulations."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.envs import CATALOGUE
from shapechanger.errors import BadAction

_TUNED = ["shapechanger/Ant-v1", "shapechanger/ExtendedAnt-v1", "shapechanger/InvertedPendulum-v1"]


@pytest.mark.parametrize("env_id", CATALOGUE)
@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda n: np.full(n, np.nan), "finite actions, got nan for .*, number 0"),
        (lambda n: np.append(np.zeros(n - 1), np.inf), "finite actions, got inf for"),
        (lambda n: np.zeros(n + 1, np.float32), r"actions of shape \(\d+,\), got \(\d+,\)"),
        (lambda n: 0.0, r"got \(\)"),
        (lambda n: ["left"] * n, "numbers as actions, got"),
        (lambda n: [[1.0], [1.0, 2.0]], "arrays of numbers as actions"),
    ],
    ids=["nan", "inf", "long", "number", "words", "ragged"],
)
def test_a_bad_action_is_refused(env_id: str, make: Any, sentence: str) -> None:
    """The error names the env, the state does not change, and the next step works."""
    with gym.make(env_id, disable_env_checker=True) as env:
        env.reset(seed=0)
        inner: Any = env.unwrapped
        good = np.zeros(env.action_space.shape, np.float32)
        env.step(good)
        before = inner.data.time, inner.data.qpos.copy(), inner.data.ctrl.copy()
        with pytest.raises(BadAction, match=f"^{env_id} takes .*{sentence}"):
            env.step(make(good.size))
        assert inner.data.time == before[0]
        np.testing.assert_array_equal(inner.data.qpos, before[1])
        np.testing.assert_array_equal(inner.data.ctrl, before[2])
        env.step(good)


def test_a_large_action_is_accepted() -> None:
    """A cost of the action that overflows float32 gives a warning, as Gymnasium does."""
    with gym.make("shapechanger/Ant-v1") as ours:
        ours.reset(seed=0)
        with pytest.warns(RuntimeWarning, match="overflow"):
            _, reward, *_ = ours.step(np.full(8, 1e30, np.float32))
        assert reward == -np.inf


@pytest.mark.parametrize("env_id", CATALOGUE)
@pytest.mark.parametrize("word", ["step", "render"])
def test_reset_is_needed_first(env_id: str, word: str) -> None:
    """Steps and renders before a reset raise ResetNeeded."""
    with gym.make(env_id) as env:
        arguments = [env.action_space.sample()] if word == "step" else []
        with pytest.raises(gym.error.ResetNeeded, match=r"before calling `?env\.reset"):
            getattr(env, word)(*arguments)


@pytest.mark.parametrize("env_id", _TUNED)
def test_time_limits_truncate(env_id: str) -> None:
    """TimeLimit works without the other default wrappers, in copies too."""
    more = {"healthy_z_range": (-9.0, 9.0)} if "Ant" in env_id else {}
    with gym.make(env_id, max_episode_steps=3, **more) as made:
        for env in (made, pickle.loads(pickle.dumps(made)), gym.make(made.spec)):
            env.reset(seed=0)
            ends = [env.step(np.zeros(env.action_space.shape))[3] for _ in range(3)]
            assert ends == [False, False, True]
        for env in (made, gym.make(made.spec)):
            assert env.spec.max_episode_steps == 3
            assert not env.spec.order_enforce
            assert env.spec.disable_env_checker


@pytest.mark.parametrize("env_id", [*_TUNED, "shapechanger/Hopper-v1"])
@pytest.mark.parametrize("edited", [False, True])
@pytest.mark.filterwarnings("ignore:.*(overflow|invalid value):RuntimeWarning")
def test_divergence_is_reported(
    env_id: str, edited: bool, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`diverged` is set until the next reset."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log file.
    with gym.make(env_id) as env:
        inner: Any = env.unwrapped
        action = np.zeros(env.action_space.shape)
        env.reset(seed=0)
        if edited:
            inner.model.opt.gravity[2] = -9.0
        assert "diverged" not in env.step(action)[4]
        assert not inner.diverged
        inner.data.qvel[0] = np.nan
        for _ in range(2):
            assert env.step(action)[4]["diverged"] is True
            assert inner.diverged
        env.reset()
        assert not inner.diverged
        assert "diverged" not in env.step(action)[4]
