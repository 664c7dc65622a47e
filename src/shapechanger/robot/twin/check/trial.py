"""Trials of faults, which drive, cause a fault and evaluate the pins; and levels of checks."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

from shapechanger.errors import RobotError, ShapechangerError, translate_errors
from shapechanger.robot.check.pins import SHOWN_S, Ask, BenchLamp, check_lamps, lamps_of, probed_pin
from shapechanger.robot.check.report import Finding, Level, judged
from shapechanger.robot.check.standing import StandingRobot, examine
from shapechanger.robot.drivers.pins import EdgeInput
from shapechanger.robot.drivers.simulation import PwmChannel
from shapechanger.robot.guard.outputs import make_safe
from shapechanger.robot.hardware import Hardware
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.check.driver import Driver
from shapechanger.robot.twin.check.driving import check_driving
from shapechanger.robot.twin.check.faults import FAULTS, BadNetwork, Fault, NotTried, Scene
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.ledger import (
    Interval,
    TwinWiring,
    propelled,
    read_ledger,
    time_to_rest,
    unauthorised,
)
from shapechanger.robot.twin.operator import Operator
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from shapechanger.robot.twin.start import BoardAt, start_board

# Longest low time of software PWM while a motor runs: two cycles at 50 Hz.
_PWM_S: Final = 0.04


class Watcher:
    """Measures the outputs independently of the robot's programs; this base class cannot."""

    def sees(self, lamp: BenchLamp) -> bool | None:
        """Return whether an LED is lit, or None if it cannot be measured."""

    def moves(self) -> bool | None:
        """Return whether a propelling output is driven now, or None if it cannot be measured."""

    def rest_ms(self, at_ns: int) -> float:
        """Return the time from `at_ns` to rest, ms; infinite if it still moves, NaN if unknown."""
        del at_ns
        return math.nan

    def close(self) -> None:
        """Stop watching."""


class _BoardWatcher(Watcher):
    """Reads the levels of a twin."""

    def __init__(self, board: BoardAt, wiring: TwinWiring) -> None:
        self._wiring = wiring
        self._operator = Operator(board.socket_path)
        self.close = self._operator.close

    def sees(self, lamp: BenchLamp) -> bool | None:
        levels = self._operator.levels()
        if lamp.pin is not None:
            return levels.duties.get(lamp.pin, 0.0) > 0.0
        settings = lamp.output.settings if lamp.output else {}
        channel = PwmChannel(*(settings[key] for key in ("bus", "address", "channel")))
        return channel in levels.channels and levels.channels[channel].us > 0.0

    def moves(self) -> bool:
        outputs = self._wiring.read(self._operator.levels(), time.monotonic_ns())
        return not all(outputs[name].at_rest for name in self._wiring.propelling)


class _ProbeWatcher(Watcher):
    """Watches a motor's pin through a wire to a free pin, with a delay of about a millisecond."""

    def __init__(self, probe: int, probed: int, hardware: Hardware) -> None:
        self._probed = probed
        self._last_ns = 0
        self._hardware = hardware
        self._input = EdgeInput(probe, "down", hardware.pin_factory(), self._changed)

    def sees(self, lamp: BenchLamp) -> bool | None:
        return self.moves() if lamp.pin == self._probed else None

    def moves(self) -> bool:
        return bool(self._input.level) or time.monotonic_ns() - self._last_ns < _PWM_S * 1e9

    def rest_ms(self, at_ns: int) -> float:
        return math.inf if self._input.level else max(0.0, (self._last_ns - at_ns) / 1e6)

    def close(self) -> None:
        self._input.close()
        self._hardware.close()

    def _changed(self, at_s: float, level: int) -> None:
        del at_s, level  # The clock of lgpio's times is undocumented, so use another one.
        self._last_ns = time.monotonic_ns()


