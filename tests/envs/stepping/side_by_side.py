"""Bitwise comparison of two envs under the same actions."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from shapechanger.envs.ant import LEGS
from shapechanger.morphology import (
    Body,
    Cut,
    Damping,
    Friction,
    Gear,
    JointRange,
    Lock,
    Mass,
    Remove,
    Stiffness,
    Stretch,
)


def same(ours: Any, theirs: Any) -> bool:
    """Return whether two results of `step` or `reset` have equal bits, types and keys."""
    if isinstance(ours, dict):
        return ours.keys() == theirs.keys() and all(same(ours[key], theirs[key]) for key in ours)
    if isinstance(ours, tuple | list):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    one, other = np.asarray(ours), np.asarray(theirs)
    return one.dtype == other.dtype and one.tobytes() == other.tobytes()


def step_together(
    ours: gym.Env[Any, Any], theirs: gym.Env[Any, Any], steps: int, seed: int, reach: float = 1.0
) -> tuple[int, int]:
    """Step two envs with the same random actions; reset both at an end and after each 400 steps.

    Returns:
        Number of these resets, and of steps with contacts.
    """
    rng = np.random.default_rng(seed)
    shape = ours.action_space.shape
    ends = touches = 0
    assert same(ours.reset(seed=seed), theirs.reset(seed=seed))
    for step in range(steps):
        action = (reach * rng.uniform(-1.0, 1.0, shape)).astype(np.float32)
        one, other = ours.step(action), theirs.step(action)
        assert same(one, other), f"step {step}"
        for name in ("qpos", "qvel", "qacc_warmstart", "cfrc_ext", "xpos", "time"):
            mine, its = (getattr(env.unwrapped.data, name) for env in (ours, theirs))
            assert same(mine, its), f"{name} in step {step}"
        touches += ours.unwrapped.data.ncon > 0
        if one[2] or one[3] or step % 400 == 399:
            assert same(ours.reset(), theirs.reset())
            ends += 1
    return ends, touches


def random_ant(seed: int) -> Body:
    """Return an ant with random limbs, masses, gears, dampings and frictions."""
    rng = np.random.default_rng(seed)
    edits: list[Any] = []
    for leg in LEGS:
        edits.append(Stretch(f"shank_{leg}", rng.uniform(0.3, 2.5)))
        edits.append(Mass(f"shank_{leg}", scale=rng.uniform(0.3, 3.0)))
        edits.append(Gear(f"hip_{leg}", scale=rng.uniform(0.3, 2.0)))
    edits.append(Damping("ankle_*", scale=rng.uniform(0.1, 3.0)))
    edits.append(Friction("floor", scale=rng.uniform(0.2, 3.0)))
    if seed % 3 == 1:
        edits.append(Cut("shank_4", rng.uniform(0.2, 0.8)))
    if seed % 4 == 2:
        edits.append(Remove("aux_2"))
    if seed % 5 == 3:
        edits.append(Lock("ankle_3"))
    if seed % 2:
        edits.append(Stiffness("hip_*", to=rng.uniform(0.1, 5.0)))
    else:
        edits.append(JointRange("hip_1", -0.2, rng.uniform(0.1, 1.0)))
    return tuple(edits)


def random_pendulum(seed: int) -> Body:
    """Return a pole of random length and mass on a cart with a random drive."""
    rng = np.random.default_rng(seed)
    return (
        Stretch("pole", rng.uniform(0.3, 3.0), axis="z"),
        Mass("pole", scale=rng.uniform(0.3, 3.0)),
        Damping("hinge", scale=rng.uniform(0.1, 3.0)),
        Gear("slide", scale=rng.uniform(0.3, 2.0)),
    )
