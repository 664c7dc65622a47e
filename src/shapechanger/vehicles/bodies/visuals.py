"""Visuals of vehicles: their colours, and the meshes that are seen from outside."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

Faces = NDArray[np.float64]
"""Corners of faces, m, (n, 4, 3), counter-clockwise seen from outside. A triangle repeats its last
corner."""

OWN_VIEW: Final = 1
"""Group of the geoms that only the vehicle's own camera sees."""

OUTSIDE_VIEW: Final = 2
"""Group of the geoms that are only seen from outside."""


Solids = tuple[Faces, NDArray[np.float64]]
"""Faces, and the texture coordinates of their corners, (n, 4, 2 or 3), or an empty array."""


@functools.cache
def read_obj(path: Path) -> Mapping[str, Mapping[str, Solids]]:
    """Read an OBJ file of triangles and quads: solids keyed by object and material."""
    numbers: dict[str, list[list[float]]] = {"v": [], "vt": []}
    objects: dict[str, dict[str, list[list[list[int]]]]] = {}
    materials, faces = dict[str, list[list[list[int]]]](), list[list[list[int]]]()
    for line in path.read_text("utf-8").splitlines():
        kind, _, rest = line.partition(" ")
        if kind in numbers:
            numbers[kind].append([float(word) for word in rest.split()])
        elif kind == "o":
            materials = objects[rest] = {}
        elif kind == "usemtl":
            faces = materials[rest] = []
        elif kind == "f":
            corners = [[int(i) - 1 for i in word.split("/")] for word in rest.split()]
            faces.append([*corners, corners[-1]][:4])
    points, uvs = np.array(numbers["v"]), np.array(numbers["vt"])

    def solids(faces: list[list[list[int]]]) -> Solids:
        at = np.array(faces)
        return points[at[..., 0]], uvs[at[..., -1]] if at.shape[2] > 1 else np.empty(0)

    return {
        name: {material: solids(faces) for material, faces in materials.items()}
        for name, materials in objects.items()
    }


_MESHES: Final = Path(__file__).parent / "meshes"
_COLOURS: Final = tomllib.loads(Path(__file__).with_name("colours.toml").read_text("utf-8"))


def normals(faces: Faces) -> NDArray[np.float64]:
    """Outward unit normal of each face, (n, 3)."""
    across = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    return across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)


def shading(faces: Faces) -> NDArray[np.float64]:
    """Brightness of each face under an open sky, 0 to 1, (n,); top faces are brightest."""
    x, y, up = normals(faces).T
    light = 0.72 + np.where(up > 0.0, 0.28, 0.4) * up
    return np.clip(light + (0.07 * x + 0.1 * y) * (1.0 - np.abs(up)), 0.05, 1.0)


# A shadow is a stack of ever smaller layers, so that its edge is soft.
_LAYERS, _LAYER_DARKNESS, _LAYER_RISE_M = 18, 0.055, 0.0002


def dress(spec: mujoco.MjSpec, vehicle: str, light: ArrayLike) -> None:
    """Add the shapes of a vehicle that are seen from outside: meshes, reflections and shadows.

    `light` is the red, green and blue of the light on the vehicle, each 0 to 1.
    """
    objects = read_obj(_MESHES / f"{vehicle}.obj")
    tints = {colour: np.asarray(light, float) * rgb for colour, rgb in _COLOURS.items()}
    for body in spec.bodies:
        ground_z = -float(body.pos[2])
        for colour, (faces, _) in objects.get(body.name, {}).items():
            below = faces[:, [0, 3, 2, 1]] * (1.0, 1.0, -1.0) + (0.0, 0.0, 2.0 * ground_z)
            both, bright = np.concatenate([faces, below]), np.tile(shading(faces), 2)
            material = _material(spec, f"{colour}/shaded", tints[colour])
            _add_shape(spec, body, f"{body.name}/{colour}", both, bright, material)
        for geom in list(body.geoms):
            if geom.classname.name == "shadow":
                faces = _shadow(tuple(geom.pos[:2]), tuple(geom.size[:2]), ground_z)
                material = _material(spec, "shadow", (0.0, 0.0, 0.0), alpha=_LAYER_DARKNESS)
                _add_shape(spec, body, f"{body.name}/shadow", faces, None, material)
                spec.delete(geom)
        if body.name.endswith(" wheel"):
            for colour, (faces, _) in objects["wheel"].items():
                name = f"{colour} of wheels"
                # All faces of a wheel are equally bright, so that rolling does not change them.
                material = _material(spec, f"{colour}/even", tints[colour], 0.85)
                _add_shape(spec, body, name, faces, None, material)
                # The reflection of a wheel belongs to the parent body, so it does not turn.
                mirrored = body.pos - (0.0, 0.0, 2.0 * body.geoms[0].size[0])
                _add_shape(spec, body.parent, name, faces, None, material, mirrored)


