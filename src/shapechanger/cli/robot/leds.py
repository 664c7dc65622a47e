"""Bench test of one Raspberry Pi with LEDs in place of motors.

It needs no second machine: the robot is served here, and a process beside it drives. What the pins
do is seen by the person, measured through a wire to a free pin, or, on a twin, read in its ledger.
"""

from __future__ import annotations

import math
import os
import signal
import tempfile
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

from shapechanger.cli.console import say
from shapechanger.cli.robot.checks import SelftestResult, check_robot, require_free_pin
from shapechanger.cli.robot.faults import FAULTS
from shapechanger.cli.robot.trial import calm, has
from shapechanger.cli.robot.trial_driver import Driver
from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.remote.client import RobotClient
from shapechanger.robot.drivers.edges import EdgeInput
from shapechanger.robot.drivers.output import open_output
from shapechanger.robot.guard.outputs import enable_device, make_safe
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan
from shapechanger.robot.hardware import Hardware, RealHardware
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.doctor import examine_robot
from shapechanger.robot.setup.wiring import examine_wiring
from shapechanger.twin.hardware import connect
from shapechanger.twin.oracle import time_to_rest
from shapechanger.twin.robot import Operator, RunningRobot, run_robot
from shapechanger.twin.signals import PwmChannel, read_ledger
from shapechanger.twin.start import BoardAt, start_board
from shapechanger.twin.wiring import TwinWiring

_COMMANDS: Final = 4
_MOVES_S: Final = 5.0
_STAYS_S: Final = 0.3
_LOOK_S: Final = 0.01
_SHOWN_S: Final = 0.5  # Time for which an LED is lit when nobody is asked.
# Longest low time of software PWM while a motor runs: two cycles at 50 Hz.
_PWM_S: Final = 0.04

Ask = Callable[[str], bool | None]
"""Asks a person a question; None if nobody answers."""


class BenchLamp(NamedTuple):
    """An LED in place of a motor or servo.

    Attributes:
        name: Its output and direction, such as "drive forward".
        place: Its pin or channel, such as "GPIO22".
        output: The output; None for the enable line.
        value: Value of the output at which it is lit.
        pin: Its BCM pin; None on a PWM chip.
    """

    name: str
    place: str
    output: OutputPlan | None
    value: float = 1.0
    pin: int | None = None


def lamps_of(plan: GuardPlan) -> list[BenchLamp]:
    """Return the LEDs of a bench, in the order of the outputs.

    Args:
        plan: The robot.

    Raises:
        RobotError: If an output takes no LED.
    """
    found: list[BenchLamp] = []
    for output in plan.outputs:
        settings, name = output.settings, output.name
        match output.driver:
            case "hbridge":
                for way, value in (("forward", 1.0), ("backward", -1.0), ("enable", 1.0)):
                    if (pin := settings[way]) >= 0:
                        found.append(BenchLamp(f"{name} {way}", f"GPIO{pin}", output, value, pin))
            case "phase_enable":
                pin = settings["enable"]
                found.append(BenchLamp(f"{name} enable", f"GPIO{pin}", output, 1.0, pin))
                pin = settings["phase"]
                found.append(BenchLamp(f"{name} backward", f"GPIO{pin}", output, -1.0, pin))
            case "servo" | "esc" if settings["over"] == "lgpio":
                pin = settings["pin"]
                found.append(BenchLamp(f"{name}, dimly", f"GPIO{pin}", output, 1.0, pin))
            case "servo" | "esc":
                place = f"channel {settings['channel']} of the {settings['over']}"
                found.append(BenchLamp(f"{name}, dimly", place, output))
            case driver:
                raise RobotError(
                    f"Output {name} is a servo on a bus ({driver}), and an LED cannot stand for "
                    "it: take a robot whose outputs are on pins, such as `init car`."
                )
    if plan.enable_pin is not None:
        pin = plan.enable_pin
        found.append(BenchLamp("enable line", f"GPIO{pin}", None, pin=pin))
    return found


