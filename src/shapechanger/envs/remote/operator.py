"""What happens before an episode: the robot is ours, is armed, and stands at the start."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable
from typing import Final

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.link.messages import Observation
from shapechanger.remote.client import RobotClient
from shapechanger.remote.inbox import Received

__all__ = ["Preparation", "Takeover"]

# s. How often to look whether a person has done something.
_LOOK_EVERY_S: Final = 0.05
# s. A wait that nobody is told of is said in the log when it is no short one any more.
_TOLD_AFTER_S: Final = 2.0
_NS_PER_S: Final = 1e9

_HAND_OVER: Final = "P in `shapechanger robot drive` lets a waiting program drive."

_log = logging.getLogger(__name__)


class Preparation:
    """The steps of one reset, which together may take so long and no longer.

    Args:
        timeout_s: How long, s.
        on_waiting: Is told in a sentence what is waited for, once for each thing; None for a
            warning in the log of each thing that is waited for after 2 s.
        clock: The time, s; never runs backwards.
        called: Name under which the robot is known here; empty for none.
    """

    def __init__(
        self,
        timeout_s: float,
        on_waiting: Callable[[str], object] | None,
        clock: Callable[[], float],
        called: str = "",
    ) -> None:
        self._timeout_s = timeout_s
        self._on_waiting = on_waiting
        self._clock = clock
        self._called = called
        self._since = clock()
        self._until = self._since + timeout_s
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
                    ) from None

    def take(self, robot: RobotClient) -> None:
        """Become the one who commands, when whoever does it now is done.

        Raises:
            RobotRefused: If they are not in time.
        """
        while True:
            try:
                robot.take()
            except RobotRefused as refusal:
                if not self._wait(str(refusal), _HAND_OVER):
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

    def arm(self, robot: RobotClient, role: str, *, by_person: bool = False) -> None:
        """Arm the robot where we may, or wait until a person has; then it is still ours.

        Args:
            robot: The robot.
            role: Who we are.
            by_person: Whether to leave it to a person, even where we may.

        Raises:
            RobotRefused: If nobody does in time.
        """
        name = robot.welcome.robot
        because = "It waits for a person"
        how = self._how_to_arm(name)
        waits_for = f"{name} waits for its operator: put it at the start and arm it: {how}."
        while True:
            seen = robot.ask().message
            if not seen.mine and self._clock() <= self._until:
                # A person has it, who gives it back to arm it for us.
                self.take(robot)
                continue
            if seen.mine and seen.armed and not seen.emergency:
                return
            may = robot.welcome.arming == "anyone" and not seen.emergency and not by_person
            if role == "person" or may:
                try:
                    robot.arm()
                except RobotRefused as refusal:
                    because = str(refusal).rstrip(".")
                else:
                    continue
            if not self._wait(waits_for):
                stopped = f" ({seen.stop_reason.rstrip('.')})" if seen.stop_reason else ""
                raise RobotRefused(
                    f"{name} was not armed within {self._timeout_s:.0f} s. {because}{stopped}. "
                    f"To arm it, {how}; `reset_timeout_s` says how long to wait for that."
                )

    def _how_to_arm(self, name: str) -> str:
        """What a person does to arm the robot for a program."""
        first = "" if self._called else f"`shapechanger robot remember {name} …` once, then "
        return (
            f"{first}`shapechanger robot drive {self._called or name}` in another terminal, and "
            "there P, which arms it for the program"
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

    def _wait(self, sentence: str, hint: str = "") -> bool:
        """Wait a moment; whether there is still time.

        Args:
            sentence: What is waited for.
            hint: What a person may do about it, for the log.
        """
        now = self._clock()
        if sentence not in self._told and (self._on_waiting or now - self._since > _TOLD_AFTER_S):
            self._told.add(sentence)
            if self._on_waiting is not None:
                self._on_waiting(sentence)
            else:
                words = f"{sentence} {hint}".rstrip()
                left_s = max(0.0, self._until - now)
                _log.warning("%s (Waiting for up to %.0f s more.)", words, left_s)
        if self._clock() > self._until:
            return False
        time.sleep(_LOOK_EVERY_S)
        return True


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
