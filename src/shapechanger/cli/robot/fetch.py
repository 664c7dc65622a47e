"""`shapechanger robot fetch`: download recordings from a robot."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import counted, say
from shapechanger.demos.episodes.reader import read_header
from shapechanger.errors import DemosError, RobotRefused
from shapechanger.robot.client.known_robots import recall


@dataclass(frozen=True)
class FetchEpisodes:
    """Download a robot's recordings to this machine, or only what is new."""

    robot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
    """Name of a robot that is known here, see `remember`."""
    out: Annotated[Path, tyro.conf.arg(metavar="DATA")]
    """Folder for the episodes; interrupted downloads there are resumed."""
    episodes: tuple[str, ...] = ()
    """Only these episodes, by their ids; all of them if not given."""

    def run(self) -> None:
        """Download; exit with 1 if an episode failed."""
        from shapechanger.robot.client.client import RobotClient
        from shapechanger.robot.client.recordings import episodes_there, fetch_episode

        failed = 0
        with RobotClient.connect(recall(self.robot), frames=False) as robot:
            there = episodes_there(robot, self.episodes)
            if not there:
                say(f"{self.robot} has recorded nothing yet.")
            for episode in there:
                busy = robot.recorder
                if busy is not None and busy.recording and busy.episode == episode.id:
                    say(f"{episode.id} is still being recorded: fetch it later.")
                    continue
                try:
                    fetched = fetch_episode(robot, episode.id, self.out)
                except (DemosError, RobotRefused) as error:
                    failed += 1
                    say(f"{episode.id}: {error}", stderr=True)
                    continue
                news = f"{fetched.came} lines came" if fetched.came else "nothing new"
                if fetched.own:
                    news += f", and {counted(fetched.own, 'edit')} made here stay"
                say(f"{episode.id}: {episode.kept} steps kept of {episode.steps}, {news}")
                if read_header(self.out / episode.id)[1] is None:
                    say(f"  it is incomplete: shapechanger demos repair {self.out / episode.id}")
        if failed:
            sys.exit(1)
