"""Simulations of chips: levels of a board's outputs, edges of its inputs, and interfaces.

The simulation of a chip is in the same module as its driver. It is plain Python that uses
`shapechanger.contract.world.World`, and runs only on a twin's board.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:  # `world` needs NumPy, which a guard must not load.
    from shapechanger.contract.world import Readings


class Edge(NamedTuple):
    """A change of an input pin."""

    t: int  # Time of the change, ns.
    pin: int  # BCM number.
    level: int  # Level from then on, 0 or 1.


class Pulse(NamedTuple):
    """Servo pulses."""

    us: float  # Width in microseconds; 0 for none.
    hz: float  # Frequency, Hz.


NO_PULSE: Final = Pulse(0.0, 0.0)
"""No pulses."""


class PwmChannel(NamedTuple):
    """A PWM channel of a chip: bus, address of the chip, number of the channel."""

    bus: int
    address: int
    number: int


@dataclass(slots=True)
class Levels:
    """State of all outputs: duty cycles, 0 to 1, and servo pulses, keyed by BCM number or channel.

    `edges_ns` has the time of each pin's last change between low and high, ns, without PWM.
    """

    duties: dict[int, float] = field(default_factory=dict[int, float])
    pulses: dict[int, Pulse] = field(default_factory=dict[int, Pulse])
    channels: dict[PwmChannel, Pulse] = field(default_factory=dict[PwmChannel, Pulse])
    edges_ns: dict[int, int] = field(default_factory=dict[int, int])

    def drive(self, pin: int, duty: float, t: int) -> None:
        """Drive a pin, by its BCM number, with a duty from 0 to 1 from the time `t` on, ns."""
        if duty in (0.0, 1.0) and self.duties.get(pin, 0.0) == 1.0 - duty:
            self.edges_ns[pin] = t
        self.duties[pin] = duty
        self.pulses.pop(pin, None)

    def release(self, pin: int) -> None:
        """Stop driving a pin."""
        self.duties.pop(pin, None)
        self.pulses.pop(pin, None)

    def pulse(self, pin: int, pulse: Pulse) -> None:
        """Send servo pulses on a pin."""
        self.duties[pin] = pulse.us * pulse.hz / 1e6
        self.pulses[pin] = pulse


DutyOf = Callable[[Levels, int], float]
"""Duty cycle of a pin, 0 to 1; resistors determine it for a pin that is not driven."""


class WiredOutput(NamedTuple):
    """State of an output."""

    # Value from -1 to 1, on the scale of its driver; None for a servo or speed controller without
    # pulses or power.
    value: float | None
    at_rest: bool  # Whether it is in the state after a stop; a motor with any duty above 0 is not.


class SimulatedChip:
    """A chip at one address of an I2C bus."""

    is_logged = True  # Whether the ledger records the bytes written to it.

    @property
    def pulses(self) -> Sequence[Pulse]:
        """Pulses of its channels; 0 us for a channel that is off."""
        return ()

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes, starting at a register."""
        raise NotImplementedError

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, starting at a register; a chip without settings ignores them."""


I2cChips = Mapping[tuple[int, int], SimulatedChip]
"""Chips, keyed by bus and address."""


class SimulatedSensor:
    """A sensor at a twin's board; subclasses override the methods that they need."""

    def __init__(self, chips: I2cChips | None = None, levels: dict[int, int] | None = None) -> None:
        self.chips: I2cChips = chips or {}
        self.levels = levels or {}  # Level of each pin that it drives.

    def edges(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        """Return the edges between two times, ns, for the readings `seen` of the world."""
        return []

    def output_changed(self, t: int, pin: int, level: float) -> list[Edge]:
        """Return the edges that an output causes with its new level or duty, 0 to 1."""
        return []
