"""What keeps a robot from being safe or from working, found before it drives.

Nothing here moves an output. Each check says in a sentence what it found and, where something is
missing, what to do.
"""

from __future__ import annotations

import importlib.util
import os
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Final

from shapechanger.errors import ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, open_camera
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.robot.setup.finding import Finding

if TYPE_CHECKING:  # The drivers need gpiozero, and whether it is there is looked at first.
    from shapechanger.robot.drivers.as5600 import As5600

__all__ = ["Finding", "examine_robot", "unit_name", "uses_pins"]

_CONFIGS: Final = ("boot/firmware/config.txt", "boot/config.txt")
_NOT_IN_UNITS: Final = re.compile(r"[^A-Za-z0-9_.-]")
_CAMERA_S: Final = 5.0
_STRICT: Final = re.compile(r"^\s*dtparam\s*=\s*([^#]*,)?strict_gpiod(=(on|1|true))?\s*(,|#|$)")


def examine_robot(
    guard: GuardPlan,
    camera: CameraPlan | None,
    port: int,
    root: Path = Path("/"),
    look: Callable[[CameraPlan], Camera] = open_camera,
    profile: Path | None = None,
    encoders: Callable[[SensorPlan], As5600] | None = None,
) -> Iterator[Finding]:
    """Look at everything that the robot's safety and work depend on.

    Args:
        guard: Its outputs, sensors and limits.
        camera: Its camera, if it has one.
        port: Port that it will be reached at.
        root: Root of the file system, for tests.
        look: Opens the camera.
        profile: The robot's profile, which the systemd unit must name; None to leave that out.
        encoders: Reaches the encoders of its joints; None for this machine's bus.
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
    free = _port(port)
    yield from _encoders(guard, root, encoders, served=free.level != "good")
    yield free


def unit_name(robot: str) -> str:
    """Name of a robot's systemd unit, so that a computer may serve several robots."""
    return f"shapechanger-{_NOT_IN_UNITS.sub('-', robot)}.service"


def _computer(root: Path) -> Finding:
    path = root / "proc/device-tree/model"
    if not path.exists():
        return Finding(
            "computer",
            "unknown",
            "This is no Raspberry Pi: `serve --twin` runs the robot on simulated pins here.",
        )
    return Finding("computer", "good", path.read_text().strip("\0\n ") + ".")


def _strict_gpiod(root: Path) -> Finding:
    path = _config(root)
    if path is None:
        return Finding("strict_gpiod", "unknown", "There is no config.txt of a Raspberry Pi here.")
    if any(_STRICT.match(line) for line in path.read_text().splitlines()):
        return Finding("strict_gpiod", "good", f"{path} sets it: pins of the dead go low.")
    return Finding(
        "strict_gpiod",
        "missing",
        f"A pin keeps its level when the process that set it dies: add "
        f"`dtparam=strict_gpiod` to {path} and restart the computer.",
    )


def _config(root: Path) -> Path | None:
    """The config.txt of a Raspberry Pi."""
    paths = [root / name for name in _CONFIGS]
    return next((path for path in paths if path.exists()), None)


def _unit(robot: str, profile: Path | None, root: Path) -> Finding:
    path = root / "etc/systemd/system" / unit_name(robot)
    if not path.exists():
        return Finding(
            "systemd",
            "missing",
            f"{path} is not there, so nothing starts the robot again, or makes its pins safe, when "
            "it crashes: `shapechanger robot init` writes one beside the profile; copy it there.",
        )
    text = path.read_text()
    lacks = [
        words
        for words, pattern in (
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
        sentence = "Each servo has a watchdog of its own, and lets go when its bus is silent."
        return Finding("enable line", "good", sentence)
    if guard.enable_pin is None:
        return Finding(
            "enable line",
            "missing",
            "The profile names no [enable] pin: if guard and supervisor are killed together, only "
            "strict_gpiod and pull-downs are left. Fit the one-shot of the hardware guide.",
        )
    return Finding(
        "enable line",
        "good",
        f"The guard feeds a one-shot on pin {guard.enable_pin}; without edges the motors lose "
        "their power. Measure that once: nothing here can see it.",
    )


def _output_enable(guard: GuardPlan) -> Iterator[Finding]:
    for output in guard.outputs:
        if output.settings.get("over") == "pca9685" and output.settings.get("output_enable") == -1:
            yield Finding(
                "output enable",
                "missing",
                f"{output.name} hangs on a PCA9685 that keeps its last pulse for ever: wire OE to "
                "a pin with a pull-up and name it as output_enable.",
            )
            return


def _devices(guard: GuardPlan, root: Path) -> Iterator[Finding]:
    """Whether the device files are there for this user."""
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
                f"{path} is not there: enable it with `sudo raspi-config` (Interface Options)."
                if group != "dialout"
                else f"{path} is not there: plug in the adapter of the servo bus.",
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
    """Whether adapters hand on at once what servos say."""
    for device in {str(o.settings["device"]) for o in guard.outputs if o.driver == "dynamixel"}:
        path = root / "sys/bus/usb-serial/devices" / Path(device).name / "latency_timer"
        if not path.exists():
            sentence = (
                f"{device} says nothing of a latency timer; it must be 1 ms where it has one."
            )
            yield Finding("latency timer", "unknown", sentence)
        elif (ms := path.read_text().strip()) != "1":
            yield Finding(
                "latency timer",
                "missing",
                f"The adapter at {device} waits for {ms} ms before it hands on what the servos "
                f"say: `echo 1 | sudo tee {path}`.",
            )
        else:
            yield Finding("latency timer", "good", f"That of {device} is 1 ms.")


def _encoders(
    guard: GuardPlan,
    root: Path,
    connect: Callable[[SensorPlan], As5600] | None,
    *,
    served: bool,
) -> Iterator[Finding]:
    """How the encoders at the joints are, where their bus can be opened."""
    sensors = [sensor for sensor in guard.sensors if sensor.driver == "as5600"]
    if not sensors or importlib.util.find_spec("gpiozero") is None:
        return
    from shapechanger.robot.setup.zeros import bus_speed, examine_encoders, real_encoders

    yield bus_speed(_config(root))
    for sensor in sensors:
        if os.access(root / f"dev/i2c-{sensor.settings['bus']}", os.R_OK | os.W_OK):
            yield from examine_encoders(sensor, connect or real_encoders, served=served)


def uses_pins(output: OutputPlan) -> bool:
    """Whether an output is on the computer's own pins, and not on a bus."""
    return output.driver in {"hbridge", "phase_enable"} or output.settings.get("over") == "lgpio"


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
            sentence = f"{plan.driver} gave no picture within {_CAMERA_S:g} s."
            return Finding("camera", "missing", sentence)
        except ShapechangerError as error:
            return Finding("camera", "missing", f"{plan.driver}: {error}")
        finally:
            camera.close()  # Ends a `read` that still waits, too.
    return Finding("camera", "good", f"{plan.driver} gave a picture of {len(frame.jpeg)} bytes.")


def _port(port: int) -> Finding:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError as error:
            return Finding(
                "port", "missing", f"Port {port} cannot be used ({error.strerror}): is it served?"
            )
    return Finding("port", "good", f"Port {port} is free.")
