"""One servo of a bus with its tendon: its registers, its goals, and the detection of its faults."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, Protocol

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.settings import (
    COUNTS_PER_TURN,
    ROUNDING,
    TRIPPED,
    WATCHDOG_STEP_MS,
    BusSettings,
    ServoSettings,
)
from shapechanger.robot.hardware import ServoReply


class ServoPort(Protocol):
    """Port of a servo bus, serial or simulated; methods raise RobotError if the bus is lost."""

    has_stray: bool  # Whether a late answer was found before a request; the reader resets it.

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read bytes of several servos; return the replies, keyed by id, without silent servos."""
        ...

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write bytes of several servos without a reply, or of one and return its reply, if any."""
        ...

    def close(self) -> None:
        """Close the port."""


# A single lost packet must not keep a rig from starting. Cycles never retry.
_TRIES: Final = 3
_REFUSALS: Final = {
    1: "it could not do it",
    2: "it does not know the instruction",
    3: "the packet was damaged on its way",
    4: "the value is out of range",
    5: "the value has the wrong length",
    6: "the value is beyond a limit",
    7: "the register cannot be written now",
}
# Distance from the position to the goal of a servo that pulls in position mode, counts.
_AHEAD: Final = 1024
# Missed cycles in a row that make a fault.
_MOST_MISSED: Final = 5
# Consecutive cycles with a wrong voltage or temperature that make a fault.
_BELIEVED_CYCLES: Final = 3
# Margin below the model's temperature limit from which a servo is too hot, K.
_MARGIN_C: Final = 5.0
# Wrong goals in a row that make a fault: a single goal may be lost, and the next one replaces it.
_MAX_WRONG_GOALS: Final = 2
# Length from the zero, m, that a tendon cannot reach in an intact finger. Chosen: the longest
# excursion of a finger's tendon is 42 mm.
_SHORTEST_M: Final = -0.06
# A tendon counts as lost if it winds in at this fraction of the speed without load for this time.
_SLACK_SHARE: Final = 0.7
_SLACK_NS: Final = 100_000_000


class TendonServo:
    """One servo of a bus with its tendon.

    There are two signs of a tendon that has snapped or come off. A tendon that is wound in further
    than the finger allows is certainly lost, at any tension, but this needs a zero. A servo that
    winds in nearly as fast as without load is an earlier sign, but only if its current clearly
    exceeds the friction of the gears. A tendon that snaps while its servo stands still at the
    pretension is detected at the next pull.
    """

    port: ServoPort  # Port of the bus, once it is open.

    def __init__(self, settings: ServoSettings, bus: BusSettings) -> None:
        self.settings = settings
        self._bus = bus
        self._model = settings.known
        self._family = self._model.family
        self.zero: int | None = None  # Position at the tendon's zero, counts; None if unknown.
        self.position = 0  # Position, as last read, counts.
        self.goal = 0  # The last sent goal, counts; see `ServoFamily`.
        self.tension = settings.pretension_n  # Requested tension, N.
        self.length: float | None = None  # Requested length beyond the zero, m; None for tension.
        self.stopped_at_n = 0.0  # Tension from which a stop ramps down, N.
        self.clear()

    def clear(self) -> None:
        """Clear the fault."""
        self._slack_since_ns: int | None = None
        self._wrong: Counter[str] = Counter()
        self._was_late = False
        self.fault = ""  # First fault, as a sentence.
        self.missed = 0  # Cycles in a row without an answer.

    def request(self, tension: float, length: float | None = None) -> None:
        """Request a tension, N; or a length beyond the zero, m, with the tension as its limit."""
        servo = self.settings
        if not math.isfinite(tension) or not math.isfinite(length or 0.0):
            raise RobotError(f"{servo.label} cannot pull {tension} N to a length of {length} m.")
        self.tension = min(max(tension, servo.pretension_n), servo.most_tension_n)
        self.length = length

    def goal_of(self, tension: float) -> int:
        """Return the goal for a tension, N, in counts, rounded towards slack and at most the limit.

        Its sign winds the tendon in; for control of the length it is an unsigned limit.
        """
        servo = self.settings
        # Clip first: the quotient of a huge number could overflow to infinity.
        kept = min(max(tension, 0.0), servo.most_tension_n)
        counts = min(math.floor(kept / servo.newton_per_goal + ROUNDING), servo.most_counts)
        return counts if servo.control == "length" else servo.direction * counts

    @property
    def goal_n(self) -> float:
        """Tension of the goal, N."""
        return abs(self.goal) * self.settings.newton_per_goal

    @property
    def goal_position(self) -> int:
        """Goal of the position, in counts, for control of the length."""
        servo = self.settings
        if self.length is None or self.zero is None:
            return self.position + servo.direction * _AHEAD
        kept = min(max(self.length, servo.shortest_m), servo.longest_m)
        return self.zero + round(kept / servo.metre_per_count)

    def ramp_n(self, left: float) -> float:
        """Return the tension during a stop, N, with a share of the ramp left, 1 to 0."""
        if self.fault:
            return 0.0  # A faulty servo releases at once, while the others ramp down.
        start = self.stopped_at_n
        end = min(self.settings.pretension_n, start)  # A slack tendon is not pulled.
        return end + left * (start - end)

    def find(self, name: str, alive: Callable[[], object] = lambda: None) -> int | None:
        """Read a register; None if the servo does not answer in three attempts.

        `alive` is called before each attempt.
        """
        one = self._family[name]
        ask = partial(self.port.read, [self.settings.id], one.address, one.size)
        data = self._ask(ask, f"read its {one.name}", alive)
        return None if data is None else one.decode(data)

    def read(self, name: str) -> int:
        """Read a register; raise RobotError if the servo does not answer or refuses."""
        if (value := self.find(name)) is None:
            raise RobotError(f"{self.settings.label} does not answer.")
        return value

    def write(self, name: str, value: int) -> None:
        """Write a register; raise RobotError if the servo does not confirm it or refuses."""
        one = self._family[name]
        ask = partial(self.port.write, {self.settings.id: one.encode(value)}, one.address)
        if self._ask(ask, f"set its {one.name} to {value}") is None:
            raise RobotError(f"{self.settings.label} does not answer.")

    def _ask(
        self,
        ask: Callable[[], Mapping[int, ServoReply]],
        doing: str,
        alive: Callable[[], object] = lambda: None,
    ) -> bytes | None:
        for _ in range(_TRIES):
            alive()
            if reply := ask().get(self.settings.id):
                if number := reply.error & self._family.refused:
                    why = _REFUSALS.get(number, f"it gives the unknown reason {number}")
                    raise RobotError(f"{self.settings.label} refuses to {doing}: {why}.")
                return reply.data
        return None

    def check_model(self, number: int | None) -> None:
        """Check the model number and the version of the firmware."""
        text, known = self.settings.label, self._model
        if number != known.number:
            wrong = f"its model number is {number}, not {known.number}"
            raise RobotError(f"{text} is not an {known.name}: {wrong}.")
        if (firmware := self.read("firmware")) < known.least_firmware:
            needed = f"its own watchdog needs {known.least_firmware} or newer"
            raise RobotError(f"{text} has firmware {firmware}; {needed}.")

    def prepare(self) -> None:
        """Set the mode and the limit of the goal, without torque and with a goal of 0."""
        family, servo = self._family, self.settings
        self.write("torque_enable", 0)
        self.write("mark", 0)  # A tripped watchdog blocks all goals.
        if error := self.read("hardware_error"):
            raise RobotError(
                f"{servo.label} has switched itself off: {family.errors_as_text(error)}. Only a "
                "reboot gives it torque again, after which its zero must be found again."
            )
        values = {name: one.value for name, one in family.registers.items()}
        values |= {"mode": family.modes[servo.control], "most": servo.most_counts}
        if "lock" in values:
            self.write("lock", 0)
        for name, value in values.items():
            if value is None:
                continue
            # These are in the EEPROM, which wears out: write them only if they differ.
            found, one = self.read(name), family[name]
            if (wanted := found & one.kept_bits | value) != found:
                self.write(name, wanted)
                if self.read(name) != wanted:  # Some families ignore a write without refusing it.
                    raise RobotError(f"{servo.label} does not keep {wanted} as {one.name}.")
        if "lock" in values:
            self.write("lock", 1)
        self._set_mark()

    def hold(self) -> None:
        """Enable the torque, with a goal of zero tension."""
        self.goal = 0
        self.write("mark", 0)
        self._set_mark()
        if self.settings.control == "length":  # Otherwise an old goal might turn the servo.
            self.position = self.read("position")
            self.write("goal_position", self.position)
        self.write("torque_enable", 1)

    def _set_mark(self) -> None:
        """Set the goal to 0, and set `mark`, which detects a restart and starts a watchdog."""
        # A change of mode sets the goal to its limit.
        self.write("goal", 0)
        steps = self._bus.watchdog_ms // WATCHDOG_STEP_MS
        self.write("mark", steps if self._family.has_watchdog else 254)

    def set_zero(self, *, knows_turns: bool) -> None:
        """Set the zero from the settings, shifted by whole turns if the servo lost its turns."""
        away = 0 if knows_turns else self.read("position") - self.settings.zero
        self.zero = self.settings.zero + round(away / COUNTS_PER_TURN) * COUNTS_PER_TURN

    def miss(self, *, late: bool) -> None:
        """Count a cycle without an answer."""
        self.missed += 1
        self._was_late |= late
        if self.missed >= _MOST_MISSED:
            how = "answers too late" if self._was_late else "does not answer"
            self._fail(f"{how}, {self.missed} cycles in a row")

    def see(self, data: bytes, now_ns: int, *, pulls: bool) -> dict[str, float]:
        """Evaluate the block of present values of a servo, with or without torque.

        Return "length" beyond the zero, m, if it has a zero; "speed", m/s, positive while the
        tendon gets longer; and "tension", N, without the gears' friction and at least 0.
        """
        self.missed, self._was_late = 0, False
        servo, model, family = self.settings, self._model, self._family
        current, speed, self.position, voltage, degrees = (
            family[name].decode(data, family[name].address - family["present"].address)
            for name in ("current", "speed", "position", "voltage", "temperature")
        )
        volts, most_c = voltage * 0.1, model.most_c - _MARGIN_C
        if self._lasts("voltage", not model.least_v <= volts <= model.most_v, _BELIEVED_CYCLES):
            self._fail(f"has {volts:.1f} V, and needs {model.least_v:g} to {model.most_v:g} V")
        if self._lasts("heat", degrees > most_c, _BELIEVED_CYCLES):
            self._fail(f"has {degrees:.0f} C, more than {most_c:g} C")
        torque = model.torque_constant * model.ampere_per_count * current
        seen: dict[str, float] = {}
        if self.zero is not None:
            seen["length"] = (self.position - self.zero) * servo.metre_per_count
        seen["speed"] = -servo.lever_m * speed * family.rad_per_s
        seen["tension"] = max(torque / servo.lever_m, 0.0)
        if pulls:
            self._see_tendon(seen.get("length", 0.0), seen["speed"], now_ns)
        return seen

    def audit(self, name: str, value: int, *, pulls: bool) -> None:
        """Evaluate a register that shows whether a servo, which should pull or not, obeys."""
        if name == "hardware_error" and value:
            error = self._family.errors_as_text(value)
            self._fail(f"has switched itself off: {error}. Only a reboot gives it torque again")
        elif name == "mark" and self._family.has_watchdog and value == TRIPPED:
            silence = f"it received nothing for {self._bus.watchdog_ms} ms"
            self._fail(f"was stopped by its own watchdog: {silence}")
        elif name == "mark" and value == 0:
            self.zero = None
            self._fail("has restarted, for example after a dip of its power, and lost its zero")
        elif name == "torque_enable" and pulls and value == 0:
            self._fail("has let go by itself")
        elif name == "goal" and pulls and self._lasts(name, value != self.goal, _MAX_WRONG_GOALS):
            self._fail(f"has a goal of {value} counts, and was sent {self.goal}")

    def _see_tendon(self, length: float, lengthening: float, now_ns: int) -> None:
        """Detect a lost tendon from its length, m, and the rate of change of the length, m/s."""
        if length < _SHORTEST_M:
            wound = f"it is wound in by {-1e3 * length:.0f} mm, further than the finger allows"
            self._fail(f"has lost its tendon: {wound}")
        no_load = self._model.no_load_rad_per_s * self.settings.spool_radius_m
        if -lengthening < _SLACK_SHARE * no_load:
            self._slack_since_ns = None
        elif self._slack_since_ns is None:
            self._slack_since_ns = now_ns
        elif now_ns - self._slack_since_ns >= _SLACK_NS:
            speed = f"it winds in at {-1e3 * lengthening:.0f} mm/s, as without any load"
            self._fail(f"has lost its tendon: {speed}")

    def _lasts(self, sign: str, is_wrong: bool, count: int) -> bool:
        """Return whether a sign of a fault was seen in enough consecutive checks."""
        self._wrong[sign] = self._wrong[sign] + 1 if is_wrong else 0
        return self._wrong[sign] >= count

    def _fail(self, reason: str) -> None:
        self.fault = self.fault or f"{self.settings.label} {reason}."
