"""Drives every output of a robot to rest from outside the guard, when there is no guard any more.

A Raspberry Pi keeps the levels of pins whose process has died, and a servo controller its pulses.
"""

from __future__ import annotations

import contextlib
import importlib
from typing import Final

from shapechanger.robot.drivers.output import OUTPUT_DRIVERS, OutputDriver, open_output
from shapechanger.robot.guard.outputs import drives_first
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.switches import enable_device
from shapechanger.robot.hardware import REAL, Hardware

__all__ = ["make_safe", "preload"]

# Servos with a watchdog of their own let go when the bus is silent; whoever spoke to them now would
# only keep them awake.
_STOPS_ITSELF: Final = ("dynamixel",)


def make_safe(plan: GuardPlan, hardware: Hardware) -> list[str]:
    """Open every output, which is at rest then, and close it; one that fails keeps no other.

    Nobody else may have the outputs open.

    Returns:
        What failed, in words.
    """
    failures: list[str] = []
    opened: list[tuple[str, OutputDriver]] = []
    for output in drives_first(plan).outputs:
        if output.driver in _STOPS_ITSELF:
            continue
        try:
            opened.append((output.name, open_output(output, hardware)))
        except Exception as error:  # Whatever it is, the next output must be safe too.
            failures.append(f"Output {output.name}: {str(error) or type(error).__name__}")
    # Closed only when all are at rest: lgpio takes 100 ms for each handle that it closes.
    for name, driver in opened:
        try:
            driver.close()
        except Exception as error:  # As above.
            failures.append(f"Output {name}: {str(error) or type(error).__name__}")
    if plan.enable_pin is not None:
        try:
            enable_device(plan.enable_pin, hardware).close()
        except Exception as error:  # As above.
            failures.append(f"Enable pin {plan.enable_pin}: {str(error) or type(error).__name__}")
    return failures


def preload(plan: GuardPlan, source: str) -> None:
    """Load everything that `make_safe` needs, and open nothing: later there is no time for it.

    Args:
        plan: The robot.
        source: Where its hardware comes from.
    """
    modules = [source.partition(":")[0]]
    modules += [
        OUTPUT_DRIVERS[output.driver]
        for output in plan.outputs
        if output.driver not in _STOPS_ITSELF
    ]
    if plan.enable_pin is not None:
        modules.append("gpiozero")
    for module in modules:
        importlib.import_module(module)
    if source != REAL:
        return
    for library in ("shapechanger.robot.drivers.lgpio_pins", "gpiozero.pins.lgpio", "smbus2"):
        # `RealHardware` loads these when it needs them; a robot without pins has no lgpio.
        with contextlib.suppress(ImportError):
            importlib.import_module(library)
