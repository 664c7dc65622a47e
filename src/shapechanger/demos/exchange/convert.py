"""Import and export of recordings, the registry of formats, and their detection."""

from __future__ import annotations

import math
import shutil
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from importlib.metadata import entry_points
from itertools import groupby, pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Final

from msgspec import structs

from shapechanger.demos.episodes import (
    Episode,
    EpisodeHeader,
    EpisodeWriter,
    Step,
    drop,
    episodes_of,
    read_episode,
)
from shapechanger.demos.episodes.files import is_episode
from shapechanger.demos.episodes.records import Keep, longest_period_s
from shapechanger.demos.exchange import csv_files, lerobot, mcap, minari, tub
from shapechanger.demos.exchange.files import cannot_read, new_folder
from shapechanger.demos.exchange.format import (
    ExchangeEpisode,
    ExchangeStep,
    ExportContext,
    Format,
    ImportContext,
    kept_steps,
)
from shapechanger.errors import DemosError, OutputError, UnknownName
from shapechanger.files import cannot_write
from shapechanger.layout import Layout

_GROUP: Final = "shapechanger.formats"
_OWN: Final = (tub.FORMAT, minari.FORMAT, lerobot.FORMAT, csv_files.FORMAT, mcap.FORMAT)


@cache
def formats() -> Mapping[str, Format]:
    """Return all formats by name: our own, and those that entry points of other packages name.

    Raises:
        DemosError: If an entry point does not name a format, or one with a name that is taken.
    """
    found = {form.name: form for form in _OWN}
    for point in entry_points(group=_GROUP):
        form = point.load()
        if not isinstance(form, Format) or form.name in found:
            raise DemosError(
                f"The entry point {point.name} in {_GROUP} must name a Format of another name than "
                f"{', '.join(found)}."
            )
        found[form.name] = form
    return MappingProxyType(found)


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        format: Name of the format.
        episodes: Number of episodes.
        steps: Number of steps written.
        left_out: Number of excluded steps that were not written.
        notes: What differs from the recording, as sentences.
    """

    format: str
    episodes: int
    steps: int
    left_out: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Imported:
    """Result of an import.

    Attributes:
        format: Name of the format.
        episodes: Number of episodes.
        steps: Number of steps.
        pictures: Number of images.
        left_out: What is not imported, a line for each reason.
        warnings: Contradictions in the source, as sentences.
        notes: Further facts, as sentences.
    """

    format: str
    episodes: int
    steps: int
    pictures: int
    left_out: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def export_recording(
    data: Path,
    out: Path,
    format: str,
    *,
    dropped: bool = False,
    task: str = "",
    images: bool = False,
) -> Exported:
    """Export a recording.

    Args:
        data: A recording, or one episode; it is not changed.
        out: The folder to create, atomically.
        format: Name of one of the `formats`.
        dropped: Whether to export excluded steps too, marked as such; minari, csv and mcap only.
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
    if dropped and "dropped" not in form.options:
        raise DemosError(
            f"The format {format} cannot mark excluded steps: export to {_with_option('dropped')}, "
            "or leave the excluded steps out."
        )
    if (task or images) and not form.options >= {"task", "images"}:
        raise DemosError(
            f"Tasks and the choice of images are of {_with_option('task')}, and not of {format}."
        )
    read = [read_episode(path) for path in episodes_of(data)]
    chosen = [(episode, episode.steps if dropped else episode.kept) for episode in read]
    if not any(steps for _, steps in chosen):
        raise DemosError(f"There is nothing to export: {data} has no steps that are kept.")
    if form.consecutive:
        episodes, notes = _consecutive_parts(chosen, form)
        _require_alike(episodes, form.title)
    else:
        episodes, notes = [_exchanged(episode, steps) for episode, steps in chosen], list[str]()
    rewarded = all(step.reward is not None for one in read for step in one.kept)
    context = ExportContext(out=out, task=task, images=images, rewarded=rewarded)
    with new_folder(out, data) as folder:
        try:
            steps = form.write(episodes, folder, context)
        except OutputError:  # Already worded, and a subclass of OSError.
            raise
        except OSError as error:
            raise cannot_write(out, error) from error
        except OverflowError as error:
            raise DemosError(f"A number in {data} is too large for {format}: {error}.") from error
    total = sum(len(episode.steps) for episode in read)
    return Exported(format, len(episodes), steps, total - steps, tuple(notes))


