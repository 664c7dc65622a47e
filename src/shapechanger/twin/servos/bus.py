"""The bus with its servos: bytes go in, bytes come out, and time moves when it is told to."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import tty
from collections.abc import Sequence
from types import TracebackType
from typing import Final, Self

from shapechanger.errors import RobotError
from shapechanger.twin.servos.motor import EndStops, Load
from shapechanger.twin.servos.protocol import BROADCAST, Packet, Parser, crc16, packed, status
from shapechanger.twin.servos.servo import ServoPlan, SimulatedServo

__all__ = ["LinePort", "LinePty", "SimulatedBus"]

_STATUS: Final = 0x55
_SYNC_READ: Final = 0x82
_SYNC_WRITE: Final = 0x83
_FAST_SYNC_READ: Final = 0x8A
_PING: Final = 0x01
_CRC_ERROR: Final = 3

_STEP_NS: Final = 1_000_000
# Assumed: a packet that does not go on for so long is dropped.
_PATIENCE_NS: Final = 10_000_000
_BAUD_CODES: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
_BITS_PER_BYTE: Final = 10


class SimulatedBus:
    """A bus.

    Assumed, and unkind on purpose: in a sync read, servos behind one that is silent stay silent.

    Args:
        plans: The servos.
        load: What they pull at; None for a spring between two stops for each.
        baud: Bits a second.

    Attributes:
        servos: By id.
        now_ns: The line's time.
        busy_ns: How long the bytes so far took on the wire, return delays included. Time does not
            wait for them: this is for who wants to know how busy a bus is.

    Raises:
        RobotError: If two servos have one id, or there is no such baud rate.
    """

    def __init__(
        self, plans: Sequence[ServoPlan], load: Load | None = None, baud: int = 1_000_000
    ) -> None:
        if baud not in _BAUD_CODES:
            rates = ", ".join(map(str, _BAUD_CODES))
            raise RobotError(f"No servo has {baud} baud; there are {rates}.")
        self.servos = {plan.id: SimulatedServo(plan, _BAUD_CODES.index(baud)) for plan in plans}
        if len(self.servos) != len(plans):
            raise RobotError("Two servos on a line cannot have the same id.")
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
        """Take bytes from the host."""
        if self._parser.waits and self.now_ns - self._fed_ns > _PATIENCE_NS:
            self._parser.forget()
        self._fed_ns = self.now_ns
        self.busy_ns += self._wire_ns(len(data))
        for packet in self._parser.feed(data):
            self._take(packet)

    def send(self) -> bytes:
        """The bytes that have come for the host since the last call."""
        due = [data for at_ns, data in self._late if at_ns <= self.now_ns]
        self._late = [one for one in self._late if one[0] > self.now_ns]
        self._out += b"".join(due)
        data = bytes(self._out)
        self._out.clear()
        return data

    def advance(self, ns: int) -> None:
        """Let time go by."""
        end_ns = self.now_ns + ns
        while self.now_ns < end_ns:
            before_ns, self.now_ns = self.now_ns, min(self.now_ns + _STEP_NS, end_ns)
            servos = list(self.servos.values())
            for servo, travel in zip(servos, self._travels, strict=True):
                servo.advance(self.now_ns, travel)
            dt_s = (self.now_ns - before_ns) / 1e9
            self._travels = list(self._load.pull([one.motor.tension for one in servos], dt_s))

    def set_travels(self, travels_m: Sequence[float]) -> None:
        """Say where the tendons' ends are, after somebody has put what they pull elsewhere."""
        self._travels = list(travels_m)

    def _take(self, packet: Packet) -> None:
        awake = [one for one in self.servos.values() if one.is_awake]
        if not packet.is_whole:
            for servo in awake:
                if servo.plan.id == packet.id:
                    self._say(servo, status(servo.plan.id, _CRC_ERROR))
            return
        if packet.instruction == _STATUS:
            return
        for servo in awake:
            servo.hear()
        if packet.instruction in (_SYNC_READ, _FAST_SYNC_READ):
            self._sync_read(packet)
        elif packet.instruction == _SYNC_WRITE:
            self._sync_write(packet)
        else:
            self._single(packet, awake)

    def _single(self, packet: Packet, awake: Sequence[SimulatedServo]) -> None:
        for servo in awake:
            if packet.id not in (servo.plan.id, BROADCAST):
                continue
            answer = servo.obey(packet.instruction, packet.parameters, packet.id)
            if answer is not None:
                self._say(servo, status(servo.plan.id, answer.error, answer.data))

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
        is_fast = packet.instruction == _FAST_SYNC_READ
        blocks: list[bytes] = []
        for servo_id in ids:
            servo = self.servos.get(servo_id)
            if servo is None or not servo.is_awake or servo.faults.mute:
                break
            if is_fast and not servo.plan.fast:
                break
            answer = servo.read(at, length)
            if is_fast:
                blocks.append(bytes([answer.error, servo_id]) + answer.data.ljust(length, b"\0"))
                continue
            self._say(servo, status(servo_id, answer.error, answer.data))
            if servo.faults.late_ns:
                break
        if blocks:
            self._out += _fast_status(blocks, len(ids), length)

    def _say(self, servo: SimulatedServo, data: bytes) -> None:
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
    """Address and length of a sync instruction, and what follows."""
    at, length = (int.from_bytes(parameters[i : i + 2], "little") for i in (0, 2))
    return (at, length, parameters[4:]) if len(parameters) >= 4 else (0, 0, b"")


