"""Checks of a robot without any motion: its settings, its computer and its wiring.

A check is a generator of results. Checks of pins and buses need exclusive access, so they are
skipped while the robot is served.
"""

from __future__ import annotations

import importlib.util
import os
import re
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from shapechanger.contract.plan import GuardPlan, SensorPlan, driven_pins
from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import CameraPlan, open_camera
from shapechanger.robot.check.pins import outside_level, pin_level
from shapechanger.robot.check.report import Checks, Finding, Result, Results, judged, run_checks
from shapechanger.robot.daemon.credentials import credentials_folder, load_credentials
from shapechanger.robot.drivers.as5600 import As5600
from shapechanger.robot.drivers.chip import SENSORS, device_errors
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.guard.outputs import OutputBank
from shapechanger.robot.hardware import Hardware
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.install import (
    Machine,
    device_groups,
    has_ribbon,
    servo_devices,
    settings_of_computer,
    unit_name,
    unit_word,
)

# Time for each check, s; a bus whose servos are all silent needs the longest, some seconds.
CHECK_S: Final = 10.0


@dataclass(frozen=True)
class StandingRobot:
    """A robot that is not driven."""

    profile: Profile
    port: int = 0  # Port of its server.
    root: Path = Path("/")  # Root of the file system.
    hardware: Callable[[], Hardware] = Hardware  # Opens its pins and buses.
    motors_off: bool = False  # Whether the motors' supply is off, so resistors can be tested.
    installed: bool = True  # Whether this is the robot's computer; False for a bench with LEDs.
    on_twin: bool = False  # Whether it is a twin, which has all pins and buses but no settings.
    credentials: Path | None = None  # Folder of key and certificate; None for `init`'s folder.

    @cached_property
    def pins(self) -> Hardware:
        """Pins and buses of the robot, opened once."""
        return self.hardware()

    @cached_property
    def port_error(self) -> str:
        """Why the robot's port cannot be used; "" if it can."""
        try:
            socket.create_server(("", self.port)).close()
        except OSError as error:
            return os.strerror(error.errno or 0)
        return ""

    @property
    def has_pins(self) -> bool:
        """Whether the robot's computer has pins."""
        return self.on_twin or any((self.root / "dev").glob("gpiochip*"))

    def has_bus(self, bus: int) -> bool:
        """Return whether this user may open an I2C bus."""
        return self.on_twin or os.access(self.root / f"dev/i2c-{bus}", os.R_OK | os.W_OK)


def examine(robot: StandingRobot) -> Iterator[Finding]:
    """Check a robot's settings, computer and wiring, as far as possible without moving it.

    A check that fails or hangs yields a finding, and the next check begins.
    """
    return run_checks(_checks(robot), CHECK_S)


def _checks(robot: StandingRobot) -> Checks:
    if not robot.on_twin:
        if robot.installed:
            profile = robot.profile
            yield "profile", [("good", f"{profile.path} is valid.")]
            yield "credentials", _credentials(robot)
            if profile.calibrated is None:
                remedy = f"Never calibrated: shapechanger robot calibrate {profile.path}"
                yield "calibration", [("unknown", remedy)]
            yield "systemd", _unit(robot)
        yield from _computer(robot)
    # While a robot is served, its guard uses the pins and buses.
    if not robot.port_error and importlib.util.find_spec("gpiozero") is not None:
        yield from _wiring(robot)
    yield "wiring", _close(robot)
    if robot.installed and not robot.on_twin:
        otherwise = f"Port {robot.port} cannot be used ({robot.port_error}). Is the robot served?"
        yield "port", [judged(not robot.port_error, f"Port {robot.port} is free.", otherwise)]


