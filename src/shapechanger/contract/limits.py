"""Caps, slew, duty cycles and motion reflexes of a robot; the caller provides the time.

The guard of a robot and its simulation both use this module, so that they move in the same way. It
imports only `shapechanger.contract.plan` and the standard library.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shapechanger.contract.plan import ActionPlan, GuardPlan

_SAME = 1e-6  # Tolerance for values that were rounded to 32-bit floats.
# Duty cycles have the steps of 1 % of gpiozero with lgpio, whose `LGPIOPin._set_state` computes
# `int(value * 100)`. So all pin factories act equally, and `Duty.of` returns the applied duty.
_STEPS = 100
# Speed below which a robot counts as standing, m/s: one count per second of a coarse encoder.
_STANDS_M_PER_S = 0.01


def aimed(action: ActionPlan, value: float) -> float:
    """Return the target of a command's value: clipped to the caps, or one of three levels."""
    if action.levels == "three":
        if value >= action.threshold:
            return action.high
        return action.low if value <= -action.threshold else action.rest
    return max(action.low, min(action.high, value))


def clipped(action: ActionPlan, value: float) -> bool:
    """Return whether a command's value lies outside the caps; never for three levels."""
    is_inside = action.low - _SAME <= value <= action.high + _SAME
    return action.levels == "any" and not is_inside


