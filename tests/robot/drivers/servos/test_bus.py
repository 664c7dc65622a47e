"""Bus driver: set-up, stops, tensions and lengths."""

import pytest

from shapechanger.errors import RobotError
from tests.robot.drivers.servos.rigs import NAMES, Rig, of, servo, settings


@pytest.mark.parametrize("family", ["Dynamixel", "Feetech"])
def test_missing_servos_and_another_model_are_refused(family: str) -> None:
    rig = Rig(of(family))
    rig.twin("FDS").mute = rig.twin("PI").deaf = True
    text = r"no servo answers as FDS \(id 2\), PI \(id 7\); these answer: FDP \(id 1\), EIP"
    beats: list[int] = []
    with pytest.raises(RobotError, match=text):
        rig.bus.set_up(lambda: beats.append(1))
    # Before each attempt, so that waiting for two silent servos does not look like a dead guard.
    assert len(beats) == 5 + 2 * 3
    rig = Rig(of(family))
    rig.twin("EIP").values["model_number"] = 1200
    with pytest.raises(RobotError, match=r"EIP \(id 3\) is not an .* is 1200, not (1190|777)"):
        rig.bus.set_up()
    assert not any(one.has_torque for one in rig.line.servos.values())


def test_firmware_without_a_watchdog_is_refused() -> None:
    rig = Rig(settings(servos=(servo("FDP", model="XM430-W210"),)))
    rig.twin("FDP").values["firmware"] = 37
    with pytest.raises(RobotError, match="firmware 37; its own watchdog needs 38"):
        rig.bus.set_up()


@pytest.mark.parametrize(
    ("family", "expected"),
    [
        # 683 counts of 0.0293 N are 19.98 N.
        ("Dynamixel", "return_delay=0 drive_mode=0 mode=0 most=683 mark=5 goal=0"),
        # Positions over many turns, all other bits of the phase kept, and the EEPROM locked again.
        (
            "Feetech",
            "return_delay=0 status_level=1 least_angle=0 most_angle=0 phase=28 mode=0 most=157 "
            "mark=254 goal=0 lock=1",
        ),
    ],
)
def test_setup_configures_servos_without_torque(family: str, expected: str) -> None:
    """Mode, limits, goal and watchdog are set before torque is enabled."""
    rig = Rig(of(family))
    rig.bus.set_up()
    for one in rig.line.servos.values():
        assert not one.has_torque
        found = {key: one.values[key] for key, _ in (x.split("=") for x in expected.split())}
        assert " ".join(f"{key}={value}" for key, value in found.items()) == expected
    rig.bus.hold()
    assert all(one.has_torque for one in rig.line.servos.values())
    assert rig.pulls() == [0.0] * 7


