"""Driving properties of the vehicles, for the expert."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from shapechanger.errors import UnknownName
from shapechanger.vehicles.bodies import VEHICLES, VehicleModel

PERIOD_S: Final = 0.05
"""Control period of the experts, s."""


@dataclass(frozen=True, slots=True)
class Traits:
    """Driving properties of a vehicle.

    All but the body was tuned on training courses.

    Attributes:
        body: Model of the vehicle.
        drive: Kind of steering: front wheels, two tracks, or a rudder.
        margin_m: Smallest clearance on each side of its path: for the corners of its hull, a
            trailer that cuts corners, and errors.
        comfort_m: Preferred clearance.
        cruise: Share of the top speed on free, straight lanes.
        lateral_limit: Largest lateral acceleration, m/s2.
        braking: Reliable deceleration, m/s2.
        look_m: Look-ahead distance at standstill.
        look_s: Additional look-ahead distance per speed.
        turn: Effect of one unit of steering: for wheels the tangent of the full lock over the
            wheelbase, a curvature, 1/m; for tracks the rate of turn, rad/s; for a rudder the rate
            of turn over the speed, rad/m.
        dead: Dead band of a tank's steering, from friction of the tracks.
        sway: Standard deviation of steering noise that it can correct.
        least_throttle: Smallest throttle while driving forward; below 0 brakes with the motor.
    """

    body: VehicleModel
    drive: Literal["wheels", "tracks", "rudder"]
    margin_m: float
    comfort_m: float
    cruise: float
    lateral_limit: float
    braking: float
    look_m: float
    look_s: float
    turn: float
    dead: float = 0.0
    sway: float = 0.25
    least_throttle: float = 0.0

    @property
    def half_width_m(self) -> float:
        """Half of the vehicle's largest width, m."""
        return self.body.width_m / 2

    @property
    def top_speed(self) -> float:
        """Speed at full throttle on level ground, m/s."""
        return self.body.top_speed_mps


TRAITS: Final[Mapping[str, Traits]] = MappingProxyType(
    {
        "car": Traits(
            body=VEHICLES["car"],
            drive="wheels",
            margin_m=0.13,
            comfort_m=0.40,
            cruise=0.9,
            lateral_limit=2.5,
            braking=1.5,
            look_m=0.40,
            look_s=0.22,
            turn=math.tan(math.radians(28.0)) / 0.26,
        ),
        "tank": Traits(
            body=VEHICLES["tank"],
            drive="tracks",
            margin_m=0.12,
            comfort_m=0.40,
            cruise=0.9,
            lateral_limit=1.0,
            braking=1.0,
            look_m=0.35,
            look_s=0.25,
            turn=6.0,  # With `dead`, a linear fit to the body at 0.1 to 0.5.
            dead=0.09,
            sway=0.12,
        ),
        "truck": Traits(
            body=VEHICLES["truck"],
            drive="wheels",
            margin_m=0.25,
            comfort_m=0.70,
            cruise=0.9,
            lateral_limit=1.2,
            braking=0.8,
            look_m=0.55,
            look_s=0.30,
            turn=math.tan(math.radians(30.0)) / 0.32,
        ),
        "boat": Traits(
            body=VEHICLES["boat"],
            drive="rudder",
            margin_m=0.35,
            comfort_m=1.0,
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
"""Driving properties by the name of the vehicle."""


def traits_of(name: str) -> Traits:
    """Find driving properties by the name of the vehicle.

    Raises:
        UnknownName: If the vehicle is unknown.
    """
    if name not in TRAITS:
        raise UnknownName("vehicle", name, TRAITS)
    return TRAITS[name]
