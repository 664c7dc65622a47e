"""Jogging a robot's outputs one after the other, over its own link and under all of its rules."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal, Protocol

from rich.console import Console

from shapechanger.cli.robot.running import run_robot
from shapechanger.errors import RobotError
from shapechanger.layout import Layout
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.profile.edit import rewrite
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.calibration import (
    PULSES,
    Jogging,
    motor_changes,
    pulse_changes,
    wheel_changes,
    widened,
)

__all__ = ["Calibration", "Keys"]

_STEP: Final = 0.02
# How near to what was asked an output is there, and how long one that is held back is waited for.
_THERE: Final = 0.07
_SETTLES_S: Final = 4.0
_START_STEP: Final = 0.05
_STOP_LOOKS: Final = 50  # Observations until an emergency stop must be seen.
_MOTORS: Final = ("hbridge", "phase_enable")


class Keys(Protocol):
    """Where keys come from, such as a terminal."""

    def keys(self, wait_s: float) -> list[str]:
        """The keys that were pressed; waits so long for the first one."""
        ...


class _Ended(Exception):
    """The person ends it all."""


class Calibration:
    """One round over all outputs and encoders of a robot.

    Args:
        profile: The robot.
        keys: Where keys come from.
        console: Where to ask.
        cap: Largest value that a motor is jogged with, and an ESC unless the person goes beyond.
        twin: Whether on the twin.
    """

    def __init__(
        self, profile: Profile, keys: Keys, console: Console, cap: float, *, twin: bool
    ) -> None:
        self._profile = profile
        self._keys = keys
        self._console = console
        self._cap = cap
        self._twin = twin

    def run(self) -> dict[str, Any]:
        """Go over everything.

        Returns:
            What to write into the profile, by dotted name; nothing where the person ends it.

        Raises:
            RobotError: If what was found cannot be.
        """
        self._console.print(
            "Lift the robot so that nothing can drive away. Enter accepts, N skips this output, "
            "Q ends without writing, Space stops everything and ends.",
            soft_wrap=True,
        )
        try:
            return self._everything()
        except _Ended:
            return {}

    def _everything(self) -> dict[str, Any]:
        changes: dict[str, Any] = {}
        for output in self._profile.outputs:
            if not output.mix:
                continue
            if output.driver in PULSES:
                changes |= self._pulses(output)
            elif output.driver in _MOTORS:
                changes |= self._motor(output)
        for sensor in self._profile.sensors:
            if sensor.driver == "encoder":
                changes |= self._wheel(sensor.name, float(_number(sensor.settings["wheel_m"])))
        return changes

    def _pulses(self, output: OutputPlan) -> dict[str, Any]:
        wide = widened(output)
        low_key, _, high_key = PULSES[output.driver]
        settings = {
            f"output.{output.name}.{key}": wide.settings[key] for key in (low_key, high_key)
        }
        names = {"servo": ("full left", "straight", "full right")}.get(
            output.driver, ("its slowest backward", "surely at rest", "its fastest forward")
        )
        self._console.print(f"\n{output.name}: A and D move it, Enter where it is …")
        with self._served(settings) as robot:
            jogger = _Jogger(robot, self._profile, output, self._keys)
            # A servo's ends are what is looked for; an ESC's end is full speed.
            cap = self._cap if output.driver == "esc" else 1.0
            found: list[float] = []
            for name in names:
                self._console.print(f"  … {name}")
                value = jogger.find(cap, self._ask_beyond)
                if value is None:
                    return {}
                found.append(value)
        return dict(pulse_changes(wide, Jogging(*found)))

    def _ask_beyond(self, cap: float) -> None:
        self._console.print(f"  That is the cap of {cap:g}. Go beyond it? Y does.")

    def _motor(self, output: OutputPlan) -> dict[str, Any]:
        self._console.print(f"\n{output.name}: D raises its duty; Enter when it begins to move …")
        with self._served({f"output.{output.name}.start": 0.0}) as robot:
            jogger = _Jogger(robot, self._profile, output, self._keys, step=_START_STEP)
            value = jogger.find(self._cap)
        if value is None or value == 0.0:
            return {}
        self._console.print("  … did it go forward, or right? Y or N")
        went = self._answer()
        return motor_changes(output, went, abs(value) * _number(output.settings["full"]))

    def _wheel(self, name: str, wheel_m: float) -> dict[str, Any]:
        self._console.print(f"\n{name}: push the robot 1 m forward by hand, then Enter …")
        with self._served({}) as robot:
            state = Layout.from_json(robot.welcome.state_layout)
            place: int = state.slices["speed"].start
            travelled_m = 0.0
            robot.acknowledge()
            seen = robot.observation().message
            while True:
                before_ns = seen.state_ns
                robot.acknowledge()
                seen = robot.observation(seen.seq).message
                travelled_m += seen.state[place] * (seen.state_ns - before_ns) / 1e9
                for key in self._keys.keys(0.0):
                    if key == "enter":
                        return dict(wheel_changes(name, wheel_m, 1.0, travelled_m))
                    _end_if_asked(key, robot)
                    if key == "n":
                        return {}

    @contextmanager
    def _served(self, settings: dict[str, Any]) -> Generator[RobotClient]:
        """The robot with other settings, served and armed for a person."""
        with tempfile.TemporaryDirectory(prefix="shapechanger-calibrate-") as folder:
            path = Path(folder) / "profile.toml"
            path.write_bytes(self._profile.path.read_bytes())
            profile = rewrite(path, settings) if settings else load_profile(path)
            # Nobody looks through the camera while calibrating, so it may be missing.
            files = Path(folder) / "robot"
            files.mkdir()
            with (
                run_robot(profile, twin=self._twin, folder=files) as robot,
                robot.client(role="person", frames=False, name="calibrate") as client,
            ):
                client.take()
                client.arm()
                yield client

    def _answer(self) -> Literal["forward", "backward"]:
        while True:
            for key in self._keys.keys(1.0):
                _end_if_asked(key)  # Nothing is served here, so everything is at rest.
                if key in {"y", "n"}:
                    return "forward" if key == "y" else "backward"


class _Jogger:
    """Moves one output by keys, and holds it where it is."""

    def __init__(
        self,
        robot: RobotClient,
        profile: Profile,
        output: OutputPlan,
        keys: Keys,
        step: float = _STEP,
    ) -> None:
        self._robot = robot
        self._keys = keys
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
        """
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
            values = list(self._rests)
            values[self._place] = value
            told = self._robot.command(values, answers=seq)
            if accepted is None:
                for key in self._keys.keys(0.0):
                    if key == "enter":
                        accepted, accepted_s = told + 1, time.monotonic()
                        break
                    _end_if_asked(key, self._robot)
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


def _end_if_asked(key: str, robot: RobotClient | None = None) -> None:
    """Q ends it all; Space besides stops the robot, and waits until that is seen."""
    if key == "space" and robot is not None:
        robot.emergency_stop("calibrate")
        for _ in range(_STOP_LOOKS):
            newest = robot.newest
            robot.acknowledge()
            if not robot.observation(newest.message.seq if newest else 0).message.armed:
                break
    if key in {"q", "space"}:
        raise _Ended


def _number(value: object) -> float:
    if isinstance(value, int | float):
        return float(value)
    raise RobotError(f"{value!r} is no number.")
