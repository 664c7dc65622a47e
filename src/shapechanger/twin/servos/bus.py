"""A simulated bus of Dynamixel servos: takes and gives bytes, and advances when asked to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.twin.servos.motor import EndStops, Load
from shapechanger.twin.servos.protocol import BROADCAST, Packet, Parser, status
from shapechanger.twin.servos.servo import ServoPlan, SimulatedServo

_STATUS: Final = 0x55
_SYNC_READ: Final = 0x82
_SYNC_WRITE: Final = 0x83
_PING: Final = 0x01
_CRC_ERROR: Final = 3

_STEP_NS: Final = 1_000_000
# Assumed: a packet is dropped when its next byte takes longer than this.
_PACKET_TIMEOUT_NS: Final = 10_000_000
_BAUD_CODES: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
_BITS_PER_BYTE: Final = 10


class SimulatedBus:
    """A bus with its servos.

    Assumed, as the worst case: in a sync read, servos behind a silent one stay silent.

    Args:
        plans: The servos.
        load: Load of their tendons; None for springs between two stops.
        baud: Baud rate.

    Attributes:
        servos: Servos by id.
        now_ns: Time of the bus.
        busy_ns: Time that all bytes so far take on the wire, return delays included. The time of
            the bus does not wait for them.

    Raises:
        RobotError: If two servos have the same id, or no servo has such a baud rate.
    """

    def __init__(
        self, plans: Sequence[ServoPlan], load: Load | None = None, baud: int = 1_000_000
    ) -> None:
        if baud not in _BAUD_CODES:
            rates = ", ".join(map(str, _BAUD_CODES))
            raise RobotError(f"No servo has {baud} baud; the baud rates are {rates}.")
        self.servos = {plan.id: SimulatedServo(plan, _BAUD_CODES.index(baud)) for plan in plans}
        if len(self.servos) != len(plans):
            raise RobotError("Two servos on a bus cannot have the same id.")
        self._load = EndStops(len(plans)) if load is None else load
        self._baud = baud
        self._travels = [0.0] * len(plans)
        self._parser = Parser()
        self._fed_ns = 0
        self._late: list[tuple[int, bytes]] = []
        self._out = bytearray()
        self.now_ns = 0
        self.busy_ns = 0

    def receive(self, data: bytes) -> None:
        """Receive bytes from the host."""
        if self._parser.waits and self.now_ns - self._fed_ns > _PACKET_TIMEOUT_NS:
            self._parser.forget()
        self._fed_ns = self.now_ns
        self.busy_ns += self._wire_ns(len(data))
        for packet in self._parser.feed(data):
            self._execute(packet)

    def send(self) -> bytes:
        """Return the bytes for the host since the last call."""
        due = [data for at_ns, data in self._late if at_ns <= self.now_ns]
        self._late = [one for one in self._late if one[0] > self.now_ns]
        self._out += b"".join(due)
        data = bytes(self._out)
        self._out.clear()
        return data

    def advance(self, ns: int) -> None:
        """Advance time."""
        end_ns = self.now_ns + ns
        while self.now_ns < end_ns:
            before_ns, self.now_ns = self.now_ns, min(self.now_ns + _STEP_NS, end_ns)
            servos = list(self.servos.values())
            for servo, travel in zip(servos, self._travels, strict=True):
                servo.advance(self.now_ns, travel)
            dt_s = (self.now_ns - before_ns) / 1e9
            self._travels = list(self._load.pull([one.motor.tension for one in servos], dt_s))

    def set_travels(self, travels_m: Sequence[float]) -> None:
        """Set where the ends of the tendons are, m, after the load was moved from outside."""
        self._travels = list(travels_m)

    def _execute(self, packet: Packet) -> None:
        awake = [one for one in self.servos.values() if one.is_awake]
        if not packet.is_valid:
            for servo in awake:
                if servo.plan.id == packet.id:
                    self._answer(servo, status(servo.plan.id, _CRC_ERROR))
            return
        if packet.instruction == _STATUS:
            return
        for servo in awake:
            servo.feed_watchdog()
        if packet.instruction == _SYNC_READ:
            self._sync_read(packet)
        elif packet.instruction == _SYNC_WRITE:
            self._sync_write(packet)
        else:
            self._single(packet, awake)

    def _single(self, packet: Packet, awake: Sequence[SimulatedServo]) -> None:
        for servo in awake:
            if packet.id not in (servo.plan.id, BROADCAST):
                continue
            answer = servo.execute(packet.instruction, packet.parameters, packet.id)
            if answer is not None:
                self._answer(servo, status(servo.plan.id, answer.error, answer.data))

    def _sync_write(self, packet: Packet) -> None:
        at, length, rest = _where(packet.parameters)
        if length == 0 or packet.id != BROADCAST or len(rest) % (1 + length):
            return
        for start in range(0, len(rest), 1 + length):
            servo = self.servos.get(rest[start])
            if servo is not None and servo.is_awake:
                servo.write(at, rest[start + 1 : start + 1 + length])

    def _sync_read(self, packet: Packet) -> None:
        at, length, ids = _where(packet.parameters)
        if packet.id != BROADCAST or len(set(ids)) != len(ids):
            return
        for servo_id in ids:
            servo = self.servos.get(servo_id)
            if servo is None or not servo.is_awake or servo.faults.mute:
                break
            answer = servo.read(at, length)
            self._answer(servo, status(servo_id, answer.error, answer.data))
            if servo.faults.late_ns:
                break

    def _answer(self, servo: SimulatedServo, data: bytes) -> None:
        faults = servo.faults
        if faults.mute:
            return
        if faults.bad_crc:
            data = data[:-1] + bytes([data[-1] ^ 0x55])
        self.busy_ns += self._wire_ns(len(data)) + 2000 * servo.register(9)
        if faults.late_ns:
            self._late.append((self.now_ns + faults.late_ns, data))
        else:
            self._out += data

    def _wire_ns(self, count: int) -> int:
        return round(1e9 * _BITS_PER_BYTE * count / self._baud)


def _where(parameters: bytes) -> tuple[int, int, bytes]:
    """Return address and length of a sync instruction, and what follows them."""
    at, length = (int.from_bytes(parameters[i : i + 2], "little") for i in (0, 2))
    return (at, length, parameters[4:]) if len(parameters) >= 4 else (0, 0, b"")
