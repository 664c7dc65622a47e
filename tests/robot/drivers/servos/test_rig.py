"""Simulated servos on their bus: registers, locks, watchdog and faults."""

import pytest

from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.simulation import Rig
from tests.robot.drivers.servos.rigs import NAMES, feetech, line, servo

MS = 1_000_000


@pytest.fixture
def bus() -> Rig:
    """Three Dynamixel servos."""
    return line(*map(servo, NAMES[:3]))


def _write(bus: Rig, at: int, value: int, size: int = 1) -> int:
    """Write a register of servo 1 and return the error of its reply."""
    return bus.write({1: value.to_bytes(size, "little", signed=value < 0)}, at)[1].error


def _read(bus: Rig, at: int, size: int) -> ServoReply | None:
    """Read a register of servo 1."""
    return bus.read([1], at, size).get(1)


def _pull(bus: Rig, watchdog: int = 0) -> None:
    """Enable torque on servo 1 with a goal current of 200 counts."""
    for at, value, size in ((11, 0, 1), (98, watchdog, 1), (102, 200, 2), (64, 1, 1)):
        assert _write(bus, at, value, size) == 0


def test_a_read_is_answered_by_the_addressed_servo(bus: Rig) -> None:
    """Model number and firmware; an id that is not on the bus gets no reply."""
    assert bus.read([2], 0, 2) == {2: ServoReply(0, b"\xa6\x04")}
    assert bus.read([2], 6, 1) == {2: ServoReply(0, b"\x34")}
    assert bus.read([9], 0, 2) == {}


def test_a_mute_servo_silences_those_after_it_in_a_sync_read(bus: Rig) -> None:
    bus.servos[2].mute = True
    assert bus.read([1, 2, 3], 64, 1) == {1: ServoReply(0, b"\0")}


@pytest.mark.parametrize(
    ("at", "value", "size", "error"),
    [
        (64, 2, 1, 4),  # Out of range.
        (11, 2, 1, 4),  # No such mode.
        (38, 1751, 2, 4),
        (98, 128, 1, 4),
        (102, 1, 1, 5),  # Half a register.
        (126, 1, 2, 7),  # Read only.
        (0, 1, 2, 7),
        (99, 1, 1, 7),  # Unused address.
        (146, 1, 1, 7),
    ],
)
def test_an_invalid_write_is_refused(bus: Rig, at: int, value: int, size: int, error: int) -> None:
    """An invalid write returns the error code of the manual and changes no register."""
    assert _write(bus, at, value, size) == error
    assert _read(bus, 64, 1) == (0, b"\0")


def test_eeprom_is_locked_while_torque_is_on(bus: Rig) -> None:
    assert [_write(bus, at, v) for at, v in ((64, 1), (9, 0), (64, 0), (9, 0))] == [0, 7, 0, 0]


def test_goals_have_a_limit_which_a_change_of_the_mode_sets(bus: Rig) -> None:
    assert _write(bus, 38, 100, 2) == 0
    assert _write(bus, 11, 0) == 0
    assert _read(bus, 102, 2) == (0, b"\x64\0")
    assert [_write(bus, 102, value, 2) for value in (101, -101, 100, -100)] == [6, 6, 0, 0]


def test_a_silent_host_trips_the_watchdog(bus: Rig) -> None:
    """When the watchdog expires, current drops to 0 and goals are refused until it is cleared."""
    _pull(bus, watchdog=5)
    bus.advance(99 * MS)
    assert bus.servos[1].pulls_a == pytest.approx(0.2)
    bus.advance(2 * MS)
    assert bus.servos[1].pulls_a == 0.0
    assert _read(bus, 98, 1) == (0, b"\xff")
    assert [_write(bus, at, v, n) for at, v, n in ((102, 9, 2), (98, 0, 1), (102, 9, 2))] == [
        4,
        0,
        0,
    ]


