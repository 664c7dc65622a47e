"""Judge from the ledger alone whether a robot moved without permission.

The inputs are the ledger, the wiring and the arrival times of commands, but nothing from the
robot's own programs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from shapechanger.robot.drivers.simulation import Levels, WiredOutput
from shapechanger.robot.twin.signals import Transition, apply
from shapechanger.robot.twin.wiring import TwinWiring


class ExpectedCommand(NamedTuple):
    """A command that the robot was to obey.

    Attributes:
        arrival_ns: Arrival, on the ledger's clock.
        ttl_ms: Time to live, ms; the deadline applies if it is shorter.
    """

    arrival_ns: int
    ttl_ms: float


class Interval(NamedTuple):
    """A time interval in which an output was not at rest.

    Attributes:
        output: Name of the output.
        start_ns: Start.
        end_ns: End; infinite if it does not end.
        value: Value of the largest size; 0 if unknown.
    """

    output: str
    start_ns: float
    end_ns: float
    value: float


def propelled(ledger: Iterable[Transition], wiring: TwinWiring) -> list[Interval]:
    """Return when each propelling output was not at rest.

    A pin with PWM counts by its duty. The last levels stay, unless the one-shot of the
    enable line ends them.
    """
    found: list[Interval] = []
    running: dict[str, tuple[int, float]] = {}
    names = wiring.propelling
    for t, outputs in _moments(ledger, wiring):
        for name in names:
            value, at_rest = outputs[name]
            start = running.get(name)
            if at_rest and start is not None:
                found.append(Interval(name, start[0], t, start[1]))
                del running[name]
            elif not at_rest:
                since, most = start or (t, 0.0)
                value = value or 0.0
                running[name] = (since, value if abs(value) > abs(most) else most)
    found.extend(Interval(name, t, math.inf, most) for name, (t, most) in running.items())
    return [interval for interval in found if interval.end_ns > interval.start_ns]


def unauthorised(
    ledger: Iterable[Transition],
    wiring: TwinWiring,
    commands: Iterable[ExpectedCommand | tuple[int, float]],
    deadline_ms: float,
    slack_ms: float = 0.0,
) -> list[Interval]:
    """Return when a propelling output was not at rest without a fresh command.

    Args:
        ledger: Transitions, ordered by time.
        wiring: Wiring of the robot.
        commands: Arrival of each accepted command, ns, and its time to live, ms.
        deadline_ms: Longest effect of a command, ms.
        slack_ms: How much later than that an output may come to rest, ms.
    """
    allowed = sorted(
        (arrival_ns, arrival_ns + (min(ttl_ms, deadline_ms) + slack_ms) * 1e6)
        for arrival_ns, ttl_ms in commands
    )
    found: list[Interval] = []
    for interval in propelled(ledger, wiring):
        start = interval.start_ns
        for allowed_start, allowed_end in allowed:
            if allowed_end <= start:
                continue
            if allowed_start >= interval.end_ns:
                break
            if allowed_start > start:
                found.append(interval._replace(start_ns=start, end_ns=allowed_start))
            start = allowed_end
        if start < interval.end_ns:
            found.append(interval._replace(start_ns=start))
    return found


def time_to_rest(ledger: Iterable[Transition], wiring: TwinWiring, fault_ns: int) -> float:
    """Return the time from a fault until all propelling outputs are at rest for good.

    Returns:
        Seconds; 0 if they were at rest before and stayed so, infinite if one never comes to rest.
    """
    ends = [interval.end_ns for interval in propelled(ledger, wiring)]
    return max(0.0, max(ends, default=0.0) - fault_ns) / 1e9


def _moments(
    ledger: Iterable[Transition], wiring: TwinWiring
) -> Iterator[tuple[int, dict[str, WiredOutput]]]:
    """Yield the states of the outputs after each transition and at the end of the one-shot."""
    levels = Levels()
    for transition in ledger:
        ends_ns = wiring.power_ends_ns(levels)
        if ends_ns is not None and ends_ns < transition.t:
            yield ends_ns, wiring.read(levels, ends_ns)
        apply(levels, transition)
        yield transition.t, wiring.read(levels, transition.t)
    ends_ns = wiring.power_ends_ns(levels)
    if ends_ns is not None:
        yield ends_ns, wiring.read(levels, ends_ns)
