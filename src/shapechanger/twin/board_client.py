"""A process's connection to the twin's board."""

from __future__ import annotations

import os
import select
import socket
from collections import deque
from collections.abc import Sequence
from typing import Any, Final, Literal

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.robot.hardware import Clock
from shapechanger.twin import messages as wire
from shapechanger.twin.messages import BoardLink, EdgeListener

__all__ = ["BoardPort", "Link"]


class Link:
    """One connection, for one thread.

    Attributes:
        clock: Where the run's time comes from, "real" or "twin".
        now_ns: The newest twin time that the board has told; when the clock is real, the time of
            the connection.
        levels: Level of each pin that is claimed as an input.
        on_edge: Whom `dispatch` tells of edges.
    """

    def __init__(self, path: str, role: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._socket.connect(path)
        except OSError as error:
            self._socket.close()
            raise RobotError(f"No twin's board answers at {path}: {error.strerror}.") from error
        self._asked = 0
        self._edges: deque[tuple[int, int, int]] = deque()
        self._grants: deque[int] = deque()
        self._replies: dict[int, wire.Message] = {}
        self.levels: dict[int, int] = {}
        self.on_edge: EdgeListener | None = None
        answer = self.ask(op="hello", role=role, pid=os.getpid())
        self.clock: Literal["real", "twin"] = answer["clock"]
        self.now_ns: int = answer["t"]

    @property
    def closed(self) -> bool:
        """Whether it was closed here."""
        return self._socket.fileno() < 0

    def fileno(self) -> int:
        """The descriptor, to wait for."""
        return self._socket.fileno()

    def post(self, **message: Any) -> None:
        """Say something that needs no answer.

        Raises:
            RobotError: If the board is gone.
        """
        try:
            self._socket.send(wire.encode(message))
        except OSError as error:
            raise RobotError("The twin's board is gone.") from error

    def ask(self, **message: Any) -> wire.Message:
        """Say something and wait for the answer.

        Raises:
            RobotError: If the board refuses, or is gone.
            OSError: If a chip does not answer, as smbus2 raises it.
        """
        self._asked += 1
        self.post(id=self._asked, **message)
        while self._asked not in self._replies:
            self._receive(0)
        answer = self._replies.pop(self._asked)
        if "error" in answer:
            raise RobotError(answer["error"])
        if "errno" in answer:
            raise OSError(answer["errno"], os.strerror(answer["errno"]))
        return answer

    def drain(self) -> None:
        """Take in everything that has arrived, without waiting."""
        while self._receive(socket.MSG_DONTWAIT):
            pass

    def dispatch(self) -> None:
        """Tell `on_edge` of all edges that have arrived."""
        while self._edges:
            edge = self._edges.popleft()
            if self.on_edge is not None:
                self.on_edge(*edge)

    def granted(self, at_most_s: float) -> bool:
        """Wait for a grant of time, which is then `now_ns`; dispatch the edges before it."""
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        while not self._grants:
            if not poll.poll(max(0.0, at_most_s * 1e3)):
                self.dispatch()
                return False
            self.drain()
        self.now_ns = self._grants.popleft()
        self.dispatch()
        return True

    def close(self) -> None:
        """Say goodbye."""
        if not self.closed:
            try:
                self._socket.send(wire.encode({"op": "bye"}))
            except OSError:
                pass  # The board left first: nobody is there to be told.
            finally:
                self._socket.close()

    def _receive(self, flags: int) -> bool:
        """Take in one message; False if there is none."""
        try:
            data = self._socket.recv(wire.MAX_MESSAGE, flags)
        except BlockingIOError:
            return False
        except OSError as error:
            raise RobotError("The twin's board is gone.") from error
        if not data:
            raise RobotError("The twin's board is gone.")
        message = wire.decode(data)
        op = message["op"]
        if op == "grant":
            self._grants.append(message["t"])
        elif op == "inputs":
            for pin, level, at_ns in message["edges"]:
                self.levels[pin] = level
                self._edges.append((pin, level, at_ns))
        else:
            self._replies[message["id"]] = message
        return True


_JUST_NOW_NS: Final = 2_000_000


class BoardPort:
    """What the SDK's packet handler asks of a port; an answer takes no time, as at a `LinePort`.

    Args:
        link: The connection to the board.
        clock: The time.
        settings: Of the bus.

    Attributes:
        is_using: As the SDK wants it.

    Raises:
        RobotError: If the board has no servos.
    """

    def __init__(self, link: BoardLink, clock: Clock, settings: BusSettings) -> None:
        self._link = link
        self._clock = clock
        self._asked_ns = 0
        self._baud = settings.baud
        self._arrived = bytearray()
        self.is_using = False
        self._device = settings.device
        self._say(b"")

    def clearPort(self) -> None:
        """Forget what has arrived."""
        self._arrived.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes."""
        data = bytes(packet)
        self._say(data)
        return len(data)

    def readPort(self, length: int) -> bytes:
        """At most so many bytes of what has arrived."""
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
        return not self._arrived

    def getBytesAvailable(self) -> int:
        """How many bytes have arrived and were not read."""
        # A board that was asked just now has nothing new, and each question costs a busy one time.
        if self._clock.now_ns() - self._asked_ns > _JUST_NOW_NS:
            self._say(b"")
        return len(self._arrived)

    def getBaudRate(self) -> int:
        """Bits a second."""
        return self._baud

    def closePort(self) -> None:
        """Nothing: the link belongs to somebody else."""

    def _say(self, data: bytes) -> None:
        self._asked_ns = self._clock.now_ns()
        answer = self._link.ask(op="servo", device=self._device, data=data.hex())
        self._arrived += bytes.fromhex(answer["data"])