def _exchanged(episode: Episode, steps: Sequence[Step]) -> ExchangeEpisode:
    rows, name = _rows(episode, steps), episode.path.name
    return ExchangeEpisode(header=episode.header, rows=rows, name=name, outcome=episode.outcome)


def _rows(episode: Episode, steps: Sequence[Step]) -> Iterator[ExchangeStep]:
    newest = episode.steps[-1].index if episode.steps else -1
    kept = {step.index for step in episode.kept}
    why = {
        index: drop.why
        for drop in episode.drops
        if not isinstance(drop, Keep)
        for index in range(max(0, drop.first), min(drop.last, newest) + 1)
    }
    marks: dict[int, list[str]] = defaultdict(list)
    for mark in episode.marks:
        marks[mark.step].append(mark.text)
    frame = ""
    for step in steps:
        yield ExchangeStep(
            step=step,
            jpeg=episode.jpeg(step) if step.frame != frame else None,
            marks=tuple(marks.get(step.index, ())),
            dropped=None if step.index in kept else why.get(step.index, ""),
        )
        frame = step.frame


def _consecutive_parts(
    episodes: Sequence[tuple[Episode, Sequence[Step]]], form: Format
) -> tuple[list[ExchangeEpisode], list[str]]:
    """Split episodes where steps are excluded or missing, and at pauses; return notes, too."""
    parts: list[ExchangeEpisode] = []
    off_s: list[float] = []
    pauses_s: list[float] = []
    missing = 0
    for episode, steps in episodes:
        hz, starts = episode.header.control_hz, [0] if steps else []
        for number, (one, two) in enumerate(pairwise(steps), 1):
            passed_s = _passed_s(one, two)
            if two.index != one.index + 1:
                missing += 1
            elif passed_s is not None and passed_s > longest_period_s(hz):
                pauses_s.append(passed_s)
            else:
                continue
            starts.append(number)
        for start, end in pairwise([*starts, len(steps)]):
            part = _exchanged(episode, steps[start:end])
            header = replace(part.header, created=_started(episode, steps[start]))
            outcome = episode.outcome if end == len(steps) else ""
            parts.append(replace(part, header=header, outcome=outcome))
            times_s = enumerate(_passed_s(steps[start], step) for step in steps[start:end])
            by_s = max(0.0 if at is None else abs(at - n / hz) for n, at in times_s)
            off_s += [by_s] if by_s > 0.5 / hz else []
    notes: list[str] = []
    whole = sum(bool(steps) for _, steps in episodes)
    if len(parts) > whole:
        where = [f"excluded or missing steps ({missing} times)"] if missing else []
        if pauses_s:
            where.append(f"pauses ({len(pauses_s)}, up to {max(pauses_s):.4g} s)")
        notes.append(
            f"Episodes are split at {' and '.join(where)}, because {form.title} takes each "
            f"step for the successor of the one before: {whole} became {len(parts)}."
        )
    if off_s and not form.timed:
        notes.append(
            f"{form.title} takes the time of a step to be its number divided by the rate, "
            f"which is off by more than half a period in {len(off_s)} of {len(parts)} "
            f"episodes, by up to {max(off_s):.4g} s."
        )
    return parts, notes


def _passed_s(one: Step, two: Step) -> float | None:
    """Return the time between two steps on the robot's clock, s; None if it is unknown."""
    for now, later in ((one.decided_ns, two.decided_ns), (one.captured_ns, two.captured_ns)):
        if now is not None and later is not None:
            return (later - now) / 1e9
    return None


def _started(episode: Episode, first: Step) -> str:
    """Return when a part of an episode began, ISO 8601; the episode's start if unknown."""
    since_s = _passed_s(episode.steps[0], first) or 0.0
    try:
        began = datetime.fromisoformat(episode.header.created) + timedelta(seconds=since_s)
    except (ValueError, OverflowError):
        return episode.header.created
    return began.isoformat(timespec="milliseconds")


