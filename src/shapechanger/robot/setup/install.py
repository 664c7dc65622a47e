"""Install a robot on a Raspberry Pi: its service, its user's groups and its interfaces.

Every change is checked before it is made, so that a second run has no effect, and again afterwards,
to report commands without an effect. One function, which tests replace, runs commands as root.
"""

from __future__ import annotations

import getpass
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal, NamedTuple

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError, translate_errors
from shapechanger.files import cannot_write, write_new
from shapechanger.robot.drivers.servos.settings import DRIVER
from shapechanger.robot.profile.profile import Profile

_FAST_HZ: Final = 400_000  # Speed of the I2C bus that encoders at joints need, bits per second.
_ARM_BUS: Final = 1  # The I2C bus of the header's pins 3 and 5.
_UARTS: Final = ("serial", "ttyAMA", "ttyS")  # Names of the header's serial ports begin so.
_UNITS: Final = "etc/systemd/system"
_WANTED: Final = f"{_UNITS}/multi-user.target.wants"
_UDEV: Final = "etc/udev/rules.d/99-shapechanger-latency.rules"
_LATENCY: Final = (
    'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"\n'
)
_MODULES: Final = "etc/modules-load.d/i2c-dev.conf"
# Overlays of Raspberry Pi cameras, needed if a camera is not detected.
_CAMERAS: Final = ("dtoverlay.imx", "dtoverlay.ov5647", "dtoverlay.ov9281")


def _text(path: Path | None) -> str:
    """Return the content of a file; "" if it does not exist."""
    return path.read_text(encoding="utf-8", errors="replace") if path and path.exists() else ""


def needs_pins(guard: GuardPlan) -> bool:
    """Return True if a robot's outputs or enable line need its computer's own pins."""
    return guard.enable_pin is not None or any(
        output.driver in {"hbridge", "phase_enable"}
        or output.settings.get("over") == "lgpio"
        or output.settings.get("output_enable", -1) >= 0
        for output in guard.outputs
    )


def device_groups(guard: GuardPlan) -> dict[str, str]:
    """Return the group that may open each device file of a robot's outputs and sensors."""
    groups: dict[str, str] = {}
    if needs_pins(guard):
        groups["/dev/gpiochip0"] = "gpio"
    for plan in (*guard.outputs, *guard.sensors):
        if "bus" in plan.settings and plan.settings.get("over", "pca9685") == "pca9685":
            groups[f"/dev/i2c-{plan.settings['bus']}"] = "i2c"
    return groups | dict.fromkeys(servo_devices(guard), "dialout")


def servo_devices(guard: GuardPlan) -> list[str]:
    """Return the serial ports of a robot's servos."""
    return sorted({one.settings["device"] for one in guard.outputs if one.driver == DRIVER})


def unit_name(robot: str) -> str:
    """Return the name of a robot's systemd unit; one computer may serve several robots."""
    return f"shapechanger-{re.sub(r'[^A-Za-z0-9_.-]', '-', robot)}.service"


def unit_word(text: str) -> str:
    """Return a word of a command line, in quotes if it needs them (systemd.service(5))."""
    if re.fullmatch(r"[A-Za-z0-9_./+:@,=-]+", text):
        return text
    escapes = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "%": "%%", "$": "$$"}
    return f'"{text.translate(str.maketrans(escapes))}"'


def write_unit(
    robot: str, profile: Path, credentials: Path | None = None, user: str = ""
) -> tuple[Path, bool]:
    """Write the unit next to a profile unless it exists; return its path and whether it is new.

    The profile need not exist yet. The service runs as `user`, by default the current one, who must
    be a member of the groups of the robot's devices.
    """
    path = profile.absolute().parent / unit_name(robot)
    options = f" --credentials {unit_word(str(credentials.absolute()))}" if credentials else ""
    values = {
        "UNIT": path.stem,
        "ROBOT": path.stem.removeprefix("shapechanger-"),
        "PROFILE": unit_word(str(profile.absolute())),
        "PYTHON": unit_word(sys.executable),
        "PROGRAM": unit_word(shutil.which("shapechanger") or f"{sys.prefix}/bin/shapechanger"),
        "USER": user or getpass.getuser(),
        "OPTIONS": options,
    }
    template = (Path(__file__).parent / "robot.service").read_text(encoding="utf-8")
    # In one pass, because a path may contain the text of another placeholder.
    text = re.sub("@([A-Z]+)@", lambda match: values[match[1]], template)
    with translate_errors(OSError, to=partial(cannot_write, path)), suppress(FileExistsError):
        write_new(path, text.encode())
        return path, True
    return path, False


