"""`shapechanger robot stop`: remote emergency stop."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Annotated, Final

import tyro

from shapechanger.cli.console import say
from shapechanger.errors import LinkError
from shapechanger.remote.known_robots import recall

# s. A guard stops within a tick and reports it in the next observation.
_CONFIRMED_WITHIN_S: Final = 2.0


@dataclass(frozen=True)
class Stop:
    """Stop a robot immediately, whoever drives it, until a person arms it again."""

    robot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
    """Name of a robot that is known here, see `remember`."""
    reason: str = "a person typed `robot stop`"
    """Why, for people to read."""

    def run(self) -> None:
        """Stop the robot; exit with 1 if it does not confirm."""
        from shapechanger.remote.client import RobotClient

        known = recall(self.robot)
        try:
            with RobotClient.connect(known, role="person", frames=False) as robot:
                robot.emergency_stop(self.reason)
                until_s = time.monotonic() + _CONFIRMED_WITHIN_S
                while not (seen := robot.ask().message).emergency:
                    if time.monotonic() > until_s:
                        raise LinkError("The robot answers, and does not say that it stopped.")
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
