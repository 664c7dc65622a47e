"""Import and export of recordings in other formats.

The module of a format declares a `Format`: it reads folders into `ExchangeEpisode`s, writes such
episodes to folders, or both. `base.COLUMNS` maps the fields of a step to the columns of each
format. `files` and `video` load and check untrusted files. Imports that are not strict leave
damaged parts out and report the reason. Sources are never changed, and targets appear atomically.
"""

from __future__ import annotations

import math
import shutil
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from importlib.metadata import entry_points
from itertools import groupby, pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Final

from shapechanger.demos.episodes import (
    Drop,
    Episode,
    EpisodeWriter,
    Step,
    edit,
    episodes_of,
    read_episode,
)
from shapechanger.demos.episodes.records import is_episode, longest_period_s
from shapechanger.demos.exchange import csv_files, lerobot, mcap, minari, tub
from shapechanger.demos.exchange.base import (
    ExchangeEpisode,
    ExchangeRecord,
    ExportContext,
    Format,
    ImportContext,
    ImportFinding,
    whole_records,
)
from shapechanger.demos.exchange.files import new_folder
from shapechanger.errors import DemosError, UnknownName, require_known
from shapechanger.files import writing

__all__ = [
    "Converted",
    "ExchangeEpisode",
    "ExchangeRecord",
    "ExportContext",
    "Format",
    "ImportContext",
    "ImportFinding",
    "export_recording",
    "find_format",
    "formats",
    "import_episodes",
    "import_recording",
]

_GROUP: Final = "shapechanger.formats"
_OWN: Final = (tub.FORMAT, minari.FORMAT, lerobot.FORMAT, csv_files.FORMAT, mcap.FORMAT)


@cache
def formats() -> Mapping[str, Format]:
    """Return all formats, keyed by name: our own, and formats of other packages' entry points.

    Raises:
        DemosError: If an entry point does not name a `Format`, or two formats have the same name.
    """
    found = {form.name: form for form in _OWN}
    for point in entry_points(group=_GROUP):
        form = point.load()
        if not isinstance(form, Format) or form.name in found:
            text = f"The entry point {point.name} in {_GROUP} must name a Format"
            raise DemosError(f"{text} of another name than {', '.join(found)}.")
        found[form.name] = form
    return MappingProxyType(found)


@dataclass(frozen=True, slots=True)
class Converted:
    """Result of an import or an export.

    Attributes:
        format: Name of the format.
        episodes: Number of episodes written.
        steps: Number of steps written.
        pictures: Number of images written by an import; 0 for an export.
        findings: Parts left out, contradictions in the source, and changes by an export.
    """

    format: str
    episodes: int
    steps: int
    pictures: int = 0
    findings: tuple[ImportFinding, ...] = ()