class RootCommand(NamedTuple):
    """A command that needs root, with its input."""

    arguments: tuple[str, ...]
    text: str = ""

    def __str__(self) -> str:
        """Return the command for a shell."""
        typed = f"sudo {shlex.join(self.arguments)}"
        quoted = shlex.quote(self.text.replace("\\", "\\\\").replace("\n", "\\n"))
        return f"printf '%b' {quoted} | {typed}" if self.text else typed


def run_as_root(command: RootCommand) -> str:
    """Run a command with sudo, which may ask for a password at the terminal; see `Machine.run`."""
    arguments = command.arguments if os.geteuid() == 0 else ("sudo", *command.arguments)
    try:
        done = subprocess.run(
            arguments, input=command.text, capture_output=True, text=True, check=False
        )
    except OSError as error:
        return f"{arguments[0]}: {error.strerror or error}"
    if done.returncode == 0:
        return ""
    lines = (done.stderr or done.stdout).strip().splitlines()
    return lines[-1] if lines else f"{arguments[0]} exited with {done.returncode}"


def _root(command: str, *more: object, text: str = "") -> RootCommand:
    """Return a command: the words of `command`, `more` arguments unsplit, and `text` as input."""
    return RootCommand((*command.split(), *map(str, more)), text)


@dataclass(frozen=True, slots=True)
class Machine:
    """The computer of a robot."""

    user: str = ""  # User that is to run the robot.
    root: Path = Path("/")  # Root of the file system.
    # Runs a command as root, and returns why it failed; empty if it did not.
    run: Callable[[RootCommand], str] = run_as_root

    @property
    def model(self) -> str:
        """Model of a Raspberry Pi; "" for another machine."""
        return _text(self.root / "proc/device-tree/model").strip("\0\n ")

    @property
    def config(self) -> Path | None:
        """Path of config.txt, which a Raspberry Pi has; None on other machines."""
        paths = [self.root / name for name in ("boot/firmware/config.txt", "boot/config.txt")]
        return next((path for path in paths if path.exists()), None)

    def settings(self) -> dict[str, str]:
        """Return the settings in config.txt that apply to every model, not only to some.

        Parameters of the device tree have keys such as "dtparam.i2c", and the value "on" if the
        line gives none; overlays have keys such as "dtoverlay.imx219".
        """
        found: dict[str, str] = {}
        section = "all"
        for line in _text(self.config).splitlines():
            if match := re.match(r"\s*\[([^\]]*)\]", line):
                section = match[1]
            elif section == "all":
                key, _, values = "".join(line.partition("#")[0].split()).partition("=")
                for value in values.split(",") if key in {"dtparam", "dtoverlay"} else ():
                    # The bus of the header has two names.
                    name, _, given = value.replace("i2c_arm", "i2c").partition("=")
                    found[f"{key}.{name}"] = given or "on"
                found[key] = values
        return found

    def sets(self, parameter: str) -> bool:
        """Return whether config.txt enables a parameter of the device tree, such as "i2c"."""
        return self.settings().get(f"dtparam.{parameter}") in {"on", "1", "true", "yes"}

    def require_systemd(self) -> None:
        """Refuse a machine that systemd does not manage (sd_booted(3))."""
        if not (self.root / "run/systemd/system").is_dir():
            raise RobotError(
                "This machine is not run by systemd, which starts a robot and makes its pins safe: "
                "installing needs Raspberry Pi OS; `shapechanger robot serve` runs it by hand."
            )

    def require_pi(self) -> None:
        """Refuse a machine that is not a Raspberry Pi with systemd."""
        self.require_systemd()
        if "Raspberry Pi" not in self.model:
            raise RobotError(
                "This machine is not a Raspberry Pi: installing needs one with Raspberry Pi OS; "
                "`shapechanger robot serve --twin` runs the robot on simulated pins here."
            )


