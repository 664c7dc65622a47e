"""What the robot does without being told: reflexes on its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapechanger.robot.guard.plan import ActionPlan, GuardPlan
from shapechanger.robot.guard.sensors import Sensing

__all__ = [
    "STANDS_M_PER_S",
    "STEERING",
    "Bump",
    "Persistence",
    "Propulsion",
    "RobotHealth",
    "Stall",
]


class Persistence:
    """A condition that counts once it has held without a break.

    Args:
        for_s: How long it must hold, s.
    """

    def __init__(self, for_s: float) -> None:
        self._for_ns = round(for_s * 1e9)
        self._since_ns: int | None = None

    def holds(self, condition: bool, now_ns: int) -> bool:
        """Whether the condition, which is so now, has been so for long enough."""
        if not condition:
            self._since_ns = None
            return False
        if self._since_ns is None:
            self._since_ns = now_ns
        return now_ns - self._since_ns >= self._for_ns


STANDS_M_PER_S = 0.01
"""Speed below which a robot stands still, m/s; one count of a coarse wheel encoder a second."""

# How long a battery must be low, or a computer hot, before it is believed: one noisy reading, and
# the dip when a motor starts, must not stop the robot.
_BELIEVED_AFTER_S = 0.5


class Bump:
    """Keeps the robot from going forward while something is touched, and some time after.

    Attributes:
        count: How many bumps there were.

    Args:
        hold_ms: How long after.
    """

    def __init__(self, hold_ms: int) -> None:
        self._hold_ns = hold_ms * 1_000_000
        self._touches = False
        self.count = 0
        self.until_ns: int | None = None
        """When the robot may go forward again; None if it never bumped."""

    def sense(self, quantities: Mapping[str, float], now_ns: int) -> None:
        """Take in a sensing."""
        touches = quantities.get("bump", 0.0) > 0.0
        if touches:
            self.count += not self._touches
            self.until_ns = now_ns + self._hold_ns
        self._touches = touches

    def blocks(self, now_ns: int) -> bool:
        """Whether the robot must not go forward."""
        return self._touches or (self.until_ns is not None and now_ns < self.until_ns)


class Stall:
    """Notices that the robot pushes without moving, and keeps it from pushing on.

    It may push again once the command has asked for something else: rest, or the other way.

    Attributes:
        way: Sign of the push that stalled; 0 for none.
        watches: Whether there is a measured speed to tell it by.

    Args:
        after_s: How long it may push, s; 0 for ever.
        threshold: Push above which it should move.
    """

    def __init__(self, after_s: float, threshold: float) -> None:
        self._after_s = after_s
        self._threshold = threshold
        self._forward = Persistence(after_s)
        self._backward = Persistence(after_s)
        self.way = 0
        self.watches = False

    def sense(self, quantities: Mapping[str, float], push: float, now_ns: int) -> None:
        """Take in a sensing, and how hard the robot is pushed, -1 to 1."""
        self.watches = self._after_s > 0.0 and "speed" in quantities
        stands = self.watches and abs(quantities["speed"]) < STANDS_M_PER_S
        if self._forward.holds(stands and push > self._threshold, now_ns):
            self.way = 1
        if self._backward.holds(stands and push < -self._threshold, now_ns):
            self.way = -1

    def ask(self, push: float) -> None:
        """Take in what the command asks for."""
        if self.way * push <= 0.0:
            self.way = 0


class RobotHealth:
    """Says why the robot must not move at all: a sensor that fails, battery, temperature.

    A low battery recovers as soon as nothing is moved; so it keeps the robot at rest until it is
    armed again.

    Args:
        plan: The robot.
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
        """Why nothing may move, in words; empty when it may."""
        return " ".join(filter(None, (*self._others, self._battery)))

    def sense(self, sensing: Sensing, now_ns: int) -> None:
        """Take in a sensing."""
        failing = [
            f"Sensor {name} fails, and can protect no longer: {sensing.failures[name]}"
            for name in self._protecting
            if name in sensing.failures and name not in sensing.slow
        ]
        # Also one that protects from nothing: it holds up every stop.
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
        """Forget that the battery was low, unless it still is."""
        if not self._is_low:
            self._battery = ""


STEERING = "steering"
"""Name of the action that turns. It may propel, as that of a tank does, but never forward."""


class Propulsion:
    """What of the actions goes forward; a positive value is forward.

    Attributes:
        forward: Which actions push the robot forward or backward, by index.

    Args:
        actions: The actions of the robot.
    """

    def __init__(self, actions: Sequence[ActionPlan]) -> None:
        self._actions = actions
        self.forward = tuple(i for i, a in enumerate(actions) if a.propels and a.name != STEERING)
        # Actions whose profile says how fast they make the robot.
        self._known = tuple(i for i in self.forward if actions[i].unit == "m/s")

    def push(self, values: Sequence[float]) -> float:
        """How hard the robot is pushed forward, -1 to 1; negative is backward."""
        return self._mean(self.forward, [value - a.rest for value, a in self._pairs(values)])

    def speed(self, values: Sequence[float]) -> float | None:
        """Speed that this push gives by the profile, m/s; None where the profile has none."""
        if not self._known:
            return None
        speeds = [a.gain * (value - a.rest) for value, a in self._pairs(values)]
        return self._mean(self._known, speeds)

    def _pairs(self, values: Sequence[float]) -> zip[tuple[float, ActionPlan]]:
        return zip(values, self._actions, strict=True)

    @staticmethod
    def _mean(which: Sequence[int], numbers: Sequence[float]) -> float:
        return sum(numbers[i] for i in which) / len(which) if which else 0.0
