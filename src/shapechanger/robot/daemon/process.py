"""The daemon's process: puts its parts together, and ends with the guard or the supervisor."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import logging
import os
import queue
import signal
from collections.abc import Callable, Sequence
from logging.handlers import QueueHandler, QueueListener
from pathlib import Path
from typing import Final

from shapechanger.errors import ShapechangerError
from shapechanger.link.address import Address, is_loopback
from shapechanger.link.authentication import fingerprint_hex, fingerprint_short
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.daemon.camera import FrameChecks, FrameReader, Latest
from shapechanger.robot.daemon.connection import Timekeeper
from shapechanger.robot.daemon.credentials import check_exposure, read_key, server_tls
from shapechanger.robot.daemon.discovery import Announcement
from shapechanger.robot.daemon.guard_link import GuardLink, send_heartbeats, send_lifeline
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.server import Server
from shapechanger.robot.daemon.session import Authenticator
from shapechanger.robot.guard.messages import GuardState
from shapechanger.robot.guard.priority import run_early
from shapechanger.robot.guard.serve_plan import read_plan_fd
from shapechanger.robot.hardware import Clock, connect

__all__ = ["Daemon", "main", "start_log"]

_MOST_LINES: Final = 1000


def start_log(program: str) -> QueueListener:
    """Send the log to stderr, from a thread of its own; lines for which there is no room are lost.

    Returns:
        What writes the lines; stop it at the end, so that the last ones are written.
    """
    # A line that cannot be written must not become another line that cannot be written.
    logging.raiseExceptions = False
    lines: queue.Queue[logging.LogRecord] = queue.Queue(_MOST_LINES)
    stderr = logging.StreamHandler()
    stderr.setFormatter(logging.Formatter(f"{program}: %(message)s"))
    root = logging.getLogger()
    root.setLevel(logging.WARNING)
    logging.getLogger("shapechanger").setLevel(logging.INFO)
    root.addHandler(QueueHandler(lines))
    listener = QueueListener(lines, stderr)
    listener.start()
    return listener


_log = logging.getLogger(__name__)

_BEAT_S: Final = 0.05  # The supervisor wants one each 100 ms.
_RECORDER_S: Final = 1.0  # How often everybody is told how the recording goes.


class Daemon:
    """A robot's daemon, from its start to its end.

    Args:
        plan: What it needs to know.
        clock: Where time comes from.
        guard_fd: Socket to the guard; this object owns it.
        heartbeat_fd: Socket to the supervisor; None without one. This object owns it.
        ready_fd: Where to tell the port once it is known; None for nowhere.
    """

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
        self._heard = asyncio.Event()  # The guard has said something, or never will.
        self._why = ""
        self._port = GuardLink(
            guard_fd,
            on_state=self._on_state,
            on_lost=lambda: self.end("The guard is gone."),
        )
        self._loop: asyncio.AbstractEventLoop | None = None
        self._cockpit = SessionHub(plan, clock.now_ns, self._port.send, self._call)
        self._heartbeat_fd = heartbeat_fd
        self._ready_fd = ready_fd

    async def run(self) -> str:
        """Serve until told to end.

        Returns:
            Why it ended, in words; empty if it was asked to.

        Raises:
            RobotError: If it cannot begin.
        """
        plan = self._plan
        loop = self._loop = asyncio.get_running_loop()
        check_exposure(plan)
        key = read_key(Path(plan.key_file)) if plan.key_file else b""
        tls, fingerprint = None, b""
        if plan.certificate:
            tls, fingerprint = server_tls(Path(plan.certificate), Path(plan.private_key))
        time = Timekeeper(self._clock, self._cockpit, self._port.drain)
        server = Server(self._cockpit, time, Authenticator(key, fingerprint), tls)
        tasks = [asyncio.create_task(work) for work in (self._beat(), self._tell_recording())]
        self._port.attach(loop)
        camera = None if plan.camera is None else self._camera(plan.camera)
        announcement = None
        try:
            # Who looks at once would see a robot of which nothing is known. Where time waits for
            # somebody who looks, the guard says nothing before.
            if not time.in_steps:
                await self._heard.wait()
            if not self._ended.is_set():
                port = await server.start()
                self._say_ready(port, fingerprint)
                announcement = self._announcement(port, fingerprint)
                if announcement is not None:
                    await announcement.start()
            await self._ended.wait()
        finally:
            # The guard stops first: it sees the end of this socket.
            self._port.close()
            self._cockpit.recorder.end()
            if camera is not None:
                await asyncio.to_thread(camera.close)
            await server.close()
            if announcement is not None:
                await announcement.close()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await asyncio.to_thread(self._cockpit.recorder.close)
            await asyncio.to_thread(self._cockpit.library.close)
        return self._why

    def end(self, why: str = "") -> None:
        """Stop serving."""
        self._why = self._why or why
        self._ended.set()
        self._heard.set()

    def _on_state(self, state: GuardState) -> None:
        self._cockpit.on_state(state)
        self._heard.set()

    async def _beat(self) -> None:
        """Show the supervisor that the event loop turns."""
        if self._heartbeat_fd is not None:
            await send_heartbeats(self._heartbeat_fd, _BEAT_S)
            self.end("The supervisor is gone.")

    async def _tell_recording(self) -> None:
        while True:
            await asyncio.sleep(_RECORDER_S)
            self._cockpit.recorder.tick()

    def _call(self, work: Callable[[], None]) -> None:
        """Run something in the thread of the event loop, from any other one."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # The loop has ended, and the thread not yet.
                self._loop.call_soon_threadsafe(work)

    def _camera(self, plan: CameraPlan) -> FrameReader:
        """Start to read the camera; of what piles up while the loop is busy, the newest counts."""
        newest: Latest[Frame] = Latest()

        def collect() -> None:
            frame = newest.take()
            if frame is not None:
                self._cockpit.on_frame(frame)

        def deliver(frame: Frame) -> None:
            newest.put(frame)
            self._call(collect)

        def report(text: str) -> None:
            _log.warning("Camera: %s", text)
            self._call(lambda: self._cockpit.event("camera", text))

        now_ns = self._clock.now_ns if self._plan.clock == "real" else None
        reader = FrameReader(plan, FrameChecks(plan.size, now_ns), deliver, report)
        reader.start()
        return reader

    def _announcement(self, port: int, fingerprint: bytes) -> Announcement | None:
        """What lets the network know of the robot; None where nobody else reaches it, or shall."""
        plan = self._plan
        if not plan.discovery:
            return None
        if is_loopback(plan.host):
            _log.info("%s is not announced: only this machine reaches %s.", plan.robot, plan.host)
            return None
        return Announcement(plan, port, fingerprint)

    def _say_ready(self, port: int, fingerprint: bytes) -> None:
        """Tell people, and whoever started this, where the robot is."""
        plan = self._plan
        secured = f"fingerprint {fingerprint_short(fingerprint)}" if fingerprint else "without TLS"
        _log.info("%s listens at %s, %s.", plan.robot, Address(plan.host, port), secured)
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
            # Nobody is told, and the robot serves all the same.
            _log.warning("The port cannot be told: %s", error)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the daemon; the exit status."""
    parser = argparse.ArgumentParser(prog="shapechanger.robot.daemon", description=__doc__)
    parser.add_argument("--plan-fd", type=int, required=True)
    parser.add_argument("--guard-fd", type=int, required=True)
    parser.add_argument("--heartbeat-fd", type=int)
    parser.add_argument("--ready-fd", type=int)
    asked = parser.parse_args(arguments)
    serve_plan = read_plan_fd(asked.plan_fd)
    os.close(asked.plan_fd)
    send_lifeline(asked.guard_fd)
    log = start_log("daemon")
    try:
        plan = DaemonPlan.from_dict(serve_plan.daemon)
        source, argument = serve_plan.hardware
        clock = connect(source, argument).clock
        run_early()
        why = asyncio.run(_run(plan, clock, asked))
    except ShapechangerError as error:
        why = str(error)
    if why:
        _log.error("%s", why)
    log.stop()
    return 1 if why else 0


async def _run(plan: DaemonPlan, clock: Clock, asked: argparse.Namespace) -> str:
    daemon = Daemon(plan, clock, asked.guard_fd, asked.heartbeat_fd, asked.ready_fd)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, daemon.end)
    return await daemon.run()
