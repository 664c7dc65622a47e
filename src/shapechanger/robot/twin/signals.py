"""Ledger of the board: all changes of its outputs.

The board writes each change of a pin, pulse or chip to one line of the ledger, as JSON.

Lines have a time `t` in nanoseconds and a kind:

```
pin     pin, duty, hz, pid       an output: its level (hz 0), or the duty of its software PWM
        released: true           the pin is no longer driven: its resistors set its level
pulse   pin, us, hz, pid         servo pulses; 0 us for none
i2c     bus, address, register, data, pid      bytes written to a chip
        bus, address, channel, us, hz          the resulting pulses of a PWM channel
gone    pid                      a process died; the next lines are the levels of its pins
input   pin, level               an edge of a sensor
place   seed                     the operator placed the vehicle at a start
put_back                         the operator put the vehicle back after a collision
course  seed                     the operator replaced the surroundings
fault   detail                   the operator broke or pressed something
```

Each line is written at once, so that a crash leaves at most one broken line, the last.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import msgspec

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.drivers.simulation import Levels, Pulse, PwmChannel


@dataclass(frozen=True, slots=True)
class Transition:
    """One line of the ledger, see the module; None for fields that its kind does not have.

    `pid` is the process that made the change, `pin` a BCM number, `duty` a share of the time from 0
    to 1, `hz` a frequency in Hz, and `us` the width of pulses in microseconds.
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
    detail: str | None = None


def read_ledger(path: str | os.PathLike[str]) -> list[Transition]:
    """Read all complete lines of a ledger, ordered by time.

    Processes stamp their changes, so lines of two processes may be out of order in the file.
    """
    decode = msgspec.json.Decoder(Transition).decode
    transitions: list[Transition] = []
    with translate_errors(
        msgspec.MsgspecError,
        to=lambda error: RobotError(
            f"Line {len(transitions) + 1} of {path} is malformed: {error}."
        ),
    ):
        # After the last newline there is at most a broken line.
        for line in Path(path).read_bytes().split(b"\n")[:-1]:
            transitions.append(decode(line))
    return sorted(transitions, key=lambda transition: transition.t)


def apply(levels: Levels, transition: Transition) -> None:
    """Apply one line of the ledger."""
    pin, us, hz = transition.pin, transition.us, transition.hz
    if transition.kind == "pin" and pin is not None:
        if transition.released or transition.duty is None:
            levels.release(pin)
        else:
            levels.drive(pin, transition.duty, transition.t)
    elif us is None or hz is None:
        return
    elif transition.kind == "pulse" and pin is not None:
        levels.pulse(pin, Pulse(us, hz))
    elif transition.kind == "i2c":
        bus, address, channel = transition.bus, transition.address, transition.channel
        if bus is not None and address is not None and channel is not None:
            levels.channels[PwmChannel(bus, address, channel)] = Pulse(us, hz)
