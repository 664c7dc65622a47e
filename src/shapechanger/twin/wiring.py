"""Wiring of a twin: from the levels of pins and pulses to the value of each output.

This inverts what the drivers do. It follows the plan of the real wiring, which by default is the
served plan: with two pins swapped only in the served profile, the wrong motor turns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.duty import Duty
from shapechanger.robot.drivers.settings import number, text, whole
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan
from shapechanger.twin.signals import Levels, Pulse, PwmChannel

__all__ = ["ESC_DEAD_BAND_US", "ONE_SHOT_MS", "TwinWiring", "WiredOutput"]

ONE_SHOT_MS: Final = 100.0
"""Time for which the one-shot of the enable line keeps the motors' power on after an edge."""

ESC_DEAD_BAND_US: Final = 20.0
"""Dead band of a speed controller on each side of neutral; makers state 10 to 50."""

# Outputs whose power goes through the one-shot: motors, not steering servos or joints.
_POWERED: Final = ("hbridge", "phase_enable", "esc")


class WiredOutput(NamedTuple):
    """State of an output.

    Attributes:
        value: Value from -1 to 1, as its driver takes it; None for a servo without pulses, which
            has no torque.
        at_rest: Whether it is in the state after a stop; a motor with any duty above 0 is not.
    """

    value: float | None
    at_rest: bool


@dataclass(frozen=True, slots=True)
class _Output:
    plan: OutputPlan
    rest: float
    propels: bool


