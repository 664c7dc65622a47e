"""A step of an env stays in few functions and few files."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger

_PACKAGE = str(Path(shapechanger.__file__).parent)
_STEPS = 20


@pytest.mark.parametrize(
    ("env_id", "arguments", "most_calls", "most_files"),
    [
        ("Ant", {}, 8, 2),
        ("Car", {"image": False, "state": True}, 151, 12),
        ("CarRanges", {}, 60, 11),
        ("Finger", {}, 48, 7),
    ],
)
def test_a_step_calls_few_functions(
    env_id: str, arguments: dict[str, Any], most_calls: int, most_files: int
) -> None:
    """Calls are Python calls in the package, and their number is the mean over 20 steps."""
    env = gym.make(f"shapechanger/{env_id}-v1", **arguments).unwrapped
    env.reset(seed=0)
    action = np.full(env.action_space.shape, 0.3, env.action_space.dtype)
    env.step(action)
    calls: Counter[str] = Counter()

    def count(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(_PACKAGE):
            calls[frame.f_code.co_filename] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        for _ in range(_STEPS):
            env.step(action)
    finally:
        sys.setprofile(before)
    env.close()
    assert calls.total() / _STEPS <= most_calls
    assert len(calls) <= most_files
