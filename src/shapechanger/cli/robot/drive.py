"""`shapechanger robot drive`: a person drives, or is in charge while a policy does."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import LinkError

if TYPE_CHECKING:
    from shapechanger.cli.robot.piloting import Pilot
    from shapechanger.remote.client import RobotClient
    from shapechanger.remote.known_robots import KnownRobot

__all__ = ["Drive"]

_LOOK_EVERY_S: Final = 0.2


@dataclass(frozen=True)
class Drive:
    """Drive a robot: in its console, where there is a browser, or with the keys of this terminal.

    A person comes before any program. With --policy a policy drives once a person lets it, and the
    person may take over at any time: what they do then can be learned from.
    """

    robot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
    """Name of a robot that is known here, see `remember`."""
    cap: float = 0.5
    """Largest steering and throttle to ask for with the keys, 0 to 1; + and - change it."""
    terminal: bool = False
    """Drive with the keys of this terminal, even where a browser could show the console."""
    policy: Path | None = None
    """A policy that drives when you let it, such as `shapechanger demos train` writes."""
    record: Path | None = None
    """Record all of it on the robot, and bring it to this folder at the end."""

    def run(self) -> None:
        """Drive until Q, or until Ctrl-C beside the console."""
        from shapechanger.cli.robot.opening import can_open
        from shapechanger.cli.robot.piloting import load_pilot
        from shapechanger.remote.known_robots import recall

        if not 0.0 < self.cap <= 1.0:
            raise LinkError(f"The cap is above 0 and at most 1, got {self.cap}.")
        known = recall(self.robot)
        pilot = None if self.policy is None else load_pilot(self.policy, known)
        if self.terminal or not can_open():
            self._drive_here(known, pilot)
        else:
            self._drive_there(known, pilot)

    def _drive_here(self, known: KnownRobot, pilot: Pilot | None) -> None:
        """With the keys of this terminal."""
        from contextlib import nullcontext

        from shapechanger.cli.robot.driving import Driving
        from shapechanger.cli.robot.recorded import recorded
        from shapechanger.remote.client import RobotClient
        from shapechanger.teleop.terminal import Terminal

        with (
            Terminal() as terminal,
            RobotClient.connect(known, role="person", frames=False) as robot,
        ):
            driving = Driving(robot, terminal, self.cap, pilot)
            robot.take()
            with recorded(robot, known.name, self.record), pilot or nullcontext():
                driving.run()

    def _drive_there(self, known: KnownRobot, pilot: Pilot | None) -> None:
        """In the console; this process stays only where it has something to do."""
        from contextlib import nullcontext

        from shapechanger.cli.robot.opening import open_console
        from shapechanger.cli.robot.recorded import recorded
        from shapechanger.remote.client import RobotClient

        with RobotClient.connect(known, role="person", frames=False) as robot:
            console = plain_console()
            address = open_console(known)
            console.print(
                f"The console of {known.name} is at {address}, and opens in your browser, which "
                "warns of its certificate once. --terminal drives with the keys of this terminal.",
                soft_wrap=True,
            )
            if pilot is None and self.record is None:
                return
            with recorded(robot, known.name, self.record), pilot or nullcontext():
                console.print("Ctrl-C ends this.")
                _stay(robot, pilot)


def _stay(robot: RobotClient, pilot: Pilot | None) -> None:
    """Say what the policy says, until Ctrl-C or until it can no longer drive."""
    console = plain_console()
    said = ""
    try:
        while robot.alive:
            robot.ping()
            if pilot is not None:
                pilot.require_well()
                if pilot.note != said:
                    said = pilot.note
                    console.print(said, soft_wrap=True)
            time.sleep(_LOOK_EVERY_S)
    except KeyboardInterrupt:
        console.print("Ended.")
