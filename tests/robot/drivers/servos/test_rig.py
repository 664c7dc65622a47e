"""Simulated servo bus: registers, locks, watchdog and faults."""

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.registers import ServoReply
from shapechanger.robot.drivers.servos.rig import SimulatedBus
from shapechanger.robot.drivers.servos.simulation import ServoPlan
from tests.robot.drivers.servos.wire import instruct

MS = 1_000_000


def _line(count: int = 1) -> SimulatedBus:
    return SimulatedBus([ServoPlan(i + 1, "XL330-M077") for i in range(count)])


def _ask(line: SimulatedBus, servo_id: int, code: int, body: bytes = b"") -> ServoReply | None:
    return instruct(line, servo_id, code, body).get(servo_id)


def _write(line: SimulatedBus, at: int, value: int, size: int = 1) -> int | None:
    """Write a register of servo 1 and return the error of its reply."""
    data = at.to_bytes(2, "little") + value.to_bytes(size, "little", signed=value < 0)
    reply = _ask(line, 1, 3, data)
    return None if reply is None else reply.error


def _read(line: SimulatedBus, at: int, size: int) -> ServoReply | None:
    """Read a register of servo 1."""
    return _ask(line, 1, 2, at.to_bytes(2, "little") + size.to_bytes(2, "little"))


def _pull(line: SimulatedBus, counts: int = 200) -> None:
    """Enable torque on servo 1 with a goal current."""
    errors = [_write(line, 11, 0), _write(line, 102, counts, 2), _write(line, 64, 1)]
    assert errors == [0, 0, 0]


def test_a_read_is_answered_by_the_addressed_servo() -> None:
    """A read of model number and firmware returns those of the addressed servo."""
    line = _line(3)
    assert instruct(line, 2, 2, b"\x00\x00\x02\x00") == {2: ServoReply(0, b"\xa6\x04")}
    assert instruct(line, 2, 2, b"\x06\x00\x01\x00") == {2: ServoReply(0, b"\x34")}


def test_an_unknown_id_gets_no_reply() -> None:
    """No servo replies to an id that is not on the bus."""
    assert instruct(_line(), 9, 2, b"\x00\x00\x02\x00") == {}


def test_a_mute_servo_silences_those_after_it_in_a_sync_read() -> None:
    line = _line(3)
    line.servos[2].mute = True
    assert instruct(line, 0xFE, 0x82, b"\x40\x00\x01\x00\x01\x02\x03") == {1: ServoReply(0, b"\0")}


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
def test_an_invalid_write_is_refused(at: int, value: int, size: int, error: int) -> None:
    """An invalid write returns the error code of the manual and changes no register."""
    line = _line()
    before = bytes(line.servos[1].register(64).to_bytes(1, "little"))
    assert _write(line, at, value, size) == error
    assert _read(line, 64, 1) == (0, before)


def test_eeprom_is_locked_while_torque_is_on() -> None:
    """The EEPROM rejects writes while torque is on and accepts them once it is off."""
    line = _line()
    assert [_write(line, at, v) for at, v in ((64, 1), (9, 0), (64, 0), (9, 0))] == [0, 7, 0, 0]


def test_a_goal_beyond_the_current_limit_is_refused() -> None:
    line = _line()
    assert _write(line, 11, 0) == 0
    assert _write(line, 38, 100, 2) == 0
    assert [_write(line, 102, value, 2) for value in (101, -101, 100, -100)] == [6, 6, 0, 0]


def test_a_change_of_the_mode_sets_the_goal_to_the_limit() -> None:
    """Changing the operating mode resets the goal current to the limit, as the manual warns."""
    line = _line()
    assert _write(line, 102, 0, 2) == 0
    assert _write(line, 11, 0) == 0
    assert _read(line, 102, 2) == (0, (1750).to_bytes(2, "little"))


def test_a_silent_host_trips_the_watchdog() -> None:
    """When the watchdog expires, current drops to 0 and goals are refused until it is cleared."""
    line = _line()
    _pull(line)
    assert _write(line, 98, 5) == 0
    line.advance(99 * MS)
    assert line.servos[1].pulls_a == pytest.approx(0.2)
    line.advance(2 * MS)
    assert line.servos[1].pulls_a == 0.0
    assert _read(line, 98, 1) == (0, b"\xff")
    assert _write(line, 102, 10, 2) == 4
    assert _write(line, 98, 0) == 0
    assert _write(line, 102, 10, 2) == 0


