"""Says from the ledger alone whether a robot moved when it should not have.

It knows what is wired and when commands arrived, and nothing of the robot's programs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from shapechanger.twin.signals import Levels, Transition
from shapechanger.twin.wiring import TwinWiring, WiredOutput

__all__ = ["ExpectedCommand", "Interval", "propelled", "time_to_rest", "unauthorised"]


class ExpectedCommand(NamedTuple):
    """A command that the robot had reason to obey.

    Attributes:
        arrival_ns: When it arrived, on the ledger's clock.
        ttl_ms: How long it may act; the deadline holds where it is shorter.
    """

    arrival_ns: int
    ttl_ms: float


class Interval(NamedTuple):
    """A stretch of time in which an output was not at rest.

    Attributes:
        output: Its name.
        start_ns: When it began.
        end_ns: When it ended; infinite if it does not.
        value: The largest value by size; 0 where it is not known.
    """

    output: str
    start_ns: float
    end_ns: float
    value: float


def propelled(ledger: Iterable[Transition], wiring: TwinWiring) -> list[Interval]:
    """When each output that propels was not at rest.

    A pin between the edges of its PWM counts by its duty. The last levels last for ever, except
    that a one-shot of the enable line ends them.
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
    """When an output that propels was not at rest without a fresh command.

    Args:
        ledger: The transitions, in the order of their times.
        wiring: What is attached.
        commands: When each accepted command arrived, in nanoseconds, and its time to live in ms.
        deadline_ms: How long a command acts at most.
        slack_ms: How much later than that an output may come to rest.
    """
    allowed = _union(
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
    """Seconds from a fault until all outputs that propel are at rest for good.

    Returns:
        0 if they were at rest before and stayed so; infinite if one never comes to rest.
    """
    ends = [interval.end_ns for interval in propelled(ledger, wiring)]
    return max(0.0, max(ends, default=0.0) - fault_ns) / 1e9


def _moments(
    ledger: Iterable[Transition], wiring: TwinWiring
) -> Iterator[tuple[int, dict[str, WiredOutput]]]:
    """What the outputs do after each transition, and when the one-shot ends."""
    levels = Levels()
    for transition in ledger:
        ends_ns = wiring.power_ends_ns(levels)
        if ends_ns is not None and ends_ns < transition.t:
            yield ends_ns, wiring.read(levels, ends_ns)
        levels.apply(transition)
        yield transition.t, wiring.read(levels, transition.t)
    ends_ns = wiring.power_ends_ns(levels)
    if ends_ns is not None:
        yield ends_ns, wiring.read(levels, ends_ns)


def _union(intervals: Iterable[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    """The same stretches of time without overlap, in order."""
    united: list[tuple[float, float]] = []
    for start, end in sorted(intervals):
        if united and start <= united[-1][1]:
            united[-1] = (united[-1][0], max(end, united[-1][1]))
        else:
            united.append((start, end))
    return united
