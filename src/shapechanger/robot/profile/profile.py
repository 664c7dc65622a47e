"""A robot's profile, its layouts and its reward, as plain values."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from shapechanger.errors import RobotError, UnknownName
from shapechanger.layout import Element, Feature, Layout
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.dynamixel.settings import (
    ServoSettings,
    bus_settings,
    servo_settings,
)
from shapechanger.robot.drivers.settings import number, numbers, texts
from shapechanger.robot.guard.plan import (
    ActionPlan,
    GuardPlan,
    LimitPlan,
    OutputPlan,
    SensorPlan,
    StopPlan,
)
from shapechanger.robot.profile.mistakes import Source, called

_APPLIED: Final = "applied"
"""Suffix of the features with the applied value of an action: `steering/applied`."""

_STALL: Final = "stall"
"""Stall, concluded by the guard from a measured speed: pushing without moving."""

TENDONS: Final = "tendons"
"""Measurements of a servo bus: `FDP/length`, `FDP/speed` and `FDP/tension`."""

JOINTS: Final = "joints"
"""Measurement of joint encoders: `MCP_flexion/angle`."""

_COLLISION: Final = "collision"
"""Collision, concluded by the guard from a bumper or a stall."""


class Quantity(NamedTuple):
    """One number measured by a sensor.

    Attributes:
        measures: Kind of the sensors that give it, as in `SensorPlan.measures`, or a conclusion.
        unit: Its SI unit.
        low: Smallest value.
        high: Largest value.
    """

    measures: str
    unit: str
    low: float = -math.inf
    high: float = math.inf


_QUANTITIES: Final = {
    "speed": Quantity("speed", "m/s"),
    "distance": Quantity("distance", "m", low=0.0),
    "bump": Quantity("bump", "1", 0.0, 1.0),
    "stall": Quantity(_STALL, "1", 0.0, 1.0),
    "collision": Quantity(_COLLISION, "1", 0.0, 1.0),
    "yaw_rate": Quantity("imu", "rad/s"),
    "acceleration_x": Quantity("imu", "m/s²"),
    "acceleration_y": Quantity("imu", "m/s²"),
    "battery": Quantity("battery", "V", low=0.0),
    "temperature": Quantity("temperature", "°C"),
}
"""Quantities by their names in `GuardState.quantities`, in the order of the state."""


def _state_features(
    sensors: Iterable[SensorPlan], actions: Iterable[ActionPlan], limits: LimitPlan
) -> list[Feature]:
    """Return a feature for each quantity that a robot senses.

    Without a speed sensor, the guard estimates the speed from a propelling action whose profile
    gives its gain in m/s. Stalls and collisions are the guard's conclusions.
    """
    sensors = tuple(sensors)
    sources: dict[str, Element] = {}
    for sensor in sensors:
        sources.setdefault(sensor.measures, Element("sensor", sensor.name))
    if "speed" in sources and limits.stall_s > 0.0:
        sources[_STALL] = sources["speed"]
    if bumped := sources.get("bump", sources.get(_STALL)):
        sources[_COLLISION] = bumped
    for action in actions:
        if action.propels and action.unit == _QUANTITIES["speed"].unit:
            sources.setdefault("speed", Element("actuator", action.name))
    known = [
        Feature(name, q.unit, q.low, q.high, sources[q.measures])
        for name, q in _QUANTITIES.items()
        if q.measures in sources
    ]
    known += [f for s in sensors if s.measures == TENDONS for f in _tendon_features(s)]
    return known + [f for s in sensors if s.measures == JOINTS for f in _joint_features(s)]


def _tendon_features(sensor: SensorPlan) -> list[Feature]:
    """Return length, speed and tension of each tendon on a servo bus."""
    names = texts(sensor.settings, "tendons")
    most = numbers(sensor.settings, "most_tensions_n")
    parts = [(name, n, Element("tendon", name)) for name, n in zip(names, most, strict=True)]
    return [
        *(Feature(f"{name}/length", "m", element=part) for name, _, part in parts),
        *(Feature(f"{name}/speed", "m/s", element=part) for name, _, part in parts),
        *(Feature(f"{name}/tension", "N", 0.0, n, part) for name, n, part in parts),
    ]


def _joint_features(sensor: SensorPlan) -> list[Feature]:
    """Return the angle of each joint, within half a turn of its zero."""
    names = texts(sensor.settings, "joints")
    return [
        Feature(f"{name}/angle", "rad", -math.pi, math.pi, Element("joint", name)) for name in names
    ]


_DRIVER: Final = "dynamixel"


def with_servo_bus(
    source: Source,
    bus: Mapping[str, Any] | None,
    outputs: tuple[OutputPlan, ...],
    sensors: tuple[SensorPlan, ...],
    stop: StopPlan,
) -> tuple[tuple[OutputPlan, ...], tuple[SensorPlan, ...]]:
    """Add the settings of the servo bus to its outputs and sensors.

    Args:
        source: Where the profile was read.
        bus: The table of the bus; None without one.
        outputs: All outputs.
        sensors: All sensors.
        stop: How the robot stops.

    Raises:
        ProfileError: If outputs lack a bus, or a bus lacks outputs or a sensor; if two servos share
            an id, a servo cannot do what it is set to, or a stop would not release it.
    """
    on_bus = [output for output in outputs if output.driver == _DRIVER]
    sensing = [sensor for sensor in sensors if sensor.driver == _DRIVER]
    if not on_bus:
        if bus is not None:
            words = f"[servo_bus] needs an output with the driver {_DRIVER}"
            raise source.mistake(("servo_bus",), words)
        if sensing:
            words = f"{called(('sensor', sensing[0].name))} needs outputs with the driver {_DRIVER}"
            raise source.mistake(("sensor", sensing[0].name), words)
        return outputs, sensors
    first = ("output", on_bus[0].name)
    if bus is None:
        raise source.mistake(first, f"{called(first)} is on a bus: add [servo_bus]")
    if len(sensing) != 1:
        words = (
            f"servos need one sensor with the driver {_DRIVER}, such as [sensor.tendons], which "
            "hears when one of them fails"
        )
        raise source.mistake(("sensor",) if not sensing else ("sensor", sensing[1].name), words)
    if stop.then != "release":
        words = 'then of [stop] must be "release", so that no servo pulls while nobody commands'
        raise source.mistake(("stop", "then"), words)
    whole = [replace(output, settings={**output.settings, **bus}) for output in on_bus]
    _check(source, whole, bus)
    tendons: dict[str, Any] = {
        "device": bus["device"],
        "tendons": [output.name for output in on_bus],
        "most_tensions_n": [number(output.settings, "most_tension_n") for output in on_bus],
    }
    by_name = {output.name: output for output in whole}
    return (
        tuple(by_name.get(output.name, output) for output in outputs),
        tuple(
            replace(sensor, settings={**sensor.settings, **tendons})
            if sensor in sensing
            else sensor
            for sensor in sensors
        ),
    )


def _tension_spans(outputs: Iterable[OutputPlan]) -> dict[str, float]:
    """Return the tension span, N, of each action that alone pulls one tendon."""
    outputs = tuple(outputs)
    moved = [name for output in outputs for name in output.mix]
    spans: dict[str, float] = {}
    for output in outputs:
        if output.driver != _DRIVER or output.offset or len(output.mix) != 1:
            continue
        ((name, weight),) = output.mix.items()
        if weight == 1.0 and moved.count(name) == 1:
            settings = output.settings
            spans[name] = number(settings, "most_tension_n") - number(settings, "pretension_n")
    return {name: span for name, span in spans.items() if span > 0.0}


def _check(source: Source, outputs: list[OutputPlan], bus: Mapping[str, Any]) -> None:
    """Report, with its line, what the driver would refuse."""
    servos: list[ServoSettings] = []
    for output in outputs:
        try:
            servos.append(servo_settings(output))
        except (RobotError, UnknownName) as error:
            words = str(error).rstrip(".")
            raise source.mistake(("output", output.name), words) from error
    try:
        bus_settings({**outputs[0].settings, **bus}, tuple(servos))
    except RobotError as error:
        raise source.mistake(("servo_bus",), str(error).rstrip(".")) from error


# Layouts are in SI units; profiles may use degrees.
_SI: Final = {"deg": ("rad", math.pi / 180.0)}


class ResetStep(NamedTuple):
    """One step of the reset routine.

    Attributes:
        values: One number for each action, in order.
        seconds: Duration, s.
    """

    values: tuple[float, ...]
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile(GuardPlan):
    """A robot: what it moves and senses, its caps, and when it stops.

    Attributes:
        path: The file that it was read from.
        body: Kind of robot, such as "car".
        control_hz: Expected rate of commands, Hz.
        calibrated: Date of calibration; None if it never was.
        camera: Its camera; None without one.
        max_observation_age_ms: Largest age of the observation that a command answers, ms.
        arming: Who may arm it.
        reward: Weights of the task, as in `Welcome.reward`: "velocity" per metre forward,
            "collision" per collision, "stall" per second of stall, and "collision_ends_episode",
            1 or 0.
        reset: The reset routine; empty for none.
    """

    path: Path
    body: str
    control_hz: float
    calibrated: datetime.date | None
    camera: CameraPlan | None
    max_observation_age_ms: int
    arming: Literal["person", "anyone"]
    reward: dict[str, float]
    reset: tuple[ResetStep, ...]

    def guard_plan(self) -> GuardPlan:
        """Return only what the guard needs."""
        return GuardPlan(**{field.name: getattr(self, field.name) for field in fields(GuardPlan)})

    def action_layout(self) -> Layout:
        """Return the layout of commands.

        The range is the full range of each action. The caps of the robot clip commands, and
        `action_applied` shows the result. The action of a tendon has a gain in newtons, from its
        pretension at 0 to its largest tension at 1.
        """
        spans = _tension_spans(self.outputs)
        return Layout(
            tuple(_action_feature(action, spans.get(action.name)) for action in self.actions)
        )

    def state_layout(self) -> Layout:
        """Return the layout of states: sensed quantities, then applied actions."""
        applied = tuple(
            Feature(
                f"{action.name}/{_APPLIED}",
                "1",
                0.0 if action.one_sided else -1.0,
                1.0,
                Element("actuator", action.name),
            )
            for action in self.actions
        )
        return Layout((*_state_features(self.sensors, self.actions, self.limits), *applied))


def _action_feature(action: ActionPlan, span_n: float | None) -> Feature:
    """Return the feature of an action; `span_n` is the tension span of its tendon, N."""
    unit, factor = _SI.get(action.unit, (action.unit, 1.0))
    if span_n is not None and unit == "1":
        unit, factor = "N", span_n
    return Feature(
        action.name,
        "1",
        0.0 if action.one_sided else -1.0,
        1.0,
        Element("actuator", action.name),
        gain=action.gain * factor,
        gain_unit="" if unit == "1" else unit,
    )
