"""Messages of faults, and their effect on the tendons."""

from collections.abc import Callable
from typing import Literal

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.bus import BusState
from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.simulation import ServoPlan
from tests.robot.drivers.servos.rigs import CYCLE_NS, MODEL, NAMES, Rig, of, settings


def _hot(rig: Rig) -> None:
    rig.twin("EIP").motor.temperature = 68.0


def _switched_off_by_heat(rig: Rig) -> None:
    rig.twin("EIP").motor.temperature = 75.0


def _low(rig: Rig) -> None:
    # Below the voltage limit of the servo, 3.5 V.
    rig.twin("EIP").volts = 3.4


def _overloaded(rig: Rig) -> None:
    rig.twin("EIP").overload()


def _mute(rig: Rig) -> None:
    rig.twin("EIP").mute = True


def _deaf(rig: Rig) -> None:
    rig.twin("EIP").deaf = True


def _late(rig: Rig) -> None:
    rig.port.late_ns[3] = 8_000_000


def _damaged(rig: Rig) -> None:
    rig.port.damaged.add(3)


def _snapped(rig: Rig) -> None:
    rig.twin("EIP").motor.snapped = True


_FAULTS: list[tuple[Callable[[Rig], None], str]] = [
    (_hot, "has 68 C, more than 65 C"),
    (_switched_off_by_heat, "switched itself off: it is overheated. Only a reboot"),
    (_low, "switched itself off: its voltage is out of range"),
    (_overloaded, "switched itself off: it is overloaded"),
    (_mute, "does not answer, 5 cycles in a row"),
    (_deaf, "does not answer, 5 cycles in a row"),
    (_late, "answers too late, 5 cycles in a row"),
    (_damaged, "does not answer, 5 cycles in a row"),
    # Without load a Feetech servo with a low limit is slow, so its speed does not show this.
    (_snapped, "has lost its tendon: it winds in at"),
]


@pytest.mark.parametrize(
    ("family", "fault", "words"),
    [
        *(("Dynamixel", fault, words) for fault, words in _FAULTS),
        *(("Feetech", fault, words) for fault, words in _FAULTS if fault is not _snapped),
    ],
)
def test_a_fault_of_one_servo_stops_all(
    family: str, fault: Callable[[Rig], None], words: str
) -> None:
    """A fault is reported, the other servos ramp down, and finally no servo pulls."""
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


def test_other_servos_are_read_while_one_is_mute() -> None:
    """The servos after a mute one are read in a second packet; stale readings are not repeated."""
    rig = Rig().start()
    rig.run(4.0, 3)
    rig.twin("FDS").mute = True
    state = rig.run(4.0)
    assert set(state.servos) == set(NAMES) - {"FDS"}
    assert state.mode == "held"


def test_a_mute_servo_costs_one_more_packet_in_a_cycle() -> None:
    """Each retry waits for a timeout, during which the guard cannot stop anything."""
    rig = Rig(settings(most_missed=50)).start()
    rig.twin("FDS").mute = True
    rig.run(4.0)
    rig.port.sent.clear()
    rig.run(4.0, 4)
    assert [len(p) for p in rig.port.sent if p[7] == 0x82 and p[8] == 126] == [20, 15] * 4


def test_a_short_silence_is_tolerated() -> None:
    """A loose plug that recovers within three cycles causes no stop."""
    rig = Rig().start()
    rig.twin("FDS").mute = True
    rig.run(4.0, 3)
    rig.twin("FDS").mute = False
    state = rig.run(4.0, 3)
    assert set(state.servos) == set(NAMES)
    assert state.reason == ""


def test_three_mute_servos_are_each_found() -> None:
    """All three are reported as faults."""
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
    """The turn count is lost with power, so no length is reported afterwards."""
    rig = Rig(settings(most_missed=most_missed)).start()
    rig.run(4.0, 5)
    rig.twin("EIP").lose_power()
    state = _until(rig, lambda s: "EIP" in s.servos)
    assert state.servos["EIP"].length_m is None
    assert words in state.faults["EIP"]
    assert "EIP" not in rig.bus.zeros
    assert "FDP" in rig.bus.zeros


def test_hold_after_a_fault_requires_setup() -> None:
    """After setting up again, the bus works as before."""
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


@pytest.mark.parametrize("on_trip", ["coast", "release"])
def test_servos_stop_without_cycles(on_trip: Literal["coast", "release"]) -> None:
    """Servos release after 100 ms without a packet, and the next cycle reports the reason."""
    plans = [ServoPlan(i, MODEL, on_trip=on_trip) for i in range(1, 8)]
    rig = Rig(plans=plans).start()
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
    """Without any packet, the watchdogs release all servos."""
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
