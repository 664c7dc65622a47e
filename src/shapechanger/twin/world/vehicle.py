"""How vehicles move: seen from above, without slip except on water.

A vehicle turns what its outputs do into speed ahead, speed to the left and rate of turn. Its
numbers are those of toys of 20 to 30 cm; none was measured on one vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Final, NamedTuple, Protocol

from shapechanger.errors import RobotError

__all__ = ["Motion", "Vehicle", "vehicle_for"]

Outputs = Mapping[str, float | None]

DEAD_BAND: Final = 0.04
"""Size of a value below which friction holds a motor."""

# Cars and trucks.
CAR_SPEED: Final = 1.5  # m/s at full throttle
CAR_LAG_S: Final = 0.15  # Time in which the speed makes up 63 % of a difference.
WHEELBASE: Final = 0.18  # m
FULL_LOCK: Final = math.radians(28.0)  # Angle of the front wheels at a steering of 1.
STEERING_LAG_S: Final = 0.08

# Tanks and other vehicles that steer by two sides.
TRACK_SPEED: Final = 0.8  # m/s
TRACK_LAG_S: Final = 0.12
TRACK_GAUGE: Final = 0.16  # m between the tracks, longer than measured because they slip in turns

# Boats.
BOAT_SPEED: Final = 0.9  # m/s
BOAT_LAG_S: Final = 1.2
PROPELLER_LAG_S: Final = 0.2
REVERSE_THRUST: Final = 0.5  # Share of the thrust that is left astern.
RUDDER_RATE: Final = 1.2  # rad/s of turn at a speed of 1 and full rudder
TWIN_RATE: Final = 1.0  # rad/s of turn with one propeller ahead and one astern
TURN_LAG_S: Final = 0.5
DRIFT_S: Final = 0.6  # Time for which a hull slides on in its old direction.


class Motion(NamedTuple):
    """How a vehicle moves.

    Attributes:
        ahead: m/s along its heading.
        left: m/s to its left.
        yaw_rate: rad/s, counter-clockwise seen from above.
    """

    ahead: float
    left: float
    yaw_rate: float


class Vehicle(Protocol):
    """Something that moves."""

    def move(self, dt_s: float, outputs: Outputs) -> Motion:
        """How it moves after a short time."""
        ...

    def halt(self) -> None:
        """It ran into something: it stops at once, while its motors go on."""
        ...


class _Car:
    """Wheels that drive and wheels that steer: the kinematic bicycle model."""

    def __init__(self) -> None:
        self._speed = 0.0
        self._steering = 0.0

    def move(self, dt_s: float, outputs: Outputs) -> Motion:
        throttle = _after_dead_band(outputs.get("wheels"))
        self._speed = _lagged(self._speed, CAR_SPEED * throttle, CAR_LAG_S, dt_s)
        steering = outputs.get("steering", 0.0)
        if steering is not None:  # A servo without pulses stays where it is.
            self._steering = _lagged(self._steering, steering, STEERING_LAG_S, dt_s)
        # Steering is negative to the left, a turn to the left is positive.
        return Motion(
            self._speed,
            0.0,
            -self._speed * math.tan(FULL_LOCK * self._steering) / WHEELBASE,
        )

    def halt(self) -> None:
        self._speed = 0.0


class _Tracks:
    """One track or row of wheels on each side."""

    def __init__(self) -> None:
        self._left = self._right = 0.0

    def move(self, dt_s: float, outputs: Outputs) -> Motion:
        left = TRACK_SPEED * _after_dead_band(outputs.get("left track"))
        right = TRACK_SPEED * _after_dead_band(outputs.get("right track"))
        self._left = _lagged(self._left, left, TRACK_LAG_S, dt_s)
        self._right = _lagged(self._right, right, TRACK_LAG_S, dt_s)
        ahead = (self._left + self._right) / 2
        return Motion(ahead, 0.0, (self._right - self._left) / TRACK_GAUGE)

    def halt(self) -> None:
        middle = (self._left + self._right) / 2
        self._left -= middle
        self._right -= middle


class _Boat:
    """A hull with a propeller and a rudder, or with two propellers."""

    def __init__(self) -> None:
        self._thrust = {"propeller": 0.0, "left propeller": 0.0, "right propeller": 0.0}
        self._ahead = self._left = self._yaw_rate = 0.0

    def move(self, dt_s: float, outputs: Outputs) -> Motion:
        for part in self._thrust:
            value = _after_dead_band(outputs.get(part))
            value *= REVERSE_THRUST if value < 0.0 else 1.0
            self._thrust[part] = _lagged(self._thrust[part], value, PROPELLER_LAG_S, dt_s)
        middle, left, right = self._thrust.values()
        thrust = middle + (left + right) / 2
        self._ahead = _lagged(self._ahead, BOAT_SPEED * thrust, BOAT_LAG_S, dt_s)
        # The rudder works on the water that flows by and on what the propeller throws at it.
        flow = self._ahead / BOAT_SPEED + max(middle, 0.0)
        turn = -RUDDER_RATE * flow * (outputs.get("rudder") or 0.0)
        turn += TWIN_RATE * (right - left) / (1.0 + REVERSE_THRUST)
        self._yaw_rate = _lagged(self._yaw_rate, turn, TURN_LAG_S, dt_s)
        # In a turn to the left the hull slides on to its right.
        self._left = _lagged(self._left, -self._ahead * self._yaw_rate * DRIFT_S, DRIFT_S, dt_s)
        return Motion(self._ahead, self._left, self._yaw_rate)

    def halt(self) -> None:
        self._ahead = self._left = 0.0


class _Still:
    """Legs, fingers and everything else whose motion this world does not know."""

    def move(self, dt_s: float, outputs: Outputs) -> Motion:
        return Motion(0.0, 0.0, 0.0)

    def halt(self) -> None:
        pass


def vehicle_for(parts: Collection[str]) -> Vehicle:
    """The vehicle that has these parts.

    Raises:
        RobotError: If they belong to vehicles of two kinds.
    """
    kinds: list[type[_Car] | type[_Tracks] | type[_Boat]] = []
    if {"wheels", "steering"} & set(parts):
        kinds.append(_Car)
    if {"left track", "right track"} & set(parts):
        kinds.append(_Tracks)
    if {"propeller", "left propeller", "right propeller", "rudder"} & set(parts):
        kinds.append(_Boat)
    if len(kinds) > 1:
        raise RobotError(f"No vehicle has all of these parts: {', '.join(sorted(parts))}.")
    return kinds[0]() if kinds else _Still()


def _after_dead_band(value: float | None) -> float:
    return 0.0 if value is None or abs(value) < DEAD_BAND else value


def _lagged(value: float, target: float, lag_s: float, dt_s: float) -> float:
    """A first-order lag, exact for a target that stays."""
    return target + (value - target) * math.exp(-dt_s / lag_s)
