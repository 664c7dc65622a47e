"""Merge the episodes of several recordings into one recording."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.demos.episodes.records import free_path, is_episode
from shapechanger.errors import DemosError, OutputError
from shapechanger.files import writing


def merge(sources: Sequence[Path], out: Path) -> list[tuple[Path, Path]]:
    """Copy episodes into one recording; the sources are not changed, and nothing is overwritten.

    All episodes are read before the first one is copied. A taken name gets the next free number.

    Args:
        sources: Recordings, or single episodes.
        out: Folder of the target recording; created if missing.

    Returns:
        Source and target folder of each episode.

    Raises:
        DemosError: If there are no episodes, or one is still being recorded, already in `out`, or
            has links.
        BrokenEpisode: If an episode is damaged.
        OutputError: If an episode cannot be copied; those copied before are complete.
    """
    if not sources:
        raise DemosError("There is nothing to merge: give at least one recording.")
    if is_episode(out):
        raise DemosError(f"{out} is an episode, but a recording is a folder of episodes.")
    episodes = [read_episode(path) for source in sources for path in episodes_of(source)]
    is_new = not out.exists() or (out.is_dir() and not any(out.iterdir()))
    there = [] if is_new else [read_episode(path) for path in episodes_of(out)]
    known = {_identity(episode): episode.path for episode in there}
    for episode in episodes:
        if not episode.closed:
            raise DemosError(f"{episode.path} is still recorded, or needs `demos repair`.")
        if same := known.get(_identity(episode)):
            raise DemosError(f"{episode.path} and {same} are the same episode.")
        known[_identity(episode)] = episode.path
        # A link would copy a file or a folder of another place into the recording.
        if link := next((path for path in episode.path.rglob("*") if path.is_symlink()), None):
            raise DemosError(f"{link} is a link, but an episode has only files: remove it.")
    return [(episode.path, _copied(episode.path, out)) for episode in episodes]


def _identity(episode: Episode) -> tuple[object, ...]:
    """Return fields that identify an episode, and that marks and drops do not change."""
    first = episode.steps[0] if episode.steps else None
    seen = (first.wall_ns, first.captured_ns, first.picture, first.action) if first else ()
    return (episode.header.created, len(episode.steps), *seen)


def _copied(source: Path, out: Path) -> Path:
    """Copy an episode atomically."""
    part, target = out / f".{source.name}.{os.getpid()}.part", free_path(out, source.name)
    try:
        with writing(target):
            out.mkdir(parents=True, exist_ok=True)
            shutil.copytree(source, part)
            part.rename(target)
    except OutputError:
        shutil.rmtree(part, ignore_errors=True)
        raise
    return target
