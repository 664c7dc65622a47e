"""Quadrilateral patches, collected into one mesh per material, and solids made of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.paint import CELLS, ROWS

Array = NDArray[np.float64]

# The corners of a patch are counter-clockwise seen from its front.
_TRIANGLES: Final = np.array([[0, 1, 2], [0, 2, 3]])
# A mirrored patch has the opposite order.
_MIRRORED: Final = np.array([[0, 2, 1], [0, 3, 2]])
_DOWN: Final = np.array([1.0, 1.0, -1.0])


@dataclass(slots=True)
class Patches:
    """Patches with texture coordinates and light.

    Each has four corners, counter-clockwise seen from its front; its back is invisible. Texture
    coordinates are u to the right and v down, from 0 to 1.
    """

    _corners: list[Array] = field(default_factory=list[Array])
    _places: list[Array] = field(default_factory=list[Array])
    _lights: list[Array] = field(default_factory=list[Array])

    def add(self, corners: Array, places: Array, lights: Array | float = 1.0) -> None:
        """Add n patches.

        Args:
            corners: Corners, m, (n, 4, 3).
            places: Texture coordinates of the corners, (n, 4, 2).
            lights: Brightness of each corner, 0 to 1, (n, 4); or of all of them.
        """
        self._corners.append(corners)
        self._places.append(places)
        self._lights.append(np.broadcast_to(np.asarray(lights, float), corners.shape[:2]))

    def __bool__(self) -> bool:
        return bool(self._corners)

    def arrays(self, mirrored: bool) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Points, m, (m, 3), texture coordinates, (m, 2), lights, (m,), and triangles, (k, 3).

        Args:
            mirrored: Whether to add a copy mirrored below the ground, for a glossy ground.
        """
        points = np.concatenate(self._corners).reshape(-1, 3)
        places = np.concatenate(self._places).reshape(-1, 2)
        lights = np.concatenate(self._lights).reshape(-1)
        first = np.arange(0, len(points), 4)[:, None, None]
        triangles = (first + _TRIANGLES).reshape(-1, 3)
        if mirrored:
            below = (first + len(points) + _MIRRORED).reshape(-1, 3)
            triangles = np.concatenate([triangles, below])
            points = np.concatenate([points, points * _DOWN])
            places, lights = np.tile(places, (2, 1)), np.tile(lights, 2)
        return points, places, lights, triangles


def add_material(
    spec: mujoco.MjSpec, name: str, picture: NDArray[np.uint8], colour: tuple[float, float, float]
) -> mujoco.MjsMaterial:
    """Add a material whose only light is that of `add_patches`.

    Args:
        spec: Model to extend.
        name: Name of the material and the texture.
        picture: The texture, (H, W, 3).
        colour: Factors on red, green and blue.
    """
    height, width, channels = picture.shape
    texture = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        height=height,
        width=width,
        nchannel=channels,
    )
    texture.data = picture.tobytes()
    material = spec.add_material(
        name=name, rgba=[*colour, 1.0], emission=0.0, specular=0.0, shininess=0.0, reflectance=0.0
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    return material


def add_patches(
    spec: mujoco.MjSpec, name: str, patches: Patches, material: str, mirrored: bool = False
) -> None:
    """Add patches as a visual mesh, without mass and collisions.

    MuJoCo has no brightness per vertex, but a normal. The only light shines straight up, so the
    normals are chosen for the brightness that they give, whatever the orientation of the patch.

    Args:
        spec: Model to extend.
        name: Name of the mesh and the geom.
        patches: The patches.
        material: Name of their material.
        mirrored: Whether to add a copy mirrored below the ground.
    """
    points, places, lights, triangles = patches.arrays(mirrored)
    lean = np.clip(lights, 0.0, 1.0)
    normals = np.stack([np.sqrt(1.0 - lean * lean), np.zeros_like(lean), -lean], axis=1)
    spec.add_mesh(
        name=name,
        uservert=points.ravel(),
        usernormal=normals.ravel(),
        usertexcoord=places.ravel(),
        userface=triangles.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=material,
        contype=0,
        conaffinity=0,
        group=0,
        mass=0.0,
    )


# Margin of a texture cell, so that its neighbours do not bleed into it at a distance.
_INSET: Final = 0.08
_SIDES: Final = 10
# Corners of a cube from -1 to 1: four sides and the top, counter-clockwise from the lower left.
_BOX: Final = np.array(
    [
        [(1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)],
        [(1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1)],
        [(-1, 1, -1), (-1, -1, -1), (-1, -1, 1), (-1, 1, 1)],
        [(-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)],
        [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
    ],
    float,
)
_BOX_LIGHT: Final = np.array([0.9, 0.75, 0.7, 0.85, 1.0])
_FOOT: Final = 0.75


def add_box(
    patches: Patches, middle: Array, half: Array, yaw: float, stuff: str, light: float
) -> None:
    """Add an upright box.

    Args:
        patches: Patches to extend.
        middle: Its centre, m, (3,).
        half: Half sizes, m, (3,).
        yaw: Rotation about the vertical axis, rad.
        stuff: Cell of the texture.
        light: Brightness, 0 to 1.
    """
    corners = _turned(_BOX * half, yaw) + middle
    lights = np.repeat(_BOX_LIGHT[:, None], 4, axis=1) * light
    lights[:4, :2] *= _FOOT
    patches.add(corners, np.tile(_cell(stuff, _square()), (5, 1, 1)), lights)


def add_turned(
    patches: Patches, x: float, y: float, profile: Array, stuff: str, light: float
) -> None:
    """Add a solid of revolution.

    Args:
        patches: Patches to extend.
        x: Position of its axis, m.
        y: Position of its axis, m.
        profile: Radius and height from below, m, (n, 2).
        stuff: Cell of the texture.
        light: Brightness, 0 to 1.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.empty((len(profile), _SIDES + 1, 3))
    points[..., :2] = profile[:, None, :1] * ring + (x, y)
    points[..., 2] = profile[:, None, 1]
    rise = profile[:, 1] - profile[0, 1]
    places = np.empty((len(profile), _SIDES + 1, 2))
    places[..., 0] = np.abs(2.0 * angle / (2.0 * np.pi) - 1.0)
    places[..., 1] = 1.0 - (rise / max(float(rise[-1]), 1e-6))[:, None]
    lights = np.empty((len(profile), _SIDES + 1, 1))
    lights[..., 0] = light * (0.82 + 0.18 * np.cos(angle - 0.7))
    lights[0] *= _FOOT
    patches.add(grid_cells(points), _cell(stuff, grid_cells(places)), grid_cells(lights)[..., 0])


def _square() -> Array:
    return np.array([[(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]])


def _cell(stuff: str, places: Array) -> Array:
    """Texture coordinates within a cell, as coordinates within the whole texture."""
    row, column = divmod(CELLS[stuff], ROWS)
    return (np.array([column, row]) + _INSET + (1.0 - 2.0 * _INSET) * places) / ROWS


def _turned(corners: Array, yaw: float) -> Array:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return corners @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def grid_cells(grid: Array) -> Array:
    """Corners of each cell of a grid (rows, columns, k) with rows upwards: (n, 4, k)."""
    corners = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    return np.stack(corners, axis=2).reshape(-1, 4, grid.shape[-1])
