"""Speed of steps and frames of one env, compared with Gymnasium's.

Rounds are paired: in each, both envs take the same actions from the same state, in alternating
order, and give one ratio of CPU times. Resets are timed apart from steps.
"""

from __future__ import annotations

import copy
import statistics
import time
from collections.abc import Callable
from typing import Any, Final

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.row import Row
from shapechanger.envs.stepping.fast_model import find_fast_model
from shapechanger.envs.stepping.tuned import ModelWatch, paused_clock

ROUNDS: Final = 41
# Env steps per round: about 30 ms for either env.
ANT_STEPS: Final = 100
PENDULUM_STEPS: Final = 1000
# Simulation steps of one step of an ant.
ANT_SKIP: Final = 5
# More than the steps after which an env searches for a faster model.
WARM_UP: Final = 600
# Checks of a model per round.
CHECKS: Final = 200
FRAMES: Final = 60
SLOW_FRAMES: Final = 8
SIZE: Final[dict[str, Any]] = {"width": 128, "height": 128}
# Scale of actions small enough for the pole to stay up for a while.
_GENTLE: Final = 0.05


def single() -> list[Row]:
    """Compare single envs: steps, resets, each trick of a step, the search for one, and frames."""
    ant, ant_reset = _compared("Ant", ANT_STEPS, 1.0)
    pole, pole_reset = _compared("InvertedPendulum", PENDULUM_STEPS, _GENTLE)
    stock, _ = _compared("Ant", ANT_STEPS, 1.0, fast_model=False)
    plain_pole, _ = _compared("InvertedPendulum", PENDULUM_STEPS, _GENTLE, fast_model=False)
    return [
        _ratio_row("one Ant-v1 step against Ant-v5, CPU time", ant, 1.5),
        _ratio_row("the same with fast_model=False", stock, None),
        _ratio_row("one InvertedPendulum-v1 step against InvertedPendulum-v5, CPU time", pole, 1.3),
        _ratio_row("the same with fast_model=False", plain_pole, None),
        _ratio_row("one Ant-v1 reset against Ant-v5, CPU time", ant_reset, None),
        _ratio_row("one InvertedPendulum-v1 reset, for comparison", pole_reset, None),
        *_trick_rows(),
        _search_row(),
        *_frame_rows(),
    ]


def _compared(
    name: str, steps: int, reach: float, **arguments: Any
) -> tuple[list[float], list[float]]:
    """Return the ratios of Gymnasium's time to ours, sorted: for steps and for resets."""
    ours = gym.make(f"shapechanger/{name}-v1", **arguments)
    theirs = gym.make(f"{name}-v5")
    rng = np.random.default_rng(0)
    shape = ours.action_space.shape or ()
    of_steps: list[float] = []
    of_resets: list[float] = []
    with ours, theirs:
        for env in (ours, theirs):
            env.reset(seed=0)
            _step_s(env, list(np.zeros((WARM_UP, *shape), np.float32)), _state(ours))
        for number in range(ROUNDS):
            actions = list((reach * rng.uniform(-1.0, 1.0, (steps, *shape))).astype(np.float32))
            ours.reset(seed=number)
            start = _state(ours)
            pair = (ours, theirs) if number % 2 else (theirs, ours)
            stepped = {env: _step_s(env, actions, start) for env in pair}
            reset = {env: _cpu_s(lambda env=env: [env.reset() for _ in range(10)]) for env in pair}
            of_steps.append(stepped[theirs] / stepped[ours])
            of_resets.append(reset[theirs] / reset[ours])
    return sorted(of_steps), sorted(of_resets)


