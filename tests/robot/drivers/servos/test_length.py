"""Control of a tendon's length: current-based position mode with a limit of the tension."""

import pytest

from shapechanger.errors import RobotError
from tests.robot.drivers.servos.rigs import NAMES, Rig, servo, settings


def _rig(direction: int = 1) -> Rig:
    """Return a held rig whose servos control lengths of 0 to -30 mm."""
    changes = {"control": "length", "longest_m": 0.0, "shortest_m": -0.03, "direction": direction}
    return Rig(settings(servos=tuple(servo(name, **changes) for name in NAMES))).start()


def test_servos_are_in_current_based_position_mode() -> None:
    """Servos hold their position at first, and after a stop do not turn back to an old length."""
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
    """Against springs of 300 N/m the spools stop within the friction of their gears."""
    rig = _rig(direction)
    rig.run(20.0, 200, length=-0.01)
    assert rig.bus.reason == ""
    seen = rig.run(None)["FDP"]
    # 3 N of the spring and 1 N of the gears are held with an error of the position.
    assert seen["length"] == pytest.approx(-0.01, abs=1e-3)
    assert rig.one("FDP").goal_n == pytest.approx(20.0, abs=0.03)
    assert 1.0 < seen["tension"] < 5.0


def test_the_tension_of_a_blocked_tendon_is_limited() -> None:
    """At the stop of the springs, 20 mm, the limit holds although the goal is beyond."""
    rig = _rig()
    rig.run(8.0, 300, length=-0.03)
    assert rig.twin("EDC").motor.current == pytest.approx(8.0 / 29.3, rel=0.01)
    assert rig.twin("EDC").motor.tension < 8.0 + 1.05  # And the friction of the gears.


def test_a_length_without_a_zero_is_refused() -> None:
    rig = _rig()
    rig.one("FDP").zero = None
    sent = len(rig.port.sent)
    with pytest.raises(RobotError, match=r"FDP .* cannot go to a length: it has no zero"):
        rig.run(20.0, length=0.0)
    assert len(rig.port.sent) == sent
