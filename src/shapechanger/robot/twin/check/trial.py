"""Trials of faults: drive, let a fault happen, judge by the pins; and the levels of a check."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import Final, Literal

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.check.pins import SHOWN_S, lamp_checks, lamps_of
from shapechanger.robot.check.report import Finding, Results, judged, run_checks
from shapechanger.robot.check.standing import StandingRobot, examine
from shapechanger.robot.twin.check.bench import Bench, Watcher
from shapechanger.robot.twin.check.driver import Driver
from shapechanger.robot.twin.check.driving import check_driving
from shapechanger.robot.twin.check.faults import FAULTS, Fault, NotTried, Scene
from shapechanger.robot.twin.judge import (
    ExpectedCommand,
    Interval,
    propelled,
    time_to_rest,
    unauthorised,
)
from shapechanger.robot.twin.network import BadNetwork
from shapechanger.robot.twin.robot import RunningRobot
from shapechanger.robot.twin.signals import Transition, read_ledger

_ATTEMPTS: Final = 3
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


@dataclass(frozen=True, slots=True)
class TrialResult:
    """Result of one trial.

    Attributes:
        stopped_ms: Time from the fault to permanent rest, ms; infinite for never, NaN if nothing
            measures it.
        limit_ms: The promised time, ms.
        drove: Whether it was driving at the fault; the trial is void otherwise.
        unauthorised: Times of propulsion without a fresh command; empty without a ledger.
        answer: Whether a person saw it drive and stop; None if nobody was asked, or answered.
    """

    stopped_ms: float
    limit_ms: float
    drove: bool
    unauthorised: tuple[Interval, ...] = ()
    answer: bool | None = None

    @property
    def kept(self) -> bool:
        """Whether the promise was kept."""
        return self.drove and self.stopped_ms <= self.limit_ms and not self.unauthorised


def run_trial(bench: Bench, fault: Fault) -> TrialResult:
    """Drive, let a fault happen, and judge.

    A robot that cannot be driven, because a busy machine made it restart, is replaced first; so is
    one whose fault has an unknown time.
    """
    attempt = 0
    while True:
        attempt += 1
        try:
            result = _try(bench, fault)
        except NotTried as error:
            _replace(bench)
            if attempt >= error.attempts:
                raise
            continue
        if fault.then == "starts afresh":
            bench.robot().await_restart()
            bench.restarts += 1
        if fault.then == "is gone" or bench.restarts >= _MOST_RESTARTS:
            _replace(bench)
        return result


def _replace(bench: Bench) -> None:
    """End the robot; the next trial begins with a new one."""
    if failures := bench.close():
        raise RobotError(f"Not everything is at rest: {' '.join(failures)}")


def _try(bench: Bench, fault: Fault) -> TrialResult:
    robot = bench.robot()
    began_ns = time.monotonic_ns()
    limit_ms = fault.limit_ms(bench.plan.limits)
    with ExitStack() as opened:
        twin = opened.enter_context(robot.operator()) if bench.twin else None
        network = opened.enter_context(BadNetwork(robot.port))
        watcher = opened.enter_context(closing(bench.watcher()))
        try:
            _calm(robot)
            if twin is not None:
                twin.place(0)
            known = robot.known_at(f"127.0.0.1:{network.port}")
            pilot = bench.pilot if fault.by_policy else ""
            driver = opened.enter_context(Driver(known, pilot=pilot))
            if fault.by_policy:
                _arm_for_program(robot)
            driver.await_commands(_COMMANDS)
        except ShapechangerError as error:
            raise NotTried(str(error), _ATTEMPTS) from error
        _await_drive(watcher)
        drove = watcher.moves() is not False
        if fault.then == "starts afresh":
            robot.forget_ready()
        called_ns = time.monotonic_ns()
        at_ns = fault.make(Scene(robot, driver, network, opened, twin))
        at_ns = called_ns if at_ns is None else at_ns
        if not fault.harms:
            # The driver must still work, and the stop is measured by killing it.
            driver.await_commands(len(driver.sent) + _COMMANDS)
            _await_drive(watcher)
            at_ns = time.monotonic_ns()
            driver.process.kill()
        _await_rest(watcher, limit_ms)
        if twin is not None:
            result = _judged(bench, fault, began_ns, at_ns, driver.sent)
            fault.repair(twin)
            return result
        stopped_ms = watcher.rest_ms(at_ns)
        answer = None
        if math.isnan(stopped_ms):  # Asked before anything else puts the LEDs out.
            question = "Did a motor's LED light up, and are all of them out now"
            answer = bench.ask(f"{question} ({fault.name})?")
        return TrialResult(stopped_ms, limit_ms, drove, answer=answer)


def _calm(robot: RunningRobot) -> None:
    """Clear the state of the last trial: an emergency stop, or being armed."""
    with robot.client(role="person", frames=False, name="trial") as person:
        person.take()
        person.arm()
        person.disarm()
        person.release()
        person.ping()


def _arm_for_program(robot: RunningRobot) -> None:
    """Arm the robot as a person, once a program has control."""
    until_s = time.monotonic() + _STARTS_S
    with robot.client(role="person", frames=False, name="trial") as person:
        while not person.ask().message.holder:
            if time.monotonic() > until_s:
                raise RobotError("The policy did not take control.")
            time.sleep(_LOOK_S)
        person.arm()


def _await_drive(watcher: Watcher) -> None:
    """Wait until it moves; a restored camera may take a while."""
    if watcher.moves() is None:
        time.sleep(SHOWN_S)  # For a person to see it.
    until_s = time.monotonic() + _DRIVES_S
    while watcher.moves() is False and time.monotonic() < until_s:
        time.sleep(_LOOK_S)


def _await_rest(watcher: Watcher, limit_ms: float) -> None:
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
    bench: Bench, fault: Fault, began_ns: int, at_ns: int, sent: Sequence[int]
) -> TrialResult:
    """Judge a trial on a twin by its ledger."""
    ledger, limits = read_ledger(bench.board().ledger_path), bench.plan.limits
    at_ns = _made_ns(bench, fault, ledger, at_ns)
    commands = [
        ExpectedCommand(sent_ns, limits.deadline_ms)
        for sent_ns in sent
        if not (fault.silences and sent_ns > at_ns + _LATE_MS * 1e6)
    ]
    # A fault of the guard itself has its own promised time.
    slack_ms = fault.within_ms if fault.guards_late else _LATE_MS
    strangers = unauthorised(ledger, bench.wiring, commands, limits.deadline_ms, slack_ms)
    moved = propelled(ledger, bench.wiring)
    return TrialResult(
        stopped_ms=1e3 * time_to_rest(ledger, bench.wiring, at_ns),
        limit_ms=fault.limit_ms(limits),
        drove=any(i.start_ns < at_ns < i.end_ns for i in moved),
        unauthorised=tuple(i for i in strangers if i.end_ns > began_ns),
    )


def _made_ns(bench: Bench, fault: Fault, ledger: Sequence[Transition], at_ns: int) -> int:
    """Return the time of a fault, ns.

    A fault that the board makes begins with its line of the ledger: the edge of the button or
    bumper, or the failure of the camera. Until then the request waits for this process and the
    board, neither of which is part of a robot.
    """
    match fault.needs:
        case "camera":
            made = [line.t for line in ledger if line.kind == "fault"]
        case "bumper" | "button":
            pins = [bench.plan.stop_pin]
            if fault.needs == "bumper":
                switches = [one for one in bench.plan.sensors if one.driver == "switch"]
                pins = [pin for one in switches for pin in one.settings["pins"]]
            made = [line.t for line in ledger if line.kind == "input" and line.pin in pins]
        case _:
            made = []
    return next((t for t in made if t >= at_ns), at_ns)


def lacks(bench: Bench, need: str) -> str:
    """Return why a fault is not tried; "" if the robot has what it needs."""
    profile = bench.profile
    has = {
        "camera": profile.camera is not None,
        "bumper": any(sensor.measures == "bump" for sensor in profile.sensors),
        "button": profile.stop_pin is not None,
        # Pins without it are tried, too: whoever has fitted none learns what then happens.
        "one-shot": profile.enable_pin is not None or not bench.twin,
        "throttle": any(one.name == "throttle" and one.propels for one in profile.actions),
    }
    return "" if has.get(need, True) else f"This robot has no {need}."


def fault_results(bench: Bench, fault: Fault, trials: int) -> Results:
    """Try a fault as often as asked, and yield one result."""
    if why := lacks(bench, "throttle") or lacks(bench, fault.needs):
        yield "unknown", why
        return
    try:
        results = [_moving(bench, fault) for _ in range(trials)]
    except ShapechangerError as error:
        # The next robot begins at rest.
        yield "bad", " ".join([str(error), *bench.close()])
        return
    promised = f"{results[0].limit_ms:.0f} ms are promised"
    times = sorted(result.stopped_ms for result in results)
    answers = {result.answer for result in results}
    if not all(result.drove for result in results):
        yield "bad", "It did not drive before the fault."
    elif not any(map(math.isnan, times)):
        stopped = f"{times[len(times) // 2]:.0f} ms later"
        if len(times) > 1:
            stopped += f", and at most {times[-1]:.0f} ms in {len(times)} trials"
        stopped = "never" if math.isinf(times[-1]) else stopped
        strangers = sum(len(result.unauthorised) for result in results)
        moved = f" It moved {strangers} times without a fresh command." if strangers else ""
        good = all(result.kept for result in results)
        yield judged(good, f"At rest {stopped}; {promised}.{moved}")
    elif answers == {None}:
        yield "unknown", f"Not measured: a wire to a free pin does, with --probe; {promised}."
    else:
        otherwise = "NOT lit, or NOT out afterwards."
        yield judged(answers == {True}, "The LEDs were lit, and then out.", otherwise)


def _moving(bench: Bench, fault: Fault) -> TrialResult:
    """Run a trial, and repeat it if the robot was not moving before the fault."""
    result = run_trial(bench, fault)
    for _ in range(_MORE_TRIES):
        if result.drove or result.unauthorised:
            break
        result = run_trial(bench, fault)
    return result


CheckLevel = Literal["wiring", "plain", "leds", "faults"]
Part = Literal["wiring", "LEDs", "driving", "faults"]

_PARTS: Final[dict[CheckLevel, tuple[Part, ...]]] = {
    "wiring": ("wiring",),
    "plain": ("wiring", "driving"),
    "leds": ("wiring", "LEDs", "driving", "faults"),
    "faults": ("faults",),
}
"""Parts of each level. Nothing moves in the first part; all others drive outputs."""

# Longer than two cycles of software PWM at 50 Hz.
_MEASURED_S: Final = 0.04


def require_level(level: CheckLevel, bench: Bench) -> None:
    """Refuse a level that a robot cannot have."""
    if level == "leds":
        lamps_of(bench.plan)
    if level == "faults" and lacks(bench, "throttle"):
        name = bench.profile.name
        raise RobotError(f"Nothing of {name} propels, so there is nothing to stop.")


def check_robot(
    level: CheckLevel, bench: Bench, standing: StandingRobot, *, cap: float, trials: int = 1
) -> Iterator[tuple[Part, Iterator[Finding]]]:
    """Yield each part of a level, and its findings, before its first question.

    Args:
        level: The level.
        bench: The robot, and where it is.
        standing: The robot for the checks that move nothing.
        cap: Largest throttle of the checks that drive, 0 to 1.
        trials: Trials of each fault.
    """
    faults = [fault for fault in FAULTS.values() if level == "faults" or fault.on_pins]
    parts: dict[Part, Iterator[Finding]] = {
        "wiring": examine(standing),
        "LEDs": _light_lamps(bench),
        "driving": _drive(bench, cap),
        "faults": run_checks((one.name, fault_results(bench, one, trials)) for one in faults),
    }
    for part in _PARTS[level]:
        yield part, _leaving_at_rest(bench, parts[part])


def _light_lamps(bench: Bench) -> Iterator[Finding]:
    with closing(bench.watcher()) as watcher:
        shown_s = SHOWN_S if type(watcher) is Watcher else _MEASURED_S
        checks = lamp_checks(bench.plan, bench.pins, bench.ask, watcher.sees, shown_s)
        yield from run_checks(checks)


def _drive(bench: Bench, cap: float) -> Iterator[Finding]:
    with bench.robot() as served:
        yield from check_driving(served, bench.profile, cap)


def _leaving_at_rest(bench: Bench, findings: Iterator[Finding]) -> Iterator[Finding]:
    try:
        yield from findings
    finally:
        failures = bench.close()
    if failures:
        yield Finding("safe pins", "bad", " ".join(failures))
