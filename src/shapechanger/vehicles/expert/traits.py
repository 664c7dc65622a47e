"""Driving properties of the vehicles, for the expert."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
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
        name: Traits(body=VEHICLES[name], **numbers)
        for name, numbers in tomllib.loads(
            Path(__file__).with_name("traits.toml").read_text("utf-8")
        ).items()
    }
)
"""Driving properties by the name of the vehicle."""


def traits_of(name: str) -> Traits:
    """Find driving properties by the name of the vehicle."""
    if name not in TRAITS:
        raise UnknownName("vehicle", name, TRAITS)
    return TRAITS[name]
