"""The robot's drivers on the twin's pins and chips, and the values computed from levels."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from gpiozero import Motor

from shapechanger.contract.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld
from shapechanger.robot.drivers.as5600 import open_and_read
from shapechanger.robot.drivers.chip import OUTPUTS, SENSORS, SensorDriver
from shapechanger.robot.drivers.simulation import Levels, Pulse
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.operator import operator_functions
from shapechanger.robot.twin.room import DrivingWorld
from tests.robot.twin.in_process import LocalBoard
from tests.robot.twin.robots import ACTIONS, CAR, DRIVE, STEER, esc, hbridge, servo

_DISTANCE = SensorPlan("sonar", "hcsr04", "distance", {"trigger": 20, "echo": 21, "max_m": 3.0})


class _Rig:
    def __init__(self, sensor: SensorPlan) -> None:
        plan = replace(CAR, sensors=(sensor,), enable_pin=None)
        self.world = DrivingWorld({"wheels", "steering"}, (160, 120), seed=1)
        self.board = LocalBoard(TwinWiring(plan), self.world)
        self.motor = Motor(22, 27, pin_factory=self.board.hardware.pin_factory())
        self.sensor: SensorDriver = SENSORS[sensor.driver].open(sensor, self.board.hardware)
        functions = operator_functions(self.board.pins)
        self.operator: Any = SimpleNamespace(**{one.__name__: one for one in functions})
        self.seen: dict[str, float] = {}

    def advance(self, seconds: float) -> dict[str, float]:
        for _ in range(round(seconds * 100)):
            self.board.pass_ns(10_000_000)
            self.seen |= self.sensor.read(self.board.t, self.motor.value)
        return self.seen


@contextmanager
def _rig(sensor: SensorPlan) -> Iterator[_Rig]:
    rig = _Rig(sensor)
    yield rig
    rig.sensor.close()
    rig.board.hardware.close()


def test_joint_encoders_measure_the_angles() -> None:
    keys = [(7, 4090, 1), (0, 5, -1), (3, 2048, -1), (4, 1000, 1)]
    rows = {
        name: {"channel": channel, "zero": zero, "direction": direction}
        for name, (channel, zero, direction) in zip(JOINTS, keys, strict=True)
    }
    plan = SensorPlan("joints", "as5600", "joints", {"bus": 1, "mux": 0x70, "rows": rows})
    world = FingerWorld(NOMINAL, seed=2)
    board = LocalBoard(TwinWiring(GuardPlan("it", (), (), (plan,))), world)
    driver = open_and_read(plan, board.hardware)
    for seed in range(5):
        world.place(seed)
        truth = {name: v for name, v in world.truth().items() if name.endswith("/angle")}
        assert driver.read(0, 0.0) == pytest.approx(truth, abs=0.51 * 2.0 * math.pi / 4096)


def test_the_distance_is_measured() -> None:
    """The echo gives the distance, which an operator can override; a dead sensor is an error."""
    with _rig(_DISTANCE) as rig:
        truth = rig.operator.where().distance_m
        assert rig.advance(0.2)["distance"] == pytest.approx(min(truth, 3.0), abs=0.01)
        rig.operator.set_distance(0.25)
        assert rig.advance(0.2)["distance"] == pytest.approx(0.25, abs=0.005)
        rig.operator.set_distance(9.0)
        assert rig.advance(0.3)["distance"] == 3.0
        rig.operator.set_distance(None, dead=True)
        with pytest.raises(RobotError, match="no echo"):
            rig.advance(2.0)


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


def test_outputs_propel_if_an_action_that_propels_is_in_their_mix() -> None:
    """The names of outputs have no effect."""
    assert TwinWiring(CAR).propelling == ("drive",)
    swapped = (replace(DRIVE, mix={"steering": 1.0}), replace(STEER, mix={"throttle": -0.5}))
    assert TwinWiring(replace(CAR, outputs=swapped)).propelling == ("steer",)


def test_swapped_pins_move_the_wrong_output() -> None:
    """The twin's wiring is independent of the served profile: the throttle steers."""
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
