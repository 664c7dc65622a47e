"""Courses in MuJoCo: visual meshes with precomputed light, and hidden collision geoms."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import FLOODED, Colour, Course, Look
from shapechanger.vehicles.courses.surfaces import Surfaces
from shapechanger.vehicles.courses.textures import QuadMesh, texture

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
    slide = _GROUND_FRICTION.get(course.world, _DEFAULT_FRICTION)
    spec.worldbody.add_geom(
        name="world/ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0],  # Infinite.
        friction=[slide, 0.005, 0.0001], contype=_GROUND_TYPE, conaffinity=_GROUND_AFFINITY,
        group=_HIDDEN,
    )  # fmt: skip
    for number, wall in enumerate(course.walls):
        start, end = np.asarray(wall.start, float), np.asarray(wall.end, float)
        length = float(np.hypot(*(end - start)))
        along = (end - start) / length
        behind = np.array([along[1], -along[0]])
        x, y = 0.5 * (start + end) + 0.5 * _THICKNESS * behind
        half = 0.5 * wall.height
        size, place = [0.5 * length, 0.5 * _THICKNESS, half], [x, y, half]
        yaw = float(np.arctan2(along[1], along[0]))
        _add_solid(spec, f"world/wall/{number}", mujoco.mjtGeom.mjGEOM_BOX, size, place, yaw)
    for number, obstacle in enumerate(course.obstacles):
        half = 0.5 * obstacle.height
        shape, size = mujoco.mjtGeom.mjGEOM_BOX, [0.5 * obstacle.length, 0.5 * obstacle.width, half]
        if obstacle.is_round:
            shape, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [0.5 * obstacle.length, half, 0.0]
        place = [obstacle.x, obstacle.y, half]
        _add_solid(spec, f"world/thing/{number}", shape, size, place, obstacle.yaw)


def _add_solid(
    spec: mujoco.MjSpec,
    name: str,
    shape: mujoco.mjtGeom,
    size: list[float],
    place: list[float],
    yaw: float,
) -> None:
    spec.worldbody.add_geom(
        name=name, type=shape, size=size, pos=place,
        quat=[np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)],
        friction=[_WALL_FRICTION, 0.005, 0.0001], contype=_SOLID_TYPE, conaffinity=_SOLID_AFFINITY,
        group=_HIDDEN,
    )  # fmt: skip


# Texture of the ground in each world.
_GROUND: Final = {"corridor": "floor", "yard": "asphalt", "harbour": "sea", FLOODED: "water"}
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
    surfaces = Surfaces(course, look)
    mirrored = look.gloss > 0.0
    walls, plain = look.tone(look.wall), look.tone()

    def show(name: str, mesh: QuadMesh, colour: Colour) -> None:
        """Add a mesh with the texture of that name."""
        if mesh:
            picture = texture(name, look.texture_seed)
            _add_surface(spec, f"world/{name}", mesh, picture, colour, mirrored=mirrored)

    for surface, mesh in surfaces.walls().items():
        show(surface, mesh, walls)
    if course.ceiling_m > 0.0:
        show("ceiling", surfaces.ceiling(), plain)
    else:
        # The tone is in the texture, because MuJoCo does not light skyboxes.
        sky = (texture("sky", look.texture_seed) * np.array(plain)).astype(np.uint8)
        _add_texture(spec, "world/sky", sky, mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    if course.world == "yard":
        show("grass", surfaces.verges(), plain)
    if course.world == "harbour":
        from shapechanger.vehicles.courses.harbour import far_shore, fittings

        show("shore", far_shore(course), plain)
        show("harbour", fittings(course), plain)
    show("things", surfaces.obstacles(), plain)
    if course.lamps and course.ceiling_m > 0.0:
        # They stay bright in dim light, as they do for a camera.
        red, green, blue = (c ** (1.0 / 4.0) for c in plain)
        picture = texture("things", look.texture_seed)
        lamps = surfaces.lamps()
        _add_surface(spec, "world/lamps", lamps, picture, (red, green, blue), mirrored=mirrored)
    # The ground is last, because it is blended over the mirrored course.
    picture = texture(_GROUND.get(course.world, _DEFAULT_GROUND), look.texture_seed)
    ground, colour = surfaces.ground(), look.tone(look.ground)
    _add_surface(spec, "world/floor", ground, picture, colour, opacity=1.0 - look.gloss)


def _add_texture(
    spec: mujoco.MjSpec, name: str, picture: NDArray[np.uint8], kind: mujoco.mjtTexture
) -> None:
    height, width, channels = picture.shape
    texture = spec.add_texture(name=name, type=kind, height=height, width=width, nchannel=channels)
    texture.data = picture.tobytes()


def _add_surface(
    spec: mujoco.MjSpec,
    name: str,
    mesh: QuadMesh,
    picture: NDArray[np.uint8],
    colour: Colour,
    *,
    mirrored: bool = False,
    opacity: float = 1.0,
) -> None:
    """Add a visual mesh, without mass and collisions, lit by its own light only.

    MuJoCo has no brightness per vertex, but a normal. The only light shines straight up, so the
    normals are chosen for the brightness that they give, whatever the orientation of the patch.
    """
    _add_texture(spec, name, picture, mujoco.mjtTexture.mjTEXTURE_2D)
    material = spec.add_material(
        name=name, rgba=[*colour, opacity], emission=0.0, specular=0.0, shininess=0.0,
        reflectance=0.0,
    )  # fmt: skip
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    points, uvs, lights, triangles = mesh.arrays(mirrored)
    lean = np.clip(lights, 0.0, 1.0)
    normals = np.stack([np.sqrt(1.0 - lean * lean), np.zeros_like(lean), -lean], axis=1)
    spec.add_mesh(
        name=name,
        uservert=points.ravel(),
        usernormal=normals.ravel(),
        usertexcoord=uvs.ravel(),
        userface=triangles.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=name, contype=0,
        conaffinity=0, group=0, mass=0.0,
    )  # fmt: skip
