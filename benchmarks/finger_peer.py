"""Finger env in a separate process, stepped on demand: `finger_peer.py KIND`.

KIND is `ours` or `myosuite`. The process prints `ready`, its version and the duration of a step, s.
For each number of steps that it reads, it prints the CPU seconds they took, resets included. With
`myosuite` it does not import Shapechanger, so that it can run in another Python environment.
"""

from __future__ import annotations

import sys
import time
from importlib.metadata import version
from typing import Any

import numpy as np

WARM_UP = 300


def _make(kind: str) -> Any:
    if kind == "myosuite":
        from myosuite.utils import gym  # pyright: ignore[reportMissingImports]  # In a separate venv.

        return gym.make("myoFingerReachRandom-v0")
    import gymnasium

    import shapechanger  # noqa: F401 - Registers the ids.

    return gymnasium.make("shapechanger/Finger-v1")


def main() -> None:
    """Execute requests until standard input ends."""
    kind = sys.argv[1]
    env = _make(kind)
    env.reset(seed=0)
    dt = float(env.unwrapped.dt) if kind == "myosuite" else 1.0 / env.metadata["render_fps"]
    rng = np.random.default_rng(0)
    size = env.action_space.shape

    def step(count: int) -> float:
        actions = rng.uniform(-1.0, 1.0, (count, *size)).astype(np.float32)
        began = time.process_time()
        for action in actions:
            _, _, terminated, truncated, *_ = env.step(action)
            if terminated or truncated:
                env.reset()
        return time.process_time() - began

    step(WARM_UP)
    name = "myosuite" if kind == "myosuite" else "shapechanger"
    print("ready", version(name), dt, flush=True)
    for line in sys.stdin:
        print(step(int(line)), flush=True)


if __name__ == "__main__":
    main()
