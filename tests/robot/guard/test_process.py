"""The guard's loop with a fake clock, mock pins and real sockets."""

import logging
import os
import signal
import socket
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, repeat
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from gpiozero import OutputDevice
from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.contract.plan import GuardPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard import process, sensors
from shapechanger.robot.guard.channel import (
    DaemonChannel,
    GuardState,
    Heartbeat,
    Order,
    decode_state,
    encode,
)
from shapechanger.robot.guard.process import Guard, main
from shapechanger.robot.guard.running import AFTER_FAILURE, GUARD, ServePlan, plan_fd
from tests.robot.guard.plans import MS, arm, command, quick_car

_T0 = 1_000 * MS


class _Clock:
    """A clock that advances when waited for, with scheduled events."""

    def __init__(self) -> None:
        self.time_ns = _T0
        self.events: list[tuple[int, Callable[[], object]]] = []
        self.waits: list[tuple[Sequence[int], float]] = []
        self.beat: Callable[[], object] | None = None

    def now_ns(self) -> int:
        return self.time_ns

    def keep_alive(self, beat: Callable[[], object]) -> None:
        self.beat = beat

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        self.waits.append((readable, at_most_s))
        if self.events and self.events[0][0] <= until_ns:
            self.time_ns, event = self.events.pop(0)
            event()
        else:
            self.time_ns = max(until_ns, self.time_ns)
        return True


class _Bench:
    """A guard with its hardware, daemon and supervisor ends; its times are ms after the start."""

    def __init__(self, plan: GuardPlan, **options: bool) -> None:
        self.clock = _Clock()
        self.factory = MockFactory(pin_class=MockPWMPin)
        self.daemon, guards_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.daemon.setblocking(False)
        self.supervisor, heart = socket.socketpair()
        self._channel = DaemonChannel(guards_end.detach())
        self.heartbeat = Heartbeat(heart.detach(), 0.0)
        self.guard = Guard(plan, self, self._channel, logging.getLogger("test"), **options)
        self.drivers = dict(self._drivers())
        self.states: list[GuardState] = []
        self.duties: dict[int, float] = {}

    def _drivers(self) -> Iterator[tuple[str, Any]]:
        for output, driver in self.guard._outputs._drivers:
            yield output.name, driver

    def pin_factory(self) -> MockFactory:
        return self.factory

    def at(self, ms: int, event: Callable[[], object]) -> None:
        """Schedule an event."""
        self.clock.events.append((_T0 + ms * MS, event))
        self.clock.events.sort(key=lambda event: event[0])

    def look(self, *times: int) -> None:
        """Record the duty of the drive at these times."""
        for ms in times:
            self.at(ms, lambda ms=ms: self.duties.update({ms: self.duty()}))

    def duty(self) -> float:
        return self.factory.pin(22).state

    def send(self, ms: int, *orders: Order | bytes) -> None:
        """Schedule orders, or other datagrams."""
        data = [one if isinstance(one, bytes) else encode(one) for one in orders]
        self.at(ms, lambda: [self.daemon.send(one) for one in data])

    def arms(self, ms: int = 1, emergency: int = 0, seq: int = 1) -> None:
        """Schedule the arrival of an arming and a command, which were issued 1 ms before."""
        issued_ns = _T0 + (ms - 1) * MS
        self.send(ms, arm(issued_ns, emergency), command(seq, issued_ns))

    def read(self) -> list[GuardState]:
        """Read all states sent so far."""
        try:
            while data := self.daemon.recv(1 << 16):
                self.states.append(decode_state(data))
        except BlockingIOError:
            pass
        return self.states

    def run(self, end_ms: int) -> GuardState:
        """Run until a time, and return the last state."""
        self.guard.ended = ""
        self.at(end_ms, lambda: setattr(self.guard, "ended", "the test is over"))
        self.guard.run(self.heartbeat)
        return self.read()[-1]

    def reasons(self) -> list[str]:
        return list(dict.fromkeys(state.stop_reason for state in self.states))

    def refusals(self) -> list[tuple[str, int | None]]:
        return [(state.refused, state.refused_seq) for state in self.states if state.refused]

    def close(self) -> None:
        self.guard.close()
        self._channel.close()
        os.close(self.heartbeat.leave())
        self.daemon.close()
        self.supervisor.close()


