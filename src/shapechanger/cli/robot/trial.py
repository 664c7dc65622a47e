"""Trials of a robot on its twin: drive at full throttle, inject a fault, judge by the ledger."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal, Self

from shapechanger.cli.robot.trial_driver import FAILURES, Driver
from shapechanger.errors import LinkError, RobotError, RobotRefused, ShapechangerError
from shapechanger.layout import Layout
from shapechanger.link.authentication import new_key
from shapechanger.link.messages import Role
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import GuardPlan, LimitPlan
from shapechanger.robot.profile.profile import Profile
from shapechanger.twin.camera import CameraFault
from shapechanger.twin.network import BadNetwork
from shapechanger.twin.oracle import (
    ExpectedCommand,
    Interval,
    propelled,
    time_to_rest,
    unauthorised,
)
from shapechanger.twin.robot import Operator, RunningRobot, run_robot
from shapechanger.twin.signals import Transition, read_ledger
from shapechanger.twin.start import start_board
from shapechanger.twin.wiring import TwinWiring

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


_ATTEMPTS: Final = 3
# Unlike a broken robot, a busy machine recovers.
_UNTIMELY_ATTEMPTS: Final = 10
_COMMANDS: Final = 4
_DRIVES_S: Final = 5.0
_STARTS_S: Final = 30.0
# Time after the promise for which everything must stay at rest.
_STAYS_S: Final = 0.3
_LOOK_S: Final = 0.01
# Tolerance beyond the deadline of a command.
_LATE_MS: Final = 20.0
# A supervisor gives up after five restarts within a minute, which would count as a kept promise.
_MOST_RESTARTS: Final = 4


class _NotDriven(RobotError):
    """The robot could not be driven."""


@dataclass(frozen=True, slots=True)
class TrialResult:
    """Result of one trial.

    Attributes:
        fault: Name of the fault.
        stopped_ms: Time from the fault to permanent rest, ms; infinite for never.
        limit_ms: The promised time, ms.
        drove: Whether it was driving at the fault; the trial is void otherwise.
        unauthorised: Times of propulsion without a fresh command.
    """

    fault: str
    stopped_ms: float
    limit_ms: float
    drove: bool
    unauthorised: tuple[Interval, ...]

    @property
    def kept(self) -> bool:
        """Return whether the promise was kept."""
        return self.drove and self.stopped_ms <= self.limit_ms and not self.unauthorised


def has(profile: Profile, needs: str) -> bool:
    """Return whether a robot has the part that a fault needs.

    Args:
        profile: The robot.
        needs: The part, as in `Fault.needs`.
    """
    return {
        "": True,
        "camera": profile.camera is not None,
        "bumper": any(sensor.measures == "bump" for sensor in profile.sensors),
        "button": profile.stop_pin is not None,
        "one-shot": profile.enable_pin is not None,
    }[needs]


class Trial:
    """A robot for successive trials.

    Args:
        profile: The robot.
        one_shot: Whether the one-shot of the enable line is fitted, where the profile has one.
    """

    def __init__(self, profile: Profile, *, one_shot: bool = True) -> None:
        self._profile = profile
        self._plan: GuardPlan = profile.guard_plan()
        self._one_shot_ms = float(self._plan.enable_hold_ms) if one_shot else None
        self._wiring = TwinWiring(self._plan, self._one_shot_ms)
        self._robot: RunningRobot | None = None
        self._restarts = 0
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Return the trial."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the robot."""
        self.close()

    def close(self) -> None:
        """Stop the robot and remove its files."""
        self._robot = None
        self._restarts = 0
        self._stack.close()

    def run(self, fault: Fault) -> TrialResult:
        """Drive, inject a fault, and judge by the ledger.

        A robot that cannot be driven, because a busy machine made it restart, is replaced first; so
        is one whose fault has an unknown time.

        Raises:
            RobotError: If no robot can be driven.
        """
        attempt = 0
        while True:
            attempt += 1
            robot = self._running()
            began_ns = time.monotonic_ns()
            try:
                with (
                    robot.operator() as operator,
                    BadNetwork(robot.port) as network,
                    self._driven(robot, operator, network, fault) as driver,
                ):
                    scene = Scene(robot, driver, network, operator)
                    result = self._tried(fault, scene, began_ns)
            except (_NotDriven, Untimely) as error:
                self.close()
                most = _UNTIMELY_ATTEMPTS if isinstance(error, Untimely) else _ATTEMPTS
                if attempt >= most:
                    raise RobotError(str(error)) from error
            else:
                self._recover(fault)
                return result

    @contextmanager
    def _driven(
        self, robot: RunningRobot, operator: Operator, network: BadNetwork, fault: Fault
    ) -> Generator[Driver]:
        """Return a driver of the robot."""
        try:
            calm(robot)
            operator.place(0)
            known = robot.known_at(f"127.0.0.1:{network.port}")
            driver = Driver(known, by_policy=fault.by_policy)
        except ShapechangerError as error:
            raise _NotDriven(str(error)) from error
        with driver:
            try:
                if fault.by_policy:
                    _arm_for_program(robot)
                driver.await_commands(_COMMANDS)
            except ShapechangerError as error:
                raise _NotDriven(str(error)) from error
            self._await_drive(operator)
            yield driver

    def _tried(self, fault: Fault, scene: Scene, began_ns: int) -> TrialResult:
        """Inject the fault and judge."""
        if fault.then == "starts afresh":
            scene.robot.forget_ready()
        at_ns = fault.make(scene)
        if not fault.harms:
            # The driver must still work, and the stop is measured by killing it.
            count = len(scene.driver.sent)
            scene.driver.await_commands(count + _COMMANDS)
            self._await_drive(scene.operator)
            at_ns = time.monotonic_ns()
            scene.driver.process.kill()
        limit_ms = fault.limit_ms(self._plan.limits)
        self._await_rest(scene.operator, limit_ms)
        result = self._judged(fault, began_ns, at_ns, limit_ms, scene.driver.sent)
        if fault.then != "is gone":
            fault.undo(scene)
        return result

    def _running(self) -> RunningRobot:
        if self._robot is None:
            folder = self._stack.enter_context(TemporaryDirectory(prefix="shapechanger-trial-"))
            # Separate, so that it outlives the robot's processes, as hardware does.
            board = start_board(
                self._plan,
                clock="real",
                folder=folder,
                camera=self._profile.camera,
                one_shot_ms=self._one_shot_ms,
            )
            self._stack.enter_context(board)
            self._robot = self._stack.enter_context(run_robot(self._profile, folder=Path(folder)))
        return self._robot

    def _recover(self, fault: Fault) -> None:
        if fault.then == "starts afresh" and self._robot is not None:
            self._robot.await_restart()
            self._restarts += 1
        if fault.then == "is gone" or self._restarts >= _MOST_RESTARTS:
            self.close()

    def _await_drive(self, operator: Operator) -> None:
        """Wait until it moves; a restored camera may take a while."""
        until_s = time.monotonic() + _DRIVES_S
        while time.monotonic() < until_s:
            outputs = self._wiring.read(operator.levels(), time.monotonic_ns())
            if not all(outputs[name].at_rest for name in self._wiring.propelling):
                return
            time.sleep(_LOOK_S)

    def _await_rest(self, operator: Operator, limit_ms: float) -> None:
        """Wait until the robot has been at rest for a while, or has broken its promise."""
        until_s = time.monotonic() + 10.0 * limit_ms / 1e3
        rest_since_s = math.inf
        while time.monotonic() < until_s:
            outputs = self._wiring.read(operator.levels(), time.monotonic_ns())
            if all(outputs[name].at_rest for name in self._wiring.propelling):
                rest_since_s = min(rest_since_s, time.monotonic())
                if time.monotonic() - rest_since_s >= _STAYS_S:
                    return
            else:
                rest_since_s = math.inf
            time.sleep(_LOOK_S)

    def _judged(
        self, fault: Fault, began_ns: int, at_ns: int, limit_ms: float, sent: list[int]
    ) -> TrialResult:
        ledger = read_ledger(self.ledger_path)
        at_ns = self._made_ns(fault, ledger, at_ns)
        moved = [i for i in propelled(ledger, self._wiring) if i.end_ns > began_ns]
        deadline_ms = self._plan.limits.deadline_ms
        commands = [
            ExpectedCommand(sent_ns, deadline_ms)
            for sent_ns in sent
            if not (fault.silences and sent_ns > at_ns + _LATE_MS * 1e6)
        ]
        # A fault of the guard itself has its own promised time.
        slack_ms = fault.within_ms if fault.guards_late else _LATE_MS
        strangers = unauthorised(ledger, self._wiring, commands, deadline_ms, slack_ms)
        return TrialResult(
            fault=fault.name,
            stopped_ms=1e3 * time_to_rest(ledger, self._wiring, at_ns),
            limit_ms=limit_ms,
            drove=any(i.start_ns < at_ns < i.end_ns for i in moved),
            unauthorised=tuple(i for i in strangers if i.end_ns > began_ns),
        )

    def _made_ns(self, fault: Fault, ledger: Sequence[Transition], at_ns: int) -> int:
        """Return the time of a fault, ns.

        What the board makes begins with its line of the ledger: the edge of the button or bumper,
        or the failure of the camera. Until then the request waits for this process and the board,
        neither of which is part of a robot.

        Args:
            fault: The fault.
            ledger: Transitions, ordered by time.
            at_ns: When this process made it, or asked the board to make it.
        """
        plan = self._plan
        switches = (one for one in plan.sensors if one.driver == "switch")
        pins: dict[str, Sequence[int | None]] = {
            "bumper": [pin for one in switches for pin in one.settings["pins"]],
            "button": [plan.stop_pin],
        }
        if fault.needs == "camera":
            made = (line.t for line in ledger if line.kind == "fault")
        else:
            edges = (line for line in ledger if line.kind == "input")
            made = (line.t for line in edges if line.pin in pins.get(fault.needs, ()))
        return next((t for t in made if t >= at_ns), at_ns)

    @property
    def ledger_path(self) -> Path:
        """Return the ledger of the running robot.

        Raises:
            RobotError: If no robot runs.
        """
        return self._running().ledger_path


def _arm_for_program(robot: RunningRobot) -> None:
    """Arm the robot as a person, once a program has control."""
    until_s = time.monotonic() + _STARTS_S
    with robot.client(role="person", frames=False, name="trial") as person:
        while not person.ask().message.holder:
            if time.monotonic() > until_s:
                raise RobotError("The policy did not take control.")
            time.sleep(_LOOK_S)
        person.arm()


def calm(robot: RunningRobot) -> None:
    """Clear the state of the last trial: an emergency stop, or being armed."""
    with robot.client(role="person", frames=False, name="trial") as person:
        person.take()
        person.arm()
        person.disarm()
        person.release()
        person.ping()
