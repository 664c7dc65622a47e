"""Looks of vehicles: their colours, and what is seen of them from outside."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.vehicles.bodies.shapes import Faces, fan, loft, shading

OWN_VIEW: Final = 1
"""Group of the geoms that only the vehicle's own camera sees.

Policies are trained on its pictures, so these simple shapes stay as they are.
"""

OUTSIDE_VIEW: Final = 2
"""Group of the geoms that are only seen from outside."""

_COLOURS: Final = {
    "blue": (0.08, 0.20, 0.45),
    "brass": (0.55, 0.42, 0.15),
    "dark": (0.07, 0.07, 0.08),
    "deck": (0.58, 0.42, 0.24),
    "glass": (0.16, 0.20, 0.24),
    "green": (0.20, 0.27, 0.13),
    "grey": (0.32, 0.33, 0.34),
    "lamp": (0.95, 0.93, 0.80),
    "olive": (0.27, 0.33, 0.17),
    "orange": (0.85, 0.34, 0.06),
    "red": (0.62, 0.06, 0.05),
    "rim": (0.55, 0.55, 0.58),
    "scarlet": (0.80, 0.09, 0.07),
    "steel": (0.60, 0.62, 0.65),
    "track": (0.09, 0.09, 0.09),
    "tread": (0.13, 0.13, 0.13),
    "tyre": (0.05, 0.05, 0.05),
    "white": (0.86, 0.86, 0.84),
}


class Paint:
    """Makes materials.

    Args:
        spec: Model that the materials are added to.
        light: Red, green and blue of the light on what is seen from outside, each 0 to 1.

    Attributes:
        spec: The model.
    """

    def __init__(self, spec: mujoco.MjSpec, light: ArrayLike = (1.0, 1.0, 1.0)) -> None:
        self.spec = spec
        self._light = np.asarray(light, float)
        self._made: set[str] = set()

    def __call__(self, colour: str) -> str:
        """Name of a material for the own camera, emissive because courses have no lights."""
        rgba = [*_COLOURS[colour], 1.0]
        return self._add(colour, rgba=rgba, emission=0.6, specular=0.2, shininess=0.3)

    def shaded(self, colour: str) -> str:
        """Name of a material for `add_shape`, whose brightness is in the normals of its mesh."""
        rgba = [*self._light * _COLOURS[colour], 1.0]
        return self._add(f"{colour}/shaded", rgba=rgba, emission=0.0, specular=0.0, shininess=0.0)

    def even(self, colour: str) -> str:
        """Name of a material for `add_shape` on turning parts, equally bright in any direction."""
        rgba = [*self._light * _COLOURS[colour], 1.0]
        return self._add(f"{colour}/even", rgba=rgba, emission=0.85, specular=0.0, shininess=0.0)

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

    Args:
        body: Body to extend.
        name: Name of the mesh; one that exists is used again.
        faces: Faces, m, (n, 4, 3).
        brightness: Brightness of each face, 0 to 1, (n,).
        material: Name of its material.
        paint: Materials.
        pos: Its position, m.
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


def joined(solids: Iterable[tuple[str, Faces]]) -> Mapping[str, Faces]:
    """Join the faces of each colour."""
    by_colour: dict[str, list[Faces]] = {}
    for colour, faces in solids:
        by_colour.setdefault(colour, []).append(faces)
    return {colour: np.concatenate(parts) for colour, parts in by_colour.items()}


def dress(
    body: mujoco.MjsBody,
    solids: Mapping[str, Faces],
    paint: Paint,
    *,
    ground_z: float = 0.0,
) -> None:
    """Add what is seen of a body from outside, and its reflection in a glossy ground.

    Args:
        body: Body to extend.
        solids: Faces by colour, m, (n, 4, 3).
        paint: Materials.
        ground_z: Height of the ground in the frame of the body, m.
    """
    for colour, faces in solids.items():
        below = faces[:, [0, 3, 2, 1]] * (1.0, 1.0, -1.0) + (0.0, 0.0, 2.0 * ground_z)
        both, light = np.concatenate([faces, below]), np.tile(shading(faces), 2)
        _add_shape(body, f"{body.name}/{colour}", both, light, paint.shaded(colour), paint)


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
    """Add a soft shadow on the ground, which is seen from outside only.

    Args:
        body: Body to extend.
        low: x and y of a corner of the footprint, m.
        high: x and y of the opposite corner, m.
        paint: Materials.
        ground_z: Height of the ground in the frame of the body, m.
    """
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
        layers.append(fan(ring))
    return np.concatenate(layers)


_TYRE_SIDES: Final = 20
_SPOKES: Final = 5


def dress_wheel(
    wheel: mujoco.MjsBody, radius: float, width: float, paint: Paint, tyre: str
) -> None:
    """Add tyre and rim of a wheel, which are seen from outside only.

    Args:
        wheel: Body of the wheel, whose axle is its y axis.
        radius: Radius, m.
        width: Width, m.
        paint: Materials.
        tyre: "tyre", or "track" for a road wheel within a track.
    """
    for colour, faces in _wheel(radius, width, tyre == "track").items():
        name = f"vehicle/{colour} of wheels"
        dark, material = np.zeros(len(faces)), paint.even(colour)
        _add_shape(wheel, name, faces, dark, material, paint)
        # Its reflection does not turn.
        mirrored = wheel.pos - (0.0, 0.0, 2.0 * radius)
        _add_shape(wheel.parent, name, faces, dark, material, paint, mirrored)


@functools.cache
def _wheel(radius: float, width: float, inside: bool) -> Mapping[str, Faces]:
    """Faces of a wheel by colour, m; `inside` a track it is smaller."""
    outer, half = (0.74 * radius, 0.52 * width) if inside else (radius, 0.5 * width)
    angle = np.linspace(0.0, 2.0 * np.pi, 2 * _TYRE_SIDES, endpoint=False)

    def ring(share: float, y: float) -> NDArray[np.float64]:
        """Circle, counter-clockwise seen from the left."""
        x, z = -share * outer * np.cos(angle), share * outer * np.sin(angle)
        return np.stack([x, np.full(len(angle), y), z], axis=1)

    tread = loft([ring(1.0, -half), ring(1.0, half)], closed=False)
    sides = [ring(1.0, half), ring(0.64, half)], [ring(0.64, -half), ring(1.0, -half)]
    walls = [loft(pair, closed=False) for pair in sides]
    proud = half + 0.0006
    discs = [fan(ring(0.66, proud)), fan(ring(0.66, -proud)[::-1])]
    # Openings between the spokes: sectors of a slightly larger radius near the rim.
    openings: list[Faces] = []
    for start in np.arange(_SPOKES) * (len(angle) // _SPOKES):
        for y, way in ((proud + 0.0004, 1), (-proud - 0.0004, -1)):
            arc = slice(start, start + 5)
            corners = np.concatenate([ring(0.56, y)[arc], ring(0.24, y)[arc][::-1]])
            openings.append(fan(corners[::way]))
    tyre = [*walls, tread[::4], tread[1::4]]
    rim = "olive" if inside else "rim"
    return joined(
        [
            *(("tyre", faces) for faces in tyre),
            *(("tread", faces) for faces in (tread[2::4], tread[3::4])),
            *((rim, faces) for faces in discs),
            *(("dark", faces) for faces in openings),
        ]
    )