_Make = Callable[..., _Bench]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Make]:
    """Make benches that are closed after the test; `sensors` are their drivers, keyed by name."""
    benches: list[_Bench] = []

    def bench(*, measures: str = "bump", after_failure: bool = False, **changes: Any) -> _Bench:
        drivers: dict[str, Any] = changes.pop("sensors", {})
        chips = defaultdict(lambda: SimpleNamespace(open=lambda plan, _: drivers[plan.name]))
        monkeypatch.setattr(sensors, "SENSORS", chips)
        plans = tuple(SensorPlan(name, "any", measures) for name in drivers)
        plan = replace(quick_car(), sensors=plans, **changes)
        benches.append(_Bench(plan, after_failure=after_failure))
        return benches[-1]

    yield bench
    for one in benches:
        one.close()


def _sensor(*readings: dict[str, float] | Exception) -> Mock:
    """A sensor with a reading at each tick, of which the last one is repeated."""
    sensor = Mock()
    sensor.read.side_effect = chain(readings, repeat(readings[-1]))
    return sensor


def test_a_command_acts_when_it_arrives_and_ends_at_its_deadline(make: _Make) -> None:
    bench = make()
    bench.arms()
    bench.look(2, 249, 251)
    bench.run(260)
    assert bench.duties == {2: 0.5, 249: 0.5, 251: 0.0}
    acting = next(s for s in bench.states if s.applied_seq == 1)
    stopped = next(s for s in bench.states if s.at_ns > acting.at_ns and s.applied_seq is None)
    assert (stopped.at_ns, stopped.stop_reason) == (_T0 + 250 * MS, "No fresh command.")
    assert acting.applied == (0.5, 0.5)
    assert acting.applied_ns == acting.at_ns == _T0 + 1 * MS
    assert stopped.applied_ns is None
    # The drive is written before the steering.
    assert list(acting.outputs.items()) == [("drive", 0.5), ("steer", 0.5)]


def test_unchanged_states_are_sent_at_every_second_tick(make: _Make) -> None:
    """A changed state is sent at once, and a refusal only once."""
    bench = make()
    bench.send(25, command(7, _T0))
    bench.run(95)
    at_ms = [(state.at_ns - _T0) / MS for state in bench.states]
    assert at_ms == [0.0, 20.0, 25.0, 40.0, 60.0, 80.0, 95.0]  # It ends at 95 ms.
    assert bench.refusals() == [("Command 7 is refused. Not armed.", 7)]
    assert {(s.applied_session, s.applied_ns) for s in bench.states} == {(0, None)}


