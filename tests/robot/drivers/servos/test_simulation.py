"""Simulated servos on their bus: registers, locks, watchdog and faults."""

import pytest

from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.hardware import ServoReply
from tests.robot.drivers.servos.rigs import NAMES, feetech, line, servo

MS = 1_000_000


@pytest.fixture
def bus() -> Rig:
    """Three Dynamixel servos."""
    return line(*map(servo, NAMES[:3]))


def _write(bus: Rig, name: str, *values: int) -> list[int]:
    """Write values to a register of servo 1, and return the errors of its replies."""
    register = bus.servos[1].family[name]
    data = [register.encode(value) for value in values]
    return [bus.write({1: one}, register.address)[1].error for one in data]


def _read(bus: Rig, name: str) -> tuple[int, int] | None:
    """Read a register of servo 1, and return its error and value."""
    register = bus.servos[1].family[name]
    reply = bus.read([1], register.address, register.size).get(1)
    return None if reply is None else (reply.error, register.decode(reply.data))


def _pull(bus: Rig, watchdog: int = 0) -> None:
    """Enable torque on servo 1 with a goal current of 200 counts."""
    for name, value in (("mode", 0), ("mark", watchdog), ("goal", 200), ("torque_enable", 1)):
        assert _write(bus, name, value) == [0]


def test_a_read_is_answered_by_the_addressed_servos(bus: Rig) -> None:
    """Model number and firmware; a silent id silences those after it in a sync read."""
    assert bus.read([2], 0, 2) == {2: ServoReply(0, b"\xa6\x04")}
    assert bus.read([2], 6, 1) == {2: ServoReply(0, b"\x34")}
    assert bus.read([9], 0, 2) == {}
    bus.servos[2].mute = True
    assert bus.read([1, 2, 3], 64, 1) == {1: ServoReply(0, b"\0")}


def test_goals_have_a_limit_which_a_change_of_the_mode_sets(bus: Rig) -> None:
    assert _write(bus, "most", 100) == _write(bus, "mode", 0) == [0]
    assert _read(bus, "goal") == (0, 100)
    assert _write(bus, "goal", 101, -101, 100, -100) == [6, 6, 0, 0]


def test_a_silent_host_trips_the_watchdog(bus: Rig) -> None:
    """When the watchdog expires, current drops to 0 and goals are refused until it is cleared.

    An instruction to another servo also feeds it; see the module for why.
    """
    _pull(bus, watchdog=5)
    for _ in range(5):
        bus.advance(80 * MS)
        bus.read([2], 6, 1)
    bus.advance(99 * MS)
    assert bus.servos[1].pulls_a == pytest.approx(0.2)
    bus.advance(2 * MS)
    assert bus.servos[1].pulls_a == 0.0
    assert _read(bus, "mark") == (0, 0xFF)
    assert _write(bus, "goal", 9) == [4]
    assert _write(bus, "mark", 0) == _write(bus, "goal", 9) == [0]


def _position(bus: Rig) -> int:
    found = _read(bus, "position")
    assert found is not None
    return found[1]


def test_a_reboot_keeps_the_eeprom_and_clears_the_turn_count() -> None:
    """Limits survive a power loss; an error, which blocks torque, is reset, and the turn count."""
    bus = line(servo("FDP", zero=65190))
    assert _write(bus, "most", 123) == _write(bus, "mark", 5) == [0]
    before = _position(bus)
    bus.break_servo("FDP", "overload")
    assert _read(bus, "hardware_error") == (0x80, 0x20)
    assert _write(bus, "torque_enable", 1) == [0x84]
    bus.servos[1].lose_power()
    bus.advance(299 * MS)
    assert _read(bus, "hardware_error") is None  # Still booting.
    bus.advance(2 * MS)
    assert _read(bus, "hardware_error") == (0, 0)
    assert (_read(bus, "most"), _read(bus, "mark")) == ((0, 123), (0, 0))
    assert 0 <= _position(bus) < 4096
    assert (before - _position(bus)) % 4096 == 0


def _feetech(bus: Rig, name: str, value: int) -> int:
    """Write a register of a Feetech servo, and return its new value."""
    _write(bus, name, value)
    return bus.servos[1].values[name]


def test_a_feetech_servo_keeps_its_eeprom_locked() -> None:
    """Without a reason, it ignores writes until the lock is 0."""
    bus = line(feetech("FDP"))
    assert _feetech(bus, "most", 100) == 1000
    assert _feetech(bus, "lock", 0) == 0
    assert _feetech(bus, "most", 100) == 100
    assert _feetech(bus, "goal", 101) == 1000  # Beyond the maximum torque.
    assert _feetech(bus, "goal", 100) == 100


def test_a_feetech_servo_pulls_without_a_host_until_its_power_is_cut() -> None:
    """The servo has no watchdog; after the power is back it has no torque and one turn."""
    bus = line(feetech("FDP", zero=6519))
    before = _position(bus)
    _feetech(bus, "goal_position", before + 1000)
    _feetech(bus, "torque_enable", 1)
    bus.advance(500 * MS)
    assert bus.servos[1].pulls_a == pytest.approx(2.44)
    assert _position(bus) > before + 50
    bus.set_power(on=False)
    bus.advance(10 * MS)
    assert (bus.servos[1].pulls_a, _read(bus, "torque_enable")) == (0.0, None)
    bus.set_power(on=True)
    bus.advance(299 * MS)
    assert _read(bus, "torque_enable") is None
    bus.advance(1 * MS)
    assert _read(bus, "torque_enable") == (0, 0)
    assert 0 <= _position(bus) < 4096
