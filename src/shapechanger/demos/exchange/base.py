"""Declaration of formats, names of their columns, and the records that readers and writers share.

A reader yields `ExchangeEpisode`s of `ExchangeRecord`s, of which `whole_records` leaves out the
damaged ones. If a source does not state its rate, `drives` measures it from the mean of the periods
near the median. The median itself is wrong by up to 2 % at 20 Hz if times are whole milliseconds.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from math import inf
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.demos.exchange.files import load_jpeg
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError, UnknownName, require_known
from shapechanger.layout import Feature

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
"""Features of actions, keyed by column of other programs' tables; a pressed key is 1."""

_OTHER_SIZE: Final = "an image of {} x {} pixels instead of {} x {}"
_MAX_FEATURES: Final = 512  # Columns with more values become one array feature.
_Size = tuple[int, int] | None
_NS_PER_S: Final = 1e9
_PAUSE_PERIODS: Final = 30.0
_NEAR: Final = (0.5, 1.5)  # In median periods; a missing record doubles a period.
_MIN_PERIODS: Final = 10  # Drives with fewer periods get the rate of all drives.
_RATE_RATIO: Final = 1.3  # A larger ratio of two rates means two settings of the rate.
_SLOWEST_HZ, _FASTEST_HZ = 1.0, 100.0  # Range of `control_hz` in a profile.
# Nominal rates are multiples of these steps (Hz), within these relative tolerances: a loop that
# sleeps for the rest of each period, such as Donkeycar's, is up to 2 % slow.
_WHOLE: Final = ((1.0, 0.005), (5.0, 0.025))

DEFAULT_HZ: Final = 20.0
UNKNOWN_RATE: Final = f"The rate is unknown: {DEFAULT_HZ:g} Hz are assumed; --hz sets it."


@dataclass(slots=True, kw_only=True)
class ExchangeRecord:
    """A step that is imported or exported.

    Attributes:
        step: The step; an import ignores its index and the name of its frame.
        jpeg: JPEG of the step's image; the same object in successive records that share an image.
            Readers of formats leave it None, and the import sets it from `image`.
        marks: Texts of the step's marks.
        dropped: Why the step is excluded; None if it is not excluded.
        name: Name of the record in findings.
        number: Number of the record in the source; gaps are missing records.
        image: Image in the source: a file, the bytes of a JPEG, PNG or BMP, or pixels; or None.
        frame: Equal for successive records that share an image; None to compare `image`.
        fault: Why the record cannot be imported; "" if it can be.
    """

    step: Step
    jpeg: bytes | None = None
    marks: tuple[str, ...] = ()
    dropped: str | None = None
    name: str = ""
    number: int = 0
    image: Path | bytes | NDArray[np.uint8] | None = None
    frame: object = None
    fault: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeEpisode:
    """An episode that is imported or exported.

    Attributes:
        header: Metadata of the episode.
        records: Steps in order, which can be iterated once. If the iterator raises `DemosError`, an
            import leaves the episode out.
        name: Name of the episode in errors.
        outcome: How the episode ended; "" if unspecified.
    """

    header: EpisodeHeader
    records: Iterable[ExchangeRecord]
    name: str
    outcome: str = ""


Kind = Literal["note", "warning", "left out"]
"""Kinds of findings: something harmless, a contradiction in the source, and a part left out."""


class ImportFinding(NamedTuple):
    """A finding of an import or an export, as a sentence or as names and a reason."""

    kind: Kind
    text: str