def export_recording(
    data: Path,
    out: Path,
    format: str,
    *,
    dropped: bool = False,
    task: str = "",
    images: bool = False,
) -> Converted:
    """Export a recording.

    Args:
        data: A recording, or one episode; it is not changed.
        out: The folder to create, atomically.
        format: Name of one of the `formats`.
        dropped: Whether to export excluded steps, too, marked as excluded; minari, csv, mcap only.
        task: What the robot does, in words, for policies that follow language; lerobot only.
        images: Whether to store images as they were recorded, instead of video; lerobot only.

    Raises:
        DemosError: If the recording is damaged or does not fit the format, or `out` exists or lies
            in `data`.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    form = formats().get(format)
    if form is None or form.write is None:
        raise UnknownName("format", format, [n for n, one in formats().items() if one.write])
    _require_options(form, dropped=dropped, task=task, images=images)
    read = [read_episode(path) for path in episodes_of(data)]
    chosen = [(one, one.steps if dropped else one.kept, one.outcome) for one in read]
    if not any(steps for _, steps, _ in chosen):
        raise DemosError(f"There is nothing to export: {data} has no steps that are kept.")
    notes: list[str] = []
    split = _consecutive(chosen, form, notes) if form.consecutive else chosen
    episodes = [_exchanged(*part) for part in split]
    rewarded = all(step.reward is not None for episode in read for step in episode.kept)
    context = ExportContext(out=out, task=task, images=images, rewarded=rewarded)
    try:
        with new_folder(out, data) as folder, writing(out):
            steps = form.write(episodes, folder, context)
    except OverflowError as error:
        raise DemosError(f"A number in {data} is too large for {format}: {error}.") from error
    if left := sum(len(episode.steps) for episode in read) - steps:
        hint = "; --dropped includes them" if "dropped" in form.options else ""
        notes.append(f"Dropped steps are left out ({left}){hint}.")
    findings = tuple(ImportFinding("note", note) for note in notes)
    return Converted(format, len(episodes), steps, findings=findings)


def _require_options(form: Format, **given: object) -> None:
    for option, value in given.items():
        if value and option not in form.options:
            known = ", ".join(name for name, one in formats().items() if option in one.options)
            raise DemosError(f"The format {form.name} has no option {option!r}, unlike {known}.")


def _exchanged(episode: Episode, steps: Sequence[Step], outcome: str) -> ExchangeEpisode:
    """Return the given steps of an episode, with the time of the first step as start time."""
    header = episode.header
    if steps and (since_s := _passed_s(episode.steps[0], steps[0])):
        with suppress(ValueError, OverflowError):
            began = datetime.fromisoformat(header.created) + timedelta(seconds=since_s)
            header = replace(header, created=began.isoformat(timespec="milliseconds"))

    def records() -> Iterator[ExchangeRecord]:
        marks, frame, jpeg = defaultdict[int, list[str]](list), "", None
        for mark in episode.marks:
            marks[mark.step].append(mark.text)
        for step in steps:
            if step.frame != frame:
                frame, jpeg = step.frame, episode.jpeg(step)
            why = episode.excluded.get(step.index)
            yield ExchangeRecord(step=step, jpeg=jpeg, marks=tuple(marks[step.index]), dropped=why)

    name = episode.path.name
    return ExchangeEpisode(header=header, records=records(), name=name, outcome=outcome)


_Part = tuple[Episode, Sequence[Step], str]  # An episode, some of its steps, and the outcome.


def _consecutive(chosen: Sequence[_Part], form: Format, notes: list[str]) -> list[_Part]:
    """Split episodes at pauses and excluded or missing steps; refuse different layouts or rates."""
    parts: list[_Part] = []
    off_s = 0.0
    chosen = [part for part in chosen if part[1]]
    first, *_ = chosen[0]
    for episode, steps, outcome in chosen:
        for name in ("action_layout", "state_layout", "image_size", "control_hz"):
            if getattr(episode.header, name) != getattr(first.header, name):
                text = f"{episode.path.name} differs from {first.path.name} in its {name}"
                raise DemosError(f"{text}: export each kind to its own {form.title} dataset.")
        hz, starts = episode.header.control_hz, [0]
        for number, (one, two) in enumerate(pairwise(steps), 1):
            if two.index != one.index + 1 or _passed_s(one, two) > longest_period_s(hz):
                starts.append(number)
        for start, end in pairwise([*starts, len(steps)]):
            run = steps[start:end]
            parts.append((episode, run, outcome if end == len(steps) else ""))
            times_s = (_passed_s(run[0], step, n / hz) for n, step in enumerate(run))
            off_s = max(off_s, *(abs(at_s - n / hz) for n, at_s in enumerate(times_s)))
    if len(parts) > len(chosen):
        notes.append(
            f"In {form.title}, each step directly follows the step before, so episodes are split "
            f"at pauses and where steps are excluded or missing: {len(chosen)} became {len(parts)}."
        )
    if off_s > 0.5 / first.header.control_hz and not form.timed:
        notes.append(
            f"{form.title} computes the time of a step from its number and the rate; these times "
            f"are off by up to {off_s:.4g} s."
        )
    return parts


def _passed_s(one: Step, two: Step, unknown_s: float = 0.0) -> float:
    """Return the time between two steps on the robot's clock, s; `unknown_s` without times."""
    for now, later in ((one.decided_ns, two.decided_ns), (one.captured_ns, two.captured_ns)):
        if now is not None and later is not None:
            return (later - now) / 1e9
    return unknown_s


def import_episodes(path: Path, context: ImportContext | None = None) -> Iterator[ExchangeEpisode]:
    """Read a recording in another format, without writing anything.

    Args:
        path: A folder in one of the `formats`.
        context: Options of the import, to which findings are added. None to refuse a source that
            is incomplete or contradicts itself.

    Yields:
        The episodes; their steps are read when they are iterated.

    Raises:
        DemosError: If `path` or an episode cannot be read, or a strict context refuses a part.
        MissingExtra: If a package that the format needs is not installed.
    """
    yield from _read(path, "auto", context or ImportContext(strict=True))[1]