def test_any_instruction_feeds_the_watchdog() -> None:
    """An instruction to another servo also resets the watchdog; see the module for why."""
    line = _line(2)
    _pull(line)
    assert _write(line, 98, 5) == 0
    for _ in range(5):
        line.advance(80 * MS)
        _ask(line, 2, 2, b"\x06\x00\x01\x00")
    assert line.servos[1].pulls_a > 0.0
    line.advance(110 * MS)
    assert line.servos[1].pulls_a == 0.0


def test_the_watchdog_does_not_run_without_torque() -> None:
    """The watchdog starts to count when torque is enabled."""
    line = _line()
    assert _write(line, 98, 5) == 0
    line.advance(500 * MS)
    assert _read(line, 98, 1) == (0, b"\x05")
    _pull(line)
    line.advance(50 * MS)
    assert line.servos[1].pulls_a > 0.0


def test_a_hardware_error_disables_torque_until_a_reboot() -> None:
    """After a hardware error, each reply carries the alert bit and torque cannot be enabled."""
    line = _line()
    _pull(line)
    line.servos[1].overload()
    assert _read(line, 70, 1) == (0x80, b"\x20")
    assert _read(line, 64, 1) == (0x80, b"\x00")
    assert _write(line, 64, 1) == 0x84
    line.servos[1].lose_power()
    line.advance(299 * MS)
    assert _read(line, 70, 1) is None  # Still booting.
    line.advance(2 * MS)
    assert _read(line, 70, 1) == (0, b"\x00")
    assert _write(line, 64, 1) == 0


def test_a_reboot_keeps_the_eeprom_and_clears_the_turn_count() -> None:
    """Mode and limits survive a power loss; torque, watchdog and turn count are reset."""
    line = SimulatedBus([ServoPlan(1, "XL330-M077", angle=100.0)])
    assert _write(line, 38, 123, 2) == 0
    assert _write(line, 98, 5) == 0
    before = line.servos[1].register(132)
    line.servos[1].lose_power()
    line.advance(400 * MS)
    assert (line.servos[1].register(38), line.servos[1].register(98)) == (123, 0)
    after = line.servos[1].register(132)
    assert 0 <= after < 4096
    assert (before - after) % 4096 == 0


def test_an_invalid_bus_is_refused() -> None:
    """Two servos with one id raise an error."""
    with pytest.raises(RobotError, match="same id"):
        SimulatedBus([ServoPlan(1), ServoPlan(1)])


def _feetech(line: SimulatedBus, at: int, value: int, size: int = 1) -> int:
    """Write a register of the first Feetech servo, and return its new value."""
    line.write({1: value.to_bytes(size, "little")}, at)
    return line.servos[1].register(at)


def test_a_feetech_servo_keeps_its_eeprom_locked() -> None:
    """Without a reason, it ignores writes until the lock is 0."""
    line = SimulatedBus([ServoPlan(1, "STS3215")])
    assert _feetech(line, 16, 100, 2) == 1000
    assert _feetech(line, 55, 0) == 0
    assert _feetech(line, 16, 100, 2) == 100
    assert _feetech(line, 48, 101, 2) == 1000  # Beyond the maximum torque.
    assert _feetech(line, 48, 100, 2) == 100


def test_a_feetech_servo_pulls_without_a_host_until_its_power_is_cut() -> None:
    """It has no watchdog; after the power is back it has no torque and one turn."""
    line = SimulatedBus([ServoPlan(1, "STS3215", angle=10.0)])
    before = line.servos[1].register(56)
    _feetech(line, 42, before + 1000, 2)
    _feetech(line, 40, 1)
    line.advance(500 * MS)
    assert line.servos[1].pulls_a == pytest.approx(2.44)
    assert line.servos[1].register(56) > before + 50
    line.set_power(on=False)
    line.advance(10 * MS)
    assert (line.servos[1].pulls_a, line.read([1], 40, 1)) == (0.0, {})
    line.set_power(on=True)
    line.advance(299 * MS)
    assert line.read([1], 40, 1) == {}
    line.advance(1 * MS)
    assert line.read([1], 40, 1) == {1: ServoReply(0, b"\0")}
    assert 0 <= line.servos[1].register(56) < 4096


def test_a_feetech_servo_reports_its_errors_in_each_reply() -> None:
    """The error byte is its status, and an overload takes its torque."""
    line = SimulatedBus([ServoPlan(1, "STS3215")])
    assert _feetech(line, 40, 1) == 1
    line.servos[1].overload()
    assert line.read([1], 40, 1) == {1: ServoReply(0x20, b"\0")}
    assert _feetech(line, 40, 1) == 0