def _require_alike(episodes: Sequence[ExchangeEpisode], title: str) -> None:
    first, *others = [(episode.name, _kind(episode.header)) for episode in episodes]
    for name, kind in others:
        for what, ours in first[1].items():
            if ours != kind[what]:
                raise DemosError(
                    f"{first[0]} has {what} {ours}, and {name} {kind[what]}: a {title} "
                    "dataset has one kind of episode, so export each kind to a dataset of its own."
                )


def _kind(header: EpisodeHeader) -> dict[str, str]:
    """Describe what all episodes of a dataset have in common."""
    action, state = (
        ", ".join(map(str, Layout.from_json(layout))) if layout else "none"
        for layout in (header.action_layout, header.state_layout)
    )
    size = "no size" if header.image_size is None else "{} x {}".format(*header.image_size)
    about = {"the actions": action, "the state": state, "images of": size}
    return about | {"steps a second:": f"{header.control_hz:g}"}


def _with_option(option: str, word: str = "or") -> str:
    """Return the names of the formats with an option, such as "csv, mcap or minari"."""
    *most, last = sorted(name for name, form in formats().items() if option in form.options)
    return f"{', '.join(most)} {word} {last}" if most else last


def import_episodes(
    path: Path, format: str = "auto", context: ImportContext | None = None
) -> Iterator[tuple[EpisodeHeader, Iterator[tuple[Step, bytes | None]]]]:
    """Read a recording in another format, without writing anything.

    Args:
        path: A folder in one of the `formats`.
        format: Name of one of them, or "auto" to detect it.
        context: Options; it collects what is left out. None to refuse a source that is incomplete
            or contradicts itself.

    Yields:
        For each episode its header, and an iterator over its steps, each with the JPEG of its
        image (None without images). Steps that share an image share the object. The iterator
        can be used once, at any time.

    Raises:
        DemosError: If something is damaged or missing, possibly not before it is read.
        UnknownName: If there is no such format.
        MissingExtra: If a package that the format needs is not installed.
    """
    context = ImportContext(strict=True) if context is None else context
    for episode in _read(path, format, context)[1]:
        if context.strict:
            context.require_whole(path)
        kept = enumerate(kept_steps(episode.rows))
        yield episode.header, ((structs.replace(step, index=n), jpeg) for n, (step, jpeg) in kept)
    if context.strict:
        context.require_whole(path)


