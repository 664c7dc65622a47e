"""Homing: finding the zero of each tendon."""

from functools import partial

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.setup import calibration
from shapechanger.robot.setup.calibration import home, require_homing
from tests.robot.drivers.servos.rigs import NAMES, Rig, servo, settings


def _cycle(rig: Rig) -> int:
    now_ns = rig.line.now_ns
    rig.bus.flush(grip=False)
    rig.run(None)
    return now_ns


@pytest.fixture
def rig() -> Rig:
    """A held rig without zeros."""
    return Rig().prepare()


def test_homing_finds_the_position_at_the_homing_tension(rig: Rig) -> None:
    """3 N less 1 N of friction stretch springs of 300 N/m by 6.7 mm from any start of a spool."""
    before = {name: rig.one(name).read("position") for name in NAMES}
    zeros = home(rig.bus, partial(_cycle, rig))
    mm = 1e3 * 2 * 3.14159 * 0.005 / 4096
    for name in NAMES:
        assert (zeros[name] - before[name]) * mm == pytest.approx(6.7, abs=0.4)
        rig.one(name).zero = zeros[name]
    assert rig.run(3.0)["FDP"]["length"] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("fault", "limits", "text"),
    [
        ("snapped", {"_TRAVEL_M": 0.03}, r"EDC \(id 4\) has no zero: it was wound in by 3"),
        (
            "",
            {"_WITHIN_MS": 100, "_STILL_MS": 1000},
            f"zero: {', '.join(NAMES)} still moved after 0.1 s",
        ),
        ("mute", {}, r"No zero: Servo EDC \(id 4\) does not answer"),
    ],
)
def test_a_zero_that_cannot_be_found_is_refused(
    rig: Rig, fault: str, limits: dict[str, float], text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, limit in limits.items():
        monkeypatch.setattr(calibration, name, limit)
    rig.line.break_servo("EDC", fault)
    with pytest.raises(RobotError, match=text):
        home(rig.bus, partial(_cycle, rig))


def test_a_homing_tension_below_the_friction_is_refused() -> None:
    """A tension below the friction would find a zero for a slack tendon."""
    servos = (servo("FDP", model="XL330-M288"), servo("FDS"))
    with pytest.raises(
        RobotError, match=r"FDP .* with 3 N: .* about 3.6 N. Set homing_n, to 5.4 N"
    ):
        require_homing(settings(servos=servos))