@dataclass
class Bench:
    """A robot to check, on its twin or on the pins of this machine, until `close`."""

    profile: Profile
    _: KW_ONLY
    twin: bool = True  # Whether to check the robot's twin.
    one_shot: bool = True  # Whether to simulate the one-shot of the enable line, if there is one.
    probe: int | None = None  # Free BCM pin, wired to the pin of the motor that drives forward.
    arguments: tuple[str, ...] = ()  # Further arguments of `serve`.
    pilot: str = ""  # Module of the program that drives as a policy on board; see `Driver`.
    ask: Ask = lambda _: None  # Function that asks a person.
    restarts: int = field(default=0, init=False)  # Restarts of the robot since it was served.

    def __post_init__(self) -> None:
        if self.twin and self.probe is not None:
            raise RobotError("A twin needs no --probe: its ledger has every change of a pin.")
        self._probed = None if self.probe is None else probed_pin(self.profile, self.probe)
        self._one_shot_ms = float(self.profile.enable_hold_ms) if self.one_shot else None
        self.wiring = TwinWiring(self.profile, self._one_shot_ms)
        self._stack = ExitStack()

    @cached_property
    def board(self) -> BoardAt:
        """Board of the twin; it outlives the robot's processes, as hardware does."""
        folder = self._stack.enter_context(TemporaryDirectory(prefix="shapechanger-check-"))
        board = start_board(
            self.profile.guard_plan(),
            clock="real",
            folder=Path(folder),
            camera=self.profile.camera,
            one_shot_ms=self._one_shot_ms,
        )
        return self._stack.enter_context(board)

    @cached_property
    def robot(self) -> RunningRobot:
        """The robot; it is served on first use."""
        folder = self.board.folder if self.twin else None
        served = run_robot(self.profile, twin=self.twin, folder=folder, arguments=self.arguments)
        return self._stack.enter_context(served)

    def pins(self) -> Hardware:
        """Open the pins and buses."""
        return connect(self.board.socket_path) if self.twin else Hardware()

    def watcher(self) -> Watcher:
        """Open a watcher of the outputs."""
        if self.twin:
            return _BoardWatcher(self.board, self.wiring)
        if self.probe is None or self._probed is None:
            return Watcher()
        return _ProbeWatcher(self.probe, self._probed, Hardware())

    def close(self) -> list[str]:
        """End robot and board, put pins at rest if they were used, and return the failures."""
        was_served = vars(self).pop("robot", None) is not None
        vars(self).pop("board", None)
        self.restarts = 0
        self._stack.close()
        if self.twin or not was_served:
            return []
        with closing(Hardware()) as hardware:
            return make_safe(self.profile, hardware)

    def lacks(self, need: str) -> str:
        """Return why a fault cannot be tried, or "" if the robot has the required part."""
        profile = self.profile
        has = {
            "camera": profile.camera is not None,
            "bumper": any(sensor.measures == "bump" for sensor in profile.sensors),
            "button": profile.stop_pin is not None,
            # On real pins this fault is tried even without a one-shot, to show its effect then.
            "one-shot": profile.enable_pin is not None or not self.twin,
            "throttle": any(one.name == "throttle" and one.propels for one in profile.actions),
        }
        return "" if has.get(need, True) else f"This robot has no {need}."


# Number of restarts after which the robot is replaced. A supervisor gives up after five restarts
# within a minute; the robot would then be at rest, and a trial would wrongly count as a success.
_MOST_RESTARTS: Final = 4
# Number of attempts to cause a fault. A busy machine may restart a robot or delay a fault.
_ATTEMPTS: Final = 10
# Most trials for each requested one; a trial only counts if the robot moved before the fault.
_TRIES: Final = 3
_COMMANDS: Final = 4
_DRIVES_S: Final = 5.0
_STARTS_S: Final = 30.0
# Time after the promised time for which all outputs must stay at rest.
_STAYS_S: Final = 0.3
_LOOK_S: Final = 0.01
# Tolerance of the deadline of a command, ms.
_LATE_MS: Final = 20.0


@dataclass(frozen=True, slots=True)
class TrialResult:
    """Result of one trial."""

    # Time from the fault to permanent rest, ms; infinite for never, NaN if not measured.
    stopped_ms: float
    limit_ms: float  # The promised time, ms.
    drove: bool  # Whether the robot drove at the time of the fault; otherwise the trial is void.
    # Intervals of propulsion without a valid command; empty on real pins.
    unauthorised: tuple[Interval, ...] = ()
    answer: bool | None = None  # Whether a person saw the robot drive and stop; None if unknown.

    @property
    def kept(self) -> bool:
        """Whether the promise was kept."""
        return self.drove and self.stopped_ms <= self.limit_ms and not self.unauthorised


