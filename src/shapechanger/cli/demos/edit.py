"""`shapechanger demos cut | bad | good | mark | merge | repair`: edit recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.demos.episodes import Episode, drop, episodes_of, keep, mark, read_episode, repair
from shapechanger.errors import DemosError, UnknownName

if TYPE_CHECKING:
    from shapechanger.demos.episodes import Repair


def _episode_path(path: Path) -> Path:
    """Resolve a path to the folder of one episode, or of a recording with a single episode.

    Raises:
        DemosError: If there is none, or more than one.
        UnknownName: If the recording has no episode of this name.
    """
    if not path.exists() and path.parent.is_dir():
        known = [episode.name for episode in episodes_of(path.parent)]
        raise UnknownName("episode", path.name, known)
    found = episodes_of(path)
    if len(found) > 1:
        raise DemosError(f"{path} has {len(found)} episodes: name one of them, such as {found[0]}.")
    return next(iter(found))


def episode_at(path: Path) -> Episode:
    """Load one episode, see `_episode_path`.

    Raises:
        BrokenEpisode: If it is incomplete.
        DemosError: If there is none, or more than one, or it has no steps.
    """
    episode = read_episode(_episode_path(path))
    if not episode.steps:
        raise DemosError(f"{episode.path} has no steps.")
    return episode


def _range_of(episode: Episode, first: int | None, last: int | None) -> tuple[int, int]:
    """Return the range from `first` to `last`; None stands for the episode's own end.

    Raises:
        DemosError: If there are no such steps.
    """
    least, most = episode.steps[0].index, episode.steps[-1].index
    one, two = least if first is None else first, most if last is None else last
    if not least <= one <= two <= most:
        raise DemosError(f"{episode.path} has the steps {least} to {most}, and not {one} to {two}.")
    return one, two


_Episode = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
_From = Annotated[int | None, tyro.conf.arg(name="from", metavar="STEP")]
_To = Annotated[int | None, tyro.conf.arg(name="to", metavar="STEP")]


@dataclass(frozen=True)
class CutEpisode:
    """Keep a range of steps of an episode and drop the rest."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step that counts; that of the episode if not given."""
    last: _To = None
    """The last step that counts; that of the episode if not given."""

    def run(self) -> None:
        """Cut and print what is kept."""
        episode = episode_at(self.episode)
        first, last = _range_of(episode, self.first, self.last)
        least, most = episode.steps[0].index, episode.steps[-1].index
        if first > least:
            drop(episode.path, least, first - 1, "cut")
        if last < most:
            drop(episode.path, last + 1, most, "cut")
        _tell(episode.path)


@dataclass(frozen=True)
class Bad:
    """Drop steps of an episode, or all of them."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step; that of the episode if not given."""
    last: _To = None
    """The last step; that of the episode if not given."""

    def run(self) -> None:
        """Drop the steps and print what is kept."""
        episode = episode_at(self.episode)
        drop(episode.path, *_range_of(episode, self.first, self.last), "bad")
        _tell(episode.path)


@dataclass(frozen=True)
class Good:
    """Restore dropped steps of an episode, or all of them."""

    episode: _Episode
    """Folder of the episode."""
    first: _From = None
    """The first step; that of the episode if not given."""
    last: _To = None
    """The last step; that of the episode if not given."""

    def run(self) -> None:
        """Restore the steps and print what is kept."""
        episode = episode_at(self.episode)
        keep(episode.path, *_range_of(episode, self.first, self.last))
        _tell(episode.path)


@dataclass(frozen=True)
class MarkStep:
    """Mark a step of an episode."""

    episode: _Episode
    """Folder of the episode."""
    step: Annotated[int, tyro.conf.Positional, tyro.conf.arg(metavar="STEP")]
    """Number of the step."""
    text: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TEXT")] = ""
    """A few words."""

    def run(self) -> None:
        """Mark the step."""
        episode = episode_at(self.episode)
        mark(episode.path, self.step, self.text)
        plain_console().print(f"marked step {self.step} of {episode.path}", soft_wrap=True)


def _tell(path: Path) -> None:
    episode = read_episode(path)
    count, seconds = len(episode.kept), episode.seconds
    plain_console().print(
        f"{count} of {len(episode.steps)} steps of {path} count, {seconds:.1f} s", soft_wrap=True
    )


_MB: Final = 1e6


@dataclass(frozen=True)
class Merge:
    """Copy the episodes of several recordings into one; nothing is overwritten."""

    data: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA [DATA ...]")
    ]
    """Folders of the recordings, or of single episodes."""
    out: Path
    """Folder of the recording that they come into."""

    def run(self) -> None:
        """Merge and print a summary."""
        from shapechanger.demos.merging import merge

        done = merge(self.data, self.out)
        console = plain_console()
        for source, target in done.episodes:
            if source.name != target.name:
                console.print(f"{source} became {target.name}: its name was taken", soft_wrap=True)
        many = f"{len(done.episodes)} episode{'' if len(done.episodes) == 1 else 's'}"
        console.print(f"copied {many}, {done.bytes_ / _MB:.1f} MB, to {self.out}", soft_wrap=True)
        if done.layouts > 1:
            console.print(
                f"they have {done.layouts} different layouts, and a policy learns from one: "
                "`shapechanger demos list` says what they are of",
                soft_wrap=True,
            )


@dataclass(frozen=True)
class RepairEpisodes:
    """Repair a recording after a crash: keep complete steps and move the rest aside."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """Folder of the recording, or of one episode."""

    def run(self) -> None:
        """Repair each episode and print what was done."""
        console = plain_console()
        refused: list[DemosError] = []
        for path in episodes_of(self.data):
            try:
                done = repair(path)
            except DemosError as error:
                refused.append(error)
                continue
            console.print(f"{path.name}: {_told(done)}", soft_wrap=True)
        if refused:
            more = f" ({len(refused) - 1} more like it.)" if len(refused) > 1 else ""
            raise DemosError(f"{refused[0]}{more}")


def _told(done: Repair) -> str:
    """Describe a repair."""
    if not done.changed:
        return f"was whole, with {done.kept} steps"
    parts = [f"kept {done.kept} steps"]
    if done.lost:
        parts.append(f"moved {_counted(len(done.lost), 'line')} aside, because {_why(done.lost)}")
    if done.pictures:
        parts.append(f"moved {_counted(done.pictures, 'picture')} of no step aside")
    if not done.was_closed:
        parts.append("closed it")
    return ", ".join(parts)


def _why(reasons: tuple[str, ...]) -> str:
    """Return the first reason and the number of others."""
    rest = len(reasons) - 1
    return f"{reasons[0]}{f', and so on ({rest} more)' if rest else ''}"


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