def _computer(robot: StandingRobot) -> Checks:
    profile, machine = robot.profile, Machine(root=robot.root)
    model = ("good", f"{machine.model}.")
    other = "This is not a Raspberry Pi: `serve --twin` runs on simulated pins here."
    yield "computer", [model if machine.model else ("unknown", other)]
    for change in settings_of_computer(profile, machine):
        level = "good" if change.is_made() else "bad" if machine.config else "unknown"
        remedy = f"Not yet: {change.state} `shapechanger robot install {profile.path}` does this."
        otherwise = remedy if change.commands else change.instead
        yield change.name, [(level, change.state if level == "good" else otherwise)]
    yield "enable line", [_enable_line(profile)]
    if any(settings["output_enable"] == -1 for settings in _boards(profile)):
        reason = "A PCA9685 without output_enable keeps its last pulse: wire OE to a pin with "
        yield "output enable", [("bad", reason + "a pull-up and name it as output_enable.")]
    yield "devices", _devices(robot)
    yield "packages", _packages(profile)
    if (camera := profile.camera) is not None:
        yield "camera", _camera(camera)
        if camera.pitch_deg is None or camera.fovy_deg is None:
            reason = "pitch_deg and fovy_deg are missing, and policies with waypoints need them: "
            geometry = "unknown", reason + "`shapechanger robot camera` measures them."
        else:
            view = (
                f"It looks {camera.pitch_deg:g} degrees down and sees {camera.fovy_deg:g} degrees "
            )
            geometry = "good", view + "from top to bottom; `shapechanger robot camera` draws it."
        yield "camera's geometry", [geometry]


def _wiring(robot: StandingRobot) -> Checks:
    profile = robot.profile
    if driven_pins(profile) or any(one["output_enable"] != -1 for one in _boards(profile)):
        yield "resistors", _resistors(robot)
    if robot.has_pins and profile.stop_pin is not None:
        yield "emergency button", _button(robot, profile.stop_pin)
    for bus, address in sorted({(one["bus"], one["address"]) for one in _boards(profile)}):
        if robot.has_bus(bus):
            yield "servo board", _servo_board(robot, bus, address)
    sensors = [
        plan
        for plan in profile.sensors
        if plan.driver == "cpu_temperature"
        or (robot.has_bus(plan.settings["bus"]) if "bus" in plan.settings else robot.has_pins)
    ]
    for plan in sensors:
        if plan.driver not in {"as5600", DRIVER}:  # Encoders and servos have other checks.
            yield "sensor", _sensor(robot, plan)
    if any(output.driver == DRIVER for output in profile.outputs):
        yield "servo bus", _servo_bus(robot)
    for plan in (one for one in sensors if one.driver == "as5600"):
        for joint in plan.settings["rows"]:
            yield "encoders", _encoder(robot, plan, joint)


def _credentials(robot: StandingRobot) -> Results:
    made = load_credentials(robot.credentials or credentials_folder(robot.profile.name))
    yield "good", f"Key and certificate: {made.folder}."


def _unit(robot: StandingRobot) -> Results:
    profile = robot.profile.path.absolute()
    path = robot.root / "etc/systemd/system" / unit_name(robot.profile.name)
    remedy = f"`shapechanger robot install {profile}` puts it there"
    word = unit_word(str(profile))
    needed = [
        "Restart=always",
        f"ExecStart=…robot serve {word}",
        f"ExecStopPost=…shapechanger.robot.safe_pins {word}",
    ]
    text = path.read_text() if path.exists() else ""
    patterns = {one: re.escape(one).replace("…", ".*") for one in needed}
    lacks = [one for one in needed if not re.search(rf"(?m)^{patterns[one]}(\s|$)", text)]
    yield judged(
        not lacks,
        f"{path} restarts the robot and makes its pins safe.",
        f"{path} is missing, old or for another profile, because it lacks {' and '.join(lacks)}: "
        f"{remedy}.",
    )


