"""A course in a MuJoCo model: what is seen of it, and what can be touched."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from shapechanger.worlds.course import Course
from shapechanger.worlds.look import Look
from shapechanger.worlds.paint import CELLS, ROWS, texture
from shapechanger.worlds.scene.patches import Patches, add_material, add_patches
from shapechanger.worlds.scene.surfaces import (
    Light,
    ceiling_patches,
    ground_patches,
    lamp_patches,
    obstacle_patches,
    verge_patches,
    wall_patches,
)

__all__ = [
    "GROUND_AFFINITY",
    "GROUND_TYPE",
    "HIDDEN",
    "SOLID_AFFINITY",
    "SOLID_TYPE",
    "add_collision",
    "add_course",
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
    for number, obstacle in enumerate(course.obstacles):
        half = 0.5 * obstacle.height
        _add_solid(
            spec,
            f"world/thing/{number}",
            mujoco.mjtGeom.mjGEOM_CYLINDER if obstacle.is_round else mujoco.mjtGeom.mjGEOM_BOX,
            [0.5 * obstacle.length, half, 0.0]
            if obstacle.is_round
            else [0.5 * obstacle.length, 0.5 * obstacle.width, half],
            [obstacle.x, obstacle.y, half],
            obstacle.yaw,
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


# What the ground of each world shows.
_GROUND: Final = {"corridor": "floor", "yard": "asphalt", "harbour": "water"}
_DEFAULT_GROUND: Final = "asphalt"
# What is nearer than the first, or farther than the second, is not drawn, m. The nearest that a
# camera a few centimetres above the ground sees is its own bonnet.
_NEAR: Final = 0.02
_FAR: Final = 150.0


def add_course(spec: mujoco.MjSpec, course: Course, look: Look) -> None:
    """Add a course to a model; the names of all its elements start with "world/".

    What is drawn is a mesh per material, with its light worked out beforehand: neither shadows nor
    MuJoCo's reflections, which take most of the time of a small picture. Its one lamp shines
    straight up, and only meshes made for it answer to that; a vehicle needs materials with
    `emission` 1. A glossy ground is a sheet through which the mirrored course is seen.

    Args:
        spec: The model; its headlight, its clipping planes and its smoothing are set.
        course: What to add.
        look: In which light and colours.
    """
    _set_camera(spec)
    add_collision(spec, course)
    light = Light(course, look)
    mirrored = look.gloss > 0.0
    walls, plain = look.tone(look.wall), look.tone()

    def show(name: str, patches: Patches, colour: tuple[float, float, float]) -> None:
        """Draw patches with the texture of that name."""
        if patches:
            add_material(spec, f"world/{name}", texture(name, look.texture_seed), colour)
            add_patches(spec, f"world/{name}", patches, f"world/{name}", mirrored)

    for surface, patches in wall_patches(course, light).items():
        show(surface, patches, walls)
    obstacles = obstacle_patches(course, light)
    if course.ceiling_m > 0.0:
        show("ceiling", ceiling_patches(course, light), plain)
    else:
        _add_sky(spec, look)
    if course.world == "yard":
        show("grass", verge_patches(course, light), plain)
    show("things", obstacles, plain)
    if course.lamps and course.ceiling_m > 0.0:
        _add_lamps(spec, course, look, mirrored)
    _add_ground(spec, course, look, light)


def _set_camera(spec: mujoco.MjSpec) -> None:
    """Let nothing but the light that was worked out be seen, from near to far."""
    spec.visual.headlight.active = 0
    spec.visual.quality.shadowsize = 0
    spec.visual.quality.offsamples = 0
    # The clipping planes are given in units of the extent, which would follow from the course.
    spec.stat.extent = 1.0
    spec.visual.map.znear = _NEAR
    spec.visual.map.zfar = _FAR
    spec.worldbody.add_light(
        name="world/light",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=[0.0, 0.0, 1.0],
        castshadow=False,
        ambient=[0.0, 0.0, 0.0],
        diffuse=[1.0, 1.0, 1.0],
        specular=[0.0, 0.0, 0.0],
    )


def _add_ground(spec: mujoco.MjSpec, course: Course, look: Look, light: Light) -> None:
    """The sheet that is seen; last, because it is drawn over what it mirrors."""
    name = _GROUND.get(course.world, _DEFAULT_GROUND)
    material = add_material(
        spec, "world/floor", texture(name, look.texture_seed), look.tone(look.ground)
    )
    material.rgba[3] = 1.0 - look.gloss
    add_patches(spec, "world/floor", ground_patches(course, light), "world/floor")


def _add_lamps(spec: mujoco.MjSpec, course: Course, look: Look, mirrored: bool) -> None:
    """Lamps stay bright when the light is dim, as they do before a camera."""
    row, column = divmod(CELLS["lamp"], ROWS)
    place = (np.array([column, row]) + 0.5) / ROWS
    colour = tuple(c ** (1.0 / 4.0) for c in look.tone())
    add_material(spec, "world/lamps", texture("things", look.texture_seed), colour)
    add_patches(spec, "world/lamps", lamp_patches(course, place), "world/lamps", mirrored)


def _add_sky(spec: mujoco.MjSpec, look: Look) -> None:
    """MuJoCo draws the sky as it is painted, so its colour is painted too."""
    picture = texture("sky", look.texture_seed) * np.array(look.tone())
    height, width, channels = picture.shape
    sky = spec.add_texture(
        name="world/sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        height=height,
        width=width,
        nchannel=channels,
    )
    sky.data = picture.astype(np.uint8).tobytes()
