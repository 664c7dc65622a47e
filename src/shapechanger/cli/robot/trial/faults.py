"""What can go wrong with a robot that drives, each as something that can be done to its twin."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from shapechanger.cli.robot.running import RunningRobot
from shapechanger.cli.robot.trial.driver import Driver
from shapechanger.link.messages import Role
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import LimitPlan
from shapechanger.twin.camera import CameraFault
from shapechanger.twin.network import BadNetwork
from shapechanger.twin.operator import Operator

__all__ = ["FAULTS", "Fault", "Make", "Scene"]

_LATE_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Scene:
    """Everybody who takes part in a trial.

    Attributes:
        robot: The robot.
        driver: Who drives it.
        network: What lies between the two.
        operator: Who stands beside the twin.
    """

    robot: RunningRobot
    driver: Driver
    network: BadNetwork
    operator: Operator


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
        needs: What the profile must have: "", "camera", "bumper" or "button".
    """

    name: str
    make: Make
    within_ms: float
    after: Literal["", "deadline", "camera"] = ""
    undo: Callable[[Scene], object] = lambda _: None
    then: Literal["goes on", "starts afresh", "is gone"] = "goes on"
    needs: Literal["", "camera", "bumper", "button"] = ""

    def limit_ms(self, limits: LimitPlan) -> float:
        """What is promised for a robot with these limits, ms."""
        waits = {"": 0, "deadline": limits.deadline_ms, "camera": limits.camera_stale_ms}
        return self.within_ms + waits[self.after]


def _now(act: Callable[[Scene], object]) -> Make:
    """Something that happens at once."""

    def make(scene: Scene) -> int:
        at_ns = time.monotonic_ns()
        act(scene)
        return at_ns

    return make


def _signal(program: Literal["guard", "daemon"], number: signal.Signals) -> Make:
    def make(scene: Scene) -> int:
        pid = scene.robot.pid_of(program)
        at_ns = time.monotonic_ns()
        os.kill(pid, number)
        return at_ns

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
        Fault("driver killed", _now(lambda s: s.driver.process.kill()), 20.0, "deadline"),
        Fault(
            "driver stopped",
            _now(lambda s: s.driver.process.send_signal(signal.SIGSTOP)),
            20.0,
            "deadline",
        ),
        Fault("network silent", _now(_go_silent), 20.0, "deadline", _speak_again),
        Fault("network reset", _now(lambda s: s.network.reset()), 20.0, "deadline"),
        Fault("network half closed", _now(lambda s: s.network.half_close()), 20.0, "deadline"),
        # What answers an observation of a second ago is refused, so the last command that acts is
        # one that had arrived already.
        Fault("network late by 1 s", _now(_be_late), 20.0, "deadline", _be_prompt),
        Fault(
            "emergency stop by another",
            _by_another("program", lambda c: c.emergency_stop("A trial.")),
            20.0,
        ),
        Fault("a person takes over", _by_another("person", lambda c: c.take()), 20.0),
        Fault("a person disarms", _by_another("person", lambda c: c.disarm()), 20.0),
        Fault(
            "camera frozen", _break_camera("freeze"), 70.0, "camera", _mend_camera, needs="camera"
        ),
        Fault(
            "camera garbage", _break_camera("garbage"), 70.0, "camera", _mend_camera, needs="camera"
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
        ),
        Fault("daemon killed", _signal("daemon", signal.SIGKILL), 20.0, then="starts afresh"),
        Fault(
            "daemon stopped",
            _signal("daemon", signal.SIGSTOP),
            20.0,
            "deadline",
            then="starts afresh",
        ),
        Fault("guard killed", _signal("guard", signal.SIGKILL), 100.0, then="starts afresh"),
        Fault(
            "guard stopped",
            _signal("guard", signal.SIGSTOP),
            100.0,
            "deadline",
            then="starts afresh",
        ),
        Fault(
            "supervisor killed", _now(lambda s: s.robot.supervisor.kill()), 100.0, then="is gone"
        ),
        # Only hardware is left then: the one-shot of the enable line, 100 ms, and its slack.
        Fault("guard and supervisor killed", _kill_both, 120.0, then="is gone"),
    )
}
"""All faults, by name."""
