"""Sockets between the guard, the daemon and the supervisor, and the messages on them.

Guard and daemon exchange one JSON object per datagram. They run on one machine, connected by a pair
of `SOCK_SEQPACKET` sockets, which preserve message boundaries, and share one monotonic clock.
"""

from __future__ import annotations

import os
import select
import socket
import time
from typing import Final, Literal

import msgspec

MAX_DATAGRAM: Final = 16 * 1024
"""Size of the largest datagram, bytes."""

# Most datagrams that are read in one round, so that it ends although the daemon sends as fast as
# the guard reads.
_MOST_ORDERS_A_ROUND: Final = 1024


class Order(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request from the daemon to the guard, checked strictly when it is decoded.

    Attributes:
        kind: "command" sets the actions; "halt" cancels the newest command and leaves the robot
            armed; "arm" lets commands move the robot; "disarm" stops it until it is armed;
            "emergency" stops it until a person arms it; "end" ends the guard.
        session: Number of the sender's lease of control; a command is refused if one of a newer
            lease arrived before it.
        seq: Sequence number of a command, which increases within a session.
        issued_ns: Time at which the daemon received the request, ns. Required for "command" and
            "arm", which are refused if they are old.
        ttl_ms: Longest time for which a command acts, counted from `issued_ns`, ms.
        frame_ns: For "command": time of the newest image, ns; None without a camera or an image.
        values: One finite number for each action.
        emergency: For "arm": number of emergency stops that the sender has seen; a newer stop stays
            in force.
        reason: For "disarm" and "emergency": the reason, shown to people.
        person: For "arm": whether a person arms; only persons end an emergency stop.
    """

    kind: Literal["command", "halt", "arm", "disarm", "emergency", "end"]
    session: int = 0
    seq: int = 0
    issued_ns: int = 0
    ttl_ms: int = 0
    frame_ns: int | None = None
    values: tuple[float, ...] = ()
    emergency: int = 0
    reason: str = ""
    person: bool = False


class GuardState(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Report from the guard: applied actions and sensor readings.

    Attributes:
        at_ns: Time of the report, ns.
        armed: Whether the robot is armed; otherwise commands move nothing.
        emergency: Whether an emergency stop is in force.
        emergencies: Number of emergency stops since the guard started; see `Order.emergency`.
        stop_reason: Why no command is applied, or what changes it beyond slew and levels, or "".
        applied: Applied value of each action.
        applied_session: `Order.session` of the applied command; 0 without one.
        applied_seq: Sequence number of the applied command; None without one, such as in a stop.
        applied_ns: Time at which the outputs first had the applied command, ns; None without one.
        refused: Why the last refused order was refused; empty without a refusal since the last
            state that was sent.
        refused_seq: Sequence number of the refused command; None for other orders.
        outputs: Value of each output, -1 to 1.
        quantities: Sensor readings in SI units, keyed by name: "speed" m/s signed, "distance" m,
            "bump" 0 or 1, "battery" V, "yaw_rate" rad/s, "acceleration_x" m/s2, "temperature" C,
            "stall" 0 or 1, "collision" 0 or 1; without those neither measured nor estimated.
        sources: Source of each quantity: name of a sensor, or "estimated".
        bumps: Number of bumps since the guard started.
    """

    at_ns: int
    armed: bool
    emergency: bool
    emergencies: int
    stop_reason: str
    applied: tuple[float, ...]
    applied_session: int
    applied_seq: int | None
    applied_ns: int | None
    refused: str
    refused_seq: int | None
    outputs: dict[str, float]
    quantities: dict[str, float]
    sources: dict[str, str]
    bumps: int


NO_STATE: Final = GuardState(
    at_ns=0,
    armed=False,
    emergency=False,
    emergencies=0,
    stop_reason="The guard has not reported yet.",
    applied=(),
    applied_session=0,
    applied_seq=None,
    applied_ns=None,
    refused="",
    refused_seq=None,
    outputs={},
    quantities={},
    sources={},
    bumps=0,
)
"""State until the guard's first report."""

encode: Final = msgspec.json.encode
decode_order: Final = msgspec.json.Decoder(Order).decode
decode_state: Final = msgspec.json.Decoder(GuardState).decode


class _Socket:
    """End of a socket to another process of the robot, which never blocks.

    Attributes:
        lost: Whether the other process has disconnected or died.
    """

    def __init__(self, fd: int) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._socket.set_inheritable(False)
        self._dead = select.poll()  # Descriptors that are readable once the other process is dead.
        self.lost = False

    def _look(self) -> None:
        """Update `lost`."""
        if self._dead.poll(0):
            self.lost = True

    def _send(self, data: bytes) -> bool:
        """Send data; return False if the socket is full or the other process is lost."""
        try:
            self._socket.send(data)
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            self.lost = True
            return False
        return True


class DaemonChannel(_Socket):
    """The guard's end of the channel to the daemon."""

    def __init__(self, fd: int) -> None:
        super().__init__(fd)
        self._life: list[int] = []

    def filenos(self) -> list[int]:
        """Return the descriptors of the socket and, once it has arrived, of the lifeline."""
        return [self._socket.fileno(), *self._life]

    def orders(self) -> tuple[list[Order], list[str]]:
        """Return the orders that have arrived, and the error of each invalid datagram."""
        self._look()
        orders: list[Order] = []
        malformed: list[str] = []
        for _ in range(_MOST_ORDERS_A_ROUND):
            try:
                data, fds, flags, _ = socket.recv_fds(self._socket, MAX_DATAGRAM, 1)
            except BlockingIOError:
                break
            except ConnectionResetError:
                data, fds, flags = b"", [], 0
            if fds:
                self._watch(fds[0])
                continue
            if not data:  # End of stream; no sender uses empty datagrams.
                self.lost = True
                break
            if flags & socket.MSG_TRUNC:
                malformed.append(f"A datagram is larger than {MAX_DATAGRAM} bytes.")
                continue
            try:
                orders.append(decode_order(data))
            except ValueError as error:
                malformed.append(f"Invalid order: {error}.")
        return orders, malformed

    def send(self, state: GuardState) -> bool:
        """Send a state; return False if the socket is full or the daemon is lost."""
        return self._send(encode(state))

    def _watch(self, fd: int) -> None:
        """Adopt the lifeline: a pipe without data whose other end closes when the daemon dies."""
        if self._life:  # The daemon sends only one lifeline.
            os.close(fd)
            return
        self._life = [fd]
        self._dead.register(fd, select.POLLIN)

    def close(self) -> None:
        """Close the socket and the lifeline."""
        self._socket.close()
        while self._life:
            os.close(self._life.pop())


class Heartbeat(_Socket):
    """Heartbeat to the supervisor, which also detects the supervisor's death."""

    def __init__(self, fd: int, period_s: float) -> None:
        super().__init__(fd)
        self._dead.register(fd, select.POLLIN)  # The supervisor sends no data.
        self._period_ns = round(period_s * 1e9)
        self._beaten_ns = 0

    def fileno(self) -> int:
        """Return the file descriptor to wait for."""
        return self._socket.fileno()

    def beat(self) -> None:
        """Send a beat if one is due, and check whether the supervisor is alive."""
        self._look()
        now_ns = time.monotonic_ns()
        if not self.lost and now_ns - self._beaten_ns >= self._period_ns:
            self._beaten_ns = now_ns
            # If the supervisor does not read, the socket is full and the beat is lost.
            self._send(b".")

    def leave(self) -> int:
        """Stop beating, but keep the socket open until the process exits; return its descriptor.

        The supervisor treats the end of the stream as the death of the process. If the socket were
        closed too early, the supervisor would kill a process that is about to exit by itself.
        """
        return self._socket.detach()
