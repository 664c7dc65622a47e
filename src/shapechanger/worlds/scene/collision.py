"""What a vehicle can touch: the ground, the walls and the things. None of it is drawn."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from shapechanger.worlds.course import Course

__all__ = [
    "GROUND_AFFINITY",
    "GROUND_TYPE",
    "HIDDEN",
    "SOLID_AFFINITY",
    "SOLID_TYPE",
    "add_collision",
]

# MuJoCo lets two geoms touch if the type of one has a bit in common with the affinity of the other.
SOLID_TYPE: Final = 1
SOLID_AFFINITY: Final = 2
GROUND_TYPE: Final = 4
GROUND_AFFINITY: Final = 8

HIDDEN: Final = 3
"""Group of the geoms that are not drawn; MuJoCo draws groups 0 to 2."""

# A wall is this thick, m, behind the side that is seen: thin enough not to come out on the far
# side of a partition, and thicker than a vehicle moves in a step.
_THICKNESS: Final = 0.06
# Sliding friction of rubber on dry concrete is 0.6 to 0.85 (Engineering Toolbox, "Friction and
# Friction Coefficients"); polished stone is swept, a yard dusty. Hulls slide along walls: a guess.
_GROUND_FRICTION: Final = {"corridor": 0.85, "yard": 0.75}
_DEFAULT_FRICTION: Final = 0.8
_WALL_FRICTION: Final = 0.3


def add_collision(spec: mujoco.MjSpec, course: Course) -> None:
    """Add "world/ground", "world/wall/0" and on, and "world/thing/0" and on."""
    body = spec.worldbody
    body.add_geom(
        name="world/ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 1.0],  # Without end.
        friction=[_GROUND_FRICTION.get(course.world, _DEFAULT_FRICTION), 0.005, 0.0001],
        contype=GROUND_TYPE,
        conaffinity=GROUND_AFFINITY,
        group=HIDDEN,
    )
    for number, wall in enumerate(course.walls):
        start, end = np.asarray(wall.start, float), np.asarray(wall.end, float)
        length = float(np.hypot(*(end - start)))
        if length <= 0.0:
            continue
        along = (end - start) / length
        behind = np.array([along[1], -along[0]])
        x, y = 0.5 * (start + end) + 0.5 * _THICKNESS * behind
        _add_solid(
            spec,
            f"world/wall/{number}",
            mujoco.mjtGeom.mjGEOM_BOX,
            [0.5 * length, 0.5 * _THICKNESS, 0.5 * wall.height],
            [x, y, 0.5 * wall.height],
            float(np.arctan2(along[1], along[0])),
        )
    for number, thing in enumerate(course.things):
        half = 0.5 * thing.height
        _add_solid(
            spec,
            f"world/thing/{number}",
            mujoco.mjtGeom.mjGEOM_CYLINDER if thing.is_round else mujoco.mjtGeom.mjGEOM_BOX,
            [0.5 * thing.length, half, 0.0]
            if thing.is_round
            else [0.5 * thing.length, 0.5 * thing.width, half],
            [thing.x, thing.y, half],
            thing.yaw,
        )


def _add_solid(
    spec: mujoco.MjSpec,
    name: str,
    shape: mujoco.mjtGeom,
    size: list[float],
    place: list[float],
    yaw: float,
) -> None:
    spec.worldbody.add_geom(
        name=name,
        type=shape,
        size=size,
        pos=place,
        quat=[np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)],
        friction=[_WALL_FRICTION, 0.005, 0.0001],
        contype=SOLID_TYPE,
        conaffinity=SOLID_AFFINITY,
        group=HIDDEN,
    )
