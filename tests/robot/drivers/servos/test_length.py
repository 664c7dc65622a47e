"""Control of a tendon's length: current-based position mode with a limit of the tension."""

import math

import pytest
from msgspec.structs import replace

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import KeyMistake
from shapechanger.robot.setup.calibration import home
from tests.robot.drivers.servos.rigs import CYCLE_NS, NAMES, Rig, servo, settings

_MOST = dict.fromkeys(NAMES, 20.0)


def _rig(direction: int = 1) -> Rig:
    """Return a held rig whose servos control lengths of 0 to -30 mm."""
    changes = {"control": "length", "longest_m": 0.0, "shortest_m": -0.03, "direction": direction}
    rig = Rig(settings(servos=tuple(servo(name, **changes) for name in NAMES)))
    return rig.start()


def _go(rig: Rig, length: float, cycles: int) -> None:
    for _ in range(cycles):
        rig.bus.send(_MOST, dict.fromkeys(NAMES, length))
        state = rig.bus.cycle(rig.line.now_ns)
        assert state.reason == ""
        rig.line.advance(CYCLE_NS)


def test_servos_are_in_current_based_position_mode() -> None:
    rig = _rig()
    for one in rig.line.servos.values():
        assert (one.register(11), one.register(102)) == (5, 0)
        assert one.register(116) == one.register(132)
    assert rig.pulls() == [0.0] * 7


@pytest.mark.parametrize("direction", [1, -1])
def test_a_length_is_reached_in_either_direction(direction: int) -> None:
    """Against springs of 300 N/m the spools stop within the friction of their gears."""
    rig = _rig(direction)
    _go(rig, -0.01, 200)
    reading = rig.run(None).servos["FDP"]
    # 3 N of the spring and 1 N of the gears are held with an error of the position.
    assert reading.length_m == pytest.approx(-0.01, abs=1e-3)
    assert reading.goal_n == pytest.approx(20.0, abs=0.03)
    assert 1.0 < reading.tension_n < 5.0


def test_the_tension_of_a_blocked_tendon_is_limited() -> None:
    """At the stop of the springs, 20 mm, the limit holds although the goal is beyond."""
    rig = _rig()
    for _ in range(300):
        rig.bus.send(dict.fromkeys(NAMES, 8.0), dict.fromkeys(NAMES, -0.03))
        rig.bus.cycle(rig.line.now_ns)
        rig.line.advance(CYCLE_NS)
    assert rig.twin("EDC").motor.current == pytest.approx(8.0 / 29.3, rel=0.01)
    assert rig.twin("EDC").motor.tension < 8.0 + 1.05  # And the friction of the gears.


def test_a_tension_pulls_as_in_current_mode() -> None:
    """Without a length a servo pulls with its tension, which homing relies on."""
    rig = _rig()
    rig.run(6.0, 150)
    assert rig.twin("PI").motor.tension == pytest.approx(6.0, abs=1.05)
    assert set(home(rig.settings, rig.cycle)) == set(NAMES)


def test_a_stop_lowers_the_limit_and_releases() -> None:
    """The ramp, the release and the watchdog act as in current mode."""
    rig = _rig()
    _go(rig, -0.02, 100)
    rig.bus.stop(rig.line.now_ns)
    goals = [rig.run(None).servos["FDS"].goal_n for _ in range(31)]
    assert goals == sorted(goals, reverse=True)
    assert goals[-1] == pytest.approx(2.0, abs=0.03)
    assert rig.bus.mode == "off"
    assert not any(one.has_torque for one in rig.line.servos.values())


def test_the_watchdog_stops_servos_that_control_a_length() -> None:
    rig = _rig()
    _go(rig, -0.02, 50)
    assert min(rig.pulls()) > 0.3
    rig.line.advance(101_000_000)
    assert rig.pulls() == [0.0] * 7
    assert max(abs(one.motor.current) for one in rig.line.servos.values()) == 0.0


def test_a_new_hold_forgets_the_length() -> None:
    """After a stop nothing turns back to an old length."""
    rig = _rig()
    _go(rig, -0.02, 50)
    rig.bus.release()
    rig.bus.hold()
    rig.run(2.0)
    one = rig.twin("FDP")
    assert one.register(116) == pytest.approx(one.register(132) + 1024, abs=40)


def test_lengths_without_meaning_are_refused() -> None:
    """A length needs control of the length, a zero, and a finite number; nothing is sent."""
    rig = _rig()
    with pytest.raises(RobotError, match=r"FDP .* cannot go to a length of nan m"):
        rig.bus.send(_MOST, {"FDP": math.nan})
    rig.twin("FDP").lose_power()
    rig.line.advance(400_000_000)
    rig.run(None, 4)
    with pytest.raises(RobotError, match=r"FDP .* cannot go to a length: it has no zero"):
        rig.bus.send(_MOST, {"FDP": 0.0})
    with pytest.raises(RobotError, match="has control of its tension"):
        Rig().start().bus.send(_MOST, {"FDP": 0.0})


def test_invalid_control_is_refused() -> None:
    with pytest.raises(KeyMistake, match="must be below longest_m, not 0 and 0 m"):
        servo("FDP", control="length")
    one = servo("FDP", control="length", longest_m=0.01, shortest_m=-0.02)
    for length in (-1.0, -0.02, 0.0, 0.01, 1.0):
        kept = min(max(length, -0.02), 0.01)
        for direction in (1, -1):
            turned = replace(one, direction=direction)
            got = turned.length_m(turned.position_at(length, 100), 100)
            assert got == pytest.approx(kept, abs=4e-6)