def import_recording(
    path: Path,
    out: Path,
    format: str = "auto",
    *,
    camera: str = "",
    hz: float | None = None,
    strict: bool = False,
) -> Converted:
    """Import the complete records of a recording, and report the others.

    Args:
        path: A folder in one of the `formats`; it is not changed.
        out: The recording to create, atomically.
        format: Name of one of the formats, or "auto" to detect it.
        camera: Camera to import, such as "front"; "" for the only one. LeRobot and tubs only.
        hz: Steps per second; None to read or measure the rate. Only for formats without a rate.
        strict: Whether to refuse a source that is incomplete or contradicts itself.

    Raises:
        DemosError: If `path` has no intact episode, or `strict` is set and a part is damaged, or
            `out` exists or lies in `path`.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    context = ImportContext(camera=camera, hz=hz, strict=strict)
    found, read = _read(path, format, context)
    counts: list[tuple[int, int]] = []
    now = datetime.now(UTC)
    with new_folder(out, path) as folder:
        for episode in read:
            if not counts:  # Folder names begin with this time, so that episodes keep their order.
                with suppress(ValueError):
                    now = datetime.fromisoformat(episode.header.created).astimezone(UTC)
            counts += _write(episode, folder, now, context)
        if not counts:
            about = [f"{kind}: {text}".removesuffix(".") for kind, text in context.findings]
            raise DemosError(f"There is nothing to import in {path} ({'; '.join(about)}).")
    steps, pictures = map(sum, zip(*counts, strict=True))
    return Converted(found, len(counts), steps, pictures, context.findings)


def _read(path: Path, format: str, context: ImportContext) -> tuple[str, Iterator[ExchangeEpisode]]:
    """Return the format of a folder, and an iterator over its episodes with intact records."""
    names = ["auto", *(name for name, form in formats().items() if form.read)]
    require_known("format", names, format)
    form = formats()[find_format(path) if format == "auto" else format]
    if form.name not in _formats_of(path):
        raise DemosError(f"{path} is not {format}: expected {form.sign}; or omit --format.")
    _require_options(form, camera=context.camera, hz=context.hz is not None)
    if context.hz is not None and not 0.0 < context.hz < math.inf:
        raise DemosError(f"--hz must be positive, got {context.hz:g}.")
    assert form.read is not None
    read = form.read(path, context)
    return form.name, (replace(one, records=whole_records(one, context)) for one in read)


def find_format(path: Path) -> str:
    """Detect the format of a folder.

    Raises:
        DemosError: If the folder does not exist, or has no known format, or several formats; the
            error lists them.
    """
    found = _formats_of(path)
    if len(found) == 1:
        return found[0]
    if found:
        raise DemosError(f"{path} looks like {' and '.join(found)}: choose with --format.")
    if any(map(is_episode, (path, *path.iterdir()))):
        raise DemosError(f"{path} is a recording already: use it as it is.")
    signs = [f"{form.sign} ({name})" for name, form in formats().items() if form.read]
    raise DemosError(f"{path} cannot be imported: expected {' or '.join(signs)}.")


def _formats_of(path: Path) -> list[str]:
    if not path.is_dir():
        where = "is a file: give its folder" if path.exists() else "does not exist"
        raise DemosError(f"{path} {where}.")
    return [name for name, form in formats().items() if form.detect and form.detect(path)]


def _write(
    episode: ExchangeEpisode, folder: Path, now: datetime, context: ImportContext
) -> list[tuple[int, int]]:
    """Write an episode; return its numbers of steps and images in a list, empty without steps."""
    excluded: dict[int, str] = {}
    pictures, shown, writer = 0, None, None
    try:
        created = episode.header.created
        with EpisodeWriter.create(folder, episode.header, now=now, created=created) as writer:
            for record in episode.records:
                index = writer.add(record.step, record.jpeg)
                pictures += record.jpeg is not None and record.jpeg is not shown
                shown = record.jpeg
                for mark in record.marks:
                    writer.mark(mark)
                if record.dropped is not None:
                    excluded[index] = record.dropped
                if writer.is_full:
                    raise DemosError("longer than an episode may be, about an hour at 100 Hz.")
            writer.close(episode.outcome)
        # Consecutive steps that are excluded for the same reason become one `Drop`.
        runs = groupby(enumerate(excluded.items()), key=lambda it: (it[1][1], it[1][0] - it[0]))
        for (why, _), run in runs:
            indexes = [index for _, (index, _) in run]
            edit(writer.path, Drop(indexes[0], indexes[-1], why))
        if writer.steps:
            return [(writer.steps, pictures)]
    except DemosError as error:
        if context.strict:
            raise
        text = str(error).removesuffix(".")
        text = text if writer is None else text.replace(str(writer.path), "the episode")
        context.report("left out", text, episode.name)
    if writer is not None:
        shutil.rmtree(writer.path)
    return []
