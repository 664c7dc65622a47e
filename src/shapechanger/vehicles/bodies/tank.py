"""Tank: two tracks with a motor each."""

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
    add_wheel,
)
from shapechanger.vehicles.bodies.shapes import Faces, block, extrude, loft, rod
from shapechanger.vehicles.bodies.visuals import Paint, add_shadow, dress, joined
from shapechanger.vehicles.bodies.wheels import Rolling

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
    box = mujoco.mjtGeom.mjGEOM_BOX
    chassis = add_chassis(spec)
    size = (_LENGTH / 2, _WIDTH / 2, 0.025)
    add_hull(chassis, "vehicle/hull", box, (0.0, 0.0, 0.050), size, _BODY_KG)
    # What its own camera sees, in wide pictures.
    add_look(chassis, box, (0.0, 0.0, 0.058), (0.150, 0.072, 0.022), paint("green"))
    dress(chassis, _bodywork(), paint)
    add_shadow(chassis, (-_LENGTH / 2, -_WIDTH / 2), (_LENGTH / 2, _WIDTH / 2), paint)
    for side, sign in _SIDES:
        _add_track(spec, chassis, side, sign * _GAUGE / 2, paint)
    add_camera(chassis, _CAMERA)


@functools.cache
def _bodywork() -> Mapping[str, Faces]:
    """Hull, tracks and a turret whose gun is the camera: colours and faces."""
    hull = extrude(
        [(-0.145, 0.03), (0.10, 0.026), (0.155, 0.050), (0.12, 0.078), (-0.15, 0.078)],
        -0.074, 0.074,
    )  # fmt: skip
    # Octagons: position ahead, radius and height.
    corners = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False) + np.pi / 8.0
    turret = [
        np.stack([x + 1.15 * r * np.cos(corners), r * np.sin(corners), np.full(8, z)], axis=1)
        for x, r, z in ((-0.035, 0.066, 0.078), (-0.035, 0.070, 0.092), (-0.042, 0.050, 0.126))
    ]
    z = _CAMERA.z
    parts = [
        ("green", hull),
        ("green", loft(turret)),
        ("olive", block((-0.02, -0.028, z - 0.012), (0.028, 0.028, z + 0.010))),  # Mantlet.
        ("dark", rod((0.02, 0.0, z), (0.10, 0.0, z), 0.009, 12)),
        ("dark", block((0.085, -0.014, z - 0.013), (0.117, 0.014, z + 0.013))),
        ("steel", rod((0.116, 0.0, z), (0.119, 0.0, z), 0.008)),
        ("olive", rod((-0.06, 0.022, 0.122), (-0.06, 0.022, 0.131), 0.017, 12)),  # Hatch.
        ("dark", rod((-0.09, -0.03, 0.12), (-0.10, -0.03, 0.215), 0.0015, 6)),  # Aerial.
    ]
    slots = [-0.140 + 0.010 * i for i in range(5)]
    parts += [("dark", block((x, -0.045, 0.077), (x + 0.004, 0.045, 0.0792))) for x in slots]
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
    bend = np.stack([np.cos(angle), np.sin(angle)], axis=1) * (_RADIUS + 0.001)
    end = np.array([_WHEEL_XS["front"], 0.0])
    straight = np.linspace(-0.095, 0.095, 11)[1:-1]
    way = [
        *((x, -_RADIUS) for x in straight), *(end + bend),
        *((x, _RADIUS + 0.001) for x in straight[::-1]), *(-end - bend),
    ]  # fmt: skip
    loop = np.add(way, (0.0, _RADIUS + 0.001))
    for _, sign in _SIDES:
        y, half = sign * _GAUGE / 2, _TRACK_WIDTH / 2
        track = extrude(loop, y - half, y + half)
        links = len(loop)
        parts += [
            ("grey", track[0:links:2]),
            ("track", track[1:links:2]),
            ("track", track[links:]),
        ]
        fender = extrude(
            [(-0.150, 0.074), (0.125, 0.074), (0.158, 0.052), (0.160, 0.055), (0.128, 0.080),
             (-0.150, 0.080)],
            y - half - 0.004, y + half + 0.004,
        )  # fmt: skip
        parts += [
            ("olive", fender),
            ("olive", block((-0.10, y - 0.014, 0.080), (-0.03, y + 0.014, 0.092))),  # Stowage.
            ("lamp", rod((0.118, 0.75 * y, 0.073), (0.137, 0.75 * y, 0.073), 0.007)),
            ("red", block((-0.1512, 0.9 * y - 0.006, 0.062), (-0.149, 0.9 * y + 0.006, 0.068))),
        ]
    return joined(parts)


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
