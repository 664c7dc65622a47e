"""I2C buses whose chips are in the twin's board."""

from __future__ import annotations

from collections.abc import Sequence

from shapechanger.robot.hardware import Clock
from shapechanger.twin.wired import BoardLink

__all__ = ["TwinBus"]


class TwinBus:
    """The part of `smbus2.SMBus` that the drivers use; a chip that is not there raises OSError.

    Args:
        link: The connection to the board.
        clock: Where the time of a write comes from.
        bus: Number of the bus.
    """

    def __init__(self, link: BoardLink, clock: Clock, bus: int) -> None:
        self._link = link
        self._clock = clock
        self._bus = bus

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Send one byte: on the wire that is a register that nothing is written to."""
        self.write_i2c_block_data(i2c_addr, value, [])

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """One register."""
        return self.read_i2c_block_data(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Set one register."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Several bytes, from one register on."""
        answer = self._link.ask(
            op="read", bus=self._bus, address=i2c_addr, register=register, length=length
        )
        return answer["data"]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write several bytes, from one register on."""
        if not all(0 <= byte <= 0xFF for byte in data):
            raise ValueError(f"These are no bytes: {list(data)}.")
        self._link.ask(
            op="write",
            bus=self._bus,
            address=i2c_addr,
            register=register,
            data=list(data),
            t=self._clock.now_ns(),
        )

    def close(self) -> None:
        """Let go of the bus; its chips go on with what they do."""
