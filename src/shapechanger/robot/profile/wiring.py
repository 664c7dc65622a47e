"""Pins, channels, addresses and the servo bus: nothing may be used twice or be missing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.servos.settings import (
    DRIVER,
    bus_settings,
    servo_settings,
    stops_itself,
)
from shapechanger.robot.guard.plan import OutputPlan, SensorPlan, StopPlan
from shapechanger.robot.profile.mistakes import Place, Source, called
from shapechanger.robot.profile.pins import I2C_PINS
from shapechanger.robot.profile.schema import (
    NO_PIN,
    OUTPUT_SETTINGS,
    OVER_SETTINGS,
    SENSOR_SETTINGS,
    ProfileKey,
)

_Settings = Mapping[str, Any]
# Address of every AS5600: ams, data sheet v1-06, "Register Description".
_AS5600: Final = 0x36
_OF_A_CHIP: Final = ("hz", "output_enable")  # A PCA9685 has one of each for its 16 channels.


@dataclass(frozen=True, slots=True)
class _User:
    """User of a pin, channel or address.

    Attributes:
        place: The key that claims it.
        group: Users of one group may share it; empty for exclusive use.
    """

    place: Place
    group: str = ""

    def __str__(self) -> str:
        return f"{self.place[-1]} of {called(self.place[:-1])}"


class PinAllocation:
    """Pins, channels and addresses in use.

    Args:
        source: Where the profile was read.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._users: dict[str, _User] = {}

    def take_pin(self, pin: int, place: Place) -> None:
        """Allocate a pin.

        Args:
            pin: BCM number.
            place: Where the profile names it.

        Raises:
            ProfileError: If it is in use.
        """
        self._take(f"GPIO{pin}", _User(place))

    def take_outputs(self, outputs: Iterable[OutputPlan]) -> tuple[OutputPlan, ...]:
        """Allocate the pins and channels of outputs.

        Returns:
            The outputs, with the settings of a PCA9685 shared by all outputs on the chip.

        Raises:
            ProfileError: If something is used twice, or two outputs disagree about their chip.
        """
        taken = tuple(outputs)
        chips: dict[str, dict[str, Any]] = {}
        for output in taken:
            self._take_output(output, chips)
        return tuple(
            replace(output, settings={**output.settings, **chips[chip]})
            if (chip := _chip_of(output.settings))
            else output
            for output in taken
        )

    def take_sensor(self, sensor: SensorPlan) -> None:
        """Allocate the pins or the address of a sensor.

        Raises:
            ProfileError: If something is in use.
        """
        place: Place = ("sensor", sensor.name)
        self._take_pins(sensor.settings, place, SENSOR_SETTINGS[sensor.driver])
        for key in ("address", "mux"):
            if key in sensor.settings:
                self._take_bus(sensor.settings, (*place, key), group="")
        if sensor.driver == "as5600":
            # All share one address, and respond together if two multiplexers select them.
            self._take_address(sensor.settings["bus"], _AS5600, _User((*place, "driver")))

    def _take_output(self, output: OutputPlan, chips: dict[str, dict[str, Any]]) -> None:
        settings: dict[str, Any] = {**output.settings}
        place: Place = ("output", output.name)
        over = settings.get("over")
        self._take_pins(settings, place, OUTPUT_SETTINGS[output.driver])
        if over == "lgpio":
            self._take_pins(settings, place, OVER_SETTINGS["lgpio"])
        elif over == "sysfs":
            what = f"channel {settings['channel']} of PWM chip {settings['chip']}"
            self._take(what, _User((*place, "channel")))
        if chip := _chip_of(settings):
            self._take(f"channel {settings['channel']} of {chip}", _User((*place, "channel")))
            self._take_bus(settings, (*place, "address"), group=chip)
            if settings["output_enable"] != NO_PIN:
                user = _User((*place, "output_enable"), group=chip)
                self._take(f"GPIO{settings['output_enable']}", user)
            self._agree(settings, place, chip, chips.setdefault(chip, {}))

    def _agree(self, settings: _Settings, place: Place, chip: str, said: dict[str, Any]) -> None:
        for name in _OF_A_CHIP:
            before = said.setdefault(name, settings[name])
            if before == NO_PIN:
                said[name] = settings[name]
            elif settings[name] not in (before, NO_PIN):
                words = f"{chip} has one {name} for all its channels, {before} or {settings[name]}"
                raise self._source.mistake((*place, name), words)

    def _take_bus(self, settings: _Settings, place: Place, group: str) -> None:
        bus = settings["bus"]
        self._take_address(bus, settings[str(place[-1])], _User(place, group))
        for pin in I2C_PINS.get(bus, ()):
            user = _User((*place[:-1], "bus"), group=f"I2C bus {bus}")
            self._take(f"GPIO{pin}, a wire of I2C bus {bus},", user, key=f"GPIO{pin}")

    def _take_address(self, bus: Any, address: Any, user: _User) -> None:
        self._take(f"address {address:#x} of I2C bus {bus}", user)

    def _take_pins(self, settings: _Settings, place: Place, keys: Iterable[ProfileKey]) -> None:
        for key in keys:
            if key.kind == "pins":
                for pin in settings[key.name]:
                    self.take_pin(pin, (*place, key.name))
            elif key.kind == "pin" and settings[key.name] != NO_PIN:
                self.take_pin(settings[key.name], (*place, key.name))

    def _take(self, what: str, user: _User, key: str = "") -> None:
        before = self._users.setdefault(key or what, user)
        if before is user or (user.group and user.group == before.group):
            return
        line = self._source.line(before.place)
        words = f"{what} is used twice: by {before} (line {line}) and by {user}"
        raise self._source.mistake(user.place, words)


