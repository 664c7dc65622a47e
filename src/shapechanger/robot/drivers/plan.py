"""Plans of an output and of a sensor, as a profile has checked them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class OutputPlan:
    """One motor, servo or controller, with its weight of each action.

    Its value is `offset` plus the weighted sum of the actions, clipped to -1 to 1.

    Attributes:
        name: Name, such as "left".
        driver: Name of its driver, such as "hbridge".
        part: The part that it moves, such as "wheels" or "left track"; may be empty.
        mix: Weight of each action.
        offset: Value where all actions are 0.
        settings: Settings of the driver, such as pins and pulse widths, with all defaults filled
            in.
    """

    name: str
    driver: str
    part: str = ""
    mix: dict[str, float] = field(default_factory=dict[str, float])
    offset: float = 0.0
    settings: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, slots=True)
class SensorPlan:
    """One sensor of the guard.

    Attributes:
        name: Name, such as "bumper".
        driver: Name of its driver, such as "switch".
        measures: What it measures: "speed", "bump", "distance", "imu", "battery",
            "temperature", "tendons" or "joints".
        settings: Settings of the driver, with all defaults filled in.
    """

    name: str
    driver: str
    measures: str
    settings: dict[str, Any] = field(default_factory=dict[str, Any])
