"""A bad network: a TCP proxy that delays, slices or blocks data, or resets connections."""

from __future__ import annotations

import selectors
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, Self

_CHUNK: Final = 16 * 1024
_MAX_QUEUED: Final = 1024 * 1024  # Bytes that one direction queues before it stops reading.
_POLL_S: Final = 0.01
# Linger for 0 s: closing then sends a reset instead of an orderly end.
_RESET: Final = struct.pack("ii", 1, 0)


@dataclass
class _Stream:
    """One direction of a connection.

    Attributes:
        source: Socket to read from.
        sink: Socket to write to.
        queue: Data to write, each with the earliest time for it, s.
        size: Number of bytes in the queue.
    """

    source: socket.socket
    sink: socket.socket
    queue: deque[tuple[float, bytes]] = field(default_factory=deque[tuple[float, bytes]])
    size: int = 0


class BadNetwork:
    """Forwards connections from a free port of 127.0.0.1 to another one.

    Args:
        port: Port of 127.0.0.1 to forward to.
        clock: Time of the latency, s.

    Attributes:
        latency_s: Delay of each byte, s.
        slice_bytes: Most bytes to forward at once; 0 for any number.
        silent: Whether to block all data while connections stay open, as when a radio dies.
    """

    def __init__(self, port: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.latency_s = 0.0
        self.slice_bytes = 0
        self.silent = False
        self._port = port
        self._clock = clock
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._streams: list[_Stream] = []
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bad network", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        """Return the network."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the network."""
        self.close()

    @property
    def port(self) -> int:
        """Port on which it listens."""
        return self._listener.getsockname()[1]

    def reset(self) -> None:
        """Reset all connections, as a router does after a restart."""
        with self._lock:
            for stream in self._streams:
                stream.source.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            self._drop_all()

    def half_close(self) -> None:
        """End the direction towards the robot of all connections."""
        with self._lock:
            for stream in self._streams[::2]:
                stream.sink.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """End all connections and the thread."""
        self._ended.set()
        self._thread.join()
        with self._lock:
            self._drop_all()
        self._listener.close()
        self._selector.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            for key, _ in self._selector.select(_POLL_S if self._idle() else 0.001):
                with self._lock:
                    if key.fileobj is self._listener:
                        self._accept()
                    elif isinstance(key.data, _Stream):
                        self._read(key.data)
            with self._lock:
                for stream in tuple(self._streams):
                    self._write(stream)

    def _idle(self) -> bool:
        return self.silent or not any(stream.queue for stream in self._streams)

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        try:
            robot = socket.create_connection(("127.0.0.1", self._port), 5.0)
        except OSError:
            client.close()  # As if the robot refused the connection.
            return
        for one in (client, robot):
            one.setblocking(False)
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for stream in (_Stream(client, robot), _Stream(robot, client)):
            self._streams.append(stream)
            self._selector.register(stream.source, selectors.EVENT_READ, stream)

    def _read(self, stream: _Stream) -> None:
        if stream.size >= _MAX_QUEUED or stream not in self._streams:
            return
        try:
            data = stream.source.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(stream)
            return
        step = self.slice_bytes or len(data)
        for start in range(0, len(data), step):
            stream.queue.append((self._clock() + self.latency_s, data[start : start + step]))
        stream.size += len(data)

    def _write(self, stream: _Stream) -> None:
        now_s = self._clock()
        while stream.queue and not self.silent and stream.queue[0][0] <= now_s:
            due, data = stream.queue[0]
            try:
                sent = stream.sink.send(data)
            except BlockingIOError:
                return
            except OSError:
                self._drop(stream)
                return
            stream.size -= sent
            if sent < len(data):
                stream.queue[0] = (due, data[sent:])
                return
            stream.queue.popleft()

    def _drop(self, stream: _Stream) -> None:
        """End both directions of a connection."""
        pair = {stream.source, stream.sink}
        for other in tuple(self._streams):
            if other.source in pair:
                self._streams.remove(other)
                self._selector.unregister(other.source)
        for one in pair:
            one.close()

    def _drop_all(self) -> None:
        while self._streams:
            self._drop(self._streams[0])
