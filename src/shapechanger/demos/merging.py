"""Merge the episodes of several recordings into one recording."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.demos.episodes.files import free_path, is_episode
from shapechanger.errors import DemosError, OutputError


class Merged(NamedTuple):
    """Result of a merge.

    Attributes:
        episodes: Source and target folder of each episode.
        layouts: Number of different layouts in the merged recording; learning needs exactly one.
        bytes_: Number of bytes copied.
    """

    episodes: tuple[tuple[Path, Path], ...]
    layouts: int
    bytes_: int


def merge(sources: Sequence[Path], out: Path) -> Merged:
    """Copy episodes into one recording; the sources are not changed, and nothing is overwritten.

    All episodes are read before the first one is copied. An episode whose name is taken gets the
    next free number.

    Args:
        sources: Recordings, or single episodes.
        out: Folder of the target recording; created if missing.

    Raises:
        DemosError: If there are no episodes, or one is still being recorded, already in `out`, or
            has links.
        BrokenEpisode: If an episode is damaged.
        OutputError: If an episode cannot be copied; those copied before are complete.
    """
    if not sources:
        raise DemosError("There is nothing to merge: give at least one recording.")
    episodes = [read_episode(path) for source in sources for path in episodes_of(source)]
    there: list[Episode] = []
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        if is_episode(out):
            raise DemosError(f"{out} is an episode, but a recording is a folder of episodes.")
        there = [read_episode(path) for path in episodes_of(out)]
    known = {_identity(episode): episode.path for episode in there}
    for episode in episodes:
        if not episode.closed:
            raise DemosError(
                f"{episode.path} is not closed: wait until its recording ends, or run "
                f"`shapechanger demos repair {episode.path}` if the recorder has crashed."
            )
        if same := known.get(_identity(episode)):
            raise DemosError(f"{episode.path} and {same} are the same episode.")
        known[_identity(episode)] = episode.path
        # A link would copy a file or a folder of another place into the recording.
        if link := next((path for path in episode.path.rglob("*") if path.is_symlink()), None):
            raise DemosError(f"{link} is a link, but an episode has only files: remove it.")
    headers = [episode.header for episode in [*there, *episodes]]
    layouts = {(header.action_layout, header.state_layout) for header in headers}
    pairs = tuple((episode.path, _copied(episode.path, out)) for episode in episodes)
    files = (file for _, target in pairs for file in target.rglob("*") if file.is_file())
    return Merged(pairs, len(layouts), sum(file.stat().st_size for file in files))


def _identity(episode: Episode) -> tuple[object, ...]:
    """Return fields that identify an episode, and that marks and drops do not change."""
    first = episode.steps[0] if episode.steps else None
    seen = (first.wall_ns, first.captured_ns, first.picture, first.action) if first else ()
    return (episode.header.created, len(episode.steps), *seen)


def _copied(source: Path, out: Path) -> Path:
    """Copy an episode atomically."""
    part = out / f".{source.name}.{os.getpid()}.part"
    target = free_path(out, source.name)
    try:
        out.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, part)
        part.rename(target)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        # `shutil.Error` lists many errors, and has no text of its own.
        reason = error.strerror or "not all of its files could be copied"
        raise OutputError(f"Cannot copy {source} to {out}: {reason}.") from error
    return target
