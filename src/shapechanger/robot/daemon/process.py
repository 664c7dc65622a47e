"""Process of the daemon: assembles its parts, and ends with the guard or the supervisor."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import ctypes
import itertools
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
from shapechanger.robot.daemon import credentials
from shapechanger.robot.daemon.camera import FrameChecks, FrameReader
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.server import Server
from shapechanger.robot.discovery import announce, withdraw
from shapechanger.robot.guard import channel
from shapechanger.robot.guard.channel import GuardState, Heartbeat, Order
from shapechanger.robot.guard.running import log_to_stderr, read_plan_fd, run_early
from shapechanger.robot.hardware import Clock, connect
from shapechanger.robot.link.address import Address, is_loopback
from shapechanger.robot.link.authentication import fingerprint_short, parse_key

_log = logging.getLogger("shapechanger.robot.daemon")

_HEARTBEAT_S: Final = 0.05  # The supervisor kills a daemon that sends none for 2 s.
_BEATS_A_REPORT: Final = 20  # The recorder reports once a second.

LIFELINE: Final = b"life"
"""The message that carries the lifeline's descriptor."""

# Orders that must arrive in any case. Repeats have no further effect, so one of each kind is kept.
_URGENT: Final = ("end", "emergency", "disarm", "halt")
_CLONE_FILES: Final = 0x400  # linux/sched.h
_READY_S: Final = 1.0


class GuardLink:
    """Sends orders to the guard and receives its states, on a non-blocking socket.

    A guard that does not read fills the socket. A command, or an order to arm, is then dropped,
    because it would be too old when the guard reads again, and a stop waits until there is room.
    """

    def __init__(
        self, fd: int, on_state: Callable[[GuardState], None], on_lost: Callable[[], None]
    ) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._on_state = on_state
        self._on_lost = on_lost
        self._stuck = False
        self._waiting: dict[str, Order] = {}
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._socket, self.drain)

    @property
    def _is_open(self) -> bool:
        return self._socket.fileno() >= 0

    def send(self, order: Order) -> None:
        """Send an order."""
        if not self._is_open:
            return
        if not self._waiting and self._try(order):
            self._stuck = False
            return
        if not self._stuck:
            self._stuck = True
            _log.warning("The guard does not read: commands are dropped, and stops wait.")
        if order.kind in _URGENT:
            self._waiting.setdefault(order.kind, order)
            self._loop.add_writer(self._socket, self._send_waiting)

    def drain(self) -> None:
        """Read all states that have arrived."""
        while self._is_open:
            try:
                data = self._socket.recv(channel.MAX_DATAGRAM)
            except BlockingIOError:
                return
            except ConnectionResetError:
                data = b""
            if not data:
                self._lose()
                return
            try:
                state = channel.decode_state(data)
            except ValueError as error:
                _log.warning("A message of the guard is not a state: %s", error)
            else:
                self._on_state(state)

    def close(self) -> None:
        """Close the socket, which makes the guard stop the robot."""
        if self._is_open:
            self._loop.remove_reader(self._socket)
            self._loop.remove_writer(self._socket)
            self._socket.close()

    def _try(self, order: Order) -> bool:
        try:
            self._socket.send(channel.encode(order))
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            self._lose()
        return True

    def _send_waiting(self) -> None:
        while self._is_open and self._waiting:
            kind, order = next(iter(self._waiting.items()))
            if not self._try(order):
                return
            del self._waiting[kind]
        if self._is_open:
            self._loop.remove_writer(self._socket)

    def _lose(self) -> None:
        self.close()
        self._on_lost()


