"""What a robot may sense: the numbers of its state, by name."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from shapechanger.layout import Element, Feature
from shapechanger.robot.drivers.settings import numbers, texts
from shapechanger.robot.guard.plan import ActionPlan, LimitPlan, SensorPlan

__all__ = [
    "APPLIED",
    "COLLISION",
    "JOINTS",
    "QUANTITIES",
    "STALL",
    "TENDONS",
    "Quantity",
    "state_features",
]

APPLIED: Final = "applied"
"""Last part of the name of a feature that says what an action really does: `steering/applied`."""

STALL: Final = "stall"
"""What the guard concludes from a speed that is measured: it pushes and does not move."""

TENDONS: Final = "tendons"
"""What the sensor of a servo bus measures: `FDP/length`, `FDP/speed` and `FDP/tension`."""

JOINTS: Final = "joints"
"""What encoders at joints measure: `MCP_flexion/angle`."""

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
    sensors = tuple(sensors)
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
    known = [
        Feature(name, q.unit, q.low, q.high, sources[q.measures])
        for name, q in QUANTITIES.items()
        if q.measures in sources
    ]
    known += [f for s in sensors if s.measures == TENDONS for f in _tendon_features(s)]
    return known + [f for s in sensors if s.measures == JOINTS for f in _joint_features(s)]


def _tendon_features(sensor: SensorPlan) -> list[Feature]:
    """Length, speed and tension of each tendon of a servo bus."""
    names = texts(sensor.settings, "tendons")
    most = numbers(sensor.settings, "most_tensions_n")
    parts = [(name, n, Element("tendon", name)) for name, n in zip(names, most, strict=True)]
    return [
        *(Feature(f"{name}/length", "m", element=part) for name, _, part in parts),
        *(Feature(f"{name}/speed", "m/s", element=part) for name, _, part in parts),
        *(Feature(f"{name}/tension", "N", 0.0, n, part) for name, n, part in parts),
    ]


def _joint_features(sensor: SensorPlan) -> list[Feature]:
    """Angle of each joint, within half a turn around its zero."""
    names = texts(sensor.settings, "joints")
    return [
        Feature(f"{name}/angle", "rad", -math.pi, math.pi, Element("joint", name)) for name in names
    ]