@dataclass(slots=True, kw_only=True)
class ImportContext:
    """Options of an import, and its findings so far.

    Attributes:
        camera: Name of the camera to import, if there are several; "" for the only one.
        hz: Steps per second, as stated by the user; None to read or measure the rate.
        strict: Whether to refuse a source that is incomplete or contradicts itself.
    """

    camera: str = ""
    hz: float | None = None
    strict: bool = False
    _found: dict[tuple[Kind, str], list[str]] = field(
        default_factory=dict[tuple[Kind, str], list[str]]
    )

    def report(self, kind: Kind, text: str, name: str = "") -> None:
        """Add a finding.

        Args:
            kind: Kind of the finding.
            text: A sentence; or with `name`, the reason for that part. Parts with the same reason
                are listed together.
            name: The part of the source, such as a record; "" if the finding is about all of it.

        Raises:
            DemosError: If `strict` is set and the kind is not "note".
        """
        names = self._found.setdefault((kind, text), [])
        names += [name] if name else []
        if self.strict and kind != "note":
            found = f"{name}: {text}" if name else text
            raise DemosError(
                f"The source is incomplete ({found.removesuffix('.')}): repair it, or import it "
                "with `shapechanger demos import` and without --strict, which lists all findings."
            )

    @property
    def findings(self) -> tuple[ImportFinding, ...]:
        """All findings, such as "record 12, record 15: an empty image"."""
        found = self._found.items()
        return tuple(ImportFinding(k, f"{few(n)}: {text}" if n else text) for (k, text), n in found)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportContext:
    """Options of an export.

    Attributes:
        out: The folder that the user asked for; the writer's folder is renamed to it at the end.
        task: What the robot does, in words; "" if not given.
        images: Whether to store images as they were recorded, instead of video.
        rewarded: Whether all kept steps have a reward.
    """

    out: Path
    task: str = ""
    images: bool = False
    rewarded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """Declaration of a format, which an entry point of another package can name.

    Attributes:
        name: Name on the command line.
        title: Name in sentences.
        sign: Files that identify a folder of the format, such as "steps.csv".
        detect: Returns whether a folder has the format; None if it cannot be imported.
        read: Yields the episodes of a folder, and reports findings to the context.
        write: Writes episodes into an existing folder and returns the number of steps; None if the
            format cannot be exported.
        options: Supported options: "camera" and "hz" on import; "task", "images" and "dropped"
            (excluded steps are included and marked) on export.
        consecutive: Whether a step always follows directly on the step before in this format. An
            export splits episodes at gaps, and requires the same layouts, image size and rate.
        timed: Whether the format stores the times of steps.
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


def few(names: Sequence[object]) -> str:
    """List up to three names, such as "12, 15, 20, ... (289 in all)"."""
    shown = ", ".join(map(str, names[:3]))
    return f"{shown}, ... ({len(names)} in all)" if len(names) > 3 else shown


def whole_records(episode: ExchangeEpisode, context: ImportContext) -> Iterator[ExchangeRecord]:
    """Yield the intact records of an episode, with images as JPEG; report the other records."""
    size, shown, jpeg = episode.header.image_size, None, None
    sizes = episode.header.action_layout.size, episode.header.state_layout.size
    for record in episode.records:
        frame, new = record.image if record.frame is None else record.frame, None
        record.fault = record.fault or record.step.refusal(*sizes)
        if not record.fault and record.step.driver not in DRIVERS:
            record.fault = str(UnknownName("driver", record.step.driver, DRIVERS))
        if size is not None and frame != shown:
            new, _ = _loaded(record, size)
        if record.fault:
            context.report("left out", record.fault.removesuffix("."), record.name)
            continue
        if new is not None:
            shown, jpeg = frame, new
        record.jpeg = jpeg
        yield record


def _loaded(record: ExchangeRecord, size: _Size = None) -> tuple[bytes | None, _Size]:
    """Return a record's image as JPEG, and its size; set a fault if damaged or of another size."""
    if not record.fault and record.image is not None:
        try:
            jpeg, found = load_jpeg(record.image)
            if size is not None and found != size:
                record.fault = _OTHER_SIZE.format(*found, *size)
            return jpeg, found
        except DemosError as error:
            record.fault = str(error)
    return None, None


def decoded_images(
    episode: ExchangeEpisode, title: str
) -> Iterator[tuple[ExchangeRecord, NDArray[np.uint8] | None]]:
    """Yield the records of an episode, whose steps must all have images of one size, or none.

    A record with a new image comes with its pixels, shape (height, width, 3); others with None.
    """
    size, shown = episode.header.image_size, None
    for number, record in enumerate(episode.records):
        pixels, where = None, f"of step {number} of {episode.name}"
        if (size is None) != (record.jpeg is None):
            found = "an image" if size is None else "no image"
            raise DemosError(f"There is {found} {where}: {title} needs all images or none.")
        if size is not None and record.jpeg is not None and record.jpeg is not shown:
            shown, pixels = record.jpeg, decode_picture(record.jpeg, where)
            if (found := (pixels.shape[1], pixels.shape[0])) != size:
                fault = _OTHER_SIZE.format(*found, *size)
                raise DemosError(f"{title} needs images of one size: step {where} has {fault}.")
        yield record, pixels


def drives(
    sessions: Sequence[list[ExchangeRecord]],
    header: EpisodeHeader,
    context: ImportContext,
    stated_hz: float | None = None,
) -> Iterator[tuple[list[ExchangeRecord], EpisodeHeader]]:
    """Yield the drives of a source that may lack its rate and the size of its images.

    Sessions, from one start of the robot to the next, are split at pauses and where time runs
    backwards, if their records have times, `captured_ns`. Records with a damaged image, or an image
    of another size than most, are left out before rates and pauses are measured. `stated_hz` is the
    rate that the source states; times that contradict it are left out.
    """
    sizes = [_loaded(record)[1] for record in chain(*sessions)]
    ((common, _),) = Counter(filter(None, sizes)).most_common(1) or [(None, 0)]
    for record, size in zip(chain(*sessions), sizes, strict=True):
        if size and common and size != common:
            record.fault = _OTHER_SIZE.format(*size, *common)
        if record.fault:
            context.report("left out", record.fault, record.name)
    parts: list[list[ExchangeRecord]] = []
    for session in sessions:
        part = [record for record in session if not record.fault]
        missing = sum(record.step.captured_ns is None for record in part)
        if 0 < missing < len(part):
            text = "some records lack a time: the times of its session are left out"
            context.report("warning", text, part[0].name)
            for record in part:
                record.step = structs.replace(record.step, captured_ns=None)
        parts += [part] if part else []
    for part, hz in zip(parts, _rates(parts, context, stated_hz), strict=True):
        timed, starts = part[0].step.captured_ns is not None, [0]
        for number, (now, later) in enumerate(pairwise(part), 1):
            if (passed_ns := _passed_ns(now, later)) < 0:
                context.report("warning", "time runs backwards: an episode begins", later.name)
            elif passed_ns > longest_period_s(hz) * _NS_PER_S:
                context.report("note", "an episode begins after a pause", later.name)
            else:
                continue
            starts.append(number)
        clock = "real" if timed else "none"
        head = replace(header, image_size=common, control_hz=hz, clock=clock)
        for one, two in pairwise([*starts, len(part)]):
            yield part[one:two], head


