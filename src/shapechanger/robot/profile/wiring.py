"""Pins, channels, addresses and the servo bus: nothing may be used twice or be missing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final, NamedTuple

from shapechanger.contract.plan import OutputPlan, SensorPlan, StopPlan
from shapechanger.robot.drivers.keys import Claim, KeyMistake, Keys
from shapechanger.robot.drivers.pins import NO_PIN
from shapechanger.robot.drivers.servos.settings import (
    DRIVER,
    ServoBusKeys,
    bus_settings,
    stops_itself,
)
from shapechanger.robot.profile.mistakes import Place, Source, called

_OF_A_CHIP: Final = ("hz", "output_enable")  # A PCA9685 has one of each for its 16 channels.


class _User(NamedTuple):
    """User of a pin, channel or address: its table and its claim."""

    place: Place
    claim: Claim

    def __str__(self) -> str:
        return f"{self.claim.key} of {called(self.place)}"


class PinAllocation:
    """Pins, channels and addresses in use.

    Args:
        source: Where the profile was read.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._users: dict[str, _User] = {}

    def take(self, place: Place, keys: Keys) -> None:
        """Allocate everything that a table claims.

        Raises:
            ProfileError: If something is in use.
        """
        for claim in keys.claims():
            user = _User(place, claim)
            before = self._users.setdefault(claim.what, user)
            if before is user or (claim.group and claim.group == before.claim.group):
                continue
            line = self._source.line((*before.place, before.claim.key))
            words = (
                f"{claim.what}{claim.use} is used twice: by {before} (line {line}) and by {user}"
            )
            raise self._source.mistake((*place, claim.key), words)

    def shared(self, outputs: Iterable[OutputPlan]) -> tuple[OutputPlan, ...]:
        """Return outputs with the settings that the channels of one PCA9685 share.

        Raises:
            ProfileError: If two outputs disagree about their chip.
        """
        chips: dict[str, dict[str, Any]] = {}
        for output in outputs:
            if chip := _chip_of(output):
                said = chips.setdefault(chip, {})
                for name in _OF_A_CHIP:
                    value = output.settings[name]
                    before = said.setdefault(name, value)
                    if before == NO_PIN:
                        said[name] = value
                    elif value not in (before, NO_PIN):
                        words = f"{chip} has one {name} for all its channels, {before} or {value}"
                        raise self._source.mistake(("output", output.name, name), words)
        return tuple(
            replace(output, settings={**output.settings, **chips.get(_chip_of(output), {})})
            for output in outputs
        )


def _chip_of(output: OutputPlan) -> str:
    """Describe the PCA9685 of an output; empty for none."""
    settings = output.settings
    if settings.get("over") != "pca9685":
        return ""
    return f"the PCA9685 at {settings['address']:#x} of I2C bus {settings['bus']}"


# Time in which servos start whose power comes with the guard, s.
_START_S: Final = 0.5


def with_servo_bus(
    source: Source,
    bus: ServoBusKeys | None,
    outputs: tuple[OutputPlan, ...],
    sensors: tuple[SensorPlan, ...],
    stop: StopPlan,
    enable_hold_ms: int | None,
) -> tuple[tuple[OutputPlan, ...], tuple[SensorPlan, ...]]:
    """Add the settings of the servo bus to its outputs and sensors.

    Args:
        source: Where the profile was read.
        bus: Keys of the bus; None without one.
        outputs: All outputs.
        sensors: All sensors.
        stop: How the robot stops.
        enable_hold_ms: How long the enable line stays on without the guard, ms; None without one.

    Raises:
        ProfileError: If outputs lack a bus, or a bus lacks outputs or a sensor; if a servo cannot
            do what the bus is set to, or a stop or the end of the guard would not release it.
    """
    on_bus = [output for output in outputs if output.driver == DRIVER]
    sensing = [sensor for sensor in sensors if sensor.driver == DRIVER]
    if not on_bus:
        if bus is not None:
            words = f"[servo_bus] needs an output with the driver {DRIVER}"
            raise source.mistake(("servo_bus",), words)
        if sensing:
            words = f"{called(('sensor', sensing[0].name))} needs outputs with the driver {DRIVER}"
            raise source.mistake(("sensor", sensing[0].name), words)
        return outputs, sensors
    first = ("output", on_bus[0].name)
    if bus is None:
        raise source.mistake(first, f"{called(first)} is on a bus: add [servo_bus]")
    if len(sensing) != 1:
        words = (
            f"servos need one sensor with the driver {DRIVER}, such as [sensor.tendons], which "
            "reports their failures"
        )
        raise source.mistake(("sensor",) if not sensing else ("sensor", sensing[1].name), words)
    if stop.then != "release":
        words = 'then of [stop] must be "release", so that no servo pulls while nobody commands'
        raise source.mistake(("stop", "then"), words)
    settings = bus.settings()
    limp = next((output for output in on_bus if not stops_itself(output)), None)
    if limp is not None:
        if enable_hold_ms is None:
            words = (
                f"{called(('output', limp.name))} is an {limp.settings['model']}, which does not "
                "stop when its bus is silent: add [enable] with the pin that keeps its power on"
            )
            raise source.mistake(("output", limp.name), words)
        settings |= {"cut_ms": 2 * enable_hold_ms, "arm_s": _START_S}
    whole = [replace(output, settings={**output.settings, **settings}) for output in on_bus]
    try:
        bus_settings(whole)
    except KeyMistake as error:
        words = f"{error.key} of [servo_bus] {error}"
        raise source.mistake(("servo_bus", error.key), words) from None
    tendons: dict[str, Any] = {
        "device": bus.device,
        "tendons": [output.name for output in on_bus],
        "most_tensions_n": [output.settings["most_tension_n"] for output in on_bus],
        # Shortest and longest where the length is controlled.
        "lengths_m": [
            [output.settings["shortest_m"], output.settings["longest_m"]]
            if output.settings["control"] == "length"
            else None
            for output in on_bus
        ],
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
