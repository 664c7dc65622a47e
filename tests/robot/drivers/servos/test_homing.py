"""Homing: finding the zero of each tendon."""

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.setup import calibration
from shapechanger.robot.setup.calibration import home, require_homing
from tests.robot.drivers.servos.rigs import NAMES, Rig, servo, settings


@pytest.fixture
def rig() -> Rig:
    """A held rig without zeros."""
    made = Rig()
    made.bus.set_up()
    made.bus.hold()
    return made


def test_homing_finds_the_position_at_the_homing_tension(rig: Rig) -> None:
    """3 N minus 1 N of friction stretch 300 N/m by 6.7 mm, wherever the spools started."""
    before = {name: rig.position(name) for name in NAMES}
    zeros = home(rig.settings, rig.cycle)
    mm = 1e3 * 2 * 3.14159 * 0.005 / 4096
    for name in NAMES:
        assert (zeros[name] - before[name]) * mm == pytest.approx(6.7, abs=0.4)
    rig.bus.set_zeros(zeros)
    length = rig.run(3.0).servos["FDP"].length_m
    assert length == pytest.approx(0.0, abs=1e-4)


def test_a_tendon_without_load_is_named(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "_TRAVEL_M", 0.03)
    rig.twin("EDC").motor.snapped = True
    with pytest.raises(RobotError, match=r"EDC \(id 4\) has no zero: it was wound in by 3"):
        home(rig.settings, rig.cycle)


def test_homing_times_out(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "_WITHIN_MS", 100)
    monkeypatch.setattr(calibration, "_STILL_MS", 1000)
    with pytest.raises(RobotError, match=f"zero: {', '.join(NAMES)} still moved after 0.1 s"):
        home(rig.settings, rig.cycle)


def test_a_fault_ends_homing(rig: Rig) -> None:
    rig.twin("PI").mute = True
    with pytest.raises(RobotError, match=r"No zero: Servo PI \(id 7\) does not answer"):
        home(rig.settings, rig.cycle)


def test_a_homing_tension_below_the_friction_is_refused() -> None:
    """A tension below the friction would find a zero for a slack tendon."""
    servos = (servo("FDP", model="XL330-M288"), servo("FDS"))
    with pytest.raises(
        RobotError, match=r"FDP .* with 3 N: .* about 3.6 N. Set homing_n, to 5.4 N"
    ):
        require_homing(settings(servos=servos))
