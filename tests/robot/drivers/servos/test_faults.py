"""Messages of faults, and their effect on the tendons."""

from collections.abc import Callable

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.bus import BusState
from shapechanger.robot.drivers.servos.registers import ServoReply
from tests.robot.drivers.servos.rigs import CYCLE_NS, NAMES, Rig, of, settings

_Fault = Callable[[Rig], object]


def _set(attribute: str, value: float) -> _Fault:
    """Return a fault that sets an attribute of the servo EIP or of its motor."""

    def fault(rig: Rig) -> None:
        servo = rig.twin("EIP")
        setattr(servo if hasattr(servo, attribute) else servo.motor, attribute, value)

    return fault


# Without load a Feetech servo with a low limit is slow, so its speed does not show this.
_SNAPPED = (_set("snapped", True), "has lost its tendon: it winds in at")
_FAULTS: list[tuple[_Fault, str]] = [
    (_set("temperature", 68.0), "has 68 C, more than 65 C"),
    (_set("temperature", 75.0), "switched itself off: it is overheated. Only a reboot"),
    # Below the voltage limit of the servo, 3.5 V.
    (_set("volts", 3.4), "switched itself off: its voltage is out of range"),
    (lambda rig: rig.twin("EIP").overload(), "switched itself off: it is overloaded"),
    (_set("mute", True), "does not answer, 5 cycles in a row"),
    (_set("deaf", True), "does not answer, 5 cycles in a row"),
    (lambda rig: rig.port.late_ns.update({3: 8_000_000}), "answers too late, 5 cycles in a row"),
    (lambda rig: rig.port.damaged.add(3), "does not answer, 5 cycles in a row"),
]


@pytest.mark.parametrize(
    ("family", "fault", "words"),
    [
        *(("Dynamixel", fault, words) for fault, words in (*_FAULTS, _SNAPPED)),
        *(("Feetech", fault, words) for fault, words in _FAULTS),
    ],
)
def test_a_fault_of_one_servo_stops_all(family: str, fault: _Fault, words: str) -> None:
    rig = Rig(of(family, most_missed=5)).start()
    rig.run(14.0, 20)
    fault(rig)
    state = _until(rig, lambda s: s.mode != "held")
    assert list(state.faults) == ["EIP"]
    assert state.faults["EIP"].startswith("Servo EIP (id 3) ")
    assert words in state.faults["EIP"]
    rig.run(None)
    # The faulty servo has released; the others have begun to ramp down.
    if not rig.twin("EIP").deaf:
        assert rig.twin("EIP").pulls_a == 0.0
    assert rig.twin("FDP").pulls_a > 0.05
    _until(rig, lambda s: s.mode in ("off", "silent"))
    rig.line.advance(100_000_000)  # The watchdogs of unreachable servos expire.
    if family == "Feetech" and rig.twin("EIP").deaf:
        assert rig.twin("EIP").pulls_a > 0.0
        rig.line.set_power(on=False)
    assert rig.pulls() == [0.0] * 7


def _until(rig: Rig, holds: Callable[[BusState], bool], cycles: int = 120) -> BusState:
    for _ in range(cycles):
        if holds(state := rig.run(10.0)):
            return state
    raise AssertionError(f"The condition was never met: {state}")


def test_a_mute_servo_costs_one_more_packet_in_a_cycle() -> None:
    """Each retry waits for a timeout, during which the guard cannot stop anything."""
    rig = Rig(settings(most_missed=50)).start()
    rig.twin("FDS").mute = True
    rig.run(4.0)
    rig.port.sent.clear()
    rig.run(4.0, 4)
    assert [len(p) for p in rig.port.sent if p[7] == 0x82 and p[8] == 126] == [20, 15] * 4


def test_a_short_silence_is_tolerated() -> None:
    """The others are read in a second packet; a plug that recovers causes no stop."""
    rig = Rig().start()
    rig.run(4.0, 3)
    rig.twin("FDS").mute = True
    state = rig.run(4.0, 3)
    assert (set(state.servos), state.mode) == (set(NAMES) - {"FDS"}, "held")
    rig.twin("FDS").mute = False
    state = rig.run(4.0, 3)
    assert (set(state.servos), state.reason) == (set(NAMES), "")


def test_three_mute_servos_are_each_found() -> None:
    rig = Rig().start()
    for name in ("FDP", "EDC", "PI"):
        rig.twin(name).mute = True
    state = rig.run(4.0, 8)
    assert set(state.faults) == {"FDP", "EDC", "PI"}


def test_an_unconfirmed_release_is_left_to_the_watchdog() -> None:
    """If a servo does not confirm its release, the driver sends nothing, so watchdogs expire."""
    rig = Rig().start()
    rig.run(10.0, 5)
    rig.twin("EIP").deaf = True
    state = _until(rig, lambda s: s.mode == "silent")
    assert "EIP did not confirm to let go, so nothing is sent any more" in state.faults[""]
    rig.port.sent.clear()
    rig.run(10.0, 3)
    assert rig.port.sent == []


