"""Bus driver with seven healthy servos."""

import math

import pytest

from shapechanger.errors import RobotError
from tests.robot.drivers.servos.rigs import CYCLE_NS, MODEL, NAMES, Rig, of, servo, settings


def test_all_missing_servos_are_named() -> None:
    rig = Rig()
    rig.twin("FDS").mute = rig.twin("PI").deaf = True
    words = r"no servo answers as FDS \(id 2\), PI \(id 7\); those that do: FDP \(id 1\), EIP"
    with pytest.raises(RobotError, match=words):
        rig.bus.set_up()


def test_another_model_is_refused() -> None:
    """A servo of another model is refused, since its torque constant differs."""
    wired = [servo(n, model="XL330-M288" if n == "EIP" else MODEL) for n in NAMES]
    with pytest.raises(RobotError, match=r"EIP \(id 3\) is not an XL330-M077.* is 1200, not 1190"):
        Rig(wired=wired).bus.set_up()


def test_firmware_without_a_watchdog_is_refused() -> None:
    bus = settings(servos=(servo("FDP", model="XM430-W210", pretension_n=2.0),))
    rig = Rig(bus)
    rig.twin("FDP").firmware = 37
    with pytest.raises(RobotError, match="firmware 37; its own watchdog needs 38"):
        rig.bus.set_up()


@pytest.mark.parametrize(
    ("family", "expected"),
    [
        # 683 counts of 0.0293 N are 19.98 N.
        ("Dynamixel", {9: 0, 10: 0, 11: 0, 38: 683, 98: 5, 102: 0}),
        # Positions over many turns, all other bits of the phase kept, and the EEPROM locked again.
        (
            "Feetech",
            {7: 0, 8: 1, 9: 0, 11: 0, 18: 28, 33: 0, 16: 157, 41: 254, 48: 0, 55: 1},
        ),
    ],
)
def test_setup_configures_servos_without_torque(family: str, expected: dict[int, int]) -> None:
    """Mode, limits, goal and watchdog are set before torque is enabled."""
    rig = Rig(of(family))
    rig.bus.set_up()
    for one in rig.line.servos.values():
        assert not one.has_torque
        assert {at: one.register(at) for at in expected} == expected
    rig.bus.hold()
    assert all(one.has_torque for one in rig.line.servos.values())
    assert rig.pulls() == [0.0] * 7


