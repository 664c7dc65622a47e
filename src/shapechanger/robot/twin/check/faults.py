"""Faults that a trial injects into a robot on its twin, each with the promised time to rest."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, Literal

from shapechanger.contract.plan import LimitPlan
from shapechanger.errors import LinkError, RobotError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link.authentication import new_key
from shapechanger.robot.link.messages import Role
from shapechanger.robot.twin.camera import CameraFault
from shapechanger.robot.twin.check.driver import FAILURES, Driver
from shapechanger.robot.twin.network import BadNetwork
from shapechanger.robot.twin.robot import Operator, RunningRobot

_LATE_S: Final = 1.0
# Longest duration of an instantaneous fault; a longer one means that the machine was paused.
_AT_ONCE_MS: Final = 5.0


@dataclass(frozen=True, slots=True)
class Scene:
    """Participants of a trial.

    Attributes:
        robot: The robot.
        driver: The driving process.
        network: The network between them.
        operator: The operator beside the twin; None on pins.
        strangers: Open connections without authentication.
    """

    robot: RunningRobot
    driver: Driver
    network: BadNetwork
    operator: Operator | None
    strangers: list[socket.socket] = field(default_factory=list[socket.socket])

    def on_board(self) -> Operator:
        """Return the operator."""
        if self.operator is None:
            raise RobotError("Only the board of a twin has this fault.")
        return self.operator


# Performs an action and returns its time: monotonic, ns.
Make = Callable[[Scene], int]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault.

    Attributes:
        name: Description.
        make: Injects it.
        within_ms: Promised time to rest after `after`, ms.
        after: How the robot can notice it: at once, by its deadline, or by the age of a frame.
        undo: Reverts it.
        then: The robot afterwards: it continues, its processes restart, or it is gone.
        needs: Required part of the profile: "", "camera", "bumper", "button" or "one-shot". The
            board makes the faults of the first three, and its ledger dates them.
        harms: Whether it stops the driving. Otherwise the driver is killed, to measure a stop.
        silences: Whether later commands of the driver do not count.
        guards_late: Whether the guard itself fails, which adds its own promised time.
        by_policy: Whether a policy drives, as on board, and a person armed the robot for it.
        on_pins: Whether it is also tried on the pins of a bench with LEDs.
    """

    name: str
    make: Make
    within_ms: float
    after: Literal["", "deadline", "camera"] = ""
    undo: Callable[[Scene], object] = lambda _: None
    then: Literal["goes on", "starts afresh", "is gone"] = "goes on"
    needs: Literal["", "camera", "bumper", "button", "one-shot"] = ""
    harms: bool = True
    silences: bool = False
    guards_late: bool = False
    by_policy: bool = False
    on_pins: bool = False

    def limit_ms(self, limits: LimitPlan) -> float:
        """Return the promised time to rest for these limits, ms."""
        waits = {"": 0, "deadline": limits.deadline_ms, "camera": limits.camera_stale_ms}
        return self.within_ms + waits[self.after]


class Untimely(RobotError):
    """The time of the fault is unknown, because the machine was paused."""


def _now(act: Callable[[Scene], object]) -> Make:
    """Wrap an action that starts now and may take a while."""

    def make(scene: Scene) -> int:
        at_ns = time.monotonic_ns()
        act(scene)
        return at_ns

    return make


def _at_once(act: Callable[[Scene], object]) -> Make:
    """Wrap an instantaneous action; its time is unknown if it took long."""

    def make(scene: Scene) -> int:
        at_ns = _now(act)(scene)
        took_ms = (time.monotonic_ns() - at_ns) / 1e6
        if took_ms > _AT_ONCE_MS:
            raise Untimely(f"It took {took_ms:.0f} ms to let the fault happen.")
        return at_ns

    return make


def _signal(program: Literal["guard", "daemon"], number: signal.Signals) -> Make:
    def make(scene: Scene) -> int:
        pid = scene.robot.pid_of(program)
        return _at_once(lambda _: os.kill(pid, number))(scene)

    return make


def _to_driver(number: signal.Signals) -> Make:
    return _at_once(lambda scene: scene.driver.process.send_signal(number))


def _kill_both(scene: Scene) -> int:
    """Kill the supervisor and the guard before either can react."""
    guard = scene.robot.pid_of("guard")
    os.kill(scene.robot.supervisor.pid, signal.SIGSTOP)
    at_ns = time.monotonic_ns()
    os.kill(guard, signal.SIGKILL)
    scene.robot.supervisor.kill()
    return at_ns


def _restore_network(scene: Scene) -> None:
    scene.network.reset()
    scene.network.silent = False
    scene.network.latency_s = 0.0


def _knock_with_a_wrong_key(scene: Scene) -> None:
    known = replace(scene.robot.known, key=new_key())
    for _ in range(3):
        with contextlib.suppress(RobotRefused):
            RobotClient.connect(known).close()


def _say_too_much(scene: Scene) -> None:
    with contextlib.suppress(LinkError), scene.robot.client(frames=False) as client:
        client.command([1.0] * 125_000, answers=0)
        client.ping()