@contextmanager
def lit(lamp: BenchLamp, plan: GuardPlan, hardware: Hardware) -> Generator[None]:
    """Light one LED, through the driver of its output, and put it out at the end.

    Args:
        lamp: The LED.
        plan: The robot.
        hardware: Its pins and buses.

    Raises:
        RobotError: If a device does not respond.
    """
    if lamp.output is None:
        if plan.enable_pin is None:
            raise RobotError(f"{plan.name} has no enable line.")
        device = enable_device(plan.enable_pin, hardware)
        try:
            device.on()
            yield
        finally:
            device.off()
            device.close()
        return
    driver = open_output(lamp.output, hardware)
    try:
        driver.write(lamp.value, hardware.clock.now_ns())
        yield
        driver.write(0.0, hardware.clock.now_ns())
    finally:
        driver.close()


class LampJudge(Protocol):
    """Measures what the outputs do, independently of the robot's programs."""

    def sees(self, lamp: BenchLamp) -> bool | None:
        """Return whether an LED is lit; None if that is not measured."""
        ...

    def moves(self) -> bool:
        """Return whether an output that propels is driven now."""
        ...

    def rest_ms(self, at_ns: int) -> float:
        """Return the time from a moment to the last propulsion after it; infinite if it goes on."""
        ...


class TwinJudge:
    """Reads the levels and the ledger of a twin; see `LampJudge`."""

    def __init__(self, board: BoardAt, operator: Operator, wiring: TwinWiring) -> None:
        self._board = board
        self._operator = operator
        self._wiring = wiring

    def sees(self, lamp: BenchLamp) -> bool | None:
        """Return whether an LED is lit."""
        levels = self._operator.levels()
        if lamp.pin is not None:
            return levels.duties.get(lamp.pin, 0.0) > 0.0
        if lamp.output is None:
            return None
        settings = lamp.output.settings
        channel = PwmChannel(*(settings[key] for key in ("bus", "address", "channel")))
        return channel in levels.channels and levels.channels[channel].us > 0.0

    def moves(self) -> bool:
        """Return whether an output that propels is driven now."""
        outputs = self._wiring.read(self._operator.levels(), time.monotonic_ns())
        return not all(outputs[name].at_rest for name in self._wiring.propelling)

    def rest_ms(self, at_ns: int) -> float:
        """Return the time from a moment to permanent rest, ms."""
        ledger = read_ledger(self._board.ledger_path)
        return 1e3 * time_to_rest(ledger, self._wiring, at_ns)


class ProbeJudge:
    """Watches the pin of a motor through a wire to a free pin; see `LampJudge`.

    Edges are stamped here when they arrive, about a millisecond late.

    Args:
        probe: Free BCM pin at the end of the wire.
        probed: BCM pin of the motor.
        hardware: The pins.
    """

    def __init__(self, probe: int, probed: int, hardware: Hardware) -> None:
        self._probed = probed
        self._edges: list[int] = []
        self._input = EdgeInput(probe, "down", hardware.pin_factory(), self._changed)

    def sees(self, lamp: BenchLamp) -> bool | None:
        """Return whether the LED on the probed pin is lit."""
        return self.moves() if lamp.pin == self._probed else None

    def moves(self) -> bool:
        """Return whether the pin is high, or was within two cycles of PWM."""
        last_ns = self._edges[-1] if self._edges else 0
        return bool(self._input.level) or time.monotonic_ns() - last_ns < _PWM_S * 1e9

    def rest_ms(self, at_ns: int) -> float:
        """Return the time from a moment to the last edge, ms."""
        if self._input.level:
            return math.inf
        return max(0.0, (self._edges[-1] - at_ns) / 1e6) if self._edges else 0.0

    def close(self) -> None:
        """Close the pin."""
        self._input.close()

    def _changed(self, at_s: float, level: int) -> None:
        del at_s, level  # lgpio's clock is not stated.
        self._edges.append(time.monotonic_ns())