class Daemon:
    """The daemon of a robot, from start to end; make it in the event loop that runs it."""

    def __init__(
        self, plan: DaemonPlan, clock: Clock, guard_fd: int, heartbeat_fd: int | None = None
    ) -> None:
        self._ended = asyncio.Event()
        self._guard_reported = asyncio.Event()  # The guard has reported, or never will.
        self._why = ""
        self._loop = asyncio.get_running_loop()
        self._guard = GuardLink(guard_fd, self._on_state, lambda: self.end("The guard has ended."))
        self._hub = SessionHub(plan, clock, self._guard.send, self._guard.drain, self._call)
        self._heartbeat_fd = heartbeat_fd

    async def run(self) -> str:
        """Serve until `end`; return why it ended unexpectedly, or "" after a request to end."""
        hub, plan = self._hub, self._hub.plan
        credentials.check_exposure(plan)
        key, tls, fingerprint = "", None, b""
        if plan.credentials:
            made = credentials.load_credentials(Path(plan.credentials))
            key = made.key
            if not plan.insecure:
                tls, fingerprint = made.tls(), made.fingerprint
        authenticator = credentials.Authenticator(parse_key(key) if key else b"", fingerprint)
        server = Server(hub, authenticator, tls)
        beating = asyncio.create_task(self._beat())
        camera = None if plan.camera is None else self._camera(plan.camera)
        announcement = None
        try:
            # The first client must not see a robot of unknown state. If time moves in steps, the
            # guard reports no state before the first step.
            if not hub.in_steps:
                await self._guard_reported.wait()
            if not self._ended.is_set():
                port = await server.start()
                hub.policies.serve(port, key, fingerprint)
                self._report_ready(port, fingerprint)
                if plan.discovery and is_loopback(plan.host):
                    text = "%s is not announced: only this machine reaches %s."
                    _log.info(text, plan.card.robot, plan.host)
                elif plan.discovery:
                    announcement = await announce(plan.card, plan.host, port, fingerprint)
            await self._ended.wait()
        finally:
            # The socket to the guard is closed first, because the guard then stops the robot.
            self._guard.close()
            if hub.recorder.on:
                hub.recorder.end()
            await hub.policies.close()
            if camera is not None:
                await asyncio.to_thread(camera.close)
            await server.close()
            if announcement is not None:
                await withdraw(announcement)
            beating.cancel()
            await asyncio.gather(beating, return_exceptions=True)
            await asyncio.to_thread(hub.recorder.close)
            await asyncio.to_thread(hub.library.close)
        return self._why

    def end(self, why: str = "") -> None:
        """Stop serving; the first reason counts."""
        self._why = self._why or why
        self._ended.set()
        self._guard_reported.set()

    def _on_state(self, state: GuardState) -> None:
        self._hub.on_state(state)
        self._guard_reported.set()

    async def _beat(self) -> None:
        """Send heartbeats, and report the recorder's state while it records."""
        heartbeat = None if self._heartbeat_fd is None else Heartbeat(self._heartbeat_fd, 0.0)
        for beats in itertools.count():
            if heartbeat is not None:
                heartbeat.beat()
                if heartbeat.lost:
                    self.end("The supervisor has ended.")
                    return
            if beats % _BEATS_A_REPORT == 0:
                self._hub.recorder.tick()
            await asyncio.sleep(_HEARTBEAT_S)

    def _call(self, work: Callable[[], None]) -> None:
        """Run a function in the event loop's thread, from any other thread."""
        with contextlib.suppress(RuntimeError):  # The loop ended before the thread.
            self._loop.call_soon_threadsafe(work)

    def _camera(self, plan: CameraPlan) -> FrameReader:
        """Read the camera. While the loop is busy, only the newest frame is kept."""
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

        checks = FrameChecks(None if self._hub.in_steps else self._hub.now_ns)
        return FrameReader(plan, checks, deliver, report)

    def _report_ready(self, port: int, fingerprint: bytes) -> None:
        plan = self._hub.plan
        secured = f"fingerprint {fingerprint_short(fingerprint)}" if fingerprint else "without TLS"
        _log.info("%s listens at %s, %s.", plan.card.robot, Address(plan.host, port), secured)
        if not plan.ready_file:
            return
        ready = {"port": port, "fingerprint": fingerprint.hex()}
        try:
            partial = Path(f"{plan.ready_file}.partial")
            partial.write_text(json.dumps(ready) + "\n")
            partial.replace(plan.ready_file)
        except OSError as error:
            _log.warning("The port cannot be reported, but the robot is served: %s", error)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the daemon, and return the exit status."""
    parser = argparse.ArgumentParser(prog="shapechanger.robot.daemon", description=__doc__)
    parser.add_argument("--plan-fd", type=int, required=True)
    parser.add_argument("--guard-fd", type=int, required=True)
    parser.add_argument("--heartbeat-fd", type=int)
    options = parser.parse_args(arguments)
    serve_plan = read_plan_fd(options.plan_fd)
    os.close(options.plan_fd)
    send_lifeline(options.guard_fd)
    log_to_stderr("daemon", "")
    logging.getLogger().setLevel(logging.WARNING)
    logging.getLogger("shapechanger").setLevel(logging.INFO)
    try:
        plan = msgspec.convert(serve_plan.daemon, DaemonPlan)
        clock = connect(*serve_plan.hardware).clock
        run_early()

        async def run() -> str:
            daemon = Daemon(plan, clock, options.guard_fd, options.heartbeat_fd)
            for number in (signal.SIGTERM, signal.SIGINT):
                asyncio.get_running_loop().add_signal_handler(number, daemon.end)
            return await daemon.run()

        why = asyncio.run(run())
    except ShapechangerError as error:
        why = str(error)
    if why:
        _log.error("%s", why)
    return 1 if why else 0


def send_lifeline(guard_fd: int) -> None:
    """Send the guard a descriptor that closes as soon as this process dies.

    When a process is killed, the kernel frees its memory before it closes its files, and the guard
    would wait for the end of the socket for as long. If a thread has a separate table of files, its
    files are closed at once. Such a thread holds one end of a pipe, and the guard holds the other
    end. `python -m benchmarks.run robot-faults` measures how soon the motors rest.

    If the system permits no such thread, the guard waits for the end of the socket. Call this
    function while few files are open and no other thread runs.
    """
    ours, theirs = os.pipe()
    # The new thread gets copies of all descriptors, so `theirs` can be closed here afterwards.
    held = threading.Event()
    threading.Thread(
        target=_hold, args=(theirs, held), name="shapechanger-life", daemon=True
    ).start()
    is_held = held.wait(_READY_S)
    os.close(theirs)
    if is_held:
        # If the guard has ended already, the reader of the socket detects it.
        with (
            socket.socket(fileno=os.dup(guard_fd)) as guard,
            contextlib.suppress(BrokenPipeError, ConnectionResetError),
        ):
            socket.send_fds(guard, [LIFELINE], [ours])
    os.close(ours)


def _hold(fd: int, held: threading.Event) -> None:
    """Hold a file that no other thread has open, until the process ends or the file is closed."""
    if ctypes.CDLL(None).unshare(_CLONE_FILES) != 0:
        return
    os.closerange(0, fd)
    os.closerange(fd + 1, os.sysconf("SC_OPEN_MAX"))
    ended = select.poll()
    ended.register(fd, 0)  # Without flags, poll reports only that the other end was closed.
    held.set()
    ended.poll()


if __name__ == "__main__":
    raise SystemExit(main())
