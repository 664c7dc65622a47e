"""A picture of a vehicle as it stands, from outside, for reports and for the command line."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.vehicles import add_vehicle
from shapechanger.envs.picture import body_reach, draw

__all__ = ["draw_vehicle", "vehicle_reach"]

# The ground that it stands on: half of its side, m, and its colour on land and on water.
_GROUND_M: Final = 2.0
_LAND: Final = (0.62, 0.60, 0.56, 1.0)
_WATER: Final = (0.24, 0.40, 0.46, 1.0)


def vehicle_reach(vehicle: str) -> float:
    """How far from its middle the farthest point of a vehicle is, m.

    Raises:
        UnknownName: If there is no such vehicle.
    """
    model = _alone(vehicle)
    return body_reach(model, model.qpos0)


def draw_vehicle(vehicle: str, width: int, height: int, reach: float) -> NDArray[np.uint8]:
    """A vehicle on even ground, shape (height, width, 3), with `reach` metres around its middle.

    Raises:
        UnknownName: If there is no such vehicle.
        RenderError: If the size is no size, or there is nothing to draw with.
    """
    model = _alone(vehicle)
    return draw(model, model.qpos0, width, height, reach)


def _alone(vehicle: str) -> mujoco.MjModel:
    """A model of nothing but the vehicle and the ground."""
    spec = mujoco.MjSpec()
    model = add_vehicle(spec, vehicle)
    ground = spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE)
    ground.size = (_GROUND_M, _GROUND_M, 1.0)
    ground.rgba = _WATER if model.floats else _LAND
    return spec.compile()
