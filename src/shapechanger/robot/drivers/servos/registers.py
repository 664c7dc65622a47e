"""Instructions that read and write registers, independent of how packets travel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple, Protocol

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.family import Register, ServoFamily

BROADCAST: Final = 0xFE
"""Id that addresses all servos."""

READ: Final = 0x02
WRITE: Final = 0x03
SYNC_READ: Final = 0x82
SYNC_WRITE: Final = 0x83

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

    `poll` reads a register of all servos in each cycle, although some may not answer. In a sync
    read each servo waits for the one before it, so a silent one may silence those behind it. The
    first missing servo becomes a suspect, and the others are read once more without it. Suspects
    are read alone, one per cycle. So a cycle waits for at most two timeouts, whatever is missing.

    Args:
        port: Port of the bus.
        device: Name of the bus in messages.
        family: Family of the servos.
        ids: Ids of the servos.

    Attributes:
        port: Port of the bus.
        suspects: Servos that did not answer when they were last read.
    """

    def __init__(
        self, port: ServoPort, device: str, family: ServoFamily, ids: Sequence[int]
    ) -> None:
        self.port = port
        self._device = device
        self._family = family
        self._ids = tuple(ids)
        self.suspects: list[int] = []

    def find(self, servo_id: int, register: Register) -> int | None:
        """Read a register of one servo; None if it does not answer.

        Args:
            servo_id: Id of the servo.
            register: The register.

        Raises:
            RobotError: If it refuses, or the bus is gone.
        """
        size = register.size
        parameters = self._number(register.address) + self._number(size)
        data = self._ask(f"read its {register.name}", servo_id, READ, parameters, size)
        return None if data is None else register.decode(data)

    def read(self, servo_id: int, register: Register) -> int:
        """Read a register of one servo.

        Args:
            servo_id: Id of the servo.
            register: The register.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        value = self.find(servo_id, register)
        if value is None:
            raise self._no_answer(servo_id)
        return value

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
        parameters = self._number(register.address) + register.encode(value)
        if self._ask(what, servo_id, WRITE, parameters, 0) is None:
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
        parameters = self._number(register.address) + self._number(register.size) + b"".join(items)
        self.port.exchange(BROADCAST, SYNC_WRITE, parameters, (), 0)

    def sync_read(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        """Read a register of several servos with one packet.

        Args:
            register: The register.
            ids: Ids of the servos; without any nothing is sent.

        Returns:
            The replies by id, without servos that did not answer or refused.

        Raises:
            RobotError: If the bus is gone.
        """
        if not ids:
            return {}
        size = register.size
        parameters = self._number(register.address) + self._number(size) + bytes(ids)
        heard = self.port.exchange(BROADCAST, SYNC_READ, parameters, ids, size)
        return {one: reply for one, reply in heard.items() if len(reply.data) == size}

    def poll(self, register: Register) -> dict[int, ServoReply]:
        """Read a register of all servos; those that did not answer are missing.

        Raises:
            RobotError: If the bus is gone.
        """
        asked = self._trusted()
        heard = self.sync_read(register, asked)
        missing = [one for one in asked if one not in heard]
        if missing:
            first, *behind = missing
            self.suspects.append(first)
            heard |= self.sync_read(register, behind)
            self.suspects += [one for one in behind if one not in heard][:1]
        elif self.suspects:
            suspect = self.suspects.pop(0)
            heard |= (answer := self.sync_read(register, [suspect]))
            if not answer:
                self.suspects.append(suspect)
        return heard

    def read_each(self, register: Register) -> dict[int, int]:
        """Read a register of all servos, suspects one by one; those without an answer are missing.

        Raises:
            RobotError: If the bus is gone.
        """
        groups = [self._trusted(), *([one] for one in self.suspects)]
        return {
            one: register.decode(reply.data)
            for group in groups
            for one, reply in self.sync_read(register, group).items()
        }

    def _trusted(self) -> list[int]:
        return [one for one in self._ids if one not in self.suspects]

    def _number(self, value: int) -> bytes:
        return value.to_bytes(self._family.address_size, "little")

    def _ask(
        self, what: str, servo_id: int, instruction: int, parameters: bytes, length: int
    ) -> bytes | None:
        """Return the data of a servo's reply; None if it does not reply, even when asked again."""
        for _ in range(_TRIES):
            heard = self.port.exchange(servo_id, instruction, parameters, (servo_id,), length)
            if (reply := heard.get(servo_id)) is None:
                continue
            if number := reply.error & self._family.refused:
                why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
                raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")
            return reply.data
        return None

    def _no_answer(self, servo_id: int) -> RobotError:
        return RobotError(f"Servo {servo_id} at {self._device} does not answer.")
