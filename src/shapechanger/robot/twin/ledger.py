"""Ledger of the board: all changes of its outputs, and the search for motion without permission.

The board writes each change of a pin, pulse or chip to one line of the ledger, as JSON.

Lines have a time `t` in nanoseconds and a kind:

```
pin     pin, duty, hz, pid       an output: its level (hz 0), or the duty of its software PWM
        released: true           the pin is no longer driven: its resistors set its level
pulse   pin, us, hz, pid         servo pulses; 0 us for none
i2c     bus, address, register, data, pid      bytes written to a chip, except for encoders
        bus, address, channel, us, hz          the resulting pulses of a PWM channel
gone    pid                      a process died; the next lines have the levels of its pins
input   pin, level               an edge of a sensor or of the emergency button
place   seed                     the operator placed the vehicle at a start
put_back                         the operator put the vehicle back after a collision
course  seed                     the operator replaced the surroundings
fault   detail                   the operator broke, repaired, pressed or released something
```

Each line is written at once, so that a crash leaves at most one broken line, the last.

`TwinWiring` computes the value of each output from the levels of pins and pulses, which is the
inverse of the output's driver. Its plan may differ from the served plan: if two pins are swapped
only in the served profile, the wrong motor turns.

Whether a robot moved without permission is decided from the ledger, the wiring and the times at
which the robot was permitted to move, without data from the robot's own programs.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from shapechanger.contract.plan import GuardPlan, OutputPlan, driven_pins
from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.drivers.chip import OUTPUTS
from shapechanger.robot.drivers.simulation import Levels, Pulse, PwmChannel, WiredOutput


@dataclass(frozen=True, slots=True)
class Transition:
    """One line of the ledger, see the module. Fields that its kind does not have are None.

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

    Each process sets the times of its changes, so the file may have lines out of order.
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


def _apply(levels: Levels, transition: Transition) -> None:
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


ONE_SHOT_MS: Final = 100.0
"""Time, ms, for which the enable line's one-shot keeps the motors' power on after an edge."""


class TwinWiring:
    """Wiring of a robot; a one-shot, if any, keeps the power on for `one_shot_ms` after an edge."""

    def __init__(self, plan: GuardPlan, one_shot_ms: float | None = ONE_SHOT_MS) -> None:
        self.plan = plan
        has_one_shot = plan.enable_pin is not None and one_shot_ms is not None
        self._one_shot_ns = int((one_shot_ms or 0.0) * 1e6) if has_one_shot else None
        keys = (one.settings for one in plan.outputs if one.settings.get("over") == "pca9685")
        self._high = {one["output_enable"] for one in keys if one.get("output_enable", -1) >= 0}
        self._low = driven_pins(plan).keys()
        self._states = {output.name: self._state(output) for output in plan.outputs}
        self.outputs: Mapping[str, OutputPlan] = {output.name: output for output in plan.outputs}
        ahead = {action.name for action in plan.actions if action.propels}
        self.propelling = tuple(
            one.name for one in plan.outputs if any(one.mix.get(name) for name in ahead)
        )

    def idle_level(self, pin: int) -> int:
        """Return the level of an undriven pin.

        The hardware guide requires pull-downs on all outputs, and a pull-up on the output enable of
        a PCA9685, which is active low.
        """
        return int(pin in self._high)

    def has_resistor(self, pin: int) -> bool:
        """Return whether an external resistor sets the level of an undriven pin."""
        return pin in self._high or pin in self._low

    def power_ends_ns(self, levels: Levels) -> int | None:
        """Return when the one-shot cuts the power, ns: 0 before any edge; None without one."""
        if self._one_shot_ns is None or self.plan.enable_pin is None:
            return None
        edge_ns = levels.edges_ns.get(self.plan.enable_pin)
        return 0 if edge_ns is None else edge_ns + self._one_shot_ns

    def has_power(self, levels: Levels, now_ns: int) -> bool:
        """Return whether the motors have power, which a one-shot may have cut."""
        ends_ns = self.power_ends_ns(levels)
        return ends_ns is None or now_ns < ends_ns

    def read(self, levels: Levels, now_ns: int) -> dict[str, WiredOutput]:
        """Return the state of each output at a time, ns, keyed by name."""
        powered = self.has_power(levels, now_ns)
        return {
            name: (None if powered else OUTPUTS[self.outputs[name].driver].unpowered)
            or state(levels)
            for name, state in self._states.items()
        }

    def _state(self, plan: OutputPlan) -> Callable[[Levels], WiredOutput]:
        """Return a function that reads the state of an output, ignoring the motors' power."""
        mixed = sum(one.rest * plan.mix.get(one.name, 0.0) for one in self.plan.actions)
        rest = max(-1.0, min(1.0, plan.offset + mixed))
        return OUTPUTS[plan.driver].wire(plan, rest, self._duty)

    def _duty(self, levels: Levels, pin: int) -> float:
        return levels.duties.get(pin, float(self.idle_level(pin)))


