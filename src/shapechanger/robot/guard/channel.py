"""Non-blocking sockets between the guard, the daemon and the supervisor."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import time
from typing import Protocol

from shapechanger.robot.guard.messages import MAX_DATAGRAM, GuardState, Order, decode_order, encode

# A daemon cannot send more between two rounds than its socket holds; this bounds a round all the
# same, should it send as fast as it is read.
_MOST_ORDERS_A_ROUND = 1024
_FD_BYTES = 4  # A descriptor in an ancillary message is an int of C.
_DESCRIPTOR = socket.CMSG_SPACE(_FD_BYTES)


class GuardChannel(Protocol):
    """Duplex channel: orders in, states out."""

    @property
    def lost(self) -> bool:
        """Return whether the sender of orders has disconnected."""
        ...

    def filenos(self) -> list[int]:
        """Return the file descriptors to wait for."""
        ...

    def orders(self) -> tuple[list[Order], list[str]]:
        """Return the orders that have arrived, and a reason for each datagram that is not one."""
        ...

    def send(self, state: GuardState) -> bool:
        """Send a state and return whether it was accepted."""
        ...


class DaemonChannel:
    """Channel over the daemon's socket."""

    def __init__(self, fd: int) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._socket.set_inheritable(False)
        self._life: int | None = None
        self._dead = select.poll()
        self._lost = False

    @property
    def lost(self) -> bool:
        """Return whether the daemon has disconnected or died."""
        return self._lost

    def filenos(self) -> list[int]:
        """Return the socket and the lifeline, which closes when the daemon dies."""
        life = [] if self._life is None else [self._life]
        return [self._socket.fileno(), *life]

    def orders(self) -> tuple[list[Order], list[str]]:
        """Return the orders that have arrived, and a reason for each datagram that is not one."""
        if self._life is not None and self._dead.poll(0):  # The lifeline carries no data.
            self._lost = True
        orders: list[Order] = []
        malformed: list[str] = []
        for _ in range(_MOST_ORDERS_A_ROUND):
            try:
                data, sent, flags, _ = self._socket.recvmsg(MAX_DATAGRAM, _DESCRIPTOR)
            except BlockingIOError:
                break
            except ConnectionResetError:
                data, sent, flags = b"", [], 0
            if sent:
                self._watch(sent)
                continue
            if not data:  # End of stream; no sender uses empty datagrams.
                self._lost = True
                break
            try:
                if flags & socket.MSG_TRUNC:
                    raise ValueError(f"A datagram is larger than {MAX_DATAGRAM} bytes.")
                orders.append(decode_order(data))
            except ValueError as error:
                malformed.append(str(error))
        return orders, malformed

    def send(self, state: GuardState) -> bool:
        """Send a state, or drop it if the socket is full.

        Returns:
            Whether it was sent.
        """
        try:
            self._socket.send(encode(state))
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            self._lost = True
            return False
        return True

    def _watch(self, sent: list[tuple[int, int, bytes]]) -> None:
        """Adopt the lifeline, whose end closes when the daemon dies."""
        kind = (socket.SOL_SOCKET, socket.SCM_RIGHTS)
        for level, number, data in sent:
            whole = len(data) - len(data) % _FD_BYTES
            for at in range(0, whole if (level, number) == kind else 0, _FD_BYTES):
                fd = int.from_bytes(data[at : at + _FD_BYTES], sys.byteorder)
                if self._life is None:
                    self._life = fd
                    self._dead.register(fd, select.POLLIN)
                else:  # The first is kept; the daemon sends one.
                    os.close(fd)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        if self._life is not None:
            os.close(self._life)
            self._life = None


class Heartbeat:
    """Heartbeat to the supervisor, which also detects the supervisor's death."""

    def __init__(self, fd: int, period_s: float) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._socket.set_inheritable(False)
        self._poll = select.poll()
        self._poll.register(fd, select.POLLIN)
        self._period_ns = round(period_s * 1e9)
        self._beaten_ns = 0
        self.lost = False
        """Return whether the supervisor has died."""

    def fileno(self) -> int:
        """Return the file descriptor to wait for."""
        return self._socket.fileno()

    def beat(self) -> None:
        """Send a beat if one is due, and return whether the supervisor is alive."""
        if self._poll.poll(0):  # The supervisor sends no data, so this is the end of the stream.
            self.lost = True
        now_ns = time.monotonic_ns()
        if self.lost or now_ns - self._beaten_ns < self._period_ns:
            return
        self._beaten_ns = now_ns
        try:
            # A full socket means that the supervisor does not read, which does not stop the robot.
            with contextlib.suppress(BlockingIOError):
                self._socket.send(b".")
        except (BrokenPipeError, ConnectionResetError):
            self.lost = True

    def leave(self) -> int:
        """Stop beating, but keep the socket open until the process exits.

        The supervisor takes its end as the death of the process: closed too early, it would kill a
        process that is about to exit by itself.

        Returns:
            The descriptor.
        """
        return self._socket.detach()