def _command_without_the_lease(client: RobotClient) -> None:
    wanted = Layout.from_json(client.welcome.action_layout).size
    for _ in range(10):
        client.command([1.0] * wanted, answers=client.ask().message.seq)


def _connect_silently(scene: Scene) -> None:
    """Open connections without authenticating, as many as the robot accepts."""
    for _ in range(40):
        scene.strangers.append(socket.create_connection(("127.0.0.1", scene.robot.port)))


def _by_another(role: Role, act: Callable[[RobotClient], object]) -> Make:
    """Act over a connection of another client."""

    def make(scene: Scene) -> int:
        with scene.robot.client(role=role, frames=False) as client:
            at_ns = time.monotonic_ns()
            act(client)
            client.ping()  # Lets the message arrive before the connection closes.
            return at_ns

    return make


def _break_camera(how: CameraFault) -> Make:
    return _now(lambda scene: scene.on_board().break_camera(how))


def _mend_camera(scene: Scene) -> None:
    scene.on_board().break_camera("")


def _list_faults() -> list[Fault]:
    """Return all faults."""
    cameras: dict[CameraFault, str] = {
        "freeze": "camera frozen",
        "garbage": "camera garbage",
        "short": "camera sends half pictures",
        "off": "camera off",
    }
    by_deadline = partial(Fault, within_ms=20.0, after="deadline")
    harmless = partial(by_deadline, harms=False)
    at_once = partial(Fault, within_ms=20.0)
    restarts = partial(Fault, then="starts afresh", on_pins=True)
    return [
        by_deadline("driver killed", _to_driver(signal.SIGKILL), on_pins=True),
        by_deadline("driver stopped", _to_driver(signal.SIGSTOP), on_pins=True),
        *(
            by_deadline(f"policy {how}", _to_driver(number), by_policy=True)
            for how, number in {"is killed": signal.SIGKILL, **FAILURES}.items()
        ),
        by_deadline(
            "network silent",
            _at_once(lambda s: setattr(s.network, "silent", True)),
            undo=_restore_network,
        ),
        by_deadline("network reset", _at_once(lambda s: s.network.reset())),
        by_deadline("network half closed", _at_once(lambda s: s.network.half_close())),
        # What answers an observation of a second ago is refused, so the last command that acts is
        # one that had arrived already.
        by_deadline(
            "network late by 1 s",
            _at_once(lambda s: setattr(s.network, "latency_s", _LATE_S)),
            undo=_restore_network,
        ),
        at_once(
            "emergency stop by another",
            _by_another("program", lambda c: c.emergency_stop("A trial.")),
            silences=True,
            on_pins=True,
        ),
        at_once("a person takes over", _by_another("person", lambda c: c.take()), silences=True),
        at_once(
            "a person disarms",
            _by_another("person", lambda c: c.disarm()),
            silences=True,
            on_pins=True,
        ),
        harmless(
            "network in slices of 1 byte",
            _at_once(lambda s: setattr(s.network, "slice_bytes", 1)),
            undo=lambda s: setattr(s.network, "slice_bytes", 0),
        ),
        harmless("a stranger with a wrong key", _now(_knock_with_a_wrong_key)),
        harmless("a message of 1 MB", _now(_say_too_much)),
        harmless("a second program commands", _by_another("program", _command_without_the_lease)),
        harmless(
            "strangers who say nothing",
            _now(_connect_silently),
            undo=lambda s: [stranger.close() for stranger in s.strangers],
        ),
        *(
            Fault(name, _break_camera(how), 70.0, "camera", _mend_camera, needs="camera")
            for how, name in cameras.items()
        ),
        Fault(
            "bumper pressed",
            _now(lambda s: s.on_board().press_bumper()),
            40.0,
            undo=lambda s: s.on_board().press_bumper(down=False),
            needs="bumper",
        ),
        Fault(
            "emergency button",
            _now(lambda s: s.on_board().press_stop()),
            40.0,
            undo=lambda s: s.on_board().press_stop(down=False),
            needs="button",
            silences=True,
        ),
        restarts("daemon killed", _signal("daemon", signal.SIGKILL), 20.0),
        restarts("daemon stopped", _signal("daemon", signal.SIGSTOP), 20.0, "deadline"),
        restarts("guard killed", _signal("guard", signal.SIGKILL), 100.0, guards_late=True),
        restarts(
            "guard stopped", _signal("guard", signal.SIGSTOP), 100.0, "deadline", guards_late=True
        ),
        Fault(
            "supervisor killed",
            _at_once(lambda s: s.robot.supervisor.kill()),
            100.0,
            then="is gone",
            on_pins=True,
        ),
        # Only hardware remains: the one-shot of the enable line, 100 ms, and its tolerance.
        Fault(
            "guard and supervisor killed",
            _kill_both,
            120.0,
            then="is gone",
            needs="one-shot",
            guards_late=True,
            on_pins=True,
        ),
    ]


FAULTS: Final[dict[str, Fault]] = {fault.name: fault for fault in _list_faults()}
"""All faults, by name."""
