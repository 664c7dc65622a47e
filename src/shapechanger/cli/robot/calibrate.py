"""`shapechanger robot calibrate`: jog each output and write the calibration to the profile."""

from __future__ import annotations

import datetime
import math
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import tyro
from rich.live import Live
from rich.text import Text

from shapechanger.cli.console import plain_console, say
from shapechanger.cli.robot.setup import change_profile, own_profile
from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.layout import Layout
from shapechanger.robot.client.teleop import STOPS, Terminal
from shapechanger.robot.drivers.chip import OUTPUTS
from shapechanger.robot.profile.load import load_profile, rewrite
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.calibration import (
    JogResult,
    motor_changes,
    pulse_changes,
    reading,
    wheel_changes,
    with_widest_pulses,
)

if TYPE_CHECKING:
    from shapechanger.robot.client.client import RobotClient


@dataclass(frozen=True)
class Calibrate:
    """Calibrate servo ends and centres, motor directions and wheel circumferences."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile; the results are written into it, and its comments stay."""
    twin: bool = False
    """Practise on the twin: no hardware moves, but the results are written all the same."""
    cap: float = 0.4
    """Largest value that a motor or an ESC is jogged with, 0 to 1; of an ESC you are asked whether
    to go beyond."""
    wheels_up: bool = False
    """Without --twin: the wheels are off the ground, so do not ask."""

    def run(self) -> None:
        """Calibrate interactively and write the result, or the partial result after an error."""
        if not 0.0 < self.cap <= 1.0:
            raise RobotError(f"The cap is above 0 and at most 1, got {self.cap}.")
        path = own_profile(self.profile)
        profile = load_profile(path)
        if not (self.twin or self.wheels_up):
            ask_for_wheels_up()
        with Terminal() as terminal:
            calibration = Calibration(profile, terminal, self.cap, twin=self.twin)
            try:
                changes = calibration.run()
            except ShapechangerError:
                # Keep the results so far if the last wire was loose. The date is
                # left out: it is not calibrated.
                if calibration.found:
                    say("\nCalibration was interrupted. Results so far:")
                    change_profile(path, calibration.found)
                raise
        if not changes:
            say("No results; nothing was written.")
            return
        change_profile(path, {**changes, "robot.calibrated": datetime.date.today()})


_STEP: Final = 0.02
# Tolerance of the requested value, and time to wait for an output that is held back.
_THERE: Final = 0.07
_SETTLES_S: Final = 4.0
_STOP_LOOKS: Final = 50  # Observations within which an emergency stop must be visible.


class _Ended(Exception):
    """The person quits."""


def _live_line() -> Live:
    """Return a live line that disappears afterwards."""
    return Live(console=plain_console(), refresh_per_second=10, transient=True)


def _end_if_asked(key: str, robot: RobotClient | None = None) -> None:
    """Quit on Q; on Space or Escape, stop the robot and wait until the stop is visible."""
    if key in STOPS and robot is not None:
        robot.emergency_stop("calibrate")
        for _ in range(_STOP_LOOKS):
            newest = robot.newest
            robot.acknowledge()
            if not robot.observation(newest.message.seq if newest else 0).message.armed:
                break
    if key == "q" or key in STOPS:
        raise _Ended


_START_STEP: Final = 0.05
_MOTORS: Final = ("hbridge", "phase_enable")


