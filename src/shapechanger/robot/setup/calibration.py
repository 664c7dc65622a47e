"""From what a person saw while an output was jogged to changes of its profile; pure."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final, Literal

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.pulse import PulseRange
from shapechanger.robot.guard.plan import OutputPlan

__all__ = [
    "PULSES",
    "JogResult",
    "motor_changes",
    "pulse_changes",
    "reading",
    "wheel_changes",
    "with_widest_pulses",
]

PULSES: Final = {
    "servo": ("left_us", "centre_us", "right_us"),
    "esc": ("backward_us", "neutral_us", "forward_us"),
}
"""The settings of each driver that are widths of pulses, at -1, 0 and 1."""

# A servo must not be driven against its stop while it is jogged: makers state 500 to 2500 us as the
# whole range that standard servos understand, and 900 to 2100 us as what most of them reach.
_NARROWEST_US: Final = 600
_WIDEST_US: Final = 2400


@dataclass(frozen=True, slots=True)
class JogResult:
    """What a person found by jogging a servo or a controller.

    Attributes:
        low: Value at which it was full left, or just not turning backward any further.
        middle: Value at which it was straight, or surely at rest.
        high: Value at which it was full right, or at its fastest.
    """

    low: float
    middle: float
    high: float


def with_widest_pulses(output: OutputPlan) -> OutputPlan:
    """The same output with the widest pulses there are, to jog in; its middle stays.

    Raises:
        RobotError: If it sends no pulses.
    """
    low, _, high = _keys(output)
    turned = _number(output, low) > _number(output, high)
    ends = (_WIDEST_US, _NARROWEST_US) if turned else (_NARROWEST_US, _WIDEST_US)
    settings = {**output.settings, low: ends[0], high: ends[1]}
    return dataclasses.replace(output, settings=settings)


def reading(output: OutputPlan, value: float) -> str:
    """What an output does at a value, in the unit of its settings, for people to read.

    Args:
        output: A servo, a controller or a motor.
        value: -1 to 1.
    """
    if output.driver in PULSES:
        pulses = PulseRange(*(_number(output, key) for key in _keys(output)))
        return f"{pulses.width_us(value):.0f} µs"
    return f"duty {abs(value) * _number(output, 'full'):.2f}"


def pulse_changes(output: OutputPlan, found: JogResult) -> dict[str, int]:
    """What to write for an output that was jogged, by dotted name; whole microseconds.

    Args:
        output: The output as it was while it was jogged.
        found: What was found.

    Raises:
        RobotError: If the middle does not lie between the ends.
    """
    keys = _keys(output)
    jogged = PulseRange(*(_number(output, key) for key in keys))
    widths = [round(jogged.width_us(v)) for v in (found.low, found.middle, found.high)]
    PulseRange(*map(float, widths))  # Says in words what cannot be.
    return {f"output.{output.name}.{key}": us for key, us in zip(keys, widths, strict=True)}


def motor_changes(
    output: OutputPlan, went: Literal["forward", "backward"], starts_at: float
) -> dict[str, Any]:
    """What to write for a motor, by dotted name.

    Args:
        output: The motor.
        went: Which way it went when it was told forward.
        starts_at: Duty at which it began to move, 0 to 1.

    Raises:
        RobotError: If the duty cannot be one.
    """
    full = _number(output, "full")
    if not 0.0 <= starts_at < full:
        raise RobotError(
            f"{output.name} cannot start at a duty of {starts_at:g}: its full duty is {full:g}."
        )
    changes: dict[str, Any] = {f"output.{output.name}.start": round(starts_at, 2)}
    if went == "backward":
        mix = {action: -weight for action, weight in output.mix.items()}
        changes[f"output.{output.name}.mix"] = mix
    return changes


def wheel_changes(
    sensor: str, wheel_m: float, pushed_m: float, measured_m: float
) -> dict[str, float]:
    """What to write for an encoder after the robot was pushed a known way.

    Args:
        sensor: Name of the encoder.
        wheel_m: Way of one turn as it is in the profile, m.
        pushed_m: How far it was pushed, m.
        measured_m: How far it went by the encoder, m; backward counts down.

    Raises:
        RobotError: If the encoder counted nothing, or backward.
    """
    if measured_m <= 0.0:
        raise RobotError(
            f"{sensor} counted {measured_m:g} m for {pushed_m:g} m forward: look at its wires, and "
            "swap its pins `a` and `b` if it counts backward."
        )
    return {f"sensor.{sensor}.wheel_m": round(wheel_m * pushed_m / measured_m, 4)}


def _keys(output: OutputPlan) -> tuple[str, str, str]:
    if output.driver not in PULSES:
        raise RobotError(f"{output.name} is a {output.driver}, which sends no pulses.")
    return PULSES[output.driver]


def _number(output: OutputPlan, key: str) -> float:
    value = output.settings[key]
    if isinstance(value, int | float):
        return float(value)
    raise RobotError(f"{key} of {output.name} is no number.")
