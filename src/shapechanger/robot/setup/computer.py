"""The computer of a robot: its boot configuration, and the devices that the robot needs."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.drivers.servos.settings import DRIVER

FAST_HZ: Final = 400_000
"""Speed of the I2C bus that encoders at joints need, bits per second."""

_CONFIGS: Final = ("boot/firmware/config.txt", "boot/config.txt")
_SECTION: Final = re.compile(r"^\s*\[([^\]]*)\]")
_BAUD: Final = re.compile(r"^\s*dtparam\s*=\s*(?:[^#]*,)?i2c(?:_arm)?_baudrate=(\d+)", re.MULTILINE)


def boot_config(root: Path) -> Path | None:
    """Return the config.txt of a Raspberry Pi; None on other machines."""
    paths = [root / name for name in _CONFIGS]
    return next((path for path in paths if path.exists()), None)


def boot_lines(config: Path) -> list[str]:
    """Return the lines of a config.txt that apply to every model, without filtered ones."""
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


def boot_rates(config: Path) -> list[int]:
    """Return the speeds of the I2C bus that a config.txt sets, bits per second; the last counts."""
    return [int(rate) for rate in _BAUD.findall("\n".join(boot_lines(config)))]


def needs_pins(guard: GuardPlan) -> bool:
    """Return True if a robot needs its computer's own pins, to move or to stop."""
    return guard.enable_pin is not None or any(
        output.driver in {"hbridge", "phase_enable"} or output.settings.get("over") == "lgpio"
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
    for plan in guard.outputs:
        if plan.driver == DRIVER:
            groups[plan.settings["device"]] = "dialout"
    return groups
