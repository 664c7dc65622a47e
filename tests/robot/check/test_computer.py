"""Checks of a robot before it drives."""

import re
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Self, cast

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.check.check import Finding
from shapechanger.robot.check.computer import examine
from shapechanger.robot.check.wiring import StandingRobot
from shapechanger.robot.hardware import RealClock
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.setup.systemd import unit_name
from tests.robot.profile.texts import finger_text, read
from tests.robots import write_profile

_CAMERA = CameraPlan("pattern")
_MOTOR = OutputPlan("drive", "hbridge", "wheels", {"throttle": 1.0}, settings={"forward": 22})
_SERVO = OutputPlan(
    "steering",
    "servo",
    "steering",
    settings={"over": "pca9685", "bus": 1, "output_enable": -1},
)
CAR = GuardPlan("car", (ActionPlan("throttle", propels=True),), (_MOTOR,))


class _Camera:
    """Returns a frame, raises an error, or blocks until closed."""

    def __init__(self, gives: Frame | RobotError | None) -> None:
        self._gives = gives
        self._closed = threading.Event()

    def read(self) -> Frame:
        if self._gives is None:
            self._closed.wait()
            raise RobotError("The camera was closed.")
        if isinstance(self._gives, RobotError):
            raise self._gives
        return self._gives

    def close(self) -> None:
        self._closed.set()


def _found(
    root: Path,
    guard: GuardPlan = CAR,
    camera: CameraPlan | None = None,
    gives: Frame | RobotError | None = None,
) -> dict[str, Finding]:
    findings = examine(StandingRobot(guard, camera, 0, root, lambda _: _Camera(gives)))
    return {finding.check: finding for finding in findings}


def _write(root: Path, name: str, text: str) -> None:
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


@pytest.mark.parametrize(
    ("line", "level"),
    [
        ("dtparam=strict_gpiod", "good"),
        ("dtparam=i2c_arm=on,strict_gpiod=on  # Pins of the dead go low.", "good"),
        ("#dtparam=strict_gpiod", "bad"),
        ("dtparam=strict_gpiod=off", "bad"),
        ("dtparam=i2c_arm=on", "bad"),
    ],
)
def test_strict_gpiod_is_read_from_the_boot_configuration(
    tmp_path: Path, line: str, level: str
) -> None:
    """The option makes pins go low when their process dies."""
    _write(tmp_path, "boot/firmware/config.txt", f"# Bookworm\n{line}\n")
    assert _found(tmp_path)["strict_gpiod"].level == level


def test_on_a_workstation_the_computer_is_unknown(tmp_path: Path) -> None:
    """A missing boot configuration is not an error."""
    found = _found(tmp_path)
    assert (found["computer"].level, found["strict_gpiod"].level) == ("unknown", "unknown")
    assert "--twin" in found["computer"].sentence


@pytest.mark.parametrize(
    ("unit", "level", "sentence"),
    [
        ("Restart=always\nExecStopPost=/x/shapechanger robot safe-pins car.toml\n", "good", ""),
        (
            "Restart=on-failure\nExecStopPost=shapechanger robot safe-pins car.toml\n",
            "bad",
            "R",
        ),
        ("Restart=always\n", "bad", "ExecStopPost"),
    ],
)
def test_the_systemd_unit_must_restart_and_make_safe(
    tmp_path: Path, unit: str, level: str, sentence: str
) -> None:
    """A unit needs Restart=always and an ExecStopPost that makes the pins safe."""
    _write(tmp_path, f"etc/systemd/system/{unit_name('car')}", f"[Service]\n{unit}")
    finding = _found(tmp_path)["systemd"]
    assert finding.level == level
    assert sentence in finding.sentence


def test_missing_safety_hardware_is_reported(tmp_path: Path) -> None:
    """A servo board without OE and motors without a one-shot are reported."""
    found = _found(tmp_path, replace(CAR, outputs=(_SERVO,)))
    assert {found["enable line"].level, found["output enable"].level} == {"bad"}
    assert _found(tmp_path, replace(CAR, enable_pin=18))["enable line"].level == "good"


def test_only_the_devices_of_the_outputs_are_checked(tmp_path: Path) -> None:
    """A car on an H-bridge needs no I2C bus."""
    guard = replace(CAR, outputs=(_MOTOR, _SERVO))
    _write(tmp_path, "dev/gpiochip0", "")
    sentences = {
        f.sentence: f.level
        for f in examine(StandingRobot(guard, None, 0, tmp_path))
        if f.check == "devices"
    }
    assert sorted(sentences.values()) == ["bad", "good"]
    assert any("raspi-config" in sentence and "i2c-1" in sentence for sentence in sentences)
    # No setting of a computer adds pins to it.
    elsewhere = _found(tmp_path / "workstation")["devices"].sentence
    assert "only a computer with GPIO pins" in elsewhere
    assert "raspi-config" not in elsewhere


def test_the_camera_is_opened(tmp_path: Path) -> None:
    """The finding reports whether the camera returns a frame."""
    frame = Frame(b"\xff\xd8", 0)
    assert _found(tmp_path, camera=_CAMERA, gives=frame)["camera"].level == "good"
    broken = _found(tmp_path, camera=_CAMERA, gives=RobotError("It burns."))["camera"]
    assert (broken.level, broken.sentence) == ("bad", "pattern: It burns.")


