"""Trials of a robot: drive, inject a fault, judge by the pins; and the levels of a check."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal, Self

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.check.check import Check, Finding, Results, judged, run_checks
from shapechanger.robot.check.computer import examine
from shapechanger.robot.check.pins import SHOWN_S, Ask, lamps_of, walk
from shapechanger.robot.check.wiring import StandingRobot
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.check.bench import Bench, Watcher
from shapechanger.robot.twin.check.driver import Driver
from shapechanger.robot.twin.check.driving import check_driving
from shapechanger.robot.twin.check.faults import FAULTS, Fault, Scene, Untimely
from shapechanger.robot.twin.judge import (
    ExpectedCommand,
    Interval,
    propelled,
    time_to_rest,
    unauthorised,
)
from shapechanger.robot.twin.network import BadNetwork
from shapechanger.robot.twin.robot import Operator, RunningRobot
from shapechanger.robot.twin.signals import Transition, read_ledger

_ATTEMPTS: Final = 3
# Unlike a broken robot, a busy machine recovers.
_UNTIMELY_ATTEMPTS: Final = 10
# Retries of a trial in which the robot was not moving before the fault.
_MORE_TRIES: Final = 2
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
        stopped_ms: Time from the fault to permanent rest, ms; infinite for never, NaN where nothing
            measures it.
        limit_ms: The promised time, ms.
        drove: Whether it was driving at the fault; the trial is void otherwise.
        unauthorised: Times of propulsion without a fresh command; empty where nothing has a ledger.
        answer: Whether a person saw it drive and stop; None if nobody was asked, or answered.
    """

    fault: str
    stopped_ms: float
    limit_ms: float
    drove: bool
    unauthorised: tuple[Interval, ...]
    answer: bool | None = None

    @property
    def kept(self) -> bool:
        """Return whether the promise was kept."""
        return self.drove and self.stopped_ms <= self.limit_ms and not self.unauthorised


