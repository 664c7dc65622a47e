"""One servo of a bus with its tendon: its goals, its readings, and the detection of its faults."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Final

from shapechanger.robot.drivers.servos.family import TRIPPED, Register
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings


@dataclass(frozen=True, slots=True)
class ServoState:
    """Readings of one servo in a cycle.

    Attributes:
        position: Position over many turns, in counts of 1/4096 turn.
        length_m: Length of the tendon beyond its zero, m; None without a zero.
        lengthening_m_per_s: Rate of change of that length, m/s.
        tension_n: Tension of its present current, N, without the gears' friction.
        goal_n: Tension of its goal, N: limited and in whole counts.
    """

    position: int
    length_m: float | None
    lengthening_m_per_s: float
    tension_n: float
    goal_n: float


# Counts ahead of its position to which a servo with control of the length is sent to pull.
_AHEAD: Final = 1024
# Consecutive cycles with a wrong voltage or temperature that make a fault.
_BELIEVED_CYCLES: Final = 3
# K below the model's temperature limit at which a servo is too hot.
_MARGIN_C: Final = 5.0
# One wrong goal was lost on the way and is replaced by the next.
_MAX_WRONG_GOALS: Final = 2
# Length from the zero, m, to which the finger cannot let a tendon shorten. Chosen: the longest
# excursion of a finger's tendon is 42 mm.
_SHORTEST_M: Final = -0.06
# Share of the speed without load, and time at it, with which a tendon counts as lost.
_SLACK_SHARE: Final = 0.7
_SLACK_NS: Final = 100_000_000


class TendonServo:
    """One servo of a bus with its tendon.

    There are two signs of a tendon that has snapped or come off. One that is wound in further than
    the finger allows is lost for certain, at any tension, but this needs a zero. A servo that winds
    in nearly as fast as without load shows it earlier, but only if its current overcomes the gears
    by far. A tendon that snaps while its servo stands still at the pretension is detected with the
    next pull.

    Args:
        settings: The servo.
        bus: Its bus.

    Attributes:
        settings: The servo.
        zero: Position at the zero of its tendon, in counts; None without a zero.
        position: Position, as last read, in counts.
        goal: Goal, as last sent, in counts; see `ServoFamily.goal`.
        length: Requested length beyond the zero, m; None to pull with the tension.
        fault: First fault, as a sentence, until `clear`; empty without a fault.
        missed: Cycles in a row without an answer.
    """

    def __init__(self, settings: ServoSettings, bus: BusSettings) -> None:
        self.settings = settings
        self._bus = bus
        self.zero: int | None = None
        self.position = self.goal = 0
        self._stopped_at_n = 0.0
        self.length: float | None = None
        self.clear()

    def clear(self) -> None:
        """Clear the fault."""
        self._slack_since_ns: int | None = None
        self._wrong: Counter[str] = Counter()
        self._was_late = False
        self.fault = ""
        self.missed = 0

    @property
    def goal_n(self) -> float:
        """Tension of the goal, N."""
        return abs(self.goal) * self.settings.newton_per_goal

    @property
    def goal_position(self) -> int:
        """Goal of the position, in counts, for control of the length."""
        if self.length is not None and self.zero is not None:
            return self.settings.position_at(self.length, self.zero)
        return self.position + self.settings.direction * _AHEAD

    def begin_stop(self) -> None:
        """Remember the tension from which a stop ramps down."""
        self._stopped_at_n = self.goal_n

    def ramp_n(self, left: float) -> float:
        """Return the tension during a stop, N.

        Args:
            left: Share of the ramp that is left, 1 to 0.
        """
        if self.fault:
            return 0.0  # Lets go at once, while the others ramp down.
        start = self._stopped_at_n
        end = min(self.settings.pretension_n, start)  # A tendon that was not pulled stays so.
        return end + left * (start - end)

    def miss(self, *, late: bool) -> None:
        """Count a cycle without an answer."""
        self.missed += 1
        self._was_late |= late
        if self.missed >= self._bus.most_missed:
            how = "answers too late" if self._was_late else "does not answer"
            self._fail(f"{how}, {self.missed} cycles in a row")

    def see(self, data: bytes, now_ns: int, *, pulls: bool) -> ServoState:
        """Evaluate the answer of a cycle.

        Args:
            data: The block of present values.
            now_ns: Time, ns.
            pulls: Whether it should have torque.
        """
        self.missed, self._was_late = 0, False
        servo, model = self.settings, self.settings.known
        present = model.family.decode(data)
        volts, degrees, most_c = present.voltage, present.temperature, model.most_c - _MARGIN_C
        if self._lasts("voltage", not model.least_v <= volts <= model.most_v, _BELIEVED_CYCLES):
            self._fail(f"has {volts:.1f} V, and needs {model.least_v:g} to {model.most_v:g} V")
        if self._lasts("heat", degrees > most_c, _BELIEVED_CYCLES):
            self._fail(f"has {degrees:.0f} C, more than {most_c:g} C")
        self.position = present.position
        length = None if self.zero is None else servo.length_m(present.position, self.zero)
        lengthening = servo.lengthening(present.speed)
        if pulls:
            self._see_tendon(length, lengthening, now_ns)
        tension_n = servo.tension_n(present.current)
        return ServoState(present.position, length, lengthening, tension_n, self.goal_n)

    def audit(self, register: Register, value: int, *, pulls: bool) -> None:
        """Evaluate a register that shows whether the servo still obeys.

        Args:
            register: The register.
            value: Its value.
            pulls: Whether the servo should have torque.
        """
        family = self.settings.known.family
        if register == family.hardware_error and value:
            error = family.error_words(value)
            self._fail(f"has switched itself off: {error}. Only a reboot gives it torque again")
        elif register == family.mark and family.has_watchdog and value == TRIPPED:
            silence = f"it received nothing for {self._bus.watchdog_ms} ms"
            self._fail(f"was stopped by its own watchdog: {silence}")
        elif register == family.mark and value == 0:
            self.zero = None
            self._fail("has restarted, for example after a dip of its power, and lost its zero")
        elif register == family.torque_enable and pulls and value == 0:
            self._fail("has let go by itself")
        elif (
            register == family.goal
            and pulls
            and self._lasts("goal", value != self.goal, _MAX_WRONG_GOALS)
        ):
            self._fail(f"has a goal of {value} counts, and was sent {self.goal}")

    def _see_tendon(self, length: float | None, lengthening: float, now_ns: int) -> None:
        """Detect a lost tendon by its length, m, and the rate of change of the length, m/s."""
        if length is not None and length < _SHORTEST_M:
            wound = f"it is wound in by {-1e3 * length:.0f} mm, further than the finger lets it"
            self._fail(f"has lost its tendon: {wound}")
        no_load = self.settings.known.no_load_rad_per_s * self.settings.spool_radius_m
        if -lengthening < _SLACK_SHARE * no_load:
            self._slack_since_ns = None
        elif self._slack_since_ns is None:
            self._slack_since_ns = now_ns
        elif now_ns - self._slack_since_ns >= _SLACK_NS:
            speed = f"it winds in at {-1e3 * lengthening:.0f} mm/s, as without any load"
            self._fail(f"has lost its tendon: {speed}")

    def _lasts(self, sign: str, is_wrong: bool, count: int) -> bool:
        """Return whether a sign of a fault was seen so often in a row."""
        self._wrong[sign] = self._wrong[sign] + 1 if is_wrong else 0
        return self._wrong[sign] >= count

    def _fail(self, reason: str) -> None:
        self.fault = self.fault or f"{self.settings.words} {reason}."
