"""Import and export of recordings, and detection of formats."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Final, Literal

from shapechanger.demos.episodes import (
    EpisodeHeader,
    EpisodeWriter,
    Step,
    drop,
    episodes_of,
    read_episode,
)
from shapechanger.demos.episodes.files import is_episode
from shapechanger.demos.exchange.csv_files import TABLE, is_csv, read_csv, write_csv
from shapechanger.demos.exchange.files import cannot_read, new_folder
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.keys_2017 import LABELS, is_2017, read_2017, write_2017
from shapechanger.demos.exchange.lerobot_export import INFO, write_lerobot
from shapechanger.demos.exchange.lerobot_import import is_lerobot, read_lerobot
from shapechanger.demos.exchange.mcap_export import write_mcap
from shapechanger.demos.exchange.minari_export import (
    METADATA,
    is_minari,
    require_dataset_name,
    write_minari,
)
from shapechanger.demos.exchange.minari_import import read_minari
from shapechanger.demos.exchange.recorded import (
    ConsecutiveParts,
    ExchangeEpisode,
    exchange_episode,
    kept_steps,
)
from shapechanger.demos.exchange.tub_export import MANIFEST, write_tub
from shapechanger.demos.exchange.tub_files import is_tub
from shapechanger.demos.exchange.tub_import import read_tub
from shapechanger.errors import DemosError, OutputError, UnknownName
from shapechanger.files import cannot_write

Format = Literal["2017", "tub", "minari", "lerobot", "csv", "mcap"]


_DETECT: Final[dict[Format, Callable[[Path], bool]]] = {
    "2017": is_2017,
    "tub": is_tub,
    "minari": is_minari,
    "lerobot": is_lerobot,
    "csv": is_csv,
}
_READ: Final[dict[Format, Callable[[Path, ImportContext], Iterator[ExchangeEpisode]]]] = {
    "2017": read_2017,
    "tub": read_tub,
    "minari": read_minari,
    "lerobot": read_lerobot,
    "csv": read_csv,
}
_STATES_CAMERA: Final = ("lerobot", "tub")
_NEEDS_RATE: Final = ("2017", "tub", "minari")
_CONSECUTIVE: Final = {"lerobot": "LeRobot", "minari": "Minari"}
"""Formats in which each step follows the one before, and how to name them."""
_MARKS_DROPPED: Final = ("minari", "csv", "mcap")

FORMATS: Final[tuple[Format, ...]] = (*_READ, "mcap")
"""Names of the formats; mcap can only be exported."""

_EXPECTED: Final = (
    f"{LABELS} beside JPEGs (2017), {MANIFEST} or record_0.json (tub), data/{METADATA} (minari), "
    f"{INFO} (lerobot), or {TABLE} (csv)"
)


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

    format: Format
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
        pictures: Number of pictures.
        left_out: What is not imported, a line for each reason.
        warnings: Contradictions in the source, as sentences.
        notes: Further facts, as sentences.
    """

    format: Format
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
        format: One of the `FORMATS`.
        dropped: Whether to export excluded steps too, marked as such; minari, csv and mcap only.
        task: What the robot does, in words, for policies that follow language; lerobot only.
        images: Whether to store pictures as they were recorded, in place of video; lerobot only.

    Raises:
        DemosError: If the recording is damaged or does not fit the format, or `out` exists or lies
            in `data`.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    if format not in FORMATS:
        raise UnknownName("format", format, FORMATS)
    if dropped and format not in _MARKS_DROPPED:
        raise DemosError(
            f"The format {format} cannot mark excluded steps: export to minari, csv or mcap, "
            "or leave the excluded steps out."
        )
    if (task or images) and format != "lerobot":
        raise DemosError(f"Tasks and the choice of images are of lerobot, and not of {format}.")
    if format == "minari":
        require_dataset_name(out)
    read = [read_episode(path) for path in episodes_of(data)]
    if not any(episode.steps if dropped else episode.kept for episode in read):
        raise DemosError(f"There is nothing to export: {data} has no steps that are kept.")
    parts = ConsecutiveParts(_CONSECUTIVE.get(format, format))
    if format in _CONSECUTIVE:
        episodes = [part for one in read for part in parts.of(one, dropped=dropped)]
    else:
        episodes = [exchange_episode(episode, dropped=dropped) for episode in read]
    with new_folder(out, data) as folder:
        try:
            match format:
                case "2017":
                    steps = write_2017(episodes, folder)
                case "tub":
                    steps = write_tub(episodes, folder)
                case "minari":
                    steps = write_minari(episodes, folder, out.name)
                case "lerobot":
                    steps = write_lerobot(
                        episodes,
                        folder,
                        task=task,
                        images=images,
                        rewarded=all(s.reward is not None for one in read for s in one.kept),
                    )
                case "csv":
                    steps = write_csv(episodes, folder)
                case "mcap":
                    steps = write_mcap(episodes, folder)
        except OutputError:  # Already worded, and a subclass of OSError.
            raise
        except OSError as error:
            raise cannot_write(out, error) from error
        except OverflowError as error:
            raise DemosError(f"A number in {data} is too large for {format}: {error}.") from error
    total = sum(len(episode.steps) for episode in read)
    notes = parts.notes(timed=format == "minari")
    return Exported(format, len(episodes), steps, total - steps, tuple(notes))


