"""Ant: a sphere on four legs, each with a hip and an ankle.

The model is `ant.xml` of Gymnasium (MIT). The bodies are those of the 2017 Shapechanger release;
the edits below reproduce its masses, inertias, ranges, gears and lengths exactly. The third
segments of the release had no motors; here they have, and `ExtendedAntPassive` is the body without.
"""

from __future__ import annotations

import math
from typing import Final

from shapechanger.bodies import odrl
from shapechanger.bodies.families import Family, length_axes, strength_axes
from shapechanger.morphology import AddSegment, Body, Cut, JointRange, StartHeight, Stretch

# Legs in the order of the model's motors, with the signs of x and y of their directions. The ankles
# of legs 2 and 3 turn in the opposite direction.
LEGS: Final = {4: (1, -1), 1: (1, 1), 2: (-1, 1), 3: (-1, -1)}
_TURNS_BACK: Final = (2, 3)

# The third segment of the 2017 release (extended_ant.xml).
_FOOT_REACH_M: Final = 0.6  # along x and along y
_FOOT_RANGE_DEG: Final = (30.0, 70.0)
_FOOT_GEAR_NM: Final = 150.0
_ANKLE_RANGE_DEG: Final = (30.0, 50.0)
_EXTENDED_START_HEIGHT_M: Final = 1.25


def _foot(leg: int, gear: float | None) -> tuple[AddSegment, JointRange]:
    """A third segment on a leg, with a motor of this gear, N·m, or without."""
    x, y = LEGS[leg]
    end = (x * _FOOT_REACH_M, y * _FOOT_REACH_M, 0.0)
    return (
        AddSegment(f"shank_{leg}", f"foot_{leg}", end, *_range(leg, _FOOT_RANGE_DEG), gear),
        JointRange(f"ankle_{leg}", *_range(leg, _ANKLE_RANGE_DEG)),
    )


def _extended(gear: float | None) -> Body:
    """Ant with a third segment on each leg, with motors of this gear, N·m, or without."""
    feet, ankles = zip(*(_foot(leg, gear) for leg in LEGS), strict=True)
    return (*feet, *ankles, StartHeight("torso", _EXTENDED_START_HEIGHT_M))


def _range(leg: int, degrees: tuple[float, float]) -> tuple[float, float]:
    """Range of a leg's joint, rad, from that of the legs that turn forwards, degrees."""
    lower, upper = (math.radians(x) for x in degrees)
    return (-upper, -lower) if leg in _TURNS_BACK else (lower, upper)


ANT: Final = Family(
    name="Ant",
    bodies={
        "Ant": (),
        "AmputatedAnt": (Cut("shank_4", 0.25),),
        "BigAnt": (Stretch("shank_*", 2.0),),
        "ExtendedAnt": _extended(_FOOT_GEAR_NM),
        "ExtendedAntPassive": _extended(None),
    },
    bodies_by_joint={f"ankle_{leg}": f"shank_{leg}" for leg in LEGS},
    axes=(
        *length_axes((f"aux_{leg}" for leg in sorted(LEGS)), 0.7, 1.4),
        *length_axes((f"shank_{leg}" for leg in sorted(LEGS)), 0.6, 1.5),
        *strength_axes("torso"),
    ),
    parts={
        f"leg {leg}": {
            "stump": (Cut(f"shank_{leg}", 0.25),),
            "foot": _foot(leg, _FOOT_GEAR_NM),
        }
        for leg in sorted(LEGS)
    },
    published=odrl.published("ant", odrl.ANT),
)
