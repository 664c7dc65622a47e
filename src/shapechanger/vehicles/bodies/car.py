"""Car: two driven rear wheels, two steered front wheels, a red bonnet."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import mujoco

from shapechanger.vehicles.bodies.model import VehicleModel
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR, CameraMount
from shapechanger.vehicles.bodies.visuals import Paint
from shapechanger.vehicles.bodies.wheels import Axles, Rolling, add_axles, add_chassis

# Rounded sizes of a touring car at the scale 1:10; mass with battery and computer. Estimates.
_LENGTH: Final = 0.40  # m
_WIDTH: Final = 0.20  # m
_BODY_KG: Final = 1.3
_AXLES: Final = Axles(
    front_x=0.13,
    rear_x=-0.13,
    gauge=0.140,  # At full lock no wheel sticks out of the body.
    radius=0.0325,  # Tyres of 65 mm, the usual ones at 1:10.
    width=0.026,
    wheel_kg=0.05,
    full_lock=math.radians(28.0),
)

# Spur gear to the axle, chosen for 2 m/s; its efficiency is an estimate.
_MOTOR: Final = HOBBY_MOTOR.geared(4.3, efficiency=0.9)

_CAMERA: Final = CameraMount(x=0.055, y=0.0, z=0.118, pitch_rad=0.0)


def _build(spec: mujoco.MjSpec, paint: Paint) -> None:
    box, ellipsoid = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_ELLIPSOID
    # The bonnet, and the bumper of a camera that leans.
    seen = (
        (box, (0.19, 0.0, 0.038), (0.01, 0.095, 0.014), "dark"),
        (ellipsoid, (0.115, 0.0, 0.050), (0.088, 0.094, 0.027), "red"),
    )
    # The centre of mass is low. The hull is as wide as the wheels, so that it meets walls first.
    chassis = add_chassis(spec, paint, _LENGTH, _WIDTH, 0.045, _BODY_KG, _CAMERA, seen=seen)
    add_axles(spec, chassis, _AXLES, _MOTOR, paint)


CAR: Final = VehicleModel(
    name="car",
    drives=(frozenset({"wheels", "steering"}),),
    length_m=_LENGTH,
    width_m=_WIDTH,
    nose_m=_LENGTH / 2,
    camera=_CAMERA,
    top_speed_mps=2.0,
    turning_radius_m=_AXLES.turning_radius,
    build=_build,
    bind=partial(Rolling, motors={"wheels": _MOTOR}, radius=_AXLES.radius, axles=_AXLES),
)
