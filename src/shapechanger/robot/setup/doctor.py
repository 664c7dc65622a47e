"""Checks of a robot's computer, drivers and settings, before it drives.

No check moves an output. Each yields its results as a level and a sentence, with a remedy where
something must be fixed.
"""

from __future__ import annotations

import importlib.util
import os
import re
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, open_camera
from shapechanger.robot.drivers.servos.settings import DRIVER, stops_itself
from shapechanger.robot.guard.plan import GuardPlan, SensorPlan
from shapechanger.robot.hardware import Hardware, RealHardware
from shapechanger.robot.setup.systemd import unit_name, unit_word
from shapechanger.robot.setup.wiring import (
    CHECK_S,
    Level,
    Results,
    examine_wiring,
    finish_in_time,
    run_checks,
)

if TYPE_CHECKING:  # The drivers need gpiozero, which may be missing.
    from shapechanger.robot.drivers.as5600 import As5600, JointEncoder

_CONFIGS: Final = ("boot/firmware/config.txt", "boot/config.txt")
_CAMERA_S: Final = 5.0
_SECTION: Final = re.compile(r"^\s*\[([^\]]*)\]")
FAST_HZ: Final = 400_000
"""Speed of the I2C bus that encoders at joints need, bits per second."""

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
    level: Level
    sentence: str


def examine_robot(
    guard: GuardPlan,
    camera: CameraPlan | None,
    port: int,
    root: Path = Path("/"),
    look: Callable[[CameraPlan], Camera] = open_camera,
    profile: Path | None = None,
    hardware: Callable[[], Hardware] = RealHardware,
    *,
    motors_off: bool = False,
    limit_s: float = CHECK_S,
) -> Iterator[Finding]:
    """Check all that the robot's safety and function depend on.

    A check that fails or hangs is a finding, and the others go on.

    Args:
        guard: Outputs, sensors and limits of the robot.
        camera: Its camera, or None.
        port: Port of its server.
        root: Root of the file system, for tests.
        look: Opens the camera.
        profile: The robot's profile, which the systemd unit must name; None to skip this check.
        hardware: Opens its pins and buses.
        motors_off: Whether the motors have no supply, so that their resistors can be tested.
        limit_s: Time for each check, s.
    """
    checks: list[tuple[str, Results]] = [
        ("computer", _computer(root)),
        ("strict_gpiod", _strict_gpiod(root)),
        ("systemd", _unit(guard.name, profile, root)),
        ("enable line", _one_shot(guard)),
        ("output enable", _output_enable(guard)),
        ("latency timer", _latency_timers(guard, root)),
        ("devices", _devices(guard, root)),
        ("packages", _packages(guard, camera)),
    ]
    if camera is not None:
        checks += [("camera", _camera(camera, look)), ("camera's geometry", _geometry(camera))]
    is_free, port_words = _port(port)
    # Where the robot is served, its guard has them to itself.
    opened = hardware() if is_free and importlib.util.find_spec("gpiozero") is not None else None
    plans = [sensor for sensor in guard.sensors if sensor.driver == "as5600"]
    if plans:
        checks += [("I2C speed", _bus_speed(boot_config(root)))]
    if plans and opened is not None:
        checks += [("encoders", _encoders(plans, root, opened))]
    for check, level, sentence in run_checks(checks, limit_s):
        yield Finding(check, level, sentence)
    if opened is not None:
        try:
            for check, level, sentence in examine_wiring(
                guard,
                opened,
                motors_off=motors_off,
                has_pins=any((root / "dev").glob("gpiochip*")),
                has_bus=lambda bus: _has_bus(bus, root),
                limit_s=limit_s,
            ):
                yield Finding(check, level, sentence)
        finally:
            closed = run_checks([("wiring", _close(opened))], limit_s)
            unclosed = [Finding(check, level, sentence) for check, level, sentence in closed]
        yield from unclosed
    elif not is_free:
        words = "The robot may be served now, so its pins and buses were left alone."
        yield Finding("wiring", "unknown", words)
    yield Finding("port", "good" if is_free else "missing", port_words)


def _close(hardware: Hardware) -> Results:
    hardware.close()
    yield from ()


def needs_pins(guard: GuardPlan) -> bool:
    """Return True if a robot needs its computer's own pins, to move or to stop."""
    return guard.enable_pin is not None or any(
        output.driver in {"hbridge", "phase_enable"} or output.settings.get("over") == "lgpio"
        for output in guard.outputs
    )


def _computer(root: Path) -> Results:
    path = root / "proc/device-tree/model"
    if path.exists():
        yield "good", path.read_text().strip("\0\n ") + "."
    else:
        words = "This is not a Raspberry Pi: `serve --twin` runs the robot on simulated pins here."
        yield "unknown", words


def boot_config(root: Path) -> Path | None:
    """Return the config.txt of a Raspberry Pi; None on other machines."""
    paths = [root / name for name in _CONFIGS]
    return next((path for path in paths if path.exists()), None)