@dataclass(frozen=True, slots=True)
class SystemChange:
    """A change of the machine."""

    name: str  # Such as "group i2c".
    state: str  # Sentence that is true once it is made.
    is_made: Callable[[], bool]
    commands: tuple[RootCommand, ...] = ()  # Empty if it has to be made by hand.
    instead: str = ""  # Instruction for a person if there are no commands.
    restarts: bool = False  # Whether it takes effect only when the computer restarts.


def make_changes(
    changes: Iterable[SystemChange], run: Callable[[RootCommand], str], *, dry: bool = False
) -> Iterator[tuple[SystemChange, Literal["did", "already", "would", "FAILED"], str]]:
    """Make each change that is not made yet, in order; if `dry`, only report the commands.

    Yield each change with its level and a sentence. Commands run as root by `run`; see
    `Machine.run`. A generator of changes is resumed after each change, so it can check the effects.
    """
    for change in changes:
        typed = " && ".join(map(str, change.commands))
        if change.is_made():
            yield change, "already", change.state
        elif not change.commands:
            yield change, "FAILED", change.instead
        elif dry:
            yield change, "would", typed
        else:
            why = next((why for command in change.commands if (why := run(command))), "")
            if not why and not change.is_made():
                why = "the command had no effect"
            sentence = f"{why}. By hand: {typed}" if why else change.state
            yield change, "FAILED" if why else "did", sentence


def changes_to_remove(unit_name: str, root: Path) -> Iterator[SystemChange]:
    """Yield the changes that remove a robot's service; groups and interfaces are kept."""
    path = root / _UNITS / unit_name
    yield SystemChange(
        "service",
        f"{path} does not exist, and the robot does not start with the computer.",
        lambda: not path.exists() and not os.path.lexists(root / _WANTED / unit_name),
        (
            _root("systemctl disable --now", unit_name),
            _root("rm -f", path),
            _root("systemctl daemon-reload"),
        ),
    )


def changes_to_install(profile: Profile, unit: Path, machine: Machine) -> Iterator[SystemChange]:
    """Yield the changes that install a robot whose systemd unit is next to its profile.

    Each change is planned after the previous ones have been made.
    """
    groups = {*device_groups(profile).values(), *(["video"] if profile.camera else [])}
    yield from (_group(group, machine) for group in sorted(groups))
    yield from settings_of_computer(profile, machine)
    path, wanted = machine.root / _UNITS / unit.name, machine.root / _WANTED / unit.name
    yield SystemChange(
        "service",
        f"{path} is a copy of the unit next to the profile, and starts the robot without arming.",
        lambda: os.path.lexists(wanted) and _text(path) == _text(unit),
        (
            _root("install -m 644", unit, path),
            _root("systemctl daemon-reload"),
            _root("systemctl enable", unit.name),
        ),
    )


def has_ribbon(profile: Profile) -> bool:
    """Return whether a robot's camera is on the ribbon cable of its Raspberry Pi."""
    return profile.camera is not None and profile.camera.driver == "picamera2"


def _group(group: str, machine: Machine) -> SystemChange:
    def members() -> list[str] | None:
        line = re.search(rf"^{group}:.*:(.*)$", _text(machine.root / "etc/group"), re.MULTILINE)
        return line and line[1].split(",")

    return SystemChange(
        f"group {group}",
        f"{machine.user} is in the group {group}.",
        lambda: machine.user in (members() or ()),
        () if members() is None else (_root("usermod -aG", group, machine.user),),
        f"This machine has no group {group}; Raspberry Pi OS has one.",
        restarts=True,
    )


