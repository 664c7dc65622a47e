"""Caps, slew and the reflexes of motion as functions of a plan's limits, without a clock.

The guard calls them on a robot, and a simulation of the robot calls them too, so that both move
the same way. They need the standard library alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from shapechanger.contract.plan import ActionPlan, GuardPlan

# Name of the turning action. It may propel, as a tank's does, but never forward.
_STEERING = "steering"
_SAME = 1e-6  # A cap that was stored as a 32-bit float is still the cap.
_NS_PER_MS = 1_000_000
_STANDS_M_PER_S = 0.01
"""Speed below which a robot stands still, m/s: one count per second of a coarse encoder."""


def aimed(action: ActionPlan, value: float) -> float:
    """Return the target of a command's value: clipped to the caps and rounded to a level.

    Args:
        action: The action.
        value: Value in the command, dimensionless.
    """
    if action.levels == "three":
        if value >= action.threshold:
            return action.high
        return action.low if value <= -action.threshold else action.rest
    return max(action.low, min(action.high, value))


def clipped(action: ActionPlan, value: float) -> bool:
    """Return whether a command's value lies outside the caps.

    Args:
        action: The action; with three levels no value is clipped.
        value: Value in the command, dimensionless.
    """
    is_inside = action.low - _SAME <= value <= action.high + _SAME
    return action.levels == "any" and not is_inside


def slewed(action: ActionPlan, now: float, aim: float, elapsed_s: float) -> float:
    """Return the next value on the way to the target.

    The slew limits it away from rest and towards rest, and it pauses at rest for one step when it
    changes sides. A three-level motor has no slew.

    Args:
        action: The action.
        now: Current value.
        aim: Target value.
        elapsed_s: Time since the current value was set, s.
    """
    is_away, will_be_away = now - action.rest, aim - action.rest
    if is_away < 0.0 < will_be_away or will_be_away < 0.0 < is_away:
        aim = action.rest
    falls = abs(aim - action.rest) <= abs(is_away)
    slew_per_s = action.slew_down_per_s if falls else action.slew_per_s
    if action.levels == "three" or math.isinf(slew_per_s):
        return aim
    step = slew_per_s * elapsed_s
    return aim if abs(aim - now) <= step else now + math.copysign(step, aim - now)


def forward_actions(actions: Sequence[ActionPlan]) -> tuple[int, ...]:
    """Return the indices of the actions that push the robot forward or backward."""
    return tuple(i for i, a in enumerate(actions) if a.propels and a.name != _STEERING)


def bump_ends_ns(touches: bool, now_ns: int, ends_ns: int | None, hold_ms: int) -> int | None:
    """Return when the block of the newest bump ends, ns; None if there was none.

    Args:
        touches: Whether a bumper touches something now.
        now_ns: Time, ns.
        ends_ns: The end so far.
        hold_ms: Time for which a bump blocks forward motion (`LimitPlan.bump_hold_ms`), ms.
    """
    return now_ns + hold_ms * _NS_PER_MS if touches else ends_ns


def bump_blocks(touches: bool, now_ns: int, ends_ns: int | None) -> bool:
    """Return whether a bump blocks forward motion.

    Args:
        touches: Whether a bumper touches something now.
        now_ns: Time, ns.
        ends_ns: End of the block, as `bump_ends_ns` returns it.
    """
    return touches or (ends_ns is not None and now_ns < ends_ns)


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
            quantities: Readings keyed by name.
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
            quantities: Readings keyed by name.
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


class MotionReflexes:
    """Reflexes that hold a robot back from what it touches, nears or pushes against.

    Args:
        plan: The robot.

    Attributes:
        bump: Contacts of the bumpers.
        stall: Pushes without motion.
        propulsion: Forward component of the actions.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._actions = plan.actions
        self._limit_m = plan.limits.stop_distance_m
        self._measures_distance = any(s.measures == "distance" for s in plan.sensors)
        self.bump = Bump(plan.limits.bump_hold_ms)
        self.stall = Stall(plan.limits.stall_s, plan.limits.stall_throttle)
        self.propulsion = Propulsion(plan.actions)
        self._is_near = False
        self._is_far = True

    def sense(
        self, quantities: Mapping[str, float], is_silent: bool, done: Sequence[float], now_ns: int
    ) -> None:
        """Update with a new sensing.

        Args:
            quantities: Readings keyed by name.
            is_silent: Whether a distance sensor responded without a distance.
            done: Applied value of each action.
            now_ns: Robot's time, ns.
        """
        limit_m = self._limit_m
        self._is_near = limit_m > 0.0 and quantities.get("distance", limit_m) < limit_m
        is_heard = "distance" in quantities and not is_silent
        self._is_far = limit_m <= 0.0 or not self._measures_distance or is_heard
        self.bump.sense(quantities, now_ns)
        self.stall.sense(quantities, self.propulsion.push(done), now_ns)

    def hold_back(self, aims: Sequence[float], now_ns: int) -> tuple[tuple[float, ...], str]:
        """Return the targets without forbidden motion, and why.

        Args:
            aims: Target of each action.
            now_ns: Robot's time, ns.
        """
        self.stall.ask(self.propulsion.push(aims))
        forward: list[str] = []
        if self.bump.blocks(now_ns):
            forward.append("Not forward: the bumper touched something.")
        if self._is_near:
            forward.append("Not forward: something is near.")
        if not self._is_far:
            forward.append("Not forward: the distance ahead is not known.")
        if self.stall.way > 0:
            forward.append("Not forward: it pushes and does not move.")
        backward = ["Not backward: it pushes and does not move."] if self.stall.way < 0 else []
        kept = list(aims)
        reasons: list[str] = []
        for i in self.propulsion.forward:
            rest = self._actions[i].rest
            for words, drops in ((forward, kept[i] > rest), (backward, kept[i] < rest)):
                if words and drops:
                    kept[i] = rest
                    reasons += words
        return tuple(kept), " ".join(dict.fromkeys(reasons))
