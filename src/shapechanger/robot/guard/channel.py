"""The guard's end of the sockets to daemon and supervisor; nothing here ever blocks."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import time
from typing import Protocol

from shapechanger.robot.guard.messages import MAX_DATAGRAM, GuardState, Order, decode_order, encode

__all__ = ["DaemonChannel", "GuardChannel", "Heartbeat"]

# A daemon cannot send more between two rounds than its socket holds; this bounds a round all the
# same, should it send as fast as it is read.
_MOST_ORDERS_A_ROUND = 1024
_FD_BYTES = 4  # A descriptor in an ancillary message is an int of C.
_DESCRIPTOR = socket.CMSG_SPACE(_FD_BYTES)


class GuardChannel(Protocol):
    """Orders in, states out."""

    @property
    def lost(self) -> bool:
        """Whether whoever gives the orders is gone."""
        ...

    def filenos(self) -> list[int]:
        """The descriptors to wait for."""
        ...

    def orders(self) -> tuple[list[Order], list[str]]:
        """All orders that have arrived, and why others were none, in words."""
        ...

    def send(self, state: GuardState) -> bool:
        """Hand over a state; whether it was taken."""
        ...


class DaemonChannel:
    """Orders from the daemon's socket, and states into it.

    Args:
        fd: Descriptor of the socket; this object owns it.
    """

    def __init__(self, fd: int) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._socket.set_inheritable(False)
        self._life: int | None = None
        self._dead = select.poll()
        self._lost = False

    @property
    def lost(self) -> bool:
        """Whether the daemon is gone."""
        return self._lost

    def filenos(self) -> list[int]:
        """The descriptors to wait for: the socket, and one that ends when the daemon dies."""
        life = [] if self._life is None else [self._life]
        return [self._socket.fileno(), *life]

    def orders(self) -> tuple[list[Order], list[str]]:
        """All orders that have arrived, and why others were none, in words."""
        if self._life is not None and self._dead.poll(0):  # It never says anything.
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
            if not data:  # The end, or an empty datagram, which nobody sends.
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
        """Send a state; one for which there is no room is dropped.

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
        """Take the descriptor that ends when the daemon dies; see `daemon.life`."""
        kind = (socket.SOL_SOCKET, socket.SCM_RIGHTS)
        for level, number, data in sent:
            whole = len(data) - len(data) % _FD_BYTES
            for at in range(0, whole if (level, number) == kind else 0, _FD_BYTES):
                fd = int.from_bytes(data[at : at + _FD_BYTES], sys.byteorder)
                if self._life is None:
                    self._life = fd
                    self._dead.register(fd, select.POLLIN)
                else:  # One is enough, and nobody sends two.
                    os.close(fd)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        if self._life is not None:
            os.close(self._life)
            self._life = None


class Heartbeat:
    """Shows the supervisor that this process lives, and notices when the supervisor does not.

    Args:
        fd: Descriptor of the socket; this object owns it.
        period_s: Real seconds between two beats.
    """

    def __init__(self, fd: int, period_s: float) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._socket.set_inheritable(False)
        self._poll = select.poll()
        self._poll.register(fd, select.POLLIN)
        self._period_ns = round(period_s * 1e9)
        self._beaten_ns = 0
        self.lost = False
        """Whether the supervisor is gone."""

    def fileno(self) -> int:
        """The descriptor, to wait for."""
        return self._socket.fileno()

    def beat(self) -> None:
        """Send a beat if one is due, and look whether the supervisor is there."""
        if self._poll.poll(0):  # It never says anything; so this is the end.
            self.lost = True
        now_ns = time.monotonic_ns()
        if self.lost or now_ns - self._beaten_ns < self._period_ns:
            return
        self._beaten_ns = now_ns
        try:
            # A supervisor that does not read is no reason to stop; its socket is then full.
            with contextlib.suppress(BlockingIOError):
                self._socket.send(b".")
        except (BrokenPipeError, ConnectionResetError):
            self.lost = True

    def leave(self) -> int:
        """Beat no more, and leave the socket open until the process is gone.

        Its end tells the supervisor that the process is gone; told too early, it would kill one
        that is about to end by itself.

        Returns:
            The descriptor.
        """
        return self._socket.detach()