def _enable_line(guard: GuardPlan) -> Result:
    if all(map(stops_itself, guard.outputs)):
        return "good", "Each servo has its own watchdog, and releases when its bus is silent."
    return judged(
        guard.enable_pin is not None,
        f"The guard feeds a one-shot on pin {guard.enable_pin}; without edges, motors and servos "
        "without a watchdog must lose power. Measure that once: it cannot be checked here.",
        "The profile has no [enable] pin: if guard and supervisor are killed together, only "
        "strict_gpiod and pull-downs are left. Fit the one-shot of the hardware guide.",
    )


def _devices(robot: StandingRobot) -> Results:
    for name, group in device_groups(robot.profile).items():
        path = robot.root / name.lstrip("/")
        wrong = f"This user may not open {path}: `sudo adduser $USER {group}` and log in again."
        if not path.exists():
            wrong = f"{path} does not exist: a Raspberry Pi has it once the robot is installed."
        yield judged(os.access(path, os.R_OK | os.W_OK), f"{path} can be opened.", wrong)


def _packages(profile: Profile) -> Results:
    plans = (*profile.outputs, *profile.sensors)
    for name, is_needed, remedy in (
        ("gpiozero", True, "pip install 'shapechanger[robot]'"),
        ("lgpio", True, "pip install lgpio, or `sudo apt install python3-lgpio`"),
        ("smbus2", any("bus" in plan.settings for plan in plans), "pip install smbus2"),
        ("dynamixel_sdk", servo_devices(profile), "pip install 'shapechanger[robot,finger]'"),
        ("picamera2", has_ribbon(profile), "it needs a venv with --system-site-packages"),
    ):
        if is_needed:
            is_there = importlib.util.find_spec(name) is not None
            yield judged(is_there, f"{name} is installed.", f"{name} is not installed: {remedy}.")


def _camera(plan: CameraPlan) -> Results:
    with closing(open_camera(plan)) as camera:
        yield "good", f"{plan.driver} sent a frame of {len(camera.read().jpeg)} bytes."


def _close(robot: StandingRobot) -> Results:
    """Close the pins and buses, or report that they were left alone; closing may hang."""
    if robot.port_error:
        yield "unknown", "The robot may be served now, so its pins and buses were left alone."
    if "pins" in vars(robot):
        robot.pins.close()


_MODE1: Final = 0x00  # First register of a PCA9685; reading it has no side effect.
_NO_BATTERY_V: Final = 1.0
_DISTANCE_READS: Final = 6
_PING_NS: Final = 70_000_000  # Longer than the 60 ms from ping to ping of an HC-SR04.


def _boards(guard: GuardPlan) -> list[dict[str, Any]]:
    return [one.settings for one in guard.outputs if one.settings.get("over") == "pca9685"]


def _resistors(robot: StandingRobot) -> Results:
    """Check the resistors that keep outputs off while no program holds their pins.

    Each pin becomes an input with the Pi's own resistor of about 50 kOhm, first up and then down;
    an external resistor of 10 kOhm overrules it. A motor could start if one is missing, so the
    supply of the motors must be off.
    """
    if not (robot.has_pins and robot.motors_off):
        lacks = "switch the motors' supply off, and add --motors-off"
        yield "unknown", f"Not tested: {lacks if robot.has_pins else 'this computer has no pins'}."
        return
    down = ("down", "high", "ground, because it may run while no program holds the pin")
    up = ("up", "low", "3.3 V, because the board sends pulses while no program holds it")
    pins = [(pin, use, 0, *down) for pin, use in driven_pins(robot.profile).items()]
    enables = sorted({one["output_enable"] for one in _boards(robot.profile)} - {-1})
    pins += [(pin, "OE of the servo board", 1, *up) for pin in enables]
    for pin, use, rest, pull, wrong, remedy in pins:
        level = outside_level(pin, robot.pins)
        problem = f"has no pull-{pull}" if level is None else f"is held {wrong}"
        good = f"GPIO{pin}, {use}, is pulled {pull}."
        yield judged(level == rest, good, f"GPIO{pin}, {use}, {problem}: fit 10 kOhm to {remedy}.")


