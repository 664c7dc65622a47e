"""The guard's loop with a fake clock, mock pins and real sockets."""

import itertools
import logging
import os
import signal
import socket
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace

import pytest
from gpiozero import OutputDevice
from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.contract.plan import GuardPlan, LimitPlan, SensorPlan
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

    def at(self, ms: int, event: Callable[[], object]) -> None:
        """Schedule an event, in milliseconds after the start."""
        self.events.append((_T0 + ms * MS, event))
        self.events.sort(key=lambda event: event[0])

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
    """A guard with its hardware, daemon and supervisor ends."""

    def __init__(self, plan: GuardPlan, **options: bool) -> None:
        self.clock = _Clock()
        self.factory = MockFactory(pin_class=MockPWMPin)
        self.daemon, guards_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.daemon.setblocking(False)
        self.supervisor, heart = socket.socketpair()
        self._channel = DaemonChannel(guards_end.detach())
        self.heartbeat = Heartbeat(heart.detach(), 0.0)
        self.guard = Guard(plan, self, self._channel, logging.getLogger("test"), **options)
        self.states: list[GuardState] = []

    def pin_factory(self) -> MockFactory:
        return self.factory

    def duty(self, pin: int) -> float:
        return self.factory.pin(pin).state

    def send(self, *orders: Order) -> None:
        for order in orders:
            self.daemon.send(encode(order))

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
        self.clock.at(end_ms, lambda: setattr(self.guard, "ended", "the test is over"))
        self.guard.run(self.heartbeat)
        return self.read()[-1]

    def close(self) -> None:
        self.guard.close()
        self._channel.close()
        os.close(self.heartbeat.leave())
        self.daemon.close()
        self.supervisor.close()


@pytest.fixture
def make() -> Iterator[Callable[[GuardPlan], _Bench]]:
    """Make benches that are closed after the test."""
    benches: list[_Bench] = []

    def bench(plan: GuardPlan, **options: bool) -> _Bench:
        benches.append(_Bench(plan, **options))
        return benches[-1]

    yield bench
    for one in benches:
        one.close()


def _plan(**changes: object) -> GuardPlan:
    return replace(quick_car(), **{"sensors": (), **changes})


def _drives(bench: _Bench) -> None:
    bench.clock.at(1, lambda: bench.send(arm(_T0), command(1, _T0)))


_Make = Callable[..., _Bench]


def test_an_order_acts_when_it_arrives_and_ends_at_its_deadline(make: _Make) -> None:
    bench = make(_plan())
    duties: dict[int, float] = {}
    _drives(bench)
    for ms in (2, 249, 251):
        bench.clock.at(ms, lambda ms=ms: duties.update({ms: bench.duty(22)}))
    bench.run(260)
    assert duties == {2: 0.5, 249: 0.5, 251: 0.0}
    stopped = next(s for s in bench.states if s.stop_reason == "No fresh command.")
    assert stopped.at_ns == _T0 + 250 * MS
    acting = next(s for s in bench.states if s.applied_seq == 1)
    assert acting.applied == (0.5, 0.5)
    assert acting.applied_ns == acting.at_ns == _T0 + 1 * MS
    assert acting.outputs == {"steer": 0.5, "drive": 0.5}


def test_the_drive_is_written_before_the_steering(make: _Make) -> None:
    assert list(make(_plan()).run(10).outputs) == ["drive", "steer"]


def test_states_are_sent_on_change_and_at_50_hz(make: _Make) -> None:
    bench = make(_plan())
    _drives(bench)
    bench.run(100)
    times = [state.at_ns for state in bench.states]
    assert _T0 + 1 * MS in times
    gaps = [after - before for before, after in itertools.pairwise(times)]
    assert max(gaps) <= 20 * MS


def test_states_without_news_are_sent_at_every_second_tick(make: _Make) -> None:
    bench = make(_plan())
    bench.clock.at(25, lambda: bench.send(command(7, _T0)))
    bench.run(95)
    at_ms = [(state.at_ns - _T0) / MS for state in bench.states]
    assert at_ms == [0.0, 20.0, 25.0, 40.0, 60.0, 80.0, 95.0]  # It ends at 95 ms.
    assert {(s.applied_session, s.applied_seq, s.applied_ns) for s in bench.states} == {
        (0, None, None)
    }


