"""Import: episodes from the records of a file, for all formats.

A reader fills `SourceRecord`s from its file. Here their actions, drivers and images are checked,
rates are measured, and sessions are split where time jumps.

Times may be rounded, and records may be missing, so a median of periods is not the rate: at times
in whole milliseconds it is off by up to 2 % at 20 Hz. The rate is the mean over the periods near
the median, each divided by the steps that its records are apart where they are numbered.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from math import inf, isfinite
from pathlib import Path
from typing import Final

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.demos.exchange.format import (
    DEFAULT_HZ,
    ExchangeStep,
    ImportContext,
    counted,
    few,
)
from shapechanger.demos.exchange.pictures import PictureError, load_jpeg, other_size
from shapechanger.errors import DemosError, ShapechangerError, UnknownName
from shapechanger.layout import Feature, Layout

_MAX_FEATURES: Final = 512  # That values become one by one; more become one array feature.
_UNIT_UNKNOWN: Final = "?"
_NS_PER_S: Final = 1e9
_PAUSE_PERIODS: Final = 30.0
_NEAR: Final = (0.5, 1.5)  # Of the median period; one missing record is 2.
_MIN_PERIODS: Final = 10  # A shorter drive is not evidence of its rate.
# Measured rates of one setting differ slightly, those of two settings by at least a third.
_RATE_RATIO: Final = 1.3
_SLOWEST_HZ, _FASTEST_HZ = 1.0, 100.0  # As `control_hz` of a profile.
# A loop that sleeps for the rest of each period, as Donkeycar's, is up to 2 % slower than it was
# set to, by the time that it takes to wake up.
_WHOLE: Final = ((1.0, 0.005), (5.0, 0.025))


@dataclass(slots=True, kw_only=True)
class SourceRecord:
    """A record of a source, before it is checked.

    Attributes:
        name: Its name in reports.
        step: Its step, with its time as `captured_ns`.
        number: Its number in the source; gaps are missing records.
        picture: Its image: a file, a JPEG, PNG or BMP, or pixels; None without one.
        frame: Equal for successive records that share an image; None to take `picture`.
        fault: Why it cannot be imported, after a noun; "" if it can.
        marks: Texts of its marks.
        dropped: Why the step is excluded; None if it is not.
    """

    name: str
    step: Step
    number: int = 0
    picture: Path | bytes | NDArray[np.uint8] | None = None
    frame: object = None
    fault: str = ""
    marks: tuple[str, ...] = ()
    dropped: str | None = None


def rows_of(
    records: Iterable[SourceRecord],
    size: tuple[int, int] | None,
    context: ImportContext,
    what: str,
    rest: Sequence[str] = (),
) -> Iterator[ExchangeStep]:
    """Yield the steps of the records that are whole; the others are reported.

    Args:
        records: The records of an episode in order.
        size: Width and height of the images, pixels; None to leave out images.
        context: Collects what is left out.
        what: A record, as a noun for reports.
        rest: Names of all records, of which those are reported that a damaged file does not have.
    """
    shown: object = None
    done = 0
    try:
        for done, record in enumerate(records, 1):  # noqa: B007
            frame = record.picture if record.frame is None else record.frame
            jpeg, fault = None, record.fault or _fault(record.step)
            if size is not None and record.picture is not None and frame != shown and not fault:
                try:
                    jpeg, *_ = load_jpeg(record.picture, size)
                except PictureError as error:
                    fault = str(error)
            if fault:
                context.leave_out(what, fault, record.name)
                continue
            shown = shown if jpeg is None else frame
            yield ExchangeStep(
                step=record.step, jpeg=jpeg, marks=record.marks, dropped=record.dropped
            )
    except DemosError as error:
        for name in rest[done:]:
            context.leave_out(what, unreadable(error), name)


def unreadable(error: ShapechangerError) -> str:
    """Return a reason to leave a part out, after a noun."""
    return f"that cannot be read ({str(error).removesuffix('.')})"


def _fault(step: Step) -> str:
    if not all(map(isfinite, step.action)):
        return "with an action that is not finite"
    if step.driver not in DRIVERS:
        return unreadable(UnknownName("driver", step.driver, DRIVERS))
    return ""


def with_pictures(
    records: Sequence[SourceRecord], what: str, context: ImportContext
) -> tuple[list[SourceRecord], tuple[int, int] | None]:
    """Return the records with a whole image, or with none, and the most frequent size.

    All images are decoded, so that rates and jumps follow from the records that remain.
    """
    sizes: dict[int, tuple[int, int]] = {}
    encoded = 0
    for place, record in enumerate(records):
        if record.picture is not None and not record.fault:
            try:
                _, sizes[place], is_new = load_jpeg(record.picture)
                encoded += is_new
            except PictureError as error:
                record.fault = str(error)
    common = Counter(sizes.values()).most_common(1)[0][0] if sizes else None
    for place, record in enumerate(records):
        if common is not None and (size := sizes.get(place, common)) != common:
            record.fault = other_size(size, common)
        if record.fault:
            context.leave_out(what, record.fault, record.name)
    if encoded:
        context.note(f"{counted(encoded, 'image')} encoded as JPEG of quality 100.")
    return [record for record in records if not record.fault], common


def stretches(
    parts: Sequence[list[SourceRecord]],
    what: str,
    context: ImportContext,
    stated_hz: float | None = None,
) -> list[tuple[list[SourceRecord], float, bool]]:
    """Measure the rates of sessions, or take a stated one, and split them where time jumps.

    What is odd about the times is reported. Times that contradict the stated rate are left out.

    Returns:
        Records that follow each other without a pause, with their rate in Hz and whether their
        times are known and believed.
    """
    periods_ns: list[list[float]] = []  # From one record to the next, per number that they differ.
    for part in parts:
        missing = sum(record.step.captured_ns is None for record in part)
        if 0 < missing < len(part):
            context.warn(
                f"{missing} of the {len(part)} {what}s from {part[0].name} have no valid time: the "
                "times of the others are left out."
            )
            _leave_out_times(part)
        pairs = pairwise(() if missing else part)
        periods_ns.append([_passed_ns(a, b) / max(1, b.number - a.number) for a, b in pairs])
    rates = _rates(periods_ns, context, stated_hz)
    if rates is None:
        rates = [context.hz or stated_hz or DEFAULT_HZ] * len(parts)
        for part in parts:
            _leave_out_times(part)
    found: list[tuple[list[SourceRecord], float, bool]] = []
    pauses_s: list[float] = []
    backwards: list[tuple[float, str]] = []
    for part, hz in zip(parts, rates, strict=True):
        starts, is_timed = [0], part[0].step.captured_ns is not None
        for number, (now, later) in enumerate(pairwise(part if is_timed else ()), 1):
            passed_s = _passed_ns(now, later) / _NS_PER_S
            if 0.0 <= passed_s <= longest_period_s(hz):
                continue
            starts.append(number)
            if passed_s < 0.0:
                backwards.append((-passed_s, later.name))
            else:
                pauses_s.append(passed_s)
        found += [(part[one:two], hz, is_timed) for one, two in pairwise([*starts, len(part)])]
    if pauses_s:
        context.note(
            f"A new episode begins after {counted(len(pauses_s), 'pause')}, of "
            f"{max(pauses_s):.6g} s at most and {sum(pauses_s):.6g} s in all."
        )
    if backwards:
        context.warn(
            f"Time runs backwards by up to {max(backwards)[0]:.6g} s at "
            f"{few([name for _, name in backwards])}: a new episode begins there."
        )
    return found


def _passed_ns(one: SourceRecord, two: SourceRecord) -> int:
    return (two.step.captured_ns or 0) - (one.step.captured_ns or 0)


def _leave_out_times(part: Iterable[SourceRecord]) -> None:
    for record in part:
        record.step = replace(record.step, captured_ns=None)


def _rates(
    periods_ns: Sequence[Sequence[float]], context: ImportContext, stated_hz: float | None
) -> list[float] | None:
    """Return the rate of each session; None if the times contradict the one that is stated."""
    measured = measured_hz([*chain.from_iterable(periods_ns)])
    about = f"{1e3 / (measured or inf):.4g} ms apart, {measured or 0.0:.4g} a second"
    if (hz := context.hz or stated_hz) is not None:
        if measured is None or 1.0 / _RATE_RATIO < measured / hz < _RATE_RATIO:
            return [hz] * len(periods_ns)
        (context.warn if context.hz is None else context.note)(
            f"The records are {about} by their times, and not the {hz:g} Hz that are stated: "
            "these times are left out."
        )
        return None
    if measured is None:
        context.note(f"The rate is unknown and taken to be {DEFAULT_HZ:g} Hz; --hz states it.")
        return [DEFAULT_HZ] * len(periods_ns)
    each = [(len(part) >= _MIN_PERIODS and measured_hz(part)) or measured for part in periods_ns]
    differ = max(each) > _RATE_RATIO * min(each)
    rates = [_nominal_hz(hz if differ else measured) for hz in each]
    if differ:
        context.warn(
            f"The drives have from {min(each):.3g} to {max(each):.3g} steps a second: a policy "
            "learns from one rate at a time."
        )
    elif abs(measured / rates[0] - 1.0) > _WHOLE[0][1]:
        context.note(
            f"The records are {about}, which is taken to be {rates[0]:g} Hz; --hz states another "
            "rate."
        )
    if not all(_SLOWEST_HZ <= hz <= _FASTEST_HZ for hz in rates):
        context.warn(
            f"The records are {about}, but robots have {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} Hz: "
            "perhaps a conversion set their times. State the rate with --hz."
        )
    return rates


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
    # If no period prevails, all count.
    return _NS_PER_S / statistics.fmean(near if 2 * len(near) > len(driven) else driven)


def _nominal_hz(measured: float) -> float:
    """Return the rate that a loop was set to, from its measured rate: a whole one, if near."""
    for grid, tolerance in _WHOLE:
        nominal = grid * max(1, round(measured / grid))
        if abs(measured / nominal - 1.0) <= tolerance:
            return nominal
    return float(f"{measured:.4g}")


def features_of(
    key: str,
    size: int,
    *,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
    low: Sequence[float] = (),
    high: Sequence[float] = (),
) -> list[Feature]:
    """Return the features of the values of a column of others: named, numbered, or one array."""
    units = units if len(units) == size and all(units) else (_UNIT_UNKNOWN,) * size
    lows = low or (-inf,) * size
    highs = high or (inf,) * size
    if not names and size > _MAX_FEATURES:
        unit = units[0] if len(set(units)) == 1 else _UNIT_UNKNOWN
        return [Feature(key, unit, min(lows), max(highs), shape=(size,))]
    names = names or ([f"{key}/{n}" for n in range(size)] if size > 1 else [key])
    return [Feature(*about) for about in zip(names, units, lows, highs, strict=True)]


def as_json(features: Sequence[Feature]) -> str:
    """Return features as the layout of a header; "" for none."""
    return Layout(tuple(features)).to_json() if features else ""


def choose_camera(folder: Path, cameras: Sequence[str], context: ImportContext) -> str:
    """Return the chosen camera, or the only one; "" without any."""
    if context.camera:
        if context.camera not in cameras:
            raise UnknownName(f"camera of {folder}", context.camera, cameras)
        return context.camera
    if len(cameras) > 1:
        raise DemosError(
            f"{folder} has {len(cameras)} cameras ({', '.join(cameras)}), but an episode has one: "
            f"choose with --camera, such as --camera {cameras[0]}."
        )
    return "".join(cameras)
