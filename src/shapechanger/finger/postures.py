"""Postures of the nominal finger: sampling, inverse kinematics and the torques they need."""

from __future__ import annotations

import functools
import threading
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.finger.anatomy import DIP_BAND, DIP_BY_PIP, JOINT_RANGE, JOINT_REST
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.task import fingertip, fingertip_jacobian
from shapechanger.finger.tensions import drive_of

# Smallest distance of a drawn angle from either end, as a fraction of the range of its joint.
_MARGIN: Final = 0.1
# Share of the abduction range that is left at full flexion, chosen small.
_SPREAD_LEFT: Final = 0.3
# Scale of the speed, rad/s, over which friction changes its sign smoothly.
_STICKS_BELOW: Final = 0.1
START_SPREAD: Final = 0.1
"""Largest distance of a joint from its rest angle at the start, rad."""
# Each thread reuses its own MjData, because envs run in threads and creating MjData is slow.
_own: Final = threading.local()


def draw_posture(rng: np.random.Generator) -> NDArray[np.float64]:
    """Sample angles, rad, (4,), away from every limit, that the nominal finger can hold."""
    low, high = inner_range()
    flexion, abduction, middle = rng.uniform(low[:3], high[:3])
    off = rng.uniform(-DIP_BAND, DIP_BAND)
    return np.array(coupled(flexion, abduction, middle, off)).clip(low, high)


def coupled(flexion: Any, abduction: Any, middle: Any, off: Any) -> tuple[Any, Any, Any, Any]:
    """Return joint angles, rad, arrays or tensors, that the tissue of a finger allows.

    `abduction` is the abduction of a straight knuckle; flexion reduces it. `off` is the difference
    of the end joint from its coupled angle. The nominal finger can hold the result if it is within
    `inner_range`.
    """
    share = 1.0 - (1.0 - _SPREAD_LEFT) * flexion.clip(0.0) / float(JOINT_RANGE[0, 1])
    return flexion, abduction * share, middle, DIP_BY_PIP * middle + off


def draw_start(rng: np.random.Generator) -> NDArray[np.float64]:
    """Sample angles, rad, (4,), near the angles of a finger at rest."""
    low, high = inner_range()
    return np.clip(JOINT_REST + rng.uniform(-START_SPREAD, START_SPREAD, 4), low, high)


def moving_torque(
    angles: NDArray[np.float64], speed: NDArray[np.float64], acceleration: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the torques, N·m, that a motion of the nominal finger needs; see `joint_torque`."""
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
    """Return the torques, N·m, (4,), that a motion of a finger with stiff tendons needs.

    The torques balance inertia, weight, passive tissue and friction. Angles are in rad, speeds in
    rad/s and accelerations in rad/s², (4,) each; `data` is overwritten.
    """
    data.qpos[:] = angles
    data.qvel[:] = speed
    mujoco.mj_forward(model, data)
    inertial = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, inertial, acceleration)
    friction = model.dof_frictionloss * np.tanh(speed / _STICKS_BELOW)
    return inertial + data.qfrc_bias - data.qfrc_passive + friction


def inner_range() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and highest angles of drawn starts and targets, rad, (4,) each."""
    low, high = JOINT_RANGE.T
    inner = _MARGIN * (high - low)
    return low + inner, high - inner


@functools.cache
def _nominal() -> mujoco.MjModel:
    return build_finger(NOMINAL, drive_of("tension", NOMINAL)).compile()


_STEPS: Final = 60
# Error at which the search ends, m, far below the tolerance of any task.
_CLOSE_ENOUGH_M: Final = 1e-6
# Weight of the preference that the end joint follows the middle one, m/rad, relative to reaching
# the point.
_PREFERENCE: Final = 1e-3
_DAMPING: Final = 1e-3
# Steps shorter than this end the search for preferred angles, rad.
_SETTLED_RAD: Final = 1e-3
_MOST_STEP_RAD: Final = 0.5
# Factors by which the damping grows after a worse step, and falls after a better one.
_GROWS: Final = 4.0
_FALLS: Final = 16.0
# Error, m, above which the search is repeated from a hyperextended, half flexed and flexed finger.
_FAR_M: Final = 1e-5
_STARTS: Final = tuple(
    np.array([low + share * (high - low), 0.0, *(share * JOINT_RANGE[2:, 1])])
    for low, high in JOINT_RANGE[:1]
    for share in (0.1, 0.5, 0.9)
)


def angles_for(
    place: NDArray[np.float64], near: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], float]:
    """Return joint angles whose fingertip is closest to a point: inverse kinematics.

    The search takes damped Gauss-Newton steps within the joints' ranges from the angles `near`,
    rad, (4,), by default at rest. Among the angles for a point, m, (3,), angles near the start with
    the end joint within the band of the hood are preferred. The second result is the distance of
    the fingertip from the point, m.
    """
    best = _search(place, JOINT_REST if near is None else near)
    if best[1] > _FAR_M:
        # The point is out of reach, or the search ended in a local minimum.
        others = (_search(place, start) for start in _STARTS)
        best = min((best, *others), key=lambda found: found[1])
    return best


def _search(
    place: NDArray[np.float64], start: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the angles, rad, (4,), at the end of a search from `start`, and their error, m."""
    low, high = JOINT_RANGE.T
    q = np.clip(start, low, high)
    coupling = np.array([[0.0, 0.0, -DIP_BY_PIP, 1.0]])
    preference = _PREFERENCE
    error = place - fingertip(q)
    damping, settled = _DAMPING, False
    for step in range(_STEPS):
        if step == _STEPS // 3 or settled:
            preference = 0.0  # A preference must not keep the fingertip off the point.
        if preference == 0.0 and float(np.linalg.norm(error)) < _CLOSE_ENOUGH_M:
            break
        off = coupling @ q
        beyond = off - np.clip(off, -DIP_BAND, DIP_BAND)
        weight = preference if beyond.any() else 0.0
        rows = [fingertip_jacobian(q), weight * coupling, damping * np.eye(4)]
        goal = [error, -weight * beyond, np.zeros(4)]
        free = np.ones(4, bool)
        change = np.zeros(4)
        # A joint that would leave its range stays at its limit, and the others compensate.
        for _ in range(4):
            matrix = np.concatenate(rows)[:, free]
            change[:] = 0.0
            change[free] = np.linalg.lstsq(matrix, np.concatenate(goal), rcond=None)[0]
            stuck = free & (((q <= low) & (change < 0.0)) | ((q >= high) & (change > 0.0)))
            if not stuck.any():
                break
            free &= ~stuck
        settled = float(np.abs(change).max()) < _SETTLED_RAD
        next_q = np.clip(q + np.clip(change, -_MOST_STEP_RAD, _MOST_STEP_RAD), low, high)
        next_error = place - fingertip(next_q)
        # Out of reach, full steps oscillate around the closest angles.
        if preference == 0.0 and next_error @ next_error > error @ error:
            damping *= _GROWS
            continue
        gained = float(np.linalg.norm(error) - np.linalg.norm(next_error))
        damping = max(damping / _FALLS, _DAMPING)
        q, error = next_q, next_error
        if (
            preference == 0.0
            and gained < _CLOSE_ENOUGH_M * 1e-2
            and damping <= _GROWS * _FALLS * _DAMPING
        ):
            break
    return q, float(np.linalg.norm(error))
