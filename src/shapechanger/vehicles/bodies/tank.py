"""Tank: two tracks with a motor each."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import mujoco

from shapechanger.vehicles.bodies.model import VehicleModel
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR, CameraMount, add_wheel
from shapechanger.vehicles.bodies.visuals import Paint
from shapechanger.vehicles.bodies.wheels import Rolling, add_chassis

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

_CAMERA: Final = CameraMount(x=0.12, y=0.0, z=0.115, pitch_rad=math.radians(3.0))
_SIDES: Final = (("left", 1), ("right", -1))


def _build(spec: mujoco.MjSpec, paint: Paint) -> None:
    # In wide pictures its own camera sees the hull.
    box = mujoco.mjtGeom.mjGEOM_BOX
    seen = ((box, (0.0, 0.0, 0.058), (0.150, 0.072, 0.022), "green"),)
    chassis = add_chassis(spec, paint, _LENGTH, _WIDTH, 0.050, _BODY_KG, _CAMERA, seen=seen)
    for side, sign in _SIDES:
        # Three wheels that turn together.
        track = _MOTOR.add(spec, f"vehicle/{side} track")
        wheels = {where: f"vehicle/{side} {where} wheel" for where in _WHEEL_XS}
        for where, x in _WHEEL_XS.items():
            place = (x, sign * _GAUGE / 2, _RADIUS)
            add_wheel(
                chassis, wheels[where], place, _RADIUS, _TRACK_WIDTH, _WHEEL_KG, paint,
                armature=_MOTOR.rotor_inertia / 3, friction=_TRACK_FRICTION, tyre="track",
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


TANK: Final = VehicleModel(
    name="tank",
    drives=(frozenset({"left track", "right track"}),),
    length_m=_LENGTH,
    width_m=_WIDTH,
    nose_m=_LENGTH / 2,
    camera=_CAMERA,
    top_speed_mps=1.0,
    turning_radius_m=0.0,
    build=_build,
    bind=partial(Rolling, motors={f"{side} track": _MOTOR for side, _ in _SIDES}, radius=_RADIUS),
)
