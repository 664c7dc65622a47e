"""Checks of a robot's computer, settings and wires, before it drives; no check moves an output."""

from __future__ import annotations

import importlib.util
import os
import re
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Final

from shapechanger.errors import ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan
from shapechanger.robot.check.check import (
    Check,
    Finding,
    Results,
    finish_in_time,
    judged,
    run_checks,
)
from shapechanger.robot.check.wiring import StandingRobot, wiring_checks
from shapechanger.robot.daemon.credentials import credentials_folder, load_credentials
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.computer import (
    FAST_HZ,
    boot_config,
    boot_lines,
    boot_rates,
    device_groups,
    sets_parameter,
)
from shapechanger.robot.setup.systemd import unit_name, unit_word

_CAMERA_S: Final = 5.0


def _profile(profile: Profile) -> Results:
    yield "good", f"{profile.path} is valid."


def _credentials(robot: StandingRobot) -> Results:
    folder = load_credentials(robot.credentials or credentials_folder(robot.guard.name))
    yield "good", f"Key and certificate: {folder.key_file.parent}."


def _calibration(profile: Profile) -> Results:
    if profile.calibrated is None:
        yield "unknown", f"Never calibrated: shapechanger robot calibrate {profile.path}"


def _computer(robot: StandingRobot) -> Results:
    path = robot.root / "proc/device-tree/model"
    if path.exists():
        yield "good", path.read_text().strip("\0\n ") + "."
    else:
        words = "This is not a Raspberry Pi: `serve --twin` runs the robot on simulated pins here."
        yield "unknown", words


def _strict_gpiod(robot: StandingRobot) -> Results:
    path = boot_config(robot.root)
    if path is None:
        yield "unknown", "This machine has no Raspberry Pi config.txt."
    elif sets_parameter(boot_lines(path), "strict_gpiod"):
        yield "good", f"{path} sets it: the pins of a process that dies go low."
    else:
        yield (
            "bad",
            f"A pin keeps its level when the process that set it dies: add "
            f"`dtparam=strict_gpiod` to {path} and restart the computer.",
        )


_IN_UNIT: Final = {
    "Restart=always": r"^Restart=always\s*$",
    "ExecStopPost=… robot safe-pins": r"^ExecStopPost=.*robot safe-pins",
}
"""Settings that a unit must have, with their patterns."""


def _unit(robot: StandingRobot) -> Results:
    profile = robot.unit_of
    path = robot.root / "etc/systemd/system" / unit_name(robot.guard.name)
    if not path.exists():
        yield (
            "bad",
            f"{path} does not exist, so after a crash nothing restarts the robot or makes its pins "
            f"safe: `shapechanger robot install {profile or 'PROFILE'}` puts it there.",
        )
        return
    text = path.read_text()
    lacks = [s for s, pattern in _IN_UNIT.items() if not re.search(pattern, text, re.MULTILINE)]
    if lacks:
        yield "bad", f"{path} lacks {' and '.join(lacks)}."
        return
    for word in ("serve", "safe-pins") if profile is not None else ():
        named = rf"^Exec\w+=.*robot {word} {re.escape(unit_word(str(profile)))}(\s|$)"
        if not re.search(named, text, re.MULTILINE):
            words = f"{path} is for another profile: `robot {word}` does not name {profile}."
            yield "bad", words
            return
    yield "good", f"{path} restarts the robot and makes its pins safe."


def _one_shot(robot: StandingRobot) -> Results:
    if all(map(stops_itself, robot.guard.outputs)):
        yield "good", "Each servo has its own watchdog, and releases when its bus is silent."
    elif robot.guard.enable_pin is None:
        yield (
            "bad",
            "The profile has no [enable] pin: if guard and supervisor are killed together, only "
            "strict_gpiod and pull-downs are left. Fit the one-shot of the hardware guide.",
        )
    else:
        yield (
            "good",
            f"The guard feeds a one-shot on pin {robot.guard.enable_pin}; without edges the motors "
            "lose power, as servos without a watchdog must. Measure that once, because it cannot "
            "be checked here.",
        )


def _output_enable(robot: StandingRobot) -> Results:
    for output in robot.guard.outputs:
        if output.settings.get("over") == "pca9685" and output.settings.get("output_enable") == -1:
            yield (
                "bad",
                f"{output.name} is on a PCA9685 that keeps its last pulse for ever: wire OE to "
                "a pin with a pull-up and name it as output_enable.",
            )
            return


def _latency_timers(robot: StandingRobot) -> Results:
    """Check that the adapters pass on the servos' answers at once."""
    for device in {o.settings["device"] for o in robot.guard.outputs if o.driver == DRIVER}:
        path = robot.root / "sys/bus/usb-serial/devices" / Path(device).name / "latency_timer"
        if not path.exists():
            yield "unknown", f"{device} reports no latency timer; if it has one, it must be 1 ms."
        elif (ms := path.read_text().strip()) != "1":
            yield (
                "bad",
                f"The adapter at {device} delays the servos' answers by {ms} ms: "
                f"`echo 1 | sudo tee {path}`.",
            )
        else:
            yield "good", f"The latency timer of {device} is 1 ms."


_WITHOUT_DEVICE: Final = {
    "gpio": "only a computer with GPIO pins, such as a Raspberry Pi, drives this robot",
    "i2c": "switch the bus on with `sudo raspi-config` (Interface Options), and restart",
    "dialout": "plug in the adapter of the servo bus",
}
"""Remedies for device files that do not exist, by their group."""


