"""Faults that a trial injects into a robot on its twin, each with the promised time to rest."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Literal

from shapechanger.cli.robot.trial_driver import FAILURES, Driver
from shapechanger.errors import LinkError, RobotError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.link.authentication import new_key
from shapechanger.link.messages import Role
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import LimitPlan
from shapechanger.twin.camera import CameraFault
from shapechanger.twin.network import BadNetwork
from shapechanger.twin.robot import Operator, RunningRobot

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
        operator: The operator beside the twin.
        strangers: Open connections without authentication.
    """

    robot: RunningRobot
    driver: Driver
    network: BadNetwork
    operator: Operator
    strangers: list[socket.socket] = field(default_factory=list[socket.socket])


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
    return _now(lambda scene: scene.operator.break_camera(how))


def _mend_camera(scene: Scene) -> None:
    scene.operator.break_camera("")


def _list_faults() -> list[Fault]:
    """Return all faults."""
    cameras: dict[CameraFault, str] = {
        "freeze": "camera frozen",
        "garbage": "camera garbage",
        "short": "camera sends half pictures",
        "off": "camera off",
    }
    return [
        Fault("driver killed", _to_driver(signal.SIGKILL), 20.0, "deadline"),
        Fault("driver stopped", _to_driver(signal.SIGSTOP), 20.0, "deadline"),
        *(
            Fault(f"policy {how}", _to_driver(number), 20.0, "deadline", by_policy=True)
            for how, number in {"is killed": signal.SIGKILL, **FAILURES}.items()
        ),
        Fault(
            "network silent",
            _at_once(lambda s: setattr(s.network, "silent", True)),
            20.0,
            "deadline",
            undo=_restore_network,
        ),
        Fault("network reset", _at_once(lambda s: s.network.reset()), 20.0, "deadline"),
        Fault("network half closed", _at_once(lambda s: s.network.half_close()), 20.0, "deadline"),
        # What answers an observation of a second ago is refused, so the last command that acts is
        # one that had arrived already.
        Fault(
            "network late by 1 s",
            _at_once(lambda s: setattr(s.network, "latency_s", _LATE_S)),
            20.0,
            "deadline",
            undo=_restore_network,
        ),
        Fault(
            "emergency stop by another",
            _by_another("program", lambda c: c.emergency_stop("A trial.")),
            20.0,
            silences=True,
        ),
        Fault(
            "a person takes over", _by_another("person", lambda c: c.take()), 20.0, silences=True
        ),
        Fault("a person disarms", _by_another("person", lambda c: c.disarm()), 20.0, silences=True),
        Fault(
            "network in slices of 1 byte",
            _at_once(lambda s: setattr(s.network, "slice_bytes", 1)),
            20.0,
            "deadline",
            undo=lambda s: setattr(s.network, "slice_bytes", 0),
            harms=False,
        ),
        *(
            Fault(name, make, 20.0, "deadline", harms=False)
            for name, make in (
                ("a stranger with a wrong key", _now(_knock_with_a_wrong_key)),
                ("a message of 1 MB", _now(_say_too_much)),
                (
                    "a second program commands",
                    _by_another("program", _command_without_the_lease),
                ),
            )
        ),
        Fault(
            "strangers who say nothing",
            _now(_connect_silently),
            20.0,
            "deadline",
            undo=lambda s: [stranger.close() for stranger in s.strangers],
            harms=False,
        ),
        *(
            Fault(name, _break_camera(how), 70.0, "camera", _mend_camera, needs="camera")
            for how, name in cameras.items()
        ),
        Fault(
            "bumper pressed",
            _now(lambda s: s.operator.press_bumper()),
            40.0,
            undo=lambda s: s.operator.press_bumper(down=False),
            needs="bumper",
        ),
        Fault(
            "emergency button",
            _now(lambda s: s.operator.press_stop()),
            40.0,
            undo=lambda s: s.operator.press_stop(down=False),
            needs="button",
            silences=True,
        ),
        Fault("daemon killed", _signal("daemon", signal.SIGKILL), 20.0, then="starts afresh"),
        Fault(
            "daemon stopped",
            _signal("daemon", signal.SIGSTOP),
            20.0,
            "deadline",
            then="starts afresh",
        ),
        Fault(
            "guard killed",
            _signal("guard", signal.SIGKILL),
            100.0,
            then="starts afresh",
            guards_late=True,
        ),
        Fault(
            "guard stopped",
            _signal("guard", signal.SIGSTOP),
            100.0,
            "deadline",
            then="starts afresh",
            guards_late=True,
        ),
        Fault(
            "supervisor killed",
            _at_once(lambda s: s.robot.supervisor.kill()),
            100.0,
            then="is gone",
        ),
        # Only hardware remains: the one-shot of the enable line, 100 ms, and its tolerance.
        Fault(
            "guard and supervisor killed",
            _kill_both,
            120.0,
            then="is gone",
            needs="one-shot",
            guards_late=True,
        ),
    ]


FAULTS: Final[dict[str, Fault]] = {fault.name: fault for fault in _list_faults()}
"""All faults, by name."""
