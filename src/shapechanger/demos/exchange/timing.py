"""Time in data of others: its order, its rate, and where one drive ends and the next begins."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from shapechanger.errors import DemosError

__all__ = ["GAP_PERIODS", "HZ_UNKNOWN", "one_rate", "rate_hz", "require_order", "split_at_gaps"]

GAP_PERIODS: Final = 30.0
"""A pause of more than this many periods ends an episode."""

HZ_UNKNOWN: Final = 20.0
"""Steps a second of an episode whose data do not say, Hz."""

_NS_PER_S: Final = 1e9

# Measured rates of one setting differ a little; those of two settings differ by a third and more.
_SAME_RATE: Final = 1.3


def require_order(times_ns: Sequence[int], names: Sequence[str], how_to_go_on: str) -> None:
    """Refuse time that runs backwards; two steps at one time are in order.

    Args:
        times_ns: One time a step, ns.
        names: What to call each step.
        how_to_go_on: What the user can do, as the end of a sentence.

    Raises:
        DemosError: If a step is earlier than the one before it.
    """
    for number, (earlier, later) in enumerate(pairwise(times_ns)):
        if later < earlier:
            raise DemosError(
                f"Time runs backwards by {(earlier - later) / _NS_PER_S:.6g} s from "
                f"{names[number]} to {names[number + 1]}: {how_to_go_on}."
            )


def rate_hz(times_ns: Sequence[int]) -> float:
    """Steps a second, from the median of the periods, Hz; `HZ_UNKNOWN` where they say nothing."""
    periods = [later - earlier for earlier, later in pairwise(times_ns)]
    period = statistics.median(periods) if periods else 0.0
    return _NS_PER_S / period if period > 0.0 else HZ_UNKNOWN


def split_at_gaps(times_ns: Sequence[int]) -> list[slice]:
    """The episodes of a drive: a pause of more than `GAP_PERIODS` median periods ends one."""
    if not times_ns:
        return []
    longest = GAP_PERIODS * _NS_PER_S / rate_hz(times_ns)
    starts = [0] + [
        number + 1
        for number, (earlier, later) in enumerate(pairwise(times_ns))
        if later - earlier > longest
    ]
    return [slice(first, last) for first, last in pairwise([*starts, len(times_ns)])]


def one_rate(rates_hz: Sequence[float], names: Sequence[str], how_to_go_on: str) -> None:
    """Refuse episodes whose rates differ by more than measuring them explains.

    Args:
        rates_hz: One rate an episode, Hz.
        names: What to call each episode.
        how_to_go_on: What the user can do, as the end of a sentence.

    Raises:
        DemosError: If one is more than 1.3 times another.
    """
    if not rates_hz:
        return
    slow, fast = min(rates_hz), max(rates_hz)
    if fast > _SAME_RATE * slow:
        raise DemosError(
            f"{names[rates_hz.index(slow)]} has {slow:.3g} steps a second and "
            f"{names[rates_hz.index(fast)]} {fast:.3g}, and one data set has one rate: "
            f"{how_to_go_on}."
        )
