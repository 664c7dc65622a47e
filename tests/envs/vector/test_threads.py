"""Threads of vector envs: errors, interruptions and termination."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger
from shapechanger.envs.vector import ThreadVectorEnv
from shapechanger.envs.vector.threads import EnvThreads


class _Plain(gym.Env[Any, Any]):
    """Env that counts its steps, or raises a given exception."""

    observation_space = gym.spaces.Box(-np.inf, np.inf, (1,), np.float64)
    action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, raises: BaseException | None = None) -> None:
        self.raises = raises
        self.steps = 0
        self.thread: int | None = None
        self.threads: list[int] = []

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        self.threads.append(threading.get_ident())
        return np.zeros(1), {}

    def render(self) -> Any:
        self.threads.append(threading.get_ident())

    def close(self) -> None:
        self.threads.append(threading.get_ident())

    def step(self, action: Any) -> Any:
        self.thread = threading.get_ident()
        if self.raises is not None:
            raise self.raises
        self.steps += 1
        return np.full(1, float(self.steps)), 0.0, False, False, {}


def _plain(raising: dict[int, BaseException], threads: int = 2) -> tuple[Any, list[_Plain]]:
    members = [_Plain(raising.get(i)) for i in range(4)]
    makers: list[Callable[[], _Plain]] = [lambda one=one: one for one in members]
    envs = ThreadVectorEnv(makers, threads=threads)
    envs.reset()
    return envs, members


def _ours() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "shapechanger-vector"]


def _wait_until(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < until
        threading.Event().wait(0.01)


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize("failing", [[0], [1, 2], [3]])
def test_an_error_names_the_first_env_and_the_others_finish(
    failing: list[int], threads: int
) -> None:
    envs, members = _plain({i: RuntimeError("it broke") for i in failing}, threads)
    with pytest.raises(RuntimeError, match="it broke") as caught:
        envs.step(np.zeros((4, 1)))
    assert caught.value.__notes__ == [f"This was raised by env {failing[0]} of the vector env."]
    assert [one.steps for one in members] == [int(i not in failing) for i in range(4)]
    with pytest.raises(gym.error.ResetNeeded):
        envs.step(np.zeros((4, 1)))
    for number in failing:
        members[number].raises = None
    envs.reset()
    envs.step(np.zeros((4, 1)))
    envs.close()


@pytest.mark.parametrize("number", [0, 3])
def test_an_interruption_leaves_the_envs_usable(number: int) -> None:
    """After KeyboardInterrupt in any thread, a reset restores the vector env."""
    envs, members = _plain({number: KeyboardInterrupt()})
    with pytest.raises(KeyboardInterrupt):
        envs.step(np.zeros((4, 1)))
    members[number].raises = None
    envs.reset()
    *_, infos = envs.step(np.zeros((4, 1)))
    assert infos == {}
    envs.close()
    assert _ours() == []


def test_all_calls_run_in_the_thread_of_the_env() -> None:
    """Steps, resets, renders, calls and `close` stay in one thread, as OpenGL requires."""
    envs, members = _plain({})
    envs.step(np.zeros((4, 1)))
    homes = [one.thread for one in members]
    for number in range(4):
        mask = np.arange(4) == number
        envs.reset(options={"reset_mask": mask})
        envs.reset(options={"reset_mask": mask, "body": "another"})
    envs.render()
    envs.call("render")
    envs.close()
    for home, one in zip(homes, members, strict=True):
        assert one.threads == [home] * 6
    assert len({*homes}) == 2


def test_envs_whose_physics_steps_separately_are_called_in_the_callers_thread() -> None:
    envs = shapechanger.make_vec("InvertedPendulum", 3, threads=2)
    envs.reset(seed=0)
    envs.set_attr("thread", threading.get_ident)
    assert set(envs.call("thread")) == {threading.get_ident()}
    envs.close()


def test_only_resets_that_change_bodies_take_turns() -> None:
    meeting, working = threading.Barrier(2, timeout=5.0), threading.Lock()

    class Timed(_Plain):
        def reset(self, *, seed: Any = None, options: Any = None) -> Any:
            if "body" not in options:
                meeting.wait()
            else:
                assert working.acquire(blocking=False)
                threading.Event().wait(0.1)
                working.release()
            return np.zeros(1), {}

    envs = ThreadVectorEnv([Timed, Timed], threads=2)
    envs.reset(options={"speed": 1.0})
    envs.reset(options={"body": "another"})
    envs.close()


def test_one_thread_draws_all_windows() -> None:
    class Shown(_Plain):
        render_mode = "human"

    envs = ThreadVectorEnv([Shown, Shown], threads=2)
    assert (envs.render_mode, envs.threads) == ("human", 1)
    envs.close()


def test_threads_that_have_ended_are_replaced() -> None:
    pool, done = EnvThreads(2, 2), []
    pool.do(done.append, range(2))
    (worker,) = _ours()
    pool._workers[0].inbox.put(None)
    worker.join()
    pool.do(done.append, range(2))
    assert sorted(done) == [0, 0, 1, 1]
    pool.stop()


@pytest.mark.parametrize(("asked", "started"), [(1, 0), (2, 1), (3, 2), (9, 2)])
def test_the_number_of_threads_is_as_requested(asked: int, started: int) -> None:
    """The caller's thread counts, and there are at most as many threads as envs.

    Daemon threads do not keep a program from its exit.
    """
    envs = shapechanger.make_vec("InvertedPendulum", 3, threads=asked)
    envs.reset(seed=0)
    assert [thread.daemon for thread in _ours()] == [True] * started
    envs.close()
    assert _ours() == []


def test_an_unclosed_vector_env_leaves_no_threads() -> None:
    envs = shapechanger.make_vec("InvertedPendulum", 3, threads=2)
    envs.reset(seed=0)
    assert len(_ours()) == 1
    del envs
    gc.collect()
    _wait_until(lambda: _ours() == [])


@pytest.mark.parametrize("presses_once", [True, False])
def test_an_interruption_waits_for_the_threads_and_a_second_one_does_not(
    presses_once: bool,
) -> None:
    """After Ctrl-C, work that has begun is finished; a second Ctrl-C abandons a hanging thread."""
    pool, hold, working = EnvThreads(2, 2), threading.Event(), threading.Event()
    finished: list[int] = []
    presses = 0

    def work(number: int) -> None:
        if number:
            working.set()
            hold.wait()
            finished.append(number)

    def press() -> None:
        # On a slow machine, two signals can arrive as one, so keep sending.
        nonlocal presses
        working.wait()
        while presses == 0 or not (presses_once or pool.lost):
            presses += 1
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            threading.Event().wait(0.2)
        if presses_once:
            hold.set()

    presser = threading.Thread(target=press)
    presser.start()
    with pytest.raises(KeyboardInterrupt):
        pool.do(work, range(2))
    assert finished == ([1] if presses_once else [])
    presser.join()
    assert bool(pool.lost) is not presses_once
    assert presses_once or presses >= 2
    hold.set()
    pool.stop()
    _wait_until(lambda: _ours() == [])


_SCRIPT = """
import os, signal, sys, threading
import numpy as np, shapechanger
envs = shapechanger.make_vec("Ant", 8, threads=2)
envs.reset(seed=0)
actions = np.zeros((8, 8), np.float32)
{body}
"""


def _run(body: str) -> subprocess.CompletedProcess[str]:
    script = _SCRIPT.format(body=textwrap.dedent(body))
    return subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False
    )


@pytest.mark.system
def test_ctrl_c_at_random_moments() -> None:
    """Thirty interruptions at random moments of steps leave the vector env usable."""
    run = _run(
        """
        import random, time
        random.seed(0)
        main = threading.main_thread().ident
        hits = 0
        for _ in range(30):
            wait = random.uniform(0.0, 0.01)
            def press():
                time.sleep(wait)
                signal.pthread_kill(main, signal.SIGINT)
            presser = threading.Thread(target=press)
            try:
                presser.start()
                while True:
                    envs.step(actions)
            except KeyboardInterrupt:
                hits += 1
            presser.join()
            assert not envs.closed
            envs.reset()
        envs.step(actions)
        envs.close()
        print(hits, threading.active_count())
        """
    )
    assert (run.stdout, run.stderr) == ("30 1\n", "")


@pytest.mark.system
@pytest.mark.parametrize("end", ["sys.exit(0)", "pass"], ids=["exit", "end"])
def test_a_program_exits_without_close(end: str) -> None:
    """Unclosed vector envs neither block the exit nor print anything."""
    run = _run(f"envs.step(actions)\n{end}")
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.system
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_a_forked_process_steps_with_threads_of_its_own() -> None:
    run = _run(
        """
        envs.step(actions)
        child = os.fork()
        if child == 0:
            envs.step(actions)
            print(threading.active_count(), flush=True)
            os._exit(0)
        os.waitpid(child, 0)
        """
    )
    assert run.stdout == "2\n"
