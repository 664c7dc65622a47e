"""Checks between the tables of a profile: pins, mixes, stops, limits and the servo bus.

Each raises a `ProfileError` with the line and one sentence.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, Literal, get_args

from shapechanger.contract.plan import ActionPlan, LimitPlan, OutputPlan, SensorPlan, StopPlan
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.chip import OUTPUTS, SENSORS
from shapechanger.robot.drivers.keys import Claim, KeyMistake, Keys
from shapechanger.robot.drivers.pins import NO_PIN
from shapechanger.robot.drivers.servos.settings import (
    DRIVER,
    ServoBusKeys,
    bus_settings,
    stops_itself,
)
from shapechanger.robot.profile.diagnostics import Section, called, choice

DrivingPart = Literal[
    "wheels", "left track", "right track", "propeller", "left propeller", "right propeller"
]
"""Part that propels the robot."""

Part = Literal["", DrivingPart, "steering", "rudder", "gear", "bed", "joint", "tendon"]
"""Part that an output may move."""


class PinAllocation:
    """Pins, channels and addresses in use, so that none is used twice.

    Args:
        root: The profile.
    """

    def __init__(self, root: Section) -> None:
        self._root = root
        self._users: dict[str, tuple[Section, Claim]] = {}

    def take(self, section: Section, keys: Keys) -> None:
        """Allocate everything that a table claims."""
        for claim in keys.claims():
            before, earlier = self._users.setdefault(claim.what, (section, claim))
            if earlier is claim or (claim.group and claim.group == earlier.group):
                continue
            line = before.line((earlier.key,))
            raise section.error_at(
                claim.key,
                f"{claim.what}{claim.use} is used twice: by {earlier.key} of {before} (line {line})"
                f" and by {claim.key} of {section}",
            )

    def shared(self, outputs: Sequence[OutputPlan]) -> tuple[OutputPlan, ...]:
        """Return outputs with the frequency and the enable pin that a PCA9685 has once."""
        chips: dict[tuple[int, ...], dict[str, Any]] = {}
        for output in outputs:
            for name in ("hz", "output_enable") if (chip := _pca9685(output)) else ():
                shared, value = chips.setdefault(chip, {}), output.settings[name]
                before = shared.setdefault(name, value)
                if before == NO_PIN:
                    shared[name] = value
                elif value not in (before, NO_PIN):
                    bus, address = chip
                    raise self._root.error_at(
                        ("output", output.name, name),
                        f"the PCA9685 at {address:#x} of I2C bus {bus} has one {name} for all its "
                        f"channels, {before} or {value}",
                    )
        return tuple(
            replace(output, settings=output.settings | chips.get(_pca9685(output), {}))
            for output in outputs
        )


def _pca9685(output: OutputPlan) -> tuple[int, ...]:
    """Return bus and address of the PCA9685 of an output; () without one."""
    settings = output.settings
    return (settings["bus"], settings["address"]) if settings.get("over") == "pca9685" else ()


def check_action(section: Section, action: ActionPlan) -> None:
    """Refuse an action that cannot rest within its caps, or whose stop would not be immediate."""
    low, high = action.low, action.high
    if action.one_sided and low < 0.0:
        raise section.error_at("low", f"low of {section} must be 0 to 1, because it is one-sided")
    if not low < high:
        message = f"high of {section} must be above low, which is {low:g}, not {high:g}"
        raise section.error_at("high", message)
    if not low <= action.rest <= high:
        message = f"rest of {section} must lie between low and high, {low:g} to {high:g}"
        raise section.error_at("rest", message)
    if action.propels and action.rest != 0.0:
        raise section.error_at("rest", f"rest of {section} must be 0, because it propels")
    if action.propels and action.slew_down_per_s < math.inf:
        raise section.error_at(
            "slew_down_per_s",
            f"{section} cannot have slew_down_per_s, because it propels: a stop is immediate",
        )
    if action.gain != 1.0 and action.unit == "1":
        message = f"gain of {section} needs a unit, such as unit = 'deg'"
        raise section.error_at("gain", message)


_NEARLY_ZERO: Final = 1e-9


def check_mix(
    root: Section, actions: Mapping[str, ActionPlan], outputs: Iterable[OutputPlan]
) -> None:
    """Refuse outputs and actions without a connection, and a rest that drives."""
    moved: set[str] = set()
    for output in outputs:
        section = root.section("output", output.name)
        if not output.mix:
            there = ", ".join(actions)
            message = f"mix of {section} is empty, so nothing moves it; there are: {there}"
            raise section.error_at("mix", message)
        for name, weight in output.mix.items():
            if name not in actions:
                message = f"mix of {section} names no action: {choice(name, actions)}"
                raise section.error_at(("mix", name), message)
            if weight == 0.0:
                message = f"the weight of {name!r} in mix of {section} is 0: leave it out"
                raise section.error_at(("mix", name), message)
        moves = output.part in get_args(DrivingPart)
        if moves and not any(actions[name].propels for name in output.mix):
            raise section.error_at(
                "mix",
                f"{section} moves the {output.part}, so an action in its mix must have "
                "propels = true",
            )
        rest = output.offset + sum(w * actions[name].rest for name, w in output.mix.items())
        if _drives(actions, output) and abs(rest) > _NEARLY_ZERO:
            raise section.error_at(
                "offset",
                f"{section} is at {rest:g} when its actions rest, and must be at 0 then, "
                "because it propels the robot",
            )
        moved |= output.mix.keys()
    for name in actions:
        if name not in moved:
            message = f"[action.{name}] moves nothing: no mix of an output names it"
            raise root.error_at(("action", name), message)


def check_stop(
    root: Section,
    stop: StopPlan,
    actions: Mapping[str, ActionPlan],
    outputs: Iterable[OutputPlan],
) -> None:
    """Refuse a stop that holds or ramps an action that contributes to a propelling output."""
    if not stop.hold_ms and not stop.ramp_ms:
        return
    key = "hold_ms" if stop.hold_ms else "ramp_ms"
    for output in outputs:
        for name in output.mix if _drives(actions, output) else ():
            if not actions[name].propels:
                raise root.error_at(
                    ("stop", key),
                    f"{key} of [stop] would keep [output.{output.name}] driving after a stop, "
                    f"because {name!r} moves it and does not propel",
                )


def _drives(actions: Mapping[str, ActionPlan], output: OutputPlan) -> bool:
    """Return whether an output can propel the robot."""
    return (
        OUTPUTS[output.driver].drives
        or output.part in get_args(DrivingPart)
        or any(actions[name].propels for name in output.mix)
    )


_CAMERA_STALE_MS: Final = 500
_NEEDS: Final = {
    "stop_distance_m": "distance",
    "low_battery_v": "battery",
    "high_temperature_c": "temperature",
    "stall_s": "speed",
    "bump_hold_ms": "bump",
}


def check_limits(
    section: Section,
    limits: LimitPlan,
    control_hz: float,
    camera: CameraPlan | None,
    sensors: Iterable[SensorPlan],
) -> LimitPlan:
    """Return the limits; refuse those that need something that is missing or too slow."""
    if limits.deadline_ms * control_hz < 1000:
        raise section.error_at(
            "deadline_ms",
            f"deadline_ms of {section} must be at least {1000 / control_hz:.0f} ms, the time from "
            f"one command to the next at control_hz = {control_hz:g}",
        )
    measured = {sensor.measures for sensor in sensors}
    for name, quantity in _NEEDS.items():
        if section.table.get(name) and quantity not in measured:
            drivers = " or ".join(d for d in SENSORS if SENSORS[d].measures == quantity)
            raise section.error_at(
                name,
                f"{name} of {section} needs a sensor that measures {quantity}, such as one with "
                f"the driver {drivers}",
            )
    key = "camera_stale_ms"
    if camera is None:
        if key in section.table:
            raise section.error_at(key, f"{key} of {section} needs a [camera]")
        return limits
    stale_ms = limits.camera_stale_ms or _CAMERA_STALE_MS
    needed_ms = 2000 / camera.fps  # One frame may be lost.
    if stale_ms < needed_ms:
        raise section.error_at(
            key,
            f"{key} of {section} must be at least {needed_ms:.0f} ms, the time of two pictures at "
            f"fps = {camera.fps:g}",
        )
    return replace(limits, camera_stale_ms=stale_ms)


# Time in which servos start whose power comes with the guard, s.
_START_S: Final = 0.5


def with_servo_bus(
    root: Section,
    bus: ServoBusKeys | None,
    outputs: tuple[OutputPlan, ...],
    sensors: tuple[SensorPlan, ...],
    stop: StopPlan,
    enable_hold_ms: int | None,
) -> tuple[tuple[OutputPlan, ...], tuple[SensorPlan, ...]]:
    """Return outputs and sensors, those of the servo bus with its settings.

    Args:
        root: The profile.
        bus: Keys of the bus; None without one.
        outputs: All outputs.
        sensors: All sensors.
        stop: How the robot stops.
        enable_hold_ms: How long the enable line stays on without the guard, ms; None without one.
    """
    servos = [output for output in outputs if output.driver == DRIVER]
    sensing = [sensor for sensor in sensors if sensor.driver == DRIVER]
    if not servos:
        if bus is not None:
            message = f"[servo_bus] needs an output with the driver {DRIVER}"
            raise root.error_at("servo_bus", message)
        if sensing:
            name = sensing[0].name
            message = f"{called('sensor', name)} needs outputs with the driver {DRIVER}"
            raise root.error_at(("sensor", name), message)
        return outputs, sensors
    if bus is None:
        first = servos[0].name
        message = f"{called('output', first)} is on a bus: add [servo_bus]"
        raise root.error_at(("output", first), message)
    if len(sensing) != 1:
        raise root.error_at(
            ("sensor", *(sensor.name for sensor in sensing[1:2])),
            f"servos need one sensor with the driver {DRIVER}, such as [sensor.tendons], which "
            "reports their failures",
        )
    if stop.then != "release":
        message = 'then of [stop] must be "release", so that no servo pulls while nobody commands'
        raise root.error_at(("stop", "then"), message)
    settings = bus.settings()
    for output in servos:
        if not stops_itself(output):
            if enable_hold_ms is None:
                raise root.error_at(
                    ("output", output.name),
                    f"{called('output', output.name)} is an {output.settings['model']}, which does "
                    "not stop when its bus is silent: add [enable] with the pin that keeps its "
                    "power on",
                )
            settings |= {"cut_ms": 2 * enable_hold_ms, "arm_s": _START_S}
    wired = {one.name: replace(one, settings=one.settings | settings) for one in servos}
    try:
        bus_settings([*wired.values()])
    except KeyMistake as error:
        message = f"{error.key} of [servo_bus] {error}"
        raise root.error_at(("servo_bus", error.key), message) from None
    tendons = {"device": bus.device, "tendons": {one.name: one.settings for one in servos}}
    return (
        tuple(wired.get(output.name, output) for output in outputs),
        tuple(replace(one, settings=tendons) if one in sensing else one for one in sensors),
    )
