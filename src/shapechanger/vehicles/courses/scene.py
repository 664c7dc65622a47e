"""Courses in MuJoCo: visual meshes with precomputed light, and hidden collision geoms."""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.bodies.visuals import add_lit_mesh
from shapechanger.vehicles.courses.course import FLOODED, Colour, Course, Look
from shapechanger.vehicles.courses.surfaces import QuadMesh, Surfaces, far_shore, fittings
from shapechanger.vehicles.courses.textures import texture

# Geoms collide if the contype of one shares a bit with the conaffinity of the other.
_SOLID: Final[dict[str, Any]] = {"contype": 1, "conaffinity": 2}
_GROUND_BITS: Final[dict[str, Any]] = {"contype": 4, "conaffinity": 8}

SOLID_GROUP: Final = 3
"""Group of the collision geoms; MuJoCo renders groups 0 to 2."""

# Thickness of a wall behind its visible side, m: thinner than a partition, and more than a vehicle
# moves in a step.
_THICKNESS: Final = 0.06
_WALL_FRICTION: Final = 0.3  # Friction of hulls on walls, an estimate.
# Texture of the ground and its sliding friction. Rubber on dry concrete has a friction of 0.6 to
# 0.85 (Engineering Toolbox, "Friction and Friction Coefficients"); yards are dusty.
_GROUND: Final = {
    "corridor": ("floor", 0.85),
    "yard": ("asphalt", 0.75),
    "harbour": ("sea", 0.8),
    FLOODED: ("water", 0.8),
}
# Clipping planes, m. The nearest object that a camera sees is the vehicle's own bonnet.
_NEAR, _FAR = 0.02, 150.0


def add_course(spec: mujoco.MjSpec, course: Course, look: Look) -> None:
    """Add a course to a model, with element names that start with "world/".

    There is one visual mesh per material, with precomputed light, because shadows and MuJoCo's
    reflections would take most of the time of a small image. The only light shines straight up
    (see `add_lit_mesh`). A glossy ground is a translucent sheet over a mirrored copy of the course.
    """
    spec.visual.headlight.active = 0
    spec.visual.quality.shadowsize = spec.visual.quality.offsamples = 0
    # The clipping planes are in units of the extent, which would depend on the course.
    spec.stat.extent = 1.0
    spec.visual.map.znear, spec.visual.map.zfar = _NEAR, _FAR
    spec.worldbody.add_light(
        name="world/light", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0.0, 0.0, 1.0],
        castshadow=False, ambient=[0.0] * 3, diffuse=[1.0] * 3, specular=[0.0] * 3,
    )  # fmt: skip
    _add_collision(spec, course)
    surfaces, plain = Surfaces(course, look), look.tone()

    def show(
        name: str, mesh: QuadMesh, colour: Colour, image: str = "", opacity: float = 1.0
    ) -> None:
        """Add a mesh, lit by its own light only, with a texture, by default the one of its name."""
        if not mesh:
            return
        name, image = f"world/{name}", image or name
        painted = texture(image, look.texture_seed)
        _add_texture(spec, name, painted, mujoco.mjtTexture.mjTEXTURE_2D)
        material = spec.add_material(
            name=name, rgba=(*colour, opacity), emission=0.0, specular=0.0, shininess=0.0,
            reflectance=0.0,
        )  # fmt: skip
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        points, uvs, lights, triangles = mesh.arrays(look.gloss > 0.0 and opacity == 1.0)
        add_lit_mesh(spec, name, points, np.clip(lights, 0.0, 1.0), uvs, triangles, axis=0)
        spec.worldbody.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=name, contype=0,
            conaffinity=0, group=0, mass=0.0,
        )  # fmt: skip

    for surface, mesh in surfaces.walls().items():
        show(surface, mesh, look.tone(look.wall))
    if course.ceiling_m > 0.0:
        show("ceiling", surfaces.ceiling(), plain)
    else:
        # The tone is in the texture, because MuJoCo does not light skyboxes.
        sky = (texture("sky", look.texture_seed) * np.array(plain)).astype(np.uint8)
        _add_texture(spec, "world/sky", sky, mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    if course.world == "yard":
        show("grass", surfaces.verges(), plain)
    if course.world == "harbour":
        show("shore", far_shore(course), plain)
        show("harbour", fittings(course), plain)
    show("things", surfaces.obstacles(), plain)
    if course.ceiling_m > 0.0:
        # Lamps stay bright in dim light, as for a real camera.
        red, green, blue = (c ** (1.0 / 4.0) for c in plain)
        show("lamps", surfaces.lamps(), (red, green, blue), "things")
    # The ground is last, because it is blended over the mirrored course.
    image, colour = _GROUND[course.world][0], look.tone(look.ground)
    show("floor", surfaces.ground(), colour, image, 1.0 - look.gloss)


def _add_collision(spec: mujoco.MjSpec, course: Course) -> None:
    """Add the collision geoms "world/ground", "world/wall/0" ... and "world/thing/0" ...."""
    spec.worldbody.add_geom(
        name="world/ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0],  # Infinite.
        friction=[_GROUND[course.world][1], 0.005, 0.0001], group=SOLID_GROUP, **_GROUND_BITS,
    )  # fmt: skip
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER

    def add(
        name: str, shape: mujoco.mjtGeom, size: list[float], place: list[float], yaw: float
    ) -> None:
        spec.worldbody.add_geom(
            name=name, type=shape, size=size, pos=place,
            quat=[np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)],
            friction=[_WALL_FRICTION, 0.005, 0.0001], group=SOLID_GROUP, **_SOLID,
        )  # fmt: skip

    for number, wall in enumerate(course.walls):
        _, along, length = wall.frame()
        x, y = 0.5 * np.add(wall.start, wall.end) + 0.5 * _THICKNESS * wall.behind()
        half, yaw = 0.5 * wall.height, float(np.arctan2(along[1], along[0]))
        size = [0.5 * length, 0.5 * _THICKNESS, half]
        add(f"world/wall/{number}", box, size, [x, y, half], yaw)
    for number, thing in enumerate(course.obstacles):
        half, place = 0.5 * thing.height, [thing.x, thing.y, 0.5 * thing.height]
        shape, size = box, [0.5 * thing.length, 0.5 * thing.width, half]
        if thing.is_round:
            shape, size = cylinder, [0.5 * thing.length, half, 0.0]
        add(f"world/thing/{number}", shape, size, place, thing.yaw)


def _add_texture(
    spec: mujoco.MjSpec, name: str, image: NDArray[np.uint8], kind: mujoco.mjtTexture
) -> None:
    height, width, channels = image.shape
    texture = spec.add_texture(name=name, type=kind, height=height, width=width, nchannel=channels)
    texture.data = image.tobytes()
