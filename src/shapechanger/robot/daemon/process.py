"""Process of the daemon: assembles its parts, and ends with the guard or the supervisor."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import ctypes
import json
import logging
import os
import select
import signal
import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.errors import ShapechangerError
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.daemon.camera import FrameChecks, FrameReader
from shapechanger.robot.daemon.credentials import check_exposure, read_key, server_tls
from shapechanger.robot.daemon.hub import SessionHub, Timekeeper
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.server import Server
from shapechanger.robot.daemon.session import Authenticator
from shapechanger.robot.discovery import announce, withdraw
from shapechanger.robot.guard.channel import (
    MAX_DATAGRAM,
    GuardState,
    Heartbeat,
    Order,
    decode_state,
    encode,
)
from shapechanger.robot.guard.running import log_to_stderr, read_plan_fd, run_early
from shapechanger.robot.hardware import Clock, connect
from shapechanger.robot.link.address import Address, is_loopback
from shapechanger.robot.link.authentication import fingerprint_short

_log = logging.getLogger("shapechanger.robot.daemon")

_HEARTBEAT_S: Final = 0.05  # The supervisor expects one each 100 ms.
_RECORDER_S: Final = 1.0  # Period of the recorder's reports.

LIFELINE: Final = b"life"
"""The message that carries the lifeline's descriptor."""

# Orders that must arrive in any case. One of each kind is enough, because repeats mean the same.
_URGENT: Final = ("end", "emergency", "disarm", "halt")
_CLONE_FILES: Final = 0x400  # linux/sched.h
_READY_S: Final = 1.0


