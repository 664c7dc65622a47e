"""Checks of the wiring, on a simulated board and on pins with other resistors."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from gpiozero.pins.mock import MockFactory, MockPin

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.check.computer import examine
from shapechanger.robot.check.wiring import StandingRobot
from shapechanger.robot.drivers.hcsr04 import SimulatedHcsr04
from shapechanger.robot.drivers.switch import SimulatedSwitch
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.raspberry_pi import RealHardware
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.in_process import LocalBoard
from tests.robots import write_profile


class _Board(LocalBoard):
    """A board whose time the checks advance."""

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        del readable, at_most_s
        self.advance(until_ns)
        return True


def _board(plan: GuardPlan) -> _Board:
    parts = {output.part for output in plan.outputs}
    return _Board(TwinWiring(plan), DrivingWorld(parts, (160, 120), seed=0))


def _found(
    plan: GuardPlan, board: _Board, *, motors_off: bool = True
) -> dict[str, list[tuple[str, str]]]:
    found: dict[str, list[tuple[str, str]]] = {}
    robot = StandingRobot(
        plan, hardware=lambda: board.hardware, motors_off=motors_off, on_twin=True
    )
    for check, level, sentence in examine(robot):
        found.setdefault(check, []).append((level, sentence))
    return found


@pytest.fixture
def car(tmp_path: Path) -> GuardPlan:
    """A car with all protective sensors."""
    return load_profile(write_profile(tmp_path).path).guard_plan()


def test_a_well_wired_car(car: GuardPlan) -> None:
    """Everything is good, but whether the wheel's sensor counts needs a person."""
    board = _board(car)
    found = _found(car, board)
    assert [level for level, _ in found["resistors"]] == ["good"] * 5
    assert ("good", "GPIO19, enable line, is pulled down.") in found["resistors"]
    assert found["emergency button"][0][0] == "good"
    levels = {sentence.split()[0].rstrip(":"): level for level, sentence in found["sensor"]}
    assert levels == {"wheel": "unknown", "bumper": "good", "front": "good", "pack": "good"}
    assert "GPIO5 is" in found["sensor"][0][1]
    # Nothing was ever driven.
    assert not any(board.pins.levels.duties.get(pin) for pin in (4, 17, 22, 27, 19))


def test_without_the_supply_off_no_output_is_touched(car: GuardPlan) -> None:
    """A motor without its resistor could start."""
    board = _board(car)
    found = _found(car, board, motors_off=False)
    level, sentence = found["resistors"][0]
    assert (level, "--motors-off" in sentence) == ("unknown", True)
    assert not board.levels.keys() & {4, 17, 22, 27, 19}


def test_pressed_switches(car: GuardPlan) -> None:
    """A switch that is pressed now, or whose wire touches ground, is reported."""
    board = _board(car)
    board.pins.sensors.press_stop(down=True)
    for bumper in board.pins.sensors.of_kind(SimulatedSwitch):
        bumper.held = True
    board.pass_ns(100_000_000)
    found = _found(car, board)
    level, sentence = found["emergency button"][0]
    assert (level, "it is pressed" in sentence) == ("bad", True)
    assert ("bad", "bumper is pressed, or a wire of it is wrong.") in found["sensor"]


@pytest.mark.parametrize(
    ("limit_v", "level", "words"),
    [(6.6, "good", "V."), (50.0, "bad", "below low_battery_v, 50 V: charge")],
)
def test_the_battery_is_measured(car: GuardPlan, limit_v: float, level: str, words: str) -> None:
    """Its voltage is compared with the limit at which the robot stops."""
    car = replace(car, limits=replace(car.limits, low_battery_v=limit_v))
    found = next(one for one in _found(car, _board(car))["sensor"] if "pack" in one[1])
    assert found[0] == level
    assert words in found[1]


def test_a_battery_that_is_not_connected(car: GuardPlan) -> None:
    """0 V is a wire, not a battery."""
    board = _board(car)
    hardware: Any = board.hardware
    real = hardware.i2c

    def i2c(bus: int) -> Any:
        opened = real(bus)
        opened.read_i2c_block_data = lambda *_: [0, 0]
        return opened

    hardware.i2c = i2c
    found = next(one for one in _found(car, board)["sensor"] if "pack" in one[1])
    assert found == ("bad", "pack measures 0.00 V: connect its V- to the load.")


def test_dead_sensors_do_not_hide_others(car: GuardPlan) -> None:
    """Each is reported by its own driver's error."""
    board = _board(car)
    board.pins.dead_chips.add((1, 0x40))
    for sensor in board.pins.sensors.of_kind(SimulatedHcsr04):
        sensor.dead = True
    found = _found(car, board)["sensor"]
    assert [level for level, _ in found] == ["unknown", "good", "bad", "bad"]
    assert "receives no echo" in found[2][1]
    assert "0x40" in found[3][1]


