"""Tank: two tracks with a motor each."""

from __future__ import annotations

import math
from typing import Final

import mujoco

from shapechanger.bodies.vehicles.model import CameraMount, VehicleModel
from shapechanger.bodies.vehicles.parts import (
    BATTERY_V,
    HOBBY_MOTOR,
    PI_CAMERA_FOVY_DEG,
    Paint,
    add_camera,
    add_hull,
    add_look,
    add_wheel,
)
from shapechanger.bodies.vehicles.wheels import Rolling

# Sizes of a toy tank at the scale 1:16 to 1:24; the mass is an estimate.
_LENGTH: Final = 0.32  # m
_WIDTH: Final = 0.24  # m
_BODY_KG: Final = 1.8
_GAUGE: Final = 0.19  # m between the middles of the tracks
_WHEEL_XS: Final = {"front": 0.095, "middle": 0.0, "rear": -0.095}  # m
_RADIUS: Final = 0.035  # m, over the track
_TRACK_WIDTH: Final = 0.04  # m
_WHEEL_KG: Final = 0.05

# Friction of hard plastic tracks on any ground, below that of rubber; an estimate. A tank turns by
# dragging its tracks sideways.
_TRACK_FRICTION: Final = 0.5

# Chosen for 1 m/s; the efficiency of gear and track is an estimate.
_MOTOR: Final = HOBBY_MOTOR.geared(9.7, efficiency=0.8)

_CAMERA: Final = CameraMount(
    x=0.12, y=0.0, z=0.115, pitch_rad=math.radians(3.0), fovy_deg=PI_CAMERA_FOVY_DEG
)
_SIDES: Final = (("left", 1), ("right", -1))


def _build(spec: mujoco.MjSpec) -> None:
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    paint = Paint(spec)
    chassis = spec.worldbody.add_body(name="vehicle/chassis")
    chassis.add_freejoint(name="vehicle/chassis")
    size = (_LENGTH / 2, _WIDTH / 2, 0.025)
    add_hull(chassis, "vehicle/hull", box, (0.0, 0.0, 0.050), size, _BODY_KG)
    green, olive = paint("green", (0.20, 0.27, 0.13)), paint("olive", (0.27, 0.33, 0.17))
    dark = paint("dark", (0.07, 0.07, 0.08))
    add_look(chassis, box, (0.0, 0.0, 0.058), (0.150, 0.072, 0.022), green)
    add_look(chassis, box, (-0.02, 0.0, 0.086), (0.115, 0.118, 0.006), olive)
    add_look(chassis, cylinder, (-0.04, 0.0, 0.104), (0.055, 0.014), green)
    add_look(chassis, box, (0.105, 0.0, 0.092), (0.010, 0.012, 0.016), dark)
    for side, sign in _SIDES:
        y = sign * _GAUGE / 2
        # The track between its wheels.
        add_look(chassis, box, (0.0, y, 0.012), (0.095, _TRACK_WIDTH / 2, 0.0105), dark)
        add_look(
            chassis, box, (0.0, y, 2 * _RADIUS - 0.006), (0.095, _TRACK_WIDTH / 2, 0.006), dark
        )
        _add_track(spec, chassis, side, y, paint)
    add_camera(chassis, _CAMERA)


def _add_track(
    spec: mujoco.MjSpec, chassis: mujoco.MjsBody, side: str, y: float, paint: Paint
) -> None:
    """Add the three wheels of a track, which turn together."""
    part = f"vehicle/{side} track"
    track = _MOTOR.add(spec, part)
    wheels = {where: f"vehicle/{side} {where} wheel" for where in _WHEEL_XS}
    for where, x in _WHEEL_XS.items():
        add_wheel(
            chassis, wheels[where], (x, y, _RADIUS), _RADIUS, _TRACK_WIDTH, _WHEEL_KG, paint,
            armature=_MOTOR.rotor_inertia / 3, friction=_TRACK_FRICTION, tyre=(0.09, 0.09, 0.09),
        )  # fmt: skip
        track.wrap_joint(wheels[where], 1 / 3)
    for where in ("front", "rear"):
        spec.add_equality(
            name=wheels[where],
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=wheels[where],
            name2=wheels["middle"],
            data=[0.0, 1.0, *[0.0] * 10],
        )


def _bind(model: mujoco.MjModel, data: mujoco.MjData) -> Rolling:
    return Rolling(model, data, {f"{side} track": _MOTOR for side, _ in _SIDES}, _RADIUS)


TANK: Final = VehicleModel(
    name="tank",
    drives=(frozenset({"left track", "right track"}),),
    optional_parts=frozenset(),
    length_m=_LENGTH,
    width_m=_WIDTH,
    nose_m=_LENGTH / 2,
    floats=False,
    camera=_CAMERA,
    battery_v=BATTERY_V,
    top_speed_mps=1.0,
    turning_radius_m=0.0,
    build=_build,
    bind=_bind,
)
