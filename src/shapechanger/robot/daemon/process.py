"""Process of the daemon: assembles its parts, and ends with the guard or the supervisor."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import logging
import os
import queue
import signal
from collections import deque
from collections.abc import Callable, Sequence
from logging.handlers import QueueHandler, QueueListener
from pathlib import Path
from typing import Final

from shapechanger.errors import ShapechangerError
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.daemon.camera import FrameChecks, FrameReader
from shapechanger.robot.daemon.connection import Timekeeper
from shapechanger.robot.daemon.credentials import check_exposure, read_key, server_tls
from shapechanger.robot.daemon.guard_link import GuardLink, send_heartbeats, send_lifeline
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.server import Server
from shapechanger.robot.daemon.session import Authenticator
from shapechanger.robot.discovery import announce, withdraw
from shapechanger.robot.guard.messages import GuardState
from shapechanger.robot.guard.priority import run_early
from shapechanger.robot.guard.serve_plan import read_plan_fd
from shapechanger.robot.hardware import Clock, connect
from shapechanger.robot.link.address import Address, is_loopback
from shapechanger.robot.link.authentication import fingerprint_hex, fingerprint_short

_log = logging.getLogger(__name__)

_HEARTBEAT_S: Final = 0.05  # The supervisor expects one each 100 ms.
_RECORDER_S: Final = 1.0  # Period of the recorder's reports.
_MAX_LOG_LINES: Final = 1000


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
        if self._heartbeat_fd is not None:
            await send_heartbeats(self._heartbeat_fd, _HEARTBEAT_S)
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
        ready = {"port": port, "fingerprint": fingerprint_hex(fingerprint)}
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
    log = _start_log()
    try:
        plan = DaemonPlan.from_dict(serve_plan.daemon)
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
    log.stop()
    return 1 if why else 0


def _start_log() -> QueueListener:
    """Log to stderr from a separate thread, so that a full disk or a stuck pipe delays nothing.

    Lines that do not fit into the queue are lost. Stop the returned listener at the end, to write
    the last lines.
    """
    # A line that cannot be written must not cause another line.
    logging.raiseExceptions = False
    lines: queue.Queue[logging.LogRecord] = queue.Queue(_MAX_LOG_LINES)
    stderr = logging.StreamHandler()
    stderr.setFormatter(logging.Formatter("daemon: %(message)s"))
    root = logging.getLogger()
    root.setLevel(logging.WARNING)
    logging.getLogger("shapechanger").setLevel(logging.INFO)
    root.addHandler(QueueHandler(lines))
    listener = QueueListener(lines, stderr)
    listener.start()
    return listener
