"""The registers that the driver uses, and what is in them.

Source: ROBOTIS e-manual, control tables of XL330, XC330 and XM430; all addresses here are the same
in the three families.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

__all__ = [
    "BUS_WATCHDOG",
    "COUNTS_PER_TURN",
    "CURRENT_LIMIT",
    "CURRENT_MODE",
    "DRIVE_MODE",
    "FIRMWARE",
    "GOAL_CURRENT",
    "HARDWARE_ERROR",
    "OPERATING_MODE",
    "PRESENT",
    "RETURN_DELAY",
    "TORQUE_ENABLE",
    "TRIPPED",
    "WATCHDOG_STEP_NS",
    "Present",
    "Register",
    "decode_present",
    "hardware_errors",
]


@dataclass(frozen=True, slots=True)
class Register:
    """Where a number lies in the control table.

    Attributes:
        name: What the manual calls it.
        address: Of its first byte.
        size: Bytes, the lowest first.
        signed: Whether it may be negative (two's complement).
    """

    name: str
    address: int
    size: int
    signed: bool = False

    def encode(self, value: int) -> bytes:
        """A number as the servo stores it."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """The number in the first bytes of `data`."""
        return int.from_bytes(data[: self.size], "little", signed=self.signed)


FIRMWARE: Final = Register("firmware version", 6, 1)
RETURN_DELAY: Final = Register("return delay time", 9, 1)
DRIVE_MODE: Final = Register("drive mode", 10, 1)
"""Bit 0 turns all signs round, bit 3 lets a goal switch the torque on: neither is wanted here."""
OPERATING_MODE: Final = Register("operating mode", 11, 1)
CURRENT_LIMIT: Final = Register("current limit", 38, 2)
TORQUE_ENABLE: Final = Register("torque enable", 64, 1)
HARDWARE_ERROR: Final = Register("hardware error status", 70, 1)
BUS_WATCHDOG: Final = Register("bus watchdog", 98, 1)
GOAL_CURRENT: Final = Register("goal current", 102, 2, signed=True)
PRESENT: Final = Register("present current to present temperature", 126, 21)
"""One block without a gap: current, velocity, position, two trajectories, voltage, temperature."""

CURRENT_MODE: Final = 0
COUNTS_PER_TURN: Final = 4096
TRIPPED: Final = 0xFF
"""What the bus watchdog reads after it has stopped the servo."""
WATCHDOG_STEP_NS: Final = 20_000_000

_A_VELOCITY: Final = 0.229 * 6.283185307179586 / 60.0  # rad/s: 0.229 rpm.
_HARDWARE_ERRORS: Final = {
    0: "its voltage is out of range",
    2: "it is overheated",
    3: "its encoder fails",
    4: "it has an electrical fault",
    5: "it is overloaded",
}


class Present(NamedTuple):
    """What a servo says of itself.

    Attributes:
        current: In its own counts.
        speed: rad/s.
        position: Counts of 1/4096 turn, over many turns.
        voltage: V.
        temperature: Degrees Celsius.
    """

    current: int
    speed: float
    position: int
    voltage: float
    temperature: float


def decode_present(data: bytes) -> Present:
    """What is in the 21 bytes of `PRESENT`."""

    def signed(start: int, size: int) -> int:
        return int.from_bytes(data[start : start + size], "little", signed=True)

    return Present(
        current=signed(0, 2),
        speed=signed(2, 4) * _A_VELOCITY,
        position=signed(6, 4),
        voltage=int.from_bytes(data[18:20], "little") * 0.1,
        temperature=float(data[20]),
    )


def hardware_errors(bits: int) -> tuple[str, ...]:
    """What the hardware error status says, in words."""
    return tuple(words for bit, words in _HARDWARE_ERRORS.items() if bits >> bit & 1)