def test_a_camera_that_hangs_does_not_hang_the_checks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Waiting for a frame times out (see picamera2#1004)."""
    monkeypatch.setattr("shapechanger.robot.check.computer._CAMERA_S", 0.01)
    assert "no frame" in _found(tmp_path, camera=_CAMERA)["camera"].sentence


def test_a_port_in_use_is_reported(tmp_path: Path) -> None:
    """A second daemon on the port would fail."""
    with socket.socket() as taken:
        taken.bind(("", 0))
        taken.listen()
        port = taken.getsockname()[1]
        ports = [f for f in examine(StandingRobot(CAR, None, port, tmp_path)) if f.check == "port"]
    assert [f.level for f in ports] == ["bad"]


def test_a_slow_adapter_is_reported(tmp_path: Path) -> None:
    """A latency timer of 16 ms would make answers late."""
    rig = load_profile(find_profile("finger")).guard_plan()
    timer = "sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
    assert _found(tmp_path, rig)["latency timer"].level == "unknown"
    assert "plug in the adapter" in _found(tmp_path, rig)["devices"].sentence
    _write(tmp_path, "dev/ttyUSB0", "")
    _write(tmp_path, timer, "16\n")
    assert _found(tmp_path, rig)["latency timer"].level == "bad"
    assert _found(tmp_path, rig)["devices"].level == "good"
    _write(tmp_path, timer, "1\n")
    assert _found(tmp_path, rig)["latency timer"].level == "good"
    assert _found(tmp_path, rig)["enable line"].level == "good"


def test_servos_without_a_watchdog_need_a_power_switch(tmp_path: Path) -> None:
    """They require the one-shot, and the pins that feed it."""
    rig = read(finger_text("Feetech")).guard_plan()
    _write(tmp_path, "dev/ttyUSB0", "")
    found = _found(tmp_path, rig)
    assert found["enable line"].level == "good"
    assert "as servos without a watchdog must" in found["enable line"].sentence
    pins = [
        f.sentence
        for f in examine(StandingRobot(rig, None, 0, tmp_path))
        if "gpiochip0" in f.sentence
    ]
    assert len(pins) == 1
    assert "does not exist" in pins[0]
    bare = _found(tmp_path, replace(rig, enable_pin=None))["enable line"]
    assert bare.level == "bad"
    assert "Fit the one-shot" in bare.sentence


class _Stuck:
    """Hardware and camera of which one method never returns, or raises.

    Args:
        where: Name of the method.
        error: What it raises; None to hang until `freed`.
        freed: Ends the hanging.
    """

    def __init__(self, where: str, error: Exception | None, freed: threading.Event) -> None:
        self._where = where
        self._error = error
        self._freed = freed
        self.clock = RealClock()

    def _maybe(self, method: str) -> None:
        if method == self._where:
            if self._error is not None:
                raise self._error
            self._freed.wait()
        elif method in {"pin_factory", "i2c"}:
            raise RobotError(f"Not here: {method}.")

    def open(self, plan: CameraPlan) -> Self:
        del plan
        self._maybe("open")
        return self

    def read(self) -> Frame:
        """Read a frame of the camera."""
        self._maybe("read")
        return Frame(b"\xff\xd8", 1)

    def pin_factory(self) -> Any:
        self._maybe("pin_factory")

    def i2c(self, bus: int) -> Any:
        """Open no bus."""
        del bus
        self._maybe("i2c")

    servo_pins = servo_port = pin_factory

    def close(self) -> None:
        """Close the camera, or the hardware."""
        self._maybe("close")


@pytest.fixture
def freed() -> Iterator[threading.Event]:
    """An event that ends all hanging after the test."""
    event = threading.Event()
    yield event
    event.set()


@pytest.mark.parametrize("where", ["open", "read", "pin_factory", "i2c", "close"])
@pytest.mark.parametrize("error", [None, OSError(5, "Input/output error"), ValueError("Odd.")])
def test_a_driver_that_hangs_or_fails_leaves_the_other_checks(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    freed: threading.Event,
    where: str,
    error: Exception | None,
) -> None:
    """Each check has a deadline, its failure is a finding, and all others are made."""
    limit_s = 0.05 if error is None else 5.0
    monkeypatch.setattr("shapechanger.robot.check.computer._CAMERA_S", limit_s)
    for name in ("dev/gpiochip0", "dev/i2c-1"):
        _write(tmp_path, name, "")
    robot = load_profile(write_profile(tmp_path).path).guard_plan()
    guard = replace(robot, outputs=(*robot.outputs, replace(_SERVO, name="turn")))

    def findings(stuck: _Stuck) -> list[Finding]:
        return list(
            examine(
                StandingRobot(
                    guard,
                    _CAMERA,
                    0,
                    tmp_path,
                    stuck.open,
                    hardware=lambda: cast("Any", stuck),
                    motors_off=True,
                    limit_s=limit_s,
                )
            )
        )

    found = findings(_Stuck(where, error, freed))
    words = "No answer within|no frame within" if error is None else "Input/output|Odd"
    assert any(re.search(words, one.sentence) for one in found if one.level == "bad")
    sound = findings(_Stuck("", None, freed))
    assert {one.check for one in found} >= {one.check for one in sound}
    assert found[-1].check == "port"
