"""Boat: a hull with a central propeller and a rudder, and twin propellers as an alternative.

A robot drives either the central propeller and the rudder, or the twins; parts that it does not
drive stay still and have no effect.
"""

from __future__ import annotations

import math
from typing import Final

import mujoco

from shapechanger.bodies.vehicles.hydrodynamics import (
    WATER_DENSITY,
    Afloat,
    Fin,
    Floating,
    Hull,
    Propeller,
)
from shapechanger.bodies.vehicles.model import CameraMount, VehicleModel
from shapechanger.bodies.vehicles.parts import (
    BATTERY_V,
    HOBBY_MOTOR,
    HOBBY_SERVO,
    PI_CAMERA_FOVY_DEG,
    Paint,
    add_camera,
    add_hull,
    add_look,
)

_LENGTH: Final = 0.60  # m
_WIDTH: Final = 0.20  # m
_DRAUGHT: Final = 0.04  # m
_BLOCK: Final = 0.55  # Block coefficient, usual for workboats.
_MASS: Final = WATER_DENSITY * _BLOCK * _LENGTH * _WIDTH * _DRAUGHT

# Radius of gyration in yaw over length: 0.25, the usual estimate for ships (Fossen, chapter 6).
_INERTIA: Final = _MASS * (0.25 * _LENGTH) ** 2
# Added masses as shares of the dry ones are those of CyberShip II, a model of 1.26 m: R. Skjetne,
# T. I. Fossen and P. Kokotović, Adaptive maneuvering, Automatica 41 (2005), table of parameters.
_ADDED_SURGE: Final = 2.0 / 23.8
_ADDED_SWAY: Final = 10.0 / 23.8
_ADDED_YAW: Final = 1.0 / 1.76
# Wetted surface and drag coefficient at a Froude number near 0.5: estimates. Friction alone gives
# about 0.005 by the ITTC 1957 line, waves the rest.
_WETTED: Final = 0.8 * _LENGTH * (_WIDTH + 2.0 * _DRAUGHT)  # m2
_SURGE_COEFFICIENT: Final = 0.0135
# Cross-flow drag of a hull with rounded bilges, an estimate after Hoerner in Fossen's chapter 6.
_CROSSFLOW_COEFFICIENT: Final = 0.7

# A hull with drift acts as a low wing. Clarke, Gedling and Hine's formulas (1983; in
# Fossen, chapter 6) for the derivatives Y_v and N_r, from length L, beam B, draught T and block.
_WING: Final = math.pi * (_DRAUGHT / _LENGTH) ** 2
_SWAY_LIFT: Final = _WING * (1.0 + 0.4 * _BLOCK * _WIDTH / _DRAUGHT)
_YAW_LIFT: Final = _WING * (0.25 + 0.039 * _WIDTH / _DRAUGHT - 0.56 * _WIDTH / _LENGTH)

_HULL: Final = Hull(
    mass=_MASS,
    inertia=_INERTIA,
    added_surge=_ADDED_SURGE * _MASS,
    added_sway=_ADDED_SWAY * _MASS,
    added_yaw=_ADDED_YAW * _INERTIA,
    # Linear terms are estimates: they equal the quadratic ones at 0.1 m/s, and at 0.5 rad/s in yaw.
    surge=0.1 * 0.5 * WATER_DENSITY * _WETTED * _SURGE_COEFFICIENT,
    surge_2=0.5 * WATER_DENSITY * _WETTED * _SURGE_COEFFICIENT,
    sway=0.1 * 0.5 * WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH,
    sway_2=0.5 * WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH,
    sway_lift=0.5 * WATER_DENSITY * _LENGTH**2 * _SWAY_LIFT,
    # Cross-flow drag integrated over the length, for a turn about the middle.
    yaw=0.5 * 0.5 * WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH**4 / 32.0,
    yaw_2=0.5 * WATER_DENSITY * _CROSSFLOW_COEFFICIENT * _DRAUGHT * _LENGTH**4 / 32.0,
    yaw_lift=0.5 * WATER_DENSITY * _LENGTH**4 * _YAW_LIFT,
)

# Linear fits by eye to the open-water curves of a Wageningen B3-50 propeller with a pitch of 0.9
# diameters (M. Oosterveld and P. van Oossanen 1975). Astern about half is left: an estimate.
_PROPELLER: Final = Propeller(
    diameter=0.035,
    thrust=0.38,
    thrust_ends=0.95,
    torque=0.045,
    torque_ends=1.1,
    astern=0.5,
    wake=0.85,
    pushes=0.9,
)
_TWIN: Final = Propeller(0.028, 0.38, 0.95, 0.045, 1.1, 0.5, 0.9, 0.9)
_SHAFTS: Final = {"propeller": 0.0, "left propeller": 0.07, "right propeller": -0.07}  # m, y
_SHAFT_X: Final = -0.23  # m

# The motor with a gear of 2.5:1 instead of its own 4.4:1, as sold for model boats.
_MOTOR: Final = HOBBY_MOTOR.geared(2.5 / 4.4)
_PROPELLER_INERTIA: Final = 2e-6  # kg·m2, with entrained water: an estimate

_RUDDER: Final = Fin(x=-0.27, height=0.045, chord=0.035)
_SKEG: Final = Fin(x=-0.20, height=0.035, chord=0.10)
_FULL_RUDDER: Final = math.radians(35.0)  # The usual limit of ships.

_CAMERA: Final = CameraMount(
    x=0.16, y=0.0, z=0.14, pitch_rad=math.radians(3.0), fovy_deg=PI_CAMERA_FOVY_DEG
)


