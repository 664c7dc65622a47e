"""The serial port below the SDK."""

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

__all__ = [
    "ALERT",
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
    "Asking",
    "OpenPort",
    "Port",
    "Present",
    "PromptPort",
    "Register",
    "ServoReply",
    "Wire",
    "decode_present",
    "hardware_errors",
    "open_serial_port",
]

try:
    from dynamixel_sdk import PortHandler
except ImportError as error:
    raise MissingExtra("dynamixel-sdk", "finger") from error


# Bytes that may still be read when the time for an answer is over. They lay there before the
# process was let run again; more is noise that never ends, and the SDK would read it for ever.
_MOST_LATE_BYTES: Final = 1024


class Port(Protocol):
    """What the SDK's packet handler asks of a port; its `PortHandler` is one."""

    is_using: bool

    def clearPort(self) -> None:
        """Forget what has arrived."""
        ...

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes; how many were taken."""
        ...

    def readPort(self, length: int) -> bytes:
        """At most so many bytes of what has arrived."""
        ...

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the time that an answer of so many bytes may take."""
        ...

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start the time that an answer may take."""
        ...

    def isPacketTimeout(self) -> bool:
        """Whether that time is over."""
        ...

    def getBytesAvailable(self) -> int:
        """How many bytes have arrived and were not read."""
        ...

    def getBaudRate(self) -> int:
        """Bits a second."""
        ...

    def closePort(self) -> None:
        """Let go of the device."""
        ...


OpenPort = Callable[[BusSettings], Port]
"""What opens the port of a bus."""


class PromptPort(PortHandler):
    """The SDK's port, which waits for an answer only as long as the bus needs.

    As it comes the SDK waits 34 ms for each missing answer, on the clock that a change of the date
    moves, and asks the processor all the while. A stop cannot wait for that.

    Args:
        device: Where it is.
        answer_ms: How long the servos may take to begin to answer.
    """

    def __init__(self, device: str, answer_ms: float) -> None:
        super().__init__(device)
        self._answer_ms = answer_ms
        self._late_bytes = 0

    def getCurrentTime(self) -> float:
        """Milliseconds that no change of the date moves."""
        return time.monotonic_ns() / 1e6

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the time that an answer of so many bytes may take."""
        self.setPacketTimeoutMillis(self.tx_time_per_byte * packet_length + self._answer_ms)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start the time that an answer may take."""
        self._late_bytes = _MOST_LATE_BYTES
        super().setPacketTimeoutMillis(msec)

    def readPort(self, length: int) -> bytes:
        """At most so many bytes; waits for the first of them while there is time."""
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
        RobotError: If it cannot be opened, or not at this speed.
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


try:
    from dynamixel_sdk import PacketHandler
except ImportError as error:
    raise MissingExtra("dynamixel-sdk", "finger") from error


ALERT: Final = 0x80
"""Bit of a status packet's error: the hardware error status is worth a look."""

# Results of the SDK (robotis_def.py).
_SUCCESS: Final = 0
_RX_TIMEOUT: Final = -3001
_RX_CORRUPT: Final = -3002
# Damaged packets that are read past while waiting for good ones.
_MOST_JUNK: Final = 8
# A single lost packet must not keep a rig from starting. In a cycle nothing is asked twice.
_TRIES: Final = 3
_BROADCAST: Final = 0xFE
# Bytes of a block of a fast answer besides its data: error, id and CRC.
_FAST_EXTRA: Final = 4

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
    """What a servo said.

    Attributes:
        error: The error byte of its status packet.
        data: What was asked for.
    """

    error: int
    data: bytes


