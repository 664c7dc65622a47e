"""Says of steps that were recorded whether they count, and marks them; nothing is taken away."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from shapechanger.demos.episodes.files import STEPS, cannot_write, lock, write_all
from shapechanger.demos.episodes.lines import encode_line
from shapechanger.demos.episodes.reader import Episode, read_episode
from shapechanger.errors import DemosError

__all__ = ["drop", "keep", "mark"]


def drop(path: Path, first: int, last: int, why: str) -> None:
    """Let steps of an episode no longer count.

    Args:
        path: Folder of the episode.
        first: Index of the first step.
        last: Index of the last step, which is dropped, too.
        why: Such as "cut" or "bad".

    Raises:
        DemosError: If there are no such steps, or the episode is being recorded.
        BrokenEpisode: If it is not whole.
        OutputError: If it cannot be written.
    """
    _append(path, {"kind": "drop", "first": first, "last": last, "why": why}, first, last)


def keep(path: Path, first: int, last: int, why: str = "") -> None:
    """Let steps of an episode count again; arguments and errors as those of `drop`."""
    _append(path, {"kind": "keep", "first": first, "last": last, "why": why}, first, last)


def mark(path: Path, step: int, text: str = "") -> None:
    """Mark a step of an episode with a few words; errors as those of `drop`."""
    _append(path, {"kind": "mark", "step": step, "text": text}, step, step)


def _append(path: Path, fields: dict[str, Any], first: int, last: int) -> None:
    episode = read_episode(path)
    fd = lock(path / STEPS, f"{path} is being recorded at this moment.")
    try:
        _require_steps(episode, first, last)
        write_all(fd, encode_line(fields))
    except OSError as error:
        raise cannot_write(path / STEPS, error) from error
    finally:
        os.close(fd)


def _require_steps(episode: Episode, first: int, last: int) -> None:
    if not episode.steps:
        raise DemosError(f"{episode.path} has no steps.")
    least, most = episode.steps[0].index, episode.steps[-1].index
    if not least <= first <= last <= most:
        raise DemosError(
            f"{episode.path} has the steps {least} to {most}, and not {first} to {last}."
        )
