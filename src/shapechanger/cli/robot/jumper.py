"""Tries the pins themselves: an output and an input that are joined by a wire."""

from __future__ import annotations

import time
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.hardware import Hardware, RealHardware

__all__ = ["check_jumper"]

_TOGGLES: Final = 50
_SETTLES_S: Final = 0.002


def check_jumper(
    output: int, sensed: int, plan: GuardPlan, hardware: Hardware | None = None
) -> str:
    """Toggle an output and look at the input that is joined to it.

    Args:
        output: BCM pin to drive; none that the robot uses.
        sensed: BCM pin to read; none that the robot uses.
        plan: The robot.
        hardware: Its pins; this machine's if not given.

    Returns:
        What was seen, in words.

    Raises:
        RobotError: If the robot uses a pin, or the input does not follow.
    """
    from gpiozero import DigitalInputDevice, DigitalOutputDevice

    used = _pins(plan)
    for pin in (output, sensed):
        if pin in used:
            raise RobotError(f"Pin {pin} is used by {used[pin]}: join two free pins.")
    pins = hardware or RealHardware()
    try:
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
    finally:
        if hardware is None:
            pins.close()
    return f"pin {sensed} followed pin {output} {_TOGGLES} times."


def _pins(plan: GuardPlan) -> dict[int, str]:
    """Which pins the robot uses, and for what."""
    used: dict[int, str] = {}
    if plan.enable_pin is not None:
        used[plan.enable_pin] = "the enable line"
    if plan.stop_pin is not None:
        used[plan.stop_pin] = "the emergency button"
    keys = ("forward", "backward", "enable", "phase", "pin", "output_enable", "a", "b")
    for device in (*plan.outputs, *plan.sensors):
        for key in (*keys, "trigger", "echo"):
            pin = device.settings.get(key)
            if isinstance(pin, int) and pin >= 0:
                used[pin] = device.name
        pins = device.settings.get("pins")
        if isinstance(pins, list):
            used |= {int(pin): device.name for pin in pins}
    return used
