"""Plan of a robot: the actions, outputs, sensors and limits of its profile.

The guard of a robot and its simulations use the same plan. The classes are tables of a profile
(`shapechanger.robot.profile`), whose bounds are checked when it is loaded. They are in this module
so that the guard need not import the reader of profiles. The guard receives the plan as JSON.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import Meta

DrivingPart = Literal[
    "wheels", "left track", "right track", "propeller", "left propeller", "right propeller"
]
Part = Literal["", DrivingPart, "steering", "rudder", "gear", "bed", "joint", "tendon"]

Mix = Annotated[
    dict[str, Annotated[float, Meta(ge=-10, le=10)]],
    Meta(description="a table of numbers from -10 to 10, keyed by action"),
]


@dataclass(frozen=True, slots=True)
class ActionPlan:
    """One action of a robot.

    Attributes:
        name: Name, such as "steering".
        low: Lower cap; smaller values are clipped.
        high: Upper cap. The full range of an action is -1 to 1, or 0 to 1 if `one_sided`.
        rest: Value at rest, which is also the value after a stop.
        slew_per_s: Fastest change away from rest, 1/s.
        slew_down_per_s: Fastest change towards rest, 1/s. An action that propels has no limit.
        levels: "any", or "three" for a motor with only full left, off and full right.
        threshold: Magnitude from which a value counts as full if `levels` is "three".
        propels: Whether the action propels the robot; a stop sets such an action to rest at once.
        one_sided: Whether the range is 0 to 1.
        unit: Unit of the physical quantity that the action sets; "1" if it is not known.
        gain: Effect of one unit of the action, in `unit`.
    """

    name: str
    low: Annotated[float, Meta(ge=-1, le=1)] = -1.0
    high: Annotated[float, Meta(ge=-1, le=1)] = 1.0
    rest: Annotated[float, Meta(ge=-1, le=1)] = 0.0
    slew_per_s: Annotated[float, Meta(gt=0)] = math.inf
    slew_down_per_s: Annotated[float, Meta(gt=0)] = math.inf
    levels: Literal["any", "three"] = "any"
    threshold: Annotated[float, Meta(gt=0, le=1)] = 0.33
    propels: bool = False
    one_sided: bool = False
    unit: Literal["1", "deg", "rad", "m", "m/s", "N", "N·m"] = "1"
    gain: Annotated[float, Meta(gt=0, le=1e6)] = 1.0

    def contradictions(self) -> Iterator[tuple[str, str]]:
        """Yield each key that contradicts other keys, and the end of a sentence about it."""
        if self.one_sided and self.low < 0.0:
            yield "low", "must be 0 to 1, because it is one-sided"
        if not self.low < self.high:
            yield "high", f"must be above low, which is {self.low:g}, not {self.high:g}"
        if not self.low <= self.rest <= self.high:
            yield "rest", f"must lie between low and high, {self.low:g} to {self.high:g}"
        if self.propels and self.rest != 0.0:
            yield "rest", "must be 0, because it propels"
        if self.propels and self.slew_down_per_s < math.inf:
            yield "slew_down_per_s", "must be left out, because it propels: a stop is immediate"
        if self.gain != 1.0 and self.unit == "1":
            yield "gain", "needs a unit, such as unit = 'deg'"


@dataclass(frozen=True, slots=True)
class OutputPlan:
    """One motor, servo or controller, with its weight of each action.

    Its value is `offset` plus the weighted sum of the actions, clipped to -1 to 1.

    Attributes:
        name: Name, such as "left".
        driver: Name of the driver, such as "hbridge".
        part: The part that the output moves, such as "wheels" or "left track"; may be empty.
        mix: Weight of each action.
        offset: Value if all actions are 0.
        settings: Settings of the driver, such as pins and pulse widths, with all defaults filled
            in.
    """

    name: str
    driver: str
    part: Part = ""
    mix: Mix = field(default_factory=dict[str, float])
    offset: Annotated[float, Meta(ge=-1, le=1)] = 0.0
    settings: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, slots=True)
class SensorPlan:
    """One sensor of the guard.

    Attributes:
        name: Name, such as "bumper".
        driver: Name of its driver, such as "switch".
        measures: Measured quantity: "speed", "bump", "distance", "imu", "battery",
            "temperature", "tendons" or "joints".
        settings: Settings of the driver, with all defaults filled in.
    """

    name: str
    driver: str
    measures: str
    settings: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, slots=True)
class LimitPlan:
    """Limits beyond which the robot stops by itself, or does not move in one direction.

    Attributes:
        deadline_ms: Time for which the newest command is valid before the robot stops, ms.
        camera_stale_ms: Age of the newest frame at which the robot stops, ms; 0 for a robot without
            a camera. The default of a profile with a camera is 500.
        bump_hold_ms: Time for which a bump blocks forward motion, ms. All bumpers count as front
            bumpers, so the robot may still reverse.
        stop_distance_m: Distance ahead below which forward motion is blocked, m; 0 to disable.
            Forward motion is also blocked while a distance sensor has no reading.
        stall_s: Longest push without motion, s; then pushing further is blocked; 0 to disable.
        stall_throttle: Propulsion above which motion is expected.
        low_battery_v: Voltage below which the robot stops, V; 0 to disable.
        high_temperature_c: CPU temperature above which the robot stops, °C; 0 to disable.
    """

    deadline_ms: Annotated[int, Meta(ge=20, le=1000)] = 250
    camera_stale_ms: Annotated[int, Meta(ge=0, le=5000)] = 0
    bump_hold_ms: Annotated[int, Meta(ge=0, le=60_000)] = 750
    stop_distance_m: Annotated[float, Meta(ge=0, le=5)] = 0.0
    stall_s: Annotated[float, Meta(ge=0, le=10)] = 0.4
    stall_throttle: Annotated[float, Meta(gt=0, le=1)] = 0.2
    low_battery_v: Annotated[float, Meta(ge=0, le=100)] = 0.0
    high_temperature_c: Annotated[float, Meta(ge=0, le=120)] = 0.0

    measured: ClassVar = {
        "stop_distance_m": "distance",
        "low_battery_v": "battery",
        "high_temperature_c": "temperature",
        "stall_s": "speed",
        "bump_hold_ms": "bump",
    }
    """Quantity that a sensor must measure, keyed by the limit that has no effect without it."""


@dataclass(frozen=True, slots=True)
class StopPlan:
    """Course of a stop for the actions that do not propel.

    Attributes:
        hold_ms: Time for which the actions keep their values, ms.
        ramp_ms: Duration of the following ramp to rest, ms.
        then: Whether the outputs stay powered at rest after the ramp ("hold") or are released.
    """

    hold_ms: Annotated[int, Meta(ge=0, le=10_000)] = 0
    ramp_ms: Annotated[int, Meta(ge=0, le=10_000)] = 0
    then: Literal["hold", "release"] = "hold"


@dataclass(frozen=True, slots=True)
class GuardPlan:
    """Everything that the guard needs.

    Attributes:
        name: Name of the robot.
        actions: The actions of a command, in order.
        outputs: The outputs that the actions move.
        sensors: The sensors that the guard reads.
        limits: Limits beyond which the robot stops by itself, or does not move in one direction.
        stop: Course of a stop.
        enable_pin: BCM pin that the guard toggles while it runs, for the one-shot circuit that
            keeps the enable line of the motors active; None without it.
        stop_pin: BCM pin of an emergency stop button to ground; None without a button.
        tick_hz: Rate at which the rules run without commands, Hz.
        enable_hold_ms: Time for which the one-shot keeps the enable line active after the last
            toggle of `enable_pin`, ms. Twins of the wiring and settings of servos depend on it.
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
        """Return the plan as JSON."""
        return json.dumps(asdict(self))  # Unlike msgspec, json keeps infinite slews.

    @classmethod
    def from_json(cls, text: str) -> GuardPlan:
        """Read the output of `to_json`."""
        return msgspec.convert(json.loads(text), cls)


