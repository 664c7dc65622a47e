"""Car: two driven rear wheels, two steered front wheels, a red bonnet."""

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
    add_look,
)
from shapechanger.vehicles.bodies.shapes import Faces, block, loft, rod, section
from shapechanger.vehicles.bodies.visuals import Paint, add_shadow, dress, joined
from shapechanger.vehicles.bodies.wheels import Axles, Steered, add_axles

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
    chassis = add_chassis(spec)
    # The centre of mass is low. The hull is as wide as the wheels, so that it meets walls first.
    size = (_LENGTH / 2, _WIDTH / 2, 0.025)
    add_hull(chassis, "vehicle/hull", box, (0.0, 0.0, 0.045), size, _BODY_KG)
    # What its own camera sees: the bonnet, and the bumper of a camera that leans.
    red, dark = paint("red"), paint("dark")
    add_look(chassis, box, (0.19, 0.0, 0.038), (0.01, 0.095, 0.014), dark)
    add_look(chassis, ellipsoid, (0.115, 0.0, 0.050), (0.088, 0.094, 0.027), red)
    dress(chassis, _bodywork(), paint)
    add_shadow(chassis, (-_LENGTH / 2, -_WIDTH / 2), (_LENGTH / 2, _WIDTH / 2), paint)
    add_axles(spec, chassis, _AXLES, _MOTOR, paint)
    add_camera(chassis, _CAMERA)


@functools.cache
def _bodywork() -> Mapping[str, Faces]:
    """A touring car with a rear wing, and the camera on its roof: colours and faces."""
    # Distance from an axle, and height of the sill there: the wheel arch.
    arch = ((-0.043, 0.024), (-0.037, 0.050), (-0.02, 0.068), (0.02, 0.068), (0.037, 0.050),
            (0.043, 0.024))  # fmt: skip
    sills = [(axle + dx, z) for axle in (_AXLES.rear_x, _AXLES.front_x) for dx, z in arch]
    sills = [(-0.2, 0.032), (-0.19, 0.026), *sills, (0.19, 0.026), (0.2, 0.034)]
    xs = np.array([x for x, _ in sills])
    # Half width, and heights of the shoulder and of the middle, along the car.
    half = np.interp(xs, (-0.2, -0.17, 0.1, 0.17, 0.2), (0.086, 0.098, 0.098, 0.094, 0.074))
    shoulder = np.interp(xs, (-0.2, -0.1, 0.05, 0.16, 0.2), (0.074, 0.079, 0.078, 0.070, 0.056))
    ridge = np.interp(xs, (-0.2, -0.1, 0.05, 0.16, 0.2), (0.080, 0.085, 0.086, 0.075, 0.059))
    body = [
        section(x, [(w - 0.004, z), (w, max(z + 0.002, 0.050)), (w - 0.003, up), (0.7 * w, top)])
        for (x, z), w, up, top in zip(sills, half, shoulder, ridge, strict=True)
    ]
    top = 0.113
    cabin = ((-0.14, 0.085), (-0.09, top), (0.0, top), (0.062, 0.086))
    glass = [section(x, [(0.080, 0.079), (0.056 + 0.5 * (top - z), z)]) for x, z in cabin]
    roof = [section(x, [(0.057, top - 0.002), (0.050, top + 0.003)]) for x in (-0.093, 0.004)]
    pillar = [section(x, [(0.0815, 0.079), (0.0575, top)]) for x in (-0.045, -0.034)]
    stripe = [
        section(x, [(0.016, z - 0.004), (0.016, z + 0.0008)])
        for x, z in ((0.05, 0.086), (0.16, 0.075), (0.198, 0.060))
    ]
    parts = [
        ("scarlet", loft(body)),
        ("glass", loft(glass)),
        ("scarlet", loft(roof)),
        ("scarlet", loft(pillar)),
        ("white", loft(stripe)),
        ("white", block((-0.09, -0.016, top), (0.002, 0.016, top + 0.0036))),
        ("dark", block((-0.19, -0.055, 0.020), (0.19, 0.055, 0.045))),
        ("dark", block((0.195, -0.045, 0.036), (0.2006, 0.045, 0.048))),  # Grille.
        ("dark", block((-0.205, -0.080, 0.106), (-0.165, 0.080, 0.110))),  # Wing.
        # The camera behind its lens.
        ("dark", block((0.000, -0.014, top), (0.054, 0.014, top + 0.018))),
        ("steel", rod((0.053, 0.0, _CAMERA.z + 0.004), (0.057, 0.0, _CAMERA.z + 0.004), 0.007)),
    ]
    for side in (-1.0, 1.0):
        y = side * 0.06
        parts += [
            ("lamp", block((0.17, y - 0.012, 0.052), (0.197, y + 0.012, 0.062))),
            ("red", block((-0.2008, 1.1 * y - 0.014, 0.058), (-0.19, 1.1 * y + 0.014, 0.068))),
            ("dark", block((-0.19, y - 0.003, 0.080), (-0.178, y + 0.003, 0.108))),
            (
                "scarlet",
                block((-0.206, side * 0.08 - 0.002, 0.100), (-0.160, side * 0.08 + 0.002, 0.116)),
            ),
            (
                "scarlet",
                block((0.030, side * 0.094 - 0.010, 0.082), (0.042, side * 0.094 + 0.010, 0.092)),
            ),
        ]
    return joined(parts)


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
    bind=partial(Steered, motors={"wheels": _MOTOR}, axles=_AXLES),
)
