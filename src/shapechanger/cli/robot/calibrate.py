"""`shapechanger robot calibrate`: jog outputs or find zeros, and write them to the profile."""

from __future__ import annotations

import datetime
import math
import sys
import tempfile
import time
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import tyro
from rich.live import Live
from rich.text import Text

from shapechanger.cli.console import plain_console, say
from shapechanger.cli.robot.setup import change_profile, own_profile
from shapechanger.contract.plan import OutputPlan, output_values
from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.layout import Layout
from shapechanger.robot.client.teleop import STOPS, Terminal
from shapechanger.robot.drivers.chip import OUTPUTS
from shapechanger.robot.hardware import REAL, connect
from shapechanger.robot.profile.load import load_profile, rewrite
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.calibration import (
    find_joint_zeros,
    find_zeros,
    motor_changes,
    pulse_changes,
    reading,
    wheel_changes,
    widest_pulses,
)
from shapechanger.robot.twin.robot import run_robot

if TYPE_CHECKING:
    from shapechanger.robot.client.client import RobotClient


@dataclass(frozen=True)
class RobotCalibrate:
    """Calibrate servo ends, motor directions, wheel circumferences, or the zeros of a rig."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile; the results are written into it, and its comments are kept."""
    twin: bool = False
    """Practise on the twin: no hardware moves, but the results are written to the profile."""
    cap: float = 0.4
    """Largest value at which a motor or an ESC is jogged, 0 to 1; for an ESC, a prompt offers
    larger values."""
    wheels_up: bool = False
    """Without --twin: confirm that the wheels are off the ground, instead of being asked."""
    zeros: bool = False
    """For a rig of tendons: find the zeros of its tendons and joints instead, while a person holds
    the finger straight. The rig must not be served meanwhile. Repeat it whenever the servos were
    without power; encoders at the joints keep their zeros."""
    straight: bool = False
    """With --zeros: confirm that a person already holds the finger straight."""

    def run(self) -> None:
        if self.zeros:
            self._find_zeros()
            return
        if self.straight:
            raise RobotError("--straight is for --zeros: give both.")
        if not 0.0 < self.cap <= 1.0:
            raise RobotError(f"--cap must be above 0 and at most 1, got {self.cap}.")
        path = own_profile(self.profile)
        profile = load_profile(path)
        if not (self.twin or self.wheels_up):
            ask_for_wheels_up()
        with Terminal() as terminal:
            calibration = Calibration(profile, terminal, self.cap, self.twin)
            try:
                calibration.run()
            except ShapechangerError:
                # Keep the results so far, for example if the last wire was loose. The date is left
                # out, because the robot is not fully calibrated.
                if calibration.found:
                    say("\nCalibration was interrupted. Results so far:")
                    change_profile(path, calibration.found)
                raise
        if not calibration.found:
            say("No results; the profile was not changed.")
            return
        calibration.found["robot.calibrated"] = datetime.date.today()
        change_profile(path, calibration.found)

    def _find_zeros(self) -> None:
        if self.twin or self.wheels_up:
            raise RobotError("--zeros needs the rig itself: leave out --twin and --wheels-up.")
        path = own_profile(self.profile)
        plan = load_profile(path).guard_plan()
        if not self.straight:
            input("Hold the finger straight, and press Enter: all tendons then pull gently. ")
        with closing(connect(REAL, "")) as hardware:
            zeros = find_zeros(plan, hardware, lambda: time.sleep(_CYCLE_S))
            joints = find_joint_zeros(plan, hardware, lambda: time.sleep(_CYCLE_S))
        found = {f"output.{name}.zero": zero for name, zero in zeros.items()}
        found |= {f"sensor.{name}.zero": zero for name, zero in joints.items()}
        change_profile(path, found)