def run_trials(bench: Bench, fault: Fault, trials: int) -> Iterator[TrialResult]:
    """Drive, cause the fault and evaluate, until the robot has driven in `trials` trials.

    At most three times as many trials are made. If a busy machine restarts the robot or delays the
    fault, the trial is repeated with a new robot; the tenth such failure in a row is raised.
    """
    drove = tried = not_tried = 0
    while drove < trials and tried < _TRIES * trials:
        try:
            result = _try(bench, fault)
        except NotTried:
            not_tried += 1
            if not_tried == _ATTEMPTS:
                raise
            _replace(bench)
            continue
        tried, not_tried = tried + 1, 0
        drove += result.drove
        if fault.then == "starts afresh":
            bench.robot.await_restart()
            bench.restarts += 1
        if fault.then == "is gone" or bench.restarts >= _MOST_RESTARTS:
            _replace(bench)
        yield result


def _replace(bench: Bench) -> None:
    """End the robot; the next trial begins with a new one."""
    if failures := bench.close():
        raise RobotError(f"Not everything is at rest: {' '.join(failures)}")


def _try(bench: Bench, fault: Fault) -> TrialResult:
    robot = bench.robot
    began_ns = time.monotonic_ns()
    limit_ms = fault.limit_ms(bench.profile.limits)
    with ExitStack() as opened:
        board = opened.enter_context(robot.operator()) if bench.twin else None
        network = opened.enter_context(closing(BadNetwork(robot.port)))
        watcher = opened.enter_context(closing(bench.watcher()))
        with (
            translate_errors(ShapechangerError, to=lambda error: NotTried(str(error))),
            robot.client(role="person", frames=False, name="trial") as person,
        ):
            # Arming ends an emergency stop of the last trial; disarming ends its armed state.
            person.take()
            person.arm()
            person.disarm()
            person.release()
            person.ping()
            if board is not None:
                board.place(0)
            known = robot.known_at(f"127.0.0.1:{network.port}")
            pilot = bench.pilot if fault.by_policy else ""
            driver = opened.enter_context(Driver(known, pilot=pilot))
            if fault.by_policy:
                until_s = time.monotonic() + _STARTS_S
                while not person.ask().message.holder:
                    if time.monotonic() > until_s:
                        raise RobotError("The policy did not take control.")
                    time.sleep(_LOOK_S)
                person.arm()
            driver.await_commands(_COMMANDS)
        _await_drive(watcher)
        drove = watcher.moves() is not False
        if fault.then == "starts afresh":
            robot.forget_ready()
        called_ns = time.monotonic_ns()
        at_ns = fault.make(Scene(robot, driver, network, opened, board)) or called_ns
        if not fault.harms:
            # The driver must still work, and the stop is measured by killing it.
            driver.await_commands(len(driver.sent) + _COMMANDS)
            _await_drive(watcher)
            at_ns = time.monotonic_ns()
            driver.kill()
        _await_rest(watcher, limit_ms)
        if bench.twin:
            return _judged(bench, fault, began_ns, at_ns, driver.sent)
        stopped_ms = watcher.rest_ms(at_ns)
        answer = None
        if math.isnan(stopped_ms):  # Ask now, before the LEDs go out for another reason.
            question = "Did a motor's LED light up, and are all of them out now"
            answer = bench.ask(f"{question} ({fault.name})?")
        return TrialResult(stopped_ms, limit_ms, drove, answer=answer)


def _await_drive(watcher: Watcher) -> None:
    """Wait until the robot moves; after a fault of the camera, this may take a while."""
    if watcher.moves() is None:
        time.sleep(SHOWN_S)  # Let a person see the LEDs.
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
    """Evaluate a trial on a twin from the twin's ledger."""
    profile, ledger = bench.profile, read_ledger(bench.board.ledger_path)
    if fault.needs in {"camera", "bumper", "button"}:
        # The time to stop is measured from the fault's line in the ledger, or from the edge of the
        # switch.
        switches = [one.settings["pins"] for one in profile.sensors if one.driver == "switch"]
        pins = [profile.stop_pin, *(pin for pins in switches for pin in pins)]
        begins = {("fault", None)} if fault.needs == "camera" else {("input", pin) for pin in pins}
        made = (one.t for one in ledger if one.t >= at_ns and (one.kind, one.pin) in begins)
        at_ns = next(made, at_ns)
    # If the guard itself fails, it may stop later, within the promised time of the fault.
    slack_ms = fault.within_ms if fault.guards_late else _LATE_MS
    obeyed_ns = (profile.limits.deadline_ms + slack_ms) * 1e6
    last_ns = at_ns + _LATE_MS * 1e6 if fault.silences else math.inf
    permitted = [(sent_ns, sent_ns + obeyed_ns) for sent_ns in sent if sent_ns <= last_ns]
    strangers = unauthorised(ledger, bench.wiring, permitted)
    return TrialResult(
        stopped_ms=1e3 * time_to_rest(ledger, bench.wiring, at_ns),
        limit_ms=fault.limit_ms(profile.limits),
        drove=any(i.start_ns < at_ns < i.end_ns for i in propelled(ledger, bench.wiring)),
        unauthorised=tuple(i for i in strangers if i.end_ns > began_ns),
    )


