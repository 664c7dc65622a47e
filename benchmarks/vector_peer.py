"""Vector env in a separate process, stepped on demand: `vector_peer.py KIND N THREADS`.

KIND is `ours`, `envpool` or `memory`. The process prints `ready` and its version; for each number
of steps that it reads, it prints the seconds they took. `memory` prints the resident memory per
env, in bytes, once. With `envpool` it does not import Shapechanger, so that it can run in another
Python environment.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

WARM_UP = 150


def _resident() -> int:
    """Return the resident memory of this process, bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


def _make(kind: str, num_envs: int, threads: int) -> Any:
    if kind == "envpool":
        import envpool  # pyright: ignore[reportMissingImports]  # In a separate venv.

        return envpool.make_gymnasium(
            "Ant-v5", num_envs=num_envs, batch_size=num_envs, num_threads=threads, seed=0
        )
    import shapechanger

    return shapechanger.make_vec("Ant", num_envs, threads=threads)


def _stepping(envs: Any, num_envs: int) -> Callable[[int], float]:
    """Return a function that takes random steps and returns the seconds they took."""
    rng = np.random.default_rng(0)

    def step(count: int) -> float:
        actions = rng.uniform(-1.0, 1.0, (count, num_envs, 8)).astype(np.float32)
        began = time.perf_counter()
        for action in actions:
            envs.step(action)
        return time.perf_counter() - began

    return step


def main() -> None:
    """Execute requests until standard input ends."""
    kind, num_envs, threads = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    if kind == "memory":
        import shapechanger

        shapechanger.make_vec(
            "Ant", 1
        ).reset()  # Load what all envs share, so that it is not counted.
    before = _resident()
    envs = _make(kind, num_envs, threads)
    if kind == "envpool":
        envs.reset()
    else:
        envs.reset(seed=0)
    step = _stepping(envs, num_envs)
    if kind == "memory":
        step(30)
        print((_resident() - before) / num_envs, flush=True)
        return
    step(WARM_UP)
    print("ready", version("envpool" if kind == "envpool" else "shapechanger"), flush=True)
    for line in sys.stdin:
        print(step(int(line)), flush=True)


if __name__ == "__main__":
    main()
