"""Put a robot in place on a Raspberry Pi: its service, its user's groups and its interfaces.

Every change is checked first, so a second run changes nothing, and afterwards, so that a command
without an effect is reported. Commands run as root, by one function that tests replace.
"""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, NamedTuple

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.servos.settings import DRIVER
from shapechanger.robot.setup.computer import (
    FAST_HZ,
    boot_config,
    boot_lines,
    boot_rates,
    device_groups,
    needs_pins,
    sets_parameter,
)

_UNITS: Final = "etc/systemd/system"
_WANTED: Final = f"{_UNITS}/multi-user.target.wants"
_UDEV: Final = "etc/udev/rules.d/99-shapechanger-latency.rules"
_LATENCY: Final = (
    'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"\n'
)
_MODULES: Final = "etc/modules-load.d/i2c-dev.conf"
_ARM_BUS: Final = 1  # The I2C bus of the header's pins 3 and 5.
_UARTS: Final = ("serial", "ttyAMA", "ttyS")  # Serial ports of the header.


class RootCommand(NamedTuple):
    """A command that needs root."""

    arguments: tuple[str, ...]
    text: str = ""

    def __str__(self) -> str:
        """Return it as a person types it."""
        typed = f"sudo {shlex.join(self.arguments)}"
        return f"printf '%b' {_quoted(self.text)} | {typed}" if self.text else typed


def _quoted(text: str) -> str:
    return shlex.quote(text.replace("\\", "\\\\").replace("\n", "\\n"))


Runner = Callable[[RootCommand], str]
"""Runs a command as root, and returns why it failed; empty if it did not."""


def run_as_root(command: RootCommand) -> str:
    """Run a command with sudo, which may ask for a password at the terminal; see `Runner`."""
    arguments = command.arguments if os.geteuid() == 0 else ("sudo", *command.arguments)
    try:
        done = subprocess.run(
            arguments, input=command.text, capture_output=True, text=True, check=False
        )
    except OSError as error:
        return f"{arguments[0]}: {error.strerror or error}"
    words = (done.stderr or done.stdout).strip().splitlines()
    if done.returncode == 0:
        return ""
    return words[-1] if words else f"{arguments[0]} exited with {done.returncode}"


@dataclass(frozen=True, slots=True)
class Machine:
    """The computer on which a robot is put in place."""

    user: str
    root: Path = Path("/")
    run: Runner = run_as_root


