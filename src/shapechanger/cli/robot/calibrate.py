"""`shapechanger robot calibrate`: a person jogs each output, and the profile learns from it."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError, ShapechangerError

__all__ = ["Calibrate"]


@dataclass(frozen=True)
class Calibrate:
    """Find the ends and the middle of servos, the direction of motors and the way of a wheel."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile; what is found is written into it, and its comments stay."""
    twin: bool = False
    """Practise on the twin: nothing real moves, and what is found is written all the same."""
    cap: float = 0.4
    """Largest value that a motor or an ESC is jogged with, 0 to 1; of an ESC you are asked whether
    to go beyond."""
    wheels_up: bool = False
    """Without --twin: the wheels are off the ground, so do not ask."""

    def run(self) -> None:
        """Jog, ask, and write what was found; after an error, what was found before it."""
        from shapechanger.cli.robot.jogging import Calibration
        from shapechanger.cli.robot.wheels import ask_for_wheels_up
        from shapechanger.robot.profile.load import find_profile, load_profile, shipped_profiles
        from shapechanger.teleop.terminal import Terminal

        if not 0.0 < self.cap <= 1.0:
            raise RobotError(f"The cap is above 0 and at most 1, got {self.cap}.")
        path = find_profile(self.profile)
        if path in shipped_profiles().values():
            raise RobotError(
                f"{path.stem} comes with Shapechanger and is not changed: "
                f"`shapechanger robot init {path.stem}` writes one of your own."
            )
        profile = load_profile(path)
        if not (self.twin or self.wheels_up):
            ask_for_wheels_up()
        console = plain_console()
        with Terminal() as terminal:
            calibration = Calibration(profile, terminal, console, self.cap, twin=self.twin)
            try:
                changes = calibration.run()
            except ShapechangerError:
                # An hour's work is not thrown away because the last wire was loose. The date is
                # left out: it is not calibrated.
                if calibration.found:
                    console.print("\nIt did not come to its end. What was found before:")
                    _write(path, calibration.found)
                raise
        if not changes:
            console.print("Nothing was found, and nothing was written.")
            return
        _write(path, {**changes, "robot.calibrated": datetime.date.today()})


def _write(path: Path, changes: dict[str, Any]) -> None:
    """Write what was found into the profile, and show it."""
    from shapechanger.robot.profile.edit import rewrite

    rewrite(path, changes)
    console = plain_console()
    for name, value in changes.items():
        console.print(f"{name} = {value}")
    console.print(f"wrote {path}")
