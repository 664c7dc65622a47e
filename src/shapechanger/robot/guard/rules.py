"""Safety rules: whether and how the outputs move, as a function of time.

The rules use no pins, sockets or clocks, so that tests can pass in any time. The guard process
(`shapechanger.robot.guard.process`) passes in orders and sensor readings, and writes the decisions
of `Rules.tick`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shapechanger.contract.limits import MotionReflexes, aimed, clipped, slewed
from shapechanger.contract.plan import ActionPlan, GuardPlan, StopPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.guard.running import shortened
from shapechanger.robot.guard.sensors import Sensing

# Time for which a battery must be low or a CPU hot before the robot stops, s: a noisy reading, or
# the dip when a motor starts, must not stop it.
_BELIEVED_AFTER_S = 0.5


class Debounce:
    """Condition that counts once it has held for `for_s` seconds without interruption."""

    def __init__(self, for_s: float) -> None:
        self._for_ns = round(for_s * 1e9)
        self._since_ns: int | None = None

    def holds(self, condition: bool, now_ns: int) -> bool:
        """Update with the condition at a time, ns; return whether it has held for long enough."""
        if not condition:
            self._since_ns = None
            return False
        if self._since_ns is None:
            self._since_ns = now_ns
        return now_ns - self._since_ns >= self._for_ns


class RobotHealth:
    """Reasons to keep the whole robot at rest: failed sensors, low battery, high temperature.

    Of the failed sensors, only slow ones and those that protect the robot count. A battery recovers
    as soon as the load is gone, so a low one latches until the robot is armed while it is not low.
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
        self._protecting = tuple(s.name for s in plan.sensors if needed.get(s.measures))
        self._low = Debounce(_BELIEVED_AFTER_S)
        self._hot = Debounce(_BELIEVED_AFTER_S)
        self._is_low = False
        self._battery = ""
        self._others: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Return why the robot must not move, or an empty string."""
        return " ".join(filter(None, (*self._others, self._battery)))

    def sense(self, sensing: Sensing, now_ns: int) -> None:
        """Update with new sensor readings."""
        failing: list[str] = []
        for name, why in sensing.failures.items():
            if name in sensing.slow:  # A slow sensor delays stops, even if no reflex uses it.
                failing.append(f"Sensor {name} delays the robot: {why}")
            elif name in self._protecting:
                failing.append(f"Sensor {name} fails and cannot protect the robot: {why}")
        low_v, high_c = self._limits.low_battery_v, self._limits.high_temperature_c
        volts = sensing.quantities.get("battery", math.inf)
        self._is_low = self._low.holds(low_v > 0.0 and volts < low_v, now_ns)
        if self._is_low:
            self._battery = f"The battery has {volts:.2f} V, less than {low_v:g} V."
        degrees = sensing.quantities.get("temperature", -math.inf)
        if self._hot.holds(high_c > 0.0 and degrees > high_c, now_ns):
            failing.append(f"The computer has {degrees:.0f} C, more than {high_c:g} C.")
        self._others = tuple(failing)

    def rearm(self) -> None:
        """Clear the low-battery latch, unless the battery is still low."""
        if not self._is_low:
            self._battery = ""


_NS_PER_MS = 1_000_000
_CLIPPED = "Clipped by the robot's caps."

# Quantities of the sensors whose failure disarms the robot; a slow one only stops it.
_DISARMING = ("tendons", "joints")

_ARM_WITHIN_NS = 1_000_000_000
"""Age from which an order to arm is refused, ns: the operator may no longer be watching."""

FUTURE_NS = 50_000_000
"""Tolerance for times in the future, ns. Both processes read one clock, so this is generous."""


class Stopping:
    """A stop: propulsion rests at once; other actions hold, then ramp; outputs may be released."""

    def __init__(
        self, plan: StopPlan, actions: Sequence[ActionPlan], values: Sequence[float], since_ns: int
    ) -> None:
        self._actions = actions
        self._values = values
        self._then = plan.then
        self._ramp_ns = plan.ramp_ms * _NS_PER_MS
        hold_end_ns = since_ns + plan.hold_ms * _NS_PER_MS
        self._end_ns = hold_end_ns + self._ramp_ns
        self.changes_ns = (hold_end_ns, self._end_ns)
        """When the values begin to change, and when they are at rest, ns."""

    def values(self, now_ns: int) -> tuple[float, ...]:
        """Return the value of each action."""
        # Remaining part of the way to rest, 1 to 0.
        left = min(1.0, max(0, self._end_ns - now_ns) / max(1, self._ramp_ns))
        return tuple(
            action.rest if action.propels else action.rest + left * (value - action.rest)
            for action, value in zip(self._actions, self._values, strict=True)
        )

    def releases(self, now_ns: int) -> bool:
        """Return whether the outputs are released."""
        return self._then == "release" and now_ns >= self._end_ns


@dataclass(frozen=True, slots=True)
class OutputDecision:
    """Decision of the rules on the outputs.

    Attributes:
        actions: One number for each action.
        release: Whether the outputs are released instead of written.
        stop_reason: Why no command is followed, or what changes it beyond slew and levels, or "".
        session: Session of the command that the robot follows; 0 without one.
        seq: Sequence number of that command; None without one, such as in a stop.
    """

    actions: tuple[float, ...]
    release: bool
    stop_reason: str
    session: int
    seq: int | None


class Rules:
    """Safety rules of one robot.

    The robot starts disarmed. An emergency stop latches until a person who has seen it arms the
    robot again.

    Attributes:
        armed: Whether the robot is armed; otherwise commands move nothing.
        emergency: Whether an emergency stop is in force.
        emergencies: Number of emergency stops.
        disarmed: Why the robot must not move; empty while armed.
        senses: Newest sensor readings, and quantities derived from them.
    """

    def __init__(self, plan: GuardPlan, now_ns: int) -> None:
        for action in plan.actions:
            if not action.low <= action.rest <= action.high:
                raise RobotError(
                    f"Action {action.name!r} rests at {action.rest:g}, outside its caps "
                    f"{action.low:g} to {action.high:g}."
                )
        self.armed = False
        self.emergency = False
        self.emergencies = 0
        self.disarmed = "Not armed."
        self.senses = Sensing()
        self._plan = plan
        self._period_ns = round(1e9 / plan.tick_hz)
        self._stale_ns = plan.limits.camera_stale_ms * _NS_PER_MS
        self._newest = (-1, -1)  # Session and number of the newest command.
        self._reflexes = MotionReflexes(plan)
        self._health = RobotHealth(plan)
        self._disarming = tuple(s.name for s in plan.sensors if s.measures in _DISARMING)
        self._is_pressed = False
        self._command: Order | None = None
        self._expiry_ns = 0
        self._frame_ns: int | None = None
        self._ticked_ns = now_ns
        self._applied = tuple(action.rest for action in plan.actions)
        self._done = self._applied
        # A guard starts as if a stop had just ended.
        self._stopping: Stopping | None = self._rest_at_once(now_ns)

    @property
    def direction(self) -> float:
        """Return the sign of the propulsion: 1 forward, -1 backward, 0 neither."""
        push = self._reflexes.propulsion.push(self._done)
        return float((push > 0.0) - (push < 0.0))

    @property
    def bumps(self) -> int:
        """Return the number of bumps."""
        return self._reflexes.bump.count

    def offer(self, order: Order, now_ns: int) -> str:
        """Process an order; return why it is refused, or an empty string."""
        if order.frame_ns is not None and order.frame_ns <= now_ns + FUTURE_NS:
            self._frame_ns = max(min(order.frame_ns, now_ns), self._frame_ns or 0)
        match order.kind:
            case "command":
                return self._offer_command(order, now_ns)
            case "halt":
                self.halt()
            case "arm":
                return self._arm(order, now_ns)
            case "disarm":
                self.disarm(order.reason)
            case "emergency":
                self.stop(order.reason)
            case "end":
                self.disarm("the guard ends.")
        return ""

    def halt(self) -> None:
        """Cancel the newest command; the robot stays armed."""
        self._command = None

    def disarm(self, reason: str) -> None:
        """Stop until armed again; the reason of an emergency stop is kept."""
        self._command, self.armed = None, False
        if not self.emergency:
            self.disarmed = _sentence("Disarmed", reason)

    def stop(self, reason: str) -> None:
        """Latch an emergency stop, and count it; while it lasts, the first reason is kept."""
        if not self.emergency:
            self.disarmed = _sentence("Emergency stop", reason)
        self._command, self.armed, self.emergency = None, False, True
        self.emergencies += 1

    def fail(self, reason: str, now_ns: int) -> None:
        """Latch an emergency stop without hold or ramp, after an output failed."""
        self.stop(reason)
        self._stopping = self._rest_at_once(now_ns)

    def press(self, pressed: bool) -> None:
        """Update with the state of the emergency stop button."""
        if pressed and not self._is_pressed:
            self.stop("the button was pressed.")
        self._is_pressed = pressed

    def sense(self, sensing: Sensing, now_ns: int) -> None:
        """Update with new sensor readings."""
        push = self._reflexes.propulsion.push(self._done)
        self._reflexes.sense(sensing.quantities, bool(sensing.silent), push, now_ns)
        self._health.sense(sensing, now_ns)
        # The robot has to be inspected before it is armed again: faulty servos have released their
        # joints, and an encoder that responds intermittently has a loose magnet.
        for name in self._disarming:
            if name in sensing.failures and name not in sensing.slow and self.armed:
                self.disarm(sensing.failures[name])
        stall = self._reflexes.stall
        sensing.conclude(
            speed=self._reflexes.propulsion.speed(self._done),
            stalled=stall.way != 0 if stall.watches else None,
        )
        self.senses = sensing

    def tick(self, now_ns: int) -> OutputDecision:
        """Return the decision on the outputs from now on."""
        # A pause of the process must not cause a jump.
        elapsed_ns = min(now_ns - self._ticked_ns, 2 * self._period_ns)
        self._ticked_ns = now_ns
        command = self._command
        if command is not None and now_ns >= self._expiry_ns:
            command = self._command = None
        reason = self._reason(now_ns)
        if reason or command is None:
            decision = self._stand(reason, now_ns)
        else:
            decision = self._follow(command, elapsed_ns / 1e9, now_ns)
        self._done = self._applied
        return decision

    def stands(self, now_ns: int) -> bool:
        """Return whether `tick` would stop the robot or keep it at rest now."""
        return self._reason(now_ns) != ""

    def set_applied(self, done: tuple[float, ...]) -> None:
        """Update with the value of each action that the outputs applied after `tick`."""
        self._done = done

    def next_wake_ns(self, now_ns: int) -> int:
        """Return when `tick` is due at the latest, ns."""
        times = [now_ns + self._period_ns]
        if self._command is not None:
            times.append(self._expiry_ns)
        if self._stale_ns and self._frame_ns is not None:
            times.append(self._frame_ns + self._stale_ns)
        if self._reflexes.bump.until_ns is not None:
            times.append(self._reflexes.bump.until_ns)
        if self._stopping is not None:
            times += self._stopping.changes_ns
        return min(time_ns for time_ns in times if time_ns > now_ns)

    def _offer_command(self, order: Order, now_ns: int) -> str:
        """Accept a command, or return why it is refused.

        A command must be newer than all earlier ones, also than those that were refused, because
        the sender has superseded the older ones.
        """
        limit_ms = min(self._plan.limits.deadline_ms, order.ttl_ms)
        expiry_ns = min(order.issued_ns, now_ns) + limit_ms * _NS_PER_MS
        if (order.session, order.seq) <= self._newest:
            session, seq = self._newest
            return (
                f"Command {order.seq} of session {order.session} is not newer than "
                f"{seq} of session {session}."
            )
        self._newest = (order.session, order.seq)
        if order.issued_ns > now_ns + FUTURE_NS:
            return f"Command {order.seq} comes from the future."
        if now_ns >= expiry_ns:
            age_ms = (now_ns - order.issued_ns) / _NS_PER_MS
            return f"Command {order.seq} is {age_ms:.0f} ms old; it may act for {limit_ms} ms."
        wanted, given = len(self._plan.actions), len(order.values)
        if given != wanted:
            self.halt()
            return f"Command {order.seq} has {given} values; this robot has {wanted} actions."
        if not self.armed:
            return f"Command {order.seq} is refused. {self.disarmed}"
        self._command, self._expiry_ns = order, expiry_ns
        return ""

    def _arm(self, order: Order, now_ns: int) -> str:
        age_ns = now_ns - order.issued_ns
        seen = f"there were {self.emergencies} emergency stops, and the sender has seen "
        refusals = (
            (self._is_pressed, "the emergency button is pressed."),
            (age_ns >= _ARM_WITHIN_NS, f"the order to arm is {age_ns / 1e9:.1f} s old."),
            (self.emergency and not order.person, "only a person ends an emergency stop."),
            (self.emergency and order.emergency != self.emergencies, f"{seen}{order.emergency}."),
        )
        for is_refused, why in refusals:
            if is_refused:
                return f"Not armed: {why}"
        self.armed, self.emergency, self.disarmed = True, False, ""
        self._command = None  # Earlier commands must not take effect now.
        self._health.rearm()
        return ""

    def _reason(self, now_ns: int) -> str:
        """Return why the robot must not move, or an empty string if its command may act."""
        if reason := self.disarmed or self._health.reason:
            return reason
        # The age of the newest frame is known only from a command, which contains the frame's time.
        if self._command is None or now_ns >= self._expiry_ns:
            return "No fresh command."
        if not self._stale_ns:
            return ""
        if self._frame_ns is None:
            return "Blind: no image yet."
        if now_ns - self._frame_ns >= self._stale_ns:
            return f"Blind: no image for {self._plan.limits.camera_stale_ms} ms."
        return ""

    def _stand(self, reason: str, now_ns: int) -> OutputDecision:
        if self._stopping is None:
            plan = self._plan
            self._stopping = Stopping(plan.stop, plan.actions, self._applied, now_ns)
        self._reflexes.stall.ask(0.0)
        self._applied = self._stopping.values(now_ns)
        return OutputDecision(self._applied, self._stopping.releases(now_ns), reason, 0, None)

    def _follow(self, command: Order, elapsed_s: float, now_ns: int) -> OutputDecision:
        self._stopping = None
        actions = self._plan.actions
        aims = [aimed(a, value) for a, value in zip(actions, command.values, strict=True)]
        clips = any(map(clipped, actions, command.values))
        aims, reason = self._reflexes.hold_back(aims, now_ns)
        if clips:
            reason = f"{reason} {_CLIPPED}".lstrip()
        self._applied = tuple(
            slewed(a, now, aim, elapsed_s)
            for a, now, aim in zip(actions, self._applied, aims, strict=True)
        )
        return OutputDecision(self._applied, False, reason, command.session, command.seq)

    def _rest_at_once(self, now_ns: int) -> Stopping:
        actions = self._plan.actions
        plan = StopPlan(then=self._plan.stop.then)
        return Stopping(plan, actions, [a.rest for a in actions], now_ns)


def _sentence(state: str, reason: str) -> str:
    return f"{state}: {shortened(reason)}" if reason else f"{state}."
