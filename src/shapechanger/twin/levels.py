"""What all outputs of a board do at one moment."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from shapechanger.twin.ledger import Transition

__all__ = ["Channel", "Levels", "Pulse"]


class Pulse(NamedTuple):
    """Servo pulses.

    Attributes:
        us: Their width in microseconds; 0 for none.
        hz: How many come a second.
    """

    us: float
    hz: float


class Channel(NamedTuple):
    """One PWM channel of a chip."""

    bus: int
    address: int
    number: int


@dataclass(slots=True)
class Levels:
    """The levels of the pins, and the pulses on pins and channels.

    Attributes:
        duties: Share of the time at which a driven pin is high; without the pins that nobody
            drives.
        pulses: Servo pulses by pin.
        channels: Pulses by channel of a chip.
        edges_ns: When a pin last changed between low and high, without PWM.
    """

    duties: dict[int, float] = field(default_factory=dict[int, float])
    pulses: dict[int, Pulse] = field(default_factory=dict[int, Pulse])
    channels: dict[Channel, Pulse] = field(default_factory=dict[Channel, Pulse])
    edges_ns: dict[int, int] = field(default_factory=dict[int, int])

    def drive(self, pin: int, duty: float, t: int) -> None:
        """A process drives a pin."""
        if duty in (0.0, 1.0) and self.duties.get(pin, 0.0) == 1.0 - duty:
            self.edges_ns[pin] = t
        self.duties[pin] = duty
        self.pulses.pop(pin, None)

    def release(self, pin: int) -> None:
        """Nobody drives a pin any more."""
        self.duties.pop(pin, None)
        self.pulses.pop(pin, None)

    def pulse(self, pin: int, pulse: Pulse) -> None:
        """A process sends servo pulses on a pin."""
        self.duties[pin] = pulse.us * pulse.hz / 1e6
        self.pulses[pin] = pulse

    def apply(self, transition: Transition) -> None:
        """Follow one line of the ledger."""
        pin, us, hz = transition.pin, transition.us, transition.hz
        if transition.kind == "pin" and pin is not None:
            if transition.released or transition.duty is None:
                self.release(pin)
            else:
                self.drive(pin, transition.duty, transition.t)
        elif us is None or hz is None:
            return
        elif transition.kind == "pulse" and pin is not None:
            self.pulse(pin, Pulse(us, hz))
        elif transition.kind == "i2c":
            bus, address, channel = transition.bus, transition.address, transition.channel
            if bus is not None and address is not None and channel is not None:
                self.channels[Channel(bus, address, channel)] = Pulse(us, hz)
