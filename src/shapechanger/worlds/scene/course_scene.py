"""A course in a MuJoCo model: what is seen of it, and what can be touched."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from shapechanger.worlds.course import Course
from shapechanger.worlds.look import Look
from shapechanger.worlds.paint import texture
from shapechanger.worlds.paint.things import CELLS, ROWS
from shapechanger.worlds.scene.collision import add_collision
from shapechanger.worlds.scene.ground import (
    ceiling_patches,
    ground_patches,
    lamp_patches,
    verge_patches,
)
from shapechanger.worlds.scene.light import Light
from shapechanger.worlds.scene.patches import Patches, add_material, add_patches
from shapechanger.worlds.scene.things import thing_patches
from shapechanger.worlds.scene.walls import wall_patches

__all__ = ["add_course"]

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
    things = thing_patches(course, light)
    if course.ceiling_m > 0.0:
        show("ceiling", ceiling_patches(course, light), plain)
    else:
        _add_sky(spec, look)
    if course.world == "yard":
        show("grass", verge_patches(course, light), plain)
    show("things", things, plain)
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
