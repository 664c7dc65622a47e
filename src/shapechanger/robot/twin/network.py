"""A bad network: a TCP proxy that delays, slices or blocks data, or resets connections."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections import deque
from collections.abc import Coroutine
from threading import Thread
from typing import Any, Final, Self

_POLL_S: Final = 0.001
# Linger for 0 s: closing then sends a reset instead of an orderly end.
_RESET: Final = struct.pack("ii", 1, 0)


class _End(asyncio.Protocol):
    """One end of a connection; data that arrives here leaves from the other end.

    Args:
        network: The network.
        other: The end at the driver; None for that end, which makes the robot's.
    """

    transport: Any = None

    def __init__(self, network: BadNetwork, other: _End | None = None) -> None:
        self._network = network
        self.faces_robot = other is not None
        self.other = other or _End(network, self)
        self._queue: deque[tuple[float, bytes]] = deque()  # With the earliest time for it, s.

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        self._network.ends.append(self)

    def data_received(self, data: bytes) -> None:
        network = self._network
        step = network.slice_bytes or len(data)
        due_s = network.loop.time() + network.latency_s
        is_polled = bool(self._queue)
        self._queue.extend((due_s, data[at : at + step]) for at in range(0, len(data), step))
        if not is_polled:
            self._pass_on()

    def connection_lost(self, exc: Exception | None) -> None:
        self._network.ends.remove(self)
        self._queue.clear()
        if self.other.transport is not None:
            self.other.transport.close()

    def _pass_on(self) -> None:
        network, sink = self._network, self.other.transport
        while self._queue and sink is not None and not network.silent:
            due_s, data = self._queue[0]
            if due_s > network.loop.time():
                break
            sink.write(data)
            self._queue.popleft()
        if self._queue:
            network.loop.call_later(_POLL_S, self._pass_on)


class BadNetwork:
    """Forwards connections from a free port of 127.0.0.1 to another one.

    Args:
        port: Port of 127.0.0.1 to forward to.

    Attributes:
        latency_s: Delay of each byte, s.
        slice_bytes: Most bytes to forward at once; 0 for any number.
        silent: Whether to block all data while connections stay open, as when a radio dies.
        loop: Loop of its thread.
        ends: Ends of the open connections.
        port: Port on which it listens.
    """

    def __init__(self, port: int) -> None:
        self.latency_s = 0.0
        self.slice_bytes = 0
        self.silent = False
        self.ends: list[_End] = []
        self._robot_port = port
        self.loop = asyncio.new_event_loop()
        self._thread = Thread(target=self.loop.run_forever, name="bad network", daemon=True)
        self._thread.start()
        self._server = self._run(self.loop.create_server(self._accepted, "127.0.0.1", 0))
        self.port: int = self._server.sockets[0].getsockname()[1]

    def __enter__(self) -> Self:
        """Return the network."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the network."""
        self.close()

    def reset(self) -> None:
        """Reset all connections, as a router does after a restart."""
        self._run(self._drop_all(reset=True))

    def half_close(self) -> None:
        """End the direction towards the robot of all connections."""
        self._run(self._half_close())

    def close(self) -> None:
        """End all connections and the thread."""
        self._run(self._drop_all(reset=False))
        self.loop.call_soon_threadsafe(self._server.close)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join()
        self.loop.close()

    def _run(self, act: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(act, self.loop).result()

    def _accepted(self) -> _End:
        near = _End(self)
        self._joining = self.loop.create_task(self._join(near))
        return near

    async def _join(self, near: _End) -> None:
        try:
            await self.loop.create_connection(lambda: near.other, "127.0.0.1", self._robot_port)
        except OSError:
            near.transport.close()  # As if the robot refused the connection.

    async def _drop_all(self, *, reset: bool) -> None:
        for end in self.ends:
            if reset:
                linger = (socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
                end.transport.get_extra_info("socket").setsockopt(*linger)
            end.transport.abort()

    async def _half_close(self) -> None:
        for end in self.ends:
            if end.faces_robot:
                end.transport.get_extra_info("socket").shutdown(socket.SHUT_WR)
