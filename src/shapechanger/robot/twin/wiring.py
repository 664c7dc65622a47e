"""Wiring of a twin: from the levels of pins and pulses to the value of each output.

This inverts what the drivers do. It follows the plan of the real wiring, which by default is the
served plan: with two pins swapped only in the served profile, the wrong motor turns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.duty import Duty
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, driven_pins
from shapechanger.robot.twin.signals import Levels, Pulse, PwmChannel

ONE_SHOT_MS: Final = 100.0
"""Time for which the one-shot of the enable line keeps the motors' power on after an edge."""

_ESC_DEAD_BAND_US: Final = 20.0
"""Dead band of a speed controller on each side of neutral; makers state 10 to 50."""


class WiredOutput(NamedTuple):
    """State of an output.

    Attributes:
        value: Value from -1 to 1, as its driver takes it; None for a servo or speed controller
            without pulses or power.
        at_rest: Whether it is in the state after a stop; a motor with any duty above 0 is not.
    """

    value: float | None
    at_rest: bool


# Outputs whose power goes through the one-shot: motors, not steering servos or joints.
_UNPOWERED: Final = {
    "hbridge": WiredOutput(0.0, True),
    "phase_enable": WiredOutput(0.0, True),
    "esc": WiredOutput(None, True),
}


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
        enables = (_output_enable(output) for output in plan.outputs)
        self._high = {pin for pin in enables if pin >= 0}
        self._low = driven_pins(plan).keys()
        self._actions = {action.name: action for action in plan.actions}
        self._states = {output.name: self._state(output) for output in plan.outputs}
        self.outputs: Mapping[str, OutputPlan] = {output.name: output for output in plan.outputs}
        self.propelling = tuple(name for name in self.outputs if self._propels(name))

    def idle_level(self, pin: int) -> int:
        """Return the level of an undriven pin.

        The hardware guide asks for pull-downs on all outputs, and for a pull-up on the output
        enable of a PCA9685, which is active low.
        """
        return int(pin in self._high)

    def has_resistor(self, pin: int) -> bool:
        """Return whether a resistor outside decides the level of an undriven pin."""
        return pin in self._high or pin in self._low

    def power_ends_ns(self, levels: Levels) -> int | None:
        """Return when the one-shot cuts the motors' power, ns; None without a one-shot."""
        if self._one_shot_ns is None or self.plan.enable_pin is None:
            return None
        edge_ns = levels.edges_ns.get(self.plan.enable_pin)
        return 0 if edge_ns is None else edge_ns + self._one_shot_ns

    def read(self, levels: Levels, now_ns: int) -> dict[str, WiredOutput]:
        """Return the state of each output, by name.

        Args:
            levels: Levels of all pins.
            now_ns: Time, ns, by which the one-shot may have cut the power.
        """
        ends_ns = self.power_ends_ns(levels)
        powered = ends_ns is None or now_ns < ends_ns
        return {
            name: state(levels)
            if powered or self.outputs[name].driver not in _UNPOWERED
            else _UNPOWERED[self.outputs[name].driver]
            for name, state in self._states.items()
        }

    def _propels(self, name: str) -> bool:
        weights = self.outputs[name].mix.items()
        return any(w and one in self._actions and self._actions[one].propels for one, w in weights)

    def _state(self, plan: OutputPlan) -> Callable[[Levels], WiredOutput]:
        """Return what reads the state of an output, apart from the motors' power."""
        known = ((self._actions[n].rest, w) for n, w in plan.mix.items() if n in self._actions)
        rest = max(-1.0, min(1.0, plan.offset + sum(weight * value for value, weight in known)))
        match plan.driver:
            case "hbridge":
                return self._hbridge(plan, rest)
            case "phase_enable":
                return self._phase_enable(plan, rest)
            case "servo":
                return _servo(plan, rest, self._pulse(plan))
            case "esc":
                return _esc(plan, self._pulse(plan))
            case "bus_servo":  # On a bus: no level of a pin determines its state.
                return lambda levels: WiredOutput(None, True)
            case driver:
                raise RobotError(f"The twin does not support the output driver {driver!r}.")

    def _hbridge(self, plan: OutputPlan, rest: float) -> Callable[[Levels], WiredOutput]:
        keys = ("forward", "backward", "enable")
        forward, backward, enable = (plan.settings[key] for key in keys)
        duty = _duty_of(plan)

        def state(levels: Levels) -> WiredOutput:
            drive = self._duty(levels, forward) - self._duty(levels, backward)
            return _motor(duty, drive * (self._duty(levels, enable) if enable >= 0 else 1), rest)

        return state

    def _phase_enable(self, plan: OutputPlan, rest: float) -> Callable[[Levels], WiredOutput]:
        enable, phase = (plan.settings[key] for key in ("enable", "phase"))
        duty = _duty_of(plan)

        def state(levels: Levels) -> WiredOutput:
            # A phase that is high part of the time turns the motor back and forth.
            direction = 1.0 - 2.0 * self._duty(levels, phase)
            return _motor(duty, self._duty(levels, enable) * direction, rest)

        return state

    def _pulse(self, plan: OutputPlan) -> Callable[[Levels], float]:
        settings = plan.settings
        match settings["over"]:
            case "lgpio":
                pin = settings["pin"]
                return lambda levels: levels.pulses.get(pin, Pulse(0.0, 0.0)).us
            case "pca9685":
                enable = _output_enable(plan)
                channel = PwmChannel(*(settings[key] for key in ("bus", "address", "channel")))

                def pulse_us(levels: Levels) -> float:
                    if enable >= 0 and self._duty(levels, enable) > 0.0:
                        return 0.0
                    return levels.channels.get(channel, Pulse(0.0, 0.0)).us

                return pulse_us
            case over:
                raise RobotError(
                    f"Output {plan.name!r}: the twin has no servos over {over!r}; "
                    "it has them over 'pca9685' and 'lgpio'."
                )

    def _duty(self, levels: Levels, pin: int) -> float:
        duty = levels.duties.get(pin)
        return float(self.idle_level(pin)) if duty is None else duty