class Calibration:
    """Calibration of all outputs and encoders of a robot.

    Args:
        profile: The robot.
        keys: Source of key presses.
        cap: Largest value for motors, and for ESCs unless the person goes beyond.
        twin: Whether on the twin.
    """

    def __init__(self, profile: Profile, keys: Terminal, cap: float, *, twin: bool) -> None:
        self._profile = profile
        self._keys = keys
        self._cap = cap
        self._twin = twin
        self.found: dict[str, Any] = {}

    def run(self) -> dict[str, Any]:
        """Calibrate everything.

        Returns:
            Changes to the profile by dotted name; empty if the person quits.
        """
        say(
            "Lift the robot so that nothing can drive away. Enter accepts, N skips this output, "
            "Q ends without writing, Space and Escape stop everything and end."
        )
        try:
            for output in self._profile.outputs:
                if output.mix and OUTPUTS[output.driver].pulses:
                    self.found |= self._pulses(output)
                elif output.mix and output.driver in _MOTORS:
                    self.found |= self._motor(output)
            for sensor in self._profile.sensors:
                if sensor.driver == "encoder":
                    self.found |= self._wheel(sensor.name, sensor.settings["wheel_m"])
        except _Ended:
            self.found = {}
        return self.found

    def _jogged(
        self,
        robot: RobotClient,
        output: OutputPlan,
        cap: float,
        step: float = _STEP,
        *,
        goes_beyond: bool = False,
    ) -> float | None:
        """Jog one output with keys until Enter.

        Args:
            robot: The robot, armed for this client.
            output: The output, with the settings for jogging.
            cap: Largest commanded value.
            step: Change per key press.
            goes_beyond: Whether to ask at the cap, where Y goes beyond it.

        Returns:
            The applied value of the output, or None if skipped.
        """
        # The action with the largest weight on this output.
        name = max(output.mix, key=lambda action: abs(output.mix[action]))
        values = {action.name: action.rest for action in self._profile.actions}
        place = list(values).index(name)
        action = self._profile.actions[place]
        way = math.copysign(step, output.mix[name])

        def applied_value(applied: tuple[float, ...]) -> float:
            mixed = sum(output.mix.get(n, 0.0) * v for n, v in zip(values, applied, strict=True))
            return min(max(output.offset + mixed, -1.0), 1.0)

        robot.acknowledge()
        newest = robot.newest
        seq = newest.message.seq if newest else 0
        accepted: int | None = None
        accepted_s = 0.0
        asked = False
        before: tuple[float, ...] = ()
        with _live_line() as live:
            while True:
                seen = robot.observation(seq).message
                seq = seen.seq
                if not seen.armed:
                    raise RobotError(f"The robot stopped: {seen.stop_reason}")
                live.update(Text(f"  {reading(output, applied_value(seen.action_applied))}"))
                sent = robot.command([*values.values()], answers=seq)
                if accepted is None:
                    for key in self._keys.keys(0.0):
                        if key == "enter":
                            accepted, accepted_s = sent + 1, time.monotonic()
                            break
                        _end_if_asked(key, robot)
                        if key == "n":
                            return None
                        if key == "y" and asked:
                            cap = 1.0
                        wanted = values[name] + {"d": way, "a": -way}.get(key, 0.0)
                        if goes_beyond and not asked and abs(wanted) > cap and cap < 1:
                            live.console.print(
                                f"  That is the cap of {cap:g}. Go beyond it? Y does."
                            )
                            asked = True
                        wanted = min(max(wanted, -cap), cap)
                        values[name] = min(max(wanted, action.low), action.high)
                # It may still be moving: a slew, or a controller that is not armed yet.
                elif (seen.applied_seq or 0) >= accepted and seen.action_applied == before:
                    is_there = abs(seen.action_applied[place] - values[name]) < _THERE
                    if is_there or time.monotonic() > accepted_s + _SETTLES_S:
                        return applied_value(before)
                before = seen.action_applied

    def _pulses(self, output: OutputPlan) -> dict[str, Any]:
        wide = with_widest_pulses(output)
        low_key, _, high_key = OUTPUTS[output.driver].pulses
        settings = {
            f"output.{output.name}.{key}": wide.settings[key] for key in (low_key, high_key)
        }
        names = {"servo": ("full left", "straight", "full right")}.get(
            output.driver, ("its fastest backward", "surely at rest", "its fastest forward")
        )
        say(f"\n{output.name}: A and D move it, Enter when it is …")
        with self._served(settings) as robot:
            # Servo ends are searched for; an ESC's end is full speed.
            cap = self._cap if output.driver == "esc" else 1.0
            found: list[float] = []
            for name in names:
                say(f"  … {name}")
                value = self._jogged(robot, wide, cap, goes_beyond=True)
                if value is None:
                    return {}
                found.append(value)
        return dict(pulse_changes(wide, JogResult(*found)))

    def _motor(self, output: OutputPlan) -> dict[str, Any]:
        say(f"\n{output.name}: D raises its duty; Enter when it begins to move …")
        with self._served({f"output.{output.name}.start": 0.0}) as robot:
            value = self._jogged(robot, output, self._cap, _START_STEP)
        if value is None or value == 0.0:
            return {}
        say("  … did it go forward, or right? Y or N")
        went = self._answer()
        return motor_changes(output, went, abs(value) * output.settings["full"])

    def _wheel(self, name: str, wheel_m: float) -> dict[str, Any]:
        say(f"\n{name}: push the robot 1 m forward by hand, then Enter …")
        with self._served({}) as robot, _live_line() as live:
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
                live.update(Text(f"  {travelled_m:.2f} m by the encoder"))
                for key in self._keys.keys(0.0):
                    if key == "enter":
                        return dict(wheel_changes(name, wheel_m, 1.0, travelled_m))
                    _end_if_asked(key, robot)
                    if key == "n":
                        return {}

    @contextmanager
    def _served(self, settings: dict[str, Any]) -> Generator[RobotClient]:
        """Serve the robot with other settings, armed for a person."""
        from shapechanger.robot.twin.robot import run_robot

        with tempfile.TemporaryDirectory(prefix="shapechanger-calibrate-") as folder:
            path = Path(folder) / "profile.toml"
            path.write_bytes(self._profile.path.read_bytes())
            profile = rewrite(path, settings) if settings else load_profile(path)
            # Calibration does not need the camera, which may be missing.
            files = Path(folder) / "robot"
            files.mkdir()
            with (
                run_robot(
                    profile,
                    twin=self._twin,
                    folder=files,
                    # Nor does it need a course.
                    arguments=("--world", "room") if self._twin else (),
                ) as robot,
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


def ask_for_wheels_up() -> None:
    """Ask at the terminal to confirm that the wheels are off the ground."""
    if not sys.stdin.isatty():
        raise RobotError("The robot will drive: lift its wheels, and say so with --wheels-up.")
    answer = input("The robot will drive. Are its wheels off the ground? [yes/no] ")
    if answer.strip().lower() != "yes":
        raise RobotError("Nothing was moved.")