def test_an_output_is_written_at_every_tick(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make()
    write = Mock(side_effect=lambda value, _: value)
    monkeypatch.setattr(bench.drivers["drive"], "write", write)
    bench.run(45)
    written = [one.args[1] for one in write.mock_calls]
    assert written == [_T0 + ms * MS for ms in (0, 10, 20, 30, 40, 45)]


def test_the_guard_waits_for_the_supervisor_and_a_living_daemon(make: _Make) -> None:
    bench = make()
    heart, daemon = bench.heartbeat.fileno(), bench._channel.filenos()
    bench.at(15, bench.daemon.close)
    bench.at(50, bench.supervisor.close)
    bench.guard.run(bench.heartbeat)
    assert bench.clock.waits[0] == ([heart, *daemon], 0.01)
    assert bench.clock.waits[-1] == ([heart], 0.01)
    assert bench.clock.beat == bench.heartbeat.beat
    assert bench.guard._rules.disarmed == "Disarmed: the daemon has ended."
    assert bench.guard.ended == "the supervisor has ended"


def test_reasons_of_a_state_fit_into_a_datagram(make: _Make) -> None:
    long = "\N{GRINNING FACE}" * 250
    first, last = RobotError(long[:230]), RobotError("z" * 1100)
    sensor = _sensor({"bump": 0.0}, {"bump": 0.0}, {"bump": 0.0}, {"bump": 0.0}, first, first, last)
    bench = make(sensors={"bumper": sensor})
    bench.send(5, Order("disarm", reason=long), command(7, _T0))
    bench.send(35, arm(_T0 + 35 * MS))
    state = bench.run(80)
    assert bench.refusals() == [(f"Command 7 is refused. Disarmed: {long[:50]}...", 7)]
    assert any(s.stop_reason.endswith(str(first)) for s in bench.states)
    assert state.stop_reason.endswith("z...")
    assert len(state.stop_reason) == 1003


def test_a_full_socket_drops_states_and_does_not_stop_the_guard(make: _Make) -> None:
    bench = make()
    bench.daemon.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    bench.arms(20_000)
    bench.at(20_100, bench.read)
    assert bench.run(20_200).armed


def test_the_enable_pin_is_toggled_at_every_tick(make: _Make) -> None:
    bench = make(enable_pin=5)
    pin = bench.factory.pin(5)
    bench.at(1, pin.clear_states)
    bench.run(101)
    assert len(pin.states) - 1 == 10
    bench.guard.close()
    assert not pin.state


def test_the_button_is_an_emergency_stop(make: _Make) -> None:
    bench = make(stop_pin=6)
    bench.arms()
    bench.at(45, lambda: bench.factory.pin(6).drive_low())
    bench.send(60, arm(_T0, 1))
    state = bench.run(80)
    assert (state.armed, state.emergency, state.emergencies) == (False, True, 1)
    assert bench.refusals() == [("Not armed: the emergency button is pressed.", None)]
    assert bench.duty() == 0.0


@pytest.mark.parametrize("reads", [True, False])
def test_a_lost_daemon_disarms(make: _Make, reads: bool) -> None:
    """A lost daemon disarms, also if it left states unread, which resets the connection."""
    bench = make()
    bench.arms()
    bench.at(14, lambda: reads and bench.read())
    bench.look(15, 16)
    bench.at(15, bench.daemon.close)
    bench.at(50, bench.supervisor.close)
    bench.guard.run(bench.heartbeat)
    assert bench.duties == {15: 0.5, 16: 0.0}


def test_an_order_or_a_signal_ends_the_guard(make: _Make) -> None:
    bench = make()
    assert bench.guard.ended == ""
    bench.send(15, Order("end"))
    bench.guard.run(bench.heartbeat)
    assert bench.guard.ended == "the daemon ended it"
    assert bench.read()[-1].stop_reason == "Disarmed: the guard ends."
    bench.guard.ended = ""
    for number in (signal.SIGTERM, signal.SIGINT):
        bench.guard.end(number, None)
    assert bench.guard.ended == "ended by SIGTERM"
    bench.guard.close()
    assert bench.guard.is_safe is True


def test_the_log_has_a_line_for_each_event(
    make: _Make, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    good: dict[str, float] = {"bump": 0.0}
    bench = make(sensors={"bumper": _sensor(good, good, good, RobotError("No answer."), good)})
    bench.arms()
    bench.send(15, b"{")
    bench.send(25, b"{")
    bench.send(65, Order("disarm", reason="lunch."))
    bench.run(80)
    failing = Mock(side_effect=RobotError("No power."))
    monkeypatch.setattr(bench.drivers["steer"], "close", failing)
    bench.guard.close()
    assert bench.guard.is_safe is False
    assert [record.getMessage()[:30] for record in caplog.records] == [
        *("Not armed.", "Armed."),
        *("1 datagrams were no orders: In", "2 datagrams were no orders: In"),
        *("Sensor bumper fails: No answer", "Sensor bumper responds again."),
        *("Disarmed: lunch.", "Output steer: No power."),
    ]


def test_outputs_that_are_not_ready_are_not_armed(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guard sends heartbeats while outputs get ready, and obeys later orders of the round."""
    bench = make(enable_pin=5)
    pin = bench.factory.pin(5)

    def ready(stay_alive: Callable[[], None]) -> str:
        pin.clear_states()
        bench.supervisor.recv(1 << 16)
        stay_alive()
        assert len(bench.supervisor.recv(1 << 16)) == 1
        assert len(pin.states) == 2
        return "servo 3 is hot."

    monkeypatch.setattr(bench.guard._outputs, "ready", ready)
    bench.send(15, arm(_T0), Order("emergency", reason="fire."))
    state = bench.run(30)
    assert bench.refusals() == [("Not armed: servo 3 is hot.", None)]
    assert state.stop_reason == "Emergency stop: fire."


def test_a_failed_output_stops_all_until_rearmed(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until the output recovers, arming causes a new emergency stop; the enable pin rests."""
    bench = make(enable_pin=5)
    bench.arms()
    pin, edges = bench.factory.pin(5), list[int]()
    write = Mock(side_effect=RobotError("No answer."))
    bench.at(31, lambda: monkeypatch.setattr(bench.drivers["drive"], "write", write))
    for ms in (45, 60):
        bench.at(ms, lambda: edges.append(len(pin.states)))
    bench.arms(46, 1)
    bench.at(60, monkeypatch.undo)
    bench.arms(85, 2, seq=2)
    state = bench.run(100)
    assert edges[0] == edges[1] < len(pin.states)
    stopped = [s for s in bench.states if s.emergency]
    assert all(s.outputs["steer"] == 0.0 and s.applied == (0.0, 0.0) for s in stopped)
    assert {(s.applied_session, s.applied_ns) for s in stopped} == {(0, None)}
    emergency = "Emergency stop: Output drive: No answer."
    assert stopped[0].stop_reason.startswith("NOT at rest: Output drive: No answer. Emergency ")
    assert (stopped[-1].stop_reason, stopped[-1].emergencies) == (emergency, 2)
    assert state.applied_seq == 2
    assert [one.args[1] for one in write.mock_calls[:2]] == [_T0 + 31 * MS] * 2


def test_outputs_are_released_once_per_stop(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make(stop=replace(quick_car().stop, then="release"))
    released: list[str] = []
    for name, driver in bench.drivers.items():
        monkeypatch.setattr(driver, "release", lambda name=name: released.append(name))
    bench.arms()
    bench.run(300)
    assert released == ["drive", "steer"] * 2


def test_a_restart_after_a_failure_starts_in_emergency_stop(make: _Make) -> None:
    """Only a person ends the emergency stop after a restart."""
    bench = make(after_failure=True)
    bench.send(1, arm(_T0, 1, person=False), command(1, _T0))
    state = bench.run(20)
    assert (state.armed, state.emergency, state.emergencies) == (False, True, 1)
    text = "Emergency stop: the robot's processes failed and started afresh."
    assert state.stop_reason == text
    assert not any(state.applied_seq for state in bench.states)
    bench.arms(21, 1, seq=2)
    assert bench.run(40).armed


def test_an_invalid_order_ends_the_previous_command(make: _Make) -> None:
    bench = make()
    bench.arms()
    bench.look(55, 57)
    bench.send(56, encode(command(2, _T0)).replace(b"0.5", b"NaN"))
    assert bench.run(60).armed
    assert bench.duties == {55: 0.5, 57: 0.0}
    assert bench.refusals()[0][0].startswith("Invalid order: ")


def test_a_controller_that_does_not_follow_yet_is_reported(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make()
    monkeypatch.setattr(bench.drivers["drive"], "write", lambda value, now_ns: 0.0)
    bench.arms()
    bench.at(45, lambda: direction.append(bench.guard._rules.direction))
    bench.at(50, monkeypatch.undo)
    direction: list[float] = []
    state = bench.run(70)
    assert direction == [0.0]
    waiting = [s for s in bench.states if s.applied_seq == 1 and s.at_ns < _T0 + 50 * MS]
    assert {(s.applied, s.stop_reason) for s in waiting} == {
        ((0.5, 0.0), "Output drive: it does not follow.")
    }
    assert (state.applied, state.stop_reason) == ((0.5, 0.5), "")


def test_sensors_are_read_at_every_tick_and_a_failing_one_stops(make: _Make) -> None:
    good, bad = {"bump": 0.0}, (RobotError("No answer."), {"bump": float("nan")}, OSError("No bus"))
    sensor = _sensor(good, good, good, {"bump": 1.0}, *bad, good)
    bench = make(sensors={"bumper": sensor})
    bench.arms()
    bench.run(100)
    fails = "Sensor bumper fails and cannot protect the robot: "
    assert bench.reasons() == [
        *("Not armed.", "", "Not forward: the bumper touched something."),
        *(f"{fails}No answer.", f"{fails}It returned a value that is not finite."),
        f"{fails}No bus",
    ]
    assert bench.states[-1].bumps == 1
    assert bench.states[-1].sources["collision"] == "bumper"
    asked = [one.args for one in sensor.read.mock_calls[:3]]
    assert asked == [(_T0, 0.0), (_T0 + 10 * MS, 1.0), (_T0 + 20 * MS, 1.0)]


def _slow(make: _Make, takes_ms: Callable[[float], int]) -> tuple[_Bench, list[tuple[int, float]]]:
    """Make a bench whose sensor takes time, and a list of the time and duty before each reading."""
    sensor, driven = Mock(**{"read.return_value": {"speed": 1.0}}), list[tuple[int, float]]()
    bench = make(sensors={"wheel": sensor}, measures="speed")

    def read(now_ns: int, direction: float) -> dict[str, float]:
        driven.append((bench.clock.time_ns, bench.duty()))
        bench.clock.time_ns += takes_ms((now_ns - _T0) / MS) * MS
        return {"speed": 1.0}

    sensor.read.side_effect = read
    bench.arms()
    return bench, driven


@pytest.mark.parametrize("takes_ms", [0, 15])
def test_a_stop_that_is_due_does_not_wait_for_a_sensor(make: _Make, takes_ms: int) -> None:
    """The guard decides with the time after the sensors were read."""
    bench, driven = _slow(make, lambda _: takes_ms)
    bench.run(320)
    assert all(duty == 0.0 for t, duty in driven if t >= _T0 + 250 * MS)
    acting = [state for state in bench.states if state.applied_seq == 1]
    assert max(state.at_ns for state in acting) < _T0 + 250 * MS
    assert {state.stop_reason for state in acting} == {""}


def test_a_sensor_that_is_slow_stops_the_robot(make: _Make) -> None:
    bench, _ = _slow(make, lambda ms: 0 if ms < 45 else 21 if ms < 150 else 20)
    bench.run(200)
    text = "Sensor wheel delays the robot: It took more than 20 ms to answer."
    slow = [state for state in bench.states if state.stop_reason == text]
    assert slow[0].at_ns == _T0 + 71 * MS
    assert all(state.outputs["drive"] == 0.0 for state in slow)
    assert any(state.applied_seq == 1 and state.at_ns > slow[-1].at_ns for state in bench.states)


def test_the_outputs_rest_before_anything_is_closed(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor = _sensor({"bump": 0.0})
    bench = make(sensors={"bumper": sensor})
    bench.arms()
    bench.run(50)
    assert bench.duty() == 0.5
    duties: list[float] = []
    sensor.close.side_effect = lambda: duties.append(bench.duty())
    write = Mock(wraps=bench.drivers["drive"].write)
    monkeypatch.setattr(bench.drivers["drive"], "write", write)
    bench.guard.close()
    assert duties == [0.0]
    assert {one.args for one in write.mock_calls} == {(0.0, bench.clock.time_ns)}
    assert write.call_count == 2  # First of all, and again before the pins are closed.


@pytest.mark.parametrize(
    ("error", "reason"), [(RobotError("No answer."), "No answer."), (KeyError(), "KeyError")]
)
def test_the_error_of_an_output_that_recovers_at_once_is_named(
    make: _Make, monkeypatch: pytest.MonkeyPatch, error: Exception, reason: str
) -> None:
    bench = make()
    bench.arms()
    write = Mock(side_effect=chain([error], repeat(0.0)))
    bench.at(31, lambda: monkeypatch.setattr(bench.drivers["drive"], "write", write))
    assert bench.run(60).stop_reason == f"Emergency stop: {reason}"


def test_all_outputs_that_fail_are_named(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make()
    bench.arms()
    write = Mock(side_effect=RobotError("No answer."))
    for name in ("drive", "steer"):
        bench.at(31, lambda name=name: monkeypatch.setattr(bench.drivers[name], "write", write))
    bench.arms(46, 1)
    bench.at(60, monkeypatch.undo)
    state = bench.run(80)
    both = "Output drive: No answer. Output steer: No answer."
    assert f"NOT at rest: {both} Emergency stop: No answer." in bench.reasons()
    assert state.stop_reason == f"Emergency stop: {both}"


def test_a_sensor_that_cannot_be_opened_leaves_nothing_open(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    hardware, good = make(), Mock()
    hardware.guard.close()
    chip = Mock(**{"open.side_effect": [good, RobotError("No answer.")]})
    monkeypatch.setattr(sensors, "SENSORS", {"switch": chip})
    plans = tuple(SensorPlan(name, "switch", "bump") for name in ("good", "bad"))
    with pytest.raises(RobotError, match="No answer"):
        Guard(replace(quick_car(), sensors=plans), hardware, Mock(), logging.getLogger("test"))
    good.close.assert_called_once()
    assert [one.args for one in chip.open.mock_calls] == [(plan, hardware) for plan in plans]
    OutputDevice(22, pin_factory=hardware.factory).close()  # The pin is free.


class _Program:
    """`main` in this process, with simulated hardware; times are ms after the start."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock = _Clock()
        self.factory = MockFactory(pin_class=MockPWMPin)
        self.hardware = SimpleNamespace(
            clock=self.clock, pin_factory=lambda: self.factory, close=Mock()
        )
        self.connect = Mock(return_value=self.hardware)
        self.run_promptly = Mock()
        monkeypatch.setattr(process, "connect", self.connect)
        monkeypatch.setattr(process, "run_promptly", self.run_promptly)
        self.daemon, self._guards_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.supervisor, self._heart = socket.socketpair()
        self.supervisor.setblocking(False)
        plan = ServePlan(replace(quick_car(), sensors=()), {}, ("module:function", "argument"))
        self._opened = [plan_fd(plan)]

    def at(self, ms: int, event: Callable[[], object]) -> None:
        self.clock.events.append((_T0 + ms * MS, event))

    def run(self, *arguments: str) -> None:
        self._opened.append(self._heart.detach())  # It stays open until the process exits.
        fds = {
            "--plan-fd": self._opened[0],
            "--daemon-fd": self._guards_end.detach(),
            "--heartbeat-fd": self._opened[1],
        }
        main([*arguments, *chain.from_iterable((name, str(fd)) for name, fd in fds.items())])

    def states(self) -> list[GuardState]:
        """Return all states; the socket must have ended."""
        return [decode_state(data) for data in iter(lambda: self.daemon.recv(1 << 16), b"")]

    def close(self) -> None:
        for fd in self._opened:
            os.close(fd)
        for one in (self.daemon, self.supervisor, self._guards_end, self._heart):
            one.close()


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Program]:
    """The program; signals and the settings of the log are restored afterwards."""
    monkeypatch.setattr(logging, "raiseExceptions", True)
    numbers = (signal.SIGTERM, signal.SIGINT)
    handlers = [signal.signal(number, Mock()) for number in numbers]
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    made = _Program(monkeypatch)
    yield made
    made.close()
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_program_guards_until_a_signal(
    program: _Program, capfd: pytest.CaptureFixture[str], number: signal.Signals
) -> None:
    duties: list[float] = []
    program.at(1, lambda: program.daemon.send(encode(arm(_T0))))
    program.at(2, lambda: program.daemon.send(encode(command(1, _T0))))
    program.at(40, lambda: duties.append(program.factory.pin(22).state))
    program.at(50, lambda: signal.raise_signal(number))
    program.at(90, program.supervisor.close)
    program.run()
    assert capfd.readouterr().err.splitlines() == [
        "guard: guards test car with 2 outputs.",
        *("guard: Not armed.", "guard: Armed."),
        f"guard: ends: ended by {number.name}.",
    ]
    assert duties == [0.5]
    assert program.factory.pin(22).state == 0.0
    assert any(state.applied_seq == 1 for state in program.states())
    program.connect.assert_called_once_with("module:function", "argument")
    program.run_promptly.assert_called_once_with(GUARD)
    program.hardware.close.assert_called_once_with()
    # Heartbeats were sent, and the stream stays open until the process exits.
    assert program.supervisor.recv(1 << 16).startswith(b".")
    with pytest.raises(BlockingIOError):
        program.supervisor.recv(1)


def test_a_signal_before_the_guard_is_ready_ends_it(
    program: _Program, capfd: pytest.CaptureFixture[str]
) -> None:
    """The outputs are opened, put to rest and closed."""
    connect = program.connect

    def connect_and_end(*arguments: str) -> object:
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        return connect.return_value

    connect.side_effect = connect_and_end
    program.at(90, program.supervisor.close)
    program.run()
    assert capfd.readouterr().err.splitlines()[-1].startswith("guard: ends: ended by SIG")
    assert program.factory.pin(22).state == 0.0


def test_the_program_starts_in_emergency_stop_after_a_failure(program: _Program) -> None:
    program.at(5, lambda: program.daemon.send(encode(Order("end"))))
    program.run(AFTER_FAILURE)
    assert {state.emergency for state in program.states()} == {True}


def test_the_program_fails_if_an_output_does_not_rest(
    program: _Program, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    stuck = Mock(side_effect=OSError("the pin is stuck"))
    program.at(5, lambda: monkeypatch.setattr(program.factory.pin(22), "_set_state", stuck))
    program.at(15, lambda: program.daemon.send(encode(Order("end"))))
    with pytest.raises(SystemExit) as ended:
        program.run()
    assert ended.value.code == 1
    last = capfd.readouterr().err.splitlines()[-1]
    assert last == "guard: ends because of RobotError: not all outputs are at rest"
    program.hardware.close.assert_called_once_with()


def test_wrong_arguments_of_the_program_are_logged(
    program: _Program, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--plan-fd", "3"])
    assert ended.value.code == 1
    assert capfd.readouterr().err == (
        "guard: ends because of ValueError: This takes --plan-fd N --daemon-fd N "
        "--heartbeat-fd N, not --plan-fd 3.\n"
    )