def _duty_of(plan: OutputPlan) -> Duty:
    return Duty(plan.settings["start"], plan.settings["full"])


def _motor(duty: Duty, drive: float, rest: float) -> WiredOutput:
    value = math.copysign(duty.size_at(abs(drive)), drive)
    return WiredOutput(value, _near(value, rest, 0.01 if rest else 0.0))


def _servo(
    plan: OutputPlan, rest: float, pulse_us: Callable[[Levels], float]
) -> Callable[[Levels], WiredOutput]:
    low, middle, high = _points(plan, "left_us", "centre_us", "right_us")

    def state(levels: Levels) -> WiredOutput:
        if not (us := pulse_us(levels)):
            return WiredOutput(None, True)
        value = _between(us, low, middle, high)
        return WiredOutput(value, _near(value, rest, _ESC_DEAD_BAND_US / abs(high - middle)))

    return state


def _esc(plan: OutputPlan, pulse_us: Callable[[Levels], float]) -> Callable[[Levels], WiredOutput]:
    low, middle, high = _points(plan, "backward_us", "neutral_us", "forward_us")

    def state(levels: Levels) -> WiredOutput:
        us = pulse_us(levels)
        if not us:
            return WiredOutput(None, True)
        if abs(us - middle) <= _ESC_DEAD_BAND_US:
            return WiredOutput(0.0, True)
        return WiredOutput(_between(us, low, middle, high), False)

    return state


def _output_enable(plan: OutputPlan) -> int:
    pin = plan.settings.get("output_enable", -1)
    return pin if isinstance(pin, int) and plan.settings.get("over") == "pca9685" else -1


def _points(plan: OutputPlan, *keys: str) -> tuple[float, ...]:
    return tuple(plan.settings[key] for key in keys)


def _between(us: float, low: float, middle: float, high: float) -> float:
    """Return the value of a pulse: -1 at `low`, 0 at `middle`, 1 at `high`; ends may be swapped."""
    end = high if (us - middle) * (high - middle) > 0 else low
    if end == middle:
        return 0.0
    value = (us - middle) / (end - middle) * (1.0 if end == high else -1.0)
    return max(-1.0, min(1.0, value))


def _near(value: float, rest: float, tolerance: float) -> bool:
    return abs(value - rest) <= tolerance
