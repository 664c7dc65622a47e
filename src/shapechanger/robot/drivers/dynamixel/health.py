"""Judges one servo by what it says; nothing here knows a bus or a clock."""

from __future__ import annotations

from shapechanger.robot.drivers.dynamixel.registers import (
    BUS_WATCHDOG,
    GOAL_CURRENT,
    HARDWARE_ERROR,
    TORQUE_ENABLE,
    TRIPPED,
    Present,
    Register,
    hardware_errors,
)
from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.dynamixel.slack import Slack
from shapechanger.robot.drivers.dynamixel.units import lengthening

__all__ = ["Health"]

# A goal that is not there once was lost on its way, and the next one replaces it.
_MOST_GOALS_REFUSED = 2


class Health:
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
