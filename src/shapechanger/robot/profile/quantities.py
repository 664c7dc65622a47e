"""What a robot may sense: the numbers of its state, by name."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from shapechanger.layout import Element, Feature
from shapechanger.robot.guard.plan import ActionPlan, LimitPlan, SensorPlan

__all__ = ["APPLIED", "COLLISION", "QUANTITIES", "STALL", "Quantity", "state_features"]

APPLIED: Final = "applied"
"""Last part of the name of a feature that says what an action really does: `steering/applied`."""

STALL: Final = "stall"
"""What the guard concludes from a speed that is measured: it pushes and does not move."""

COLLISION: Final = "collision"
"""What the guard concludes from a bumper, or from a stall."""


class Quantity(NamedTuple):
    """One number that a sensor gives.

    Attributes:
        measures: Which sensors give it, as in `SensorPlan.measures`; or what the guard concludes.
        unit: Its SI unit.
        low: Smallest value.
        high: Largest value.
    """

    measures: str
    unit: str
    low: float = -math.inf
    high: float = math.inf


QUANTITIES: Final = {
    "speed": Quantity("speed", "m/s"),
    "distance": Quantity("distance", "m", low=0.0),
    "bump": Quantity("bump", "1", 0.0, 1.0),
    "stall": Quantity(STALL, "1", 0.0, 1.0),
    "collision": Quantity(COLLISION, "1", 0.0, 1.0),
    "yaw_rate": Quantity("imu", "rad/s"),
    "acceleration_x": Quantity("imu", "m/s²"),
    "acceleration_y": Quantity("imu", "m/s²"),
    "battery": Quantity("battery", "V", low=0.0),
    "temperature": Quantity("temperature", "°C"),
}
"""The quantities by their names in `GuardState.quantities`, in the order of the state."""


def state_features(
    sensors: Iterable[SensorPlan], actions: Iterable[ActionPlan], limits: LimitPlan
) -> list[Feature]:
    """A feature for each quantity that a robot senses.

    Without a sensor the guard estimates the speed from an action that propels and whose profile
    says how fast it makes the robot, in m/s. Stalls and collisions are what the guard concludes.
    """
    sources: dict[str, Element] = {}
    for sensor in sensors:
        sources.setdefault(sensor.measures, Element("sensor", sensor.name))
    if "speed" in sources and limits.stall_s > 0.0:
        sources[STALL] = sources["speed"]
    if bumped := sources.get("bump", sources.get(STALL)):
        sources[COLLISION] = bumped
    for action in actions:
        if action.propels and action.unit == QUANTITIES["speed"].unit:
            sources.setdefault("speed", Element("actuator", action.name))
    return [
        Feature(name, q.unit, q.low, q.high, sources[q.measures])
        for name, q in QUANTITIES.items()
        if q.measures in sources
    ]