def _material(
    spec: mujoco.MjSpec, name: str, rgb: ArrayLike, emission: float = 0.0, alpha: float = 1.0
) -> str:
    """Add a matt material unless there is one of that name, and return the name."""
    if spec.material(name) is None:
        rgba = [*np.asarray(rgb), alpha]
        spec.add_material(name=name, rgba=rgba, emission=emission, specular=0.0, shininess=0.0)
    return name


def _add_shape(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    faces: Faces,
    brightness: NDArray[np.float64] | None,
    material: str,
    pos: ArrayLike = (0.0, 0.0, 0.0),
) -> None:
    """Add a geom without mass or collisions, and its mesh unless there is one of that name.

    `brightness` of each face is 0 to 1, (n,); None for shapes that emit their light.
    """
    if spec.mesh(name) is None:
        triangles = faces[:, [[0, 1, 2], [0, 2, 3]]]
        edges = triangles - np.roll(triangles, 1, axis=2)
        full = (edges != 0.0).any(axis=3).all(axis=2)  # A face of three corners is one triangle.
        points = triangles[full].reshape(-1, 3)
        given = np.zeros(len(faces)) if brightness is None else brightness
        light = np.repeat(np.broadcast_to(given[:, None], full.shape)[full], 3)
        # The texture coordinates are unused. Without them MuJoCo would ignore the given normals.
        uvs = np.zeros((len(points), 2))
        add_lit_mesh(spec, name, points, light, uvs, np.arange(len(points)), axis=1)
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material, pos=pos, mass=0.0,
        contype=0, conaffinity=0, group=OUTSIDE_VIEW,
    )  # fmt: skip


def add_lit_mesh(
    spec: mujoco.MjSpec,
    name: str,
    points: NDArray[np.float64],
    lights: NDArray[np.float64],
    uvs: NDArray[np.float64],
    triangles: NDArray[np.int64],
    *,
    axis: int,
) -> None:
    """Add a mesh with a brightness, 0 to 1, at each of its points, m.

    MuJoCo vertices have normals, but no brightness. Courses have one light, which shines straight
    up, so each normal is tilted until the light gives the wanted brightness. Normals tilt along
    `axis`, 0 (x) or 1 (y). A wheel rolls about y, so rolling does not change normals along y.
    """
    normals = np.zeros((len(points), 3))
    normals[:, axis], normals[:, 2] = np.sqrt(1.0 - lights * lights), -lights
    spec.add_mesh(
        name=name,
        uservert=points.ravel(),
        usernormal=normals.ravel(),
        usertexcoord=uvs.ravel(),
        userface=triangles.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )


@functools.cache
def _shadow(middle: tuple[float, float], half: tuple[float, float], ground_z: float) -> Faces:
    """Layers of the shadow of a rectangle on the ground, with round corners."""
    angle = np.linspace(0.0, 2.0 * np.pi, 28, endpoint=False)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    layers: list[Faces] = []
    for number, spread in enumerate(np.linspace(0.05, -0.02, _LAYERS)):
        flat = middle + np.sign(direction) * np.subtract(half, 0.03) + direction * (0.03 + spread)
        height = ground_z + 0.001 + _LAYER_RISE_M * number
        ring = np.column_stack([flat, np.full(len(flat), height)])
        first = np.broadcast_to(ring[0], (len(ring) - 2, 3))
        layers.append(np.stack([first, ring[1:-1], ring[2:], ring[2:]], axis=1))
    return np.concatenate(layers)
