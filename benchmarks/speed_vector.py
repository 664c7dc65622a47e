"""Speed of many ants stepped together, compared with bare physics and other libraries.

Each round runs both sides one after the other, and gives one ratio. If the states of the other side
can be set, it runs first, from the states of our envs; otherwise the order alternates.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

import shapechanger
from benchmarks.peer import Peer
from benchmarks.row import Row
from shapechanger.envs.stepping.fast_model import find_fast_model

ROUNDS = 31
# More rounds for wall-clock times, which vary more: other processes count too.
WALL_ROUNDS = 93
STEPS = 8
WARM_UP = 150
# Interpreter with EnvPool installed.
ENVPOOL_PYTHON = os.environ.get("SHAPECHANGER_ENVPOOL_PYTHON", sys.executable)
PEER = Path(__file__).with_name("vector_peer.py")

# State that an integration starts from, warm start of the solver included.
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class _Fleet:
    """Vector env of ants that have been moving for a while."""

    def __init__(self, num_envs: int, threads: int = 1) -> None:
        self.num_envs = num_envs
        self.envs = shapechanger.make_vec("Ant", num_envs, threads=threads)
        self.envs.reset(seed=0)
        self._rng = np.random.default_rng(0)
        for action in self.actions(WARM_UP):
            self.envs.step(action)

    def actions(self, steps: int) -> NDArray[np.float32]:
        """Return random actions for a number of steps."""
        return self._rng.uniform(-1.0, 1.0, (steps, self.num_envs, 8)).astype(np.float32)

    def bodies(self) -> list[tuple[Any, Any]]:
        """Return model and data of each ant."""
        return [(env.model, env.data) for env in _unwrapped(self.envs)]

    def put_into(self, others: list[tuple[Any, Any]]) -> None:
        """Copy the states of these ants into others."""
        for (model, data), (other_model, other_data) in zip(self.bodies(), others, strict=True):
            state = np.empty(mujoco.mj_stateSize(model, _STATE))
            mujoco.mj_getState(model, data, state, _STATE)
            mujoco.mj_setState(other_model, other_data, state, _STATE)


def _unwrapped(envs: Any) -> list[Any]:
    """Return the MuJoCo envs of a vector env."""
    return [env.unwrapped for env in envs.envs]


def _timed(work: Callable[[], object], clock: Callable[[], float]) -> float:
    began = clock()
    work()
    return clock() - began


def _paired(theirs: Callable[[], float], ours: Callable[[], float], rounds: int) -> list[float]:
    """Return the ratio of their time to ours of each round, sorted."""
    ratios: list[float] = []
    for number in range(rounds):
        if number % 2:
            our, their = ours(), theirs()
        else:
            their, our = theirs(), ours()
        ratios.append(their / our)
    return sorted(ratios)


def _row(name: str, ratios: list[float], target: float | None) -> Row:
    middle = statistics.median(ratios)
    spread = f"{ratios[0]:.2f} to {ratios[-1]:.2f} in {len(ratios)} rounds"
    if target is None:
        return Row(name, f"{middle:.2f}x", spread, "none", True)
    return Row(name, f"{middle:.2f}x", spread, f">= {target:g}x", middle >= target)


def _missing(name: str, why: str, target: float) -> Row:
    return Row(name, "not measured", why, f">= {target:g}x", False)


def against_physics(num_envs: int, *, fast: bool = False) -> Row:
    """Compare the CPU time of `mj_step(nstep=5)`, called from Python, with our step's.

    With `fast` the loop also steps the fast model, and the ratio shows the overhead beyond the
    physics.
    """
    fleet = _Fleet(num_envs)
    ant: Any = gym.make("Ant-v5").unwrapped
    model = ant.model
    if fast:
        one: Any = fleet.envs.envs[0].unwrapped
        model = cast("Any", find_fast_model(one.model, one.body_spec))
    bare = [(model, mujoco.MjData(model)) for _ in range(num_envs)]
    controls: list[Any] = [data.ctrl for _, data in bare]
    actions = fleet.actions(STEPS)

    def physics() -> float:
        fleet.put_into(bare)

        def work() -> None:
            step = mujoco.mj_step
            for row in actions:
                for (_, data), control, action in zip(bare, controls, row, strict=True):
                    control[:] = action
                    step(model, data, 5)

        return _timed(work, time.process_time)

    def ours() -> float:
        return _timed(lambda: [fleet.envs.step(row) for row in actions], time.process_time)

    ratios: list[float] = []
    for _ in range(ROUNDS):  # Physics first: it copies the states that our steps start from.
        actions = fleet.actions(STEPS)
        ratios.append(physics() / ours())
    fleet.envs.close()
    which = "mj_step loop on the fast model" if fast else "bare mj_step loop"
    return _row(
        f"Ant, N={num_envs}, 1 thread: {which} over ours, CPU",
        sorted(ratios),
        None if fast else 1.08,
    )


def against_sync(num_envs: int) -> Row:
    """Compare the CPU time of Gymnasium's `SyncVectorEnv` of Ant-v5 with ours."""
    fleet = _Fleet(num_envs)
    sync = gym.make_vec("Ant-v5", num_envs=num_envs, vectorization_mode="sync")
    sync.reset(seed=0)
    theirs = [(env.model, env.data) for env in _unwrapped(sync)]
    ratios: list[float] = []
    for _ in range(ROUNDS):
        actions = fleet.actions(STEPS)
        sync.reset()
        fleet.put_into(theirs)
        their = _timed(lambda: [sync.step(row) for row in actions], time.process_time)  # noqa: B023
        our = _timed(lambda: [fleet.envs.step(row) for row in actions], time.process_time)  # noqa: B023
        ratios.append(their / our)
    fleet.envs.close()
    sync.close()
    name = f"Ant, N={num_envs}, 1 thread: SyncVectorEnv of Ant-v5 over ours, CPU"
    return _row(name, sorted(ratios), 1.75)


