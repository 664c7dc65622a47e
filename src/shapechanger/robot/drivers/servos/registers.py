"""Registers of the servos on a bus: set-up, reading and writing, however packets travel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple, Protocol

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.family import Register
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings

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
        settings: The bus and its servos.

    Attributes:
        port: Port of the bus.
    """

    def __init__(self, port: ServoPort, settings: BusSettings) -> None:
        self.port = port
        self._settings = settings
        self._device = settings.device
        self._family = settings.family
        self._ids = [servo.id for servo in settings.servos]
        self._suspects: list[int] = []  # Did not answer when they were last read.

    def set_up(self, alive: Callable[[], object]) -> None:
        """Check and prepare all servos, without torque."""
        self._check_servos(alive)
        for servo in self._settings.servos:
            alive()
            self._prepare(servo)
        self._suspects.clear()

    def set_mark(self, servo: ServoSettings) -> None:
        """Set the goal to 0, and what shows a restart, which starts a watchdog."""
        # A change of mode sets the goal to the limit.
        self.write(servo.id, self._family.goal, 0)
        self.write(servo.id, self._family.mark, self._settings.mark)

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
            self._suspects.append(first)
            heard |= self.read_several(register, behind)
            self._suspects += [one for one in behind if one not in heard][:1]
        elif self._suspects:
            suspect = self._suspects.pop(0)
            heard |= (answer := self.read_several(register, [suspect]))
            if not answer:
                self._suspects.append(suspect)
        return heard

    def read_each(self, register: Register) -> dict[int, int]:
        """Read a register of all servos, suspects one by one; silent ones are missing."""
        groups = [self._trusted(), *([one] for one in self._suspects)]
        return {
            one: register.decode(reply.data)
            for group in groups
            for one, reply in self.read_several(register, group).items()
        }

    def _trusted(self) -> list[int]:
        return [one for one in self._ids if one not in self._suspects]

    def _check(self, reply: ServoReply, servo_id: int, what: str) -> None:
        """Raise RobotError if a servo refuses to do something."""
        if number := reply.error & self._family.refused:
            why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
            raise RobotError(f"Servo {servo_id} at {self._device} refuses to {what}: {why}.")

    def _check_servos(self, alive: Callable[[], object]) -> None:
        """Check that every servo answers, has the right model and firmware that is new enough."""
        bus, models = self._settings, dict[int, int | None]()
        for servo in bus.servos:
            alive()
            models[servo.id] = self.find(servo.id, self._family.model_number)
        names = {servo.id: f"{servo.name} (id {servo.id})" for servo in bus.servos}
        if missing := [names[one] for one, number in models.items() if number is None]:
            there = [names[one] for one, number in models.items() if number is not None]
            raise RobotError(
                f"At {bus.device}, with {bus.baud} baud, no servo answers as {', '.join(missing)}; "
                f"those that do: {', '.join(there) or 'none'}. Look at power, cables, ids and "
                "baud, and at the latency timer of the adapter."
            )
        for servo in bus.servos:
            known, number = servo.known, models[servo.id]
            if number != known.number:
                raise RobotError(
                    f"{servo.words} is not an {known.name}: its model number is {number}, "
                    f"not {known.number}."
                )
            firmware = self.read(servo.id, self._family.firmware)
            if firmware < known.least_firmware:
                raise RobotError(
                    f"{servo.words} has firmware {firmware}; its own watchdog needs "
                    f"{known.least_firmware} or newer."
                )

    def _prepare(self, servo: ServoSettings) -> None:
        """Set up the mode, the limit of the goal, no goal and no torque."""
        family = self._family
        self.write(servo.id, family.torque_enable, 0)
        self.write(servo.id, family.mark, 0)  # A tripped watchdog blocks all goals.
        if error := self.read(servo.id, family.hardware_error):
            raise RobotError(
                f"{servo.words} has switched itself off: {family.error_words(error)}. Only a "
                "reboot gives it torque again, after which its zero must be found again."
            )
        if family.lock is not None:
            self.write(servo.id, family.lock, 0)
        for register, value, kept_bits in (
            *((one, one.value, one.kept_bits) for one in family.constants),
            (family.mode, family.modes[servo.control], 0),
            (family.most, servo.most_counts, 0),
        ):
            # These are in the EEPROM, which wears out: write them only if they differ.
            found = self.read(servo.id, register)
            if (wanted := found & kept_bits | value) != found:
                self.write(servo.id, register, wanted)
                if self.read(servo.id, register) != wanted:  # Not every family refuses.
                    raise RobotError(f"{servo.words} does not keep {wanted} as {register.name}.")
        if family.lock is not None:
            self.write(servo.id, family.lock, 1)
        self.set_mark(servo)
