"""Formats of datasets: their declaration, the names of their columns, and steps on their way.

A reader fills `SourceRecord`s from its file; `pictures.rows_of` makes steps of them. Where the rate
is not stated, it is measured, and sessions are split where time jumps. Times may be rounded, and
records may be missing, so a median of periods is not the rate: at times in whole milliseconds it is
off by up to 2 % at 20 Hz. The rate is the mean over the periods near the median, each divided by
the steps that its records are apart where they are numbered.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, pairwise
from math import inf
from pathlib import Path
from typing import Final

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

FORMATS: Final = ("csv", "minari", "lerobot", "tub", "mcap")
_NAMES: Final = """
step        | step        |                    | frame_index               | _index          | /step
frame       | frame       | observations/image | observation.images.camera | cam/image_array | /camera
driver      | driver      | infos/step         |                           | user/mode       | /step
action      | action/     | actions            | action                    | user/, pilot/   | /action
applied     | applied/    | infos/step         |                           |                 | /applied
wanted      | wanted/     | infos/step         |                           | pilot/          | /wanted
state       | state/      | observations/state | observation.state         | other numbers   | /state
captured_ns | captured_ns | infos/step         | timestamp                 | _timestamp_ms   | log time
decided_ns  | decided_ns  | infos/step         |                           |                 | log time
wall_ns     | wall_ns     | infos/step         |                           | _timestamp_ms   | /step
reward      | reward      | rewards            | next.reward               |                 | /reward
terms       | terms       | infos/step         |                           |                 | /reward
terminated  | terminated  | terminations       | next.terminated           |                 | /step
truncated   | truncated   | truncations        | next.done                 |                 | /step
stop_reason | stop_reason | infos/step         |                           |                 | /step
marks       | marks       | infos/step         |                           |                 | /step
dropped     | dropped     | infos/step         |                           |                 | /step
"""  # noqa: E501
COLUMNS: Final = {
    field: {form: name for form, name in zip(FORMATS, names, strict=True) if name}
    for field, *names in (map(str.strip, row.split("|")) for row in _NAMES.split("\n")[1:-1])
}
"""Names of the fields of a step in each format that has them, in the order of `steps.csv`."""

COMMANDS: Final = {
    "steering": Feature("steering", "1", -1.0, 1.0),
    "angle": Feature("steering", "1", -1.0, 1.0),
    "throttle": Feature("throttle", "1", -1.0, 1.0),
    **{key: Feature(key, "1", 0.0, 1.0) for key in ("forward", "backward", "right", "left")},
}
"""Values of an action by their names in tables of others; a key that is held is 1."""


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

DEFAULT_HZ: Final = 20.0
"""Steps per second of an episode without any information on its rate, Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeStep:
    """One step between two formats.

    Attributes:
        step: The step; its index and the name of its frame are ignored.
        jpeg: Its image; None for that of the step before, or without a camera.
        marks: Texts of its marks.
        dropped: Why the step is excluded; None if it is not.
    """

    step: Step
    jpeg: bytes | None
    marks: tuple[str, ...] = ()
    dropped: str | None = None


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


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeEpisode:
    """One episode between two formats.

    Attributes:
        header: Its metadata.
        rows: Its steps in order; they can be iterated once, at any time.
        name: How to name the episode in errors.
        outcome: How it ended; "" if unspecified.
    """

    header: EpisodeHeader
    rows: Iterable[ExchangeStep]
    name: str
    outcome: str = ""


