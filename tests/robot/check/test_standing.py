"""Checks of a standing robot: its computer, and its wiring on simulated boards and pins."""

import re
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import pytest
from gpiozero.pins.mock import MockPin

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.check import standing
from shapechanger.robot.check.report import Finding
from shapechanger.robot.check.standing import StandingRobot, examine
from shapechanger.robot.drivers.switch import SimulatedSwitch
from shapechanger.robot.hardware import Clock
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.install import unit_name
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.room import DrivingWorld
from tests.robot.check.held_pins import HeldPins, shipped
from tests.robot.profile.texts import finger_text, read
from tests.robot.twin.in_process import LocalBoard
from tests.robots import write_profile

Found = dict[str, list[tuple[str, str]]]

_BOARD = {"over": "pca9685", "bus": 1, "address": 0x40, "output_enable": -1}
_SERVO = OutputPlan("turn", "servo", "steering", settings=_BOARD)


@pytest.fixture
def car(tmp_path: Path) -> Profile:
    """A car with all protective sensors, and without a camera."""
    return replace(write_profile(tmp_path), camera=None)


def _write(root: Path, name: str, text: str = "") -> None:
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def _found(robot: StandingRobot) -> Found:
    found: Found = {}
    for check, level, sentence in examine(robot):
        found.setdefault(check, []).append((level, sentence))
    return found


def _on(root: Path, profile: Profile, **more: Any) -> dict[str, Finding]:
    robot = StandingRobot(profile, root=root, **more)
    return {finding.check: finding for finding in examine(robot)}


@pytest.mark.parametrize(
    ("line", "gpiod", "speed"),
    [
        ("dtparam=strict_gpiod", "good", "bad"),
        ("dtparam=i2c_arm=on,strict_gpiod=on  # Pins of the dead go low.", "good", "bad"),
        ("#dtparam=strict_gpiod", "bad", "bad"),
        ("dtparam=strict_gpiod\ndtparam=strict_gpiod=off", "bad", "bad"),
        ("[pi5]\ndtparam=strict_gpiod", "bad", "bad"),
        ("dtparam=i2c_arm=on,i2c_arm_baudrate=400000", "bad", "good"),
        ("dtparam = i2c_baudrate=1000000", "bad", "good"),
        ("dtparam=i2c_arm_baudrate=400000\ndtparam=i2c_arm_baudrate=100000", "bad", "bad"),
    ],
)
def test_the_boot_configuration_is_read(tmp_path: Path, line: str, gpiod: str, speed: str) -> None:
    """Encoders need a fast bus; of several lines for a setting, the last one is in force."""
    _write(tmp_path, "boot/firmware/config.txt", f"# Bookworm\n{line}\n")
    found = _on(tmp_path, replace(shipped("finger"), camera=None, enable_pin=19))
    assert (found["strict_gpiod"].level, found["I2C speed"].level) == (gpiod, speed)


def test_on_a_workstation_the_computer_is_unknown(tmp_path: Path, car: Profile) -> None:
    found = _on(tmp_path, replace(car, sensors=()))
    assert (found["computer"].level, found["strict_gpiod"].level) == ("unknown", "unknown")
    assert "does not exist: a Raspberry Pi has it" in found["devices"].sentence
    assert "I2C speed" not in found


_EXECUTES = (
    "Restart={}\nExecStart=/x robot serve {}\nExecStopPost=x shapechanger.robot.safe_pins {}\n"
)


@pytest.mark.parametrize(
    ("restart", "safe", "sentence"),
    [
        ("always", "car.toml", "makes its pins safe"),
        ("on-failure", "car.toml", "lacks Restart=always"),
        ("always", "b.toml", "another profile"),
    ],
)
def test_the_systemd_unit_must_restart_and_make_safe(
    tmp_path: Path, car: Profile, restart: str, safe: str, sentence: str
) -> None:
    text = _EXECUTES.format(restart, car.path, car.path if safe == "car.toml" else safe)
    _write(tmp_path, f"etc/systemd/system/{unit_name(car.name)}", f"[Service]\n{text}")
    finding = _on(tmp_path, car)["systemd"]
    assert (finding.level == "good") == ("safe" in sentence)
    assert sentence in finding.sentence