_CYCLE_S: Final = 0.01  # Between two readings of a rig.
# Change of a value at each key press, and in the search for the duty at which a motor starts.
_STEP: Final = 0.02
_START_STEP: Final = 0.05
# Largest difference between a requested and an applied value, and time limit to reach it, s.
_THERE: Final = 0.07
_SETTLES_S: Final = 4.0
_STOP_LOOKS: Final = 50  # Most observations to wait for until the robot reports that it stopped.


class _Ended(Exception):
    """The person quits."""


@dataclass
class Calibration:
    """Calibration of a robot's servos, motors and encoders, with the results in `found`."""

    profile: Profile
    keys: Terminal
    cap: float  # Largest value for motors and ESCs; the person may choose to exceed it for ESCs.
    twin: bool
    found: dict[str, Any] = field(default_factory=dict[str, Any])

    def run(self) -> None:
        """Calibrate everything; `found` is empty if the person quits."""
        say(
            "Lift the robot so that it cannot drive away. Enter accepts, N skips this output, "
            "Q ends without writing, and Space and Escape stop everything and end without writing."
        )
        try:
            for output in self.profile.outputs:
                if output.mix and OUTPUTS[output.driver].pulses:
                    self.found |= self._pulses(output)
                elif output.mix and output.driver in {"hbridge", "phase_enable"}:
                    self.found |= self._motor(output)
            for sensor in self.profile.sensors:
                if sensor.driver == "encoder":
                    self.found |= self._wheel(sensor.name, sensor.settings["wheel_m"])
        except _Ended:
            self.found = {}

    def _pulses(self, output: OutputPlan) -> dict[str, int]:
        widest = widest_pulses(output)
        wide = replace(output, settings={**output.settings, **widest})
        names = {"servo": ("full left", "straight", "full right")}.get(
            output.driver, ("at its fastest backward", "surely at rest", "at its fastest forward")
        )
        say(f"\n{output.name}: A and D move it, Enter when it is …")
        found: list[float] = []
        with self._served(
            {f"output.{output.name}.{key}": us for key, us in widest.items()}
        ) as robot:
            # The cap limits an ESC, whose end is full speed; a servo's ends must be reachable.
            cap = self.cap if output.driver == "esc" else 1.0
            for name in names:
                say(f"  … {name}")
                value = self._jogged(robot, wide, cap, goes_beyond=True)
                if value is None:
                    return {}
                found.append(value)
        return pulse_changes(wide, found)

    def _motor(self, output: OutputPlan) -> dict[str, Any]:
        say(f"\n{output.name}: D raises its duty; Enter when it begins to move …")
        with self._served({f"output.{output.name}.start": 0.0}) as robot:
            value = self._jogged(robot, output, self.cap, _START_STEP)
        if not value:
            return {}
        say("  … did it move in the positive direction, forward or to the right? Y or N")
        while True:
            for key in self._pressed(1.0):  # The robot is not served here, so it is at rest.
                if key in {"y", "n"}:
                    starts_at = abs(value) * output.settings["full"]
                    return motor_changes(output, "forward" if key == "y" else "backward", starts_at)

    def _wheel(self, name: str, wheel_m: float) -> dict[str, float]:
        say(f"\n{name}: push the robot 1 m forward by hand, then Enter …")
        with (
            self._served({}) as robot,
            Live(console=plain_console(), refresh_per_second=10, transient=True) as live,
        ):
            place: int = Layout.from_json(robot.welcome.state_layout).slices["speed"].start
            travelled_m = 0.0
            seen = robot.ask().message
            while True:
                before_ns = seen.state_ns
                seen = robot.ask().message
                travelled_m += seen.state[place] * (seen.state_ns - before_ns) / 1e9
                live.update(Text(f"  {travelled_m:.2f} m by the encoder"))
                for key in self._pressed(robot=robot):
                    if key == "enter":
                        return wheel_changes(name, wheel_m, travelled_m)
                    if key == "n":
                        return {}

    def _jogged(
        self,
        robot: RobotClient,
        output: OutputPlan,
        cap: float,
        step: float = _STEP,
        *,
        goes_beyond: bool = False,
    ) -> float | None:
        """Jog an output with keys until Enter; return its applied value, or None if skipped.

        A key press changes the command by `step`, to at most `cap`; with `goes_beyond`, Y lifts the
        cap.
        """
        actions, outputs = self.profile.actions, self.profile.outputs
        index = [one.name for one in outputs].index(output.name)
        # The action with the largest weight on this output.
        name = max(output.mix, key=lambda action: abs(output.mix[action]))
        place = [one.name for one in actions].index(name)
        way = math.copysign(step, output.mix[name])
        values = [one.rest for one in actions]
        accepted: int | None = None
        accepted_s = 0.0
        asked = False
        before: tuple[float, ...] = ()
        seen = robot.ask().message
        with Live(console=plain_console(), refresh_per_second=10, transient=True) as live:
            while True:
                if not seen.armed:
                    raise RobotError(f"The robot stopped: {seen.stop_reason}")
                applied = output_values(self.profile, seen.action_applied)[index]
                live.update(Text(f"  {reading(output, applied)}"))
                sent = robot.command(values, answers=seen.seq)
                if accepted is None:
                    for key in self._pressed(robot=robot):
                        if key == "n":
                            return None
                        if key == "enter":
                            accepted, accepted_s = sent + 1, time.monotonic()
                            break
                        if key == "y" and asked:
                            cap = 1.0
                        wanted = values[place] + {"d": way, "a": -way}.get(key, 0.0)
                        if goes_beyond and not asked and abs(wanted) > cap and cap < 1:
                            live.console.print(
                                f"  That is the cap of {cap:g}. Go beyond it? Y does."
                            )
                            asked = True
                        wanted = min(max(wanted, -cap), cap)
                        values[place] = min(max(wanted, actions[place].low), actions[place].high)
                # The output may still be moving: its slew is limited, or its ESC is not armed yet.
                elif (seen.applied_seq or 0) >= accepted and seen.action_applied == before:
                    is_there = abs(before[place] - values[place]) < _THERE
                    if is_there or time.monotonic() > accepted_s + _SETTLES_S:
                        return applied
                before = seen.action_applied
                seen = robot.observation(seen.seq).message

    def _pressed(self, wait_s: float = 0.0, robot: RobotClient | None = None) -> Iterator[str]:
        """Yield the pressed keys; Q quits, and Space and Escape stop the robot and quit."""
        for key in self.keys.keys(wait_s):
            if key in STOPS and robot is not None:
                robot.emergency_stop("calibrate")
                looks = 0
                while robot.ask().message.armed and looks < _STOP_LOOKS:
                    looks += 1
            if key == "q" or key in STOPS:
                raise _Ended
            yield key

    @contextmanager
    def _served(self, settings: dict[str, Any]) -> Generator[RobotClient]:
        """Serve the robot with changed `settings`, and arm it for a person."""
        with tempfile.TemporaryDirectory(prefix="shapechanger-calibrate-") as folder:
            path = Path(folder, "profile.toml")
            path.write_bytes(self.profile.path.read_bytes())
            profile = rewrite(path, settings) if settings else load_profile(path)
            # Calibration needs neither the camera, which may be missing, nor a course.
            arguments = ("--world", "room") if self.twin else ()
            with (
                run_robot(profile, twin=self.twin, arguments=arguments) as robot,
                robot.client(role="person", frames=False, name="calibrate") as client,
            ):
                client.take()
                client.arm()
                yield client


def ask_for_wheels_up() -> None:
    """Ask at the terminal to confirm that the wheels are off the ground."""
    if not sys.stdin.isatty():
        raise RobotError("The robot will drive: lift its wheels, and confirm with --wheels-up.")
    answer = input("The robot will drive. Are its wheels off the ground? [yes/no] ")
    if answer.strip().lower() != "yes":
        raise RobotError("The robot was not moved.")