class GuardLink:
    """Non-blocking socket to the guard: sends orders and receives states.

    A guard that does not read fills the socket. A command is then dropped, because it would be
    too old when the guard reads again, and a stop waits until there is room.
    """

    def __init__(
        self, fd: int, on_state: Callable[[GuardState], None], on_lost: Callable[[], None]
    ) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._on_state = on_state
        self._on_lost = on_lost
        self._lost = False
        self._stuck = False
        self._waiting: dict[str, Order] = {}
        self._loop: asyncio.AbstractEventLoop | None = None

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read states in an event loop from now on."""
        self._loop = loop
        loop.add_reader(self._socket, self.drain)

    def send(self, order: Order) -> None:
        """Send an order."""
        if self._lost:
            return
        if not self._waiting and self._try(order):
            self._stuck = False
            return
        if not self._stuck:
            self._stuck = True
            _log.warning("The guard does not read: commands are dropped, and stops wait.")
        if order.kind in _URGENT:
            self._waiting.setdefault(order.kind, order)
            if self._loop is not None:
                self._loop.add_writer(self._socket, self._send_waiting)

    def drain(self) -> None:
        """Read all states that have arrived."""
        while not self._lost:
            try:
                data = self._socket.recv(MAX_DATAGRAM)
            except BlockingIOError:
                return
            except ConnectionResetError:
                data = b""
            if not data:
                self._lose()
                return
            try:
                state = decode_state(data)
            except ValueError as error:
                _log.warning("A message of the guard is not a state: %s", error)
                continue
            self._on_state(state)

    def close(self) -> None:
        """Close the socket, which makes the guard stop the robot."""
        self._lost = True  # Nothing is sent from now on.
        if self._socket.fileno() >= 0:
            self._detach()
        self._socket.close()

    def _try(self, order: Order) -> bool:
        try:
            self._socket.send(encode(order))
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            self._lose()
        return True

    def _send_waiting(self) -> None:
        for kind, order in list(self._waiting.items()):
            if not self._try(order):
                return
            self._waiting.pop(kind, None)
        if self._loop is not None and not self._lost:
            self._loop.remove_writer(self._socket)

    def _lose(self) -> None:
        if self._lost:
            return
        self._lost = True
        self._waiting.clear()
        self._detach()
        self._on_lost()

    def _detach(self) -> None:
        if self._loop is not None:
            self._loop.remove_reader(self._socket)
            self._loop.remove_writer(self._socket)


class Daemon:
    """The daemon of a robot, from start to end; make it in the event loop that runs it."""

    def __init__(
        self,
        plan: DaemonPlan,
        clock: Clock,
        guard_fd: int,
        heartbeat_fd: int | None = None,
        ready_fd: int | None = None,
    ) -> None:
        self._plan = plan
        self._clock = clock
        self._ended = asyncio.Event()
        self._guard_reported = asyncio.Event()  # The guard has reported, or never will.
        self._why = ""
        self._guard = GuardLink(
            guard_fd,
            on_state=self._on_state,
            on_lost=lambda: self.end("The guard is gone."),
        )
        self._loop = asyncio.get_running_loop()
        self._hub = SessionHub(plan, clock.now_ns, self._guard.send, self._call)
        self._heartbeat_fd = heartbeat_fd
        self._ready_fd = ready_fd

    async def run(self) -> str:
        """Serve until `end` is called.

        Returns:
            The reason why it ended; "" if it was asked to.
        """
        plan = self._plan
        check_exposure(plan)
        key = read_key(Path(plan.key_file)) if plan.key_file else b""
        tls, fingerprint = None, b""
        if plan.certificate:
            tls, fingerprint = server_tls(Path(plan.certificate), Path(plan.private_key))
        time = Timekeeper(self._clock, self._hub, self._guard.drain)
        server = Server(self._hub, time, Authenticator(key, fingerprint), tls)
        tasks = [
            asyncio.create_task(work) for work in (self._heartbeats(), self._report_recorder())
        ]
        self._guard.attach(self._loop)
        camera = None if plan.camera is None else self._camera(plan.camera)
        announcement = None
        try:
            # The first client must not see a robot of unknown state. Where time moves in steps,
            # the guard reports nothing before the first step.
            if not time.in_steps:
                await self._guard_reported.wait()
            if not self._ended.is_set():
                port = await server.start()
                self._hub.policies.serve(port, fingerprint)
                self._report_ready(port, fingerprint)
                if plan.discovery and is_loopback(plan.host):
                    words = "%s is not announced: only this machine reaches %s."
                    _log.info(words, plan.card.robot, plan.host)
                elif plan.discovery:
                    announcement = await announce(plan.card, plan.host, port, fingerprint)
            await self._ended.wait()
        finally:
            # First of all the guard stops the robot, when it sees this socket close.
            self._guard.close()
            self._hub.recorder.end()
            await self._hub.policies.close()
            if camera is not None:
                await asyncio.to_thread(camera.close)
            await server.close()
            if announcement is not None:
                await withdraw(announcement)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await asyncio.to_thread(self._hub.recorder.close)
            await asyncio.to_thread(self._hub.library.close)
        return self._why

    def end(self, why: str = "") -> None:
        """Stop serving; the first reason counts."""
        self._why = self._why or why
        self._ended.set()
        self._guard_reported.set()

    def _on_state(self, state: GuardState) -> None:
        self._hub.on_state(state)
        self._guard_reported.set()

    async def _heartbeats(self) -> None:
        if self._heartbeat_fd is None:
            return
        heartbeat = Heartbeat(self._heartbeat_fd, 0.0)
        while not heartbeat.lost:
            heartbeat.beat()
            await asyncio.sleep(_HEARTBEAT_S)
        self.end("The supervisor is gone.")

    async def _report_recorder(self) -> None:
        while True:
            await asyncio.sleep(_RECORDER_S)
            self._hub.recorder.tick()

    def _call(self, work: Callable[[], None]) -> None:
        """Run a function in the event loop's thread, from any other thread."""
        with contextlib.suppress(RuntimeError):  # The loop ended before the thread.
            self._loop.call_soon_threadsafe(work)

    def _camera(self, plan: CameraPlan) -> FrameReader:
        """Start to read the camera. While the loop is busy, only the newest frame is kept."""
        newest: deque[Frame] = deque(maxlen=1)

        def collect() -> None:
            if newest:
                self._hub.on_frame(newest.pop())

        def deliver(frame: Frame) -> None:
            newest.append(frame)
            self._call(collect)

        def report(text: str) -> None:
            _log.warning("Camera: %s", text)
            self._call(lambda: self._hub.event("camera", text))

        now_ns = self._clock.now_ns if self._plan.card.clock == "real" else None
        reader = FrameReader(plan, FrameChecks(now_ns), deliver, report)
        reader.start()
        return reader

    def _report_ready(self, port: int, fingerprint: bytes) -> None:
        """Report the port in the log, and to the process that started this one."""
        plan = self._plan
        secured = f"fingerprint {fingerprint_short(fingerprint)}" if fingerprint else "without TLS"
        _log.info("%s listens at %s, %s.", plan.card.robot, Address(plan.host, port), secured)
        ready = {"port": port, "fingerprint": fingerprint.hex()}
        line = json.dumps(ready).encode() + b"\n"
        try:
            if self._ready_fd is not None:
                os.write(self._ready_fd, line)
                os.close(self._ready_fd)
            if plan.ready_file:
                partial = Path(f"{plan.ready_file}.partial")
                partial.write_bytes(line)
                partial.replace(plan.ready_file)
        except OSError as error:
            _log.warning("The port cannot be reported, but the robot is served: %s", error)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the daemon, and return the exit status."""
    parser = argparse.ArgumentParser(prog="shapechanger.robot.daemon", description=__doc__)
    parser.add_argument("--plan-fd", type=int, required=True)
    parser.add_argument("--guard-fd", type=int, required=True)
    parser.add_argument("--heartbeat-fd", type=int)
    parser.add_argument("--ready-fd", type=int)
    options = parser.parse_args(arguments)
    serve_plan = read_plan_fd(options.plan_fd)
    os.close(options.plan_fd)
    send_lifeline(options.guard_fd)
    log_to_stderr("daemon", "")
    logging.getLogger().setLevel(logging.WARNING)
    logging.getLogger("shapechanger").setLevel(logging.INFO)
    try:
        plan = msgspec.convert(serve_plan.daemon, DaemonPlan)
        source, argument = serve_plan.hardware
        clock = connect(source, argument).clock
        run_early()

        async def run() -> str:
            daemon = Daemon(plan, clock, options.guard_fd, options.heartbeat_fd, options.ready_fd)
            for number in (signal.SIGTERM, signal.SIGINT):
                asyncio.get_running_loop().add_signal_handler(number, daemon.end)
            return await daemon.run()

        why = asyncio.run(run())
    except ShapechangerError as error:
        why = str(error)
    if why:
        _log.error("%s", why)
    return 1 if why else 0


def send_lifeline(guard_fd: int) -> bool:
    """Send the guard a descriptor that closes as soon as this process dies.

    When a process is killed, the kernel frees its memory before it closes its files. For the
    daemon's 50 MB that takes 6 ms, in which the guard would wait for the end of the socket. The
    files of a thread that shares the memory but not the files close at once. Such a thread holds
    one end of a pipe, and the guard the other. `python -m benchmarks.run robot-faults` measures
    0.5 ms instead of 7 ms.

    Call this while few files are open and no other thread runs.

    Returns:
        False where the system cannot do it; the guard then waits for the end of the socket.
    """
    ours, theirs = os.pipe()
    # The new thread gets a copy of each file; this one is then closed here.
    apart = threading.Event()
    failed: list[bool] = []
    threading.Thread(
        target=_hold, args=(theirs, apart, failed), name="shapechanger-life", daemon=True
    ).start()
    held = apart.wait(_READY_S) and not failed
    os.close(theirs)
    if held:
        # If the guard is gone already, the reader of the socket notices.
        with (
            socket.socket(fileno=os.dup(guard_fd)) as guard,
            contextlib.suppress(BrokenPipeError, ConnectionResetError),
        ):
            socket.send_fds(guard, [LIFELINE], [ours])
    os.close(ours)
    return held


def _hold(fd: int, apart: threading.Event, failed: list[bool]) -> None:
    """Hold a file that no other thread has, until the process or the other end is gone."""
    unshare = getattr(ctypes.CDLL(None), "unshare", None)  # On Linux only.
    if unshare is None or unshare(_CLONE_FILES) != 0:
        failed.append(True)
        apart.set()
        return
    os.closerange(0, fd)
    os.closerange(fd + 1, os.sysconf("SC_OPEN_MAX"))
    ended = select.poll()
    ended.register(fd, 0)  # Only the error condition, that the other end is closed.
    apart.set()
    ended.poll()


if __name__ == "__main__":
    raise SystemExit(main())
