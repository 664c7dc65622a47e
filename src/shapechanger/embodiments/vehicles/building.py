"""What the bodies are put together from: hulls, wheels, paint and cameras."""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.embodiments.vehicles.model import CameraMount

__all__ = ["PI_CAMERA_FOVY_DEG", "Paint", "add_camera", "add_hull", "add_look", "add_wheel"]

# What touches what: MuJoCo lets two geoms collide if the type of one meets the affinity of the
# other. The world is 1 and meets 2, the ground is 4 and meets 8.
_HULL_TYPE, _HULL_MEETS = 2, 1  # Walls and things, not the ground.
_WHEEL_TYPE, _WHEEL_MEETS = 10, 5  # Those and the ground.

_HIDDEN_GROUP: Final = 3

HULL_FRICTION: Final = 0.2
"""Between a smooth plastic body and a wall, an estimate; rubber at the wheels grips more."""

_WHEEL_FRICTION: Final = 0.3  # Of the wheel alone: the ground's counts where that is larger.

PI_CAMERA_FOVY_DEG: Final = 48.8
"""Raspberry Pi camera module 2: https://www.raspberrypi.com/documentation/accessories/camera.html"""


class Paint:
    """Colours that shine by themselves a little, for worlds whose light is painted on."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self._spec = spec
        self._made: set[str] = set()

    def __call__(self, name: str, rgb: tuple[float, float, float]) -> str:
        """The name of the material of this colour."""
        material = f"vehicle/{name}"
        if material not in self._made:
            self._spec.add_material(
                name=material, rgba=[*rgb, 1.0], emission=0.6, specular=0.2, shininess=0.3
            )
            self._made.add(material)
        return material


def add_look(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    pos: ArrayLike,
    size: ArrayLike,
    material: str,
    *,
    euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Add a shape that is seen, but neither weighs nor touches anything."""
    quat = np.empty(4)
    mujoco.mju_euler2Quat(quat, np.radians(euler_deg), "xyz")
    body.add_geom(
        type=kind, pos=pos, size=_three(size), quat=quat, material=material, mass=0.0,
        contype=0, conaffinity=0, group=0,
    )  # fmt: skip


def add_hull(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    pos: ArrayLike,
    size: ArrayLike,
    mass: float,
    *,
    quat: ArrayLike = (1.0, 0.0, 0.0, 0.0),
) -> None:
    """Add a shape that weighs and that bumps into things, a little softly, and is not seen."""
    body.add_geom(
        name=name, type=kind, pos=pos, size=_three(size), quat=quat, mass=mass,
        friction=[HULL_FRICTION, 0.005, 0.0001], priority=1, condim=3,
        solref=[0.02, 1.0], solimp=[0.8, 0.95, 0.005, 0.5, 2.0], group=_HIDDEN_GROUP,
        contype=_HULL_TYPE, conaffinity=_HULL_MEETS,
    )  # fmt: skip


def add_wheel(
    body: mujoco.MjsBody,
    name: str,
    pos: tuple[float, float, float],
    radius: float,
    width: float,
    mass: float,
    paint: Paint,
    *,
    armature: float = 0.0,
    damping: float = 1e-4,
    friction: float | None = None,
    tyre: tuple[float, float, float] = (0.05, 0.05, 0.05),
) -> mujoco.MjsBody:
    """Add a wheel that rolls: forward is positive.

    It touches the ground as a flat ellipsoid does, in one point.

    Args:
        body: What it is fixed to.
        name: Of its body, joint and geom.
        pos: Of its middle, m.
        radius: m.
        width: m.
        mass: kg.
        paint: For its colours.
        armature: Share of the motor's rotor, kg·m2.
        damping: Of its bearing, N·m·s/rad; small, an estimate.
        friction: Its own, whatever the ground; or else the ground's.
        tyre: Colour, red, green and blue.
    """
    wheel = body.add_body(name=name, pos=pos)
    wheel.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0],
        armature=armature, damping=damping,
    )  # fmt: skip
    wheel.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=[radius, width / 2, radius],
        mass=mass, friction=[friction or _WHEEL_FRICTION, 0.005, 0.0001],
        priority=0 if friction is None else 1, condim=3, group=_HIDDEN_GROUP,
        contype=_WHEEL_TYPE, conaffinity=_WHEEL_MEETS,
    )  # fmt: skip
    cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
    black = paint("tyre" if tyre == (0.05, 0.05, 0.05) else "track", tyre)
    grey = paint("rim", (0.55, 0.55, 0.58))
    aside = (90.0, 0.0, 0.0)
    add_look(wheel, cylinder, (0.0, 0.0, 0.0), (radius, width / 2), black, euler_deg=aside)
    add_look(wheel, cylinder, (0.0, 0.0, 0.0), (0.55 * radius, 0.52 * width), grey, euler_deg=aside)
    box = mujoco.mjtGeom.mjGEOM_BOX  # A spoke, so that one sees it turn.
    add_look(wheel, box, (0.0, 0.0, 0.0), (0.5 * radius, 0.54 * width, 0.12 * radius), black)
    return wheel


def add_camera(body: mujoco.MjsBody, mount: CameraMount) -> None:
    """Add the camera, which looks ahead."""
    s, c = math.sin(mount.pitch_rad), math.cos(mount.pitch_rad)
    # Columns are its axes: x to the right, y up, and z backwards, for it looks against that.
    axes = np.array([[0.0, s, -c], [-1.0, 0.0, 0.0], [0.0, c, s]])
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    place = [mount.x, mount.y, mount.z]
    body.add_camera(name="vehicle/camera", pos=place, quat=quat, fovy=mount.fovy_deg)


def _three(size: ArrayLike) -> NDArray[np.float64]:
    """The size with zeros for the numbers that a shape does not have."""
    given = np.asarray(size, dtype=np.float64)
    return np.concatenate([given, np.zeros(3 - len(given))])