def import_episodes(
    path: Path, format: str = "auto", context: ImportContext | None = None
) -> Iterator[tuple[EpisodeHeader, Iterator[tuple[Step, bytes | None]]]]:
    """Read a recording in another format, without writing anything.

    Args:
        path: A folder in one of the `FORMATS`.
        format: One of them, or "auto" to detect it.
        context: Options; it collects what is left out. None to refuse a source that is incomplete
            or contradicts itself.

    Yields:
        For each episode its header, and an iterator over its steps, each with the JPEG of its
        picture (None without pictures). Steps that share a picture share the object. The iterator
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
        yield episode.header, ((replace(step, index=n), jpeg) for n, (step, jpeg) in kept)
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
        path: A folder in one of the `FORMATS`; it is not changed.
        out: The recording to create, atomically.
        format: One of the formats, or "auto" to detect it.
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
    named_after: datetime | None = None
    episodes = steps = pictures = 0
    with new_folder(out, path) as folder:
        for episode in read:
            named_after = named_after or _began(episode.header)
            added, shown = _write(episode, folder, named_after, context)
            whole = added > 0 or not context.left_out
            episodes, steps, pictures = episodes + whole, steps + added, pictures + shown
        if strict:
            context.require_whole(path)
        if not episodes or (context.left_out and not steps):
            why = f": {'; '.join(lines)}" if (lines := context.left_out_lines()) else ""
            raise DemosError(f"There is nothing to import in {path}{why}.")
    return Imported(
        found,
        episodes,
        steps,
        pictures,
        tuple(context.left_out_lines()),
        tuple(context.warnings),
        tuple(context.notes),
    )


def _read(
    path: Path, format: str, context: ImportContext
) -> tuple[Format, Iterator[ExchangeEpisode]]:
    """Return the format of a folder, and an iterator over its episodes."""
    found = _require_format(format, path)
    if context.camera and found not in _STATES_CAMERA:
        raise DemosError(f"A camera is chosen in lerobot and tub, and {path} is {found}.")
    if context.hz is not None:
        if found not in _NEEDS_RATE:
            raise DemosError(f"The format {found} states the rate itself: leave out --hz.")
        if not 0.0 < context.hz < math.inf:
            raise DemosError(f"--hz must be positive, got {context.hz:g}.")
    return found, _READ[found](path, context)


def _began(header: EpisodeHeader) -> datetime:
    """Return when an episode began; the current time if that is unknown."""
    try:
        return datetime.fromisoformat(header.created).astimezone(UTC)
    except ValueError:
        return datetime.now(UTC)


def find_format(path: Path) -> Format:
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
        if child.is_dir() and (formats := _formats_of(child)):
            raise DemosError(
                f"{path} has none of the formats, but {child} in it is {formats[0]}: import that."
            )
    what = "has nothing that can be imported" if children else "is empty"
    raise DemosError(f"{path} {what}: expected {_EXPECTED}.")


def _require_format(name: str, path: Path) -> Format:
    """Return the named format, or the detected one for "auto"."""
    if name == "auto":
        return find_format(path)
    if name not in _READ:
        raise UnknownName("format", name, ("auto", *_READ))
    _require_folder(path)
    if not _DETECT[name](path):
        raise DemosError(f"{path} is not {name}: expected {_EXPECTED}; or omit --format.")
    return name


def _require_folder(path: Path) -> None:
    if not path.exists():
        raise DemosError(f"There is no {path}.")
    if not path.is_dir():
        raise DemosError(f"{path} is a file: give the folder that it is in, {path.parent}.")


def _formats_of(path: Path) -> list[Format]:
    return [name for name, detect in _DETECT.items() if detect(path)]


def _write(
    episode: ExchangeEpisode, folder: Path, named_after: datetime, context: ImportContext
) -> tuple[int, int]:
    """Write one episode of a recording; return its numbers of steps and pictures."""
    pictures = 0
    excluded: list[tuple[int, str]] = []
    # The folders of all episodes begin with the same time, so that their order is kept.
    with EpisodeWriter.create(
        folder, episode.header, now=lambda: named_after, created=episode.header.created
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
