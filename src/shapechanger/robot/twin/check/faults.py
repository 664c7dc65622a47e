"""Faults after which a robot must stop, with the time within which it must be at rest."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import struct
import time
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, replace
from functools import partial
from threading import Thread
from typing import Any, Final, Literal, NamedTuple

from shapechanger.contract.plan import LimitPlan
from shapechanger.errors import LinkError, RobotError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link.authentication import new_key
from shapechanger.robot.link.messages import Role
from shapechanger.robot.twin.check.driver import FAILURES, Driver
from shapechanger.robot.twin.operator import Operator
from shapechanger.robot.twin.robot import RunningRobot

_POLL_S: Final = 0.001
_MOST_BYTES: Final = 65536


class BadNetwork:
    """TCP proxy with faults, from a free port of 127.0.0.1 to the robot's `port`."""

    def __init__(self, port: int) -> None:
        self.latency_s = 0.0  # Least delay of each byte, s.
        self.slice_bytes = _MOST_BYTES  # Most bytes to forward at once.
        self.silent = False  # Whether to block all data on open connections, like a dead radio.
        self._robot_port = port
        self._ends: list[asyncio.StreamWriter] = []  # Writers to driver, robot, driver, robot, …
        self._ended: set[asyncio.StreamWriter] = set()  # Data to these writers are discarded.
        listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = listener.getsockname()[1]
        self._closed = asyncio.Event()
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop = self._runner.get_loop()
        serve = partial(self._runner.run, self._serve(listener))
        self._thread = Thread(target=serve, name="bad network", daemon=True)
        self._thread.start()

    def reset(self) -> None:
        """Reset all connections, like a router after a restart."""
        ends = [end for end in self._ends if not end.is_closing()]
        # Set SO_LINGER of all ends to 0 s before closing any, so that each sends a reset instead of
        # an orderly end.
        option = (socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        for end in ends:
            end.get_extra_info("socket").setsockopt(*option)
        for end in ends:
            self._loop.call_soon_threadsafe(end.transport.abort)

    def half_close(self) -> None:
        """End all connections in the direction to the robot, but not in the other direction."""
        for robot in self._ends[1::2]:
            if not robot.is_closing():
                self._ended.add(robot)
                self._loop.call_soon_threadsafe(robot.write_eof)

    def close(self) -> None:
        """End all connections and the thread."""
        self._loop.call_soon_threadsafe(self._closed.set)
        self._thread.join()
        self._runner.close()  # Cancels the tasks of the connections.

    async def _serve(self, listener: socket.socket) -> None:
        server = await asyncio.start_server(self._join, sock=listener)
        await self._closed.wait()
        server.close()

    async def _join(self, read: asyncio.StreamReader, driver: asyncio.StreamWriter) -> None:
        try:
            answers, robot = await asyncio.open_connection("127.0.0.1", self._robot_port)
        except OSError:
            driver.close()  # To the driver, the robot seems to refuse the connection.
            return
        self._ends += driver, robot
        with suppress(asyncio.CancelledError):
            await asyncio.gather(self._pass_on(read, robot), self._pass_on(answers, driver))

    async def _pass_on(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        with closing(sink), suppress(ConnectionError):
            while data := await source.read(_MOST_BYTES):
                await asyncio.sleep(self.latency_s)
                while self.silent:
                    await asyncio.sleep(_POLL_S)
                for at in range(0, len(data), self.slice_bytes):
                    # asyncio would log each write to a lost connection.
                    if not sink.is_closing() and sink not in self._ended:
                        sink.write(data[at : at + self.slice_bytes])
                await sink.drain()


class NotTried(RobotError):
    """A fault could not be caused; a retry with a new robot may succeed."""


class Scene(NamedTuple):
    """Participants of a trial."""

    robot: RunningRobot
    driver: Driver
    network: BadNetwork  # Proxy between driver and robot.
    opened: ExitStack  # Resources that are closed after the trial.
    board: Operator | None  # Operator of the robot's twin; None for a robot on real pins.


Make = Callable[[Scene], int | None]
"""Causes a fault, and returns its time: monotonic, ns; None for the time of the call."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault, and the promised reaction of the robot."""

    name: str
    make: Make
    within_ms: float = 20.0  # Promised time from the detection to rest, ms.
    # How the robot detects the fault: at once, by its deadline, or by the age of a frame.
    after: Literal["", "deadline", "camera"] = ""
    # State of the robot after the fault: it still runs, it restarts, or it has ended.
    then: Literal["goes on", "starts afresh", "is gone"] = "goes on"
    needs: Literal["", "camera", "bumper", "button", "one-shot"] = ""  # Required part.
    harms: bool = True  # Whether the fault stops the driving; if not, the driver is killed later.
    silences: bool = False  # Whether the robot must ignore later commands of the driver.
    guards_late: bool = False  # Whether the guard fails: expired commands may act for `within_ms`.
    by_policy: bool = False  # Whether a policy drives, for which a person has armed the robot.
    on_pins: bool = False  # Whether to also try the fault on real pins with LEDs.

    def limit_ms(self, limits: LimitPlan) -> float:
        """Return the promised time to rest for these limits, ms."""
        waits = {"": 0, "deadline": limits.deadline_ms, "camera": limits.camera_stale_ms}
        return self.within_ms + waits[self.after]


# Longest time to cause an instantaneous fault; if it takes longer, the machine was paused.
_AT_ONCE_MS: Final = 5.0


def _at_once(act: Callable[[], object]) -> int:
    """Cause an instantaneous fault and return its time; raise `NotTried` if it took too long."""
    at_ns = time.monotonic_ns()
    act()
    took_ms = (time.monotonic_ns() - at_ns) / 1e6
    if took_ms > _AT_ONCE_MS:
        raise NotTried(f"It took {took_ms:.0f} ms to cause the fault.")
    return at_ns


def _to_driver(number: signal.Signals) -> Make:
    return lambda scene: _at_once(lambda: scene.driver.send_signal(number))


def _to_program(program: Literal["guard", "daemon"], number: signal.Signals) -> Make:
    return lambda scene: _at_once(partial(os.kill, scene.robot.pid_of(program), number))


def _kill_both(scene: Scene) -> int:
    """Kill the supervisor and the guard before either can react."""
    guard = scene.robot.pid_of("guard")
    os.kill(scene.robot.supervisor.pid, signal.SIGSTOP)
    at_ns = time.monotonic_ns()
    os.kill(guard, signal.SIGKILL)
    scene.robot.supervisor.kill()
    return at_ns


def _on_board(act: Callable[[Operator, Any], None], broken: object, sound: object) -> Make:
    """Return a function that sets a state of the twin to `broken` until the trial ends."""

    def make(scene: Scene) -> None:
        assert scene.board is not None  # Only twins have these faults.
        act(scene.board, broken)
        scene.opened.callback(act, scene.board, sound)

    return make


def _by_another(role: Role, act: Callable[[RobotClient], object]) -> Make:
    """Return a function that calls `act` with another client."""

    def make(scene: Scene) -> int:
        with scene.robot.client(role=role, frames=False) as client:
            at_ns = time.monotonic_ns()
            act(client)
            client.ping()  # Lets the message arrive before the connection closes.
            return at_ns

    return make


def _set_network(name: str, value: float) -> Make:
    return lambda scene: _at_once(lambda: setattr(scene.network, name, value))


def _knock_with_a_wrong_key(scene: Scene) -> None:
    known = replace(scene.robot.known, key=new_key())
    for _ in range(3):
        with suppress(RobotRefused):
            RobotClient.connect(known).close()


def _say_too_much(scene: Scene) -> None:
    with suppress(LinkError), scene.robot.client(frames=False) as client:
        client.command([1.0] * 125_000, answers=0)
        client.ping()


def _command_without_the_lease(client: RobotClient) -> None:
    size = Layout.from_json(client.welcome.action_layout).size
    for _ in range(10):
        client.command([1.0] * size, answers=client.ask().message.seq)


def _connect_silently(scene: Scene) -> None:
    """Open 40 connections without authenticating, more than the robot keeps of an address."""
    for _ in range(40):
        stranger = socket.create_connection(("127.0.0.1", scene.robot.port))
        scene.opened.enter_context(stranger)


_by_deadline = partial(Fault, after="deadline")
_by_policy = partial(_by_deadline, by_policy=True)
_harmless = partial(_by_deadline, harms=False)
_silences = partial(Fault, silences=True)
_camera = partial(Fault, within_ms=70.0, after="camera", needs="camera")
_restarts = partial(Fault, then="starts afresh", on_pins=True)
_guard = partial(_restarts, within_ms=100.0, guards_late=True)
_gone = partial(Fault, then="is gone", on_pins=True)

FAULTS: Final = {
    fault.name: fault
    for fault in (
        _by_deadline("driver killed", _to_driver(signal.SIGKILL), on_pins=True),
        _by_deadline("driver stopped", _to_driver(signal.SIGSTOP), on_pins=True),
        _by_policy("policy is killed", _to_driver(signal.SIGKILL)),
        *(_by_policy(f"policy {how}", _to_driver(number)) for how, number in FAILURES.items()),
        _by_deadline("network silent", _set_network("silent", True)),
        _by_deadline("network reset", lambda s: _at_once(s.network.reset)),
        _by_deadline("network half closed", lambda s: _at_once(s.network.half_close)),
        # Answers to an observation of a second ago are refused, so only commands that have arrived
        # before the fault take effect.
        _by_deadline("network late by 1 s", _set_network("latency_s", 1.0)),
        _silences(
            "emergency stop by another",
            _by_another("program", lambda c: c.emergency_stop("A trial.")),
            on_pins=True,
        ),
        _silences("a person takes over", _by_another("person", lambda c: c.take())),
        _silences("a person disarms", _by_another("person", lambda c: c.disarm()), on_pins=True),
        _harmless("network in slices of 1 byte", _set_network("slice_bytes", 1)),
        _harmless("a stranger with a wrong key", _knock_with_a_wrong_key),
        _harmless("a message of 1 MB", _say_too_much),
        _harmless("a second program commands", _by_another("program", _command_without_the_lease)),
        _harmless("strangers who say nothing", _connect_silently),
        _camera("camera frozen", _on_board(Operator.break_camera, "freeze", "")),
        _camera("camera garbage", _on_board(Operator.break_camera, "garbage", "")),
        _camera("camera sends half pictures", _on_board(Operator.break_camera, "short", "")),
        _camera("camera off", _on_board(Operator.break_camera, "off", "")),
        Fault(
            "bumper pressed", _on_board(Operator.press_bumper, True, False), 40.0, needs="bumper"
        ),
        _silences(
            "emergency button", _on_board(Operator.press_stop, True, False), 40.0, needs="button"
        ),
        _restarts("daemon killed", _to_program("daemon", signal.SIGKILL)),
        _restarts("daemon stopped", _to_program("daemon", signal.SIGSTOP), after="deadline"),
        _guard("guard killed", _to_program("guard", signal.SIGKILL)),
        _guard("guard stopped", _to_program("guard", signal.SIGSTOP), after="deadline"),
        _gone("supervisor killed", lambda s: _at_once(s.robot.supervisor.kill), 100.0),
        # Only the one-shot of the enable line can then stop the robot: 100 ms and its tolerance.
        _gone("guard and supervisor killed", _kill_both, 120.0, needs="one-shot", guards_late=True),
    )
}
"""All faults, keyed by name."""