def walk(
    plan: GuardPlan, connect_pins: Callable[[], Hardware], ask: Ask, judge: LampJudge | None
) -> Iterator[SelftestResult]:
    """Light each LED alone, and ask or measure whether it is lit.

    Args:
        plan: The robot.
        connect_pins: Opens its pins and buses, which nothing else uses meanwhile.
        ask: Asks the person.
        judge: Measures; None for nothing.
    """
    for lamp in lamps_of(plan):
        name = f"LED {lamp.place}"
        hardware = connect_pins()  # Afresh, because a closed output stays claimed.
        try:
            with lit(lamp, plan, hardware):
                answer = ask(f"Is the LED on {lamp.place} lit ({lamp.name})?")
                if answer is None:
                    time.sleep(_SHOWN_S if judge is None else _PWM_S)
                measured = judge.sees(lamp) if judge is not None else None
        except RobotError as error:
            yield SelftestResult(name, "bad", f"{lamp.name}: {error}")
            continue
        finally:
            hardware.close()
        words = {True: "lit", False: "NOT lit", None: "not asked"}[answer]
        if measured is not None:
            words += f", measured as {'lit' if measured else 'NOT lit'}"
        if answer is None and measured is None:
            yield SelftestResult(name, "unknown", f"{lamp.name}: {words}.")
        else:
            good = answer is not False and measured is not False
            yield SelftestResult(name, "good" if good else "bad", f"{lamp.name}: {words}.")


Act = Callable[[RunningRobot, Driver], int]
"""Does something to a robot and its driver, and returns when: monotonic, ns."""


def _signal(program: str, number: signal.Signals) -> Act:
    def act(robot: RunningRobot, driver: Driver) -> int:
        pids = {
            "driver": lambda: driver.process.pid,
            "guard": lambda: robot.pid_of("guard"),
            "daemon": lambda: robot.pid_of("daemon"),
            "supervisor": lambda: robot.supervisor.pid,
        }
        pid = pids[program]()
        at_ns = time.monotonic_ns()
        os.kill(pid, number)
        return at_ns

    return act


def _by_person(act: Callable[[RobotClient], object]) -> Act:
    def acted(robot: RunningRobot, _: Driver) -> int:
        with robot.client(role="person", frames=False, name="selftest") as client:
            at_ns = time.monotonic_ns()
            act(client)
            client.ping()  # Lets the message arrive before the connection closes.
            return at_ns

    return acted


def _kill_both(robot: RunningRobot, _: Driver) -> int:
    """Kill the supervisor and the guard before either can react."""
    guard = robot.pid_of("guard")
    os.kill(robot.supervisor.pid, signal.SIGSTOP)
    at_ns = time.monotonic_ns()
    os.kill(guard, signal.SIGKILL)
    robot.supervisor.kill()
    return at_ns


# Faults of `trial` that need neither a twin nor a network; in pairs, so that a supervisor, which
# gives up after five restarts within a minute, sees four.
_FAULTS: Final[dict[str, Act]] = {
    "driver killed": _signal("driver", signal.SIGKILL),
    "driver stopped": _signal("driver", signal.SIGSTOP),
    "a person disarms": _by_person(lambda client: client.disarm()),
    "emergency stop by another": _by_person(lambda client: client.emergency_stop("A self-test.")),
    "daemon killed": _signal("daemon", signal.SIGKILL),
    "daemon stopped": _signal("daemon", signal.SIGSTOP),
    "guard killed": _signal("guard", signal.SIGKILL),
    "guard stopped": _signal("guard", signal.SIGSTOP),
    "supervisor killed": _signal("supervisor", signal.SIGKILL),
    "guard and supervisor killed": _kill_both,
}


