"""`shapechanger robot fetch`: brings what a robot recorded to this machine."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import DemosError, RobotRefused

__all__ = ["Fetch"]


@dataclass(frozen=True)
class Fetch:
    """Bring what a robot recorded to this machine, byte for byte; a second time, what is new."""

    robot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
    """Name of a robot that is known here, see `remember`."""
    out: Annotated[Path, tyro.conf.arg(metavar="DATA")]
    """Folder to put the episodes into. What was cut off there goes on where it was."""
    episodes: tuple[str, ...] = ()
    """Only these episodes, by their ids; all of them if not given."""

    def run(self) -> None:
        """Fetch; exits with 1 where an episode could not be fetched."""
        from shapechanger.cli.robot.fetching import episodes_there, fetch_episode
        from shapechanger.remote.client import RobotClient
        from shapechanger.remote.known_robots import recall

        console, failed = plain_console(), 0
        with RobotClient.connect(recall(self.robot), frames=False) as robot:
            there = episodes_there(robot, self.episodes)
            if not there:
                console.print(f"{self.robot} has recorded nothing yet.", soft_wrap=True)
            for episode in there:
                busy = robot.recorder
                if busy is not None and busy.recording and busy.episode == episode.id:
                    console.print(f"{episode.id} is being recorded: later.", soft_wrap=True)
                    continue
                try:
                    came = fetch_episode(robot, episode.id, self.out)
                except (DemosError, RobotRefused) as error:
                    failed += 1
                    plain_console(stderr=True).print(f"{episode.id}: {error}", soft_wrap=True)
                    continue
                news = f"{came} lines came" if came else "nothing new"
                console.print(
                    f"{episode.id}: {episode.kept} steps kept of {episode.steps}, {news}",
                    soft_wrap=True,
                )
                if not episode.closed:
                    console.print(
                        f"  it was cut off: shapechanger demos repair {self.out / episode.id}",
                        soft_wrap=True,
                    )
        if failed:
            sys.exit(1)