class Interval(NamedTuple):
    """A time interval in which an output was not at rest."""

    output: str
    start_ns: float
    end_ns: float  # Infinite if it does not end.
    value: float  # Value with the largest magnitude; 0 if unknown.


def propelled(ledger: Iterable[Transition], wiring: TwinWiring) -> list[Interval]:
    """Return the intervals in which a propelling output was not at rest.

    The value of a pin with PWM is its duty. After the last line, the levels remain, but the
    one-shot of the enable line may still cut the power.
    """
    found: list[Interval] = []
    running: dict[str, Interval] = {}
    for t, outputs in _moments(ledger, wiring):
        for name in wiring.propelling:
            value, at_rest = outputs[name]
            if not at_rest:
                since = running.get(name, Interval(name, t, math.inf, 0.0))
                running[name] = since._replace(value=max(since.value, value or 0.0, key=abs))
            elif name in running:
                found.append(running.pop(name)._replace(end_ns=t))
    found.extend(running.values())
    return [interval for interval in found if interval.end_ns > interval.start_ns]


def unauthorised(
    ledger: Iterable[Transition],
    wiring: TwinWiring,
    permitted: Iterable[tuple[float, float]],
) -> list[Interval]:
    """Return the intervals in which a propelling output was not at rest without permission.

    `permitted` has the start and end, ns, of each interval in which the robot may move, for example
    from the arrival of a command to its deadline. The `ledger` must be ordered by time.
    """
    never = (math.inf, math.inf)
    permits = [*sorted(permitted), never]
    found: list[Interval] = []
    for interval in propelled(ledger, wiring):
        at_ns = interval.start_ns
        for start_ns, end_ns in permits:
            gap = interval._replace(start_ns=at_ns, end_ns=min(start_ns, interval.end_ns))
            if gap.end_ns > gap.start_ns:
                found.append(gap)
            at_ns = max(at_ns, end_ns)
    return found


def time_to_rest(ledger: Iterable[Transition], wiring: TwinWiring, fault_ns: int) -> float:
    """Return the time, s, from a fault until all propelling outputs are permanently at rest.

    It is 0 if they stayed at rest from the fault on, and infinite if one never comes to rest.
    """
    ends = [interval.end_ns for interval in propelled(ledger, wiring)]
    return max(0.0, max(ends, default=0.0) - fault_ns) / 1e9


def _moments(
    ledger: Iterable[Transition], wiring: TwinWiring
) -> Iterator[tuple[int, dict[str, WiredOutput]]]:
    """Yield the states of the outputs after each transition and at the end of the one-shot."""
    levels = Levels()
    for line in (*ledger, None):
        ends_ns = wiring.power_ends_ns(levels)
        if ends_ns is not None and (line is None or ends_ns < line.t):
            yield ends_ns, wiring.read(levels, ends_ns)
        if line is not None:
            _apply(levels, line)
            yield line.t, wiring.read(levels, line.t)
