"""Judges one servo by what it says; nothing here knows a bus or a clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.protocol import (
    BUS_WATCHDOG,
    COUNTS_PER_TURN,
    GOAL_CURRENT,
    HARDWARE_ERROR,
    TORQUE_ENABLE,
    TRIPPED,
    Present,
    Register,
    hardware_errors,
)
from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings

__all__ = [
    "BusState",
    "Mode",
    "ServoHealth",
    "ServoState",
    "Slack",
    "cap_count",
    "goal_count",
    "length_m",
    "length_per_count",
    "lengthening",
    "tension_n",
    "within",
]

Mode = Literal["off", "held", "stopping", "silent"]
"""What the bus does.

"off": no servo has torque. "held": they pull what they are told. "stopping": the tensions go down,
then the servos let go. "silent": nothing is sent any more, so that the servos' own watchdogs stop
them.
"""


@dataclass(frozen=True, slots=True)
class ServoState:
    """What one servo said in this cycle.

    Attributes:
        position: Counts of 1/4096 turn, over many turns.
        length_m: Length of the tendon beyond its zero, m; None while it has no zero.
        lengthening_m_per_s: How fast it gets longer, m/s.
        tension_n: What its present current pulls, N, the gears' friction aside.
        goal_n: What it was told to pull, N, after the caps and in whole counts.
        is_capped: Whether more was asked of it than it may pull.
        voltage_v: V.
        temperature_c: Degrees Celsius.
    """

    position: int
    length_m: float | None
    lengthening_m_per_s: float
    tension_n: float
    goal_n: float
    is_capped: bool
    voltage_v: float
    temperature_c: float


@dataclass(frozen=True, slots=True)
class BusState:
    """The bus after a cycle.

    Attributes:
        at_ns: The time of the cycle.
        mode: What the bus does from now on.
        servos: What was heard in this cycle, by the name of the tendon; who was not heard is not in
            it, and nothing old is said again.
        missed: How many cycles in a row each servo was not heard.
        faults: What is wrong, in sentences, by the name of the tendon, or "" for the bus. They stay
            until `ServoBus.set_up`.
    """

    at_ns: int
    mode: Mode
    servos: Mapping[str, ServoState]
    missed: Mapping[str, int]
    faults: Mapping[str, str]

    @property
    def reason(self) -> str:
        """All faults as one text; empty without any."""
        return " ".join(self.faults.values())


_ROUNDING: Final = 1e-9  # Of a quotient that is a whole number: 3.0 may come out as 2.9999999999.


def cap_count(servo: ServoSettings) -> int:
    """The current limit, in counts: the largest that pulls no more than the most tension."""
    return math.floor(servo.most_tension_n / servo.newton_per_count + _ROUNDING)


def within(servo: ServoSettings, tension: float) -> float:
    """A tension, kept between the pretension and the most tension, N.

    Raises:
        RobotError: If it is no number: nobody knows what was meant.
    """
    if not math.isfinite(tension):
        raise RobotError(f"{servo.words} cannot pull {tension} N.")
    return min(max(tension, servo.pretension_n), servo.most_tension_n)


def goal_count(servo: ServoSettings, tension: float) -> int:
    """The goal current for a tension, in counts with the sign that winds in; never above the cap.

    It is rounded towards slack.

    Args:
        servo: Who pulls.
        tension: N; below 0 counts as 0, for a tendon does not push.

    Raises:
        RobotError: If it is no number.
    """
    if not math.isfinite(tension):
        raise RobotError(f"{servo.words} cannot pull {tension} N.")
    # Clipped first: a number near the largest that there is would divide to infinity.
    pulled = min(max(tension, 0.0), servo.most_tension_n)
    counts = math.floor(pulled / servo.newton_per_count + _ROUNDING)
    return servo.direction * min(counts, cap_count(servo))


def tension_n(servo: ServoSettings, current: int) -> float:
    """What a current pulls, N; below 0 for one that lets out."""
    return servo.direction * current * servo.newton_per_count


def length_per_count(servo: ServoSettings) -> float:
    """How much longer the tendon gets with one more count, m; below 0 if it winds in."""
    return -servo.direction * 2.0 * math.pi * servo.spool_radius_m / COUNTS_PER_TURN


def length_m(servo: ServoSettings, position: int, zero: int) -> float:
    """Length of the tendon beyond its zero, m.

    Args:
        servo: Whose tendon.
        position: Present position, in counts.
        zero: Position at the zero.
    """
    return (position - zero) * length_per_count(servo)


def lengthening(servo: ServoSettings, speed: float) -> float:
    """How fast the tendon gets longer, m/s, for a speed of the servo in rad/s."""
    return -servo.direction * speed * servo.spool_radius_m


class Slack:
    """One tendon.

    Two signs tell. It is wound in further than the finger could let it: certain, at any tension,
    but it needs a zero. Or it winds in nearly as fast as the servo turns without load, for a while:
    earlier, but only where the current overcomes the gears by far. A tendon that snaps while its
    servo stands still at the pretension is noticed when it is next pulled.

    Args:
        shortest_m: Length that the finger cannot shorten it to, m.
        most_m_per_s: Speed from which on it carries nothing, m/s.
        slack_ms: For how long.
    """

    def __init__(self, shortest_m: float, most_m_per_s: float, slack_ms: int) -> None:
        self._shortest_m = shortest_m
        self._most_m_per_s = most_m_per_s
        self._slack_ns = slack_ms * 1_000_000
        self._since_ns: int | None = None

    def see(self, length: float | None, lengthening: float, now_ns: int) -> str:
        """Take in how long the tendon is, and how fast it gets longer.

        Args:
            length: Beyond its zero, m; None without one.
            lengthening: m/s; below 0 while it is wound in.
            now_ns: The time.

        Returns:
            Why it must be slack, in words; empty where it need not be.
        """
        if length is not None and length < self._shortest_m:
            return f"it is wound in by {-1e3 * length:.0f} mm, further than the finger lets it"
        if -lengthening < self._most_m_per_s:
            self._since_ns = None
            return ""
        if self._since_ns is None:
            self._since_ns = now_ns
        if now_ns - self._since_ns >= self._slack_ns:
            return f"it winds in at {-1e3 * lengthening:.0f} mm/s, as without any load"
        return ""


# A goal that is not there once was lost on its way, and the next one replaces it.
_MOST_GOALS_REFUSED = 2


class ServoHealth:
    """One servo.

    Args:
        servo: The servo.
        bus: Its bus.

    Attributes:
        fault: What is wrong first, as a sentence; empty while nothing is. It stays until `clear`.
        missed: How many cycles in a row it was not heard.
        was_reset: Whether it has forgotten where its zero is.
    """

    def __init__(self, servo: ServoSettings, bus: BusSettings) -> None:
        self._servo = servo
        self._bus = bus
        self.was_reset = False
        self.clear()

    def clear(self) -> None:
        """Forget what was wrong."""
        model, bus = self._servo.known, self._bus
        most_m_per_s = bus.slack_share * model.no_load_rad_per_s * self._servo.spool_radius_m
        self._slack = Slack(self._servo.shortest_m, most_m_per_s, bus.slack_ms)
        self._wrong_volts = self._hot = self._refused = 0
        self._was_late = False
        self.fault = ""
        self.missed = 0

    def miss(self, *, late: bool) -> None:
        """It was not heard in this cycle.

        Args:
            late: Whether bytes of a late answer were seen.
        """
        self.missed += 1
        self._was_late |= late
        if self.missed >= self._bus.most_missed:
            what = "answers too late" if self._was_late else "does not answer"
            self._say(f"{what}, {self.missed} cycles in a row")

    def see(self, present: Present, length: float | None, now_ns: int, *, pulls: bool) -> None:
        """Take in what it said.

        Args:
            present: What it said.
            length: Length of its tendon beyond its zero, m; None without one.
            now_ns: The time.
            pulls: Whether it has torque.
        """
        self.missed, self._was_late = 0, False
        model = self._servo.known
        volts, degrees = present.voltage, present.temperature
        self._wrong_volts = 0 if model.least_v <= volts <= model.most_v else self._wrong_volts + 1
        if self._wrong_volts >= self._bus.believed_cycles:
            self._say(f"has {volts:.1f} V, and needs {model.least_v:g} to {model.most_v:g} V")
        most_c = model.most_c - self._bus.margin_c
        self._hot = self._hot + 1 if degrees > most_c else 0
        if self._hot >= self._bus.believed_cycles:
            self._say(f"has {degrees:.0f} C, more than {most_c:g} C")
        if pulls:
            speed = lengthening(self._servo, present.speed)
            if words := self._slack.see(length, speed, now_ns):
                self._say(f"has lost its tendon: {words}")

    def audit(self, register: Register, value: int, *, pulls: bool, goal: int) -> None:
        """Take in one of the registers that say whether it still obeys.

        Args:
            register: Which one.
            value: What is in it.
            pulls: Whether it should have torque.
            goal: The goal current that it was sent last, in counts.
        """
        if register == HARDWARE_ERROR and value:
            words = ", ".join(hardware_errors(value)) or f"it gives the unknown code {value}"
            self._say(f"has switched itself off: {words}. Only a reboot gives it torque again")
        elif register == BUS_WATCHDOG and value == TRIPPED:
            words = f"it heard nothing for {self._bus.watchdog_ms} ms"
            self._say(f"was stopped by its own watchdog, for {words}")
        elif register == BUS_WATCHDOG and value == 0:
            self.was_reset = True
            self._say("was started afresh, as by a dip of its power, and has lost its zero")
        elif register == TORQUE_ENABLE and pulls and value == 0:
            self._say("has let go by itself")
        elif register == GOAL_CURRENT and pulls:
            self._refused = 0 if value == goal else self._refused + 1
            if self._refused >= _MOST_GOALS_REFUSED:
                self._say(f"keeps to a goal of {value} counts, and was told {goal}")

    def _say(self, what: str) -> None:
        self.fault = self.fault or f"{self._servo.words} {what}."