@dataclass(frozen=True, slots=True)
class SystemChange:
    """A change of the machine.

    Attributes:
        name: What it is about, such as "group i2c".
        state: Sentence that is true once it is made.
        is_made: Whether it is made.
        commands: What makes it; empty if no command can.
        then: What has to follow, such as a restart of the computer.
        instead: What a person has to do if no command can.
    """

    name: str
    state: str
    is_made: Callable[[], bool]
    commands: tuple[RootCommand, ...] = ()
    then: Literal["", "restart", "log in"] = ""
    instead: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of one change."""

    change: SystemChange
    level: Literal["did", "already", "would", "failed"]
    sentence: str


def make_changes(
    changes: Iterable[SystemChange], run: Runner, *, dry: bool = False
) -> Iterator[Outcome]:
    """Make each change that is not made yet, in order.

    Args:
        changes: The changes; a generator sees the effect of those before.
        run: Runs commands as root.
        dry: Whether to say only what would be done.
    """
    for change in changes:
        typed = " && ".join(map(str, change.commands))
        if change.is_made():
            yield Outcome(change, "already", change.state)
        elif not change.commands:
            yield Outcome(change, "failed", change.instead)
        elif dry:
            yield Outcome(change, "would", typed)
        else:
            why = next((why for command in change.commands if (why := run(command))), "")
            if not why and not change.is_made():
                why = "the command had no effect"
            sentence = f"{why}. By hand: {typed}" if why else change.state
            yield Outcome(change, "failed" if why else "did", sentence)


def require_systemd(root: Path) -> None:
    """Refuse a machine that systemd does not manage (sd_booted(3))."""
    if not (root / "run/systemd/system").is_dir():
        raise RobotError(
            "This machine is not run by systemd, which starts a robot and makes its pins safe: "
            "installing needs Raspberry Pi OS; `shapechanger robot serve` runs it by hand."
        )


def require_pi(root: Path) -> None:
    """Refuse a machine that is not a Raspberry Pi with systemd."""
    require_systemd(root)
    model = root / "proc/device-tree/model"
    if not model.exists() or "Raspberry Pi" not in model.read_text(errors="replace"):
        raise RobotError(
            "This machine is not a Raspberry Pi: installing needs one with Raspberry Pi OS; "
            "`shapechanger robot serve --twin` runs the robot on simulated pins here."
        )


def changes_to_install(
    guard: GuardPlan, camera: CameraPlan | None, unit: Path, machine: Machine
) -> Iterator[SystemChange]:
    """Yield what puts a robot in place; each change is planned when those before are made.

    Args:
        guard: Outputs and sensors of the robot.
        camera: Its camera; None without one.
        unit: Its systemd unit, next to the profile.
        machine: The computer.
    """
    groups = {*device_groups(guard).values(), *(["video"] if camera is not None else [])}
    for group in sorted(groups):
        yield _group(group, machine)
    config = boot_config(machine.root)
    for change in _boot_changes(guard, camera, machine, config):
        yield change if config else _without_config(change)
    if camera is not None and camera.driver == "picamera2":
        package = machine.root / "usr/lib/python3/dist-packages/picamera2"
        install = RootCommand(("apt-get", "install", "-y", "python3-picamera2"))
        yield SystemChange(
            "picamera2", "python3-picamera2 is installed.", package.is_dir, (install,)
        )
    yield from _serial(guard, machine, config)
    yield _service(unit, machine.root)
    link = machine.root / _WANTED / unit.name
    yield SystemChange(
        "start",
        "The robot starts with the computer, not armed.",
        lambda: os.path.lexists(link),
        (RootCommand(("systemctl", "enable", unit.name)),),
    )


def changes_to_remove(unit_name: str, root: Path) -> Iterator[SystemChange]:
    """Yield what removes a robot's service; groups and interfaces stay."""
    path = root / _UNITS / unit_name
    yield SystemChange(
        "service",
        f"{path} does not exist, and the robot does not start with the computer.",
        lambda: not path.exists() and not os.path.lexists(root / _WANTED / unit_name),
        (
            RootCommand(("systemctl", "disable", "--now", unit_name)),
            RootCommand(("rm", "-f", str(path))),
            RootCommand(("systemctl", "daemon-reload")),
        ),
    )


def _service(unit: Path, root: Path) -> SystemChange:
    path = root / _UNITS / unit.name
    return SystemChange(
        "service",
        f"{path} is the unit next to the profile.",
        lambda: path.exists() and path.read_bytes() == unit.read_bytes(),
        (
            RootCommand(("install", "-m", "644", str(unit), str(path))),
            RootCommand(("systemctl", "daemon-reload")),
        ),
    )


def _group(group: str, machine: Machine) -> SystemChange:
    path = machine.root / "etc/group"

    def members() -> list[str] | None:
        for line in path.read_text(errors="replace").splitlines():
            name, *rest = line.split(":")
            if name == group:
                return rest[-1].split(",") if rest else []
        return None

    exists = path.exists() and members() is not None
    return SystemChange(
        f"group {group}",
        f"{machine.user} is in the group {group}.",
        lambda: path.exists() and machine.user in (members() or ()),
        (RootCommand(("usermod", "-aG", group, machine.user)),) if exists else (),
        then="log in",
        instead=f"There is no group {group} here, which Raspberry Pi OS has.",
    )


