"""Pins that a robot uses, and a test of two that it does not use."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path
from typing import Final

from shapechanger.contract.plan import GuardPlan, driven_pins
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.pins import BCM_OF_BOARD, HIGHEST_BCM
from shapechanger.robot.hardware import Hardware, RealHardware
from shapechanger.robot.setup.computer import needs_pins

_TOGGLES: Final = 50
_SETTLES_S: Final = 0.002


def pins_of(plan: GuardPlan) -> dict[int, str]:
    """Return the robot's pins and their uses.

    Args:
        plan: The robot.
    """
    used = driven_pins(plan)
    if plan.stop_pin is not None:
        used[plan.stop_pin] = "the emergency button"
    for device in (*plan.outputs, *plan.sensors):
        keys = ("output_enable", "a", "b", "trigger", "echo")
        pins = [*(device.settings.get(key, -1) for key in keys), *device.settings.get("pins", [])]
        used |= {pin: device.name for pin in pins if pin >= 0}
    return used


def plan_of_pins(plan: GuardPlan) -> list[str]:
    """Return a line for each pin of a robot, to compare with its wires.

    Args:
        plan: The robot.
    """
    positions = {pin: position for position, pin in BCM_OF_BOARD.items()}
    return [
        f"pin          GPIO{pin} ({positions[pin]}): {use}"
        for pin, use in sorted(pins_of(plan).items())
    ]


def require_free_pin(pin: int, plan: GuardPlan) -> None:
    """Refuse a pin that the header lacks, or that the robot uses.

    Args:
        pin: BCM number.
        plan: The robot.

    Raises:
        RobotError: If it is one of these.
    """
    if not 0 <= pin <= HIGHEST_BCM:
        raise RobotError(f"The header has the pins GPIO0 to GPIO{HIGHEST_BCM}, got {pin}.")
    if use := pins_of(plan).get(pin):
        raise RobotError(f"Pin {pin} is used by {use}: join a free pin.")


def probed_pin(plan: GuardPlan, probe: int) -> int:
    """Return the pin that a probe has to be joined to: the one of the motor that drives forward.

    Args:
        plan: The robot.
        probe: BCM pin of the probe.

    Raises:
        RobotError: If there is no such pin, the robot uses it, or nothing can be probed.
    """
    require_free_pin(probe, plan)
    for output in plan.outputs:
        weight = output.mix.get("throttle", 0.0)
        if weight and output.driver == "hbridge":
            return int(output.settings["forward" if weight > 0 else "backward"])
        if weight and output.driver == "phase_enable":
            return int(output.settings["enable"])
    raise RobotError("A probe needs a motor on an H-bridge: pulses of a servo go on at rest.")


def check_jumper(
    output: int, sensed: int, plan: GuardPlan, hardware: Hardware | None = None
) -> str:
    """Toggle an output and check the input that is wired to it.

    Args:
        output: BCM pin to drive, unused by the robot.
        sensed: BCM pin to read, unused by the robot.
        plan: The robot.
        hardware: Its pins; those of this machine by default.

    Returns:
        Description of the result.

    Raises:
        RobotError: If the robot uses a pin, or the input does not follow.
    """
    from gpiozero import DigitalInputDevice, DigitalOutputDevice

    for pin in (output, sensed):
        require_free_pin(pin, plan)
    if output == sensed:
        raise RobotError(f"A jumper joins two pins, got {output} twice.")
    with closing(hardware or RealHardware()) as pins:
        factory = pins.pin_factory()
        with (
            DigitalOutputDevice(output, pin_factory=factory) as driven,
            DigitalInputDevice(sensed, pull_up=False, pin_factory=factory) as read,
        ):
            for n in range(_TOGGLES):
                driven.value = n % 2
                time.sleep(_SETTLES_S)
                if read.value != n % 2:
                    raise RobotError(
                        f"Pin {sensed} does not follow pin {output}: is the wire between them?"
                    )
    return f"pin {sensed} followed pin {output} {_TOGGLES} times."


def require_pins(plan: GuardPlan, root: Path = Path("/")) -> None:
    """Refuse a machine without GPIO pins.

    Args:
        plan: The robot.
        root: Root of the file system, for tests.

    Raises:
        RobotError: If an output needs a pin and the machine has none.
    """
    if needs_pins(plan) and not any((root / "dev").glob("gpiochip*")):
        raise RobotError(
            f"{plan.name} is on pins, and this machine has none (no /dev/gpiochip0): "
            "`shapechanger robot serve --twin` runs it on simulated ones."
        )