class TwinWiring:
    """Wiring of a robot.

    Args:
        plan: The robot as it is wired.
        one_shot_ms: Hold time of the enable line's one-shot after each edge of `plan.enable_pin`,
            ms; None without one.

    Attributes:
        plan: The robot as it is wired.
        outputs: Plans of the outputs, by name.
        propelling: Names of the outputs that propel the robot.

    Raises:
        RobotError: If the twin does not support an output.
    """

    def __init__(self, plan: GuardPlan, one_shot_ms: float | None = ONE_SHOT_MS) -> None:
        self.plan = plan
        has_one_shot = plan.enable_pin is not None and one_shot_ms is not None
        self._one_shot_ns = int((one_shot_ms or 0.0) * 1e6) if has_one_shot else None
        actions = {action.name: action for action in plan.actions}
        self._outputs: dict[str, _Output] = {}
        self._high: set[int] = set()
        for output in plan.outputs:
            weights = {name: weight for name, weight in output.mix.items() if name in actions}
            rest = output.offset + sum(
                weight * actions[name].rest for name, weight in weights.items()
            )
            propels = any(weight and actions[name].propels for name, weight in weights.items())
            self._outputs[output.name] = _Output(output, max(-1.0, min(1.0, rest)), propels)
            if (pin := _output_enable(output)) >= 0:
                self._high.add(pin)
        self.outputs: Mapping[str, OutputPlan] = {
            name: output.plan for name, output in self._outputs.items()
        }
        self.propelling = tuple(name for name, output in self._outputs.items() if output.propels)
        self.read(Levels(), 0)  # Raises for outputs that the twin does not support.

    def idle_level(self, pin: int) -> int:
        """Return the level of an undriven pin.

        The hardware guide asks for pull-downs on all outputs, and for a pull-up on the output
        enable of a PCA9685, which is active low.
        """
        return int(pin in self._high)

    def power_ends_ns(self, levels: Levels) -> int | None:
        """Return when the one-shot cuts the motors' power, ns; None without a one-shot."""
        if self._one_shot_ns is None or self.plan.enable_pin is None:
            return None
        edge_ns = levels.edges_ns.get(self.plan.enable_pin)
        return 0 if edge_ns is None else edge_ns + self._one_shot_ns

    def read(self, levels: Levels, now_ns: int) -> dict[str, WiredOutput]:
        """Return the state of each output at a time."""
        ends_ns = self.power_ends_ns(levels)
        powered = ends_ns is None or now_ns < ends_ns
        read: dict[str, WiredOutput] = {}
        for name, output in self._outputs.items():
            if not powered and output.plan.driver in _POWERED:
                read[name] = WiredOutput(0.0, True)
            else:
                read[name] = self._read(output, levels)
        return read

    def has_pulses(self, name: str, levels: Levels, now_ns: int) -> bool:
        """Return whether a servo or speed controller has pulses and power."""
        ends_ns = self.power_ends_ns(levels)
        return (ends_ns is None or now_ns < ends_ns) and self._pulse(
            self._outputs[name], levels
        ) > 0.0

    def _read(self, output: _Output, levels: Levels) -> WiredOutput:
        settings = output.plan.settings
        match output.plan.driver:
            case "hbridge":
                enable = whole(settings, "enable")
                drive = self._duty(levels, whole(settings, "forward"))
                drive -= self._duty(levels, whole(settings, "backward"))
                return self._motor(
                    output, drive * (self._duty(levels, enable) if enable >= 0 else 1)
                )
            case "phase_enable":
                drive = self._duty(levels, whole(settings, "enable"))
                # A phase that is high part of the time turns the motor back and forth.
                direction = 1.0 - 2.0 * self._duty(levels, whole(settings, "phase"))
                return self._motor(output, drive * direction)
            case "servo":
                return self._servo(output, self._pulse(output, levels))
            case "esc":
                return self._esc(output, self._pulse(output, levels))
            case "dynamixel":  # On a bus: no level of a pin determines its state.
                return WiredOutput(None, True)
            case driver:
                raise RobotError(f"The twin does not support the output driver {driver!r}.")

    def _motor(self, output: _Output, drive: float) -> WiredOutput:
        duty = Duty(number(output.plan.settings, "start"), number(output.plan.settings, "full"))
        value = math.copysign(duty.size_at(abs(drive)), drive)
        return WiredOutput(value, _near(value, output.rest, 0.01 if output.rest else 0.0))

    def _servo(self, output: _Output, us: float) -> WiredOutput:
        if not us:
            return WiredOutput(None, True)
        low, middle, high = _points(output.plan, "left_us", "centre_us", "right_us")
        value = _between(us, low, middle, high)
        return WiredOutput(value, _near(value, output.rest, ESC_DEAD_BAND_US / abs(high - middle)))

    def _esc(self, output: _Output, us: float) -> WiredOutput:
        if not us:
            return WiredOutput(0.0, True)
        low, middle, high = _points(output.plan, "backward_us", "neutral_us", "forward_us")
        if abs(us - middle) <= ESC_DEAD_BAND_US:
            return WiredOutput(0.0, True)
        return WiredOutput(_between(us, low, middle, high), False)

    def _duty(self, levels: Levels, pin: int) -> float:
        duty = levels.duties.get(pin)
        return float(self.idle_level(pin)) if duty is None else duty

    def _pulse(self, output: _Output, levels: Levels) -> float:
        settings = output.plan.settings
        match text(settings, "over"):
            case "lgpio":
                return levels.pulses.get(whole(settings, "pin"), Pulse(0.0, 0.0)).us
            case "pca9685":
                enable = _output_enable(output.plan)
                if enable >= 0 and self._duty(levels, enable) > 0.0:
                    return 0.0
                channel = PwmChannel(
                    *(whole(settings, key) for key in ("bus", "address", "channel"))
                )
                return levels.channels.get(channel, Pulse(0.0, 0.0)).us
            case over:
                raise RobotError(
                    f"Output {output.plan.name!r}: the twin has no servos over {over!r}; "
                    "it has them over 'pca9685' and 'lgpio'."
                )


def _output_enable(plan: OutputPlan) -> int:
    pin = plan.settings.get("output_enable", -1)
    return pin if isinstance(pin, int) and plan.settings.get("over") == "pca9685" else -1


def _points(plan: OutputPlan, *keys: str) -> tuple[float, ...]:
    return tuple(number(plan.settings, key) for key in keys)


def _between(us: float, low: float, middle: float, high: float) -> float:
    """Return the value of a pulse: -1 at `low`, 0 at `middle`, 1 at `high`; ends may be swapped."""
    end = high if (us - middle) * (high - middle) > 0 else low
    if end == middle:
        return 0.0
    value = (us - middle) / (end - middle) * (1.0 if end == high else -1.0)
    return max(-1.0, min(1.0, value))


def _near(value: float, rest: float, tolerance: float) -> bool:
    return abs(value - rest) <= tolerance
