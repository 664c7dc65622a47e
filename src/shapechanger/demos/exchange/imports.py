"""From the formats of others to episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step, drop
from shapechanger.demos.exchange.csv_in import read_csv
from shapechanger.demos.exchange.formats import Format, require_format
from shapechanger.demos.exchange.keys_2017 import read_2017
from shapechanger.demos.exchange.minari_in import read_minari
from shapechanger.demos.exchange.places import new_folder
from shapechanger.demos.exchange.recorded import Recorded, seen
from shapechanger.demos.exchange.tub import read_tub
from shapechanger.errors import DemosError

__all__ = ["Imported", "import_episodes", "import_recording"]

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
