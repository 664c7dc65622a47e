"""Decide from the ledger alone whether a robot moved without permission.

The inputs are the ledger, the wiring and the times at which the robot was permitted to move, but
nothing from the robot's own programs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from shapechanger.robot.drivers.simulation import Levels, WiredOutput
from shapechanger.robot.twin.signals import Transition, apply
from shapechanger.robot.twin.wiring import TwinWiring


class Interval(NamedTuple):
    """A time interval in which an output was not at rest."""

    output: str
    start_ns: float
    end_ns: float  # Infinite if it does not end.
    value: float  # Value with the largest magnitude; 0 if unknown.


def propelled(ledger: Iterable[Transition], wiring: TwinWiring) -> list[Interval]:
    """Return when each propelling output was not at rest.

    A pin with PWM counts with its duty. The last levels remain, unless the one-shot of the enable
    line cuts the power.
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
    """Return when a propelling output was not at rest without permission.

    Args:
        ledger: Transitions, ordered by time.
        wiring: Wiring of the robot.
        permitted: Start and end of each time in which it may move, ns, such as from the arrival of
            a command to its deadline.
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
    for line in (*ledger, None):
        ends_ns = wiring.power_ends_ns(levels)
        if ends_ns is not None and (line is None or ends_ns < line.t):
            yield ends_ns, wiring.read(levels, ends_ns)
        if line is not None:
            apply(levels, line)
            yield line.t, wiring.read(levels, line.t)