def _state(env: gym.Env[Any, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    inner: Any = env.unwrapped
    data = inner.data
    return data.qpos.copy(), data.qvel.copy()


def _step_s(
    env: gym.Env[Any, Any],
    actions: list[NDArray[np.float32]],
    start: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> float:
    """Return the CPU time of the steps, s; each new episode starts from the same state."""
    inner: Any = env.unwrapped
    env.reset()
    inner.set_state(*start)
    spent = 0.0
    began = time.thread_time()
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            spent += time.thread_time() - began
            env.reset()
            inner.set_state(*start)
            began = time.thread_time()
    return spent + time.thread_time() - began


def _cpu_s(work: Callable[[], object]) -> float:
    began = time.thread_time()
    work()
    return time.thread_time() - began


def _ratio_row(name: str, ratios: list[float], target: float | None) -> Row:
    median = statistics.median(ratios)
    return Row(
        name,
        f"{median:.2f}x",
        f"{ratios[0]:.2f} to {ratios[-1]:.2f} in {len(ratios)} paired rounds",
        "none" if target is None else f">= {target:g}x",
        target is None or median >= target,
    )


def _trick_rows() -> list[Row]:
    """Return the gain of each trick of an ant's step by itself."""
    clock = paused_clock()
    assert clock is not None, "A clock of a user is installed."
    with gym.make("shapechanger/Ant-v1") as env:
        inner: Any = env.unwrapped
        model = inner.model
        fast = find_fast_model(model, inner.body_spec)
    assert fast is not None
    flagged = copy.copy(model)
    flagged.opt.disableflags = fast.opt.disableflags
    plain, flags, pairs, paused = (
        _physics(model, _mj_step),
        _physics(flagged, _mj_step),
        _physics(fast, _mj_step),
        _physics(fast, clock.step),
    )
    watch = ModelWatch(model)
    arrays = [
        (getattr(owner, name).copy(), getattr(owner, name))
        for owner in (model, model.opt, model.stat)
        for name in dir(owner)
        if type(getattr(owner, name)) is np.ndarray and name != "tex_data"
    ]

    def by_memory(_: int) -> float:
        return _cpu_s(lambda: [watch.unedited() for _ in range(CHECKS)])

    def by_arrays(_: int) -> float:
        return _cpu_s(lambda: [all(np.array_equal(*two) for two in arrays) for _ in range(CHECKS)])

    return [
        _ratio_row("physics of Ant: MuJoCo's flags alone", _ratios(plain, flags), None),
        _ratio_row(
            "physics of Ant: contact pairs on top of the flags", _ratios(flags, pairs), None
        ),
        _ratio_row("physics of Ant: a paused clock on top of both", _ratios(pairs, paused), None),
        _ratio_row(
            "check of Ant's model: memory instead of arrays", _ratios(by_arrays, by_memory), None
        ),
    ]


def _ratios(slow: Callable[[int], float], quick: Callable[[int], float]) -> list[float]:
    """Return the ratios of two CPU times in paired rounds, sorted; both get the round's number."""
    found: list[float] = []
    for number in range(-1, ROUNDS):
        pair = (slow, quick) if number % 2 else (quick, slow)
        took = {work: work(number + 1) for work in pair}
        found.append(took[slow] / took[quick])
    return sorted(found[1:])  # The first warms up.


def _physics(
    model: mujoco.MjModel, step: Callable[[mujoco.MjModel, mujoco.MjData, int], None]
) -> Callable[[int], float]:
    """Return a function of a seed that returns the CPU time of an episode's physics, s."""
    data = mujoco.MjData(model)

    def episode(seed: int) -> float:
        mujoco.mj_resetData(model, data)
        actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (ANT_STEPS, model.nu))
        began = time.thread_time()
        for action in actions:
            data.ctrl[:] = action
            step(model, data, ANT_SKIP)
        return time.thread_time() - began

    return episode


def _mj_step(model: mujoco.MjModel, data: mujoco.MjData, frame_skip: int) -> None:
    mujoco.mj_step(model, data, frame_skip)
    mujoco.mj_rnePostConstraint(model, data)


def _search_row() -> Row:
    """Return the time to find the fast model of a new body."""
    times: list[float] = []
    with gym.make("shapechanger/Ant-v1") as env:
        inner: Any = env.unwrapped
        for _ in range(15):
            times.append(1e3 * _cpu_s(lambda: find_fast_model(inner.model, inner.body_spec)))
    times.sort()
    return Row(
        "finding the fast model of Ant, once a body, CPU time",
        f"{statistics.median(times):.1f} ms",
        f"{times[0]:.1f} to {times[-1]:.1f} ms in {len(times)} rounds",
        "none",
        True,
    )


def _frame_rows() -> list[Row]:
    """Return frames per second, from the CPU time of all threads including the driver's."""
    plain = _frame_ms(gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **SIZE), FRAMES)
    theirs = _frame_ms(gym.make("Ant-v5", render_mode="rgb_array", **SIZE), SLOW_FRAMES)
    median = statistics.median(plain)
    return [
        Row(
            "frames of Ant-v1 at 128x128, one core",
            f"{1e3 / median:.0f} frames/s",
            f"{plain[0]:.1f} to {plain[-1]:.1f} ms in {len(plain)} frames",
            ">= 150 frames/s",
            1e3 / median >= 150.0,
        ),
        Row(
            "the same of Ant-v5",
            f"{1e3 / statistics.median(theirs):.0f} frames/s",
            f"{theirs[0]:.1f} to {theirs[-1]:.1f} ms in {len(theirs)} frames",
            "none",
            True,
        ),
    ]


def _frame_ms(env: gym.Env[Any, Any], frames: int) -> list[float]:
    """Return the CPU time of each frame, ms, sorted; the body moves in between."""
    times: list[float] = []
    with env:
        env.reset(seed=0)
        env.action_space.seed(0)
        env.render()  # The first makes the context.
        for _ in range(frames):
            env.step(env.action_space.sample())
            began = time.process_time()
            env.render()
            times.append(1e3 * (time.process_time() - began))
    return sorted(times)