def fault_finding(bench: Bench, fault: Fault, trials: int) -> tuple[Level, str]:
    """Try a fault in `trials` trials, and return the level and the sentence of its finding."""
    if why := bench.lacks("throttle") or bench.lacks(fault.needs):
        return "unknown", why
    try:
        tried = list(run_trials(bench, fault, trials))
    except ShapechangerError as error:
        # The next trial must begin with a robot at rest.
        return "bad", " ".join([str(error), *bench.close()])
    results = [result for result in tried if result.drove or result.unauthorised]
    if len(results) < trials or not all(result.drove for result in results):
        return "bad", "It did not drive before the fault."
    promised = f"{results[0].limit_ms:.0f} ms are promised"
    times = sorted(result.stopped_ms for result in results)
    if not any(map(math.isnan, times)):
        stopped = f"{times[len(times) // 2]:.0f} ms later"
        if len(times) > 1:
            stopped += f", and at most {times[-1]:.0f} ms in {len(times)} trials"
        stopped = "never" if math.isinf(times[-1]) else stopped
        strangers = sum(len(result.unauthorised) for result in results)
        moved = f" It moved {strangers} times without a fresh command." if strangers else ""
        good = all(result.kept for result in results)
        return judged(good, f"At rest {stopped}; {promised}.{moved}")
    answers = {result.answer for result in results}
    if answers == {None}:
        how = "Not measured: join the motor's pin to a free pin, and give that pin as --probe"
        return "unknown", f"{how}; {promised}."
    otherwise = "NOT lit, or NOT out afterwards."
    return judged(answers == {True}, "The LEDs were lit, and then out.", otherwise)


CheckLevel = Literal["wiring", "plain", "leds", "faults"]

_PARTS: Final[dict[CheckLevel, tuple[str, ...]]] = {
    "wiring": ("wiring",),
    "plain": ("wiring", "driving"),
    "leds": ("wiring", "LEDs", "driving", "faults"),
    "faults": ("faults",),
}


def require_level(level: CheckLevel, bench: Bench) -> None:
    """Refuse a level of checks that is impossible for a robot."""
    if level == "leds":
        lamps_of(bench.profile)
    if level == "faults" and bench.lacks("throttle"):
        name = bench.profile.name
        raise RobotError(f"{name} has no propulsion, so there is nothing to stop.")


def check_robot(
    level: CheckLevel, bench: Bench, standing: StandingRobot, *, cap: float, trials: int = 1
) -> Iterator[tuple[str, Iterator[Finding]]]:
    """Yield the name of each part of a level with an iterator of its findings.

    A part runs, and its questions are asked, while its iterator is read.

    The part "wiring" moves no output; all other parts drive outputs, and put them at rest at the
    end. `cap`, 0 to 1, is the largest throttle of "driving"; `trials` is the number of trials of
    each fault.
    """

    def light_lamps() -> Iterator[Finding]:
        with closing(bench.watcher()) as watcher:
            # A watcher needs two cycles of software PWM at 50 Hz; a person needs longer.
            shown_s = SHOWN_S if type(watcher) is Watcher else _PWM_S
            yield from check_lamps(bench.profile, bench.pins, bench.ask, watcher.sees, shown_s)

    def drive() -> Iterator[Finding]:
        with bench.robot as served:
            yield from check_driving(served, bench.profile, cap)

    def leave_at_rest(findings: Iterator[Finding]) -> Iterator[Finding]:
        with closing(bench):
            yield from findings
            failures = bench.close()
        if failures:
            yield Finding("safe pins", "bad", " ".join(failures))

    faults = [fault for fault in FAULTS.values() if level == "faults" or fault.on_pins]
    parts: dict[str, Iterator[Finding]] = {
        "wiring": examine(standing),
        "LEDs": light_lamps(),
        "driving": drive(),
        "faults": (Finding(one.name, *fault_finding(bench, one, trials)) for one in faults),
    }
    for part in _PARTS[level]:
        yield part, leave_at_rest(parts[part])