def boot_lines(config: Path) -> list[str]:
    """Return the lines of a config.txt that apply to every model, without those of a filter."""
    lines: list[str] = []
    section = "all"
    for line in config.read_text(encoding="utf-8", errors="replace").splitlines():
        if match := _SECTION.match(line):
            section = match[1]
        elif section == "all":
            lines.append(line)
    return lines


def sets_parameter(lines: Iterable[str], name: str) -> bool:
    """Return whether lines of a config.txt switch a device tree parameter on.

    Args:
        lines: The lines, of `boot_lines`.
        name: Name of the parameter, such as "i2c_arm".
    """
    pattern = rf"^\s*dtparam\s*=\s*([^#]*,)?{name}(=(on|1|true|yes))?\s*(,|#|$)"
    return any(re.match(pattern, line) for line in lines)


def _strict_gpiod(root: Path) -> Results:
    path = boot_config(root)
    if path is None:
        yield "unknown", "This machine has no Raspberry Pi config.txt."
    elif sets_parameter(boot_lines(path), "strict_gpiod"):
        yield "good", f"{path} sets it: the pins of a process that dies go low."
    else:
        yield (
            "missing",
            f"A pin keeps its level when the process that set it dies: add "
            f"`dtparam=strict_gpiod` to {path} and restart the computer.",
        )


_IN_UNIT: Final = {
    "Restart=always": r"^Restart=always\s*$",
    "ExecStopPost=… robot safe-pins": r"^ExecStopPost=.*robot safe-pins",
}
"""Settings that a unit must have, with their patterns."""


def _unit(robot: str, profile: Path | None, root: Path) -> Results:
    path = root / "etc/systemd/system" / unit_name(robot)
    if not path.exists():
        yield (
            "missing",
            f"{path} does not exist, so after a crash nothing restarts the robot or makes its pins "
            f"safe: `shapechanger robot install {profile or 'PROFILE'}` puts it there.",
        )
        return
    text = path.read_text()
    lacks = [s for s, pattern in _IN_UNIT.items() if not re.search(pattern, text, re.MULTILINE)]
    if lacks:
        yield "missing", f"{path} lacks {' and '.join(lacks)}."
        return
    for word in ("serve", "safe-pins") if profile is not None else ():
        named = rf"^Exec\w+=.*robot {word} {re.escape(unit_word(str(profile)))}(\s|$)"
        if not re.search(named, text, re.MULTILINE):
            words = f"{path} is for another profile: `robot {word}` does not name {profile}."
            yield "missing", words
            return
    yield "good", f"{path} restarts the robot and makes its pins safe."


def _one_shot(guard: GuardPlan) -> Results:
    if all(map(stops_itself, guard.outputs)):
        yield "good", "Each servo has its own watchdog, and releases when its bus is silent."
    elif guard.enable_pin is None:
        yield (
            "missing",
            "The profile has no [enable] pin: if guard and supervisor are killed together, only "
            "strict_gpiod and pull-downs are left. Fit the one-shot of the hardware guide.",
        )
    else:
        yield (
            "good",
            f"The guard feeds a one-shot on pin {guard.enable_pin}; without edges the motors lose "
            "power, as servos without a watchdog must. Measure that once, because it cannot be "
            "checked here.",
        )


def _output_enable(guard: GuardPlan) -> Results:
    for output in guard.outputs:
        if output.settings.get("over") == "pca9685" and output.settings.get("output_enable") == -1:
            yield (
                "missing",
                f"{output.name} is on a PCA9685 that keeps its last pulse for ever: wire OE to "
                "a pin with a pull-up and name it as output_enable.",
            )
            return


def _latency_timers(guard: GuardPlan, root: Path) -> Results:
    """Check that the adapters pass on the servos' answers at once."""
    for device in {o.settings["device"] for o in guard.outputs if o.driver == DRIVER}:
        path = root / "sys/bus/usb-serial/devices" / Path(device).name / "latency_timer"
        if not path.exists():
            yield "unknown", f"{device} reports no latency timer; if it has one, it must be 1 ms."
        elif (ms := path.read_text().strip()) != "1":
            yield (
                "missing",
                f"The adapter at {device} delays the servos' answers by {ms} ms: "
                f"`echo 1 | sudo tee {path}`.",
            )
        else:
            yield "good", f"The latency timer of {device} is 1 ms."


def device_groups(guard: GuardPlan) -> dict[str, str]:
    """Return the group that may open each device file of a robot's outputs and sensors."""
    groups: dict[str, str] = {}
    if needs_pins(guard):
        groups["/dev/gpiochip0"] = "gpio"
    for plan in (*guard.outputs, *guard.sensors):
        if "bus" in plan.settings and plan.settings.get("over", "pca9685") == "pca9685":
            groups[f"/dev/i2c-{plan.settings['bus']}"] = "i2c"
    for plan in guard.outputs:
        if plan.driver == DRIVER:
            groups[plan.settings["device"]] = "dialout"
    return groups


