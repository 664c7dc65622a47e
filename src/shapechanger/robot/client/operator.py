"""Reset and takeover: how a remote env waits for the operator of its robot."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.connection import Received
from shapechanger.robot.client.observations import RobotSpaces
from shapechanger.robot.link.messages import Observation

_POLL_S: Final = 0.05  # Time between two tries, s.
_NS_PER_S: Final = 1e9

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class Preparation:
    """Steps of one reset; one time limit applies to all their waits."""

    timeout_s: float
    on_waiting: Callable[[str], object] | None  # Called with a sentence; None to log it.
    known_as: str  # Name of the known robot; "" for an address.
    _since: float = field(default_factory=time.monotonic)
    _reported: set[str] = field(default_factory=set[str])

    @property
    def _left_s(self) -> float:
        return self._since + self.timeout_s - time.monotonic()

    def connect(self, make: Callable[[], RobotClient]) -> RobotClient:
        """Connect; try again while no robot answers, but not after a refusal."""
        while True:
            try:
                return make()
            except RobotRefused:
                raise
            except LinkError as error:
                failure = LinkError(f"{error} Gave up after {self.timeout_s:.0f} s.")
                self._wait("The robot does not answer.", failure)

    def take(self, robot: RobotClient) -> None:
        """Take control, once no other client has it."""
        while True:
            try:
                return robot.take()
            except RobotRefused as refusal:
                self._wait(str(refusal), refusal)

    def disarm(self, robot: RobotClient) -> None:
        """Disarm the robot, so that a person can put it back."""
        name = robot.welcome.robot
        robot.disarm()
        while robot.ask().message.armed:
            self._wait(f"{name} is still armed.", RobotRefused(f"{name} does not disarm."))

    def arm(self, robot: RobotClient, role: str, *, by_person: bool = False) -> None:
        """Arm the robot if that is allowed, or wait for a person; the env then has control."""
        name = robot.welcome.robot
        because = "It waits for a person"
        first = "" if self.known_as else f"`shapechanger robot remember {name} …` once, then "
        how = (
            f"{first}`shapechanger robot drive {self.known_as or name}` in another terminal, and "
            "there P, which arms it for the program"
        )
        while True:
            seen = robot.ask().message
            if not seen.mine and self._left_s >= 0.0:
                # To arm the robot for the program, a person first gives control back.
                self.take(robot)
                continue
            if seen.mine and seen.armed and not seen.emergency:
                return
            may = robot.welcome.arming == "anyone" and not seen.emergency and not by_person
            if role == "person" or may:
                try:
                    robot.arm()
                    continue
                except RobotRefused as refusal:
                    because = str(refusal).rstrip(".")
            stopped = f" ({seen.stop_reason.rstrip('.')})" if seen.stop_reason else ""
            failure = RobotRefused(
                f"{name} was not armed within {self.timeout_s:.0f} s. {because}{stopped}. "
                f"To arm it, {how}; `reset_timeout_s` sets how long to wait for that."
            )
            start = f"{name} waits for its operator: put it at the start and arm it: {how}."
            self._wait(start, failure)

    def play(self, robot: RobotClient) -> None:
        """Run the reset routine of the robot's profile."""
        for values, seconds in robot.welcome.reset:
            seen = robot.ask()
            end_ns = seen.message.state_ns + seconds * _NS_PER_S
            while seen.message.state_ns < end_ns:
                if not seen.message.armed:
                    raise RobotRefused(
                        f"The reset routine was stopped: {seen.message.stop_reason or 'disarmed'}"
                    )
                seen = robot.exchange(values, seen)

    def first(self, robot: RobotClient, spaces: RobotSpaces) -> Received:
        """Wait for the first observation whose state and frame were made after the reset.

        In lockstep, commands at rest advance the robot's time.
        """
        _, now_ns = robot.ping()
        seen = robot.ask()
        while True:
            has_frame = seen.message.captured_ns > now_ns and spaces.shows(seen)
            if seen.message.state_ns > now_ns and (has_frame or not spaces.has_image):
                return seen
            if self._left_s < 0.0:
                raise LinkError(
                    f"{robot.welcome.robot} sends no new observation. Does its camera still work?"
                )
            is_paced = robot.pace == "lockstep"
            seen = robot.exchange(spaces.rest, seen) if is_paced else robot.ask()

    def _wait(self, sentence: str, failure: LinkError) -> None:
        """Report the wait once, and wait a moment; raise the failure after the time limit."""
        if sentence not in self._reported:
            self._reported.add(sentence)
            (self.on_waiting or _log.warning)(sentence)
        if self._left_s < 0.0:
            raise failure from None
        time.sleep(_POLL_S)


class Takeover:
    """Continues an episode while a person has control, if that is `allowed`.

    Meanwhile the program sends suggestions. Afterwards the person gives control back and arms the
    robot for the program, whose commands have no effect until both have happened.
    """

    def __init__(self, *, allowed: bool) -> None:
        self._allowed = allowed
        self._waits = False

    def act(self, robot: RobotClient, values: tuple[float, ...], last: Observation) -> int:
        """Send a command, or a suggestion after a permitted loss of control; return its `seq`."""
        if not self._allowed or last.mine:
            return robot.command(values, answers=last.seq)
        if not last.holder:
            # A person who takes control again meanwhile keeps it.
            with contextlib.suppress(RobotRefused):
                robot.take()
        return robot.suggest(values, answers=last.seq)

    def goes_on(self, seen: Observation) -> bool:
        """Return True from the time when the program lost control until it controls an armed robot.

        The episode then continues. An emergency stop, or another program in control, ends it.
        """
        if not self._allowed or seen.emergency:
            return False
        is_lent = seen.holder_role == "person" or not seen.holder
        self._waits = not (seen.mine and seen.armed) and (self._waits or is_lent)
        return self._waits and (seen.mine or is_lent)

    @staticmethod
    def action(seen: Observation) -> tuple[float, ...] | None:
        """Return the command of a person who has control, or None."""
        return seen.commanded if seen.commanded and seen.holder_role == "person" else None


def interruption(message: Observation) -> str:
    """Return the reason why a program does not drive, or ""."""
    why = f": {message.stop_reason}" if message.stop_reason else "."
    if not message.mine:
        return f"{message.holder or 'No client'} has control of the robot now{why}"
    if message.emergency:
        return f"Emergency stop{why}"
    if not message.armed:
        return f"The robot was disarmed{why}"
    return ""
