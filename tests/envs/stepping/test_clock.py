"""MuJoCo's profiling clock is paused while ants and single pendulums step fast, and only then."""

import ctypes
from collections.abc import Iterator
from contextlib import closing
from threading import Event, Thread
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

import shapechanger
from shapechanger.envs.stepping.tuned import PausedClock, paused_clock


def measured(data: mujoco.MjData) -> float:
    return float(data.timer.duration[int(mujoco.mjtTimer.mjTIMER_STEP)])


@pytest.fixture
def user_clock() -> Iterator[list[float]]:
    """Install a clock of a user, and return the list of its readings."""
    readings: list[float] = []
    mujoco.set_mjcb_time(lambda: readings.append(0.0) or float(len(readings)))
    yield readings
    mujoco.set_mjcb_time(None)


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("name", ["Ant", "InvertedPendulum"])
def test_the_clock_pauses_during_fast_steps_alone(name: str, fast: bool) -> None:
    with closing(gym.make(f"shapechanger/{name}-v1", fast_model=fast)) as env:
        inner: Any = env.unwrapped
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape or (), np.float32))
        assert (measured(inner.data) == 0.0) is fast
        mujoco.mj_step(inner.model, inner.data)
        assert measured(inner.data) > 0.0


@pytest.mark.parametrize("threads", [1, 2])
def test_the_clock_pauses_in_vector_envs(threads: int) -> None:
    with closing(shapechanger.make_vec("Ant", 4, threads=threads)) as envs:
        inner: list[Any] = [env.unwrapped for env in envs.envs]
        envs.reset(seed=0)
        for _ in range(3):
            envs.step(np.zeros((4, 8), np.float32))
        assert [measured(env.data) for env in inner] == [0.0] * 4
        mujoco.mj_step(inner[0].model, inner[0].data)
        assert measured(inner[0].data) > 0.0


def test_a_clock_of_a_user_keeps_running(user_clock: list[float]) -> None:
    with closing(gym.make("shapechanger/Ant-v1")) as env:
        env.reset(seed=0)
        before = len(user_clock)
        env.step(np.zeros(8, np.float32))
        assert len(user_clock) > before
    paused_clock.cache_clear()
    try:
        assert paused_clock() is None
    finally:
        paused_clock.cache_clear()


def test_the_clock_runs_again_after_the_last_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stays paused while any thread steps; a step that raises counts as ended."""
    clock = ctypes.c_void_p(4096)  # A made-up address, which is never called.
    paused, inside, leave = PausedClock(clock), Event(), Event()
    blank: Any = None

    def stay(*_: Any) -> None:
        inside.set()
        leave.wait()

    def fail(*_: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(mujoco, "mj_step", stay)
    monkeypatch.setattr(mujoco, "mj_rnePostConstraint", lambda *_: None)
    other = Thread(target=paused.step, args=(blank, blank, 1))
    other.start()
    inside.wait()
    monkeypatch.setattr(mujoco, "mj_step", fail)
    with pytest.raises(ZeroDivisionError):
        paused.step(blank, blank, 1)
    assert clock.value is None
    leave.set()
    other.join()
    assert clock.value == 4096


def test_the_clock_can_be_paused_here() -> None:
    """Otherwise steps would be slower without notice."""
    assert isinstance(paused_clock(), PausedClock)