def _boot_changes(
    guard: GuardPlan, camera: CameraPlan | None, machine: Machine, config: Path | None
) -> Iterator[SystemChange]:
    """Yield the lines that config.txt needs."""

    def lines() -> list[str]:
        return boot_lines(config) if config else []

    def line(name: str, state: str, text: str, is_made: Callable[[], bool]) -> SystemChange:
        # After a filter, such as [pi4], the line would apply to one model only.
        added = RootCommand(("tee", "-a", str(config)), f"\n[all]\n{text}\n")
        return SystemChange(name, state, is_made, (added,), "restart", text)

    if needs_pins(guard):
        yield line(
            "strict_gpiod",
            "The pins of a process that dies go low.",
            "dtparam=strict_gpiod",
            lambda: sets_parameter(lines(), "strict_gpiod"),
        )
    devices = device_groups(guard)
    for device in (name for name, group in devices.items() if group == "i2c"):
        bus = int(device.rpartition("-")[2])
        state = f"I2C bus {bus} is on."
        if bus != _ARM_BUS:
            words = f"Bus {bus} needs an overlay that depends on its pins, as dtoverlay=i2c{bus}"
            node = machine.root / device.lstrip("/")
            yield SystemChange(f"I2C bus {bus}", state, node.exists, instead=f"{words}.")
            continue
        change = line(
            "I2C",
            state,
            "dtparam=i2c_arm=on",
            lambda: sets_parameter(lines(), "i2c_arm") or sets_parameter(lines(), "i2c"),
        )
        module = RootCommand(("tee", str(machine.root / _MODULES)), "i2c-dev\n")
        change = replace(change, commands=(*change.commands, module))
        yield _by_raspi_config(change, machine.root, ("do_i2c", "0"))
    if any(sensor.driver == "as5600" for sensor in guard.sensors):
        yield line(
            "I2C speed",
            f"The I2C bus has {FAST_HZ} bits per second.",
            f"dtparam=i2c_arm_baudrate={FAST_HZ}",
            lambda: config is not None and max(boot_rates(config)[-1:], default=0) >= FAST_HZ,
        )
    if camera is not None and camera.driver == "picamera2":
        yield line(
            "camera",
            "The camera on the ribbon cable is detected.",
            "camera_auto_detect=1",
            lambda: any(
                text.replace(" ", "").startswith(("camera_auto_detect=1", *_CAMERA_OVERLAYS))
                for text in lines()
            ),
        )


# Overlays of Raspberry Pi's cameras, for those that are not detected.
_CAMERA_OVERLAYS: Final = tuple(f"dtoverlay={chip}" for chip in ("imx", "ov5647", "ov9281"))


def _by_raspi_config(change: SystemChange, root: Path, call: tuple[str, str]) -> SystemChange:
    """Return a change made by raspi-config, if it exists: it supports all models."""
    if not (root / "usr/bin/raspi-config").exists():
        return change
    return replace(change, commands=(RootCommand(("raspi-config", "nonint", *call)),))


def _without_config(change: SystemChange) -> SystemChange:
    """Return a change that only a person can make, because there is no config.txt."""
    words = f"There is no config.txt of Raspberry Pi OS here; it would need {change.instead}."
    return replace(change, commands=(), instead=words)


def _serial(guard: GuardPlan, machine: Machine, config: Path | None) -> Iterator[SystemChange]:
    """Yield the changes for the port of a servo bus: the header's own, or a USB adapter's."""
    rule = machine.root / _UDEV
    cmdline = config.with_name("cmdline.txt") if config else None

    def is_on() -> bool:
        lines = boot_lines(config) if config else []
        return "enable_uart=1" in lines or sets_parameter(lines, "uart0")

    def has_console() -> bool:
        return cmdline is None or "console=serial0" in cmdline.read_text()

    devices = {o.settings["device"] for o in guard.outputs if o.driver == DRIVER}
    for device in sorted(devices):
        if not Path(device).name.startswith(_UARTS):
            yield SystemChange(
                "latency timer",
                "USB adapters that are plugged in from now on pass on answers within 1 ms.",
                lambda: rule.exists() and rule.read_text() == _LATENCY,
                (
                    RootCommand(("tee", str(rule)), _LATENCY),
                    RootCommand(("udevadm", "control", "--reload")),
                ),
            )
            continue
        port = SystemChange(
            "serial port",
            f"{device} is on.",
            is_on,
            then="restart",
            instead="Add enable_uart=1 to config.txt.",
        )
        console = SystemChange(
            "serial console",
            f"No console uses {device}.",
            lambda: not has_console(),
            then="restart",
            instead="Remove console=serial0,115200 from cmdline.txt.",
        )
        yield _by_raspi_config(port, machine.root, ("do_serial_hw", "0"))
        yield _by_raspi_config(console, machine.root, ("do_serial_cons", "1"))
