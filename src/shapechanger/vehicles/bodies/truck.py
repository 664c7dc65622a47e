"""Truck: a tractor with Ackermann steering and a semi-trailer."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from functools import partial
from typing import Final

import mujoco
import numpy as np

from shapechanger.vehicles.bodies.model import VehicleModel
from shapechanger.vehicles.bodies.parts import (
    HOBBY_MOTOR,
    CameraMount,
    add_camera,
    add_chassis,
    add_hull,
    add_wheel,
)
from shapechanger.vehicles.bodies.shapes import Faces, block, extrude, rod
from shapechanger.vehicles.bodies.visuals import Paint, add_shadow, dress, joined
from shapechanger.vehicles.bodies.wheels import Axles, Steered, add_axles

# Sizes of a tractor and a semi-trailer at the scale 1:14, shortened; masses are estimates.
_TRACTOR_LENGTH: Final = 0.50  # m
_TRAILER_LENGTH: Final = 0.50  # m
_WIDTH: Final = 0.20  # m
_TRACTOR_KG: Final = 2.4
_TRAILER_KG: Final = 1.2
_AXLES: Final = Axles(
    front_x=0.17,
    rear_x=-0.15,
    gauge=0.132,  # At full lock no wheel sticks out of the body.
    radius=0.0375,
    width=0.028,
    wheel_kg=0.07,
    full_lock=math.radians(30.0),
)
_HITCH_X: Final = -0.14  # m: a little ahead of the rear axle, as on real tractors.
_HITCH_Z: Final = 0.085  # m
_TRAILER_FRONT: Final = 0.05  # m of the trailer ahead of the hitch
_TRAILER_GAUGE: Final = 0.165  # m
_TRAILER_AXLE_X: Final = -0.36  # m behind the hitch
_MOST_YAW: Final = math.radians(85.0)  # The trailer meets the cab.
_MOST_PITCH: Final = math.radians(12.0)

# Chosen for 1.5 m/s.
_MOTOR: Final = HOBBY_MOTOR.geared(6.75, efficiency=0.9)

_CAMERA: Final = CameraMount(x=0.235, y=0.0, z=0.125, pitch_rad=math.radians(4.0))


def _build(spec: mujoco.MjSpec, paint: Paint) -> None:
    box = mujoco.mjtGeom.mjGEOM_BOX
    chassis = add_chassis(spec)
    size = (_TRACTOR_LENGTH / 2, _WIDTH / 2, 0.025)
    add_hull(chassis, "vehicle/hull", box, (0.0, 0.0, 0.050), size, _TRACTOR_KG)
    dress(chassis, _tractor(), paint)
    add_shadow(chassis, (-_TRACTOR_LENGTH / 2, -0.09), (_TRACTOR_LENGTH / 2, 0.09), paint)
    add_axles(spec, chassis, _AXLES, _MOTOR, paint)
    add_camera(chassis, _CAMERA)
    _add_trailer(spec, chassis, paint)


@functools.cache
def _tractor() -> Mapping[str, Faces]:
    """A cab over its front axle, with a wind deflector, tanks and exhausts: colours and faces."""
    # The cab's outline from the side, with the wheel arch cut out.
    sill, arch = 0.052, _AXLES.radius + 0.045
    front = [(0.12, sill), (0.125, arch), (0.215, arch), (0.222, sill + 0.02)]
    rear = [(0.062, sill), (0.12, sill), (0.12, arch), (0.062, arch)]
    upper = [(0.062, arch), (0.232, arch), (0.230, 0.145), (0.214, 0.222), (0.20, 0.234),
             (0.062, 0.234)]  # fmt: skip
    screen = [(0.2295, 0.152), (0.2312, 0.152), (0.2168, 0.217), (0.2150, 0.217)]
    deflector = [(0.070, 0.234), (0.198, 0.234), (0.16, 0.243), (0.10, 0.262), (0.070, 0.266)]
    z = _CAMERA.z
    parts = [
        ("blue", extrude(upper, -0.095, 0.095)),
        ("blue", extrude(rear, -0.095, 0.095)),
        ("dark", extrude(front, -0.05, 0.05)),
        ("glass", extrude(screen, -0.082, 0.082)),
        ("blue", extrude(deflector, -0.075, 0.075)),
        ("dark", block((0.2135, -0.085, 0.216), (0.236, 0.085, 0.222))),  # Visor.
        ("white", block((0.218, -0.097, 0.036), (0.250, 0.097, 0.072))),  # Bumper.
        ("dark", block((0.226, -0.060, 0.078), (0.2335, 0.060, 0.112))),  # Grille.
        ("dark", block((-0.245, -0.042, 0.045), (0.215, 0.042, 0.068))),  # Frame.
        ("dark", block((-0.185, -0.045, 0.068), (-0.09, 0.045, 0.082))),  # Fifth wheel.
        ("dark", block((0.218, -0.016, z - 0.010), (0.2345, 0.016, z + 0.012))),  # Camera.
        ("steel", rod((0.233, 0.0, z), (0.2365, 0.0, z), 0.008)),
        ("red", block((-0.2465, -0.05, 0.048), (-0.244, 0.05, 0.060))),
    ]
    parts += [
        ("steel", block((0.233, -0.058, h), (0.2345, 0.058, h + 0.003)))
        for h in (0.086, 0.095, 0.104)
    ]
    for side in (-1.0, 1.0):
        y = side * 0.0955
        window = [(0.105, 0.155), (0.200, 0.155), (0.192, 0.212), (0.105, 0.212)]
        parts += [
            ("glass", extrude(window, y - 0.0012, y + 0.0012)),
            ("dark", block((0.098, y - 0.001, 0.090), (0.100, y + 0.001, 0.215))),  # Door.
            ("steel", block((0.104, y - 0.003, 0.135), (0.118, y + 0.003, 0.139))),
            (
                "dark",
                block((0.222, side * 0.104 - 0.008, 0.165), (0.230, side * 0.104 + 0.008, 0.205)),
            ),
            ("lamp", block((0.248, 0.75 * y - 0.014, 0.046), (0.2512, 0.75 * y + 0.014, 0.062))),
            ("steel", rod((-0.065, 0.8 * y, 0.058), (0.052, 0.8 * y, 0.058), 0.021, 12)),  # Tank.
            ("steel", rod((0.050, 0.85 * y, 0.08), (0.050, 0.85 * y, 0.275), 0.006, 8)),
            ("dark", block((-0.20, 0.7 * y - 0.018, 0.080), (-0.10, 0.7 * y + 0.018, 0.084))),
        ]
    return joined(parts)


@functools.cache
def _box(rear: float, front: float) -> Mapping[str, Faces]:
    """A ribbed container on its frame, between two positions ahead, m: colours and faces."""
    half, low, high = 0.096, 0.016, 0.165
    parts = [
        ("white", block((rear, -half, low), (front, half, high))),
        ("dark", block((rear + 0.02, -0.05, -0.012), (front - 0.02, 0.05, 0.016))),
        (
            "dark",
            block((_TRAILER_AXLE_X - 0.04, -0.06, -0.055), (_TRAILER_AXLE_X + 0.04, 0.06, 0.0)),
        ),
        ("dark", block((rear, -0.085, -0.045), (rear + 0.008, 0.085, -0.030))),
        ("steel", block((rear - 0.0012, -0.001, low), (rear, 0.001, high))),  # Doors.
    ]
    for y in (-0.065, -0.030, 0.030, 0.065):
        parts.append(("steel", rod((rear - 0.002, y, low), (rear - 0.002, y, high), 0.002, 6)))
    for side in (-1.0, 1.0):
        y = side * half
        ribs = np.arange(rear + 0.006, front - 0.004, 0.0245)
        parts += [
            ("white", block((x, y - 0.0016, low), (x + 0.010, y + 0.0016, high))) for x in ribs
        ]
        parts += [
            ("orange", block((rear, y - 0.0021, 0.050), (front, y + 0.0021, 0.074))),
            ("grey", block((rear, y - 0.002, low - 0.006), (front, y + 0.002, low + 0.006))),
            ("grey", block((rear, y - 0.002, high - 0.007), (front, y + 0.002, high + 0.001))),
            ("dark", block((-0.25, 0.85 * y - 0.003, -0.045), (-0.10, 0.85 * y + 0.003, 0.0))),
            ("dark", block((-0.065, 0.6 * y - 0.005, -0.070), (-0.055, 0.6 * y + 0.005, 0.0))),
            (
                "red",
                block((rear - 0.001, 0.75 * y - 0.012, -0.043), (rear, 0.75 * y + 0.012, -0.032)),
            ),
        ]
    return joined(parts)


def _add_trailer(spec: mujoco.MjSpec, chassis: mujoco.MjsBody, paint: Paint) -> None:
    """Add the trailer with its kingpin, which allows yaw and pitch but no roll."""
    box, hinge = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtJoint.mjJNT_HINGE
    trailer = chassis.add_body(name="vehicle/trailer", pos=[_HITCH_X, 0.0, _HITCH_Z])
    unit = 1.0 if not spec.compiler.degree else math.degrees(1.0)  # Unit of angles in the model.
    # Damping of the greased plate: estimates.
    trailer.add_joint(
        name="vehicle/trailer yaw", type=hinge, axis=[0.0, 0.0, 1.0], damping=0.01, limited=True,
        range=[-unit * _MOST_YAW, unit * _MOST_YAW],
    )  # fmt: skip
    trailer.add_joint(
        name="vehicle/trailer pitch", type=hinge, axis=[0.0, 1.0, 0.0], damping=0.02, limited=True,
        range=[-unit * _MOST_PITCH, unit * _MOST_PITCH],
    )  # fmt: skip
    half = _TRAILER_LENGTH / 2
    x = _TRAILER_FRONT - half
    add_hull(
        trailer, "vehicle/trailer", box, (x, 0.0, 0.025), (half, _WIDTH / 2, 0.02), _TRAILER_KG
    )
    dress(trailer, _box(x - half, x + half), paint, ground_z=-_HITCH_Z)
    rear, front = (x - half, -_WIDTH / 2), (x + half - 0.08, _WIDTH / 2)
    add_shadow(trailer, rear, front, paint, ground_z=-_HITCH_Z)
    for side, sign in (("left", 1), ("right", -1)):
        place = (_TRAILER_AXLE_X, sign * _TRAILER_GAUGE / 2, _AXLES.radius - _HITCH_Z)
        size = (_AXLES.radius, _AXLES.width, _AXLES.wheel_kg)
        add_wheel(trailer, f"vehicle/trailer {side} wheel", place, *size, paint)


TRUCK: Final = VehicleModel(
    name="truck",
    drives=(frozenset({"wheels", "steering"}),),
    optional_parts=frozenset({"gear", "bed"}),
    length_m=_TRACTOR_LENGTH / 2 - _HITCH_X + _TRAILER_LENGTH - _TRAILER_FRONT,
    width_m=_WIDTH,
    nose_m=_TRACTOR_LENGTH / 2,
    camera=_CAMERA,
    top_speed_mps=1.5,
    turning_radius_m=_AXLES.turning_radius,
    build=_build,
    bind=partial(Steered, motors={"wheels": _MOTOR}, axles=_AXLES),
)