@pytest.mark.parametrize(
    ("most_missed", "words"),
    [
        (50, "has restarted, for example after a dip of its power, and lost its zero"),
        (5, "does not answer, 5 cycles in a row"),
    ],
)
def test_a_power_dip_invalidates_the_zero(most_missed: int, words: str) -> None:
    rig = Rig(settings(most_missed=most_missed)).start()
    rig.run(4.0, 5)
    rig.twin("EIP").lose_power()
    state = _until(rig, lambda s: "EIP" in s.servos)
    assert state.servos["EIP"].length_m is None
    assert words in state.faults["EIP"]
    assert state.servos["FDP"].length_m is not None


def test_hold_after_a_fault_requires_setup() -> None:
    rig = Rig().start()
    rig.twin("EIP").mute = True
    _until(rig, lambda s: s.mode != "held")
    with pytest.raises(RobotError, match=r"not held: Servo EIP \(id 3\) does not answer"):
        rig.bus.hold()
    rig.twin("EIP").mute = False
    rig.bus.set_up()
    rig.bus.hold()
    assert rig.run(4.0, 10).reason == ""


def test_a_servo_with_a_hardware_error_needs_a_reboot() -> None:
    """`set_up` reports the error until the servo has been without power."""
    rig = Rig().start()
    rig.twin("EIP").overload()
    _until(rig, lambda s: s.mode == "off")
    with pytest.raises(RobotError, match=r"EIP .* it is overloaded. Only a reboot"):
        rig.bus.set_up()
    rig.twin("EIP").lose_power()
    rig.line.advance(400_000_000)
    rig.bus.set_up()
    rig.bus.hold()
    assert rig.run(4.0, 10).reason == ""


@pytest.mark.parametrize("releases", [False, True])
def test_servos_stop_without_cycles(releases: bool) -> None:
    """Servos release after 100 ms without a packet, and the next cycle reports the reason."""
    rig = Rig().start()
    for one in rig.line.servos.values():
        one.releases_on_trip = releases
    rig.run(10.0, 20)
    rig.line.advance(89_000_000)
    assert min(rig.pulls()) > 0.3
    rig.line.advance(2_000_000)
    assert rig.pulls() == [0.0] * 7
    state = rig.run(10.0, 4)
    assert set(state.faults) == set(NAMES)
    words = "was stopped by its own watchdog: it received nothing for 100 ms"
    assert words in state.faults["DI"] or "has let go by itself" in state.faults["DI"]
    assert rig.pulls() == [0.0] * 7
    assert _until(rig, lambda s: s.mode == "off").mode == "off"


def test_a_cut_cable_trips_the_watchdogs() -> None:
    rig = Rig().start()
    rig.run(10.0, 20)
    rig.port.is_cut = True
    rig.run(10.0, 11)
    assert rig.pulls() == [0.0] * 7


def test_without_watchdogs_an_unplugged_adapter_ends_in_silence_at_once() -> None:
    """Feetech servos would ignore a ramp, so the power switch has to act at once."""
    rig = Rig(of("Feetech")).start()
    rig.run(20.0, 20)
    rig.port.is_gone = True
    state = rig.run(20.0)
    assert state.mode == "silent"
    assert "did not confirm to let go, so nothing is sent any more: [enable] stops" in state.reason
    rig.line.advance(10 * CYCLE_NS)
    assert min(rig.pulls()) > 0.0
    rig.line.set_power(on=False)
    assert rig.pulls() == [0.0] * 7


def test_an_unplugged_adapter_is_reported_and_trips_the_watchdogs() -> None:
    """When the serial device raises on every call, the cycle reports it and does not raise."""
    rig = Rig().start()
    rig.run(10.0, 20)
    rig.port.is_gone = True
    state = rig.run(10.0)
    assert state.faults[""].startswith("The bus at the twin is gone: ")
    assert state.mode == "stopping"
    rig.line.advance(10 * CYCLE_NS)
    assert rig.pulls() == [0.0] * 7
    for i in range(40):
        state = rig.bus.cycle(rig.line.now_ns + i * CYCLE_NS)
    assert state.mode == "silent"


def test_a_goal_that_was_not_applied_is_reported() -> None:
    """Sync writes have no reply, so the driver reads goals back periodically."""
    rig = Rig().start()
    rig.run(4.0, 4)
    servo = rig.twin("PI")
    taken = servo.write

    def deaf_for_goals(at: int, data: bytes) -> ServoReply:
        return ServoReply(0, b"") if at == 102 else taken(at, data)

    servo.write = deaf_for_goals  # type: ignore[method-assign]
    state = rig.run(8.0, 8)
    assert "Servo PI (id 7) has a goal of 136 counts, and was sent 273" in state.reason