def _devices(robot: StandingRobot) -> Results:
    """Check that this user can open the device files."""
    for name, group in device_groups(robot.guard).items():
        path = robot.root / name.lstrip("/")
        if not path.exists():
            yield "bad", f"{path} does not exist: {_WITHOUT_DEVICE[group]}."
        elif not os.access(path, os.R_OK | os.W_OK):
            remedy = f"`sudo adduser $USER {group}` and log in again"
            yield "bad", f"This user may not open {path}: {remedy}."
        else:
            yield "good", f"{path} can be opened."


def _packages(robot: StandingRobot) -> Results:
    guard, camera = robot.guard, robot.camera
    remedies = {"gpiozero": "pip install 'shapechanger[robot]'"}
    remedies["lgpio"] = "pip install lgpio, or for Python 3.13 `sudo apt install python3-lgpio`"
    if any("bus" in plan.settings for plan in (*guard.outputs, *guard.sensors)):
        remedies["smbus2"] = "pip install 'shapechanger[robot]'"
    if any(output.driver == DRIVER for output in guard.outputs):
        remedies["dynamixel_sdk"] = "pip install 'shapechanger[robot,finger]'"
    if camera is not None and camera.driver == "picamera2":
        remedies["picamera2"] = (
            "sudo apt install python3-picamera2, and make the virtual environment with "
            "--system-site-packages"
        )
    for name, remedy in remedies.items():
        there = importlib.util.find_spec(name) is not None
        yield judged(there, f"{name} is {'installed' if there else f'not installed: {remedy}'}.")


def _camera(robot: StandingRobot, plan: CameraPlan) -> Results:
    late = f"{plan.driver} sent no frame within {_CAMERA_S:g} s."
    try:
        with closing(robot.look(plan)) as camera:  # Also ends a `read` that still waits.
            yield from finish_in_time(_frame(plan, camera), _CAMERA_S, late)
    except ShapechangerError as error:
        yield "bad", f"{plan.driver}: {error}"


def _frame(plan: CameraPlan, camera: Camera) -> Results:
    try:
        yield "good", f"{plan.driver} sent a frame of {len(camera.read().jpeg)} bytes."
    except ShapechangerError as error:
        yield "bad", f"{plan.driver}: {error}"


def _geometry(plan: CameraPlan) -> Results:
    """Check that policies that drive by waypoints can use the camera."""
    if plan.pitch_deg is None or plan.fovy_deg is None:
        words = "pitch_deg and fovy_deg are not stated, which policies with waypoints need: "
        yield "unknown", words + "`shapechanger robot camera` measures them."
    else:
        words = f"It looks {plan.pitch_deg:g} degrees down and sees {plan.fovy_deg:g} degrees from "
        yield "good", words + "top to bottom; `shapechanger robot camera` draws it."


def _bus_speed(robot: StandingRobot) -> Results:
    """Check that the I2C bus is fast enough to read the encoders in each tick of the guard."""
    config = boot_config(robot.root)
    if config is None:
        words = f"The bus should have {FAST_HZ} bits per second, which cannot be read here."
        yield "unknown", words
        return
    rates = boot_rates(config)
    if rates and rates[-1] >= FAST_HZ:
        yield "good", f"{config} sets {rates[-1]} bits per second."
    else:
        yield (
            "bad",
            f"Four encoders take 3 of every 10 ms at the default of 100000 bits per second: add "
            f"`dtparam=i2c_arm_baudrate={FAST_HZ}` to {config} and restart the computer.",
        )


def _port(robot: StandingRobot) -> Results:
    if robot.port_error:
        reason = f"Port {robot.port} cannot be used ({robot.port_error})."
        yield "bad", f"{reason} Is the robot served already?"
    else:
        yield "good", f"Port {robot.port} is free."


def _close(robot: StandingRobot) -> Results:
    """Close what was opened, which may hang."""
    if robot.port_error:
        words = "The robot may be served now, so its pins and buses were left alone."
        yield "unknown", words
    if "pins" in vars(robot):
        robot.pins.close()


def _own_checks(robot: StandingRobot) -> Iterator[Check]:
    """Yield the checks of a robot's profile, computer, installation and camera."""
    if (profile := robot.profile) is not None:
        yield Check("profile", partial(_profile, profile))
        yield Check("credentials", partial(_credentials, robot))
        yield Check("calibration", partial(_calibration, profile))
    yield Check("computer", partial(_computer, robot))
    yield Check("strict_gpiod", partial(_strict_gpiod, robot))
    if robot.installed:
        yield Check("systemd", partial(_unit, robot))
    yield Check("enable line", partial(_one_shot, robot))
    yield Check("output enable", partial(_output_enable, robot))
    yield Check("latency timer", partial(_latency_timers, robot))
    yield Check("devices", partial(_devices, robot))
    yield Check("packages", partial(_packages, robot))
    if (camera := robot.camera) is not None:
        yield Check("camera", partial(_camera, robot, camera))
        yield Check("camera's geometry", partial(_geometry, camera))
    if any(sensor.driver == "as5600" for sensor in robot.guard.sensors):
        yield Check("I2C speed", partial(_bus_speed, robot))


def examine(robot: StandingRobot) -> Iterator[Finding]:
    """Check all that a robot's safety and function depend on, without moving it.

    A check that fails or hangs is a finding, and the others go on.
    """
    checks = [] if robot.on_twin else [*_own_checks(robot)]
    checks += [*wiring_checks(robot), Check("wiring", partial(_close, robot))]
    if robot.installed and not robot.on_twin:
        checks.append(Check("port", partial(_port, robot)))
    return run_checks(checks, robot.limit_s)
