"""Rates, pauses and order of records that have a time each but do not state their rate.

Times may be rounded, and records may be missing, so a median of periods is not the rate: at times
in whole milliseconds it is off by up to 2 % at 20 Hz. Here the rate is the mean over the periods
near the median, each divided by the steps that its records are apart where they are numbered.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Final

import numpy as np

from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.demos.exchange.format import DEFAULT_HZ, ImportContext, counted, few

_NS_PER_S: Final = 1e9
_NS_PER_MS: Final = 1e6

_PAUSE_PERIODS: Final = 30.0
_NEAR: Final = (0.5, 1.5)  # Of the median period; one missing record is 2.
_MIN_PERIODS: Final = 10  # A shorter drive is not evidence of its rate.
_IRREGULAR: Final = 0.1
# Measured rates of one setting differ slightly, those of two settings by at least a third.
_RATE_RATIO: Final = 1.3
_SLOWEST_HZ, _FASTEST_HZ = 1.0, 100.0  # As `control_hz` of a profile.
# A loop that sleeps for the rest of each period, as Donkeycar's, is up to 2 % slower than it was
# set to, by the time that it takes to wake up.
_WHOLE: Final = ((1.0, 0.005), (5.0, 0.025))


@dataclass(frozen=True, slots=True)
class TimedDrive:
    """Consecutive records of one session.

    Attributes:
        times_ns: Time of each record, ns; empty if unknown.
        numbers: Number of each record in its source, increasing; gaps are records that are missing.
        name: How to name the drive in messages.
    """

    times_ns: Sequence[int]
    numbers: Sequence[int]
    name: str

    def periods_ns(self) -> list[float]:
        """Return the times from step to step, ns."""
        pairs = zip(pairwise(self.times_ns), pairwise(self.numbers), strict=False)
        return [(later - now) / max(1, after - at) for (now, later), (at, after) in pairs]


def choose_rates(
    drives: Sequence[TimedDrive], context: ImportContext, stated_hz: float | None = None
) -> tuple[list[float], bool]:
    """Measure the rates of drives, or take a stated one, and report what is odd about them."""
    periods = [drive.periods_ns() for drive in drives]
    pooled = measured_hz([period for part in periods for period in part])
    if (hz := context.hz or stated_hz) is not None:
        if pooled is None or 1.0 / _RATE_RATIO < pooled / hz < _RATE_RATIO:
            return [hz] * len(drives), True
        (context.warn if context.hz is None else context.note)(
            f"The records are {_described(pooled)} by their times, and not the {hz:g} Hz that are "
            "stated: these times are left out."
        )
        return [hz] * len(drives), False
    if pooled is None:
        context.note(f"The rate is unknown and taken to be {DEFAULT_HZ:g} Hz; --hz states it.")
        return [DEFAULT_HZ] * len(drives), True
    measured = {
        drive.name: hz
        for drive, part in zip(drives, periods, strict=True)
        if len(part) >= _MIN_PERIODS and (hz := measured_hz(part)) is not None
    }
    slow = min(measured, key=lambda name: measured[name], default="")
    fast = max(measured, key=lambda name: measured[name], default="")
    if measured and measured[fast] > _RATE_RATIO * measured[slow]:
        context.warn(
            f"The drive from {slow} has {measured[slow]:.3g} steps a second, and the drive from "
            f"{fast} {measured[fast]:.3g}: a policy learns from one rate at a time."
        )
        rates = [nominal_hz(measured.get(drive.name, pooled)) for drive in drives]
    else:
        rates = [nominal_hz(pooled)] * len(drives)
        if abs(pooled / rates[0] - 1.0) > _WHOLE[0][1]:
            context.note(
                f"The records are {_described(pooled)}, which is taken to be {rates[0]:g} Hz; --hz "
                "states another rate."
            )
    for hz in sorted({rate for rate in rates if not _SLOWEST_HZ <= rate <= _FASTEST_HZ}):
        context.warn(
            f"The records are {_described(hz)}, which no robot has ({_SLOWEST_HZ:g} to "
            f"{_FASTEST_HZ:g} Hz): perhaps a conversion set their times. State the rate with --hz."
        )
    _report_irregular([period for part in periods for period in part], context)
    return rates, True


def measured_hz(periods_ns: Sequence[float]) -> float | None:
    """Return the steps per second, without regard to pauses and outliers.

    Args:
        periods_ns: Times from step to step, ns.
    """
    positive = [period for period in periods_ns if period > 0.0]
    if not positive:
        return None
    typical = statistics.median_low(positive)
    driven = [period for period in positive if period <= _PAUSE_PERIODS * typical]
    if 2 * len(positive) < len(periods_ns):  # The clock is coarser than a period.
        return _NS_PER_S * len(periods_ns) / sum(driven)
    low, high = _NEAR
    near = [period for period in driven if low * typical <= period <= high * typical]
    # Where no period prevails, the rate is that of all.
    return _NS_PER_S / statistics.fmean(near if 2 * len(near) > len(driven) else driven)


def nominal_hz(measured: float) -> float:
    """Return the rate that a loop was set to, from its measured rate: a whole one, if near."""
    for grid, tolerance in _WHOLE:
        nominal = grid * max(1, round(measured / grid))
        if abs(measured / nominal - 1.0) <= tolerance:
            return nominal
    return float(f"{measured:.4g}")


def split_at_jumps(
    drives: Sequence[TimedDrive],
    names: Sequence[Sequence[str]],
    rates: Sequence[float],
    context: ImportContext,
) -> list[list[slice]]:
    """Split drives at each long pause, and wherever time runs backwards, and report all jumps."""
    pauses_s: list[float] = []
    backwards: list[tuple[float, str]] = []
    found: list[list[slice]] = []
    for drive, named, hz in zip(drives, names, rates, strict=True):
        starts = [0]
        for number, (now, later) in enumerate(pairwise(drive.times_ns), 1):
            passed_s = (later - now) / _NS_PER_S
            if passed_s < 0.0:
                backwards.append((-passed_s, named[number]))
            elif passed_s > longest_period_s(hz):
                pauses_s.append(passed_s)
            else:
                continue
            starts.append(number)
        found.append([slice(*ends) for ends in pairwise([*starts, len(named)])])
    if pauses_s:
        context.note(
            f"A new episode begins after {counted(len(pauses_s), 'pause')}, of "
            f"{_seconds(max(pauses_s))} at most and {_seconds(sum(pauses_s))} in all."
        )
    if backwards:
        context.warn(
            f"Time runs backwards by up to {_seconds(max(backwards)[0])} at "
            f"{few([name for _, name in backwards])}: a new episode begins there."
        )
    return found


def iso_time(unix_ns: int) -> str:
    """Return a Unix time as ISO 8601 in UTC; "" if it is beyond the calendar."""
    try:
        at = datetime.fromtimestamp(unix_ns / _NS_PER_S, UTC)
    except (OverflowError, ValueError, OSError):
        return ""
    return at.isoformat(timespec="milliseconds")


def _report_irregular(periods_ns: Sequence[float], context: ImportContext) -> None:
    driven = [p for p in periods_ns if p > 0.0]
    typical = statistics.median_low(driven)
    driven = [period for period in driven if period <= _PAUSE_PERIODS * typical]
    low, high = _NEAR
    odd = sum(not low * typical <= period <= high * typical for period in driven)
    if len(driven) >= _MIN_PERIODS and odd > _IRREGULAR * len(driven):
        least, most = np.percentile(driven, [5, 95]) / _NS_PER_MS
        context.note(
            f"The records are irregular: {100 * odd / len(driven):.0f} % come more than half a "
            f"period early or late (the middle 90 % of the periods are {least:.3g} to {most:.3g} "
            "ms)."
        )


def _described(hz: float) -> str:
    return f"{1e3 / hz:.4g} ms apart, {hz:.4g} a second"


def _seconds(seconds: float) -> str:
    return f"{seconds:.6g} s"