def _passed_ns(one: ExchangeRecord, two: ExchangeRecord) -> int:
    return (two.step.captured_ns or 0) - (one.step.captured_ns or 0)


def _rates(
    parts: Sequence[list[ExchangeRecord]], context: ImportContext, stated_hz: float | None
) -> list[float]:
    """Return the rate of each session; leave out times that contradict a stated rate."""
    periods_ns = [
        [_passed_ns(a, b) / max(1, b.number - a.number) for a, b in pairwise(part)]
        for part in parts
    ]
    measured = measured_hz([*chain.from_iterable(periods_ns)])
    about = f"{1e3 / (measured or inf):.4g} ms apart, {measured or 0.0:.4g} a second"
    if (hz := context.hz or stated_hz) is not None:
        if measured and not 1.0 / _RATE_RATIO < measured / hz < _RATE_RATIO:
            for record in chain(*parts):
                record.step = structs.replace(record.step, captured_ns=None)
            text = f"The records are {about}, not at {hz:g} Hz: their times are left out."
            context.report("warning" if context.hz is None else "note", text)
        return [hz] * len(parts)
    if measured is None:
        context.report("note", UNKNOWN_RATE)
        return [DEFAULT_HZ] * len(parts)
    each = [(len(part) >= _MIN_PERIODS and measured_hz(part)) or measured for part in periods_ns]
    if max(each) > _RATE_RATIO * min(each):
        text = f"The drives have from {min(each):.3g} to {max(each):.3g} steps a second."
        context.report("warning", text)
    else:
        each = [measured] * len(parts)
    rates = [_nominal_hz(hz) for hz in each]
    if not all(_SLOWEST_HZ <= hz <= _FASTEST_HZ for hz in rates):
        text = f"The records are {about}, unlike those of robots: --hz sets the rate."
        context.report("warning", text)
    elif abs(each[0] / rates[0] - 1.0) > _WHOLE[0][1]:
        text = f"The records are {about}, so {rates[0]:g} Hz are assumed; --hz sets the rate."
        context.report("note", text)
    return rates


def measured_hz(periods_ns: Sequence[float]) -> float | None:
    """Return the steps per second from periods in ns, ignoring pauses and outliers."""
    positive = [period for period in periods_ns if period > 0.0]
    if not positive:
        return None
    typical = statistics.median_low(positive)
    driven = [period for period in positive if period <= _PAUSE_PERIODS * typical]
    if 2 * len(positive) < len(periods_ns):  # Most periods are 0: the clock's ticks are longer.
        return _NS_PER_S * len(periods_ns) / sum(driven)
    low, high = _NEAR
    near = [period for period in driven if low * typical <= period <= high * typical]
    # If fewer than half the periods are near the median, all of them are averaged.
    return _NS_PER_S / statistics.fmean(near if 2 * len(near) > len(driven) else driven)


def _nominal_hz(measured: float) -> float:
    """Return the rate that a loop was set to: a whole number, if the measured rate is near one."""
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
    """Return a column's features: named, numbered, or one array; unit "?" if none is known."""
    units = units if len(units) == size and all(units) else ("?",) * size
    lows = low or (-inf,) * size
    highs = high or (inf,) * size
    if not names and size > _MAX_FEATURES:
        unit = units[0] if len(set(units)) == 1 else "?"
        return [Feature(key, unit, min(lows), max(highs), shape=(size,))]
    names = names or ([f"{key}/{n}" for n in range(size)] if size > 1 else [key])
    return [Feature(*about) for about in zip(names, units, lows, highs, strict=True)]


def choose_camera(folder: Path, cameras: Sequence[str], context: ImportContext) -> str:
    """Return the chosen camera, or the only one; "" if there is no camera."""
    if context.camera:
        require_known(f"camera of {folder}", cameras, context.camera)
        return context.camera
    if len(cameras) > 1:
        names = ", ".join(cameras)
        raise DemosError(f"{folder} has {len(cameras)} cameras: choose one of {names} by --camera.")
    return "".join(cameras)
