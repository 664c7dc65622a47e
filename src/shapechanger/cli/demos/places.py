"""From what a user types to an episode."""

from __future__ import annotations

from pathlib import Path

from shapechanger.demos.episodes import Episode, episodes_of, read_episode
from shapechanger.errors import DemosError, UnknownName

__all__ = ["episode_at", "episode_path", "range_of"]


def episode_path(path: Path) -> Path:
    """The folder of one episode; that of a recording will do where it has only one.

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
    """One episode, see `episode_path`.

    Raises:
        BrokenEpisode: If it is not whole.
        DemosError: If there is none, or more than one, or it has no steps.
    """
    episode = read_episode(episode_path(path))
    if not episode.steps:
        raise DemosError(f"{episode.path} has no steps.")
    return episode


def range_of(episode: Episode, first: int | None, last: int | None) -> tuple[int, int]:
    """The steps from `first` to `last`, each of which is that of the episode where it is None.

    Raises:
        DemosError: If there are no such steps.
    """
    least, most = episode.steps[0].index, episode.steps[-1].index
    one, two = least if first is None else first, most if last is None else last
    if not least <= one <= two <= most:
        raise DemosError(f"{episode.path} has the steps {least} to {most}, and not {one} to {two}.")
    return one, two
