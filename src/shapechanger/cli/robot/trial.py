"""Trials of a robot on its twin: drive at full throttle, inject a fault, judge by the ledger."""

from __future__ import annotations

import math
import time
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Self

from shapechanger.cli.robot.faults import Fault, Scene, Untimely
from shapechanger.cli.robot.trial_driver import Driver
from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.profile.profile import Profile
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
