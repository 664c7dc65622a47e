"""One client of the board."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Final

from shapechanger.twin import wire
from shapechanger.twin.pin_board import Owner
from shapechanger.twin.sensors import Edge

__all__ = ["Connection"]

_MOST_WAITING: Final = 256
"""Messages that wait for a client that does not read; then edges are lost, as in the kernel."""


class Connection:
    """One client; nothing here ever waits for it.

    Args:
        connected: Its socket.

    Attributes:
        role: "hardware", "operator" or "clock".
        owner: Whose pins it holds.
        inputs: Pins whose edges it wants.
        takes_part: Whether time waits for it.
        works: Whether it was granted time and has not said that it is done.
        until_ns: When it wants time at the latest.
        polite: Whether it said goodbye.
    """

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self._socket = connected
        self._outbox: deque[bytes] = deque()
        self.role = "clock"
        self.owner = Owner(self, 0)
        self.inputs: set[int] = set()
        self.takes_part = False
        self.works = False
        self.until_ns = 0
        self.polite = False

    def fileno(self) -> int:
        """The descriptor, to wait for."""
        return self._socket.fileno()

    @property
    def wants_to_write(self) -> bool:
        """Whether something waits for the client to read."""
        return bool(self._outbox)

    def receive(self) -> wire.Message | None:
        """The next message; None if there is none now.

        Raises:
            EOFError: If the client is gone.
        """
        try:
            data = self._socket.recv(wire.MAX_MESSAGE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        return wire.decode(data)

    def send(self, message: wire.Message) -> None:
        """Say something, now or when the client reads."""
        self._outbox.append(wire.encode(message))
        self.flush()

    def send_edges(self, edges: Iterable[Edge], levels: Mapping[int, int]) -> None:
        """Tell of those edges that the client wants."""
        wanted = [[edge.pin, edge.level, edge.t] for edge in edges if edge.pin in self.inputs]
        if not wanted:
            return
        if len(self._outbox) >= _MOST_WAITING:
            # Too slow: it gets the levels as they are in the end, and not how they came about.
            self._outbox.pop()
            wanted = [[pin, levels.get(pin, 0), wanted[-1][2]] for pin in sorted(self.inputs)]
        for start in range(0, len(wanted), wire.MOST_EDGES):
            self.send({"op": "inputs", "edges": wanted[start : start + wire.MOST_EDGES]})

    def flush(self) -> None:
        """Send what waits, as far as the client reads."""
        while self._outbox:
            try:
                self._socket.send(self._outbox[0])
            except BlockingIOError:
                return
            except OSError:
                self._outbox.clear()  # It is gone, which the next `receive` says.
                return
            self._outbox.popleft()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
