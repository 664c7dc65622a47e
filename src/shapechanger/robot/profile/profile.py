"""A robot's profile, its layouts and its reward, as plain values."""

from __future__ import annotations

import datetime
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

from msgspec import Meta

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan
from shapechanger.layout import Element, Feature, Layout
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.chip import SENSORS, Text

_INF: Final = math.inf
# Unit, smallest and largest value of each quantity of the guard, in the order of the state (chips
# may add others), and the kind of sensor that measures it (see `SensorPlan.measures`). The guard
# derives stalls from a measured speed, and collisions from a bumper or a stall.
QUANTITIES: Final = {
    "speed": ("m/s", -_INF, _INF, "speed"),
    "distance": ("m", 0.0, _INF, "distance"),
    "bump": ("1", 0.0, 1.0, "bump"),
    "stall": ("1", 0.0, 1.0, "stall"),
    "collision": ("1", 0.0, 1.0, "collision"),
    "yaw_rate": ("rad/s", -_INF, _INF, "imu"),
    "acceleration_x": ("m/s²", -_INF, _INF, "imu"),
    "acceleration_y": ("m/s²", -_INF, _INF, "imu"),
    "battery": ("V", 0.0, _INF, "battery"),
    "temperature": ("°C", -_INF, _INF, "temperature"),
}


def _tendon_spans(outputs: Sequence[OutputPlan]) -> dict[str, tuple[float, str]]:
    """Return span and unit of each action that moves one tendon, without other actions or weights.

    The span is the rise of the tension, N, or the fall of the length, m, over the values 0 to 1.
    """
    moved = [name for output in outputs for name in output.mix]
    spans: dict[str, tuple[float, str]] = {}
    for output in outputs:
        if output.driver != "bus_servo" or output.offset or list(output.mix.values()) != [1.0]:
            continue
        (name,) = output.mix
        one = output.settings
        if moved.count(name) > 1:
            continue
        if one["control"] == "length":
            spans[name] = one["longest_m"] - one["shortest_m"], "m"
        elif span := one["most_tension_n"] - one["pretension_n"]:
            spans[name] = span, "N"
    return spans


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


_A_DATE: Final = "a date, such as 2026-11-03"


@dataclass(frozen=True, kw_only=True)
class RobotTable:
    """Keys of `[robot]`.

    Attributes:
        name: Name of the robot.
        body: Kind of robot, such as "car".
        control_hz: Expected rate of commands, Hz.
        calibrated: Date of the last `shapechanger robot calibrate`; None if there was none.
        turn_deg_per_m: Turn per metre at full steering, degrees; None if not measured. Policies
            with waypoints need it on board.
        turn_deg_per_s: Turn per second at full steering, degrees, of a vehicle that turns in place,
            such as a tank; None if not measured.
    """

    name: Text
    body: Text
    control_hz: Annotated[float, Meta(ge=1, le=100)] = 20.0
    calibrated: Annotated[datetime.date, Meta(description=_A_DATE)] | None = None
    turn_deg_per_m: Annotated[float, Meta(ge=0, le=10_000)] | None = None
    turn_deg_per_s: Annotated[float, Meta(ge=0, le=10_000)] | None = None


@dataclass(frozen=True, kw_only=True)
class CommandTable:
    """Keys of `[limits]` that concern clients and their commands.

    Attributes:
        max_observation_age_ms: Largest age of the observation that a command answers, ms.
        arming: Who may arm the robot: only a person, or anyone, including programs.
    """

    max_observation_age_ms: Annotated[int, Meta(ge=20, le=5000)] = 400
    arming: Literal["person", "anyone"] = "person"


@dataclass(frozen=True, kw_only=True)
class Profile(GuardPlan, RobotTable, CommandTable):
    """A robot: actions, outputs, sensors, limits, camera and reward.

    Attributes:
        path: File of the profile.
        camera: Plan of the camera; None for a robot without a camera.
        reward: Weights of the reward, the same as `Welcome.reward`: "velocity" per metre forward,
            "collision" per collision, "stall" per second of stall, and "collision_ends_episode",
            1 or 0.
        reset: The reset routine; empty for none.
    """

    path: Path
    camera: CameraPlan | None
    reward: dict[str, float]
    reset: tuple[ResetStep, ...]

    @property
    def turning(self) -> tuple[float, float] | None:
        """Turn at full steering, rad/m and rad/s; 0 if one is not measured, None if neither is."""
        if self.turn_deg_per_m is None and self.turn_deg_per_s is None:
            return None
        return math.radians(self.turn_deg_per_m or 0.0), math.radians(self.turn_deg_per_s or 0.0)

    def guard_plan(self) -> GuardPlan:
        """Return the plan of the guard, without other settings."""
        return GuardPlan(**{field.name: getattr(self, field.name) for field in fields(GuardPlan)})

    def action_layout(self) -> Layout:
        """Return the layout of commands.

        The range is the full range of each action. The caps of the robot clip commands, and
        `action_applied` shows the result. The gain of a tendon's action is the rise of its tension
        from 0, the pretension, to 1, N; if its length is controlled, the length wound in, m.
        """
        spans = _tendon_spans(self.outputs)
        features: list[Feature] = []
        for action in self.actions:
            unit, factor = _SI.get(action.unit, (action.unit, 1.0))
            if unit == "1":
                factor, unit = spans.get(action.name, (1.0, "1"))
            gain_unit = "" if unit == "1" else unit
            features.append(_feature(action, gain=action.gain * factor, gain_unit=gain_unit))
        return Layout(tuple(features))

    def state_layout(self) -> Layout:
        """Return the layout of states: sensed quantities, then applied actions.

        Without a speed sensor, the guard estimates the speed from a propelling action whose profile
        gives its gain in m/s.
        """
        sources: dict[str, Element] = {}
        for sensor in self.sensors:
            sources.setdefault(sensor.measures, Element("sensor", sensor.name))
        if "speed" in sources and self.limits.stall_s > 0.0:
            sources["stall"] = sources["speed"]
        if bumped := sources.get("bump", sources.get("stall")):
            sources["collision"] = bumped
        for action in self.actions:
            if action.propels and action.unit == "m/s":
                sources.setdefault("speed", Element("actuator", action.name))
        features = [
            Feature(name, unit, low, high, sources[measures])
            for name, (unit, low, high, measures) in QUANTITIES.items()
            if measures in sources
        ]
        for sensor in self.sensors:
            if (own := SENSORS[sensor.driver].features) is not None:
                features += own(sensor)
        features += (_feature(action, "/applied") for action in self.actions)
        return Layout(tuple(features))


def _feature(action: ActionPlan, suffix: str = "", **gain: Any) -> Feature:
    low = 0.0 if action.one_sided else -1.0
    element = Element("actuator", action.name)
    return Feature(f"{action.name}{suffix}", "1", low, 1.0, element, **gain)