def test_any_instruction_feeds_the_watchdog(bus: Rig) -> None:
    """An instruction to another servo also resets the watchdog; see the module for why."""
    _pull(bus, watchdog=5)
    for _ in range(5):
        bus.advance(80 * MS)
        bus.read([2], 6, 1)
    assert bus.servos[1].pulls_a > 0.0
    bus.advance(110 * MS)
    assert bus.servos[1].pulls_a == 0.0


def test_the_watchdog_does_not_run_without_torque(bus: Rig) -> None:
    assert _write(bus, 98, 5) == 0
    bus.advance(500 * MS)
    assert _read(bus, 98, 1) == (0, b"\x05")
    _pull(bus, watchdog=5)
    bus.advance(50 * MS)
    assert bus.servos[1].pulls_a > 0.0


def test_a_hardware_error_disables_torque_until_a_reboot(bus: Rig) -> None:
    _pull(bus)
    bus.servos[1].overload()
    assert _read(bus, 70, 1) == (0x80, b"\x20")
    assert _read(bus, 64, 1) == (0x80, b"\x00")
    assert _write(bus, 64, 1) == 0x84
    bus.servos[1].lose_power()
    bus.advance(299 * MS)
    assert _read(bus, 70, 1) is None  # Still booting.
    bus.advance(2 * MS)
    assert _read(bus, 70, 1) == (0, b"\x00")
    assert _write(bus, 64, 1) == 0


def test_a_reboot_keeps_the_eeprom_and_clears_the_turn_count() -> None:
    """Mode and limits survive a power loss; torque, watchdog and turn count are reset."""
    bus = line(servo("FDP", zero=65190))
    assert _write(bus, 38, 123, 2) == 0
    assert _write(bus, 98, 5) == 0
    before = bus.servos[1].register(132)
    bus.servos[1].lose_power()
    bus.advance(400 * MS)
    assert (bus.servos[1].register(38), bus.servos[1].register(98)) == (123, 0)
    after = bus.servos[1].register(132)
    assert 0 <= after < 4096
    assert (before - after) % 4096 == 0


def _feetech(bus: Rig, at: int, value: int, size: int = 1) -> int:
    """Write a register of a Feetech servo, and return its new value."""
    bus.write({1: value.to_bytes(size, "little")}, at)
    return bus.servos[1].register(at)


def test_a_feetech_servo_keeps_its_eeprom_locked() -> None:
    """Without a reason, it ignores writes until the lock is 0."""
    bus = line(feetech("FDP"))
    assert _feetech(bus, 16, 100, 2) == 1000
    assert _feetech(bus, 55, 0) == 0
    assert _feetech(bus, 16, 100, 2) == 100
    assert _feetech(bus, 48, 101, 2) == 1000  # Beyond the maximum torque.
    assert _feetech(bus, 48, 100, 2) == 100


def test_a_feetech_servo_pulls_without_a_host_until_its_power_is_cut() -> None:
    """It has no watchdog; after the power is back it has no torque and one turn."""
    bus = line(feetech("FDP", zero=6519))
    before = bus.servos[1].register(56)
    _feetech(bus, 42, before + 1000, 2)
    _feetech(bus, 40, 1)
    bus.advance(500 * MS)
    assert bus.servos[1].pulls_a == pytest.approx(2.44)
    assert bus.servos[1].register(56) > before + 50
    bus.set_power(on=False)
    bus.advance(10 * MS)
    assert (bus.servos[1].pulls_a, bus.read([1], 40, 1)) == (0.0, {})
    bus.set_power(on=True)
    bus.advance(299 * MS)
    assert bus.read([1], 40, 1) == {}
    bus.advance(1 * MS)
    assert bus.read([1], 40, 1) == {1: ServoReply(0, b"\0")}
    assert 0 <= bus.servos[1].register(56) < 4096


def test_a_feetech_servo_reports_its_errors_in_each_reply() -> None:
    """The error byte is its status, and an overload takes its torque."""
    bus = line(feetech("FDP"))
    assert _feetech(bus, 40, 1) == 1
    bus.servos[1].overload()
    assert bus.read([1], 40, 1) == {1: ServoReply(0x20, b"\0")}
    assert _feetech(bus, 40, 1) == 0