def test_a_setting_that_is_not_kept_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Feetech servo does not say that it refuses a mode, so what it has is read again."""
    rig = Rig(of("Feetech"))
    servo = rig.twin("EDC")
    taken = servo.write
    monkeypatch.setattr(servo, "write", lambda at, data: taken(at, data if at != 16 else b"\7\7"))
    with pytest.raises(RobotError, match=r"EDC \(id 4\) does not keep 157 as maximum torque"):
        rig.bus.set_up()


def test_torque_is_enabled_last() -> None:
    """`hold` writes goal and watchdog before it enables torque."""
    rig = Rig()
    rig.bus.set_up()
    rig.port.sent.clear()
    rig.bus.hold()
    written = [(p[4], int.from_bytes(p[8:10], "little")) for p in rig.port.sent if p[7] == 3]
    for servo_id in range(1, 8):
        assert [at for one, at in written if one == servo_id] == [98, 102, 98, 64]


def test_eeprom_is_written_only_on_change() -> None:
    """A second setup writes no EEPROM register, to spare its write cycles."""
    rig = Rig()
    rig.bus.set_up()
    rig.port.sent.clear()
    rig.bus.set_up()
    written = [p[8] for p in rig.port.sent if p[7] in (3, 0x83)]
    assert written
    assert all(at >= 64 for at in written)


def test_hold_requires_setup() -> None:
    with pytest.raises(RobotError, match="not held: they are not set up"):
        Rig().bus.hold()


def test_a_cycle_commands_and_reads_tensions() -> None:
    """The tension matches the command to one count and the friction of the gears."""
    rig = Rig().start()
    state = rig.run(6.0, 150)
    reading = state.servos["EDC"]
    assert state.reason == ""
    assert set(state.servos) == set(NAMES)
    assert reading.goal_n == pytest.approx(6.0, abs=0.03)
    assert reading.tension_n == pytest.approx(6.0, abs=0.03)
    assert rig.twin("EDC").motor.tension == pytest.approx(6.0, abs=1.05)  # 1 N of friction.
    assert reading.length_m is not None
    assert reading.length_m == pytest.approx(-rig.twin("EDC").motor.tension / 300.0, abs=1e-3)


def test_tensions_are_clipped() -> None:
    rig = Rig().start()
    state = rig.run(500.0, LUM=-3.0)
    assert state.servos["FDP"].goal_n == pytest.approx(20.0, abs=0.03)
    assert state.servos["LUM"].goal_n == pytest.approx(2.0, abs=0.03)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_non_finite_tension_changes_no_goal(wrong: float) -> None:
    rig = Rig().start()
    rig.run(4.0)
    before, sent = rig.pulls(), len(rig.port.sent)
    with pytest.raises(RobotError, match=r"Servo DI \(id 6\) cannot pull"):
        rig.run(9.0, DI=wrong)
    assert (rig.pulls(), len(rig.port.sent)) == (before, sent)
    rig.run(None)
    assert rig.pulls() == before


def test_a_stop_ramps_down_and_releases() -> None:
    rig = Rig().start()
    rig.run(12.0, 50)
    rig.bus.stop(rig.line.now_ns)
    goals: list[float] = []
    for _ in range(40):
        state = rig.run(None)
        goals.append(state.servos["FDS"].goal_n)
        if state.mode == "off":
            break
    assert len(goals) == 31  # 300 ms.
    assert goals == sorted(goals, reverse=True)
    assert goals[0] == pytest.approx(12.0, abs=0.03)
    assert goals[15] == pytest.approx(7.0, abs=0.03)
    assert not any(one.has_torque for one in rig.line.servos.values())


def test_a_stop_without_a_ramp_releases_at_once() -> None:
    rig = Rig(settings(ramp_ms=0)).start()
    rig.run(12.0, 5)
    rig.bus.stop(rig.line.now_ns)
    assert rig.run(None).mode == "off"
    assert rig.pulls() == [0.0] * 7


def test_only_a_new_hold_ends_a_stop() -> None:
    """Tensions requested after a stop have no effect until then."""
    rig = Rig().start()
    rig.run(12.0, 5)
    rig.bus.stop(rig.line.now_ns)
    assert rig.run(12.0, 31).mode == "off"
    rig.run(12.0, 5)
    assert rig.pulls() == [0.0] * 7
    rig.bus.hold()
    assert rig.run(5.0, 20).reason == ""
    assert min(rig.pulls()) > 0.1


def test_a_stop_before_the_first_pull_does_not_pull() -> None:
    rig = Rig().start()
    rig.bus.stop(rig.line.now_ns)
    rig.run(None, 5)
    assert rig.pulls() == [0.0] * 7


def test_close_leaves_no_torque() -> None:
    """`close` disables torque and closes the port."""
    rig = Rig().start()
    rig.run(5.0, 5)
    rig.bus.close()
    assert not any(one.has_torque for one in rig.line.servos.values())
    assert rig.port.is_closed


def test_a_cycle_costs_three_packets() -> None:
    """A cycle sends three packets, and takes less than 45 % of its period.

    Goals, present values and one register for verification take at most 390 bytes, which are
    3.9 ms at 1 Mbaud.
    """
    rig = Rig().start()
    rig.run(5.0)
    rig.port.sent.clear()
    before = rig.port.received
    rig.run(5.0, 4)
    assert [p[7] for p in rig.port.sent] == [0x83, 0x82, 0x82] * 4
    count = sum(map(len, rig.port.sent)) + rig.port.received - before
    assert count / 4 * 10_000 < 0.45 * CYCLE_NS


def test_send_writes_goals_without_a_cycle() -> None:
    """`send` writes one packet without reading, and only while the bus is held."""
    rig = Rig()
    rig.bus.set_up()
    rig.port.sent.clear()
    rig.bus.send(dict.fromkeys(NAMES, 6.0))
    assert rig.port.sent == []
    rig.bus.hold()
    rig.port.sent.clear()
    rig.bus.send(dict.fromkeys(NAMES, 6.0))
    assert [packet[7] for packet in rig.port.sent] == [0x83]
    assert rig.pulls() == pytest.approx([0.205] * 7, abs=0.001)
    rig.port.is_gone = True
    rig.bus.send(dict.fromkeys(NAMES, 7.0))
    assert "is gone" in rig.bus.cycle(rig.line.now_ns).reason
