"""What the guard needs to know of a robot: its actions, outputs, sensors and limits.

These are the tables of a profile (`shapechanger.robot.profile`), as plain dataclasses, because the
guard loads nothing but the standard library and its drivers. They cross from the command line to
the guard as JSON.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

__all__ = [
    "ActionPlan",
    "GuardPlan",
    "LimitPlan",
    "OutputPlan",
    "SensorPlan",
    "StopPlan",
    "output_values",
]

Setting = bool | int | float | str | list[int] | list[float] | list[str]


@dataclass(frozen=True, slots=True)
class ActionPlan:
    """One number of a command.

    Attributes:
        name: Its name, such as "steering".
        low: Smallest value that the robot takes: its own cap. Smaller ones are clipped.
        high: Largest value that the robot takes. The whole range of an action is -1 to 1, or 0 to 1
            where `one_sided`.
        rest: The value at rest, where a stop leads to.
        slew_per_s: How fast it may move away from rest, 1/s. Towards rest it may jump.
        levels: "any", or "three" for a motor that knows full left, off and full right only.
        threshold: Size from which on a value counts as full, where `levels` is "three".
        propels: Whether it makes the robot go. Such an action goes to rest at once at a stop.
        one_sided: Whether the range is 0 to 1.
        unit: Unit of the quantity that it moves, where it is an angle or a length.
        gain: What one unit of the action does, in `unit`.
    """

    name: str
    low: float = -1.0
    high: float = 1.0
    rest: float = 0.0
    slew_per_s: float = math.inf
    levels: Literal["any", "three"] = "any"
    threshold: float = 0.33
    propels: bool = False
    one_sided: bool = False
    unit: str = "1"
    gain: float = 1.0


@dataclass(frozen=True, slots=True)
class OutputPlan:
    """One motor, servo or controller, and how much of each action it gets.

    Its value is `offset` plus the weighted sum of the actions, clipped to -1 to 1.

    Attributes:
        name: Its name, such as "left".
        driver: Name of its driver, such as "hbridge".
        part: What it moves, such as "wheels" or "left track"; "" for something else.
        mix: Weight of each action.
        offset: Value where all actions are 0.
        settings: What the driver needs: pins, channels, pulse widths; all of its keys, those with
            their default too.
    """

    name: str
    driver: str
    part: str = ""
    mix: dict[str, float] = field(default_factory=dict[str, float])
    offset: float = 0.0
    settings: dict[str, Setting] = field(default_factory=dict[str, Setting])


@dataclass(frozen=True, slots=True)
class SensorPlan:
    """One sensor that the guard reads.

    Attributes:
        name: Its name, such as "bumper".
        driver: Name of its driver, such as "switch".
        measures: What it measures: "speed", "bump", "distance", "imu", "battery",
            "temperature", "tendons" or "joints".
        settings: What the driver needs; all of its keys, those with their default too.
    """

    name: str
    driver: str
    measures: str
    settings: dict[str, Setting] = field(default_factory=dict[str, Setting])


@dataclass(frozen=True, slots=True)
class LimitPlan:
    """When the robot stops by itself.

    Attributes:
        deadline_ms: How long the newest command acts; then the robot stops.
        camera_stale_ms: Age of the newest picture from which on the robot is blind, and stops; 0
            for a robot without a camera.
        bump_hold_ms: How long a bump keeps the robot from going forward. All bumpers count as front
            bumpers: touched from behind, it may still go backward.
        stop_distance_m: Distance ahead below which it does not go forward, nor does it while
            a sensor knows none; 0 for never.
        stall_s: How long it may push without moving before it stops; 0 for ever.
        stall_throttle: Propulsion above which it should move.
        low_battery_v: Voltage below which it stops; 0 for none.
        high_temperature_c: Temperature of the computer above which it stops; 0 for none.
    """

    deadline_ms: int = 250
    camera_stale_ms: int = 0
    bump_hold_ms: int = 750
    stop_distance_m: float = 0.0
    stall_s: float = 0.4
    stall_throttle: float = 0.2
    low_battery_v: float = 0.0
    high_temperature_c: float = 0.0


@dataclass(frozen=True, slots=True)
class StopPlan:
    """What a stop does with the actions that do not propel.

    Attributes:
        hold_ms: How long they keep their value.
        ramp_ms: How long they then take to their rest.
        then: Whether the outputs then hold the rest, or let go.
    """

    hold_ms: int = 0
    ramp_ms: int = 0
    then: Literal["hold", "release"] = "hold"


@dataclass(frozen=True, slots=True)
class GuardPlan:
    """Everything that the guard needs to know.

    Attributes:
        name: Name of the robot.
        actions: The numbers of a command, in order.
        outputs: What they move.
        sensors: What the guard reads.
        limits: When it stops by itself.
        stop: How it stops.
        enable_pin: BCM pin that is toggled while the guard lives, for the one-shot that holds the
            enable line of the motors; None without one.
        stop_pin: BCM pin of an emergency stop button to ground; None without one.
        tick_hz: How often the rules are looked at without anything happening.
        enable_hold_ms: How long the one-shot holds the enable line after the last toggle of
            `enable_pin`. The guard does not need it; a twin of the wiring does.
    """

    name: str
    actions: tuple[ActionPlan, ...]
    outputs: tuple[OutputPlan, ...]
    sensors: tuple[SensorPlan, ...] = ()
    limits: LimitPlan = LimitPlan()
    stop: StopPlan = StopPlan()
    enable_pin: int | None = None
    stop_pin: int | None = None
    tick_hz: float = 100.0
    enable_hold_ms: int = 100

    def to_json(self) -> str:
        """The plan as JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> GuardPlan:
        """Read what `to_json` wrote; for nothing else, since it checks nothing."""
        data: dict[str, Any] = json.loads(text)
        return cls(
            name=data["name"],
            actions=tuple(ActionPlan(**action) for action in data["actions"]),
            outputs=tuple(OutputPlan(**output) for output in data["outputs"]),
            sensors=tuple(SensorPlan(**sensor) for sensor in data["sensors"]),
            limits=LimitPlan(**data["limits"]),
            stop=StopPlan(**data["stop"]),
            enable_pin=data["enable_pin"],
            stop_pin=data["stop_pin"],
            tick_hz=data["tick_hz"],
            enable_hold_ms=data["enable_hold_ms"],
        )


def output_values(plan: GuardPlan, actions: Sequence[float]) -> tuple[float, ...]:
    """The value of each output, -1 to 1: its offset plus the weighted sum of the actions, clipped.

    Args:
        plan: The robot.
        actions: One number for each of its actions, in order.

    Raises:
        ValueError: If these are not as many numbers as the robot has actions.
    """
    if len(actions) != len(plan.actions):
        names = ", ".join(action.name for action in plan.actions)
        raise ValueError(
            f"{plan.name} has {len(plan.actions)} actions ({names}), got {len(actions)} numbers."
        )
    named = {action.name: value for action, value in zip(plan.actions, actions, strict=True)}
    return tuple(
        max(-1.0, min(1.0, output.offset + sum(w * named[a] for a, w in output.mix.items())))
        for output in plan.outputs
    )
