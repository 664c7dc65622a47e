"""Pins of a Raspberry Pi's header: their notation in profiles, and inputs with interrupts."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Final

HIGHEST_BCM: Final = 27
"""Largest BCM number on the header; the smallest is 0."""

BCM_OF_BOARD: Final = {
    3: 2, 5: 3, 7: 4, 8: 14, 10: 15, 11: 17, 12: 18, 13: 27, 15: 22, 16: 23,
    18: 24, 19: 10, 21: 9, 22: 25, 23: 11, 24: 8, 26: 7, 27: 0, 28: 1, 29: 5,
    31: 6, 32: 12, 33: 13, 35: 19, 36: 16, 37: 26, 38: 20, 40: 21,
}  # fmt: skip
"""BCM number of each header position that has one."""

I2C_PINS: Final = {0: (0, 1), 1: (2, 3)}
"""BCM pins of SDA and SCL of the I2C buses with fixed pins."""

_POWER_OF_BOARD: Final = (
    dict.fromkeys((1, 17), "3.3 V")
    | dict.fromkeys((2, 4), "5 V")
    | dict.fromkeys((6, 9, 14, 20, 25, 30, 34, 39), "ground")
)
_WRITTEN: Final = re.compile(r"(GPIO|BOARD)([0-9]{1,3})")


class Pin(int):
    """BCM number of a pin, 0 to 27; a profile writes 22, "GPIO22" or "BOARD15"."""

    description = f'a BCM pin from 0 to {HIGHEST_BCM}, such as 22, "GPIO22" or "BOARD15"'


class OptionalPin(Pin):
    """A `Pin`, or -1 for none."""

    description = f"{Pin.description}, or -1 for none"


NO_PIN: Final = OptionalPin(-1)
"""Value of an unconnected pin."""


def bcm(written: object) -> int:
    """Parse a pin into its BCM number.

    The message of a ValueError is a reason after a comma, or empty.
    """
    number = written
    if isinstance(written, str) and (match := _WRITTEN.fullmatch(written)):
        number = place = int(match[2])
        if match[1] == "BOARD":
            if place in _POWER_OF_BOARD:
                raise ValueError(f"and {written} is {_POWER_OF_BOARD[place]}")
            if place not in BCM_OF_BOARD:
                raise ValueError("and the header has the places 1 to 40")
            number = BCM_OF_BOARD[place]
    if type(number) is not int or not 0 <= number <= HIGHEST_BCM:
        raise ValueError
    return number


class EdgeInput:
    """Input with an internal resistor that pulls it "up" or "down".

    On each change of its level, `changed` is called with the time, s, by the clock of gpiozero's
    `factory`, and the new level; lgpio calls it in a thread.
    """

    def __init__(
        self, pin: int, pull: str, factory: Any, changed: Callable[[float, int], None]
    ) -> None:
        from gpiozero import InputDevice  # Simulations do not need gpiozero.

        self._changed = changed
        self._device = InputDevice(pin, pull_up=pull == "up", pin_factory=factory)
        # gpiozero's devices do not pass the timestamp on; their pins do.
        self._device.pin.edges = "both"
        self._device.pin.when_changed = self._call

    @property
    def level(self) -> int:
        """Current level, 0 or 1."""
        return int(self._device.pin.state)

    def close(self) -> None:
        """Close the pin."""
        if not self._device.closed:
            self._device.pin.when_changed = None
            self._device.close()

    def _call(self, at_s: float, level: int) -> None:
        if level in (0, 1):  # lgpio reports 2 for a watchdog timeout.
            self._changed(at_s, int(level))
