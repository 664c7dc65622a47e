"""MuJoCo's timers are paused while our envs step, and only then."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, cast

import gymnasium as gym
import mujoco
import numpy as np
import pytest

import shapechanger
from shapechanger.envs.stepping.tuned import PausedTimer, paused_timer
from shapechanger.envs.vector.env import ThreadVectorEnv

_STEP = int(mujoco.mjtTimer.mjTIMER_STEP)


def _measured(data: mujoco.MjData) -> float:
    return float(data.timer.duration[_STEP])


@pytest.fixture
def clocked() -> Iterator[Callable[[], int]]:
    """Install a clock, and return a function that counts its readings."""
    reads = 0

    def clock() -> float:
        nonlocal reads
        reads += 1
        return float(reads)

    mujoco.set_mjcb_time(clock)
    yield lambda: reads
    mujoco.set_mjcb_time(None)


@pytest.mark.parametrize("name", ["Ant", "InvertedPendulum"])
def test_timers_are_paused_during_steps_only(name: str) -> None:
    """Timers stay at zero in env steps and run in manual steps."""
    with contextlib.closing(gym.make(f"shapechanger/{name}-v1")) as env:
        inner: Any = env.unwrapped
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape or (), np.float32))
        assert _measured(inner.data) == 0.0
        mujoco.mj_step(inner.model, inner.data)
        assert _measured(inner.data) > 0.0


def test_timers_run_without_the_fast_model() -> None:
    """With `fast_model=False` the timers run as in Gymnasium."""
    with contextlib.closing(gym.make("shapechanger/Ant-v1", fast_model=False)) as env:
        inner: Any = env.unwrapped
        env.reset(seed=0)
        env.step(np.zeros(8, np.float32))
        assert _measured(inner.data) > 0.0


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("fast", [True, False])
def test_timers_are_paused_in_vector_envs(threads: int, fast: bool) -> None:
    """Timers are paused in all threads, and run again after the step."""
    with contextlib.closing(
        shapechanger.make_vec("Ant", 4, threads=threads, fast_model=fast)
    ) as envs:
        datas: list[mujoco.MjData] = [env.unwrapped.data for env in envs.envs]
        envs.reset(seed=0)
        for _ in range(3):
            envs.step(np.zeros((4, 8), np.float32))
        assert all((_measured(data) == 0.0) is fast for data in datas)
        mujoco.mj_step(envs.envs[0].unwrapped.model, datas[0])
        assert _measured(datas[0]) > 0.0


def test_timers_run_if_one_env_needs_them() -> None:
    """One env without a fast model keeps the global timers running."""
    makers = [partial(gym.make, "shapechanger/Ant-v1", fast_model=fast) for fast in (True, False)]
    with contextlib.closing(ThreadVectorEnv(makers)) as envs:
        datas: list[mujoco.MjData] = [env.unwrapped.data for env in cast("Any", envs.envs)]
        envs.reset(seed=0)
        envs.step(np.zeros((2, 8), np.float32))
        assert all(_measured(data) > 0.0 for data in datas)


def test_a_user_clock_keeps_running(clocked: Callable[[], int]) -> None:
    """A clock that a user installs is read in env steps."""
    with contextlib.closing(gym.make("shapechanger/Ant-v1")) as env:
        env.reset(seed=0)
        before = clocked()
        env.step(np.zeros(8, np.float32))
        assert clocked() > before
        assert mujoco.get_mjcb_time() is not None


def test_an_earlier_clock_is_kept(clocked: Callable[[], int]) -> None:
    """If a clock is installed first, the timers are not paused."""
    paused_timer.cache_clear()
    try:
        assert not isinstance(paused_timer(), PausedTimer)
    finally:
        paused_timer.cache_clear()


def test_timers_resume_after_the_last_thread() -> None:
    """Timers resume when the last thread leaves, after errors too."""
    clock = ctypes.c_void_p(4096)  # A fake address that is never called.
    resting = PausedTimer(clock)
    inside, leave = threading.Event(), threading.Event()

    def stay() -> None:
        with resting:
            inside.set()
            leave.wait()

    other = threading.Thread(target=stay)
    other.start()
    inside.wait()
    with pytest.raises(ZeroDivisionError), resting:
        _ = 1 / 0
    assert clock.value is None  # The other thread is still inside.
    leave.set()
    other.join()
    assert clock.value == 4096


def test_timers_can_be_paused_here() -> None:
    """Pausing works on this platform; otherwise steps would silently be slower."""
    assert isinstance(paused_timer(), PausedTimer)
