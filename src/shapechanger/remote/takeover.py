"""While a person has the robot: the program watches, says what it would do, and gets it back."""

from __future__ import annotations

import contextlib
from typing import Final

from shapechanger.errors import RobotRefused
from shapechanger.link.messages import Observation
from shapechanger.remote.client import RobotClient

__all__ = ["Takeover"]

_PERSON: Final = "person"


class Takeover:
    """Lets an episode go on while a person drives.

    A person who is done gives the robot back and arms it for the program; until both have
    happened, the program waits and moves nothing.

    Args:
        allowed: Whether an episode goes on at all when a person takes the robot.
    """

    def __init__(self, *, allowed: bool) -> None:
        self._allowed = allowed
        self._waits = False

    def start(self) -> None:
        """An episode begins: the robot is ours and armed."""
        self._waits = False

    def act(self, robot: RobotClient, values: tuple[float, ...], last: Observation) -> int:
        """Command, or say what we would do while somebody else commands.

        Returns:
            Number of the command or suggestion.

        Raises:
            LinkError: If the link is lost.
        """
        if not self._allowed or last.mine:
            return robot.command(values, answers=last.seq)
        if not last.holder:
            # The person may have changed their mind meanwhile; then they go on driving.
            with contextlib.suppress(RobotRefused):
                robot.take()
        return robot.suggest(values, answers=last.seq)

    def goes_on(self, seen: Observation) -> bool:
        """Whether the episode goes on though the robot is not ours, or not armed.

        It does where a person drives, or is about to give it back.
        """
        if not self._allowed or seen.emergency:
            return False
        if seen.mine and seen.armed:
            self._waits = False
        elif seen.holder_role == _PERSON or not seen.holder:
            self._waits = True
        return self._waits and (seen.mine or seen.holder_role == _PERSON or not seen.holder)

    @staticmethod
    def action(seen: Observation) -> tuple[float, ...] | None:
        """What a person commands; None where nobody but a program commands anything."""
        return seen.commanded if seen.commanded and seen.holder_role == _PERSON else None
