"""Reflexes: automatic reactions to bumps, stalls, battery, temperature and failed sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapechanger.robot.guard.limits import bump_blocks, bump_ends_ns, forward_actions
from shapechanger.robot.guard.plan import ActionPlan, GuardPlan
from shapechanger.robot.guard.sensors import Sensing


class Persistence:
    """Condition that counts once it has held for `for_s` seconds without interruption."""

    def __init__(self, for_s: float) -> None:
        self._for_ns = round(for_s * 1e9)
        self._since_ns: int | None = None

    def holds(self, condition: bool, now_ns: int) -> bool:
        """Update with the current condition and return whether it has held for long enough.

        Args:
            condition: Whether it holds now.
            now_ns: Robot's time, ns.
        """
        if not condition:
            self._since_ns = None
            return False
        if self._since_ns is None:
            self._since_ns = now_ns
        return now_ns - self._since_ns >= self._for_ns


_STANDS_M_PER_S = 0.01
"""Speed below which a robot stands still, m/s: one count per second of a coarse encoder."""

# Time for which a battery must be low or a CPU hot. A noisy reading, or the dip when a motor
# starts, must not stop the robot.
_BELIEVED_AFTER_S = 0.5


class Bump:
    """Block forward motion during a contact and for `hold_ms` after it.

    Attributes:
        count: Number of bumps.
        until_ns: When the robot may go forward again; None if it never bumped.
    """

    def __init__(self, hold_ms: int) -> None:
        self._hold_ms = hold_ms
        self._touches = False
        self.count = 0
        self.until_ns: int | None = None

    def sense(self, quantities: Mapping[str, float], now_ns: int) -> None:
        """Update with a new sensing.

        Args:
            quantities: Readings by name.
            now_ns: Robot's time, ns.
        """
        touches = quantities.get("bump", 0.0) > 0.0
        self.count += touches and not self._touches
        self.until_ns = bump_ends_ns(touches, now_ns, self.until_ns, self._hold_ms)
        self._touches = touches

    def blocks(self, now_ns: int) -> bool:
        """Return whether forward motion is blocked."""
        return bump_blocks(self._touches, now_ns, self.until_ns)


class Stall:
    """Detect a push without motion, and block further pushing.

    The block ends once the command asks for rest or for the other direction.

    Attributes:
        way: Sign of the push that stalled; 0 for none.
        watches: Whether a measured speed is available.

    Args:
        after_s: Longest push without motion, s; 0 to disable.
        threshold: Push above which motion is expected.
    """

    def __init__(self, after_s: float, threshold: float) -> None:
        self._after_s = after_s
        self._threshold = threshold
        self._forward = Persistence(after_s)
        self._backward = Persistence(after_s)
        self.way = 0
        self.watches = False

    def sense(self, quantities: Mapping[str, float], push: float, now_ns: int) -> None:
        """Update with a new sensing.

        Args:
            quantities: Readings by name.
            push: Applied push, -1 to 1.
            now_ns: Robot's time, ns.
        """
        self.watches = self._after_s > 0.0 and "speed" in quantities
        stands = self.watches and abs(quantities["speed"]) < _STANDS_M_PER_S
        if self._forward.holds(stands and push > self._threshold, now_ns):
            self.way = 1
        if self._backward.holds(stands and push < -self._threshold, now_ns):
            self.way = -1

    def ask(self, push: float) -> None:
        """Update with the push that the command asks for."""
        if self.way * push <= 0.0:
            self.way = 0


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
        """Update with a new sensing.

        Args:
            sensing: Readings of all sensors.
            now_ns: Robot's time, ns.
        """
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


class Propulsion:
    """Forward component of the actions; positive is forward.

    Attributes:
        forward: Which actions push the robot forward or backward, by index.
    """

    def __init__(self, actions: Sequence[ActionPlan]) -> None:
        self._actions = actions
        self.forward = forward_actions(actions)
        # Actions whose profile gives a speed.
        self._known = tuple(i for i in self.forward if actions[i].unit == "m/s")

    def push(self, values: Sequence[float]) -> float:
        """Return the forward push, -1 to 1; negative is backward."""
        if not self.forward:
            return 0.0
        return sum([values[i] - self._actions[i].rest for i in self.forward]) / len(self.forward)

    def speed(self, values: Sequence[float]) -> float | None:
        """Return the speed that the profile gives for this push, m/s; None if it gives none."""
        if not self._known:
            return None
        known = [(self._actions[i], values[i]) for i in self._known]
        return sum([a.gain * (value - a.rest) for a, value in known]) / len(known)
