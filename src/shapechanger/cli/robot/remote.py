"""`shapechanger robot find | remember | stop | fetch`: robots on the network."""

from __future__ import annotations

import getpass
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro
from rich.table import Table

from shapechanger.cli.console import counted, print_table, say
from shapechanger.demos.episodes.reader import read_header
from shapechanger.errors import DemosError, LinkError, RobotRefused, ShapechangerError
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import KnownRobot, forget, known_names, recall, remember
from shapechanger.robot.client.recordings import episodes_there, fetch_episode
from shapechanger.robot.discovery import find
from shapechanger.robot.link.messages import VERSION

_KEY_VARIABLE = "SHAPECHANGER_KEY"

RobotName = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="ROBOT", help="Name of a robot that `remember` has stored."),
]


@dataclass(frozen=True)
class RobotFind:
    """List the robots on this network, or remove a known one."""

    seconds: float = 2.0
    """Time to listen, s."""
    forget: str = ""
    """Local name of a known robot to remove, instead of listing."""

    def run(self) -> None:
        if self.forget:
            forget(self.forget)
            return
        if not 0.0 < self.seconds <= 60.0:
            raise LinkError(f"--seconds must be above 0 and at most 60, got {self.seconds}.")
        known: dict[str, str] = {}
        for name in known_names():
            try:
                known[recall(name).fingerprint] = name
            except (ShapechangerError, OSError) as error:
                say(f"{name} is skipped: {error}", stderr=True)
        found = find(self.seconds)
        if not found:
            say(
                "No robot answers. A network may block multicast DNS; connecting by address "
                "still works."
            )
            return
        table = Table("robot", "body", "address", "known as", "", box=None, pad_edge=False)
        for robot in found:
            other = "" if robot.version == str(VERSION) else f"link version {robot.version}"
            name = known.get(robot.fingerprint, "")
            table.add_row(robot.name, robot.body, str(robot.address), name, other)
        print_table(table)


@dataclass(frozen=True)
class RobotRemember:
    """Store a robot's address and key under a name."""

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Local name of the robot."""
    address: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ADDRESS")]
    """Address, as HOST or HOST:PORT."""
    fingerprint: str
    """SHA-256 of the robot's certificate, as `robot key` shows it; "insecure" for no TLS."""

    def run(self) -> None:
        """Ask for the key, which would be visible on a command line, and store everything."""
        key = os.environ.get(_KEY_VARIABLE, "")
        if not key and sys.stdin.isatty():
            key = getpass.getpass(f"key of {self.name}: ")
        elif not key:
            key = sys.stdin.readline()
            if not key.strip():
                raise LinkError(
                    f"The robot's key is needed: type it, or set {_KEY_VARIABLE}. "
                    "`shapechanger robot key NAME` shows it on the robot."
                )
        path = remember(KnownRobot(self.name, self.address, key.strip(), self.fingerprint))
        say(f"wrote {path}")


# Time limit for the report of a stop, s. A guard stops within a tick and then reports it.
_CONFIRMED_WITHIN_S: Final = 2.0


@dataclass(frozen=True)
class RobotStop:
    """Stop a robot immediately, whoever drives it, until a person arms it again."""

    robot: RobotName
    reason: str = "a person typed `robot stop`"
    """Reason, which other clients show to people."""

    def run(self) -> None:
        known = recall(self.robot)
        try:
            with RobotClient.connect(known, role="person", frames=False) as robot:
                robot.emergency_stop(self.reason)
                until_s = time.monotonic() + _CONFIRMED_WITHIN_S
                while not (seen := robot.ask().message).emergency:
                    if time.monotonic() > until_s:
                        raise LinkError("The robot answers, but does not report that it stopped.")
        except LinkError as error:
            say(
                f"error: {error}\nThe stop was not confirmed: go there, and cut its power.",
                stderr=True,
            )
            sys.exit(1)
        say(
            f"{self.robot} is stopped. {seen.stop_reason}\n"
            f"Only a person lets it drive again: shapechanger robot drive {self.robot}, and E."
        )


@dataclass(frozen=True)
class RobotFetch:
    """Download a robot's recordings to this machine; only new data are transferred."""

    robot: RobotName
    out: Annotated[Path, tyro.conf.arg(metavar="DATA")]
    """Folder for the episodes; interrupted downloads there are resumed."""
    episodes: tuple[str, ...] = ()
    """Ids of the episodes to fetch; all if not given."""

    def run(self) -> None:
        failed = 0
        with RobotClient.connect(recall(self.robot), frames=False) as robot:
            there = episodes_there(robot, self.episodes)
            if not there:
                say(f"{self.robot} has no recordings yet.")
            for episode in there:
                busy = robot.recorder
                if busy is not None and busy.recording and busy.episode == episode.id:
                    say(f"{episode.id} is still being recorded: fetch it later.")
                    continue
                try:
                    came, own = fetch_episode(robot, episode.id, self.out)
                except (DemosError, RobotRefused) as error:
                    failed += 1
                    say(f"{episode.id}: {error}", stderr=True)
                    continue
                news = f"{came} lines downloaded" if came else "no new lines"
                if own:
                    news += f", {counted(own, 'edit')} made here kept"
                say(f"{episode.id}: {episode.kept} steps kept of {episode.steps}, {news}")
                if read_header(self.out / episode.id)[1] is None:
                    say(f"  it is incomplete: shapechanger demos repair {self.out / episode.id}")
        if failed:
            sys.exit(1)