class Bench:
    """A bench of one Pi with LEDs, or its twin.

    Args:
        profile: The robot.
        twin: Whether on its twin.
        probe: Free BCM pin with a wire to the pin of the motor that drives forward; None without.
        ask: Asks the person.
        cap: Largest throttle of the checks, 0 to 1.

    Raises:
        RobotError: If the profile has no LEDs, or the probe cannot be used.
    """

    def __init__(
        self, profile: Profile, *, twin: bool, probe: int | None, ask: Ask, cap: float
    ) -> None:
        self._profile = profile
        self._plan = profile.guard_plan()
        self._twin = twin
        self._ask = ask
        self._cap = cap
        lamps_of(self._plan)
        self._probe = None if probe is None else (probe, probed_pin(self._plan, probe))

    def results(self) -> Iterator[tuple[str, SelftestResult | None]]:
        """Run everything, and yield the part and the result of each check.

        At the start of a part, before its first question, there is no result yet.

        Raises:
            RobotError: If the robot cannot be served.
        """
        with ExitStack() as stack:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="shapechanger-leds-"))
            board = self._board(Path(folder), stack) if self._twin else None
            yield "wiring", None
            for result in self._wiring(board):
                yield "wiring", result
            yield "LEDs", None
            with self._judged(board) as judge:
                for result in walk(self._plan, lambda: _pins(board), self._ask, judge):
                    yield "LEDs", result
            yield "checks", None
            with self._served(Path(folder)) as robot:
                for result in check_robot(robot, self._profile, self._cap):
                    yield "checks", result
            yield "faults", None
            for result in self._faults(Path(folder), board):
                yield "faults", result

    def _board(self, folder: Path, stack: ExitStack) -> BoardAt:
        return stack.enter_context(
            start_board(
                self._plan,
                clock="real",
                folder=folder,
                camera=self._profile.camera,
                one_shot_ms=float(self._plan.enable_hold_ms),
            )
        )

    def _wiring(self, board: BoardAt | None) -> Iterator[SelftestResult]:
        """Yield what the doctor finds; a bench needs neither unit nor calibration."""
        if board is None:
            found = (
                (one.check, one.level, one.sentence)
                for one in examine_robot(
                    self._plan, self._profile.camera, 0, profile=None, motors_off=True
                )
                if one.check not in {"systemd", "port"}
            )
            yield from (_found(*one) for one in found)
            return
        hardware = _pins(board)
        try:
            for one in examine_wiring(self._plan, hardware, motors_off=True):
                yield _found(*one)
        finally:
            hardware.close()

    @contextmanager
    def _judged(self, board: BoardAt | None) -> Generator[LampJudge | None]:
        """Open the judge."""
        with ExitStack() as stack:
            if board is not None:
                operator = stack.enter_context(Operator(board.socket_path))
                one_shot_ms = float(self._plan.enable_hold_ms)
                yield TwinJudge(board, operator, TwinWiring(self._plan, one_shot_ms))
            elif self._probe is not None:
                hardware = RealHardware()
                stack.callback(hardware.close)
                judge = ProbeJudge(*self._probe, hardware)
                stack.callback(judge.close)
                yield judge
            else:
                yield None

    def _served(self, folder: Path) -> AbstractContextManager[RunningRobot]:
        """Serve the robot; the folder is that of the twin's board."""
        if not self._twin:
            return run_robot(self._profile, twin=False, arguments=("--arm-by-program",))
        (folder / "ready.json").unlink(missing_ok=True)  # Of a robot that was killed.
        return run_robot(self._profile, folder=folder)

    def _faults(self, folder: Path, board: BoardAt | None) -> Iterator[SelftestResult]:
        """Yield the result of each fault; a robot that a fault ended is served again."""
        names = [
            name for name in _FAULTS if not self._twin or has(self._profile, FAULTS[name].needs)
        ]
        if not any(action.name == "throttle" and action.propels for action in self._plan.actions):
            yield SelftestResult("faults", "unknown", "The robot has no throttle to drive with.")
            return
        with self._judged(board) as judge:
            while names:
                with self._served(folder) as robot:
                    while names:
                        name = names.pop(0)
                        yield self._tried(name, robot, judge)
                        if FAULTS[name].then == "is gone":
                            break
                # Whatever the last fault left, the next robot begins at rest.
                hardware = _pins(board)
                failures = make_safe(self._plan, hardware)
                hardware.close()
                if failures:
                    yield SelftestResult("safe pins", "bad", " ".join(failures))

    def _tried(self, name: str, robot: RunningRobot, judge: LampJudge | None) -> SelftestResult:
        """Drive, let one fault happen, and measure or ask when the LED went out."""
        fault = FAULTS[name]
        limit_ms = fault.limit_ms(self._plan.limits)
        try:
            calm(robot)
            with Driver(robot.known) as driver:
                driver.await_commands(_COMMANDS)
                if not _awaited_motion(judge):
                    return SelftestResult(name, "bad", "It did not drive before the fault.")
                if judge is None:
                    time.sleep(_SHOWN_S)
                if fault.then == "starts afresh":
                    robot.forget_ready()
                at_ns = _FAULTS[name](robot, driver)
                time.sleep(limit_ms / 1e3 + _STAYS_S)
                result = self._judge_stop(name, judge, at_ns, limit_ms)
            if fault.then == "starts afresh":
                robot.await_restart()
        except ShapechangerError as error:
            return SelftestResult(name, "bad", str(error))
        return result

    def _judge_stop(
        self, name: str, judge: LampJudge | None, at_ns: int, limit_ms: float
    ) -> SelftestResult:
        promised = f"{limit_ms:.0f} ms are promised"
        if judge is not None:
            stopped_ms = judge.rest_ms(at_ns)
            words = "never" if math.isinf(stopped_ms) else f"{stopped_ms:.0f} ms later"
            good = stopped_ms <= limit_ms
            return SelftestResult(name, "good" if good else "bad", f"At rest {words}; {promised}.")
        answer = self._ask(f"Did a motor's LED light up, and are all of them out now ({name})?")
        if answer is None:
            words = f"Not measured: a wire to a free pin does, with --probe; {promised}."
            return SelftestResult(name, "unknown", words)
        words = "The LEDs were lit, and then out." if answer else "NOT lit, or NOT out afterwards."
        return SelftestResult(name, "good" if answer else "bad", words)


