"""Serial port, registers and packets of Dynamixel protocol 2.0, on top of the SDK."""

from __future__ import annotations

import contextlib
import select
import termios
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from shapechanger.errors import MissingExtra, RobotError
from shapechanger.robot.drivers.dynamixel.settings import BusSettings

try:
    from dynamixel_sdk import PacketHandler, PortHandler
except ImportError as error:
    raise MissingExtra("dynamixel-sdk", "finger") from error


# Bytes that may still be read after the timeout of an answer: they arrived while the process did
# not run. More is endless noise, which the SDK would read for ever.
_MAX_LATE_BYTES: Final = 1024


class Port(Protocol):
    """Port of the SDK's packet handler, such as its `PortHandler`."""

    is_using: bool

    def clearPort(self) -> None:
        """Discard what has arrived."""
        ...

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes and return how many were accepted."""
        ...

    def readPort(self, length: int) -> bytes:
        """Return at most `length` bytes of what has arrived."""
        ...

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the timeout of an answer of so many bytes."""
        ...

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start a timeout."""
        ...

    def isPacketTimeout(self) -> bool:
        """Return whether the timeout has passed."""
        ...

    def getBytesAvailable(self) -> int:
        """Return the number of bytes that have arrived and were not read."""
        ...

    def getBaudRate(self) -> int:
        """Return the baud rate."""
        ...

    def closePort(self) -> None:
        """Close the device."""
        ...


OpenPort = Callable[[BusSettings], Port]
"""Opens the port of a bus."""


class PromptPort(PortHandler):
    """The SDK's port with a timeout as short as the bus allows.

    The SDK alone waits 34 ms for each missing answer, by a clock that changes with the date, and
    keeps the processor busy meanwhile. A stop cannot wait for that.

    Args:
        device: Serial device.
        answer_ms: Time for the servos to start an answer, ms.
    """

    def __init__(self, device: str, answer_ms: float) -> None:
        super().__init__(device)
        self._answer_ms = answer_ms
        self._late_bytes = 0

    def getCurrentTime(self) -> float:
        """Return the monotonic time in milliseconds."""
        return time.monotonic_ns() / 1e6

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the timeout of an answer of so many bytes."""
        self.setPacketTimeoutMillis(self.tx_time_per_byte * packet_length + self._answer_ms)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start a timeout."""
        self._late_bytes = _MAX_LATE_BYTES
        super().setPacketTimeoutMillis(msec)

    def readPort(self, length: int) -> bytes:
        """Return at most `length` bytes, waiting for the first until the timeout."""
        if length <= 0:
            return b""
        left_ms = self.packet_timeout - self.getTimeSinceStart()
        if left_ms > 0.0:
            select.select([self.ser.fd], [], [], left_ms / 1e3)
            return super().readPort(length)
        data = super().readPort(min(length, self._late_bytes))
        self._late_bytes -= len(data)
        return data


def open_serial_port(settings: BusSettings) -> PromptPort:
    """Open the port of a bus.

    Raises:
        RobotError: If it cannot be opened with this baud rate.
    """
    port = PromptPort(settings.device, settings.answer_ms)
    try:
        opened = port.setBaudRate(settings.baud)
    except OSError as error:
        raise RobotError(f"The bus at {settings.device} cannot be opened: {error}.") from error
    if not opened:
        raise RobotError(
            f"The bus at {settings.device} cannot have {settings.baud} baud; "
            "57600, 115200, 1000000, 2000000, 3000000 and 4000000 are usual."
        )
    return port


@dataclass(frozen=True, slots=True)
class Register:
    """A register of the control table.

    Attributes:
        name: Name in the manual.
        address: Address of its first byte.
        size: Size in bytes, little-endian.
        signed: Whether it is signed (two's complement).
    """

    name: str
    address: int
    size: int
    signed: bool = False

    def encode(self, value: int) -> bytes:
        """Encode a value."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Decode the value at the start of `data`."""
        return int.from_bytes(data[: self.size], "little", signed=self.signed)


FIRMWARE: Final = Register("firmware version", 6, 1)
RETURN_DELAY: Final = Register("return delay time", 9, 1)
DRIVE_MODE: Final = Register("drive mode", 10, 1)
"""Bit 0 reverses all signs, bit 3 lets a goal enable the torque; the driver clears both."""
OPERATING_MODE: Final = Register("operating mode", 11, 1)
CURRENT_LIMIT: Final = Register("current limit", 38, 2)
TORQUE_ENABLE: Final = Register("torque enable", 64, 1)
HARDWARE_ERROR: Final = Register("hardware error status", 70, 1)
BUS_WATCHDOG: Final = Register("bus watchdog", 98, 1)
GOAL_CURRENT: Final = Register("goal current", 102, 2, signed=True)
PRESENT: Final = Register("present current to present temperature", 126, 21)
"""Block of current, velocity, position, two trajectories, voltage and temperature, without gaps."""

CURRENT_MODE: Final = 0
TRIPPED: Final = 0xFF
"""Value of the bus watchdog after it has stopped the servo."""
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
    """Present values of a servo.

    Attributes:
        current: Current, in counts of the model.
        speed: Speed, rad/s.
        position: Position over many turns, in counts of 1/4096 turn.
        voltage: Voltage, V.
        temperature: Temperature, degrees Celsius.
    """

    current: int
    speed: float
    position: int
    voltage: float
    temperature: float


def decode_present(data: bytes) -> Present:
    """Decode the 21 bytes of `PRESENT`."""

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
    """Describe the bits of the hardware error status."""
    return tuple(words for bit, words in _HARDWARE_ERRORS.items() if bits >> bit & 1)


ALERT: Final = 0x80
"""Bit of a status packet's error: the hardware error status is not 0."""

# Results of the SDK (robotis_def.py).
_SUCCESS: Final = 0
_RX_TIMEOUT: Final = -3001
_RX_CORRUPT: Final = -3002
# Damaged packets to skip while waiting for valid ones.
_MAX_DAMAGED: Final = 8
# A single lost packet must not keep a rig from starting. Cycles never retry.
_TRIES: Final = 3

_REFUSALS: Final = {
    1: "it could not do it",
    2: "it does not know the instruction",
    3: "the packet was damaged on its way",
    4: "the value is out of range",
    5: "the value has the wrong length",
    6: "the value is beyond a limit",
    7: "the register cannot be written now",
}


class ServoReply(NamedTuple):
    """Answer of a servo.

    Attributes:
        error: Error byte of the status packet.
        data: Data of the status packet.
    """

    error: int
    data: bytes


class RegisterBus:
    """Reads and writes registers of the servos on a bus.

    Args:
        port: Port of the bus.
        device: Name of the bus in messages.

    Attributes:
        has_stray: Whether a late answer was found before a request; the reader resets it.
    """

    def __init__(self, port: Port, device: str) -> None:
        self._port = port
        self._device = device
        self._sdk = PacketHandler(2.0)
        self.has_stray = False

    def ping(self, servo_id: int) -> int | None:
        """Return the model number of a servo; None if it does not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        for _ in range(_TRIES):
            with self._request():
                model, result, _ = self._sdk.ping(self._port, servo_id)
                if result == _SUCCESS:
                    return model
        return None

    def read(self, servo_id: int, register: Register) -> int:
        """Read a register of one servo.

        Args:
            servo_id: Number of the servo on the bus.
            register: The register.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        for _ in range(_TRIES):
            with self._request():
                data, result, error = self._sdk.readTxRx(
                    self._port, servo_id, register.address, register.size
                )
                if result == _SUCCESS:
                    self._check(servo_id, f"read its {register.name}", error)
                    if len(data) == register.size:
                        return register.decode(bytes(data))
        raise self._no_answer(servo_id)

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Write a register of one servo and wait for its confirmation.

        Args:
            servo_id: Number of the servo on the bus.
            register: The register.
            value: The new value, in the register's unit.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        data = register.encode(value)
        for _ in range(_TRIES):
            with self._request():
                result, error = self._sdk.writeTxRx(
                    self._port, servo_id, register.address, register.size, data
                )
                if result == _SUCCESS:
                    self._check(servo_id, f"set its {register.name} to {value}", error)
                    return
        raise self._no_answer(servo_id)

    def reboot(self, servo_id: int) -> None:
        """Reboot a servo.

        Raises:
            RobotError: If it does not answer.
        """
        with self._request():
            result, _ = self._sdk.reboot(self._port, servo_id)
            if result == _SUCCESS:
                return
        raise self._no_answer(servo_id)

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a register of several servos in one packet, which has no answer.

        Args:
            register: The register.
            values: New values by the servo's number.

        Raises:
            RobotError: If the bus is gone.
        """
        data: list[int] = []
        for servo_id, value in values.items():
            data += [servo_id, *register.encode(value)]
        with self._request():
            result = self._sdk.syncWriteTxOnly(
                self._port, register.address, register.size, data, len(data)
            )
            if result == _SUCCESS:
                return
        raise RobotError(f"The bus at {self._device} does not take what is written to it.")

    def sync_read(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        """Read a register of several servos with one packet.

        Args:
            register: The register.
            ids: Numbers of the servos.

        Returns:
            The answers by id, without servos that did not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        with self._request():
            result = self._sdk.syncReadTx(
                self._port, register.address, register.size, list(ids), len(ids), False
            )
            if result == _SUCCESS:
                return self._answers(register, ids)
        raise RobotError(f"The bus at {self._device} does not take what is written to it.")

    def close(self) -> None:
        """Close the port."""
        with contextlib.suppress(OSError, termios.error):  # A device that is gone counts as closed.
            self._port.closePort()

    def _answers(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        # The SDK's GroupSyncRead stops at the first missing servo, drops the other answers and
        # keeps no error byte; so the packets are received one by one here.
        heard: dict[int, ServoReply] = {}
        for _ in range(len(ids) + _MAX_DAMAGED):
            packet, result = self._receive()
            if result == _RX_TIMEOUT:
                break
            if result != _SUCCESS:
                continue
            end = 5 + int.from_bytes(bytes(packet[5:7]), "little")
            servo_id, error, data = packet[4], packet[8], bytes(packet[9:end])
            if servo_id in ids and len(data) == register.size:
                heard[servo_id] = ServoReply(error, data)
            if len(heard) == len(ids):
                break
        return heard

    def _receive(self) -> tuple[list[int], int]:
        try:
            return self._sdk.rxPacket(self._port, False)
        except IndexError:  # The SDK trusts the length in a packet.
            return [], _RX_CORRUPT

    @contextlib.contextmanager
    def _request(self) -> Generator[None]:
        """Turn errors of the device into RobotError, and malformed answers into missing ones."""
        self._port.is_using = False  # The SDK leaves it set after an exception.
        try:
            self.has_stray |= self._port.getBytesAvailable() > 0
            yield
        except (OSError, termios.error) as error:
            raise RobotError(f"The bus at {self._device} is gone: {error}.") from error
        except IndexError:
            pass  # As in `_receive`: the caller continues as without an answer.

    def _check(self, servo_id: int, what: str, error: int) -> None:
        if number := error & ~ALERT:
            why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
            raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")

    def _no_answer(self, servo_id: int) -> RobotError:
        return RobotError(f"Servo {servo_id} at {self._device} does not answer.")


class ServoPoller:
    """Reads a register of all servos in each cycle, although some may not answer.

    In a sync read each servo waits for the one before it, so a silent one may silence those behind
    it. The first missing servo becomes a suspect, and the others are read once more without it.
    Suspects are read alone, one per cycle. So a cycle waits for at most two timeouts, whatever is
    missing.

    Args:
        bus: The bus.
        ids: Ids of the servos.

    Attributes:
        suspects: Servos that did not answer when they were last read.
    """

    def __init__(self, bus: RegisterBus, ids: Sequence[int]) -> None:
        self._bus = bus
        self._ids = tuple(ids)
        self.suspects: list[int] = []

    @property
    def trusted(self) -> tuple[int, ...]:
        """Servos that answered when they were last read."""
        return tuple(one for one in self._ids if one not in self.suspects)

    def read(self, register: Register) -> dict[int, ServoReply]:
        """Read a register of all servos; those that did not answer are missing.

        Raises:
            RobotError: If the bus is gone.
        """
        asked = self.trusted
        heard = self._bus.sync_read(register, asked) if asked else {}
        missing = [one for one in asked if one not in heard]
        if missing:
            first, *behind = missing
            self.suspects.append(first)
            heard |= self._bus.sync_read(register, behind) if behind else {}
            self.suspects += [one for one in behind if one not in heard][:1]
        elif self.suspects:
            suspect = self.suspects.pop(0)
            heard |= (answer := self._bus.sync_read(register, [suspect]))
            if not answer:
                self.suspects.append(suspect)
        return heard
