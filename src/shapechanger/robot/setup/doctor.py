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
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from shapechanger.errors import ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, open_camera
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan

__all__ = ["Finding", "examine_robot", "unit_name", "uses_pins"]

_CONFIGS: Final = ("boot/firmware/config.txt", "boot/config.txt")
_NOT_IN_UNITS: Final = re.compile(r"[^A-Za-z0-9_.-]")
_CAMERA_S: Final = 5.0
_STRICT: Final = re.compile(r"^\s*dtparam\s*=\s*([^#]*,)?strict_gpiod(=(on|1|true))?\s*(,|#|$)")


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check came to.

    Attributes:
        check: What was looked at.
        level: "good", "missing" for something to mend, "unknown" for what cannot be told here.
        sentence: What was found, and what to do.
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
) -> Iterator[Finding]:
    """Look at everything that the robot's safety and work depend on.

    Args:
        guard: Its outputs, sensors and limits.
        camera: Its camera, if it has one.
        port: Port that it will be reached at.
        root: Root of the file system, for tests.
        look: Opens the camera.
        profile: The robot's profile, which the systemd unit must name; None to leave that out.
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
    yield _port(port)


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
    for name in _CONFIGS:
        path = root / name
        if path.exists():
            if any(_STRICT.match(line) for line in path.read_text().splitlines()):
                return Finding("strict_gpiod", "good", f"{path} sets it: pins of the dead go low.")
            return Finding(
                "strict_gpiod",
                "missing",
                f"A pin keeps its level when the process that set it dies: add "
                f"`dtparam=strict_gpiod` to {path} and restart the computer.",
            )
    return Finding("strict_gpiod", "unknown", "There is no config.txt of a Raspberry Pi here.")


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
    for name, group in wanted.items():
        path = root / name
        if not path.exists():
            yield Finding(
                "devices",
                "missing",
                f"{path} is not there: enable it with `sudo raspi-config` (Interface Options).",
            )
        elif not os.access(path, os.R_OK | os.W_OK):
            yield Finding(
                "devices",
                "missing",
                f"This user may not open {path}: `sudo adduser $USER {group}` and log in again.",
            )
        else:
            yield Finding("devices", "good", f"{path} can be opened.")


def uses_pins(output: OutputPlan) -> bool:
    """Whether an output is on the computer's own pins, and not on a bus."""
    return output.driver in {"hbridge", "phase_enable"} or output.settings.get("over") == "lgpio"


def _packages(guard: GuardPlan, camera: CameraPlan | None) -> Iterator[Finding]:
    wanted = {"gpiozero": "pip install 'shapechanger[robot]'"}
    wanted["lgpio"] = "pip install lgpio, or for Python 3.13 `sudo apt install python3-lgpio`"
    if any("bus" in plan.settings for plan in [*guard.outputs, *guard.sensors]):
        wanted["smbus2"] = "pip install 'shapechanger[robot]'"
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