def _pins(board: BoardAt | None) -> Hardware:
    """Open the pins of a twin's board; None for those of this machine."""
    return RealHardware() if board is None else connect(board.socket_path)


def _found(check: str, level: str, sentence: str) -> SelftestResult:
    known: dict[str, Any] = {"good": "good", "missing": "bad"}
    return SelftestResult(check, known.get(level, "unknown"), sentence)


def _awaited_motion(judge: LampJudge | None) -> bool:
    """Wait until the judge sees motion; without a judge, assume it."""
    until_s = time.monotonic() + _MOVES_S
    while judge is not None and not judge.moves():
        if time.monotonic() > until_s:
            return False
        time.sleep(_LOOK_S)
    return True


def probed_pin(plan: GuardPlan, probe: int) -> int:
    """Return the pin that a probe has to be joined to: that of the motor that drives forward.

    Args:
        plan: The robot.
        probe: BCM pin of the probe.

    Raises:
        RobotError: If there is no such pin, the robot uses it, or nothing can be probed.
    """
    require_free_pin(probe, plan)
    for output in plan.outputs:
        weight = output.mix.get("throttle", 0.0)
        if weight and output.driver == "hbridge":
            return int(output.settings["forward" if weight > 0 else "backward"])
        if weight and output.driver == "phase_enable":
            return int(output.settings["enable"])
    raise RobotError("A probe needs a motor on an H-bridge: pulses of a servo go on at rest.")


def ask_nobody(_: str) -> None:
    """Ask nothing; see `Ask`."""


def ask_person(question: str) -> bool | None:
    """Ask until the answer is yes or no; see `Ask`."""
    while True:
        try:
            answer = input(f"{question} [y/n] ").strip().lower()
        except EOFError:
            return None
        if answer in {"y", "yes", "n", "no"}:
            return answer.startswith("y")
        say("Answer y or n.")