@pytest.mark.parametrize(
    ("family", "register", "data", "text"),
    [
        ("Feetech", 16, b"\7\7", r"EDC \(id 4\) does not keep 157 as maximum torque"),
        ("Dynamixel", 98, b"\xff", r"EDC \(id 4\) refuses to set its bus watchdog to 0: the"),
    ],
)
def test_a_setting_that_is_not_kept_is_an_error(
    family: str, register: int, data: bytes, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dynamixel servos report refusals; registers of Feetech servos are read back instead."""
    rig = Rig(of(family))
    servo = rig.twin("EDC")
    taken = servo.write
    monkeypatch.setattr(
        servo, "write", lambda at, sent: taken(at, data if at == register else sent)
    )
    with pytest.raises(RobotError, match=text):
        rig.prepare()
    assert not any(one.has_torque for one in rig.line.servos.values())


def test_torque_is_enabled_last_and_eeprom_writes_are_avoided() -> None:
    """`hold` writes goal and watchdog before torque; a second setup writes no EEPROM register."""
    rig = Rig()
    rig.bus.set_up()
    rig.port.sent.clear()
    rig.bus.hold()
    written = [(p[4], int.from_bytes(p[8:10], "little")) for p in rig.port.sent if p[7] == 3]
    for servo_id in range(1, 8):
        assert [at for one, at in written if one == servo_id] == [98, 102, 98, 64]
    rig.port.sent.clear()
    rig.bus.set_up()
    again = [p[8] for p in rig.port.sent if p[7] in (3, 0x83)]
    assert again
    assert all(at >= 64 for at in again)


def test_a_stop_ramps_down_and_releases() -> None:
    """A fault of one servo stops all within 300 ms; only `ready` ends the stop."""
    rig = Rig().start()
    rig.run(12.0, 50)
    rig.one("EIP").fault = "It has a fault."
    goals: list[float] = []
    while rig.bus.mode != "off":
        rig.run(None)
        goals.append(rig.one("FDS").goal_n)
    assert len(goals) == 31
    assert goals == sorted(goals, reverse=True)
    assert goals[1] == pytest.approx(12.0 - 10.0 / 30, abs=0.05)
    assert goals[15] == pytest.approx(7.0, abs=0.03)
    assert not any(one.has_torque for one in rig.line.servos.values())
    rig.bus.flush(grip=True)
    rig.run(None, 5)
    assert rig.pulls() == [0.0] * 7
    rig.bus.ready()
    rig.bus.flush(grip=True)
    rig.run(5.0, 20)
    assert rig.bus.reason == ""
    assert min(rig.pulls()) > 0.1
    rig.bus.close()
    assert not any(one.has_torque for one in rig.line.servos.values())
    assert rig.port.is_closed


@pytest.mark.parametrize(("ramp_ms", "pulled"), [(0, True), (300, False)])
def test_a_stop_pulls_no_slack_tendon(ramp_ms: int, pulled: bool) -> None:
    """Without a ramp the servos release at once; a stop before the first pull does not pull."""
    rig = Rig(settings(ramp_ms=ramp_ms)).start()
    if pulled:
        rig.run(12.0, 5)
    rig.one("EIP").fault = "It has a fault."
    rig.run(None)
    assert (rig.bus.mode == "off") == pulled
    rig.run(None, 5)
    assert rig.pulls() == [0.0] * 7


def test_flush_sends_only_while_held() -> None:
    """`flush` writes one packet without reading; the next cycle reports that the bus is gone."""
    rig = Rig()
    with pytest.raises(RobotError, match="cannot be held: they are not set up"):
        rig.bus.hold()
    rig.bus.set_up()
    rig.port.sent.clear()
    rig.bus.flush(grip=False)
    assert rig.port.sent == []
    rig.bus.hold()
    rig.port.sent.clear()
    rig.one("FDP").request(6.0)
    rig.bus.flush(grip=False)
    assert [packet[7] for packet in rig.port.sent] == [0x83]
    assert rig.pulls()[0] == pytest.approx(0.205, abs=0.001)
    rig.port.is_gone = True
    rig.bus.flush(grip=False)
    rig.run(None)
    assert "is gone" in rig.bus.reason


def _rig(direction: int = 1) -> Rig:
    """Return a held rig whose servos control lengths of 0 to -30 mm."""
    changes = {"control": "length", "longest_m": 0.0, "shortest_m": -0.03, "direction": direction}
    return Rig(settings(servos=tuple(servo(name, **changes) for name in NAMES))).start()


def test_servos_are_in_current_based_position_mode() -> None:
    """After `hold`, the goal is the present position, so that no servo turns to an old length."""
    rig = _rig()
    for _ in range(2):
        for name in NAMES:
            values = rig.twin(name).values
            assert (values["mode"], values["goal"]) == (5, 0)
            assert values["goal_position"] == rig.one(name).read("position")
        assert rig.pulls() == [0.0] * 7
        rig.run(20.0, 50, length=-0.02)
        rig.bus.release()
        rig.bus.hold()
    rig.run(2.0)
    ahead = rig.twin("FDP").values["goal_position"] - rig.one("FDP").read("position")
    assert ahead == pytest.approx(1024, abs=40)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_length_is_reached_in_either_direction(direction: int) -> None:
    """Against springs of 300 N/m, the length is reached within 1 mm."""
    rig = _rig(direction)
    rig.run(20.0, 200, length=-0.01)
    assert rig.bus.reason == ""
    seen = rig.run(None)["FDP"]
    # Holding the spring's 3 N against 1 N of friction takes an error of the position.
    assert seen["length"] == pytest.approx(-0.01, abs=1e-3)
    assert rig.one("FDP").goal_n == pytest.approx(20.0, abs=0.03)
    assert 1.0 < seen["tension"] < 5.0


def test_the_tension_of_a_blocked_tendon_is_limited() -> None:
    """Springs stop at 20 mm; a goal of 30 mm does not raise the tension above its limit."""
    rig = _rig()
    rig.run(8.0, 300, length=-0.03)
    assert rig.twin("EDC").motor.current == pytest.approx(8.0 / 29.3, rel=0.01)
    assert rig.twin("EDC").motor.tension < 8.0 + 1.05  # 1.05 N is the friction of the gears.


def test_a_length_without_a_zero_is_refused() -> None:
    rig = _rig()
    rig.one("FDP").zero = None
    sent = len(rig.port.sent)
    with pytest.raises(RobotError, match=r"FDP .* cannot go to a length: it has no zero"):
        rig.run(20.0, length=0.0)
    assert len(rig.port.sent) == sent
