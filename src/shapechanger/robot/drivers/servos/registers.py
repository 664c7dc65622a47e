"""Reading and writing of registers of servos, independent of how packets travel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple, Protocol

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.family import Register, ServoFamily

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

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read bytes of several servos and wait for the replies.

        Returns:
            The replies by id, without servos that did not answer.

        Raises:
            RobotError: If the bus is gone.
        """
        ...

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write bytes of several servos without a reply, or of one and wait for its reply.

        Returns:
            The reply of a single servo by its id, if it answered.

        Raises:
            RobotError: If the bus is gone.
        """
        ...

    def close(self) -> None:
        """Close the port."""
        ...


class RegisterBus:
    """Reads and writes registers of the servos on a bus.

    `poll` reads a register of all servos in each cycle, although some may not answer. In one packet
    each servo waits for the one before it, so a silent one may silence those behind it. The
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
        self._refused = family.refused
        self._ids = tuple(ids)
        self.suspects: list[int] = []

    def find(self, servo_id: int, register: Register) -> int | None:
        """Read a register of one servo; None if it does not answer, even when asked again."""
        for _ in range(_TRIES):
            if reply := self.port.read([servo_id], register.address, register.size).get(servo_id):
                self._check(reply, servo_id, f"read its {register.name}")
                return register.decode(reply.data)
        return None

    def read(self, servo_id: int, register: Register) -> int:
        """Read a register of one servo.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        value = self.find(servo_id, register)
        if value is None:
            raise RobotError(f"Servo {servo_id} at {self._device} does not answer.")
        return value

    def write(self, servo_id: int, register: Register, value: int) -> None:
        """Write a register of one servo and wait for its confirmation.

        Raises:
            RobotError: If it does not answer or refuses.
        """
        for _ in range(_TRIES):
            heard = self.port.write({servo_id: register.encode(value)}, register.address)
            if reply := heard.get(servo_id):
                self._check(reply, servo_id, f"set its {register.name} to {value}")
                return
        raise RobotError(f"Servo {servo_id} at {self._device} does not answer.")

    def write_all(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a register of all servos with one packet, which has no reply."""
        data = {one: register.encode(value) for one, value in values.items()}
        self.port.write(data, register.address)

    def read_several(self, register: Register, ids: Sequence[int]) -> dict[int, ServoReply]:
        """Read a register of several servos with one packet.

        Returns:
            The replies by id, without servos that did not answer or refused.
        """
        heard = self.port.read(ids, register.address, register.size) if ids else {}
        return {one: reply for one, reply in heard.items() if len(reply.data) == register.size}

    def poll(self, register: Register) -> dict[int, ServoReply]:
        """Read a register of all servos; those that did not answer are missing."""
        asked = self._trusted()
        heard = self.read_several(register, asked)
        missing = [one for one in asked if one not in heard]
        if missing:
            first, *behind = missing
            self.suspects.append(first)
            heard |= self.read_several(register, behind)
            self.suspects += [one for one in behind if one not in heard][:1]
        elif self.suspects:
            suspect = self.suspects.pop(0)
            heard |= (answer := self.read_several(register, [suspect]))
            if not answer:
                self.suspects.append(suspect)
        return heard

    def read_each(self, register: Register) -> dict[int, int]:
        """Read a register of all servos, suspects one by one; silent ones are missing."""
        groups = [self._trusted(), *([one] for one in self.suspects)]
        return {
            one: register.decode(reply.data)
            for group in groups
            for one, reply in self.read_several(register, group).items()
        }

    def _trusted(self) -> list[int]:
        return [one for one in self._ids if one not in self.suspects]

    def _check(self, reply: ServoReply, servo_id: int, what: str) -> None:
        """Raise RobotError if a servo refuses to do something."""
        if number := reply.error & self._refused:
            why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
            raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")
