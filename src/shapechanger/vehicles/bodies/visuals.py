"""Looks of vehicles: their colours, and the meshes that are seen from outside."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

Faces = NDArray[np.float64]
"""Corners of faces, (n, 4, 3), m, counter-clockwise seen from outside; the last corner of a
triangle is there twice."""

OWN_VIEW: Final = 1
"""Group of the geoms that only the vehicle's own camera sees.

Policies are trained on its pictures, so these simple shapes stay as they are.
"""

OUTSIDE_VIEW: Final = 2
"""Group of the geoms that are only seen from outside."""


class Solids(NamedTuple):
    """Faces of one object and material of an OBJ file.

    Attributes:
        faces: Corners of the faces.
        uvs: Texture coordinates of the corners, (n, 4, 2); empty without any.
    """

    faces: Faces
    uvs: NDArray[np.float64]


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
    points, uvs = (np.array(numbers[kind]).reshape(-1, n) for kind, n in (("v", 3), ("vt", 2)))

    def solids(faces: list[list[list[int]]]) -> Solids:
        at = np.array(faces)
        return Solids(points[at[..., 0]], uvs[at[..., -1]] if at.shape[2] > 1 else np.empty(0))

    return {
        name: {material: solids(faces) for material, faces in materials.items()}
        for name, materials in objects.items()
    }


def read_mtl(path: Path) -> Mapping[str, tuple[float, float, float]]:
    """Read the colours of an MTL file: red, green and blue, each 0 to 1, by material."""
    blocks = path.read_text("utf-8").split("newmtl ")[1:]
    lines = (block.splitlines() for block in blocks)
    return {
        name: (float(r), float(g), float(b)) for name, kd in lines for _, r, g, b in [kd.split()]
    }


_MESHES: Final = Path(__file__).parent / "meshes"
_COLOURS: Final = read_mtl(_MESHES / "colours.mtl")


def normals(faces: Faces) -> NDArray[np.float64]:
    """Unit vectors outwards, (n, 3)."""
    across = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    return across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)


def shading(faces: Faces) -> NDArray[np.float64]:
    """Brightness of each face under an open sky, 0 to 1, (n,): the top is brightest."""
    x, y, up = normals(faces).T
    light = 0.72 + np.where(up > 0.0, 0.28, 0.4) * up
    return np.clip(light + (0.07 * x + 0.1 * y) * (1.0 - np.abs(up)), 0.05, 1.0)


class Paint:
    """Materials and meshes of a vehicle.

    Args:
        spec: Model that the materials are added to.
        vehicle: Name of the vehicle, whose meshes are in `meshes/`.
        light: Red, green and blue of the light on what is seen from outside, each 0 to 1.

    Attributes:
        spec: The model.
        meshes: Faces seen from outside, keyed by object, such as "wheel", and colour.
    """

    def __init__(
        self, spec: mujoco.MjSpec, vehicle: str, light: ArrayLike = (1.0, 1.0, 1.0)
    ) -> None:
        self.spec = spec
        self.meshes = read_obj(_MESHES / f"{vehicle}.obj")
        self._light = np.asarray(light, float)
        self._made: set[str] = set()

    def __call__(self, colour: str) -> str:
        """Name of a material for the own camera, emissive because courses have no lights."""
        rgba = [*_COLOURS[colour], 1.0]
        return self._add(colour, rgba=rgba, emission=0.6, specular=0.2, shininess=0.3)

    def lit(self, colour: str, *, turning: bool = False) -> str:
        """Name of a material for `_add_shape`, whose brightness is in the normals of its mesh.

        A `turning` part is equally bright in any direction.
        """
        rgba, name = [*self._light * _COLOURS[colour], 1.0], "even" if turning else "shaded"
        emission = 0.85 if turning else 0.0
        return self._add(
            f"{colour}/{name}", rgba=rgba, emission=emission, specular=0.0, shininess=0.0
        )

    def shadow(self) -> str:
        """Name of the material of one layer of a shadow."""
        rgba = [0.0, 0.0, 0.0, _LAYER_DARKNESS]
        return self._add("shadow", rgba=rgba, emission=0.0, specular=0.0, shininess=0.0)

    def _add(self, name: str, **properties: Any) -> str:
        material = f"vehicle/{name}"
        if material not in self._made:
            self.spec.add_material(name=material, **properties)
            self._made.add(material)
        return material


def _add_shape(
    body: mujoco.MjsBody,
    name: str,
    faces: Faces,
    brightness: NDArray[np.float64],
    material: str,
    paint: Paint,
    pos: ArrayLike = (0.0, 0.0, 0.0),
) -> None:
    """Add a visual mesh that is seen from outside only: without mass and collisions.

    Courses have one light, which shines straight up. So the normals are chosen for the brightness
    that they give, which turns about the vertical axis do not change. A brightness of 0 gives
    normals along y, so that a wheel's do not change as it rolls either.
    """
    if paint.spec.mesh(name) is None:
        triangles = faces[:, [[0, 1, 2], [0, 2, 3]]]
        edges = triangles - np.roll(triangles, 1, axis=2)
        full = (edges != 0.0).any(axis=3).all(axis=2)  # A face of three corners is one triangle.
        points = triangles[full].reshape(-1, 3)
        light = np.repeat(np.broadcast_to(brightness[:, None], full.shape)[full], 3)
        normals = np.stack([np.zeros_like(light), np.sqrt(1.0 - light * light), -light], axis=1)
        paint.spec.add_mesh(
            name=name,
            uservert=points.ravel(),
            usernormal=normals.ravel(),
            # Unused, but without them MuJoCo draws the faces with their own normals.
            usertexcoord=np.zeros(2 * len(points)),
            userface=np.arange(len(points)),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material, pos=pos, mass=0.0,
        contype=0, conaffinity=0, group=OUTSIDE_VIEW,
    )  # fmt: skip


def dress(body: mujoco.MjsBody, name: str, paint: Paint, *, ground_z: float = 0.0) -> None:
    """Add the object of this name, and its reflection in a glossy ground at `ground_z`, m."""
    for colour, (faces, _) in paint.meshes[name].items():
        below = faces[:, [0, 3, 2, 1]] * (1.0, 1.0, -1.0) + (0.0, 0.0, 2.0 * ground_z)
        both, light = np.concatenate([faces, below]), np.tile(shading(faces), 2)
        _add_shape(body, f"{body.name}/{colour}", both, light, paint.lit(colour), paint)


# A shadow is a stack of layers, each larger than the next, so that its edge is soft.
_LAYERS: Final = 18
_LAYER_DARKNESS: Final = 0.055
_LAYER_RISE_M: Final = 0.0002


def add_shadow(
    body: mujoco.MjsBody,
    low: tuple[float, float],
    high: tuple[float, float],
    paint: Paint,
    *,
    ground_z: float = 0.0,
) -> None:
    """Add a soft shadow of a rectangle on the ground, which is seen from outside only."""
    faces = _layers(low, high, ground_z)
    name = f"{body.name}/shadow"
    _add_shape(body, name, faces, np.zeros(len(faces)), paint.shadow(), paint)


@functools.cache
def _layers(low: tuple[float, float], high: tuple[float, float], ground_z: float) -> Faces:
    """Rectangles with round corners; see `add_shadow`."""
    middle, half = 0.5 * np.add(low, high), 0.5 * np.subtract(high, low)
    angle = np.linspace(0.0, 2.0 * np.pi, 28, endpoint=False)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    layers: list[Faces] = []
    for number, spread in enumerate(np.linspace(0.05, -0.02, _LAYERS)):
        flat = middle + np.sign(direction) * (half - 0.03) + direction * (0.03 + spread)
        height = ground_z + 0.001 + _LAYER_RISE_M * number
        ring = np.column_stack([flat, np.full(len(flat), height)])
        first = np.broadcast_to(ring[0], (len(ring) - 2, 3))
        layers.append(np.stack([first, ring[1:-1], ring[2:], ring[2:]], axis=1))
    return np.concatenate(layers)


def dress_wheel(wheel: mujoco.MjsBody, radius: float, paint: Paint) -> None:
    """Add tyre and rim of a wheel, which are seen from outside only; its axle is its y axis."""
    for colour, (faces, _) in paint.meshes["wheel"].items():
        name = f"vehicle/{colour} of wheels"
        dark, material = np.zeros(len(faces)), paint.lit(colour, turning=True)
        _add_shape(wheel, name, faces, dark, material, paint)
        # Its reflection does not turn.
        mirrored = wheel.pos - (0.0, 0.0, 2.0 * radius)
        _add_shape(wheel.parent, name, faces, dark, material, paint, mirrored)
