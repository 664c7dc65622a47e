"""What the bus knows after a cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

__all__ = ["BusState", "Mode", "ServoState"]

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