def _chip_of(settings: _Settings) -> str:
    """Describe the PCA9685 of an output; empty for none."""
    if settings.get("over") != "pca9685":
        return ""
    return f"the PCA9685 at {settings['address']:#x} of I2C bus {settings['bus']}"


# Time in which servos start whose power comes with the guard, s.
_START_S: Final = 0.5


def with_servo_bus(
    source: Source,
    bus: Mapping[str, Any] | None,
    outputs: tuple[OutputPlan, ...],
    sensors: tuple[SensorPlan, ...],
    stop: StopPlan,
    enable_hold_ms: int | None,
) -> tuple[tuple[OutputPlan, ...], tuple[SensorPlan, ...]]:
    """Add the settings of the servo bus to its outputs and sensors.

    Args:
        source: Where the profile was read.
        bus: The table of the bus; None without one.
        outputs: All outputs.
        sensors: All sensors.
        stop: How the robot stops.
        enable_hold_ms: How long the enable line stays on without the guard, ms; None without one.

    Raises:
        ProfileError: If outputs lack a bus, or a bus lacks outputs or a sensor; if two servos share
            an id, a servo cannot do what it is set to, or a stop or the end of the guard would not
            release it.
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
    limp = next((output for output in on_bus if not stops_itself(output)), None)
    if limp is not None:
        if enable_hold_ms is None:
            words = (
                f"{called(('output', limp.name))} is an {limp.settings['model']}, which does not "
                "stop when its bus is silent: add [enable] with the pin that keeps its power on"
            )
            raise source.mistake(("output", limp.name), words)
        bus = {**bus, "cut_ms": 2 * enable_hold_ms, "arm_s": _START_S}
    whole = [replace(output, settings={**output.settings, **bus}) for output in on_bus]
    for output in whole:
        _report(source, ("output", output.name), lambda output=output: servo_settings(output))
    _report(source, ("servo_bus",), lambda: bus_settings(whole))
    tendons: dict[str, Any] = {
        "device": bus["device"],
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


def _report(source: Source, place: Place, check: Callable[[], object]) -> None:
    """Report, with its line, what the driver would refuse."""
    try:
        check()
    except (RobotError, UnknownName) as error:
        raise source.mistake(place, str(error).rstrip(".")) from error
