"""Reflexes on the robot's health: battery, temperature and failed sensors."""

from __future__ import annotations

from shapechanger.contract.limits import Persistence
from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.guard.sensors import Sensing

# Time for which a battery must be low or a CPU hot. A noisy reading, or the dip when a motor
# starts, must not stop the robot.
_BELIEVED_AFTER_S = 0.5


class RobotHealth:
    """Reasons to keep the whole robot at rest: failed sensors, low battery, high temperature.

    A battery recovers as soon as the load is gone, so a low battery latches until the robot is
    armed again.
    """

    def __init__(self, plan: GuardPlan) -> None:
        limits = plan.limits
        self._limits = limits
        needed = {
            "bump": True,
            "tendons": True,
            "joints": True,
            "distance": limits.stop_distance_m > 0.0,
            "battery": limits.low_battery_v > 0.0,
            "temperature": limits.high_temperature_c > 0.0,
        }
        self._protecting = tuple(s.name for s in plan.sensors if needed.get(s.measures, False))
        self._low = Persistence(_BELIEVED_AFTER_S)
        self._hot = Persistence(_BELIEVED_AFTER_S)
        self._is_low = False
        self._battery = ""
        self._others: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Return why nothing may move, or an empty string."""
        return " ".join(filter(None, (*self._others, self._battery)))

    def sense(self, sensing: Sensing, now_ns: int) -> None:
        """Update with a new sensing."""
        failing = [
            f"Sensor {name} fails, and can protect no longer: {sensing.failures[name]}"
            for name in self._protecting
            if name in sensing.failures and name not in sensing.slow
        ]
        # Even a sensor without a reflex: a slow one delays every stop.
        failing += [
            f"Sensor {name} holds up the robot: {sensing.failures[name]}"
            for name in sorted(sensing.slow)
        ]
        limits, quantities = self._limits, sensing.quantities
        volts = quantities.get("battery")
        is_low = limits.low_battery_v > 0.0 and volts is not None and volts < limits.low_battery_v
        self._is_low = self._low.holds(is_low, now_ns)
        if self._is_low:
            self._battery = f"The battery has {volts:.2f} V, less than {limits.low_battery_v:g} V."
        degrees = quantities.get("temperature")
        limit_c = limits.high_temperature_c
        if self._hot.holds(limit_c > 0.0 and degrees is not None and degrees > limit_c, now_ns):
            failing.append(f"The computer has {degrees:.0f} C, more than {limit_c:g} C.")
        self._others = tuple(failing)

    def rearm(self) -> None:
        """Clear the low-battery latch, unless the battery is still low."""
        if not self._is_low:
            self._battery = ""
