"""Homing: finding the zero of each tendon."""

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.homing import Homing
from tests.robot.drivers.servos.rigs import NAMES, Rig, servo, settings


def _home(rig: Rig, homing: Homing, cycles: int = 400) -> None:
    for _ in range(cycles):
        homing.see(rig.run(0.0, **homing.tensions))
        if homing.failure or homing.zeros is not None:
            return


def test_homing_finds_the_position_at_the_homing_tension() -> None:
    """3 N minus 1 N of friction stretch 300 N/m by 6.7 mm, wherever the spools started."""
    rig = Rig()
    rig.bus.set_up()
    rig.bus.hold()
    before = {name: rig.twin(name).register(132) for name in NAMES}
    homing = Homing(rig.settings)
    _home(rig, homing)
    assert homing.failure == ""
    assert homing.zeros is not None
    mm = 1e3 * 2 * 3.14159 * 0.005 / 4096
    for name in NAMES:
        assert (homing.zeros[name] - before[name]) * mm == pytest.approx(6.7, abs=0.4)
    rig.bus.set_zeros(homing.zeros)
    length = rig.run(3.0).servos["FDP"].length_m
    assert length == pytest.approx(0.0, abs=1e-4)


def test_a_tendon_without_load_is_named() -> None:
    """A snapped tendon is wound in to the travel limit and then named."""
    rig = Rig()
    rig.twin("EDC").plan.tendon.snapped = True
    rig.bus.set_up()
    rig.bus.hold()
    homing = Homing(rig.settings, travel_m=0.03)
    _home(rig, homing)
    assert homing.zeros is None
    assert "Servo EDC (id 4) has no zero: it was wound in by 3" in homing.failure
    assert homing.tensions["EDC"] == 2.0  # Back to the pretension.


def test_homing_times_out() -> None:
    """The error names the tendons that still move."""
    rig = Rig()
    rig.bus.set_up()
    rig.bus.hold()
    homing = Homing(rig.settings, within_ms=100, still_ms=1000)
    _home(rig, homing)
    assert homing.failure == f"No zero: {', '.join(NAMES)} still moved after 0.1 s."


def test_a_fault_ends_homing() -> None:
    rig = Rig()
    rig.bus.set_up()
    rig.bus.hold()
    homing = Homing(rig.settings)
    rig.twin("PI").mute = True
    _home(rig, homing)
    assert homing.failure.startswith("No zero: Servo PI (id 7) does not answer")


def test_a_homing_tension_below_the_friction_is_refused() -> None:
    """A tension below the friction would find a zero for a slack tendon."""
    servos = (servo("FDP", model="XL330-M288"), servo("FDS"))
    with pytest.raises(
        RobotError, match=r"FDP .* with 3 N: .* about 3.6 N. Set homing_n, to 5.4 N"
    ):
        Homing(settings(servos=servos))
