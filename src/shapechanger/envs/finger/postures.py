"""Postures that a finger can hold, and the points that it reaches with them."""

from __future__ import annotations

import functools
import math
import threading
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import NOMINAL, build_finger, drive_of
from shapechanger.embodiments.finger.anatomy import (
    DIP_BY_PIP,
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
)
from shapechanger.embodiments.finger.balance import hold

__all__ = ["can_hold", "draw_posture", "draw_start", "joint_torque", "moving_torque"]

# Of its range, how far a joint stays from either end.
_MARGIN: Final = 0.1
# The end joint follows the middle one to within this, rad. Chosen.
_COUPLING_SPREAD: Final = math.radians(8.0)
# A flexed finger hardly spreads: of the range of abduction, what is left at full flexion. Chosen.
_SPREAD_LEFT: Final = 0.3
# rad/s. Friction turns over with the motion rather than jumping.
_STICKS_BELOW: Final = 0.1
# Of the rest posture, how far starts are, rad.
_START_SPREAD: Final = 0.1
# Data of each thread: envs in other threads ask, too, and to make it takes longer than to use it.
_own: Final = threading.local()


def draw_posture(rng: np.random.Generator) -> NDArray[np.float64]:
    """Angles, rad, (4,), away from every limit, that the nominal finger can hold."""
    low, high = _inner_range()
    while True:
        flexion, abduction, middle = rng.uniform(low[:3], high[:3])
        share = 1.0 - (1.0 - _SPREAD_LEFT) * max(flexion, 0.0) / float(JOINT_RANGE[0, 1])
        abduction *= share
        end = DIP_BY_PIP * middle + rng.uniform(-_COUPLING_SPREAD, _COUPLING_SPREAD)
        angles = np.array([flexion, abduction, middle, end]).clip(low, high)
        if can_hold(angles):
            return angles


def draw_start(rng: np.random.Generator) -> NDArray[np.float64]:
    """Angles, rad, (4,), near those of a finger at rest."""
    low, high = _inner_range()
    return np.clip(JOINT_REST + rng.uniform(-_START_SPREAD, _START_SPREAD, 4), low, high)


def can_hold(angles: NDArray[np.float64]) -> bool:
    """Whether tensions in their range hold the nominal finger at these angles, rad, (4,)."""
    torque = moving_torque(angles, np.zeros(4), np.zeros(4))
    return hold(MOMENT_ARMS, torque, LEAST_TENSION_N, MOST_TENSION_N)[1]


def moving_torque(
    angles: NDArray[np.float64], speed: NDArray[np.float64], acceleration: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What the tendons must give about each joint for a motion, N·m, (4,).

    Against inertia, weight, passive tissue and friction.

    Args:
        angles: rad, (4,).
        speed: rad/s, (4,).
        acceleration: rad/s², (4,).
    """
    model = _nominal()
    if not hasattr(_own, "data"):
        _own.data = mujoco.MjData(model)
    return joint_torque(model, _own.data, angles, speed, acceleration)


def joint_torque(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    angles: NDArray[np.float64],
    speed: NDArray[np.float64],
    acceleration: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The same for another finger whose tendons do not stretch; `data` is overwritten."""
    data.qpos[:] = angles
    data.qvel[:] = speed
    mujoco.mj_forward(model, data)
    inertial = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, inertial, acceleration)
    friction = model.dof_frictionloss * np.tanh(speed / _STICKS_BELOW)
    return inertial + data.qfrc_bias - data.qfrc_passive + friction


def _inner_range() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = JOINT_RANGE.T
    inner = _MARGIN * (high - low)
    return low + inner, high - inner


@functools.cache
def _nominal() -> mujoco.MjModel:
    return build_finger(NOMINAL, drive_of("tension", NOMINAL)).compile()
