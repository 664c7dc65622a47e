"""Finds the zero of each tendon: pull gently until nothing moves."""

from __future__ import annotations

from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.health import BusState, length_per_count
from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings

__all__ = ["Homing"]

# Chosen: half a percent of the longest excursion of a finger's tendon.
_STILL_M: Final = 0.2e-3


class _Tendon:
    def __init__(self, servo: ServoSettings, position: int, now_ns: int) -> None:
        self.servo = servo
        self.start = self.position = self._reference = position
        self.still_since_ns = now_ns

    def see(self, position: int, now_ns: int) -> None:
        self.position = position
        step = abs(length_per_count(self.servo))
        if abs(position - self._reference) * step > _STILL_M:
            self._reference, self.still_since_ns = position, now_ns

    @property
    def wound_m(self) -> float:
        return -(self.position - self.start) * length_per_count(self.servo)


class Homing:
    """All tendons at once, so that they hold the finger against each other in a known posture.

    Who uses it gives `tensions` to the bus in each cycle, and the state to `see`, until `zeros` are
    there or `failure` says why not. Tendons that were slack take up their slack meanwhile.

    Args:
        settings: The bus.
        still_ms: How long nothing may have moved.
        within_ms: How long it may take.
        travel_m: How far a tendon may be wound in, m.

    Attributes:
        zeros: Position of each servo at the zero of its tendon, in counts, by name; None before.
        failure: Why there is no zero, as a sentence; empty otherwise.

    Raises:
        RobotError: If a servo's gears would hold against what it pulls: it would stand still at
            once, with its tendon slack.
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
            friction, pull = servo.friction_n, servo.homing_tension_n
            if friction is not None and pull <= friction:
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
        """What each tendon pulls now, N."""
        if self.failure:
            return {name: servo.pretension_n for name, servo in self._servos.items()}
        return {name: servo.homing_tension_n for name, servo in self._servos.items()}

    def see(self, state: BusState) -> None:
        """Take in what the bus says after a cycle."""
        if self.failure or self.zeros is not None:
            return
        now_ns = state.at_ns
        if self._since_ns is None:
            self._since_ns = now_ns
        for name, said in state.servos.items():
            if name not in self._tendons:
                self._tendons[name] = _Tendon(self._servos[name], said.position, now_ns)
            self._tendons[name].see(said.position, now_ns)
        self.failure = self._why_not(state)
        if not self.failure and self._is_still(now_ns):
            self.zeros = {name: one.position for name, one in self._tendons.items()}

    def _is_still(self, now_ns: int) -> bool:
        return len(self._tendons) == len(self._servos) and all(
            now_ns - one.still_since_ns >= self._still_ns for one in self._tendons.values()
        )

    def _why_not(self, state: BusState) -> str:
        if state.faults:
            return f"No zero: {state.reason}"
        for one in self._tendons.values():
            if one.wound_m > self._travel_m:
                words = f"it was wound in by {1e3 * one.wound_m:.0f} mm and met nothing"
                return f"{one.servo.words} has no zero: {words}. Its tendon has come off."
        if self._since_ns is not None and state.at_ns - self._since_ns > self._within_ns:
            moving = [
                servo.name
                for name, servo in self._servos.items()
                if name not in self._tendons
                or state.at_ns - self._tendons[name].still_since_ns < self._still_ns
            ]
            seconds = self._within_ns / 1e9
            return f"No zero: {', '.join(moving)} still moved after {seconds:g} s."
        return ""
