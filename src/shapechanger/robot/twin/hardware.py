"""Hardware of a robot's process on a twin: pins, buses and time of its board."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.settings import BusSettings
from shapechanger.robot.hardware import Clock
from shapechanger.robot.twin.board_client import BoardClient, GrantedClock, SteadyClock
from shapechanger.robot.twin.messages import (
    BoardPins,
    ClaimPin,
    InstructServos,
    PulsePin,
    ReadChip,
    WriteChip,
)


class TwinBus:
    """The part of `smbus2.SMBus` that the drivers use; a missing chip raises OSError.

    Args:
        board: Pins and chips.
        clock: Source of the time of each write.
        bus: Number of the bus.
    """

    def __init__(self, board: BoardPins, clock: Clock, bus: int) -> None:
        self._board = board
        self._clock = clock
        self._bus = bus

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Send one byte, which on the bus is a register without data."""
        self.write_i2c_block_data(i2c_addr, value, [])

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one register."""
        return self.read_i2c_block_data(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one register."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read several bytes, starting at one register."""
        request = ReadChip(bus=self._bus, address=i2c_addr, register=register, length=length)
        return self._board.ask(request, list[int])

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write several bytes, starting at one register."""
        if not all(0 <= byte <= 0xFF for byte in data):
            raise ValueError(f"Bytes must be 0 to 255, got {list(data)}.")
        self._board.ask(
            WriteChip(
                bus=self._bus,
                address=i2c_addr,
                register=register,
                data=list(data),
                t=self._clock.now_ns(),
            )
        )

    def close(self) -> None:
        """Let go of the bus; its chips continue with what they do."""


class TwinServoPins:
    """Pins that send pulses of whole microseconds.

    A thread of the process sends the pulses. If the process dies, they end, and the pin keeps the
    level that it has at that moment.

    Args:
        board: The pins.
        clock: Source of the time of each change.
    """

    def __init__(self, board: BoardPins, clock: Clock) -> None:
        self._board = board
        self._clock = clock
        self._pulses: dict[int, tuple[int, int]] = {}

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send pulses of this width on a BCM pin from now on; 0 for none."""
        if pin not in self._pulses:
            self._board.ask(ClaimPin(pin=pin, mode="output", t=self._clock.now_ns()), int)
        us, hz = int(width_us), int(frequency_hz)
        if self._pulses.get(pin) != (us, hz):
            self._board.post(PulsePin(pin=pin, us=us, hz=hz, t=self._clock.now_ns()))
            self._pulses[pin] = us, hz

    def close(self) -> None:
        """End all pulses; the pins stay low."""
        if not self._board.closed:
            for pin, (_, frequency_hz) in list(self._pulses.items()):
                self.pulse(pin, 0, frequency_hz)
        self._pulses.clear()


class TwinServoPort:
    """Port of the servo bus; see `ServoPort`. Its servos answer at once or not at all.

    Args:
        board: The servos.
        device: Name of the bus.

    Attributes:
        has_stray: False: no answer is late.
    """

    def __init__(self, board: BoardPins, device: str) -> None:
        self._board = board
        self._device = device
        self.has_stray = False

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read bytes of several servos; see `ServoPort.read`."""
        request = InstructServos(device=self._device, at=at, ids=list(ids), size=size)
        return self._board.ask(request, dict[int, ServoReply])

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write bytes of several servos, or of one; see `ServoPort.write`."""
        request = InstructServos(
            device=self._device, at=at, ids=list(data), data=list(data.values())
        )
        return self._board.ask(request, dict[int, ServoReply])

    def close(self) -> None:
        """Do nothing: the bus outlives the port."""


class TwinHardware:
    """Pins, buses and time of a board; see `shapechanger.robot.hardware.Hardware`.

    Args:
        board: Pins, chips and servos.
        clock: Time.

    Attributes:
        board: Pins, chips and servos.
        clock: Time.
    """

    def __init__(self, board: BoardPins, clock: Clock) -> None:
        self.board = board
        self._pin_factory: Any = None
        self.clock = clock

    def pin_factory(self) -> Any:
        """Return the `pin_factory` of gpiozero's devices."""
        if self._pin_factory is None:
            from shapechanger.robot.twin.gpio_pins import TwinPinFactory  # gpiozero is an extra.

            self._pin_factory = TwinPinFactory(self.board, self.clock)
        return self._pin_factory

    def i2c(self, bus: int) -> TwinBus:
        """Return an I2C bus by its number."""
        return TwinBus(self.board, self.clock, bus)

    def servo_pins(self) -> TwinServoPins:
        """Return the pins that send servo pulses."""
        return TwinServoPins(self.board, self.clock)

    def servo_port(self, settings: BusSettings) -> TwinServoPort:
        """Return the port of the servo bus; its first use fails if the board has no such bus."""
        return TwinServoPort(self.board, settings.device)

    def close(self) -> None:
        """Let go of the pins and leave the board."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None
        if isinstance(self.clock, GrantedClock):
            self.clock.close()
        self.board.close()


def connect(path: str) -> TwinHardware:
    """Connect to the board that listens on a socket.

    Raises:
        RobotError: If no board answers there.
    """
    client = BoardClient(path, "hardware")
    clock = GrantedClock(client, path) if client.clock == "twin" else SteadyClock(client)
    return TwinHardware(client, clock)
