"""Moves one output of a robot by keys, and tells where it is."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final, Protocol

from rich.console import Console
from rich.live import Live
from rich.text import Text

from shapechanger.errors import RobotError
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.calibration import reading

__all__ = ["Ended", "Jogger", "Keys", "end_if_asked", "live_line"]

_STEP: Final = 0.02
# How near to what was asked an output is there, and how long one that is held back is waited for.
_THERE: Final = 0.07
_SETTLES_S: Final = 4.0
_STOP_LOOKS: Final = 50  # Observations until an emergency stop must be seen.


class Keys(Protocol):
    """Where keys come from, such as a terminal."""

    def keys(self, wait_s: float) -> list[str]:
        """The keys that were pressed; waits so long for the first one."""
        ...


class Ended(Exception):
    """The person ends it all."""


class Jogger:
    """Moves one output by keys, and holds it where it is.

    Args:
        robot: The robot, armed for us.
        profile: What it is.
        output: The output, with the settings that it is jogged in.
        keys: Where keys come from.
        console: Where to show what the output does.
        step: How much one key changes the value.
    """

    def __init__(
        self,
        robot: RobotClient,
        profile: Profile,
        output: OutputPlan,
        keys: Keys,
        console: Console,
        step: float = _STEP,
    ) -> None:
        self._robot = robot
        self._keys = keys
        self._console = console
        self._step = step
        self._output = output
        # The action that moves this output most.
        name = max(output.mix, key=lambda action: abs(output.mix[action]))
        self._names = [action.name for action in profile.actions]
        self._rests = [action.rest for action in profile.actions]
        self._place = self._names.index(name)
        self._action = profile.actions[self._place]
        self._way = math.copysign(1.0, output.mix[name])

    def find(self, cap: float, ask_beyond: Callable[[float], None] | None = None) -> float | None:
        """Jog until Enter.

        Args:
            cap: Largest value that is commanded.
            ask_beyond: Asks, at the cap, whether to go beyond it, which Y then does; None where
                nobody may.

        Returns:
            Where the output really is then; None where the person skips.

        Raises:
            RobotError: If the robot stopped.
        """
        with live_line(self._console) as live:
            return self._jogged(cap, ask_beyond, live)

    def _jogged(
        self, cap: float, ask_beyond: Callable[[float], None] | None, live: Live
    ) -> float | None:
        """As `find`, and shows all the while where the output is."""
        value = self._action.rest
        self._robot.acknowledge()
        newest = self._robot.newest
        seq = newest.message.seq if newest else 0
        accepted: int | None = None
        accepted_s = 0.0
        asked = False
        before: tuple[float, ...] = ()
        while True:
            seen = self._robot.observation(seq).message
            seq = seen.seq
            if not seen.armed:
                raise RobotError(f"The robot stopped: {seen.stop_reason}")
            live.update(Text(f"  {reading(self._output, self._is_at(seen.action_applied))}"))
            values = list(self._rests)
            values[self._place] = value
            told = self._robot.command(values, answers=seq)
            if accepted is None:
                for key in self._keys.keys(0.0):
                    if key == "enter":
                        accepted, accepted_s = told + 1, time.monotonic()
                        break
                    end_if_asked(key, self._robot)
                    if key == "n":
                        return None
                    if key == "y" and asked:
                        cap = 1.0
                    step = self._way * {"d": self._step, "a": -self._step}.get(key, 0.0)
                    if abs(value + step) > cap and ask_beyond is not None and not asked and cap < 1:
                        ask_beyond(cap)
                        asked = True
                    value = min(max(value + step, -cap), cap)
                    value = min(max(value, self._action.low), self._action.high)
            # It may still be on its way there: a slew, or a controller that is not awake yet.
            elif (seen.applied_seq or 0) >= accepted and seen.action_applied == before:
                is_there = abs(seen.action_applied[self._place] - value) < _THERE
                if is_there or time.monotonic() > accepted_s + _SETTLES_S:
                    return self._is_at(before)
            before = seen.action_applied

    def _is_at(self, applied: tuple[float, ...]) -> float:
        """The value of the output that follows from what the actions are."""
        mix = self._output.mix
        mixed = sum(mix.get(name, 0.0) * v for name, v in zip(self._names, applied, strict=True))
        return min(max(self._output.offset + mixed, -1.0), 1.0)


def live_line(console: Console) -> Live:
    """A line that follows what is measured, and is gone afterwards."""
    return Live(console=console, refresh_per_second=10, transient=True)


def end_if_asked(key: str, robot: RobotClient | None = None) -> None:
    """Q ends it all; Space besides stops the robot, and waits until that is seen."""
    if key == "space" and robot is not None:
        robot.emergency_stop("calibrate")
        for _ in range(_STOP_LOOKS):
            newest = robot.newest
            robot.acknowledge()
            if not robot.observation(newest.message.seq if newest else 0).message.armed:
                break
    if key in {"q", "space"}:
        raise Ended
