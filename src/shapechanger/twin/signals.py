"""The ledger: each change of a pin, pulse or chip on a line of its own, written by the board.

The kinds of lines, each with its time `t` in nanoseconds:

```
pin     pin, duty, hz, pid       an output: its level (hz 0), or the duty of its software PWM
        released: true           nobody drives the pin: its resistors give it its level
pulse   pin, us, hz, pid         servo pulses; 0 us for none
i2c     bus, address, register, data, pid      what was written to a chip
        bus, address, channel, us, hz          what that makes of a PWM channel
gone    pid                      a process died; lines with the levels that its pins keep follow
input   pin, level               an edge of a sensor
place   seed                     the operator put the vehicle at a start
put_back                         the operator put the vehicle back after a collision
course  seed                     the operator put other surroundings around it
fault   what                     the operator broke or pressed something
```

Each line is written in one go, so that a crash leaves whole lines and one broken one at most.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

from shapechanger.errors import RobotError

__all__ = [
    "Ledger",
    "LedgerWriter",
    "Levels",
    "NoLedger",
    "Pulse",
    "PwmChannel",
    "Transition",
    "read_ledger",
]


@dataclass(frozen=True, slots=True)
class Transition:
    """One line of the ledger; what a kind does not have is None.

    Attributes:
        t: When, in nanoseconds of the run's clock.
        kind: What it is, see the module.
        pid: Process that did it.
        pin: BCM number.
        duty: Share of the time at which the pin is high, 0 to 1.
        hz: How many periods a second.
        us: Width of the pulses in microseconds; 0 for none.
        bus: Number of the I2C bus.
        address: Address on that bus.
        channel: PWM channel of that chip.
        register: First register of a write.
        data: Bytes of a write.
        level: Level of an input.
        released: Whether nobody drives the pin.
        seed: Of a start.
        what: What the operator did.
    """

    t: int
    kind: str
    pid: int | None = None
    pin: int | None = None
    duty: float | None = None
    hz: float | None = None
    us: float | None = None
    bus: int | None = None
    address: int | None = None
    channel: int | None = None
    register: int | None = None
    data: tuple[int, ...] | None = None
    level: int | None = None
    released: bool = False
    seed: int | None = None
    what: str | None = None


_FIELDS: Final = frozenset(Transition.__slots__)


class Ledger(Protocol):
    """Where changes are written down."""

    def write(self, t: int, kind: str, **fields: Any) -> None:
        """Write down a change."""
        ...

    def close(self) -> None:
        """Write nothing any more."""
        ...


class NoLedger:
    """Forgets everything, for a board whose pins nobody judges."""

    def write(self, t: int, kind: str, **fields: Any) -> None:
        """Forget a change."""

    def close(self) -> None:
        """Do nothing."""


class LedgerWriter:
    """Appends lines.

    Args:
        path: The file; it is made, and must not be there yet.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_EXCL, 0o644)
        self._encoder = json.JSONEncoder(allow_nan=False)

    def write(self, t: int, kind: str, **fields: Any) -> None:
        """Append a line; it is with the kernel when this returns."""
        line = self._encoder.encode({"t": t, "kind": kind, **fields}) + "\n"
        os.write(self._fd, line.encode())

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)


def read_ledger(path: str | os.PathLike[str]) -> list[Transition]:
    """All whole lines of a ledger, in the order of their times.

    Processes stamp what they do, so that lines of two of them can be in the file out of order.

    Raises:
        RobotError: If a line other than a broken last one is no transition.
    """
    text = Path(path).read_text(encoding="utf-8")
    lines = text.split("\n")[:-1]  # What follows the last newline is broken, or nothing.
    transitions = [_read(line, number, path) for number, line in enumerate(lines, 1)]
    return sorted(transitions, key=lambda transition: transition.t)


def _read(line: str, number: int, path: str | os.PathLike[str]) -> Transition:
    try:
        fields = json.loads(line)
        if "data" in fields:
            fields["data"] = tuple(fields["data"])
        return Transition(**{key: fields[key] for key in fields if key in _FIELDS})
    except (ValueError, TypeError) as error:
        raise RobotError(f"Line {number} of {path} is no transition: {error}.") from error


class Pulse(NamedTuple):
    """Servo pulses.

    Attributes:
        us: Their width in microseconds; 0 for none.
        hz: How many come a second.
    """

    us: float
    hz: float


class PwmChannel(NamedTuple):
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
    channels: dict[PwmChannel, Pulse] = field(default_factory=dict[PwmChannel, Pulse])
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
                self.channels[PwmChannel(bus, address, channel)] = Pulse(us, hz)