def _button(robot: StandingRobot, pin: int) -> Results:
    yield judged(
        bool(pin_level(pin, robot.pins, pull_up=True)),
        f"GPIO{pin} is high: released, or not fitted. Hold it down and check again to tell.",
        f"GPIO{pin} is low: it is pressed, or its wire touches ground.",
    )


def _sensor(robot: StandingRobot, plan: SensorPlan) -> Results:
    if plan.measures == "speed":  # Only a turning wheel changes the levels of its encoder.
        pins = [plan.settings[key] for key in ("a", "b") if plan.settings[key] >= 0]
        high = [pin_level(pin, robot.pins, pull_up=True) for pin in pins]
        levels = [f"GPIO{p} is {'high' if h else 'low'}" for p, h in zip(pins, high, strict=True)]
        remedy = "turn the wheel a little by hand and check again: each must change now and then"
        yield "unknown", f"{plan.name}: {', '.join(levels)}; {remedy}."
        return
    clock = robot.pins.clock
    with closing(SENSORS[plan.driver].open(plan, robot.pins)) as sensor:
        reading: dict[str, float] = {}
        for _ in range(_DISTANCE_READS if plan.measures == "distance" else 1):
            if reading := sensor.read(clock.now_ns(), 0.0):
                break
            clock.wait([], clock.now_ns() + _PING_NS, _PING_NS / 1e9)
    match plan.measures:
        case "battery":
            volts, least_v = reading["battery"], robot.profile.limits.low_battery_v
            measured = f"{plan.name} measures {volts:.2f} V"
            otherwise = f"{measured}, below low_battery_v, {least_v:g} V: charge the battery."
            if volts < _NO_BATTERY_V:
                otherwise = f"{measured}: connect its V- to the load."
            yield judged(volts >= max(least_v, _NO_BATTERY_V), f"{measured}.", otherwise)
        case "bump":
            otherwise = f"{plan.name} is pressed, or it is miswired."
            yield judged(not reading["bump"], f"{plan.name} is not pressed.", otherwise)
        case _:
            values = ", ".join(f"{name} {value:.2f}" for name, value in reading.items())
            yield "good" if values else "unknown", f"{plan.name}: {values or 'no value yet'}."


def _servo_board(robot: StandingRobot, bus: int, address: int) -> Results:
    """Check that a PCA9685 answers, without changing its pulses."""
    name = f"The PCA9685 at {address:#04x} on I2C bus {bus}"
    wires = f"Look at SDA, SCL, 3.3 V and ground, and at `i2cdetect -y {bus}`."
    with (
        translate_errors(RobotError, to=lambda error: RobotError(f"{error} {wires}")),
        device_errors(name),
        closing(robot.pins.i2c(bus)) as opened,
    ):
        opened.read_i2c_block_data(address, _MODE1, 1)
    yield "good", f"{name} answers."


def _servo_bus(robot: StandingRobot) -> Results:
    """Check, without torque, that every servo answers and has the model of the profile."""
    servos = tuple(output for output in robot.profile.outputs if output.driver == DRIVER)
    if not all(map(stops_itself, servos)):
        yield "unknown", "Not tested: these servos have power only while the enable line is on."
        return
    with ExitStack() as opened:
        bank = OutputBank(replace(robot.profile, outputs=servos), robot.pins)
        opened.callback(lambda: bank.close(robot.pins.clock.now_ns()))
        bank.release()
    yield "good", f"All {len(servos)} servos answer."


def _encoder(robot: StandingRobot, plan: SensorPlan, joint: str) -> Results:
    with closing(As5600(plan, robot.pins)) as sensor:
        _, magnet = sensor.measure(joint)
    if magnet == "gone":
        yield "bad", f"The encoder of {joint} detects no magnet: fit one above the chip."
        return
    where = "far from" if magnet == "weak" else "near to"
    otherwise = f"The magnet of {joint} is too {where} its encoder."
    yield judged(not magnet, f"The encoder of {joint} detects its magnet.", otherwise)
