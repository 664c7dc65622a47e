"""Checks of a robot's computer, drivers and settings, before it drives.

No check moves an output. Each returns a sentence, with a remedy where something must be fixed.
"""

from __future__ import annotations

import importlib.util
import os
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, open_camera
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.robot.hardware import RealHardware

if TYPE_CHECKING:  # The drivers need gpiozero, which may be missing.
    from shapechanger.robot.drivers.as5600 import As5600

_CONFIGS: Final = ("boot/firmware/config.txt", "boot/config.txt")
_NOT_IN_UNITS: Final = re.compile(r"[^A-Za-z0-9_.-]")
_CAMERA_S: Final = 5.0
_STRICT: Final = re.compile(r"^\s*dtparam\s*=\s*([^#]*,)?strict_gpiod(=(on|1|true))?\s*(,|#|$)")
_FAST_HZ: Final = 400_000
_BAUD: Final = re.compile(r"^\s*dtparam\s*=\s*(?:[^#]*,)?i2c(?:_arm)?_baudrate=(\d+)", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one check.

    Attributes:
        check: Name of the check.
        level: "good", "missing" for something to fix, "unknown" for what cannot be checked here.
        sentence: The result, and the remedy.
    """

    check: str
    level: Literal["good", "missing", "unknown"]
    sentence: str


def examine_robot(
    guard: GuardPlan,
    camera: CameraPlan | None,
    port: int,
    root: Path = Path("/"),
    look: Callable[[CameraPlan], Camera] = open_camera,
    profile: Path | None = None,
    encoders: Callable[[SensorPlan], As5600] | None = None,
) -> Iterator[Finding]:
    """Check all that the robot's safety and function depend on.

    Args:
        guard: Outputs, sensors and limits of the robot.
        camera: Its camera, or None.
        port: Port of its server.
        root: Root of the file system, for tests.
        look: Opens the camera.
        profile: The robot's profile, which the systemd unit must name; None to skip this check.
        encoders: Opens the encoders of its joints; None for this machine's bus.
    """
    yield _computer(root)
    yield _strict_gpiod(root)
    yield _unit(guard.name, profile, root)
    yield _one_shot(guard)
    yield from _output_enable(guard)
    yield from _devices(guard, root)
    yield from _packages(guard, camera)
    if camera is not None:
        yield _camera(camera, look)
        yield _geometry(camera)
    free = _port(port)
    yield from _encoders(guard, root, encoders or _real_encoders, served=free.level != "good")
    yield free


def unit_name(robot: str) -> str:
    """Return the name of a robot's systemd unit; one computer may serve several robots."""
    return f"shapechanger-{_NOT_IN_UNITS.sub('-', robot)}.service"


def uses_pins(output: OutputPlan) -> bool:
    """Return True if an output is on the computer's own pins, and not on a bus."""
    return output.driver in {"hbridge", "phase_enable"} or output.settings.get("over") == "lgpio"


def _computer(root: Path) -> Finding:
    path = root / "proc/device-tree/model"
    if not path.exists():
        return Finding(
            "computer",
            "unknown",
            "This is not a Raspberry Pi: `serve --twin` runs the robot on simulated pins here.",
        )
    return Finding("computer", "good", path.read_text().strip("\0\n ") + ".")


def _strict_gpiod(root: Path) -> Finding:
    path = _config(root)
    if path is None:
        return Finding("strict_gpiod", "unknown", "This machine has no Raspberry Pi config.txt.")
    if any(_STRICT.match(line) for line in path.read_text().splitlines()):
        return Finding(
            "strict_gpiod", "good", f"{path} sets it: the pins of a process that dies go low."
        )
    return Finding(
        "strict_gpiod",
        "missing",
        f"A pin keeps its level when the process that set it dies: add "
        f"`dtparam=strict_gpiod` to {path} and restart the computer.",
    )


def _config(root: Path) -> Path | None:
    """Return the config.txt of a Raspberry Pi."""
    paths = [root / name for name in _CONFIGS]
    return next((path for path in paths if path.exists()), None)


def _unit(robot: str, profile: Path | None, root: Path) -> Finding:
    path = root / "etc/systemd/system" / unit_name(robot)
    if not path.exists():
        return Finding(
            "systemd",
            "missing",
            f"{path} does not exist, so after a crash nothing restarts the robot or makes its pins "
            "safe: `shapechanger robot init` writes it beside the profile; copy it there.",
        )
    text = path.read_text()
    lacks = [
        setting
        for setting, pattern in (
            ("Restart=always", r"^Restart=always\s*$"),
            ("ExecStopPost=… robot safe-pins", r"^ExecStopPost=.*robot safe-pins"),
        )
        if not re.search(pattern, text, re.MULTILINE)
    ]
    for word in ("serve", "safe-pins") if profile is not None else ():
        named = rf"^Exec\w+=.*robot {word} {re.escape(str(profile))}(\s|$)"
        if not lacks and not re.search(named, text, re.MULTILINE):
            sentence = f"{path} is for another profile: `robot {word}` does not name {profile}."
            return Finding("systemd", "missing", sentence)
    if lacks:
        return Finding("systemd", "missing", f"{path} lacks {' and '.join(lacks)}.")
    return Finding("systemd", "good", f"{path} restarts the robot and makes its pins safe.")


def _one_shot(guard: GuardPlan) -> Finding:
    if all(output.driver == "dynamixel" for output in guard.outputs):
        sentence = "Each servo has its own watchdog, and releases when its bus is silent."
        return Finding("enable line", "good", sentence)
    if guard.enable_pin is None:
        return Finding(
            "enable line",
            "missing",
            "The profile has no [enable] pin: if guard and supervisor are killed together, only "
            "strict_gpiod and pull-downs are left. Fit the one-shot of the hardware guide.",
        )
    return Finding(
        "enable line",
        "good",
        f"The guard feeds a one-shot on pin {guard.enable_pin}; without edges the motors lose "
        "power. Measure that once, because it cannot be checked here.",
    )


def _output_enable(guard: GuardPlan) -> Iterator[Finding]:
    for output in guard.outputs:
        if output.settings.get("over") == "pca9685" and output.settings.get("output_enable") == -1:
            yield Finding(
                "output enable",
                "missing",
                f"{output.name} is on a PCA9685 that keeps its last pulse for ever: wire OE to "
                "a pin with a pull-up and name it as output_enable.",
            )
            return


def _devices(guard: GuardPlan, root: Path) -> Iterator[Finding]:
    """Check that this user can open the device files."""
    wanted: dict[str, str] = {}
    if any(uses_pins(output) for output in guard.outputs):
        wanted["dev/gpiochip0"] = "gpio"
    plans = [*guard.outputs, *guard.sensors]
    for plan in plans:
        if "bus" in plan.settings and plan.settings.get("over", "pca9685") == "pca9685":
            wanted[f"dev/i2c-{plan.settings['bus']}"] = "i2c"
    for plan in guard.outputs:
        if plan.driver == "dynamixel":
            wanted[str(plan.settings["device"]).lstrip("/")] = "dialout"
    yield from _latency_timers(guard, root)
    for name, group in wanted.items():
        path = root / name
        if not path.exists():
            yield Finding(
                "devices",
                "missing",
                f"{path} does not exist: enable it with `sudo raspi-config` (Interface Options)."
                if group != "dialout"
                else f"{path} does not exist: plug in the adapter of the servo bus.",
            )
        elif not os.access(path, os.R_OK | os.W_OK):
            yield Finding(
                "devices",
                "missing",
                f"This user may not open {path}: `sudo adduser $USER {group}` and log in again.",
            )
        else:
            yield Finding("devices", "good", f"{path} can be opened.")


def _latency_timers(guard: GuardPlan, root: Path) -> Iterator[Finding]:
    """Check that the adapters pass on the servos' answers at once."""
    for device in {str(o.settings["device"]) for o in guard.outputs if o.driver == "dynamixel"}:
        path = root / "sys/bus/usb-serial/devices" / Path(device).name / "latency_timer"
        if not path.exists():
            sentence = f"{device} reports no latency timer; if it has one, it must be 1 ms."
            yield Finding("latency timer", "unknown", sentence)
        elif (ms := path.read_text().strip()) != "1":
            yield Finding(
                "latency timer",
                "missing",
                f"The adapter at {device} delays the servos' answers by {ms} ms: "
                f"`echo 1 | sudo tee {path}`.",
            )
        else:
            yield Finding("latency timer", "good", f"The latency timer of {device} is 1 ms.")


def _packages(guard: GuardPlan, camera: CameraPlan | None) -> Iterator[Finding]:
    wanted = {"gpiozero": "pip install 'shapechanger[robot]'"}
    wanted["lgpio"] = "pip install lgpio, or for Python 3.13 `sudo apt install python3-lgpio`"
    if any("bus" in plan.settings for plan in [*guard.outputs, *guard.sensors]):
        wanted["smbus2"] = "pip install 'shapechanger[robot]'"
    if any(output.driver == "dynamixel" for output in guard.outputs):
        wanted["dynamixel_sdk"] = "pip install 'shapechanger[robot,finger]'"
    if camera is not None and camera.driver == "picamera2":
        wanted["picamera2"] = (
            "sudo apt install python3-picamera2, and make the virtual environment with "
            "--system-site-packages"
        )
    for name, remedy in wanted.items():
        if importlib.util.find_spec(name) is None:
            yield Finding("packages", "missing", f"{name} is not installed: {remedy}.")
        else:
            yield Finding("packages", "good", f"{name} is installed.")


def _camera(plan: CameraPlan, look: Callable[[CameraPlan], Camera]) -> Finding:
    with ThreadPoolExecutor(1) as reader:
        try:
            camera = look(plan)
        except ShapechangerError as error:
            return Finding("camera", "missing", f"{plan.driver}: {error}")
        try:
            frame = reader.submit(camera.read).result(_CAMERA_S)
        except TimeoutError:
            sentence = f"{plan.driver} sent no frame within {_CAMERA_S:g} s."
            return Finding("camera", "missing", sentence)
        except ShapechangerError as error:
            return Finding("camera", "missing", f"{plan.driver}: {error}")
        finally:
            camera.close()  # Also ends a `read` that still waits.
    return Finding("camera", "good", f"{plan.driver} sent a frame of {len(frame.jpeg)} bytes.")


def _geometry(plan: CameraPlan) -> Finding:
    """Whether policies that drive by waypoints can use the camera."""
    if plan.pitch_deg is None or plan.fovy_deg is None:
        return Finding(
            "camera's geometry",
            "unknown",
            "pitch_deg and fovy_deg are not stated, which policies with waypoints need: "
            "`shapechanger robot camera` measures them.",
        )
    return Finding(
        "camera's geometry",
        "good",
        f"It looks {plan.pitch_deg:g} degrees down and sees {plan.fovy_deg:g} degrees from top to "
        "bottom; `shapechanger robot camera` draws it.",
    )


def _encoders(
    guard: GuardPlan, root: Path, connect: Callable[[SensorPlan], As5600], *, served: bool
) -> Iterator[Finding]:
    """Check the encoders at the joints, where their bus can be opened."""
    sensors = [sensor for sensor in guard.sensors if sensor.driver == "as5600"]
    if not sensors or importlib.util.find_spec("gpiozero") is None:
        return
    yield _bus_speed(_config(root))
    for plan in sensors:
        if not os.access(root / f"dev/i2c-{plan.settings['bus']}", os.R_OK | os.W_OK):
            continue
        if served:
            # The guard then has the multiplexer to itself: a channel opened by another process
            # would give it the angle of another joint.
            sentence = "The robot may be served now, and its encoders were left alone."
            yield Finding("encoders", "unknown", sentence)
            continue
        try:
            sensor = connect(plan)
        except RobotError as error:
            yield Finding("encoders", "missing", str(error))
            continue
        try:
            for encoder in sensor.encoders:
                yield _encoder(sensor, encoder.joint)
        finally:
            sensor.close()


def _real_encoders(plan: SensorPlan) -> As5600:
    from shapechanger.robot.drivers.as5600 import connect_encoders

    return connect_encoders(plan, RealHardware())


def _encoder(sensor: As5600, joint: str) -> Finding:
    (encoder,) = (one for one in sensor.encoders if one.joint == joint)
    try:
        measured = sensor.measure(encoder)
    except RobotError as error:
        return Finding("encoders", "missing", str(error))
    if not measured.detects_magnet:
        sentence = f"The encoder of {joint} detects no magnet: fit one above the chip."
        return Finding("encoders", "missing", sentence)
    if measured.too_weak or measured.too_strong:
        where = "far from" if measured.too_weak else "near to"
        return Finding("encoders", "missing", f"The magnet of {joint} is too {where} its encoder.")
    return Finding("encoders", "good", f"The encoder of {joint} detects its magnet.")


def _bus_speed(config: Path | None) -> Finding:
    """Check that the I2C bus is fast enough to read the encoders in each tick of the guard."""
    if config is None:
        sentence = f"The bus should have {_FAST_HZ} bits per second, which cannot be read here."
        return Finding("I2C speed", "unknown", sentence)
    rates = _BAUD.findall(config.read_text())
    if rates and int(rates[-1]) >= _FAST_HZ:
        return Finding("I2C speed", "good", f"{config} sets {rates[-1]} bits per second.")
    return Finding(
        "I2C speed",
        "missing",
        f"Four encoders take 3 of every 10 ms at the default of 100000 bits per second: add "
        f"`dtparam=i2c_arm_baudrate={_FAST_HZ}` to {config} and restart the computer.",
    )


def _port(port: int) -> Finding:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError as error:
            return Finding(
                "port",
                "missing",
                f"Port {port} cannot be used ({error.strerror}). Is the robot served already?",
            )
    return Finding("port", "good", f"Port {port} is free.")
