"""What the guard senses, and what it makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["ESTIMATED", "Senses", "Sensing"]

ESTIMATED = "estimated"
"""Source of a quantity that follows from what is commanded."""


@dataclass(frozen=True, slots=True)
class Sensing:
    """What the sensors said in one round.

    Attributes:
        quantities: What was measured, by name and in SI units; see `GuardState.quantities`.
        sources: Name of the sensor behind each quantity.
        failures: Why a sensor did not answer, in words, by its name.
        slow: Sensors that took too long, among those that failed.
        silent: Distance sensors that answered, but know no distance.
    """

    quantities: Mapping[str, float] = field(default_factory=dict[str, float])
    sources: Mapping[str, str] = field(default_factory=dict[str, str])
    failures: Mapping[str, str] = field(default_factory=dict[str, str])
    slow: frozenset[str] = frozenset()
    silent: frozenset[str] = frozenset()


class Senses:
    """The newest sensing, completed by what is concluded from it.

    Attributes:
        quantities: By name and in SI units; what nothing measures and nothing implies is absent.
        sources: Name of the sensor behind each, or "estimated".
    """

    def __init__(self) -> None:
        self.quantities: dict[str, float] = {}
        self.sources: dict[str, str] = {}

    def complete(
        self, sensing: Sensing, *, speed: float | None, stalled: bool, watches_stall: bool
    ) -> None:
        """Take in a sensing.

        Args:
            sensing: What the sensors said.
            speed: What the speed should be, m/s, for where it is not measured; None for unknown.
            stalled: Whether the robot pushes without moving.
            watches_stall: Whether that would be noticed.
        """
        self.quantities = dict(sensing.quantities)
        self.sources = dict(sensing.sources)
        if watches_stall:
            self._add("stall", float(stalled), self.sources["speed"])
        if "speed" not in self.quantities and speed is not None:
            self._add("speed", speed, ESTIMATED)
        self._conclude_collision()

    def _conclude_collision(self) -> None:
        """A bumper is certain; a stall is the last thing that tells."""
        signs = [name for name in ("bump", "stall") if name in self.quantities]
        if not signs:
            return
        sign = next((name for name in signs if self.quantities[name] > 0.0), signs[0])
        source = ESTIMATED if sign == "stall" else self.sources[sign]
        self._add("collision", float(self.quantities[sign] > 0.0), source)

    def _add(self, name: str, value: float, source: str) -> None:
        self.quantities[name], self.sources[name] = value, source
