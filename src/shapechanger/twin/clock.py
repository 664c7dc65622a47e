"""Time on the twin: the machine's, or one that moves only when it is asked to."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Sequence

from shapechanger.errors import RobotError
from shapechanger.twin import messages as wire
from shapechanger.twin.board_client import Link

__all__ = ["GrantedClock", "SteadyClock"]


class SteadyClock:
    """The machine's monotonic clock; while a guard waits, the edges of its inputs are dispatched.

    Args:
        link: The connection to the board.
    """

    def __init__(self, link: Link) -> None:
        self._link = link

    def now_ns(self) -> int:
        """Nanoseconds of CLOCK_MONOTONIC."""
        return time.monotonic_ns()

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait until a descriptor can be read or it is `until_ns`; see `Clock.wait`."""
        latest_ns = min(until_ns, time.monotonic_ns() + int(at_most_s * 1e9))
        board = self._link.fileno()
        poll = select.poll()
        for fd in {*readable, board}:
            poll.register(fd, select.POLLIN)
        while True:
            left_ms = max(0.0, (latest_ns - time.monotonic_ns()) / 1e6)
            ready = {fd for fd, _ in poll.poll(left_ms)}
            if board in ready:
                self._link.drain()
            self._link.dispatch()
            now_ns = time.monotonic_ns()
            if ready - {board} or now_ns >= latest_ns:
                return bool(ready - {board}) or now_ns >= until_ns

    async def sleep(self, seconds: float) -> None:
        """Let so many real seconds go by."""
        import asyncio  # Not in the guard, which has no use for it.

        await asyncio.sleep(seconds)


class GrantedClock:
    """The twin's own clock.

    A process that calls `wait` takes part: the board moves time only when all who take part wait.

    Args:
        link: The connection to the board.
        path: Where the board listens; each `sleep` that runs needs a connection of its own.
    """

    def __init__(self, link: Link, path: str) -> None:
        self._link = link
        self._path = path
        self._waiting = False
        self._idle: list[socket.socket] = []

    def now_ns(self) -> int:
        """The newest twin time that this process was told."""
        return self._link.now_ns

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait for the next grant, which says that the last one is done; see `Clock.wait`.

        A grant comes at each tick of the board, and at `until_ns` if that is earlier.
        """
        if not self._waiting:
            self._link.post(op="wait", until=until_ns)
            self._waiting = True
        if not self._link.granted(at_most_s):
            return False
        self._waiting = False
        return True

    async def sleep(self, seconds: float) -> int | None:
        """Let so much twin time go by; the time when the newest picture was taken."""
        import asyncio  # Not in the guard, which has no use for it.

        loop = asyncio.get_running_loop()
        connected = bool(self._idle)
        if connected:
            connection = self._idle.pop()
        else:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            connection.setblocking(False)
        try:
            if not connected:
                await loop.sock_connect(connection, self._path)
            message = {"op": "sleep", "id": 0, "ns": max(0, round(seconds * 1e9))}
            await loop.sock_sendall(connection, wire.encode(message))
            data = await loop.sock_recv(connection, wire.MAX_MESSAGE)
            if not data:
                raise RobotError("The twin's board is gone.")
        except BaseException as error:
            # Cancelled, too: what was asked on it would confuse the next sleep.
            connection.close()
            if isinstance(error, OSError):
                raise RobotError("The twin's board is gone.") from error
            raise
        self._idle.append(connection)
        answer = wire.decode(data)
        self._link.now_ns = max(self._link.now_ns, answer["t"])
        return answer["captured_ns"]

    def close(self) -> None:
        """Close the connections of `sleep`."""
        while self._idle:
            self._idle.pop().close()
