"""`shapechanger demos cut | bad | good | mark`: what counts, without taking anything away."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.cli.demos.places import episode_at, range_of
from shapechanger.demos.episodes import drop, keep, mark, read_episode

__all__ = ["Bad", "Cut", "Good", "MarkStep"]

_Episode = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
_From = Annotated[int | None, tyro.conf.arg(name="from", metavar="STEP")]
_To = Annotated[int | None, tyro.conf.arg(name="to", metavar="STEP")]


@dataclass(frozen=True)
class Cut:
    """Let only a part of an episode count: what is before and after it does not any more."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step that counts; that of the episode if not given."""
    last: _To = None
    """The last step that counts; that of the episode if not given."""

    def run(self) -> None:
        """Cut, and say what counts now."""
        episode = episode_at(self.episode)
        first, last = range_of(episode, self.first, self.last)
        least, most = episode.steps[0].index, episode.steps[-1].index
        if first > least:
            drop(episode.path, least, first - 1, "cut")
        if last < most:
            drop(episode.path, last + 1, most, "cut")
        _tell(episode.path)


@dataclass(frozen=True)
class Bad:
    """Let steps of an episode, or all of them, not count."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step; that of the episode if not given."""
    last: _To = None
    """The last step; that of the episode if not given."""

    def run(self) -> None:
        """Drop them, and say what counts now."""
        episode = episode_at(self.episode)
        drop(episode.path, *range_of(episode, self.first, self.last), "bad")
        _tell(episode.path)


@dataclass(frozen=True)
class Good:
    """Let steps of an episode, or all of them, count again, whatever they were dropped for."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step; that of the episode if not given."""
    last: _To = None
    """The last step; that of the episode if not given."""

    def run(self) -> None:
        """Keep them, and say what counts now."""
        episode = episode_at(self.episode)
        keep(episode.path, *range_of(episode, self.first, self.last))
        _tell(episode.path)


@dataclass(frozen=True)
class MarkStep:
    """Mark a step of an episode, to find it again."""

    episode: _Episode
    """Folder of the episode."""
    step: Annotated[int, tyro.conf.Positional, tyro.conf.arg(metavar="STEP")]
    """Number of the step."""
    text: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TEXT")] = ""
    """A few words."""

    def run(self) -> None:
        """Mark it."""
        episode = episode_at(self.episode)
        mark(episode.path, self.step, self.text)
        plain_console().print(f"marked step {self.step} of {episode.path}", soft_wrap=True)


def _tell(path: Path) -> None:
    episode = read_episode(path)
    count, seconds = len(episode.kept), episode.seconds
    plain_console().print(
        f"{count} of {len(episode.steps)} steps of {path} count, {seconds:.1f} s", soft_wrap=True
    )
