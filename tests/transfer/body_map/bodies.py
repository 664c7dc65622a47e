"""Small layouts for the tests of body maps, with the names of the ants."""

from __future__ import annotations

import math
from typing import Any

from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap

DEGREE = math.pi / 180.0

# Left and right elements in the mirror y -> -y: leg 1 is at (+, +), 2 at (-, +),
# 3 at (-, -) and 4 at (+, -) in (x, y).
ANT_SWAP = {"*_1": "*_4", "*_2": "*_3"}
ANT_FLIP = ["hip_*"]


def motor(name: str, gain: float = 150.0, unit: str = "N·m") -> Feature:
    return Feature(f"{name}/motor", "1", -1.0, 1.0, gain=gain, gain_unit=unit)


def ant_observation(*, feet: bool = False) -> Layout:
    ankle = {1: (30, 100), 2: (-100, -30), 3: (-100, -30), 4: (30, 100)}
    torso = [Feature("torso/z", "m")]
    torso += [Feature(f"torso/{axis}", "1") for axis in ("qw", "qx", "qy", "qz")]
    angles: list[Feature] = []
    velocities = [Feature(f"torso/{axis}", "m/s") for axis in ("vx", "vy", "vz")]
    velocities += [Feature(f"torso/{axis}", "rad/s") for axis in ("wx", "wy", "wz")]
    contacts: list[Feature] = []
    for leg in (1, 2, 3, 4):
        low, high = ankle[leg]
        angles.append(Feature(f"hip_{leg}/angle", "rad", -30 * DEGREE, 30 * DEGREE))
        angles.append(Feature(f"ankle_{leg}/angle", "rad", low * DEGREE, high * DEGREE))
        velocities.append(Feature(f"hip_{leg}/velocity", "rad/s"))
        velocities.append(Feature(f"ankle_{leg}/velocity", "rad/s"))
        if feet:
            angles.append(Feature(f"foot_{leg}/angle", "rad", low * DEGREE, high * DEGREE))
            velocities.append(Feature(f"foot_{leg}/velocity", "rad/s"))
        contacts += [
            Feature(f"shank_{leg}/contact/{axis}", unit, -1.0, 1.0)
            for axis, unit in zip(("tx", "ty", "tz", "fx", "fy", "fz"), ["N·m"] * 3 + ["N"] * 3)  # noqa: B905
        ]
    return Layout((*torso, *angles, *velocities, *contacts))


def ant_action(*, feet: bool = False) -> Layout:
    motors = [motor(f"{joint}_{leg}") for leg in (4, 1, 2, 3) for joint in ("hip", "ankle")]
    if feet:
        motors += [motor(f"foot_{leg}") for leg in (4, 1, 2, 3)]
    return Layout(tuple(motors))


def pendulum_observation(hinge: str = "hinge", unit: str = "rad") -> Layout:
    return Layout(
        (
            Feature("slider/position", "m", -1.0, 1.0),
            Feature(f"{hinge}/angle", unit),
            Feature("slider/velocity", "m/s"),
            Feature(f"{hinge}/velocity", f"{unit}/s"),
        )
    )


def pendulum_action(gain: float = 100.0, unit: str = "N", name: str = "slide") -> Layout:
    return Layout((motor(name, gain, unit),))


def carts(source: Layout, target: Layout, **options: Any) -> BodyMap:
    return BodyMap.between(
        pendulum_observation(), pendulum_observation(), source, target, **options
    )


def grown(**options: Any) -> BodyMap:
    return BodyMap.between(*GROWN, **options)


GROWN = ant_observation(), ant_observation(feet=True), ant_action(), ant_action(feet=True)
