"""Step a world on a device and a CPU env from the same state."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import torch

import shapechanger
from shapechanger.envs.warp import WarpVectorEnv
from shapechanger.morphology import Mass, Stretch

# Bodies of each family that worlds take in turn: plain, named and edited ones.
BODIES: dict[str, list[Any]] = {
    "Ant": ["Ant", "BigAnt", "AmputatedAnt", [Stretch("shank_1", 1.5), Mass("torso", 1.3)]],
    "ExtendedAnt": ["ExtendedAnt", "ExtendedAnt"],
    "InvertedPendulum": ["SmallInvertedPendulum", "InvertedPendulum", "BigInvertedPendulum"],
    "InvertedDoublePendulum": [
        "InvertedDoublePendulum",
        [Stretch("pole", 1.5, axis="z"), Stretch("pole2", 0.8, axis="z")],
    ],
    "HalfCheetah": ["HalfCheetah", [Stretch("bshin", 1.3)]],
    "Hopper": ["Hopper", [Stretch("leg", 1.2)]],
    "Walker2d": ["Walker2d", [Mass("torso", 2.0)]],
    "Swimmer": ["Swimmer", [Stretch("mid", 1.4)]],
    "Humanoid": ["Humanoid", [Stretch("left_lower_arm", 1.2), Mass("torso", 1.3)]],
}

WORLDS = 8
# Device of the worlds in `test_exam.py`, such as cuda:0.
DEVICE = os.environ.get("SHAPECHANGER_TEST_DEVICE", "cpu")
# Infos that a device has after each step in addition to the CPU env's.
ALWAYS = {"final_obs", "final_info", "diverged"}

# The device computes in single precision. Over the five or fewer physics steps of an action, the
# largest differences in several hundred steps are 4e-5 for numbers of observations and 6e-6 for
# rewards, relative to 1 + the number.
OBSERVATION_TOLERANCE = 2e-4
REWARD_TOLERANCE = 5e-5

# On a GPU threads add the contact forces of a Humanoid in any order: 2.5e-4 on an H200.
HUMANOID_ON_A_GPU = 5e-4


def tolerance(worlds: WarpVectorEnv) -> float:
    on_a_gpu = not worlds.device.startswith("cpu")
    is_humanoid = worlds.made_from is not None and "Humanoid" in worlds.made_from.id
    return HUMANOID_ON_A_GPU if on_a_gpu and is_humanoid else OBSERVATION_TOLERANCE


def many(name: str, **arguments: Any) -> tuple[WarpVectorEnv, list[Any]]:
    """Return worlds on the device that take turns with the bodies of a family, and CPU envs."""
    turns = [BODIES[name][i % len(BODIES[name])] for i in range(WORLDS)]
    worlds = shapechanger.make_vec(
        name, WORLDS, backend="warp", device=DEVICE, bodies=turns, **arguments
    )
    alone = [
        gym.make(f"shapechanger/{name}-v1", body=body, **arguments).unwrapped for body in turns
    ]
    for env in alone:
        if env.model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            # A device has no PGS and uses Newton's.
            env.model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    return worlds, alone


def set_all(worlds: WarpVectorEnv, alone: Sequence[Any], states: Any) -> None:
    """Put worlds of one batch, and a CPU env per world, into states without warm starts.

    A state is `qpos` and `qvel`. Episodes of the worlds begin; the CPU envs have had a reset.
    """
    qpos = torch.tensor(np.array([q for q, _ in states]), dtype=torch.float32)
    qvel = torch.tensor(np.array([v for _, v in states]), dtype=torch.float32)
    worlds.reset()
    batch, everywhere = worlds.batches[0], torch.ones(len(alone), dtype=torch.bool, device=DEVICE)
    batch._clear(everywhere)
    batch.qpos[:], batch.qvel[:] = qpos, qvel
    batch._started(everywhere)
    for env, q, v in zip(alone, qpos.double().numpy(), qvel.double().numpy(), strict=True):
        mujoco.mj_resetData(env.model, env.data)
        env.set_state(q, v)


def visited(env: Any, rng: np.random.Generator, count: int) -> list[tuple[Any, Any]]:
    """Return states that a CPU env visits under random actions, some on the floor."""
    states: list[tuple[Any, Any]] = []
    env.reset(seed=int(rng.integers(1000)))
    while len(states) < count:
        for _ in range(6):
            env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32))
        if abs(env.data.qvel).max() > 50.0:
            env.reset()
        states.append((env.data.qpos.copy(), env.data.qvel.copy()))
    return states


def apart(found: Any, expected: Any) -> float:
    """Return the largest difference relative to 1 + the size; infinite numbers must be equal."""
    here = found.cpu() if isinstance(found, torch.Tensor) else found
    one, other = np.asarray(here, np.float64), np.asarray(expected, np.float64)
    assert one.shape == other.shape
    finite = np.isfinite(other)
    assert np.array_equal(one[~finite], other[~finite])
    found = np.abs(one[finite] - other[finite]) / (1.0 + np.abs(other[finite]))
    return float(found.max(initial=0.0))


def names_of(infos: dict[str, Any]) -> set[str]:
    return {name for name in infos if not name.startswith("_")} - ALWAYS