def settings_of_computer(profile: Profile, machine: Machine) -> Iterator[SystemChange]:
    """Yield the settings of the computer that a robot needs, for any user."""

    def line(
        name: str, state: str, text: str, is_made: Callable[[], bool], *more: RootCommand
    ) -> SystemChange:
        # After a filter, such as [pi4], the line would apply to one model only.
        added = _root("tee -a", machine.config, text=f"\n[all]\n{text}\n")
        otherwise = f"There is no config.txt of Raspberry Pi OS here; it would need {text}."
        commands = (added, *more) if machine.config else ()
        return SystemChange(name, state, is_made, commands, otherwise, restarts=True)

    if needs_pins(profile):
        state = "The pins of a process become inputs when it dies, so pull-downs make them low."
        is_strict = partial(machine.sets, "strict_gpiod")
        yield line("strict_gpiod", state, "dtparam=strict_gpiod", is_strict)
    for device in (name for name, group in device_groups(profile).items() if group == "i2c"):
        bus = int(device.rpartition("-")[2])
        state = f"I2C bus {bus} is on."
        if bus == _ARM_BUS:
            module = _root("tee", machine.root / _MODULES, text="i2c-dev\n")
            is_on = partial(machine.sets, "i2c")
            yield line("I2C", state, "dtparam=i2c_arm=on", is_on, module)
        else:
            exists = (machine.root / device.lstrip("/")).exists
            reason = f"Bus {bus} needs an overlay for its pins, such as dtoverlay=i2c{bus}."
            yield SystemChange(f"I2C bus {bus}", state, exists, instead=reason)
    if any(sensor.driver == "as5600" for sensor in profile.sensors):
        state, text = f"I2C bus 1 has {_FAST_HZ} bits/s or more.", f"i2c_arm_baudrate={_FAST_HZ}"

        def is_fast() -> bool:
            speed = machine.settings().get("dtparam.i2c_baudrate", "")
            return speed.isdecimal() and int(speed) >= _FAST_HZ

        yield line("I2C speed", state, f"dtparam={text}", is_fast)
    if has_ribbon(profile):
        state = "The camera on the ribbon cable is detected, or named by its overlay."

        def finds_camera() -> bool:
            found = machine.settings()
            is_auto = found.get("camera_auto_detect") == "1"
            return is_auto or any(key.startswith(_CAMERAS) for key in found)

        yield line("camera detection", state, "camera_auto_detect=1", finds_camera)
        package = machine.root / "usr/lib/python3/dist-packages/picamera2"
        install = _root("apt-get install -y python3-picamera2")
        state = "python3-picamera2 is installed."
        yield SystemChange("picamera2", state, package.is_dir, (install,))
    rule = machine.root / _UDEV
    for device in servo_devices(profile):
        if Path(device).name.startswith(_UARTS):
            yield _serial_port(device, machine)
        else:
            yield SystemChange(
                "latency timer",
                "USB adapters deliver answers within 1 ms, once they are plugged in again.",
                lambda: _text(rule) == _LATENCY,
                (_root("tee", rule, text=_LATENCY), _root("udevadm control --reload")),
            )


def _serial_port(device: str, machine: Machine) -> SystemChange:
    lines = machine.config and machine.config.with_name("cmdline.txt")

    def is_made() -> bool:
        is_on = machine.settings().get("enable_uart") == "1" or machine.sets("uart0")
        return is_on and bool(lines) and "console=serial0" not in _text(lines)

    calls = "do_serial_hw 0", "do_serial_cons 1"
    commands = tuple(_root(f"raspi-config nonint {call}") for call in calls)
    return SystemChange(
        "serial port",
        f"{device} is on, and no console uses it.",
        is_made,
        commands if (machine.root / "usr/bin/raspi-config").exists() else (),
        "Add enable_uart=1 to config.txt, and remove console=serial0,115200 from cmdline.txt.",
        restarts=True,
    )
