"""Wiring of a twin: compute the value of each output from the levels of pins and pulses.

The chip of each output inverts its driver. The plan of the wiring is the served plan by default,
and may differ: if two pins are swapped only in the served profile, the wrong motor turns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from shapechanger.contract.plan import GuardPlan, OutputPlan, driven_pins
from shapechanger.robot.drivers.chip import OUTPUTS
from shapechanger.robot.drivers.simulation import Levels, WiredOutput

ONE_SHOT_MS: Final = 100.0
"""Time for which the one-shot of the enable line keeps the motors' power on after an edge."""


class TwinWiring:
    """Wiring of a robot.

    Args:
        plan: The robot as it is wired.
        one_shot_ms: Hold time of the enable line's one-shot after each edge of `plan.enable_pin`,
            ms; None without one.
    """

    def __init__(self, plan: GuardPlan, one_shot_ms: float | None = ONE_SHOT_MS) -> None:
        self.plan = plan
        has_one_shot = plan.enable_pin is not None and one_shot_ms is not None
        self._one_shot_ns = int((one_shot_ms or 0.0) * 1e6) if has_one_shot else None
        keys = (one.settings for one in plan.outputs if one.settings.get("over") == "pca9685")
        self._high = {one["output_enable"] for one in keys if one.get("output_enable", -1) >= 0}
        self._low = driven_pins(plan).keys()
        self._states = {output.name: self._state(output) for output in plan.outputs}
        self.outputs: Mapping[str, OutputPlan] = {output.name: output for output in plan.outputs}
        ahead = {action.name for action in plan.actions if action.propels}
        self.propelling = tuple(
            one.name for one in plan.outputs if any(one.mix.get(name) for name in ahead)
        )

    def idle_level(self, pin: int) -> int:
        """Return the level of an undriven pin.

        The hardware guide asks for pull-downs on all outputs, and for a pull-up on the output
        enable of a PCA9685, which is active low.
        """
        return int(pin in self._high)

    def has_resistor(self, pin: int) -> bool:
        """Return whether an external resistor sets the level of an undriven pin."""
        return pin in self._high or pin in self._low

    def power_ends_ns(self, levels: Levels) -> int | None:
        """Return when the one-shot cuts the motors' power, ns; None without a one-shot."""
        if self._one_shot_ns is None or self.plan.enable_pin is None:
            return None
        edge_ns = levels.edges_ns.get(self.plan.enable_pin)
        return 0 if edge_ns is None else edge_ns + self._one_shot_ns

    def has_power(self, levels: Levels, now_ns: int) -> bool:
        """Return whether the one-shot, if there is one, leaves the motors their power."""
        ends_ns = self.power_ends_ns(levels)
        return ends_ns is None or now_ns < ends_ns

    def read(self, levels: Levels, now_ns: int) -> dict[str, WiredOutput]:
        """Return the state of each output, keyed by name.

        Args:
            levels: Levels of all pins.
            now_ns: Time, ns, by which the one-shot may have cut the power.
        """
        powered = self.has_power(levels, now_ns)
        return {
            name: (None if powered else OUTPUTS[self.outputs[name].driver].unpowered)
            or state(levels)
            for name, state in self._states.items()
        }

    def _state(self, plan: OutputPlan) -> Callable[[Levels], WiredOutput]:
        """Return a function that reads the state of an output, ignoring the motors' power."""
        mixed = sum(one.rest * plan.mix.get(one.name, 0.0) for one in self.plan.actions)
        rest = max(-1.0, min(1.0, plan.offset + mixed))
        return OUTPUTS[plan.driver].wire(plan, rest, self._duty)

    def _duty(self, levels: Levels, pin: int) -> float:
        return levels.duties.get(pin, float(self.idle_level(pin)))
