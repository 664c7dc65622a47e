"""What an expert knows of the vehicle that it drives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from shapechanger.errors import UnknownName

__all__ = ["TRAITS", "Traits", "traits_of"]


@dataclass(frozen=True, slots=True)
class Traits:
    """How a vehicle is driven.

    Sizes and speeds are those of the bodies in `shapechanger.bodies.vehicles`; the rest was
    tuned on them, on seeds for training.

    Attributes:
        drive: What turns it: front wheels, two tracks, or a rudder.
        half_width_m: Of its widest part.
        nose_m: From its origin to its front.
        margin_m: What its path leaves at each side, at least: for the corners of its hull, a
            trailer that cuts corners, and errors.
        comfort_m: What its path leaves where there is room.
        top_speed: m/s at full throttle on the level.
        cruise: Share of the top speed that it is driven at where nothing is in the way.
        lateral_limit: Acceleration across that it is not driven beyond, m/s2.
        braking: Deceleration that it can be relied on for, m/s2.
        look_m: How far ahead of itself it aims at standstill.
        look_s: How much farther for each m/s.
        turn: What one unit of steering gives: for wheels the tangent of the full lock over the
            wheelbase, which is a curvature in 1/m; for tracks the rate of turn in rad/s; for a
            rudder the rate of turn over the speed, in rad/m.
        dead: Steering below which tracks do not turn it, because they stick.
        sway: Steering that it can be disturbed by, as a standard deviation, and still put right.
        least_throttle: Lowest throttle while it goes forward; below 0 brakes by the motor.
    """

    drive: Literal["wheels", "tracks", "rudder"]
    half_width_m: float
    nose_m: float
    margin_m: float
    comfort_m: float
    top_speed: float
    cruise: float
    lateral_limit: float
    braking: float
    look_m: float
    look_s: float
    turn: float
    dead: float = 0.0
    sway: float = 0.25
    least_throttle: float = 0.0


TRAITS: Final[Mapping[str, Traits]] = MappingProxyType(
    {
        "car": Traits(
            drive="wheels",
            half_width_m=0.10,
            nose_m=0.20,
            margin_m=0.13,
            comfort_m=0.40,
            top_speed=2.0,
            cruise=0.9,
            lateral_limit=2.5,
            braking=1.5,
            look_m=0.40,
            look_s=0.22,
            turn=math.tan(math.radians(28.0)) / 0.26,
        ),
        "tank": Traits(
            drive="tracks",
            half_width_m=0.12,
            nose_m=0.16,
            margin_m=0.12,
            comfort_m=0.40,
            top_speed=1.0,
            cruise=0.9,
            lateral_limit=1.0,
            braking=1.0,
            look_m=0.35,
            look_s=0.25,
            turn=6.0,  # With `dead`, a line through what the body does at 0.1 to 0.5.
            dead=0.09,
            sway=0.12,
        ),
        "truck": Traits(
            drive="wheels",
            half_width_m=0.10,
            nose_m=0.25,
            margin_m=0.25,
            comfort_m=0.70,
            top_speed=1.5,
            cruise=0.9,
            lateral_limit=1.2,
            braking=0.8,
            look_m=0.55,
            look_s=0.30,
            turn=math.tan(math.radians(30.0)) / 0.32,
        ),
        "boat": Traits(
            drive="rudder",
            half_width_m=0.10,
            nose_m=0.30,
            margin_m=0.35,
            comfort_m=1.0,
            top_speed=1.2,
            cruise=0.95,
            lateral_limit=0.5,
            braking=0.25,
            look_m=0.8,
            look_s=0.8,
            turn=1.2,
            least_throttle=-0.3,
        ),
    }
)
"""By the name of the vehicle."""


def traits_of(name: str) -> Traits:
    """How a vehicle is driven.

    Args:
        name: Of the vehicle.

    Raises:
        UnknownName: No expert knows it.
    """
    if name not in TRAITS:
        raise UnknownName("vehicle", name, TRAITS)
    return TRAITS[name]