def _peer(kind: str, num_envs: int, threads: int) -> Peer:
    """Start a vector env in another process."""
    python = ENVPOOL_PYTHON if kind == "envpool" else sys.executable
    return Peer([python, str(PEER), kind, str(num_envs), str(threads)])


def against_envpool() -> Row:
    """Compare the wall-clock time of EnvPool with ours, two threads each."""
    name = "Ant, N=128, 2 threads: EnvPool over ours, wall clock"
    peer = _peer("envpool", 128, 2)
    try:
        made_by, *_ = peer.ready()
    except RuntimeError as error:
        peer.close()
        return _missing(name, f"EnvPool does not start: {error}", 1.2)
    fleet = _Fleet(128, threads=2)

    def theirs() -> float:
        peer.begin(STEPS)
        return peer.seconds()

    def ours() -> float:
        actions = fleet.actions(STEPS)
        return _timed(lambda: [fleet.envs.step(row) for row in actions], time.perf_counter)

    ratios = _paired(theirs, ours, WALL_ROUNDS)
    peer.close()
    fleet.envs.close()
    return _row(f"{name} (EnvPool {made_by})", ratios, 1.2)


def against_processes() -> Row:
    """Compare two processes of 64 envs with one process of 128 envs and two threads."""
    # Both sides run in separate processes, so that neither is disturbed.
    peers = [_peer("ours", 64, 1) for _ in range(2)]
    threads = _peer("ours", 128, 2)
    for peer in (*peers, threads):
        peer.ready()

    def theirs() -> float:
        for peer in peers:
            peer.begin(STEPS)
        return max(peer.seconds() for peer in peers)

    def ours() -> float:
        threads.begin(STEPS)
        return threads.seconds()

    ratios = _paired(theirs, ours, WALL_ROUNDS)
    for peer in (*peers, threads):
        peer.close()
    return _row("Ant, N=128: two processes over two threads, wall clock", ratios, 0.92)


def memory() -> Row:
    """Measure the resident memory per env, of 1,024 envs."""
    command = [sys.executable, str(PEER), "memory", "1024", "1"]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    megabytes = float(run.stdout) / 1e6
    return Row(
        "Ant, N=1024: resident memory per env",
        f"{megabytes:.2f} MB",
        "one round",
        "<= 1 MB",
        megabytes <= 1.0,
    )


def vector() -> list[Row]:
    """Run all comparisons."""
    return [
        against_physics(32),
        against_physics(128),
        against_physics(32, fast=True),
        against_physics(128, fast=True),
        against_sync(32),
        against_sync(128),
        against_envpool(),
        against_processes(),
        memory(),
    ]


if __name__ == "__main__":
    for row in vector():
        print(row)
