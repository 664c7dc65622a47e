"""A course in a MuJoCo model: visual meshes and hidden collision geoms."""

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

# Two geoms collide if the contype of one shares a bit with the conaffinity of the other.
_SOLID_TYPE: Final = 1
_SOLID_AFFINITY: Final = 2
_GROUND_TYPE: Final = 4
_GROUND_AFFINITY: Final = 8

_HIDDEN: Final = 3
"""Group of the collision geoms; MuJoCo renders groups 0 to 2."""

# Thickness of a wall behind its visible side, m: thinner than a partition, and more than a vehicle
# moves in a step.
_THICKNESS: Final = 0.06
# Sliding friction of rubber on dry concrete is 0.6 to 0.85 (Engineering Toolbox, "Friction and
# Friction Coefficients"); yards are dusty. Friction of hulls on walls is a guess.
_GROUND_FRICTION: Final = {"corridor": 0.85, "yard": 0.75}
_DEFAULT_FRICTION: Final = 0.8
_WALL_FRICTION: Final = 0.3


def _add_collision(spec: mujoco.MjSpec, course: Course) -> None:
    """Add the collision geoms "world/ground", "world/wall/0" ... and "world/thing/0" ...."""
    body = spec.worldbody
    body.add_geom(
        name="world/ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 1.0],  # Infinite.
        friction=[_GROUND_FRICTION.get(course.world, _DEFAULT_FRICTION), 0.005, 0.0001],
        contype=_GROUND_TYPE,
        conaffinity=_GROUND_AFFINITY,
        group=_HIDDEN,
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
        contype=_SOLID_TYPE,
        conaffinity=_SOLID_AFFINITY,
        group=_HIDDEN,
    )


# Texture of the ground in each world.
_GROUND: Final = {"corridor": "floor", "yard": "asphalt", "harbour": "water"}
_DEFAULT_GROUND: Final = "asphalt"
# Clipping planes, m. The nearest object that a camera sees is the vehicle's own bonnet.
_NEAR: Final = 0.02
_FAR: Final = 150.0


def add_course(spec: mujoco.MjSpec, course: Course, look: Look) -> None:
    """Add a course to a model, with element names that start with "world/".

    There is one visual mesh per material, with precomputed light, because shadows and MuJoCo's
    reflections would take most of the time of a small picture. The only light shines straight up,
    and only these meshes have normals made for it; vehicles need emissive materials. A glossy
    ground is a translucent sheet over a mirrored copy of the course.

    Args:
        spec: Model to extend; its headlight, clipping planes and antialiasing are set.
        course: The course.
        look: Light and colours.
    """
    _set_camera(spec)
    _add_collision(spec, course)
    light = Light(course, look)
    mirrored = look.gloss > 0.0
    walls, plain = look.tone(look.wall), look.tone()

    def show(name: str, patches: Patches, colour: tuple[float, float, float]) -> None:
        """Add patches with the texture of that name."""
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
    """Set the light, the clipping planes and the quality."""
    spec.visual.headlight.active = 0
    spec.visual.quality.shadowsize = 0
    spec.visual.quality.offsamples = 0
    # The clipping planes are in units of the extent, which would depend on the course.
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
    """Add the visible ground; last, because it is blended over the mirrored course."""
    name = _GROUND.get(course.world, _DEFAULT_GROUND)
    material = add_material(
        spec, "world/floor", texture(name, look.texture_seed), look.tone(look.ground)
    )
    material.rgba[3] = 1.0 - look.gloss
    add_patches(spec, "world/floor", ground_patches(course, light), "world/floor")


def _add_lamps(spec: mujoco.MjSpec, course: Course, look: Look, mirrored: bool) -> None:
    """Add the lamps, which stay bright in dim light, as they do for a camera."""
    row, column = divmod(CELLS["lamp"], ROWS)
    place = (np.array([column, row]) + 0.5) / ROWS
    colour = tuple(c ** (1.0 / 4.0) for c in look.tone())
    add_material(spec, "world/lamps", texture("things", look.texture_seed), colour)
    add_patches(spec, "world/lamps", lamp_patches(course, place), "world/lamps", mirrored)


def _add_sky(spec: mujoco.MjSpec, look: Look) -> None:
    """Add the sky, with its tone in the texture, because MuJoCo does not light skyboxes."""
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
