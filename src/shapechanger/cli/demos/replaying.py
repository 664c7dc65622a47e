"""`shapechanger demos replay`: what was recorded again, as a film, in an env or on a robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.demos.places import episode_at
from shapechanger.errors import DemosError

__all__ = ["Replay"]


@dataclass(frozen=True)
class Replay:
    """Play an episode again: as a film, in an env, or on a robot."""

    episode: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
    """Folder of the episode."""
    film: Path | None = None
    """A film to write, such as out.mp4, with the actions drawn in."""
    env: str = ""
    """Id of an env to play the actions in, from the seed that was recorded; it says how far the
    two come apart."""
    robot: str = ""
    """Name of a robot to play the actions on, see `robot remember`; a person at this terminal
    arms it, and any key stops it."""

    def run(self) -> None:
        """Play it where it was asked for."""
        asked = [bool(self.film), bool(self.env), bool(self.robot)]
        if sum(asked) != 1:
            raise DemosError("An episode is played with one of --film, --env and --robot.")
        episode = episode_at(self.episode)
        if not episode.kept:
            raise DemosError(f"No step of {episode.path} counts: `shapechanger demos good` it.")
        if self.film is not None:
            from shapechanger.cli.demos.filming import film

            film(episode, self.film)
        elif self.env:
            from shapechanger.cli.demos.again import play_in_env

            play_in_env(episode, self.env)
        else:
            from shapechanger.cli.demos.on_robot import play_on_robot

            play_on_robot(episode, self.robot)
