"""MuJoCo's stopwatch rests while our envs step, and only then."""

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
    """How often a user's own clock has been read; it is installed."""
    reads = 0

    def clock() -> float:
        nonlocal reads
        reads += 1
        return float(reads)

    mujoco.set_mjcb_time(clock)
    yield lambda: reads
    mujoco.set_mjcb_time(None)


@pytest.mark.parametrize("name", ["Ant", "InvertedPendulum"])
def test_nothing_is_measured_in_a_step_but_everything_after_it(name: str) -> None:
    """What that would cost is saved, and whoever steps the data by hand may measure it."""
    with contextlib.closing(gym.make(f"shapechanger/{name}-v1")) as env:
        inner: Any = env.unwrapped
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape or (), np.float32))
        assert _measured(inner.data) == 0.0
        mujoco.mj_step(inner.model, inner.data)
        assert _measured(inner.data) > 0.0


def test_it_goes_on_without_the_fast_model() -> None:
    """Whoever wants Gymnasium's step has its measurements too."""
    with contextlib.closing(gym.make("shapechanger/Ant-v1", fast_model=False)) as env:
        inner: Any = env.unwrapped
        env.reset(seed=0)
        env.step(np.zeros(8, np.float32))
        assert _measured(inner.data) > 0.0


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("fast", [True, False])
def test_it_rests_in_a_vector_env_too(threads: int, fast: bool) -> None:
    """In every thread, and it goes on when the last of them is done."""
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


def test_it_goes_on_where_one_env_wants_it() -> None:
    """The others are measured too then: there is one for all."""
    makers = [partial(gym.make, "shapechanger/Ant-v1", fast_model=fast) for fast in (True, False)]
    with contextlib.closing(ThreadVectorEnv(makers)) as envs:
        datas: list[mujoco.MjData] = [env.unwrapped.data for env in cast("Any", envs.envs)]
        envs.reset(seed=0)
        envs.step(np.zeros((2, 8), np.float32))
        assert all(_measured(data) > 0.0 for data in datas)


def test_a_users_own_clock_goes_on(clocked: Callable[[], int]) -> None:
    """Who installs one wants to measure."""
    with contextlib.closing(gym.make("shapechanger/Ant-v1")) as env:
        env.reset(seed=0)
        before = clocked()
        env.step(np.zeros(8, np.float32))
        assert clocked() > before
        assert mujoco.get_mjcb_time() is not None


def test_a_clock_that_was_there_first_is_left_alone(clocked: Callable[[], int]) -> None:
    """The usual one is not known then."""
    paused_timer.cache_clear()
    try:
        assert not isinstance(paused_timer(), PausedTimer)
    finally:
        paused_timer.cache_clear()


def test_it_goes_on_when_the_last_of_several_threads_is_done() -> None:
    """And after an error."""
    clock = ctypes.c_void_p(4096)  # An address that nothing calls.
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
    assert clock.value is None  # The other is still inside.
    leave.set()
    other.join()
    assert clock.value == 4096


def test_there_is_a_way_to_it_here() -> None:
    """Else every step would be slower, and nobody would know."""
    assert isinstance(paused_timer(), PausedTimer)
