"""Inverse of each driver: from pin levels back to output values."""

from dataclasses import replace

import pytest

from shapechanger.contract.plan import GuardPlan, OutputPlan
from shapechanger.robot.drivers.chip import OUTPUTS
from shapechanger.robot.drivers.simulation import Levels, Pulse
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.in_process import LocalBoard
from tests.robot.twin.robots import ACTIONS, CAR, DRIVE, STEER, esc, hbridge, servo

_CHIP = {"over": "pca9685", "bus": 1, "address": 0x40, "channel": 2, "output_enable": -1}
_PHASE = OutputPlan(
    "phase",
    "phase_enable",
    "wheels",
    {"throttle": 1.0},
    0.0,
    {"phase": 5, "enable": 6, "pwm_hz": 50, "start": 0.2, "full": 0.9},
)
_ENABLED = replace(DRIVE, settings={**DRIVE.settings, "enable": 18})
_OUTPUTS = {
    "hbridge": DRIVE,
    "hbridge with enable": _ENABLED,
    "hbridge with start": hbridge("drive", "wheels", (22, 27), {"throttle": 1.0}, start=0.3),
    "phase": _PHASE,
    "servo on a pin": servo("servo", "steering", {"steering": 1.0}, over="lgpio", pin=12),
    "servo on a chip": servo("servo", "steering", {"steering": 1.0}, **_CHIP),
    "reversed servo": servo(
        "servo", "steering", {"steering": 1.0}, left_us=1900, right_us=1200, **_CHIP
    ),
    "esc on a chip": esc("esc", "wheels", {"throttle": 1.0}, arm_s=0.0, reverse="direct", **_CHIP),
}


@pytest.mark.parametrize("kind", _OUTPUTS)
def test_the_wiring_inverts_each_driver(kind: str) -> None:
    """The value read from the levels is the value written, within one step of resolution."""
    output = _OUTPUTS[kind]
    wiring = TwinWiring(GuardPlan("robot", ACTIONS, (output,)))
    board = LocalBoard(wiring, DrivingWorld((), (8, 6), seed=0))
    driver = OUTPUTS[output.driver].open(output, board.hardware)
    for value in (0.0, 0.05, 0.3, 1.0, -0.05, -0.7, -1.0, 0.0):
        driver.write(value, 10**9)
        read = wiring.read(board.pins.levels, 10**9)[output.name]
        assert read.value == pytest.approx(value, abs=0.02), value
        if "steering" not in output.mix:
            assert read.at_rest == (value == 0.0)
    driver.release()
    read = wiring.read(board.pins.levels, 10**9)[output.name]
    assert read == (None if output.driver in ("servo", "esc") else 0.0, True)
    driver.close()
    board.hardware.close()


def test_only_outputs_with_throttle_propel() -> None:
    """The mix decides which outputs propel, not their names."""
    assert TwinWiring(CAR).propelling == ("drive",)
    swapped = (replace(DRIVE, mix={"steering": 1.0}), replace(STEER, mix={"throttle": -0.5}))
    assert TwinWiring(replace(CAR, outputs=swapped)).propelling == ("steer",)


def test_wrong_pins_turn_the_wrong_motor() -> None:
    """Wiring is independent of the served profile: swapped pins steer instead of driving."""
    levels = Levels()
    levels.drive(17, 0.8, 0)
    read = TwinWiring(CAR, None).read(levels, 0)
    assert (read["drive"].value, read["steer"].value) == (0.0, 0.8)


def test_the_one_shot_powers_motors_only() -> None:
    """The bridge loses power 100 ms after the last edge; a servo keeps its pulses."""
    turn = servo("turn", "steering", {"steering": 1.0}, over="lgpio", pin=12)
    wiring = TwinWiring(replace(CAR, outputs=(DRIVE, turn)), 100.0)
    levels = Levels()
    levels.drive(22, 1.0, 0)
    levels.pulse(12, Pulse(2000, 50))
    assert wiring.read(levels, 0)["drive"].value == 0.0
    levels.drive(25, 1.0, 50_000_000)
    assert wiring.read(levels, 149_000_000)["drive"].value == 1.0
    assert wiring.read(levels, 150_000_000)["drive"].value == 0.0
    assert wiring.read(levels, 150_000_000)["turn"].value == 1.0