def test_missing_safety_hardware_is_reported(tmp_path: Path, car: Profile) -> None:
    """Servo boards need OE; motors, and servos without a watchdog, need the one-shot."""
    found = _on(tmp_path, replace(car, outputs=(_SERVO,), enable_pin=None))
    assert {found["enable line"].level, found["output enable"].level} == {"bad"}
    assert _on(tmp_path, car)["enable line"].level == "good"
    _write(tmp_path, "dev/ttyUSB0")
    rig = replace(read(finger_text("Feetech")), camera=None)
    found = _found(StandingRobot(rig, root=tmp_path))
    ((level, sentence),) = found["enable line"]
    assert (level, "motors and servos without a watchdog must" in sentence) == ("good", True)
    assert any("gpiochip0 does not exist" in sentence for _, sentence in found["devices"])
    bare = _on(tmp_path, replace(rig, enable_pin=None))["enable line"]
    assert (bare.level, "Fit the one-shot" in bare.sentence) == ("bad", True)


def _hardware(where: str = "", act: Any = None) -> Any:
    """Return hardware with a camera, without pins and buses; the method `where` calls `act`."""
    made = MagicMock(clock=Clock())
    for name in ("pin_factory", "i2c", "servo_port"):
        getattr(made, name).side_effect = RobotError("Not here.")
    made.open.return_value = made
    made.read.return_value = Frame(b"\xff\xd8", 1)
    if where:
        getattr(made, where).side_effect = act
    return made


@pytest.fixture
def freed() -> Iterator[threading.Event]:
    event = threading.Event()
    yield event
    event.set()


@pytest.mark.parametrize("where", ["open", "read", "pin_factory", "i2c", "close"])
@pytest.mark.parametrize(
    ("error", "text"),
    [(None, "No answer"), (RobotError("Hot."), r"^Hot\.|: Hot\."), (ValueError("Odd."), "Odd")],
)
def test_a_driver_that_hangs_or_fails_does_not_end_the_checks(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    freed: threading.Event,
    car: Profile,
    where: str,
    error: Exception | None,
    text: str,
) -> None:
    """Each check has a deadline; its failure is a finding, and all other checks are made."""
    monkeypatch.setattr(standing, "CHECK_S", 0.05 if error is None else 5.0)
    for name in ("dev/gpiochip0", "dev/i2c-1"):
        _write(tmp_path, name)
    profile = replace(car, camera=CameraPlan("pattern"), outputs=(*car.outputs, _SERVO))

    def findings(hardware: Any) -> list[Finding]:
        monkeypatch.setattr(standing, "open_camera", hardware.open)
        robot = StandingRobot(profile, root=tmp_path, hardware=lambda: hardware, motors_off=True)
        return list(examine(robot))

    found = findings(_hardware(where, error or (lambda *_: freed.wait())))
    assert any(re.search(text, one.sentence) for one in found if one.level == "bad")
    sound = findings(_hardware())
    assert [one.level for one in sound if one.check == "camera"] == ["good"]
    assert {one.check for one in found} >= {one.check for one in sound}
    assert found[-1].check == "port"


class _Board(LocalBoard):
    def wait_until(self, until_ns: int) -> bool:
        self.advance(until_ns)
        return True


def _board(profile: Profile) -> _Board:
    parts = {output.part for output in profile.outputs}
    return _Board(TwinWiring(profile.guard_plan()), DrivingWorld(parts, (160, 120), seed=0))


def _wired(profile: Profile, hardware: Any, *, motors_off: bool = True) -> Found:
    robot = StandingRobot(profile, hardware=lambda: hardware, motors_off=motors_off, on_twin=True)
    return _found(robot)


def test_all_findings_of_a_well_wired_car_are_good(car: Profile) -> None:
    """Only the wheel's sensor is unknown, because a person has to turn the wheel."""
    board = _board(car)
    found = _wired(car, board.hardware)
    assert [level for level, _ in found["resistors"]] == ["good"] * 5
    assert ("good", "GPIO19, enable line, is pulled down.") in found["resistors"]
    assert found["emergency button"][0][0] == "good"
    levels = {sentence.split()[0].rstrip(":"): level for level, sentence in found["sensor"]}
    assert levels == {"wheel": "unknown", "bumper": "good", "front": "good", "pack": "good"}
    # No output was ever driven.
    assert not any(board.pins.levels.duties.get(pin) for pin in (4, 17, 22, 27, 19))


