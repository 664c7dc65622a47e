"""Calibration: profile changes from a person's findings while jogging an output."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final, Literal

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import OUTPUTS
from shapechanger.robot.drivers.pulse import PulseRange

# A servo must not be driven against its stop while it is jogged. Makers state 500 to 2500 us as the
# full range of standard servos, and 900 to 2100 us as what most of them reach.
_NARROWEST_US: Final = 600
_WIDEST_US: Final = 2400


@dataclass(frozen=True, slots=True)
class JogResult:
    """Values that a person found by jogging a servo or a motor controller."""

    low: float
    middle: float
    high: float


def with_widest_pulses(output: OutputPlan) -> OutputPlan:
    """Return a servo or controller with the widest pulse range, for jogging; its middle stays."""
    low, _, high = OUTPUTS[output.driver].pulses
    turned = output.settings[low] > output.settings[high]
    ends = (_WIDEST_US, _NARROWEST_US) if turned else (_NARROWEST_US, _WIDEST_US)
    settings = {**output.settings, low: ends[0], high: ends[1]}
    return dataclasses.replace(output, settings=settings)


def reading(output: OutputPlan, value: float) -> str:
    """Describe an output at a value, in the unit of its settings.

    Args:
        output: A servo, a motor controller or a motor.
        value: -1 to 1.
    """
    if OUTPUTS[output.driver].pulses:
        return f"{PulseRange.of(output).width_us(value):.0f} µs"
    return f"duty {abs(value) * output.settings['full']:.2f}"


def pulse_changes(output: OutputPlan, found: JogResult) -> dict[str, int]:
    """Return the changes for a jogged output, whole microseconds by dotted name."""
    keys, jogged = OUTPUTS[output.driver].pulses, PulseRange.of(output)
    widths = [round(jogged.width_us(v)) for v in (found.low, found.middle, found.high)]
    PulseRange(*map(float, widths))  # Checks the order.
    return {f"output.{output.name}.{key}": us for key, us in zip(keys, widths, strict=True)}


def motor_changes(
    output: OutputPlan, went: Literal["forward", "backward"], starts_at: float
) -> dict[str, Any]:
    """Return the changes for a motor, by dotted name.

    Args:
        output: The motor.
        went: Direction in which it turned at a forward command.
        starts_at: Duty at which it began to turn, 0 to 1.
    """
    full: float = output.settings["full"]
    if not 0.0 <= starts_at < full:
        raise RobotError(
            f"{output.name} must start at a duty from 0 to below its full duty of {full:g}, got "
            f"{starts_at:g}."
        )
    changes: dict[str, Any] = {f"output.{output.name}.start": round(starts_at, 2)}
    if went == "backward":
        mix = {action: -weight for action, weight in output.mix.items()}
        changes[f"output.{output.name}.mix"] = mix
    return changes


def wheel_changes(
    sensor: str, wheel_m: float, pushed_m: float, measured_m: float
) -> dict[str, float]:
    """Return the changes for an encoder after the robot was pushed a known distance.

    Args:
        sensor: Name of the encoder.
        wheel_m: Distance of one turn in the profile, m.
        pushed_m: Distance that the robot was pushed, m.
        measured_m: Distance measured by the encoder, m; negative for backward.
    """
    if measured_m <= 0.0:
        raise RobotError(
            f"{sensor} measured {measured_m:g} m for {pushed_m:g} m forward: check its wires, and "
            "swap its pins `a` and `b` if it counts backward."
        )
    return {f"sensor.{sensor}.wheel_m": round(wheel_m * pushed_m / measured_m, 4)}
