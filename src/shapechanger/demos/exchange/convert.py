"""From episodes to the formats of others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes import (
    EpisodeHeader,
    EpisodeWriter,
    Step,
    drop,
    episodes_of,
    read_episode,
)
from shapechanger.demos.exchange.csv_files import read_csv, write_csv
from shapechanger.demos.exchange.formats import FORMATS, Format, require_format
from shapechanger.demos.exchange.keys_2017 import read_2017, write_2017
from shapechanger.demos.exchange.minari_export import require_dataset_name, write_minari
from shapechanger.demos.exchange.minari_import import read_minari
from shapechanger.demos.exchange.places import new_folder
from shapechanger.demos.exchange.recorded import Recorded, recorded_of, seen
from shapechanger.demos.exchange.tub import read_tub, write_tub
from shapechanger.errors import DemosError, OutputError, UnknownName

__all__ = ["Exported", "Imported", "export_recording", "import_episodes", "import_recording"]


@dataclass(frozen=True, slots=True)
class Exported:
    """What was exported.

    Attributes:
        format: The format that it has.
        episodes: How many episodes there were.
        steps: How many steps were written.
        left_out: How many steps were not, because they do not count.
    """

    format: Format
    episodes: int
    steps: int
    left_out: int


def export_recording(data: Path, out: Path, format: str, *, dropped: bool = False) -> Exported:
    """Write a recording in a format of others.

    Args:
        data: A recording, or one episode; it stays as it is.
        out: The folder to make. It appears whole, or not at all.
        format: One of the `FORMATS`.
        dropped: Whether the steps that do not count go with it, and why they do not; only minari
            and csv can say so.

    Raises:
        DemosError: If the recording is not whole, does not fit the format, or `out` exists or lies
            in it.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    if format not in FORMATS:
        raise UnknownName("format", format, FORMATS)
    if dropped and format not in {"minari", "csv"}:
        raise DemosError(
            f"The format {format} cannot say that a step does not count: export to minari or csv, "
            "or leave the dropped steps out."
        )
    if format == "minari":
        require_dataset_name(out)
    read = [read_episode(path) for path in episodes_of(data)]
    kept = sum(len(episode.steps if dropped else episode.kept) for episode in read)
    if not kept:
        raise DemosError(f"No step of {data} counts, so there is nothing to export.")
    episodes = [recorded_of(episode, dropped=dropped) for episode in read]
    with new_folder(out, data) as folder:
        try:
            match format:
                case "2017":
                    steps = write_2017(episodes, folder)
                case "tub":
                    steps = write_tub(episodes, folder)
                case "minari":
                    steps = write_minari(episodes, folder, out.name)
                case _:
                    steps = write_csv(episodes, folder)
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"Cannot write {out}: {error.strerror or error}.") from error
        except OverflowError as error:
            raise DemosError(f"A number in {data} is too large for {format}: {error}.") from error
    total = sum(len(episode.steps) for episode in read)
    return Exported(_named(format), len(read), steps, total - steps)


def _named(name: str) -> Format:
    return next(known for known in FORMATS if known == name)


_READERS: Final[dict[Format, Callable[[Path], Iterator[Recorded]]]] = {
    "2017": read_2017,
    "tub": read_tub,
    "minari": read_minari,
    "csv": read_csv,
}


@dataclass(frozen=True, slots=True)
class Imported:
    """What was imported.

    Attributes:
        format: The format it had.
        episodes: How many episodes there are.
        steps: How many steps they have.
        pictures: How many pictures.
    """

    format: Format
    episodes: int
    steps: int
    pictures: int


def import_episodes(
    path: Path, format: str = "auto"
) -> Iterator[tuple[EpisodeHeader, Iterator[tuple[Step, bytes | None]]]]:
    """Read what others recorded, without writing anything.

    Args:
        path: A folder in one of the `FORMATS`.
        format: One of them, or "auto".

    Yields:
        For each episode its header, and its steps, each with the JPEG of the picture that it saw
        (None without pictures). The steps that share a picture share the object. They can be read
        at any time, once.

    Raises:
        DemosError: If something is not whole, while it is read; the sentence says what to do.
        UnknownName: If there is no such format.
        MissingExtra: If a package that the format needs is not installed.
    """
    for episode in _READERS[require_format(format, path)](path):
        yield episode.header, _numbered(episode)


def import_recording(path: Path, out: Path, format: str = "auto") -> Imported:
    """Make a recording of what others recorded.

    Args:
        path: A folder in one of the `FORMATS`; it stays as it is.
        out: The recording to make. It appears whole, or not at all.
        format: One of the formats, or "auto".

    Raises:
        DemosError: If `path` is not whole, or `out` exists or lies in it.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    found = require_format(format, path)
    began = datetime.now(UTC)
    episodes = steps = pictures = 0
    with new_folder(out, path) as folder:
        for episode in _READERS[found](path):
            added, shown = _write(episode, folder, began)
            episodes, steps, pictures = episodes + 1, steps + added, pictures + shown
        if not episodes:
            raise DemosError(f"There are no episodes in {path}.")
    return Imported(found, episodes, steps, pictures)


def _numbered(episode: Recorded) -> Iterator[tuple[Step, bytes | None]]:
    for index, (step, picture) in enumerate(seen(episode.rows)):
        yield replace(step, index=index), picture


def _write(episode: Recorded, folder: Path, began: datetime) -> tuple[int, int]:
    """Write one episode; how many steps and how many pictures it has."""
    pictures = 0
    gone: list[tuple[int, str]] = []
    # The folders of all episodes begin with the same time, so that their order stays.
    with EpisodeWriter.create(folder, episode.header, now=lambda: began) as writer:
        for row in episode.rows:
            try:
                index = writer.add(row.step, row.jpeg)
            except DemosError as error:
                raise DemosError(f"{episode.name} cannot be imported: {error}") from error
            pictures += row.jpeg is not None
            for mark in row.marks:
                writer.mark(mark)
            if row.dropped is not None:
                gone.append((index, row.dropped))
        writer.close(episode.outcome)
    # Steps in a row that were dropped for one reason are dropped in one line.
    for why, group in groupby(enumerate(gone), key=lambda pair: (pair[1][1], pair[1][0] - pair[0])):
        indexes = [index for _, (index, _) in group]
        drop(writer.path, indexes[0], indexes[-1], why[0])
    return writer.steps, pictures