_WITHOUT_DEVICE: Final = {
    "gpio": "only a computer with GPIO pins, such as a Raspberry Pi, drives this robot",
    "i2c": "switch the bus on with `sudo raspi-config` (Interface Options), and restart",
    "dialout": "plug in the adapter of the servo bus",
}
"""Remedies for device files that do not exist, by their group."""


def _devices(guard: GuardPlan, root: Path) -> Results:
    """Check that this user can open the device files."""
    for name, group in device_groups(guard).items():
        path = root / name.lstrip("/")
        if not path.exists():
            yield "missing", f"{path} does not exist: {_WITHOUT_DEVICE[group]}."
        elif not os.access(path, os.R_OK | os.W_OK):
            remedy = f"`sudo adduser $USER {group}` and log in again"
            yield "missing", f"This user may not open {path}: {remedy}."
        else:
            yield "good", f"{path} can be opened."


def _packages(guard: GuardPlan, camera: CameraPlan | None) -> Results:
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
        if importlib.util.find_spec(name) is None:
            yield "missing", f"{name} is not installed: {remedy}."
        else:
            yield "good", f"{name} is installed."


def _camera(plan: CameraPlan, look: Callable[[CameraPlan], Camera]) -> Results:
    late = f"{plan.driver} sent no frame within {_CAMERA_S:g} s."
    try:
        camera = look(plan)
        try:
            yield from finish_in_time(_frame(plan, camera), _CAMERA_S, late)
        finally:
            camera.close()  # Also ends a `read` that still waits.
    except ShapechangerError as error:
        yield "missing", f"{plan.driver}: {error}"


def _frame(plan: CameraPlan, camera: Camera) -> Results:
    try:
        frame = camera.read()
    except ShapechangerError as error:
        yield "missing", f"{plan.driver}: {error}"
    else:
        yield "good", f"{plan.driver} sent a frame of {len(frame.jpeg)} bytes."


def _geometry(plan: CameraPlan) -> Results:
    """Check that policies that drive by waypoints can use the camera."""
    if plan.pitch_deg is None or plan.fovy_deg is None:
        yield (
            "unknown",
            "pitch_deg and fovy_deg are not stated, which policies with waypoints need: "
            "`shapechanger robot camera` measures them.",
        )
    else:
        yield (
            "good",
            f"It looks {plan.pitch_deg:g} degrees down and sees {plan.fovy_deg:g} degrees from top "
            "to bottom; `shapechanger robot camera` draws it.",
        )


def boot_rates(config: Path) -> list[int]:
    """Return the speeds of the I2C bus that a config.txt sets, bits per second; the last counts."""
    return [int(rate) for rate in _BAUD.findall("\n".join(boot_lines(config)))]


def _bus_speed(config: Path | None) -> Results:
    """Check that the I2C bus is fast enough to read the encoders in each tick of the guard."""
    if config is None:
        yield (
            "unknown",
            f"The bus should have {FAST_HZ} bits per second, which cannot be read here.",
        )
        return
    rates = boot_rates(config)
    if rates and rates[-1] >= FAST_HZ:
        yield "good", f"{config} sets {rates[-1]} bits per second."
    else:
        yield (
            "missing",
            f"Four encoders take 3 of every 10 ms at the default of 100000 bits per second: add "
            f"`dtparam=i2c_arm_baudrate={FAST_HZ}` to {config} and restart the computer.",
        )


def _has_bus(bus: int, root: Path) -> bool:
    """Return whether this user may open an I2C bus."""
    return os.access(root / f"dev/i2c-{bus}", os.R_OK | os.W_OK)


def _encoders(plans: Sequence[SensorPlan], root: Path, hardware: Hardware) -> Results:
    """Check the encoders at the joints, where their bus can be opened."""
    from shapechanger.robot.drivers.as5600 import connect_encoders

    for plan in plans:
        if not _has_bus(plan.settings["bus"], root):
            continue
        try:
            sensor = connect_encoders(plan, hardware)
        except RobotError as error:
            yield "missing", str(error)
            continue
        try:
            for encoder in sensor.encoders:
                yield _encoder(sensor, encoder)
        finally:
            sensor.close()


def _encoder(sensor: As5600, encoder: JointEncoder) -> tuple[Level, str]:
    joint = encoder.joint
    try:
        measured = sensor.measure(encoder)
    except RobotError as error:
        return "missing", str(error)
    if not measured.detects_magnet:
        return "missing", f"The encoder of {joint} detects no magnet: fit one above the chip."
    if measured.too_weak or measured.too_strong:
        where = "far from" if measured.too_weak else "near to"
        return "missing", f"The magnet of {joint} is too {where} its encoder."
    return "good", f"The encoder of {joint} detects its magnet."


def _port(port: int) -> tuple[bool, str]:
    """Return whether a port is free, and a sentence about it."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError as error:
            reason = f"Port {port} cannot be used ({error.strerror})."
            return False, f"{reason} Is the robot served already?"
    return True, f"Port {port} is free."
