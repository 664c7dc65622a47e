"""Truck: a tractor with Ackermann steering and a semi-trailer."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import mujoco

from shapechanger.vehicles.bodies.model import VehicleModel
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR, CameraMount, add_hull, add_wheel
from shapechanger.vehicles.bodies.visuals import Paint, add_shadow, dress
from shapechanger.vehicles.bodies.wheels import Axles, Rolling, add_axles, add_chassis

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
    chassis = add_chassis(
        spec, paint, _TRACTOR_LENGTH, _WIDTH, 0.050, _TRACTOR_KG, _CAMERA, shadow_m=0.18
    )
    add_axles(spec, chassis, _AXLES, _MOTOR, paint)
    _add_trailer(spec, chassis, paint)


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
    dress(trailer, "trailer", paint, ground_z=-_HITCH_Z)
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
    bind=partial(Rolling, motors={"wheels": _MOTOR}, radius=_AXLES.radius, axles=_AXLES),
)