@dataclass(slots=True, kw_only=True)
class ImportContext:
    """Options of an import, and its findings so far.

    A reader yields what is whole. It calls `leave_out` for each part that it skips, `warn` where a
    source contradicts itself or is implausible, and `note` for what is neither lost nor wrong. With
    `strict`, the import is refused at the end if there is anything of the first two kinds.

    Attributes:
        camera: Name of the camera to take, if there are several; "" for the only one.
        hz: Steps per second, as stated by the user; None to read or measure them.
        strict: Whether to refuse a source that is incomplete or contradicts itself.
        left_out: Names of the parts that are left out, by what they are and by the reason.
        warnings: Contradictions, as sentences that state their size.
        notes: Further facts, as sentences.
    """

    camera: str = ""
    hz: float | None = None
    strict: bool = False
    left_out: dict[tuple[str, str], list[str]] = field(
        default_factory=dict[tuple[str, str], list[str]]
    )
    warnings: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])

    def leave_out(self, what: str, reason: str, name: object) -> None:
        """Report that a part is left out."""
        self.left_out.setdefault((what, reason), []).append(str(name))

    def warn(self, sentence: str) -> None:
        """Report a contradiction in the source, once."""
        self.warnings += [sentence] if sentence not in self.warnings else []

    def note(self, sentence: str) -> None:
        """Report a fact that is neither a loss nor a contradiction, once."""
        self.notes += [sentence] if sentence not in self.notes else []

    def left_out_lines(self) -> list[str]:
        """Return a line for each reason, such as "9 records with an empty image: 31, 32, ...".

        The reason with most parts is first.
        """
        groups = sorted(self.left_out.items(), key=lambda group: -len(group[1]))
        return [f"{counted(len(n), what)} {reason}: {few(n)}" for (what, reason), n in groups]

    def require_whole(self, source: object) -> None:
        """Refuse a source of which something is left out, or which contradicts itself."""
        findings = [f"left out: {line}" for line in self.left_out_lines()]
        findings += [warning.removesuffix(".") for warning in self.warnings]
        if findings:
            raise DemosError(
                f"{source} is incomplete ({'; '.join(findings)}): repair it, or import it with "
                "`shapechanger demos import` and without --strict."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportContext:
    """Options of an export.

    Attributes:
        out: The folder that the user asked for; a writer gets another one, which is moved there.
        task: What the robot does, in words; "" if not given.
        images: Whether to store images as they were recorded, instead of video.
        rewarded: Whether all steps have a reward.
    """

    out: Path
    task: str = ""
    images: bool = False
    rewarded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """Declaration of a format, which a module binds to a name and an entry point names.

    Attributes:
        name: Its name on the command line.
        title: Its name in sentences.
        sign: Files by which a folder of the format is known, such as "steps.csv".
        detect: Returns whether a folder has the format; None if it cannot be imported.
        read: Yields the episodes of a folder, and tells the context what it leaves out.
        write: Writes episodes into an existing folder and returns the number of steps; None if the
            format cannot be exported.
        options: Options that it takes: "camera" and "hz" on import; "task", "images" and "dropped"
            (excluded steps, marked as such) on export.
        consecutive: Whether each step follows the one before, so that an export splits episodes.
        timed: Whether it keeps the times of steps.
    """

    name: str
    title: str
    sign: str = ""
    detect: Callable[[Path], bool] | None = None
    read: Callable[[Path, ImportContext], Iterator[ExchangeEpisode]] | None = None
    write: Callable[[Sequence[ExchangeEpisode], Path, ExportContext], int] | None = None
    options: frozenset[str] = frozenset()
    consecutive: bool = False
    timed: bool = True


def counted(number: int, what: str) -> str:
    """Format a count, such as "1 record" or "2 records"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def few(names: Sequence[object]) -> str:
    """List the first few names and count the rest, such as "12, 15, 20, and 286 more"."""
    shown = ", ".join(map(str, names[:3]))
    return f"{shown}, and {len(names) - 3} more" if len(names) > 3 else shown


def kept_steps(rows: Iterable[ExchangeStep]) -> Iterator[tuple[Step, bytes | None]]:
    """Yield the steps that are not excluded, each with its image, even where it is shared."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


def decoded_steps(
    rows: Iterable[ExchangeStep], size: tuple[int, int] | None, name: str, title: str
) -> Iterator[tuple[ExchangeStep, bytes, NDArray[np.uint8] | None]]:
    """Yield steps for a dataset with an image at every step, each with its image.

    Args:
        rows: The steps.
        size: Width and height of all images; None without images.
        name: How to name the episode in errors.
        title: How to name the format in errors.

    Yields:
        The step; its image, also if it is shared; and its pixels if it is new, shape
        (height, width, 3).
    """
    jpeg = b""
    for number, row in enumerate(rows):
        pixels, where = None, f"of step {number} of {name}"
        if size is not None and row.jpeg is not None:
            jpeg, pixels = row.jpeg, decode_picture(row.jpeg, where)
            height, width, _ = pixels.shape
            if (width, height) != size:
                raise DemosError(
                    f"The image {where} has {width} x {height} pixels, and not {size[0]} x "
                    f"{size[1]}: a {title} dataset has one size."
                )
        if size is not None and not jpeg:
            raise DemosError(f"There is no image {where}, but {title} needs one at every step.")
        yield row, jpeg, pixels


def value_names(layout: Iterable[Feature]) -> list[str]:
    """Return a name for each value of a layout; those of a block are numbered, as in `map[3]`."""
    return [
        f"{feature.name}[{place}]" if feature.shape else feature.name
        for feature in layout
        for place in range(feature.size)
    ]


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