def output_values(plan: GuardPlan, actions: Sequence[float]) -> tuple[float, ...]:
    """Return the value of each output: offset plus weighted sum of the actions, clipped to [-1, 1].

    Args:
        plan: The robot.
        actions: One number for each action of the robot, in order.

    Raises:
        ValueError: If the number of actions is wrong.
    """
    if len(actions) != len(plan.actions):
        names = ", ".join(action.name for action in plan.actions)
        raise ValueError(
            f"{plan.name} has {len(plan.actions)} actions ({names}), got {len(actions)} numbers."
        )
    named = {action.name: value for action, value in zip(plan.actions, actions, strict=True)}
    mixed = [
        o.offset + sum([weight * named[a] for a, weight in o.mix.items()]) for o in plan.outputs
    ]
    return tuple([max(-1.0, min(1.0, value)) for value in mixed])


def driven_pins(plan: GuardPlan) -> dict[int, str]:
    """Return the use of each pin that drives an output or the enable line, keyed by BCM number."""
    keys = ("forward", "backward", "enable", "phase", "pin")
    used = {o.settings.get(key, -1): f"{o.name} {key}" for o in plan.outputs for key in keys}
    enable = {} if plan.enable_pin is None else {plan.enable_pin: "enable line"}
    return {pin: use for pin, use in (used | enable).items() if pin >= 0}
