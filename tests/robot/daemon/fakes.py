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
from shapechanger.robot.hardware import Clock
from tests.robot.daemon.plans import guard_state


class FakeGuard:
    """The guard's end of the socket, which applies orders and replies with its state."""

    def __init__(self, now_ns: Callable[[], int]) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        self.daemon_fd = theirs.detach()
        self.orders: list[Order] = []
        self.state: GuardState = guard_state()
        self._now_ns = now_ns
        self._socket = ours

    def attach(self) -> None:
        """Answer orders as they arrive, as on a real clock."""
        asyncio.get_running_loop().add_reader(self._socket, self.tick)

    def close(self) -> None:
        if self._socket.fileno() >= 0:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()

    def tick(self) -> None:
        """Apply all orders, and send the state."""
        while True:
            try:
                data = self._socket.recv(MAX_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionResetError:  # The daemon closed, and had not read everything.
                data = b""
            if not data:
                asyncio.get_running_loop().remove_reader(self._socket)
                return
            order = decode_order(data)
            self.orders.append(order)
            self._apply(order)
        self.send()

    def send(self, **changes: Any) -> None:
        self.state = msgspec.structs.replace(self.state, at_ns=self._now_ns(), **changes)
        self._socket.send(encode(self.state))
        self.state = msgspec.structs.replace(self.state, refused="", refused_seq=None)

    def kinds(self) -> list[str]:
        return [order.kind for order in self.orders]

    def _apply(self, order: Order) -> None:
        changes: dict[str, Any] = {}
        rest = {"applied": (0.0, 0.0), "applied_seq": None}
        may_arm = order.person or not self.state.emergency
        if order.kind == "arm" and may_arm:
            changes = {"armed": True, "emergency": False, "stop_reason": ""}
        elif order.kind == "arm":
            changes = {"refused": "Only a person ends an emergency stop."}
        elif order.kind == "halt":
            changes = rest
        elif order.kind == "disarm":
            changes = {"armed": False, "stop_reason": order.reason, **rest}
        elif order.kind == "emergency":
            count = self.state.emergencies + 1
            changes = {"armed": False, "emergency": True, "emergencies": count, **rest}
        elif order.kind == "command" and self.state.armed:
            changes = {
                "applied": order.values,
                "applied_session": order.session,
                "applied_seq": order.seq,
                "applied_ns": self._now_ns(),
            }
        elif order.kind == "command":
            changes = {"refused": "Not armed.", "refused_seq": order.seq}
        self.state = msgspec.structs.replace(self.state, **changes)


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
        """Return the next frame."""
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
    """A clock that moves in steps, as that of a twin does."""

    def __init__(self) -> None:
        self.ns = 1_000_000_000
        self.steps: list[float] = []
        self.tick: Callable[[], None] = lambda: None
        self.captured_ns: int | None = None

    def now_ns(self) -> int:
        """Return the time, ns."""
        return self.ns

    async def sleep(self, seconds: float) -> int | None:
        """Advance the time, and let the guard tick."""
        await asyncio.sleep(0)
        self.steps.append(seconds)
        self.ns += round(seconds * 1e9)
        self.tick()
        return self.captured_ns
