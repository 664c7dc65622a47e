"""How far a camera is off the place where its vehicle has it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import WorldError

__all__ = ["Jitter", "move_camera"]

# What screws, a printed mount and a bump leave: estimates, no measurement.
_HEIGHT_M: Final = 0.015
_SIDE_M: Final = 0.01
_ANGLE_RAD: Final = math.radians(3.0)

_LOWEST_M: Final = 0.01  # A lens is not in the floor.
_FARTHEST_M: Final = 1.0  # A camera that is farther from its vehicle is not on it.


@dataclass(frozen=True, slots=True)
class Jitter:
    """An error of a camera's pose.

    Attributes:
        up_m: Above its place, m.
        left_m: To the left of its place, m.
        roll_rad: About the line of sight; to the right is positive.
        pitch_rad: Down is positive.
        yaw_rad: To the left is positive.
    """

    up_m: float = 0.0
    left_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0

    @staticmethod
    def random(rng: np.random.Generator) -> Jitter:
        """Each uniform: within 1.5 cm of its height, 1 cm of its side, 3 degrees of each angle."""
        up, left = rng.uniform(-1.0, 1.0, 2) * (_HEIGHT_M, _SIDE_M)
        roll, pitch, yaw = rng.uniform(-_ANGLE_RAD, _ANGLE_RAD, 3)
        return Jitter(float(up), float(left), float(roll), float(pitch), float(yaw))


def move_camera(model: mujoco.MjModel, camera: str, jitter: Jitter) -> None:
    """Move a camera of a model from where it is now.

    Raises:
        WorldError: If it is no longer on its vehicle, or in the floor, or a number is none.
    """
    place = model.camera(camera)
    place.pos += (0.0, jitter.left_m, jitter.up_m)
    turns = jitter.roll_rad, jitter.pitch_rad, jitter.yaw_rad
    if not np.isfinite([*place.pos, *turns]).all():
        raise WorldError(f"A camera is off its place by finite numbers, got {jitter}.")
    if place.pos[2] < _LOWEST_M or np.abs(place.pos).max() > _FARTHEST_M:
        where = ", ".join(f"{x:.3f}" for x in place.pos)
        raise WorldError(f"The camera is outside the world: it would be at ({where}) m.")
    # A camera of MuJoCo looks along -z of its own frame, with x to the right and y up.
    turned = np.empty(4)
    for axis, angle in (
        ((0.0, 1.0, 0.0), jitter.yaw_rad),
        ((1.0, 0.0, 0.0), -jitter.pitch_rad),
        ((0.0, 0.0, 1.0), -jitter.roll_rad),
    ):
        turn = np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(axis), angle)
        mujoco.mju_mulQuat(turned, place.quat, turn)
        place.quat[:] = turned
