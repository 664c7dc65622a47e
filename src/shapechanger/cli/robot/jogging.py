"""Jogging a robot's outputs one after the other, over its own link and under all of its rules."""

from __future__ import annotations

import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal

from rich.console import Console
from rich.text import Text

from shapechanger.cli.robot.jogger import Ended, Jogger, Keys, end_if_asked, live_line
from shapechanger.errors import RobotError
from shapechanger.layout import Layout
from shapechanger.remote.client import RobotClient
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.profile.edit import rewrite
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.calibration import (
    PULSES,
    JogResult,
    motor_changes,
    pulse_changes,
    wheel_changes,
    with_widest_pulses,
)
from shapechanger.twin.running import run_robot

__all__ = ["Calibration"]

_START_STEP: Final = 0.05
_MOTORS: Final = ("hbridge", "phase_enable")


class Calibration:
    """One round over all outputs and encoders of a robot.

    Args:
        profile: The robot.
        keys: Where keys come from.
        console: Where to ask.
        cap: Largest value that a motor is jogged with, and an ESC unless the person goes beyond.
        twin: Whether on the twin.

    Attributes:
        found: What was found so far, by dotted name; whole outputs and sensors only.
    """

    def __init__(
        self, profile: Profile, keys: Keys, console: Console, cap: float, *, twin: bool
    ) -> None:
        self._profile = profile
        self._keys = keys
        self._console = console
        self._cap = cap
        self._twin = twin
        self.found: dict[str, Any] = {}

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
            self._everything()
        except Ended:
            self.found = {}
        return self.found

    def _everything(self) -> None:
        for output in self._profile.outputs:
            if not output.mix:
                continue
            if output.driver in PULSES:
                self.found |= self._pulses(output)
            elif output.driver in _MOTORS:
                self.found |= self._motor(output)
        for sensor in self._profile.sensors:
            if sensor.driver == "encoder":
                self.found |= self._wheel(sensor.name, float(_number(sensor.settings["wheel_m"])))

    def _pulses(self, output: OutputPlan) -> dict[str, Any]:
        wide = with_widest_pulses(output)
        low_key, _, high_key = PULSES[output.driver]
        settings = {
            f"output.{output.name}.{key}": wide.settings[key] for key in (low_key, high_key)
        }
        names = {"servo": ("full left", "straight", "full right")}.get(
            output.driver, ("its slowest backward", "surely at rest", "its fastest forward")
        )
        self._console.print(f"\n{output.name}: A and D move it, Enter where it is …")
        with self._served(settings) as robot:
            jogger = Jogger(robot, self._profile, wide, self._keys, self._console)
            # A servo's ends are what is looked for; an ESC's end is full speed.
            cap = self._cap if output.driver == "esc" else 1.0
            found: list[float] = []
            for name in names:
                self._console.print(f"  … {name}")
                value = jogger.find(cap, self._ask_beyond)
                if value is None:
                    return {}
                found.append(value)
        return dict(pulse_changes(wide, JogResult(*found)))

    def _ask_beyond(self, cap: float) -> None:
        self._console.print(f"  That is the cap of {cap:g}. Go beyond it? Y does.")

    def _motor(self, output: OutputPlan) -> dict[str, Any]:
        self._console.print(f"\n{output.name}: D raises its duty; Enter when it begins to move …")
        with self._served({f"output.{output.name}.start": 0.0}) as robot:
            jogger = Jogger(
                robot, self._profile, output, self._keys, self._console, step=_START_STEP
            )
            value = jogger.find(self._cap)
        if value is None or value == 0.0:
            return {}
        self._console.print("  … did it go forward, or right? Y or N")
        went = self._answer()
        return motor_changes(output, went, abs(value) * _number(output.settings["full"]))

    def _wheel(self, name: str, wheel_m: float) -> dict[str, Any]:
        self._console.print(f"\n{name}: push the robot 1 m forward by hand, then Enter …")
        with self._served({}) as robot, live_line(self._console) as live:
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
                    end_if_asked(key, robot)
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
                run_robot(
                    profile,
                    twin=self._twin,
                    folder=files,
                    # Nor does anybody need a place to drive in.
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
                end_if_asked(key)  # Nothing is served here, so everything is at rest.
                if key in {"y", "n"}:
                    return "forward" if key == "y" else "backward"


def _number(value: object) -> float:
    if isinstance(value, int | float):
        return float(value)
    raise RobotError(f"{value!r} is no number.")
