"""Puts together what a profile says of a servo bus: in a table of its own, outputs and a sensor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.dynamixel.plans import bus_settings, servo_settings
from shapechanger.robot.drivers.dynamixel.settings import ServoSettings
from shapechanger.robot.drivers.settings import number
from shapechanger.robot.guard.plan import OutputPlan, SensorPlan, StopPlan
from shapechanger.robot.profile.mistake import Source, called

__all__ = ["tension_spans", "with_servo_bus"]

_DRIVER: Final = "dynamixel"


def with_servo_bus(
    source: Source,
    bus: Mapping[str, Any] | None,
    outputs: tuple[OutputPlan, ...],
    sensors: tuple[SensorPlan, ...],
    stop: StopPlan,
) -> tuple[tuple[OutputPlan, ...], tuple[SensorPlan, ...]]:
    """The outputs and sensors with what they need to know of their bus.

    Args:
        source: Where the profile was read.
        bus: The table of the bus; None without one.
        outputs: All outputs.
        sensors: All sensors.
        stop: How the robot stops.

    Raises:
        ProfileError: If outputs have no bus, or a bus no outputs or no sensor; if two servos have
            one id, one cannot do what it is set to, or a stop would not let go.
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


def tension_spans(outputs: Iterable[OutputPlan]) -> dict[str, float]:
    """From pretension to the most tension, N, of each action that alone pulls one tendon."""
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
    """Refuse what the driver would refuse, with the line."""
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