class Wire:
    """The bus.

    Args:
        port: What the bytes go over.
        device: What it is called in a sentence.
    """

    def __init__(self, port: Port, device: str) -> None:
        self._port = port
        self._device = device
        self._sdk = PacketHandler(2.0)
        self.has_stray = False
        """Whether bytes lay there when something was said: somebody had answered too late.

        It stays until its reader takes it back.
        """

    def ping(self, servo_id: int) -> int | None:
        """The model number of a servo; None if it does not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        for _ in range(_TRIES):
            with self._speaking():
                model, result, _ = self._sdk.ping(self._port, servo_id)
                if result == _SUCCESS:
                    return model
        return None

    def read(self, servo_id: int, register: Register) -> int:
        """One register of one servo.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        for _ in range(_TRIES):
            with self._speaking():
                data, result, error = self._sdk.readTxRx(
                    self._port, servo_id, register.address, register.size
                )
                if result == _SUCCESS:
                    self._check(servo_id, f"read its {register.name}", error)
                    if len(data) == register.size:
                        return register.decode(bytes(data))
        raise self._silence(servo_id)

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Set one register of one servo, and wait until it says that it has done so.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        data = register.encode(value)
        for _ in range(_TRIES):
            with self._speaking():
                result, error = self._sdk.writeTxRx(
                    self._port, servo_id, register.address, register.size, data
                )
                if result == _SUCCESS:
                    self._check(servo_id, f"set its {register.name} to {value}", error)
                    return
        raise self._silence(servo_id)

    def reboot(self, servo_id: int) -> None:
        """Start a servo afresh.

        Raises:
            RobotError: If it does not answer.
        """
        with self._speaking():
            result, _ = self._sdk.reboot(self._port, servo_id)
            if result == _SUCCESS:
                return
        raise self._silence(servo_id)

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Set a register of several servos in one packet. Nobody answers.

        Raises:
            RobotError: If the bus is gone.
        """
        data: list[int] = []
        for servo_id, value in values.items():
            data += [servo_id, *register.encode(value)]
        with self._speaking():
            result = self._sdk.syncWriteTxOnly(
                self._port, register.address, register.size, data, len(data)
            )
            if result == _SUCCESS:
                return
        raise RobotError(f"The bus at {self._device} does not take what is written to it.")

    def sync_read(
        self, register: Register, ids: Sequence[int], *, fast: bool = False
    ) -> dict[int, ServoReply]:
        """A register of several servos, asked in one packet; who was not heard is not in it.

        Raises:
            RobotError: If the bus is gone.
        """
        with self._speaking():
            result = self._sdk.syncReadTx(
                self._port, register.address, register.size, list(ids), len(ids), fast
            )
            if result == _SUCCESS:
                return self._fast(register, ids) if fast else self._plain(register, ids)
        raise RobotError(f"The bus at {self._device} does not take what is written to it.")

    def close(self) -> None:
        """Let go of the port."""
        with contextlib.suppress(OSError, termios.error):  # A device that is gone is closed.
            self._port.closePort()

    def _plain(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        # The SDK's GroupSyncRead gives up at the first servo that is missing, drops what the others
        # said, and keeps no error byte; so the packets are taken here, one by one.
        heard: dict[int, ServoReply] = {}
        for _ in range(len(ids) + _MOST_JUNK):
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

    def _fast(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        size = register.size + _FAST_EXTRA
        raw, result, _ = self._sdk.fastSyncReadRx(self._port, _BROADCAST, size * len(ids))
        # The last block's CRC is the packet's.
        if result != _SUCCESS or len(raw) != size * len(ids):
            return {}
        blocks = [raw[i * size : (i + 1) * size] for i in range(len(ids))]
        # Whether servos stuff bytes here nobody says; where one did, the ids would not fit.
        if [block[1] for block in blocks] != list(ids):
            return {}
        return {block[1]: ServoReply(block[0], bytes(block[2:-2])) for block in blocks}

    def _receive(self) -> tuple[list[int], int]:
        try:
            return self._sdk.rxPacket(self._port, False)
        except IndexError:  # The SDK trusts the length that a packet states.
            return [], _RX_CORRUPT

    @contextlib.contextmanager
    def _speaking(self) -> Generator[None]:
        """Turn what the device raises into words; what the SDK stumbles over is no answer."""
        self._port.is_using = False  # The SDK leaves it set when something was raised.
        try:
            self.has_stray |= self._port.getBytesAvailable() > 0
            yield
        except (OSError, termios.error) as error:
            raise RobotError(f"The bus at {self._device} is gone: {error}.") from error
        except IndexError:
            pass  # As in _receive. Whoever asked goes on as without an answer.

    def _check(self, servo_id: int, what: str, error: int) -> None:
        if number := error & ~ALERT:
            why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
            raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")

    def _silence(self, servo_id: int) -> RobotError:
        return RobotError(f"Servo {servo_id} at {self._device} does not answer.")


# In so many cycles in a row the fast way may fail before it is given up.
_MOST_FAST_FAILURES: Final = 3


class Asking:
    """Who is asked, and how.

    In a sync read each servo waits for the one before it; so a silent one may silence those behind
    it. The first that is missing is suspected, and the others are asked once more without it. From
    then on it is asked alone, one suspect in each cycle: whatever is missing, a cycle waits twice
    at most, or three times while the fast way is tried.

    Args:
        wire: The bus.
        ids: Who is there.
        fast: Whether to try the fast sync read.

    Attributes:
        suspects: Who was missing when last asked.
        fast: Whether the fast way is still tried.
    """

    def __init__(self, wire: Wire, ids: Sequence[int], *, fast: bool) -> None:
        self._wire = wire
        self._ids = tuple(ids)
        self._fast_failures = 0
        self.suspects: list[int] = []
        self.fast = fast

    @property
    def trusted(self) -> tuple[int, ...]:
        """Who answered when last asked."""
        return tuple(one for one in self._ids if one not in self.suspects)

    def read(self, register: Register) -> dict[int, ServoReply]:
        """A register of everybody; who was not heard is not in it.

        Raises:
            RobotError: If the bus is gone.
        """
        asked = self.trusted
        heard = self._ask(register, asked)
        missing = [one for one in asked if one not in heard]
        if missing:
            first, *behind = missing
            self.suspects.append(first)
            heard |= self._wire.sync_read(register, behind) if behind else {}
            self.suspects += [one for one in behind if one not in heard][:1]
        elif self.suspects:
            suspect = self.suspects.pop(0)
            heard |= (answer := self._wire.sync_read(register, [suspect]))
            if not answer:
                self.suspects.append(suspect)
        return heard

    def _ask(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        if not ids:
            return {}
        if self.fast:
            if heard := self._wire.sync_read(register, ids, fast=True):
                self._fast_failures = 0
                return heard
            self._fast_failures += 1
            self.fast = self._fast_failures < _MOST_FAST_FAILURES
        return self._wire.sync_read(register, ids)