def test_while_the_supply_may_be_on_no_output_is_touched(car: Profile) -> None:
    """While the motors have a supply, a motor without its resistor could start."""
    board = _board(car)
    level, sentence = _wired(car, board.hardware, motors_off=False)["resistors"][0]
    assert (level, "--motors-off" in sentence) == ("unknown", True)
    assert not board.levels.keys() & {4, 17, 22, 27, 19}


def test_pressed_switches_and_a_low_battery_are_reported(car: Profile) -> None:
    """The voltage is compared with the robot's limit; 0 V is reported as a missing wire."""
    car = replace(car, limits=replace(car.limits, low_battery_v=50.0))
    board = _board(car)
    board.pins.stop_held = True
    for bumper in board.pins.of_kind(SimulatedSwitch):
        bumper.held = True
    board.pass_ns(100_000_000)
    hardware: Any = board.hardware
    found = _wired(car, hardware)
    level, sentence = found["emergency button"][0]
    assert (level, "it is pressed" in sentence) == ("bad", True)
    assert ("bad", "bumper is pressed, or it is miswired.") in found["sensor"]
    level, sentence = found["sensor"][-1]
    assert (level, "below low_battery_v, 50 V: charge" in sentence) == ("bad", True)
    bus = hardware.i2c(1)
    bus.read_i2c_block_data = lambda *_: [0, 0]
    hardware.i2c = lambda _: bus
    found = _wired(car, hardware)["sensor"][-1]
    assert found == ("bad", "pack measures 0.00 V: connect its V- to the load.")


def test_the_servos_of_a_rig_answer() -> None:
    rig = shipped("finger")
    board = _board(rig)
    assert _wired(rig, board.hardware)["servo bus"] == [("good", "All 7 servos answer.")]
    board.pins.require_rig().break_servo("EIP", "mute")
    ((level, sentence),) = _wired(rig, board.hardware)["servo bus"]
    assert (level, "EIP" in sentence) == ("bad", True)


@pytest.mark.parametrize(
    ("kind", "held", "expected"),
    [
        ("car", {22: False}, "good: GPIO22, drive forward, is pulled down."),
        ("car", {27: True}, "bad: GPIO27, drive backward, is held high: fit 10 kOhm to ground"),
        ("car", {}, "bad: GPIO4, steer forward, has no pull-down: fit 10 kOhm to ground"),
        ("cat", {}, "bad: GPIO25, OE of the servo board, has no pull-up: fit 10 kOhm to 3.3 V"),
        ("cat", {25: False}, "bad: GPIO25, OE of the servo board, is held low: fit 10 kOhm to"),
    ],
)
def test_only_the_right_resistor_is_good(kind: str, held: dict[int, bool], expected: str) -> None:
    """A pin that follows the Pi's own resistor has no external one."""
    pins = HeldPins(MockPin)
    for pin, level in held.items():
        holding = type("Held", (MockPin,), {"_get_state": lambda _, level=level: level})
        pins.factory.pin(pin, pin_class=holding)
    found = _wired(shipped(kind), pins)["resistors"]
    assert any(f"{level}: {sentence}".startswith(expected) for level, sentence in found)


def test_the_wiring_is_examined_on_a_computer(tmp_path: Path, car: Profile) -> None:
    """The wiring is checked if the computer has pins and buses, and the robot is not served."""
    for name in ("dev/gpiochip0", "dev/i2c-1"):
        _write(tmp_path, name)

    def checks(port: int = 0, root: Path = tmp_path) -> dict[str, Finding]:
        hardware = _board(car).hardware
        return _on(root, car, port=port, hardware=lambda: hardware, motors_off=True)

    wiring = {"resistors", "emergency button", "sensor"}
    assert wiring <= checks().keys()
    # Without pins, the finding explains why the resistors are not tested.
    without_pins = checks(root=tmp_path / "workstation")
    assert without_pins["resistors"].sentence == "Not tested: this computer has no pins."
    assert wiring & without_pins.keys() == {"resistors"}
    with socket.create_server(("", 0)) as taken:
        found = checks(taken.getsockname()[1])
    assert (found["port"].level, "wiring" in found) == ("bad", True)
    assert not wiring & found.keys()