def slewed(action: ActionPlan, now: float, aim: float, elapsed_s: float) -> float:
    """Return the next value on the way to the target.

    The slew limits the change away from rest and towards rest. A value that changes to the other
    side of rest stays at rest for one step. A three-level motor has no slew.

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


@dataclass(frozen=True, slots=True)
class Duty:
    """Conversion of an output value to a duty cycle, the share of time that a motor is on.

    Attributes:
        start: Smallest duty that moves the motor, 0 to 1; values just above 0 are mapped to it.
        full: Duty at a value of 1, above `start` and at most 1.
    """

    start: float = 0.0
    full: float = 1.0

    def of(self, value: float) -> float:
        """Return the duty cycle for the magnitude of a value, in whole steps."""
        size = min(abs(value), 1.0)
        if size == 0.0:
            return 0.0
        steps = round((self.start + (self.full - self.start) * size) * _STEPS)
        duty = steps / _STEPS
        # gpiozero truncates, and 0.29 * 100 is 28.999999999999996.
        return duty if int(duty * _STEPS) == steps else math.nextafter(duty, 1.0)

    def size_at(self, duty: float) -> float:
        """Return the magnitude of the value with a duty cycle; above 0 for every duty above 0."""
        if duty <= 0.0:
            return 0.0
        # A duty that was rounded to just below `start` still turns the motor.
        return min(max((duty - self.start) / (self.full - self.start), 0.5 / _STEPS), 1.0)


class Bump:
    """Block forward motion during a contact and for `hold_ms` after it.

    Attributes:
        count: Number of bumps.
        until_ns: Time from which the robot may go forward again, ns; None before the first bump.
    """

    def __init__(self, hold_ms: int) -> None:
        self._hold_ns = hold_ms * 1_000_000
        self._touches = False
        self.count = 0
        self.until_ns: int | None = None

    def sense(self, quantities: Mapping[str, float], now_ns: int) -> None:
        """Update with readings keyed by quantity, at a time, ns."""
        touches = quantities.get("bump", 0.0) > 0.0
        self.count += touches and not self._touches
        if touches:
            self.until_ns = now_ns + self._hold_ns
        self._touches = touches

    def blocks(self, now_ns: int) -> bool:
        """Return whether forward motion is blocked."""
        return self._touches or (self.until_ns is not None and now_ns < self.until_ns)


class Stall:
    """Detect a push without motion, and block further pushing in this direction.

    The block ends as soon as a command requests rest or the other direction.

    Attributes:
        way: Sign of the push that stalled; 0 for none.
        watches: Whether stalls can be detected: not disabled, and with a measured speed.

    Args:
        after_s: Longest push without motion, s; 0 to disable.
        threshold: Push above which motion is expected.
    """

    def __init__(self, after_s: float, threshold: float) -> None:
        self._after_ns = round(after_s * 1e9)
        self._threshold = threshold
        self._pushing = self._since_ns = self.way = 0
        self.watches = False

    def sense(self, quantities: Mapping[str, float], push: float, now_ns: int) -> None:
        """Update with readings keyed by quantity, and the applied push, -1 to 1, at a time, ns."""
        self.watches = self._after_ns > 0 and "speed" in quantities
        stands = self.watches and abs(quantities["speed"]) < _STANDS_M_PER_S
        pushing = (push > self._threshold) - (push < -self._threshold) if stands else 0
        if pushing != self._pushing:
            self._pushing, self._since_ns = pushing, now_ns
        if pushing and now_ns - self._since_ns >= self._after_ns:
            self.way = pushing

    def ask(self, push: float) -> None:
        """Update with the push that the command requests, -1 to 1."""
        if self.way * push <= 0.0:
            self.way = 0


class Propulsion:
    """Forward component of the actions; positive is forward. Actions that propel rest at 0.

    Attributes:
        forward: Indices of the actions that push the robot forward or backward.
    """

    def __init__(self, actions: Sequence[ActionPlan]) -> None:
        self._actions = actions
        # The steering of a tank propels too, but never forward.
        self.forward = tuple(i for i, a in enumerate(actions) if a.propels and a.name != "steering")
        # Indices of the actions for which the profile states a speed.
        self._known = tuple(i for i in self.forward if actions[i].unit == "m/s")

    def push(self, values: Sequence[float]) -> float:
        """Return the forward push, -1 to 1; negative is backward."""
        push = 0.0
        for i in self.forward:
            push += values[i]
        return push / len(self.forward) if self.forward else 0.0

    def speed(self, values: Sequence[float]) -> float | None:
        """Return the speed that the profile states for this push, m/s; None if unknown."""
        if not self._known:
            return None
        return sum([self._actions[i].gain * values[i] for i in self._known]) / len(self._known)


class MotionReflexes:
    """Reflexes that block motion into an object, and forward motion if the distance is not known.

    Attributes:
        bump: Contacts of the bumpers.
        stall: Pushes without motion.
        propulsion: Forward component of the actions.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._limit_m = plan.limits.stop_distance_m
        self._measures_distance = any(s.measures == "distance" for s in plan.sensors)
        self.bump = Bump(plan.limits.bump_hold_ms)
        self.stall = Stall(plan.limits.stall_s, plan.limits.stall_throttle)
        self.propulsion = Propulsion(plan.actions)
        self._is_near = False
        self._is_far = True

    def sense(
        self, quantities: Mapping[str, float], is_silent: bool, push: float, now_ns: int
    ) -> None:
        """Update with readings keyed by quantity, and the applied push, -1 to 1, at a time, ns.

        `is_silent` states whether a distance sensor responded without a distance.
        """
        limit_m = self._limit_m
        self._is_near = limit_m > 0.0 and quantities.get("distance", limit_m) < limit_m
        is_heard = "distance" in quantities and not is_silent
        self._is_far = limit_m <= 0.0 or not self._measures_distance or is_heard
        self.bump.sense(quantities, now_ns)
        self.stall.sense(quantities, push, now_ns)

    def hold_back(self, aims: Sequence[float], now_ns: int) -> tuple[tuple[float, ...], str]:
        """Return the allowed target of each action, and the reasons for changes as text."""
        if self.stall.way:
            self.stall.ask(self.propulsion.push(aims))
        bumped, stalled = self.bump.blocks(now_ns), self.stall.way
        if self._is_far and not (bumped or self._is_near or stalled):
            return tuple(aims), ""
        reasons = (
            (1, bumped, "Not forward: the bumper touched something."),
            (1, self._is_near, "Not forward: something is near."),
            (1, not self._is_far, "Not forward: the distance ahead is not known."),
            (1, stalled > 0, "Not forward: it pushes and does not move."),
            (-1, stalled < 0, "Not backward: it pushes and does not move."),
        )
        forbidden = [(way, reason) for way, holds, reason in reasons if holds]
        kept, given = list(aims), dict[str, None]()
        for i in self.propulsion.forward:
            asked = [reason for way, reason in forbidden if way * aims[i] > 0.0]
            if asked:
                kept[i] = 0.0
                given |= dict.fromkeys(asked)
        return tuple(kept), " ".join(given)
