"""Registers and instructions of Dynamixel protocol 2.0, independent of how packets travel."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from shapechanger.errors import RobotError


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

    @property
    def span(self) -> bytes:
        """Address and size, as parameters of an instruction."""
        return self.address.to_bytes(2, "little") + self.size.to_bytes(2, "little")

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
GOAL_POSITION: Final = Register("goal position", 116, 4, signed=True)
PRESENT_POSITION: Final = Register("present position", 132, 4, signed=True)
PRESENT: Final = Register("present current to present temperature", 126, 21)
"""Block of current, velocity, position, two trajectories, voltage and temperature, without gaps."""

CURRENT_MODE: Final = 0
LENGTH_MODE: Final = 5
"""Current-based position mode: goes to the goal position with at most the goal current."""
TRIPPED: Final = 0xFF
"""Value of the bus watchdog after it has stopped the servo."""
WATCHDOG_STEP_NS: Final = 20_000_000

_PRESENT: Final = struct.Struct("<hiiiiHB")
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
    current, speed, position, _, _, tenth_volts, degrees = _PRESENT.unpack(data)
    return Present(current, speed * _A_VELOCITY, position, tenth_volts * 0.1, float(degrees))


def hardware_errors(bits: int) -> tuple[str, ...]:
    """Describe the bits of the hardware error status."""
    return tuple(words for bit, words in _HARDWARE_ERRORS.items() if bits >> bit & 1)


BROADCAST: Final = 0xFE
"""Id that addresses all servos."""

PING: Final = 0x01
READ: Final = 0x02
WRITE: Final = 0x03
REBOOT: Final = 0x08
SYNC_READ: Final = 0x82
SYNC_WRITE: Final = 0x83

ALERT: Final = 0x80
"""Bit of a reply's error: the hardware error status is not 0."""
REFUSED: Final = 0x7F
"""Bits of a reply's error with the reason of a refusal."""

_PING_BYTES: Final = 3  # Model number and firmware.
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
    """Reply of a servo.

    Attributes:
        error: Error byte of the status packet.
        data: Data of the status packet.
    """

    error: int
    data: bytes


class ServoPort(Protocol):
    """Port of a servo bus: serial, or of a twin.

    Attributes:
        has_stray: Whether a late answer was found before a request; the reader resets it.
    """

    has_stray: bool

    def exchange(
        self,
        servo_id: int,
        instruction: int,
        parameters: bytes,
        ids: Sequence[int],
        length: int,
    ) -> dict[int, ServoReply]:
        """Send an instruction and wait for the replies.

        Args:
            servo_id: Id of the addressed servo, or `BROADCAST`.
            instruction: Code of the instruction.
            parameters: Its parameters.
            ids: Servos that reply; empty for an instruction without a reply.
            length: Bytes of data in each reply; a refusal may have fewer.

        Returns:
            The replies by id, without servos that did not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        ...

    def close(self) -> None:
        """Close the port."""
        ...


class RegisterBus:
    """Reads and writes registers of the servos on a bus.

    Args:
        port: Port of the bus.
        device: Name of the bus in messages.

    Attributes:
        port: Port of the bus.
    """

    def __init__(self, port: ServoPort, device: str) -> None:
        self.port = port
        self._device = device

    def ping(self, servo_id: int) -> int | None:
        """Return the model number of a servo; None if it does not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        reply = self._ask(servo_id, PING, b"", _PING_BYTES)
        if reply is None or len(reply.data) != _PING_BYTES:
            return None
        return int.from_bytes(reply.data[:2], "little")

    def read(self, servo_id: int, register: Register) -> int:
        """Read a register of one servo.

        Args:
            servo_id: Id of the servo.
            register: The register.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        what = f"read its {register.name}"
        return register.decode(self._demand(what, servo_id, READ, register.span, register.size))

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Write a register of one servo and wait for its confirmation.

        Args:
            servo_id: Id of the servo.
            register: The register.
            value: The new value, in the register's unit.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        what = f"set its {register.name} to {value}"
        self._demand(what, servo_id, WRITE, register.span[:2] + register.encode(value), 0)

    def reboot(self, servo_id: int) -> None:
        """Reboot a servo.

        Raises:
            RobotError: If it does not answer.
        """
        # Only once: it does not answer while it starts.
        if self._ask(servo_id, REBOOT, b"", 0, tries=1) is None:
            raise self._no_answer(servo_id)

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a register of several servos with one packet, which has no reply.

        Args:
            register: The register.
            values: New values by id.

        Raises:
            RobotError: If the bus is gone.
        """
        items = (bytes([one]) + register.encode(value) for one, value in values.items())
        self.port.exchange(BROADCAST, SYNC_WRITE, register.span + b"".join(items), (), 0)

    def sync_read(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        """Read a register of several servos with one packet.

        Args:
            register: The register.
            ids: Ids of the servos.

        Returns:
            The replies by id, without servos that did not answer or refused.

        Raises:
            RobotError: If the bus is gone.
        """
        parameters = register.span + bytes(ids)
        heard = self.port.exchange(BROADCAST, SYNC_READ, parameters, ids, register.size)
        return {one: reply for one, reply in heard.items() if len(reply.data) == register.size}

    def _ask(
        self, servo_id: int, instruction: int, parameters: bytes, length: int, tries: int = _TRIES
    ) -> ServoReply | None:
        """Send an instruction to one servo until it replies; None if it does not."""
        for _ in range(tries):
            heard = self.port.exchange(servo_id, instruction, parameters, (servo_id,), length)
            if servo_id in heard:
                return heard[servo_id]
        return None

    def _demand(
        self, what: str, servo_id: int, instruction: int, parameters: bytes, length: int
    ) -> bytes:
        """Return the data of a servo's reply; raise RobotError if it does not answer or refuses."""
        reply = self._ask(servo_id, instruction, parameters, length)
        if reply is None:
            raise self._no_answer(servo_id)
        if number := reply.error & REFUSED:
            why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
            raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")
        return reply.data

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
