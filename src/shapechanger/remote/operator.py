"""What happens before an episode: the robot is ours, is armed, and stands at the start."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.remote.client import RobotClient
from shapechanger.remote.inbox import Received

__all__ = ["Preparation"]

# s. How often to look whether a person has done something.
_LOOK_EVERY_S: Final = 0.05
_NS_PER_S: Final = 1e9


class Preparation:
    """The steps of one reset, which together may take so long and no longer.

    Args:
        timeout_s: How long, s.
        on_waiting: Is told in a sentence what is waited for, once for each thing.
        clock: The time, s; never runs backwards.
    """

    def __init__(
        self,
        timeout_s: float,
        on_waiting: Callable[[str], object] | None,
        clock: Callable[[], float],
    ) -> None:
        self._timeout_s = timeout_s
        self._on_waiting = on_waiting
        self._clock = clock
        self._until = clock() + timeout_s
        self._told: set[str] = set()

    def connect(self, make: Callable[[], RobotClient]) -> RobotClient:
        """Connect, however often it takes.

        Raises:
            RobotRefused: If the robot does not want us.
            LinkError: If it does not answer in time.
        """
        while True:
            try:
                return make()
            except RobotRefused:
                raise
            except LinkError as error:
                if not self._wait("The robot does not answer."):
                    raise LinkError(
                        f"{error} This was tried for {self._timeout_s:.0f} s."
                    ) from error

    def take(self, robot: RobotClient) -> None:
        """Become the one who commands, when whoever does it now is done.

        Raises:
            RobotRefused: If they are not in time.
        """
        while True:
            try:
                robot.take()
            except RobotRefused as refusal:
                if not self._wait(str(refusal)):
                    raise
            else:
                return

    def disarm(self, robot: RobotClient) -> None:
        """Let the robot stand, so that a person can put it back.

        Raises:
            RobotRefused: If it stays armed.
        """
        robot.disarm()
        while robot.ask().message.armed:
            if not self._wait(f"{robot.welcome.robot} is still armed."):
                raise RobotRefused(f"{robot.welcome.robot} does not disarm.")

    def arm(self, robot: RobotClient, role: str) -> None:
        """Arm the robot where we may, or wait until a person has.

        Raises:
            RobotRefused: If nobody does in time.
        """
        name = robot.welcome.robot
        because = "It waits for a person"
        waits_for = f"{name} waits for its operator: put it at the start and arm it."
        while True:
            seen = robot.ask().message
            if seen.armed and not seen.emergency:
                return
            if role == "person" or (robot.welcome.arming == "anyone" and not seen.emergency):
                try:
                    robot.arm()
                except RobotRefused as refusal:
                    because = str(refusal).rstrip(".")
                else:
                    continue
            if not self._wait(waits_for):
                stopped = f" ({seen.stop_reason.rstrip('.')})" if seen.stop_reason else ""
                raise RobotRefused(
                    f"{name} was not armed within {self._timeout_s:.0f} s. {because}{stopped}: arm "
                    "it on its page or with `shapechanger robot drive`, or give `reset_timeout_s`."
                )

    def require_routine(self, robot: RobotClient) -> None:
        """Refuse a robot without a reset routine before anything moves.

        Raises:
            RobotRefused: If its profile has none.
        """
        if not robot.welcome.reset:
            raise RobotRefused(
                f"The profile of {robot.welcome.robot} has no reset routine: add [[reset]] tables "
                "to it, or let its operator put it back with on_reset='operator'."
            )

    def play(self, robot: RobotClient) -> None:
        """Run the reset routine of the robot's profile.

        Raises:
            RobotRefused: If it is disarmed meanwhile.
        """
        for values, seconds in robot.welcome.reset:
            seen = robot.ask()
            end_ns = seen.message.state_ns + seconds * _NS_PER_S
            while seen.message.state_ns < end_ns:
                if not seen.message.armed:
                    raise RobotRefused(
                        f"The reset routine was stopped: {seen.message.stop_reason or 'disarmed'}"
                    )
                seen = robot.exchange(values, seen)

    def first(
        self, robot: RobotClient, rest: tuple[float, ...], is_new: Callable[[Received, int], bool]
    ) -> Received:
        """An observation of the time after all this.

        Where the robot waits for us, it is moved on by commands that move nothing.

        Args:
            robot: The robot.
            rest: Such a command.
            is_new: Whether an observation was made after a time of the robot.

        Raises:
            LinkError: If none comes in time.
        """
        _, now_ns = robot.ping()
        seen = robot.ask()
        while not is_new(seen, now_ns):
            if self._clock() > self._until:
                raise LinkError(
                    f"{robot.welcome.robot} gives no new observation: does its camera still work?"
                )
            seen = robot.exchange(rest, seen) if robot.pace == "lockstep" else robot.ask()
        return seen

    def _wait(self, sentence: str) -> bool:
        """Wait a moment; whether there is still time."""
        if self._on_waiting is not None and sentence not in self._told:
            self._on_waiting(sentence)
        self._told.add(sentence)
        if self._clock() > self._until:
            return False
        time.sleep(_LOOK_EVERY_S)
        return True