def _build(spec: mujoco.MjSpec) -> None:
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    box, ellipsoid = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_ELLIPSOID
    paint = Paint(spec)
    chassis = spec.worldbody.add_body(name="vehicle/chassis")
    chassis.add_joint(name="vehicle/chassis x", type=slide, axis=[1.0, 0.0, 0.0])
    chassis.add_joint(name="vehicle/chassis y", type=slide, axis=[0.0, 1.0, 0.0])
    chassis.add_joint(name="vehicle/chassis yaw", type=hinge, axis=[0.0, 0.0, 1.0])
    chassis.explicitinertial = True
    chassis.mass = _MASS
    chassis.inertia = [0.1 * _INERTIA, _INERTIA, _INERTIA]
    # Collision geoms: a box amidships and a rounded bow, without mass.
    add_hull(chassis, "vehicle/hull", box, (-0.06, 0.0, 0.02), (0.24, _WIDTH / 2, 0.05), 0.0)
    bow = (0.16, 0.0, 0.02), (0.14, _WIDTH / 2, 0.05)
    add_hull(chassis, "vehicle/bow", ellipsoid, *bow, 0.0)
    white, orange = paint("white", (0.62, 0.62, 0.58)), paint("orange", (0.70, 0.28, 0.05))
    dark, glass = paint("dark", (0.07, 0.07, 0.08)), paint("glass", (0.16, 0.20, 0.24))
    add_look(chassis, box, (-0.08, 0.0, 0.015), (0.22, 0.098, 0.035), white)
    add_look(chassis, ellipsoid, (0.10, 0.0, 0.015), (0.20, 0.098, 0.040), white)
    add_look(chassis, box, (-0.09, 0.0, 0.053), (0.20, 0.085, 0.004), orange)
    add_look(chassis, ellipsoid, (0.11, 0.0, 0.048), (0.165, 0.080, 0.012), orange)
    add_look(chassis, box, (-0.06, 0.0, 0.080), (0.09, 0.060, 0.028), white)
    add_look(chassis, box, (0.02, 0.0, 0.090), (0.012, 0.056, 0.014), glass)
    add_look(chassis, box, (0.13, 0.0, 0.095), (0.006, 0.010, 0.050), dark)
    for part, y in _SHAFTS.items():
        _add_propeller(spec, chassis, part, y, paint)
    _add_rudder(spec, chassis, paint)
    add_camera(chassis, _CAMERA)


def _add_propeller(
    spec: mujoco.MjSpec, chassis: mujoco.MjsBody, part: str, y: float, paint: Paint
) -> None:
    name = f"vehicle/{part}"
    # Its weight is part of the hull's, so that the centre of mass stays amidships.
    shaft = chassis.add_body(name=name, pos=[_SHAFT_X, y, -_DRAUGHT])
    shaft.explicitinertial = True
    shaft.mass = 1e-4
    shaft.inertia = [1e-8, 1e-8, 1e-8]
    shaft.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1.0, 0.0, 0.0],
        armature=_MOTOR.rotor_inertia + _PROPELLER_INERTIA,
    )  # fmt: skip
    half, box = _diameter(part) / 2, mujoco.mjtGeom.mjGEOM_BOX
    brass = paint("brass", (0.55, 0.42, 0.15))
    add_look(shaft, box, (0.0, 0.0, 0.0), (0.003, half, 0.005), brass)
    add_look(shaft, box, (0.0, 0.0, 0.0), (0.003, 0.005, half), brass)
    _MOTOR.add(spec, name).wrap_joint(name, 1.0)


def _add_rudder(spec: mujoco.MjSpec, chassis: mujoco.MjsBody, paint: Paint) -> None:
    name = "vehicle/rudder"
    stock = chassis.add_body(name=name, pos=[_RUDDER.x, 0.0, -_DRAUGHT])
    stock.explicitinertial = True
    stock.mass = 1e-4
    stock.inertia = [1e-8, 1e-8, 1e-8]
    stock.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0],
        damping=HOBBY_SERVO.damping, armature=2e-4,
    )  # fmt: skip
    size = (_RUDDER.chord / 2, 0.002, _RUDDER.height / 2)
    dark = paint("dark", (0.07, 0.07, 0.08))
    add_look(stock, mujoco.mjtGeom.mjGEOM_BOX, (-_RUDDER.chord / 4, 0.0, 0.0), size, dark)
    HOBBY_SERVO.add(spec, name, name)


def _diameter(part: str) -> float:
    return (_PROPELLER if part == "propeller" else _TWIN).diameter


def _bind(model: mujoco.MjModel, data: mujoco.MjData) -> Floating:
    propellers = {
        part: (_PROPELLER if part == "propeller" else _TWIN, y) for part, y in _SHAFTS.items()
    }
    return Floating(model, data, Afloat(_HULL, propellers, _RUDDER, _SKEG, _FULL_RUDDER, _MOTOR))


BOAT: Final = VehicleModel(
    name="boat",
    drives=(frozenset({"propeller", "rudder"}), frozenset({"left propeller", "right propeller"})),
    optional_parts=frozenset(),
    length_m=_LENGTH,
    width_m=_WIDTH,
    nose_m=_LENGTH / 2,
    floats=True,
    camera=_CAMERA,
    battery_v=BATTERY_V,
    top_speed_mps=1.2,
    turning_radius_m=0.7,  # At full throttle; measured in a test.
    build=_build,
    bind=_bind,
)