@pytest.mark.parametrize("dead", [False, True])
def test_servo_boards(dead: bool) -> None:
    """A board is asked for a register that has no effect."""
    plan = load_profile(find_profile("cat")).guard_plan()
    board = _board(plan)
    if dead:
        board.pins.dead_chips.add((1, 0x40))
    found = _found(plan, board)
    ((level, sentence),) = found["servo board"]
    assert (level, "i2cdetect -y 1" in sentence) == (("bad", True) if dead else ("good", False))
    assert found["resistors"] == [("good", "GPIO25, OE of the servo board, is pulled up.")]


def test_the_servos_of_a_rig_answer() -> None:
    """They are asked without torque, and a missing one is named."""
    plan = load_profile(find_profile("finger")).guard_plan()
    board = _Board(TwinWiring(plan), DrivingWorld({"tendon"}, (160, 120), seed=0))
    ((level, sentence),) = _found(plan, board)["servo bus"]
    servos = [output for output in plan.outputs if output.driver == "bus_servo"]
    assert (level, sentence) == ("good", f"All {len(servos)} servos answer.")
    board.pins.require_rig().break_servo(servos[0].name, "mute")
    ((level, sentence),) = _found(plan, board)["servo bus"]
    assert (level, servos[0].name in sentence) == ("bad", True)


class _Held(MockPin):
    """A pin that something outside holds high or low; `level` is set by the test."""

    level = 0

    def _get_state(self) -> bool:
        return bool(self.level)


class _HeldHigh(_Held):
    level = 1


class _Pins(RealHardware):
    """gpiozero's mock pins, some of them held."""

    def __init__(self, held: dict[int, type[_Held]]) -> None:
        super().__init__()
        self.factory: Any = MockFactory()
        for pin, kind in held.items():
            self.factory.pin(pin, pin_class=kind)

    def pin_factory(self) -> Any:
        return self.factory


def _resistors(plan: GuardPlan, held: dict[int, type[_Held]]) -> list[tuple[str, str]]:
    robot = StandingRobot(plan, hardware=lambda: _Pins(held), motors_off=True, on_twin=True)
    return [(one.level, one.sentence) for one in examine(robot) if one.check == "resistors"]


def test_missing_and_wrong_resistors() -> None:
    """A pin that follows the Pi's own resistor has none; one that is held high is dangerous."""
    car = load_profile(find_profile("car")).guard_plan()
    found = _resistors(car, {22: _Held, 27: _HeldHigh})
    assert ("good", "GPIO22, drive forward, is pulled down.") in found
    words = {sentence.split(",")[0]: (level, sentence) for level, sentence in found}
    assert words["GPIO27"][0] == "bad"
    assert "holds it high" in words["GPIO27"][1]
    assert words["GPIO4"][0] == "bad"
    assert "no pull-down: fit 10 kOhm to ground" in words["GPIO4"][1]


@pytest.mark.parametrize(("held", "words"), [({}, "has no pull-up"), ({25: _Held}, "is held low")])
def test_oe_needs_a_pull_up(held: dict[int, type[_Held]], words: str) -> None:
    """Without one a servo board sends pulses while no program holds it."""
    cat = load_profile(find_profile("cat")).guard_plan()
    ((level, sentence),) = _resistors(cat, held)
    assert level == "bad"
    assert f"GPIO25, OE of the servo board, {words}: fit 10 kOhm to 3.3 V" in sentence


def test_the_wiring_is_examined_on_a_computer(tmp_path: Path, car: GuardPlan) -> None:
    """It does so where there are pins and buses, and the robot is not served."""
    for name in ("gpiochip0", "i2c-1"):
        (tmp_path / "dev").mkdir(exist_ok=True)
        (tmp_path / "dev" / name).touch()

    def checks(port: int, root: Path = tmp_path) -> dict[str, str]:
        board = _board(car)
        found = examine(
            StandingRobot(car, None, port, root, hardware=lambda: board.hardware, motors_off=True)
        )
        return {one.check: one.sentence for one in found}

    wiring = {"resistors", "emergency button", "sensor"}
    assert wiring <= checks(0).keys()
    # Who asked for the resistors is told why nothing follows.
    without_pins = checks(0, tmp_path / "workstation")
    assert without_pins["resistors"] == "Not tested: this computer has no pins."
    assert wiring & without_pins.keys() == {"resistors"}
    with socket.create_server(("", 0)) as taken:
        found = checks(taken.getsockname()[1])
    assert "wiring" in found
    assert not wiring & found.keys()
