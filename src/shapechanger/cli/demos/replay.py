"""`shapechanger demos replay`: replay an episode as a video, in an env or on a robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import say
from shapechanger.demos.episodes import episode_at
from shapechanger.demos.replay import play_in_env, write_episode_film
from shapechanger.envs.naming import env_ref
from shapechanger.errors import DemosError
from shapechanger.robot.client.recordings import play_on_robot


@dataclass(frozen=True)
class Replay:
    """Replay an episode as a video, in an env or on a robot."""

    episode: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODE")]
    """Folder of the episode."""
    film: Path | None = None
    """A film to write, such as out.mp4, with the actions drawn in."""
    env: str = ""
    """Id of an env to play the actions in, from the recorded seed; differences are reported."""
    robot: str = ""
    """Name of a robot to play the actions on, see `robot remember`; a person at this terminal
    arms it, and any key stops it."""

    def run(self) -> None:
        """Replay the episode."""
        asked = [bool(self.film), bool(self.env), bool(self.robot)]
        if sum(asked) != 1:
            raise DemosError("An episode is played with one of --film, --env and --robot.")
        episode = episode_at(self.episode)
        if not episode.kept:
            raise DemosError(f"No step of {episode.path} counts: `shapechanger demos good` it.")

        if self.film is not None:
            say(write_episode_film(episode, self.film))
        elif self.env:
            for line in play_in_env(episode, env_ref(self.env)):
                say(line)
        else:
            play_on_robot(episode, self.robot, say)
