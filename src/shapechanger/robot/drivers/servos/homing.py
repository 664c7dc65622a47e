"""Find the zero of each tendon by pulling gently until nothing moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.health import BusState
from shapechanger.robot.drivers.servos.settings import BusSettings

# Chosen: half a percent of the longest excursion of a finger's tendon.
_STILL_M: Final = 0.2e-3


@dataclass(slots=True)
class _Tendon:
    """Positions of a servo: first, present, and where it was when it last moved, in counts."""

    start: int
    position: int
    reference: int
    still_since_ns: int


class Homing:
    """Homing of all tendons at once, so that they hold the finger in a known posture.

    In each cycle send `tensions` to the bus and pass its state to `see`, until there are `zeros`,
    or a `failure`. Slack tendons are taken up meanwhile.

    Args:
        settings: The bus.
        still_ms: Time for which no servo may move, ms.
        within_ms: Time limit, ms.
        travel_m: Limit of winding in, m.

    Attributes:
        zeros: Position of each servo at the zero of its tendon, in counts, by name; None before.
        failure: Reason why there are no zeros, as a sentence; empty without one.

    Raises:
        RobotError: If the gears' measured friction of a servo is above its homing tension: it would
            stand still at once, with its tendon slack.
    """

    def __init__(
        self,
        settings: BusSettings,
        *,
        still_ms: int = 300,
        within_ms: int = 10_000,
        travel_m: float = 0.06,
    ) -> None:
        for servo in settings.servos:
            gears, pull = servo.known.gears, servo.homing_n
            friction = gears.friction_nm / servo.spool_radius_m
            if gears.is_measured and pull <= friction:
                raise RobotError(
                    f"{servo.words} cannot find its zero with {pull:g} N: its gears hold against "
                    f"about {friction:.1f} N. Set homing_n, to {1.5 * friction:.1f} N for example."
                )
        self._servos = {servo.name: servo for servo in settings.servos}
        self._still_ns = still_ms * 1_000_000
        self._within_ns = within_ms * 1_000_000
        self._travel_m = travel_m
        self._since_ns: int | None = None
        self._tendons: dict[str, _Tendon] = {}
        self.zeros: dict[str, int] | None = None
        self.failure = ""

    @property
    def tensions(self) -> dict[str, float]:
        """Tension to send for each tendon, N."""
        failed, servos = bool(self.failure), self._servos.items()
        return {name: one.pretension_n if failed else one.homing_n for name, one in servos}

    def see(self, state: BusState) -> None:
        """Evaluate the state of the bus after a cycle."""
        if self.failure or self.zeros is not None:
            return
        now_ns = state.at_ns
        if self._since_ns is None:
            self._since_ns = now_ns
        for name, reading in state.servos.items():
            at, step = reading.position, abs(self._servos[name].metre_per_count)
            one = self._tendons.setdefault(name, _Tendon(at, at, at, now_ns))
            one.position = at
            if abs(at - one.reference) * step > _STILL_M:
                one.reference, one.still_since_ns = at, now_ns
        self.failure = self._find_failure(state)
        if not self.failure and not self._moving(now_ns):
            self.zeros = {name: one.position for name, one in self._tendons.items()}

    def _moving(self, now_ns: int) -> list[str]:
        """Return the tendons that have not been still for long enough."""
        return [
            name
            for name in self._servos
            if name not in self._tendons
            or now_ns - self._tendons[name].still_since_ns < self._still_ns
        ]

    def _find_failure(self, state: BusState) -> str:
        if state.faults:
            return f"No zero: {state.reason}"
        for name, one in self._tendons.items():
            servo = self._servos[name]
            wound_m = (one.start - one.position) * servo.metre_per_count
            if wound_m > self._travel_m:
                words = f"it was wound in by {1e3 * wound_m:.0f} mm and met nothing"
                return f"{servo.words} has no zero: {words}. Its tendon has come off."
        if self._since_ns is not None and state.at_ns - self._since_ns > self._within_ns:
            moving, seconds = self._moving(state.at_ns), self._within_ns / 1e9
            return f"No zero: {', '.join(moving)} still moved after {seconds:g} s."
        return ""