def import_recording(
    path: Path,
    out: Path,
    format: str = "auto",
    *,
    camera: str = "",
    hz: float | None = None,
    strict: bool = False,
) -> Imported:
    """Import a recording: what is whole, with a report on the rest.

    Args:
        path: A folder in one of the `formats`; it is not changed.
        out: The recording to create, atomically.
        format: Name of one of the formats, or "auto" to detect it.
        camera: Which camera to take, such as "front"; "" for the only one. LeRobot and tubs only.
        hz: Steps per second; None to read or measure them. Only for formats that do not state it.
        strict: Whether to refuse a source that is incomplete or contradicts itself.

    Raises:
        DemosError: If nothing in `path` is whole, or with `strict` not all of it, or `out` exists
            or lies in it.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    context = ImportContext(camera=camera, hz=hz, strict=strict)
    found, read = _read(path, format, context)
    now: datetime | None = None
    episodes = steps = pictures = 0
    with new_folder(out, path) as folder:
        for episode in read:
            # The folders of all episodes begin with the same time, so that their order is kept.
            now = now or _began(episode.header)
            added, shown = _write(episode, folder, now, context)
            whole = added > 0 or not context.left_out
            episodes, steps, pictures = episodes + whole, steps + added, pictures + shown
        if strict:
            context.require_whole(path)
        if not episodes or (context.left_out and not steps):
            why = f": {'; '.join(lines)}" if (lines := context.left_out_lines()) else ""
            raise DemosError(f"There is nothing to import in {path}{why}.")
    findings = map(tuple, (context.left_out_lines(), context.warnings, context.notes))
    return Imported(found, episodes, steps, pictures, *findings)


def _read(path: Path, format: str, context: ImportContext) -> tuple[str, Iterator[ExchangeEpisode]]:
    """Return the format of a folder, and an iterator over its episodes."""
    importable = [name for name, form in formats().items() if form.read]
    if format == "auto":
        format = find_format(path)
    elif format not in importable:
        raise UnknownName("format", format, ("auto", *importable))
    else:
        _require_folder(path)
        if format not in _formats_of(path):
            raise DemosError(f"{path} is not {format}: expected {_expected()}; or omit --format.")
    form = formats()[format]
    if context.camera and "camera" not in form.options:
        known = _with_option("camera", "and")
        raise DemosError(f"A camera is chosen in {known}, and {path} is {format}.")
    if context.hz is not None:
        if "hz" not in form.options:
            raise DemosError(f"The format {format} states the rate itself: leave out --hz.")
        if not 0.0 < context.hz < math.inf:
            raise DemosError(f"--hz must be positive, got {context.hz:g}.")
    assert form.read is not None
    return format, form.read(path, context)


def _began(header: EpisodeHeader) -> datetime:
    """Return when an episode began; the current time if that is unknown."""
    try:
        return datetime.fromisoformat(header.created).astimezone(UTC)
    except ValueError:
        return datetime.now(UTC)


def find_format(path: Path) -> str:
    """Detect the format of a folder.

    Raises:
        DemosError: If there is no such folder, or it has none or several of the formats; the error
            names what was found.
    """
    _require_folder(path)
    try:
        if is_episode(path) or any(is_episode(child) for child in path.iterdir()):
            raise DemosError(f"{path} is a recording already: use it as it is.")
        children = sorted(path.iterdir())
    except OSError as error:
        raise cannot_read(path, error) from error
    found = _formats_of(path)
    if len(found) > 1:
        raise DemosError(
            f"{path} looks like {' and '.join(found)}: choose with --format, such as --format "
            f"{found[0]}."
        )
    if found:
        return found[0]
    for child in children:
        if child.is_dir() and (below := _formats_of(child)):
            raise DemosError(
                f"{path} has none of the formats, but {child} in it is {below[0]}: import that."
            )
    what = "has nothing that can be imported" if children else "is empty"
    raise DemosError(f"{path} {what}: expected {_expected()}.")


def _expected() -> str:
    signs = [f"{form.sign} ({name})" for name, form in formats().items() if form.read]
    return f"{', '.join(signs[:-1])}, or {signs[-1]}"


def _require_folder(path: Path) -> None:
    if not path.exists():
        raise DemosError(f"There is no {path}.")
    if not path.is_dir():
        raise DemosError(f"{path} is a file: give the folder that it is in, {path.parent}.")


def _formats_of(path: Path) -> list[str]:
    return [name for name, form in formats().items() if form.detect and form.detect(path)]


def _write(
    episode: ExchangeEpisode, folder: Path, now: datetime, context: ImportContext
) -> tuple[int, int]:
    """Write one episode of a recording; return its numbers of steps and images."""
    pictures = 0
    excluded: list[tuple[int, str]] = []
    with EpisodeWriter.create(
        folder, episode.header, now=lambda: now, created=episode.header.created
    ) as writer:
        for row in episode.rows:
            try:
                index = writer.add(row.step, row.jpeg)
            except DemosError as error:
                raise DemosError(f"{episode.name} cannot be imported: {error}") from error
            pictures += row.jpeg is not None
            for mark in row.marks:
                writer.mark(mark)
            if row.dropped is not None:
                excluded.append((index, row.dropped))
        if writer.is_full:
            raise DemosError(
                f"{episode.name} is longer than an episode may be, which is about an hour at 100 "
                f"Hz: it has {writer.steps} steps. Split it."
            )
        writer.close(episode.outcome)
    # Consecutive steps that were dropped for one reason become one line.
    runs = groupby(enumerate(excluded), key=lambda pair: (pair[1][1], pair[1][0] - pair[0]))
    for why, group in runs:
        indexes = [index for _, (index, _) in group]
        drop(writer.path, indexes[0], indexes[-1], why[0])
    if not writer.steps and context.left_out:  # All its steps.
        shutil.rmtree(writer.path)
    return writer.steps, pictures