def _fast_status(blocks: Sequence[bytes], count: int, length: int) -> bytes:
    """The common answer; cut off behind the last block where somebody is missing.

    Each block ends with the CRC of everything before it, as the manual's pictures show it. Assumed:
    nothing is stuffed, since the SDK removes no stuffing here.
    """
    whole = packed(BROADCAST, _STATUS, b"")[:5]
    whole += (1 + count * (length + 4)).to_bytes(2, "little") + bytes([_STATUS])
    for block in blocks:
        whole += block
        whole += crc16(whole).to_bytes(2, "little")
    return whole


class LinePort:
    """What the SDK's packet handler asks of a port, and nothing that depends on the machine.

    An answer is there at once or, if it is late or missing, not at all: then the time for it is
    over as soon as somebody asks.

    Args:
        line: The bus.
        baud: Bits a second, for who asks.

    Attributes:
        is_using: As the SDK wants it.
        is_cut: Whether the cable is cut: what is sent arrives nowhere.
        is_gone: Whether the device is gone: every use raises `OSError`.
        sent: Every packet that was written, for a test to look at.
    """

    def __init__(self, line: SimulatedBus, baud: int = 1_000_000) -> None:
        self._line = line
        self._baud = baud
        self._arrived = bytearray()
        self.is_using = False
        self.is_cut = False
        self.is_gone = False
        self.is_closed = False
        self.sent: list[bytes] = []

    def inject(self, data: bytes) -> None:
        """Let bytes arrive that no servo has sent."""
        self._arrived += data

    def clearPort(self) -> None:
        """Forget what has arrived."""
        self._pump()
        self._arrived.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes."""
        self._pump()
        data = bytes(packet)
        self.sent.append(data)
        if not self.is_cut:
            self._line.receive(data)
        return len(data)

    def readPort(self, length: int) -> bytes:
        """At most so many bytes of what has arrived."""
        self._pump()
        if length <= 0:
            return b""
        data = bytes(self._arrived[:length])
        del self._arrived[:length]
        return data

    def setPacketTimeout(self, packet_length: int) -> None:
        """Nothing: an answer takes no time."""

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Nothing: an answer takes no time."""

    def isPacketTimeout(self) -> bool:
        """Whether nothing more will come."""
        self._pump()
        return not self._arrived

    def getBytesAvailable(self) -> int:
        """How many bytes have arrived and were not read."""
        self._pump()
        return len(self._arrived)

    def getBaudRate(self) -> int:
        """Bits a second."""
        return self._baud

    def closePort(self) -> None:
        """Let go of the line."""
        self.is_closed = True

    def _pump(self) -> None:
        if self.is_gone:
            raise OSError(5, "Input/output error")
        if not self.is_cut:
            self._arrived += self._line.send()


_CHUNK: Final = 4096


class LinePty:
    """Answers at a pseudo-terminal from a thread of its own; the line's time is the caller's.

    What was written without being answered, such as a sync write, is sure to have arrived once
    something after it was answered. So whoever lets time go by should have heard an answer before.

    Args:
        line: The bus. From now on only `advance` may be used, or `lock` be held.

    Attributes:
        device: Path to open, such as "/dev/pts/3".
        line: The bus.
        lock: Held while the line is used.
    """

    def __init__(self, line: SimulatedBus) -> None:
        self.line = line
        self.lock = threading.Lock()
        self._host, self._far = os.openpty()
        tty.setraw(self._far)  # No echo, and no byte means anything.
        os.set_blocking(self._host, False)
        self.device = os.ttyname(self._far)
        self._wake_in, self._wake_out = os.pipe()
        self._thread = threading.Thread(target=self._run, name="servo line", daemon=True)
        self._thread.start()

    def advance(self, ns: int) -> None:
        """Let time go by."""
        with self.lock:
            self.line.advance(ns)
            late = self.line.send()
        self._give(late)

    def close(self) -> None:
        """End the thread and the device."""
        if self._thread.is_alive():
            os.write(self._wake_out, b"x")
            self._thread.join()
            for fd in (self._host, self._far, self._wake_in, self._wake_out):
                os.close(fd)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._host, self._wake_in], [], [])
            if self._wake_in in ready:
                return
            data = os.read(self._host, _CHUNK)
            with self.lock:
                self.line.receive(data)
                answer = self.line.send()
            self._give(answer)

    def _give(self, data: bytes) -> None:
        """Send bytes; a serial line loses what nobody takes."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._host, data)