def test_each_output_is_written_once_a_tick(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make(_plan())
    drive = bench.guard._outputs._drivers[0][1]
    written: list[int] = []
    monkeypatch.setattr(drive, "write", lambda value, now_ns: written.append(now_ns) or value)
    bench.run(45)
    assert written == [_T0 + ms * MS for ms in (0, 10, 20, 30, 40, 45)]


def test_the_guard_waits_for_the_supervisor_and_a_living_daemon(make: _Make) -> None:
    bench = make(_plan())
    heart, daemon = bench.heartbeat.fileno(), bench._channel.filenos()
    bench.clock.at(15, bench.daemon.close)
    bench.clock.at(50, lambda: setattr(bench.guard, "ended", "the test is over"))
    bench.guard.run(bench.heartbeat)
    assert bench.clock.waits[0] == ([heart, *daemon], 0.01)
    assert bench.clock.waits[-1] == ([heart], 0.01)
    assert bench.clock.beat == bench.heartbeat.beat
    assert bench.guard._rules.disarmed == "Disarmed: the daemon has ended."


def test_a_refusal_is_sent_once(make: _Make) -> None:
    bench = make(_plan())
    bench.clock.at(5, lambda: bench.send(command(7, _T0)))
    bench.run(50)
    refused = [(s.refused, s.refused_seq) for s in bench.states if s.refused]
    assert refused == [("Command 7 is refused. Not armed.", 7)]


def test_reasons_of_a_state_fit_into_a_datagram(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor = _Sensor()
    bench = _with(make, monkeypatch, {"bumper": sensor}, "bump")
    bench.clock.at(5, lambda: bench.send(Order("disarm", reason="x" * 200), command(7, _T0)))
    bench.clock.at(35, lambda: bench.send(arm(_T0 + 35 * MS)))
    bench.clock.at(36, lambda: setattr(sensor, "reading", RobotError("y" * 900)))
    bench.clock.at(56, lambda: setattr(sensor, "reading", RobotError("z" * 1100)))
    state = bench.run(80)
    refused = [s.refused for s in bench.states if s.refused]
    assert refused == [f"Command 7 is refused. Disarmed: {'x' * 200}"]
    assert any(s.stop_reason.endswith("y" * 900) for s in bench.states)
    assert state.stop_reason.endswith("z...")
    assert len(state.stop_reason) == 1003


def test_a_full_socket_drops_states_and_does_not_stop_the_guard(make: _Make) -> None:
    bench = make(_plan())
    bench.daemon.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    bench.clock.at(20_000, lambda: bench.send(arm(bench.clock.time_ns)))
    bench.clock.at(20_100, bench.read)
    assert bench.run(20_200).armed


def test_the_enable_pin_is_toggled_at_every_tick(make: _Make) -> None:
    bench = make(_plan(enable_pin=5))
    pin = bench.factory.pin(5)
    bench.clock.at(1, pin.clear_states)
    bench.run(101)
    assert len(pin.states) - 1 == 10
    bench.guard.close()
    assert not pin.state


def test_the_button_is_an_emergency_stop(make: _Make) -> None:
    bench = make(_plan(stop_pin=6))
    _drives(bench)
    bench.clock.at(45, lambda: bench.factory.pin(6).drive_low())
    bench.clock.at(60, lambda: bench.send(arm(_T0, 1)))
    state = bench.run(80)
    assert (state.armed, state.emergency, state.emergencies) == (False, True, 1)
    refused = [(s.refused, s.refused_seq) for s in bench.states if "button" in s.refused]
    assert refused == [("Not armed: the emergency button is pressed.", None)]
    assert bench.duty(22) == 0.0


@pytest.mark.parametrize("reads", [True, False])
def test_a_lost_daemon_disarms(make: _Make, reads: bool) -> None:
    """Whether or not it leaves states unread, which resets the connection."""
    bench = make(_plan())
    _drives(bench)
    duties: list[float] = []
    bench.clock.at(14, lambda: reads and bench.read())
    bench.clock.at(15, lambda: (duties.append(bench.duty(22)), bench.daemon.close()))
    bench.clock.at(16, lambda: duties.append(bench.duty(22)))
    bench.clock.at(50, lambda: setattr(bench.guard, "ended", "the test is over"))
    bench.guard.run(bench.heartbeat)
    assert duties == [0.5, 0.0]


def test_a_lost_supervisor_ends_the_guard(make: _Make) -> None:
    bench = make(_plan())
    bench.clock.at(15, bench.supervisor.close)
    bench.guard.run(bench.heartbeat)
    assert bench.guard.ended == "the supervisor has ended"


def test_an_order_or_a_signal_ends_the_guard(make: _Make) -> None:
    bench = make(_plan())
    assert bench.guard.ended == ""
    bench.clock.at(15, lambda: bench.send(Order("end")))
    bench.guard.run(bench.heartbeat)
    assert bench.guard.ended == "the daemon ended it"
    assert bench.read()[-1].stop_reason == "Disarmed: the guard ends."
    bench.guard.ended = ""
    bench.guard.end(signal.SIGTERM, None)
    bench.guard.end(signal.SIGINT, None)
    assert bench.guard.ended == "ended by SIGTERM"
    bench.guard.close()
    assert bench.guard.is_safe is True


def test_the_log_has_a_line_for_each_event(
    make: _Make, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    sensor = _Sensor()
    bench = _with(make, monkeypatch, {"bumper": sensor}, "bump")
    _drives(bench)
    for ms, order in ((15, b"{"), (16, b"{"), (17, b"x" * 300)):
        bench.clock.at(ms, lambda order=order: bench.daemon.send(order))
    bench.clock.at(25, lambda: setattr(sensor, "reading", RobotError("No answer.")))
    bench.clock.at(45, lambda: setattr(sensor, "reading", {"bump": 0.0}))
    bench.clock.at(65, lambda: bench.send(Order("disarm", reason="lunch.")))
    bench.run(80)

    def fail() -> None:
        raise RobotError("No power.")

    monkeypatch.setattr(bench.guard._outputs._drivers[1][1], "close", fail)
    bench.guard.close()
    assert bench.guard.is_safe is False
    malformed = "datagrams were no orders: Invalid order: "
    said = [record.getMessage() for record in caplog.records]
    assert said[:2] == ["Not armed.", "Armed."]
    assert [line.partition("Invalid order: ")[0] for line in said[2:5]] == [
        f"{number} {malformed.removesuffix('Invalid order: ')}" for number in (1, 2, 3)
    ]
    assert said[5:] == [
        "Sensor bumper fails: No answer.",
        "Sensor bumper responds again.",
        "Disarmed: lunch.",
        "Output steer: No power.",
    ]


def test_outputs_that_are_not_ready_are_not_armed(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Meanwhile the guard stays alive, and later orders of the same round count."""
    bench = make(_plan(enable_pin=5))
    pin = bench.factory.pin(5)

    def ready(stay_alive: Callable[[], None]) -> str:
        pin.clear_states()
        beats.append(len(bench.supervisor.recv(1 << 16)))
        stay_alive()
        beats.append(len(bench.supervisor.recv(1 << 16)))
        assert len(pin.states) == 2
        return "servo 3 is hot."

    beats: list[int] = []
    monkeypatch.setattr(bench.guard._outputs, "ready", ready)
    bench.clock.at(15, lambda: bench.send(arm(_T0), Order("emergency", reason="fire.")))
    state = bench.run(30)
    refused = [(s.refused, s.refused_seq) for s in bench.states if s.refused]
    assert refused == [("Not armed: servo 3 is hot.", None)]
    assert beats[1] == 1
    assert state.stop_reason == "Emergency stop: fire."


def test_a_failed_output_stops_all_until_rearmed(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make(_plan(enable_pin=5))
    _drives(bench)
    drive, steer = (driver for _, driver in bench.guard._outputs._drivers)

    def fail(value: float, now_ns: int) -> float:
        raise RobotError("Output drive does not answer.")

    edges: list[int] = []
    pin = bench.factory.pin(5)
    bench.clock.at(31, lambda: monkeypatch.setattr(drive, "write", fail))
    bench.clock.at(45, lambda: edges.append(len(pin.states)))
    bench.clock.at(45, lambda: bench.send(arm(_T0 + 45 * MS, 1)))
    bench.clock.at(60, lambda: edges.append(len(pin.states)))
    bench.clock.at(60, monkeypatch.undo)
    bench.clock.at(85, lambda: bench.send(arm(_T0 + 85 * MS, 2), command(2, _T0 + 85 * MS)))
    state = bench.run(100)
    assert edges[0] == edges[1]
    assert len(pin.states) > edges[1]
    stopped = [s for s in bench.states if s.emergency]
    assert "Output drive does not answer." in stopped[0].stop_reason
    assert all(s.outputs["steer"] == 0.0 and s.applied == (0.0, 0.0) for s in stopped)
    assert "NOT at rest: Output drive: Output drive does not answer." in stopped[0].stop_reason
    assert "NOT at rest" not in stopped[-1].stop_reason
    assert stopped[-1].emergencies == 2  # Arming before the output recovered failed again.
    assert stopped[-1].stop_reason == (
        "Emergency stop: Output drive: Output drive does not answer."
    )
    assert {(s.applied_session, s.applied_ns) for s in stopped} == {(0, None)}
    assert state.applied_seq == 2
    assert steer.write(0.0, 0) == 0.0


def test_all_failures_of_outputs_are_reported(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also an error without a text; drivers get the time of the round."""
    bench = make(_plan())
    _drives(bench)
    times: list[int] = []

    def fail(value: float, now_ns: int) -> float:
        times.append(now_ns)
        raise ValueError

    for _, driver in bench.guard._outputs._drivers:
        bench.clock.at(31, lambda driver=driver: monkeypatch.setattr(driver, "write", fail))
    state = bench.run(50)
    failures = "Output drive: ValueError Output steer: ValueError"
    assert state.stop_reason == f"NOT at rest: {failures} Emergency stop: ValueError"
    assert times[0] == _T0 + 31 * MS
    assert set(times) == {_T0 + ms * MS for ms in (31, 40, 50)}
    monkeypatch.undo()
    bench.guard.close()
    assert bench.guard.is_safe is True


def test_outputs_are_released_once_per_stop(make: _Make) -> None:
    plan = _plan()
    bench = make(replace(plan, stop=replace(plan.stop, then="release")))
    released: list[str] = []
    for output, driver in bench.guard._outputs._drivers:
        original = driver.release
        driver.release = lambda name=output.name, original=original: (
            released.append(name),
            original(),
        )
    _drives(bench)
    bench.run(300)
    assert released == ["drive", "steer"] * 2


def test_a_restart_after_a_failure_starts_in_emergency_stop(make: _Make) -> None:
    bench = make(_plan(), after_failure=True)
    bench.clock.at(1, lambda: bench.send(arm(_T0, 1, person=False), command(1, _T0)))
    state = bench.run(20)
    assert (state.armed, state.emergency, state.emergencies) == (False, True, 1)
    text = "Emergency stop: the robot's processes failed and started afresh."
    assert state.stop_reason == text
    assert not any(state.applied_seq for state in bench.states)
    bench.guard.ended = ""
    bench.clock.at(21, lambda: bench.send(arm(_T0, 1)))
    assert bench.run(40).armed


def test_an_invalid_order_ends_the_previous_command(make: _Make) -> None:
    bench = make(_plan())
    _drives(bench)
    duties: list[float] = []
    nan = encode(command(2, _T0)).replace(b"0.5", b"NaN")
    bench.clock.at(55, lambda: duties.append(bench.duty(22)))
    bench.clock.at(56, lambda: bench.daemon.send(nan))
    bench.clock.at(57, lambda: duties.append(bench.duty(22)))
    assert bench.run(60).armed
    assert duties == [0.5, 0.0]
    assert any(state.refused.startswith("Invalid order: ") for state in bench.states)


def test_a_controller_that_does_not_follow_yet_is_reported(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = _plan()
    bench = make(plan)
    drive = bench.guard._outputs._drivers[0][1]
    monkeypatch.setattr(drive, "write", lambda value, now_ns: 0.0)
    _drives(bench)
    bench.clock.at(50, monkeypatch.undo)
    state = bench.run(70)
    waiting = [s for s in bench.states if s.applied_seq == 1 and s.at_ns < _T0 + 50 * MS]
    assert {s.applied for s in waiting} == {(0.5, 0.0)}
    assert {s.stop_reason for s in waiting} == {"Output drive: it does not follow."}
    assert (state.applied, state.stop_reason) == ((0.5, 0.5), "")


class _Sensor:
    """A sensor that returns a set reading or raises a set error."""

    def __init__(self) -> None:
        self.reading: dict[str, float] | Exception = {"bump": 0.0}
        self.asked: list[tuple[int, float]] = []

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        self.asked.append((now_ns, direction))
        if isinstance(self.reading, Exception):
            raise self.reading
        return self.reading

    def close(self) -> None:
        self.reading = {}


def _open_by(
    monkeypatch: pytest.MonkeyPatch, opens: Callable[[SensorPlan, object], _Sensor]
) -> None:
    """Open every sensor with a function."""
    chips = defaultdict[str, SimpleNamespace](lambda: SimpleNamespace(open=opens))
    monkeypatch.setattr(sensors, "SENSORS", chips)


def test_sensors_are_read_at_every_tick_and_a_failing_one_stops(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor = _Sensor()
    bench = _with(make, monkeypatch, {"bumper": sensor}, "bump")
    _drives(bench)
    readings: list[dict[str, float] | Exception] = [
        {"bump": 1.0},
        RobotError("No answer."),
        {"bump": float("nan")},
        OSError("No bus."),
        {"bump": 0.0},
    ]
    for i, what in enumerate(readings):
        bench.clock.at(25 + 10 * i, lambda what=what: setattr(sensor, "reading", what))
    bench.run(100)
    reasons = list(dict.fromkeys(state.stop_reason for state in bench.states))
    fails = "Sensor bumper fails, and can protect no longer: "
    assert reasons == [
        "Not armed.",
        "",
        "Not forward: the bumper touched something.",
        f"{fails}No answer.",
        f"{fails}It returned a value that is not finite.",
        f"{fails}No bus.",
    ]
    assert bench.states[-1].bumps == 1
    assert bench.states[-1].sources["collision"] == "bumper"
    assert sensor.asked[:3] == [(_T0, 0.0), (_T0 + 10 * MS, 1.0), (_T0 + 20 * MS, 1.0)]


class _SlowSensor(_Sensor):
    """A sensor that takes time, and records the drive's duty when it is read."""

    def __init__(self, takes_ms: int) -> None:
        super().__init__()
        self.reading = {"speed": 1.0}
        self.takes_ns = takes_ms * MS
        self.bench: _Bench | None = None
        self.driven: list[tuple[int, float]] = []

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        if self.bench is not None:
            self.driven.append((self.bench.clock.time_ns, self.bench.duty(22)))
            self.bench.clock.time_ns += self.takes_ns
        return super().read(now_ns, direction)


def _with(
    make: _Make,
    monkeypatch: pytest.MonkeyPatch,
    drivers: dict[str, _Sensor],
    measures: str,
    **changes: object,
) -> _Bench:
    _open_by(monkeypatch, lambda plan, hardware: drivers[plan.name])
    plans = tuple(SensorPlan(name, "any", measures) for name in drivers)
    return make(_plan(sensors=plans, **changes))


def test_no_stop_waits_for_a_sensor(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = _SlowSensor(takes_ms=15)
    bench = _with(make, monkeypatch, {"wheel": sensor}, "speed")
    _drives(bench)
    sensor.bench = bench
    bench.run(320)
    assert all(duty == 0.0 for t, duty in sensor.driven if t >= _T0 + 250 * MS)
    # The decision uses the time after the sensors were read.
    acting = [state.at_ns for state in bench.states if state.applied_seq == 1]
    assert max(acting) < _T0 + 250 * MS
    assert all(not state.stop_reason for state in bench.states if state.at_ns in acting)


def test_a_sensor_that_is_slow_stops_the_robot(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor = _SlowSensor(takes_ms=0)
    bench = _with(make, monkeypatch, {"wheel": sensor}, "speed")
    _drives(bench)
    sensor.bench = bench
    bench.clock.at(45, lambda: setattr(sensor, "takes_ns", 21 * MS))
    bench.clock.at(150, lambda: setattr(sensor, "takes_ns", 20 * MS))
    bench.run(200)
    text = "Sensor wheel holds up the robot: It took more than 20 ms to answer."
    slow = [state for state in bench.states if state.stop_reason == text]
    assert slow
    assert all(state.outputs["drive"] == 0.0 for state in slow)
    assert slow[0].at_ns == _T0 + 71 * MS
    assert any(state.applied_seq == 1 and state.at_ns > slow[-1].at_ns for state in bench.states)


def test_all_distance_sensors_must_report(make: _Make, monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = _Sensor(), _Sensor()
    left.reading, right.reading = {"distance": 2.0}, {}
    eyes = {"left": left, "right": right}
    limits = LimitPlan(stop_distance_m=0.5)
    bench = _with(make, monkeypatch, eyes, "distance", limits=limits)
    _drives(bench)
    bench.clock.at(55, lambda: setattr(right, "reading", {"distance": 1.0}))
    state = bench.run(100)
    reasons = list(dict.fromkeys(state.stop_reason for state in bench.states))
    assert reasons == ["Not armed.", "Not forward: the distance ahead is not known.", ""]
    assert state.quantities["distance"] == 1.0


def test_the_outputs_rest_before_anything_is_closed(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor = _Sensor()
    bench = _with(make, monkeypatch, {"bumper": sensor}, "bump")
    _drives(bench)
    duties: list[float] = []
    monkeypatch.setattr(sensor, "close", lambda: duties.append(bench.duty(22)))
    bench.run(50)
    assert bench.duty(22) == 0.5
    bench.guard.close()
    assert duties == [0.0]


def test_a_sensor_that_cannot_be_opened_leaves_nothing_open(
    make: _Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, hardware = _Sensor(), make(_plan())
    hardware.guard.close()

    def open_sensor(plan: SensorPlan, hardware: object) -> _Sensor:
        if plan.name == "bad":
            raise RobotError("No answer.")
        return good

    _open_by(monkeypatch, open_sensor)
    plans = tuple(SensorPlan(name, "switch", "bump") for name in ("good", "bad"))
    with pytest.raises(RobotError, match="No answer"):
        Guard(_plan(sensors=plans), hardware, None, logging.getLogger("test"))
    assert good.reading == {}
    OutputDevice(22, pin_factory=hardware.factory).close()  # The pin is free.


class _Program:
    """The program of the guard, in this process, on a fake clock."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock = _Clock()
        self.factory = MockFactory(pin_class=MockPWMPin)
        self.hardware = SimpleNamespace(
            clock=self.clock,
            pin_factory=lambda: self.factory,
            close=lambda: self.did.append("closed"),
        )
        self.did: list[object] = []
        monkeypatch.setattr(process, "connect", self._connect)
        monkeypatch.setattr(process, "run_promptly", self.did.append)
        self.daemon, guards = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.supervisor, heart = socket.socketpair()
        plan = ServePlan(guard=_plan(), daemon={}, hardware=("machine", "argument"))
        self.fds = plan_fd(plan), guards.detach(), heart.detach()

    def _connect(self, *given: str) -> SimpleNamespace:
        self.did += [given, {signal.SIGTERM, signal.SIGINT} <= _blocked()]
        return self.hardware

    def run(self, *first: str) -> list[GuardState]:
        names = ("--plan-fd", "--daemon-fd", "--heartbeat-fd")
        pairs = [text for name, fd in zip(names, self.fds, strict=True) for text in (name, str(fd))]
        try:
            main([*first, *pairs])
        finally:
            found: list[GuardState] = []
            while data := self.daemon.recv(1 << 16):
                found.append(decode_state(data))
            for fd in (self.fds[0], self.fds[2]):  # The supervisor must not see the guard die.
                os.close(fd)
            self.daemon.close()
            self.supervisor.close()
        return found


def _blocked() -> set[int]:
    return {int(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, ())}


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Program]:
    """A program, after which signals are handled as before."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    yield _Program(monkeypatch)
    for number, handler in handlers.items():
        signal.signal(number, handler)
    assert not {signal.SIGTERM, signal.SIGINT} & _blocked()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_program_guards_until_a_signal(
    program: _Program, capfd: pytest.CaptureFixture[str], number: signal.Signals
) -> None:
    program.clock.at(20, lambda: os.kill(os.getpid(), number))
    states = program.run()
    assert program.did == [("machine", "argument"), True, GUARD, "closed"]
    assert states[0].emergencies == 0
    assert capfd.readouterr().err.splitlines() == [
        "guard: guards test car with 2 outputs.",
        "guard: Not armed.",
        f"guard: ends: ended by {number.name}.",
    ]


def test_the_program_after_a_failure_starts_in_emergency_stop(program: _Program) -> None:
    program.clock.at(20, lambda: program.daemon.send(encode(Order("end"))))
    assert program.run(AFTER_FAILURE)[0].emergencies == 1


def test_the_program_exits_with_an_error_if_an_output_is_stuck(
    program: _Program, capfd: pytest.CaptureFixture[str]
) -> None:
    def stick(_: float) -> None:
        raise OSError("stuck")

    program.clock.at(19, lambda: setattr(program.factory.pin(22), "_set_state", stick))
    program.clock.at(19, lambda: program.daemon.send(encode(Order("end"))))
    with pytest.raises(SystemExit) as ended:
        program.run()
    assert ended.value.code == 1
    lines = capfd.readouterr().err.splitlines()
    assert lines[-1] == "guard: ends, for RobotError: not all outputs are at rest"


def test_wrong_arguments_exit_with_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--plan-fd", "3"])
    assert ended.value.code == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("guard: ends, for ValueError: This takes --plan-fd N")
