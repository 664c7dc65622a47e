"""What can go wrong with a robot that drives, each as something that can be done to its twin."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Literal

from shapechanger.cli.robot.trial.driver import Driver
from shapechanger.errors import LinkError, RobotError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.link.authentication import new_key
from shapechanger.link.messages import Role
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import LimitPlan
from shapechanger.twin.camera import CameraFault
from shapechanger.twin.network import BadNetwork
from shapechanger.twin.robot import Operator, RunningRobot

__all__ = ["FAULTS", "Fault", "Make", "Scene", "Untimely"]

_LATE_S: Final = 1.0
# What takes no time takes no longer than this, or the machine stood still meanwhile.
_AT_ONCE_MS: Final = 5.0


@dataclass(frozen=True, slots=True)
class Scene:
    """Everybody who takes part in a trial.

    Attributes:
        robot: The robot.
        driver: Who drives it.
        network: What lies between the two.
        operator: Who stands beside the twin.
        strangers: Connections that somebody opened and keeps open.
    """

    robot: RunningRobot
    driver: Driver
    network: BadNetwork
    operator: Operator
    strangers: list[socket.socket] = field(default_factory=list[socket.socket])


# Does something, and says when, on the machine's monotonic clock in ns.
Make = Callable[[Scene], int]


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that goes wrong.

    Attributes:
        name: What it is, in words.
        make: Does it.
        within_ms: What is promised: how long after that all that propels is at rest, on top of
            `after`.
        after: What the robot may wait for before it knows: nothing, its deadline, or the age at
            which a picture is stale.
        undo: Takes it back, so that the robot can be used again.
        then: What becomes of the robot: it goes on, its processes start afresh, or it is gone.
        needs: What the profile must have: "", "camera", "bumper", "button" or "one-shot".
        harms: Whether it keeps the driver from driving. What does not is followed by the driver's
            own end, so that a stop is measured all the same.
        silences: Whether commands count no more from then on, however many the driver sends.
        guards_late: Whether the guard itself fails, so that its promised time comes on top.
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

    def limit_ms(self, limits: LimitPlan) -> float:
        """What is promised for a robot with these limits, ms."""
        waits = {"": 0, "deadline": limits.deadline_ms, "camera": limits.camera_stale_ms}
        return self.within_ms + waits[self.after]


class Untimely(RobotError):
    """Nobody knows when the fault happened, because the machine stood still meanwhile."""


def _now(act: Callable[[Scene], object]) -> Make:
    """Something that begins now, and may take a while."""

    def make(scene: Scene) -> int:
        at_ns = time.monotonic_ns()
        act(scene)
        return at_ns

    return make


def _at_once(act: Callable[[Scene], object]) -> Make:
    """Something that takes no time; if it did, its time is not known."""

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


def _kill_both(scene: Scene) -> int:
    """Kill the supervisor and the guard before either can do something for the other."""
    guard = scene.robot.pid_of("guard")
    os.kill(scene.robot.supervisor.pid, signal.SIGSTOP)
    at_ns = time.monotonic_ns()
    os.kill(guard, signal.SIGKILL)
    scene.robot.supervisor.kill()
    return at_ns


def _go_silent(scene: Scene) -> None:
    scene.network.silent = True


def _speak_again(scene: Scene) -> None:
    scene.network.reset()
    scene.network.silent = False


def _be_late(scene: Scene) -> None:
    scene.network.latency_s = _LATE_S


def _be_prompt(scene: Scene) -> None:
    scene.network.reset()
    scene.network.latency_s = 0.0


def _slice(scene: Scene) -> None:
    scene.network.slice_bytes = 1


def _mend(scene: Scene) -> None:
    scene.network.slice_bytes = 0


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


def _stand_at_the_door(scene: Scene) -> None:
    """Open connections and never say hello, for as long as the robot lets them."""
    for _ in range(40):
        scene.strangers.append(socket.create_connection(("127.0.0.1", scene.robot.port)))


def _by_another(role: Role, act: Callable[[RobotClient], object]) -> Make:
    """Let somebody else act, over a connection of their own."""

    def make(scene: Scene) -> int:
        with scene.robot.client(role=role, frames=False) as client:
            at_ns = time.monotonic_ns()
            act(client)
            client.ping()  # So that what was said has arrived before the connection ends.
            return at_ns

    return make


def _break_camera(how: CameraFault) -> Make:
    return _now(lambda scene: scene.operator.break_camera(how))


def _mend_camera(scene: Scene) -> None:
    scene.operator.break_camera("")


FAULTS: Final[dict[str, Fault]] = {
    fault.name: fault
    for fault in (
        Fault("driver killed", _at_once(lambda s: s.driver.process.kill()), 20.0, "deadline"),
        Fault(
            "driver stopped",
            _at_once(lambda s: s.driver.process.send_signal(signal.SIGSTOP)),
            20.0,
            "deadline",
        ),
        Fault("network silent", _at_once(_go_silent), 20.0, "deadline", _speak_again),
        Fault("network reset", _at_once(lambda s: s.network.reset()), 20.0, "deadline"),
        Fault("network half closed", _at_once(lambda s: s.network.half_close()), 20.0, "deadline"),
        # What answers an observation of a second ago is refused, so the last command that acts is
        # one that had arrived already.
        Fault("network late by 1 s", _at_once(_be_late), 20.0, "deadline", _be_prompt),
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
            "network in slices of 1 byte", _at_once(_slice), 20.0, "deadline", _mend, harms=False
        ),
        Fault(
            "a stranger with a wrong key",
            _now(_knock_with_a_wrong_key),
            20.0,
            "deadline",
            harms=False,
        ),
        Fault("a message of 1 MB", _now(_say_too_much), 20.0, "deadline", harms=False),
        Fault(
            "a second program commands",
            _by_another("program", _command_without_the_lease),
            20.0,
            "deadline",
            harms=False,
        ),
        Fault(
            "strangers who say nothing",
            _now(_stand_at_the_door),
            20.0,
            "deadline",
            lambda scene: [stranger.close() for stranger in scene.strangers],
            harms=False,
        ),
        Fault(
            "camera frozen", _break_camera("freeze"), 70.0, "camera", _mend_camera, needs="camera"
        ),
        Fault(
            "camera garbage", _break_camera("garbage"), 70.0, "camera", _mend_camera, needs="camera"
        ),
        Fault(
            "camera sends half pictures",
            _break_camera("short"),
            70.0,
            "camera",
            _mend_camera,
            needs="camera",
        ),
        Fault("camera off", _break_camera("off"), 70.0, "camera", _mend_camera, needs="camera"),
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
        # Only hardware is left then: the one-shot of the enable line, 100 ms, and its slack.
        Fault(
            "guard and supervisor killed",
            _kill_both,
            120.0,
            then="is gone",
            needs="one-shot",
            guards_late=True,
        ),
    )
}
"""All faults, by name."""