class Trial:
    """A robot for successive trials."""

    def __init__(
        self,
        bench: Bench | Profile,
        *,
        pilot: str = "",
        trials: int = 1,
        ask: Ask = lambda _: None,
    ) -> None:
        self.bench = Bench(bench) if isinstance(bench, Profile) else bench
        self._plan = self.bench.plan
        self._pilot = pilot
        self._trials = trials
        self.ask = ask
        self._restarts = 0

    def __enter__(self) -> Self:
        """Return the trial."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the robot."""
        self.close()

    def close(self) -> None:
        """Stop the robot and remove its files."""
        self._restarts = 0
        if failures := self.bench.close():
            raise RobotError(f"Not everything is at rest: {' '.join(failures)}")

    def lacks(self, need: str) -> str:
        """Return why a fault is not tried; "" if the robot has what it needs."""
        profile = self.bench.profile
        has = {
            "camera": profile.camera is not None,
            "bumper": any(sensor.measures == "bump" for sensor in profile.sensors),
            "button": profile.stop_pin is not None,
            # Pins without it are tried, too: whoever has fitted none learns what then happens.
            "one-shot": profile.enable_pin is not None or not self.bench.twin,
            "throttle": any(one.name == "throttle" and one.propels for one in profile.actions),
        }
        return "" if has.get(need, True) else f"This robot has no {need}."

    def results(self, fault: Fault) -> Results:
        """Try a fault as often as asked, and yield one result."""
        if why := self.lacks("throttle") or self.lacks(fault.needs):
            yield "unknown", why
            return
        try:
            results = [self._moving(fault) for _ in range(self._trials)]
        except ShapechangerError as error:
            # Whatever it left, the next robot begins at rest.
            self._restarts = 0
            yield "bad", " ".join([str(error), *self.bench.close()])
            return
        promised = f"{results[0].limit_ms:.0f} ms are promised"
        times = sorted(result.stopped_ms for result in results)
        if not all(result.drove for result in results):
            yield "bad", "It did not drive before the fault."
        elif any(map(math.isnan, times)):
            answers = {result.answer for result in results}
            if answers == {None}:
                words = f"Not measured: a wire to a free pin does, with --probe; {promised}."
                yield "unknown", words
            else:
                words = "The LEDs were lit, and then out."
                lit = answers == {True}
                yield judged(lit, words if lit else "NOT lit, or NOT out afterwards.")
        else:
            words = f"{times[len(times) // 2]:.0f} ms later"
            if len(times) > 1:
                words += f", and at most {times[-1]:.0f} ms in {len(times)} trials"
            words = "never" if math.isinf(times[-1]) else words
            strangers = sum(len(result.unauthorised) for result in results)
            moved = f" It moved {strangers} times without a fresh command." if strangers else ""
            good = all(result.kept for result in results)
            yield judged(good, f"At rest {words}; {promised}.{moved}")

    def _moving(self, fault: Fault) -> TrialResult:
        """Run a trial, and repeat it if the robot was not moving before the fault."""
        result = self.run(fault)
        for _ in range(_MORE_TRIES):
            if result.drove or result.unauthorised:
                break
            result = self.run(fault)
        return result

    def run(self, fault: Fault) -> TrialResult:
        """Drive, inject a fault, and judge.

        A robot that cannot be driven, because a busy machine made it restart, is replaced first; so
        is one whose fault has an unknown time.
        """
        attempt = 0
        while True:
            attempt += 1
            robot = self.bench.robot()
            began_ns = time.monotonic_ns()
            try:
                with ExitStack() as opened:
                    twin = opened.enter_context(robot.operator()) if self.bench.twin else None
                    network = opened.enter_context(BadNetwork(robot.port))
                    watcher = opened.enter_context(closing(self.bench.watcher()))
                    driver = self._drive(opened, twin, network, fault)
                    self._await_drive(watcher)
                    scene = Scene(robot, driver, network, twin)
                    result = self._tried(fault, scene, watcher, began_ns)
            except (_NotDriven, Untimely) as error:
                self.close()
                most = _UNTIMELY_ATTEMPTS if isinstance(error, Untimely) else _ATTEMPTS
                if attempt >= most:
                    raise RobotError(str(error)) from error
            else:
                self._recover(fault)
                return result

    def _drive(
        self, opened: ExitStack, twin: Operator | None, network: BadNetwork, fault: Fault
    ) -> Driver:
        """Start a driver, and wait until it has sent some commands."""
        robot = self.bench.robot()
        try:
            _calm(robot)
            if twin is not None:
                twin.place(0)
            known = robot.known_at(f"127.0.0.1:{network.port}")
            pilot = self._pilot if fault.by_policy else ""
            driver = opened.enter_context(Driver(known, pilot=pilot))
            if fault.by_policy:
                _arm_for_program(robot)
            driver.await_commands(_COMMANDS)
        except ShapechangerError as error:
            raise _NotDriven(str(error)) from error
        return driver

    def _tried(self, fault: Fault, scene: Scene, watcher: Watcher, began_ns: int) -> TrialResult:
        """Inject the fault and judge."""
        drove = watcher.moves() is not False
        if fault.then == "starts afresh":
            scene.robot.forget_ready()
        at_ns = fault.make(scene)
        if not fault.harms:
            # The driver must still work, and the stop is measured by killing it.
            count = len(scene.driver.sent)
            scene.driver.await_commands(count + _COMMANDS)
            self._await_drive(watcher)
            at_ns = time.monotonic_ns()
            scene.driver.process.kill()
        limit_ms = fault.limit_ms(self._plan.limits)
        self._await_rest(watcher, limit_ms)
        if self.bench.twin:
            result = self._judged(fault, began_ns, at_ns, limit_ms, scene.driver.sent)
        else:
            stopped_ms = watcher.rest_ms(at_ns)
            answer = None
            if math.isnan(stopped_ms):  # Asked before anything else puts the LEDs out.
                question = "Did a motor's LED light up, and are all of them out now"
                answer = self.ask(f"{question} ({fault.name})?")
            result = TrialResult(fault.name, stopped_ms, limit_ms, drove, (), answer)
        if fault.then != "is gone":
            fault.undo(scene)
        return result

    def _recover(self, fault: Fault) -> None:
        if fault.then == "starts afresh":
            self.bench.robot().await_restart()
            self._restarts += 1
        if fault.then == "is gone" or self._restarts >= _MOST_RESTARTS:
            self.close()

    def _await_drive(self, watcher: Watcher) -> None:
        """Wait until it moves; a restored camera may take a while."""
        if watcher.moves() is None:
            time.sleep(SHOWN_S)  # For a person to see it.
        until_s = time.monotonic() + _DRIVES_S
        while watcher.moves() is False and time.monotonic() < until_s:
            time.sleep(_LOOK_S)

    def _await_rest(self, watcher: Watcher, limit_ms: float) -> None:
        """Wait until the robot has been at rest for a while, or has broken its promise."""
        if watcher.moves() is None:
            time.sleep(limit_ms / 1e3 + _STAYS_S)
            return
        until_s = time.monotonic() + 10.0 * limit_ms / 1e3
        moved_s = time.monotonic()
        while time.monotonic() < min(until_s, moved_s + _STAYS_S):
            if watcher.moves():
                moved_s = time.monotonic()
            time.sleep(_LOOK_S)

    def _judged(
        self, fault: Fault, began_ns: int, at_ns: int, limit_ms: float, sent: list[int]
    ) -> TrialResult:
        ledger = read_ledger(self.ledger_path)
        at_ns = self._made_ns(fault, ledger, at_ns)
        moved = [i for i in propelled(ledger, self.bench.wiring) if i.end_ns > began_ns]
        deadline_ms = self._plan.limits.deadline_ms
        commands = [
            ExpectedCommand(sent_ns, deadline_ms)
            for sent_ns in sent
            if not (fault.silences and sent_ns > at_ns + _LATE_MS * 1e6)
        ]
        # A fault of the guard itself has its own promised time.
        slack_ms = fault.within_ms if fault.guards_late else _LATE_MS
        strangers = unauthorised(ledger, self.bench.wiring, commands, deadline_ms, slack_ms)
        return TrialResult(
            fault=fault.name,
            stopped_ms=1e3 * time_to_rest(ledger, self.bench.wiring, at_ns),
            limit_ms=limit_ms,
            drove=any(i.start_ns < at_ns < i.end_ns for i in moved),
            unauthorised=tuple(i for i in strangers if i.end_ns > began_ns),
        )

    def _made_ns(self, fault: Fault, ledger: Sequence[Transition], at_ns: int) -> int:
        """Return the time of a fault, ns.

        What the board makes begins with its line of the ledger: the edge of the button or bumper,
        or the failure of the camera. Until then the request waits for this process and the board,
        neither of which is part of a robot.
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
        """Return the ledger of the twin."""
        return self.bench.board().ledger_path


def _arm_for_program(robot: RunningRobot) -> None:
    """Arm the robot as a person, once a program has control."""
    until_s = time.monotonic() + _STARTS_S
    with robot.client(role="person", frames=False, name="trial") as person:
        while not person.ask().message.holder:
            if time.monotonic() > until_s:
                raise RobotError("The policy did not take control.")
            time.sleep(_LOOK_S)
        person.arm()


def _calm(robot: RunningRobot) -> None:
    """Clear the state of the last trial: an emergency stop, or being armed."""
    with robot.client(role="person", frames=False, name="trial") as person:
        person.take()
        person.arm()
        person.disarm()
        person.release()
        person.ping()


def fault_checks(trial: Trial, *, all_faults: bool) -> list[Check]:
    """Return the faults as checks.

    Args:
        trial: The robot.
        all_faults: Whether to try all, and not only those that a bench with LEDs can have.
    """
    return [
        Check(fault.name, partial(trial.results, fault))
        for fault in FAULTS.values()
        if all_faults or fault.on_pins
    ]


CheckLevel = Literal["wiring", "plain", "leds", "faults"]
Part = Literal["wiring", "LEDs", "driving", "faults"]

PARTS: Final[dict[CheckLevel, tuple[Part, ...]]] = {
    "wiring": ("wiring",),
    "plain": ("wiring", "driving"),
    "leds": ("wiring", "LEDs", "driving", "faults"),
    "faults": ("faults",),
}
"""Parts of each level. Nothing moves in the first part; all others drive outputs."""

# Longer than two cycles of software PWM at 50 Hz.
_MEASURED_S: Final = 0.04


def require_level(level: CheckLevel, trial: Trial) -> None:
    """Refuse a level that a robot cannot have."""
    profile = trial.bench.profile
    if level == "leds":
        lamps_of(trial.bench.plan)
    if level == "faults" and trial.lacks("throttle"):
        raise RobotError(f"Nothing of {profile.name} propels, so there is nothing to stop.")


def check_robot(
    level: CheckLevel, trial: Trial, standing: StandingRobot, cap: float
) -> Iterator[tuple[Part, Iterator[Finding]]]:
    """Yield each part of a level, and its findings, before its first question.

    Args:
        level: The level.
        trial: The robot for the faults, and where it is.
        standing: The robot for the checks that move nothing.
        cap: Largest throttle of the checks that drive, 0 to 1.
    """
    for part in PARTS[level]:
        yield part, _findings(part, level, trial, standing, cap)


def _findings(
    part: Part, level: CheckLevel, trial: Trial, standing: StandingRobot, cap: float
) -> Iterator[Finding]:
    """Yield the findings of a part, and leave everything at rest."""
    bench = trial.bench
    try:
        match part:
            case "wiring":
                robot = replace(standing, hardware=bench.pins, on_twin=bench.twin)
                yield from examine(robot)
            case "LEDs":
                with closing(bench.watcher()) as watcher:
                    shown_s = SHOWN_S if type(watcher) is Watcher else _MEASURED_S
                    yield from walk(bench.plan, bench.pins, trial.ask, watcher.sees, shown_s)
            case "driving":
                with bench.robot() as served:
                    yield from check_driving(served, bench.profile, cap)
            case "faults":
                yield from run_checks(fault_checks(trial, all_faults=level == "faults"))
    finally:
        failures = bench.close()
    if failures:
        yield Finding("safe pins", "bad", " ".join(failures))
