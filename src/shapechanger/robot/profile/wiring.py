"""Allocation of pins, channels and addresses; none may be used twice."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from shapechanger.robot.guard.plan import OutputPlan, SensorPlan
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
