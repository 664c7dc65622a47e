"""Fake guard, camera and clock for tests of the daemon."""

from __future__ import annotations

import asyncio
import queue
import socket
from collections.abc import Callable
from typing import Any

import msgspec

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame
from shapechanger.robot.guard.channel import MAX_DATAGRAM, GuardState, Order, decode_order, encode
from shapechanger.robot.guard.rules import Rules
from shapechanger.robot.hardware import Clock
from tests.robot.daemon.plans import guard_state
from tests.robot.guard.plans import quick_car


class FakeGuard:
    """The guard's end of the socket: it applies orders by the rules, without any deadline."""

    def __init__(self, now_ns: Callable[[], int]) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        self.daemon_fd = theirs.detach()
        self.orders: list[Order] = []
        self.state: GuardState = guard_state()
        self._now_ns = now_ns
        self._socket = ours
        self._rules = Rules(quick_car(), now_ns())

    def attach(self) -> None:
        """Handle each order when it arrives, as a guard does in real time."""
        asyncio.get_running_loop().add_reader(self._socket, self.tick)

    def close(self) -> None:
        if self._socket.fileno() >= 0:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()

    def tick(self) -> None:
        while True:
            try:
                data = self._socket.recv(MAX_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionResetError:  # The daemon closed the socket with unread states in it.
                data = b""
            if not data:
                asyncio.get_running_loop().remove_reader(self._socket)
                return
            self._apply(decode_order(data))
        self.send()

    def send(self, **changes: Any) -> None:
        self.state = msgspec.structs.replace(self.state, at_ns=self._now_ns(), **changes)
        self._socket.send(encode(self.state))
        self.state = msgspec.structs.replace(self.state, refused="", refused_seq=None)

    def kinds(self) -> list[str]:
        return [order.kind for order in self.orders]

    def _apply(self, order: Order) -> None:
        self.orders.append(order)
        rules, now_ns = self._rules, self._now_ns()
        refused = rules.offer(order, now_ns)
        decision = rules.tick(now_ns)
        self.state = msgspec.structs.replace(
            self.state,
            armed=rules.armed,
            emergency=rules.emergency,
            emergencies=rules.emergencies,
            stop_reason=decision.stop_reason,
            applied=decision.actions,
            applied_session=decision.session,
            applied_seq=decision.seq,
            applied_ns=None if decision.seq is None else now_ns,
            refused=refused,
            refused_seq=order.seq if refused and order.kind == "command" else None,
        )


class FakeCamera(Camera):
    """Camera that returns the frames of a test."""

    def __init__(self) -> None:
        super().__init__(CameraPlan("fake"))
        self.opened = 0
        self._frames: queue.Queue[Frame | str | int] = queue.Queue()

    def open(self, plan: CameraPlan) -> FakeCamera:
        self.opened += 1
        return self

    def put(self, frame: Frame) -> None:
        self._frames.put(frame)

    def fail(self, why: str) -> None:
        self._frames.put(why)

    def read(self) -> Frame:
        while True:
            frame = self._frames.get()
            if isinstance(frame, Frame):
                return frame
            if isinstance(frame, str):
                raise RobotError(frame)
            if frame == self.opened:
                raise RobotError("The camera is closed.")

    def close(self) -> None:
        self._frames.put(self.opened)


class SteppedClock(Clock):
    """A clock that moves in steps, like the clock of a twin."""

    def __init__(self) -> None:
        self.ns = 1_000_000_000
        self.steps: list[float] = []
        self.tick: Callable[[], None] = lambda: None
        self.captured_ns: int | None = None

    def now_ns(self) -> int:
        return self.ns

    async def sleep(self, seconds: float) -> int | None:
        await asyncio.sleep(0)
        self.steps.append(seconds)
        self.ns += round(seconds * 1e9)
        self.tick()
        return self.captured_ns
