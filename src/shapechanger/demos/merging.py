"""Puts the episodes of several recordings into one."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.errors import DemosError, OutputError

__all__ = ["Merged", "merge"]

_MOST: Final = 10_000


@dataclass(frozen=True, slots=True)
class Merged:
    """What was merged.

    Attributes:
        episodes: Where each episode was, and where it is now, too.
        layouts: How many kinds of layouts there are among them; who learns needs one.
        bytes_: How much was copied.
    """

    episodes: tuple[tuple[Path, Path], ...]
    layouts: int
    bytes_: int


def merge(sources: Sequence[Path], out: Path) -> Merged:
    """Copy episodes into one recording; the sources stay as they are, and nothing is overwritten.

    All of them are read before the first is copied. An episode whose name is taken by another one
    gets the next number that is free.

    Args:
        sources: Recordings, or single episodes.
        out: Folder of the recording that they come into; made where it is missing.

    Raises:
        DemosError: If an episode is still being recorded or there already, or there are none.
        BrokenEpisode: If one of them is not whole.
        OutputError: If they cannot be written. What was copied by then is whole.
    """
    if not sources:
        raise DemosError("There is nothing to merge: name at least one recording.")
    episodes = [read_episode(path) for source in sources for path in episodes_of(source)]
    there = [read_episode(path) for path in _episodes_in(out)]
    known = {_identity(episode): episode.path for episode in there}
    for episode in episodes:
        if not episode.closed:
            raise DemosError(
                f"{episode.path} is not closed: wait for its end, or "
                f"`shapechanger demos repair {episode.path}` if nobody records it any more."
            )
        identity = _identity(episode)
        if identity in known:
            raise DemosError(f"{episode.path} and {known[identity]} are the same episode.")
        known[identity] = episode.path
    layouts = {_layouts(episode) for episode in [*there, *episodes]}
    pairs: list[tuple[Path, Path]] = []
    copied = 0
    for episode in episodes:
        target = _copied(episode.path, out)
        pairs.append((episode.path, target))
        copied += sum(file.stat().st_size for file in target.rglob("*") if file.is_file())
    return Merged(tuple(pairs), len(layouts), copied)


def _episodes_in(out: Path) -> tuple[Path, ...]:
    """The episodes that are in a recording already.

    Raises:
        DemosError: If it is something else.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return ()
    found = episodes_of(out)
    if found == (out,):
        raise DemosError(f"{out} is an episode, and a recording is a folder of them.")
    return found


def _identity(episode: Episode) -> tuple[object, ...]:
    """What an episode is told from others by, also after somebody has judged its steps."""
    first = episode.steps[0] if episode.steps else None
    seen = (first.wall_ns, first.captured_ns, first.frame_crc, first.action) if first else ()
    return (episode.header.created, len(episode.steps), *seen)


def _layouts(episode: Episode) -> tuple[str, str]:
    return episode.header.action_layout, episode.header.state_layout


def _copied(source: Path, out: Path) -> Path:
    """Copy an episode, which appears whole or not at all."""
    part = out / f".{source.name}.{os.getpid()}.part"
    try:
        out.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, part)
        target = _free(out, source.name)
        part.rename(target)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        # Of many files that cannot be copied it gives a list, which has no words of its own.
        reason = error.strerror or "not all of its files can be copied"
        raise OutputError(f"Cannot copy {source} to {out}: {reason}.") from error
    return target


def _free(out: Path, name: str) -> Path:
    """The name, or the next one that nothing has."""
    if not (out / name).exists():
        return out / name
    stem, dash, number = name.rpartition("-")
    begun, start = (stem, int(number)) if dash and number.isdigit() else (name, 0)
    for following in range(start + 1, _MOST):
        path = out / f"{begun}-{following:04d}"
        if not path.exists():
            return path
    raise OutputError(f"{out} has too many episodes that are called as {name}.")
