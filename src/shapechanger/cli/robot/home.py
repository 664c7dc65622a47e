"""`shapechanger robot home`: where servos and encoders of a rig stand while it is straight."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Annotated, Final

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError

__all__ = ["Home"]

_CYCLE_S: Final = 0.01


@dataclass(frozen=True)
class Home:
    """Find the zeros of a rig's tendons and joints while somebody holds the finger straight."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The rig's profile; the zeros are written into it, and its comments stay. The rig must not be
    served meanwhile. Do it again whenever the servos were without power; encoders at the joints
    keep their zeros."""
    straight: bool = False
    """Somebody holds the finger straight already, so do not ask."""

    def run(self) -> None:
        """Pull gently, and write down where nothing moves any more."""
        from shapechanger.robot.hardware import REAL, connect
        from shapechanger.robot.profile.edit import rewrite
        from shapechanger.robot.profile.load import find_profile, load_profile, shipped_profiles
        from shapechanger.robot.setup.zeros import find_joint_zeros, find_zeros

        path = find_profile(self.profile)
        if path in shipped_profiles().values():
            raise RobotError(
                f"{path.stem} comes with Shapechanger and is not changed: "
                f"`shapechanger robot init {path.stem}` writes one of your own."
            )
        plan = load_profile(path).guard_plan()
        console = plain_console()
        if not self.straight:
            words = "All tendons pull gently. Hold the finger straight, and press Enter. "
            console.input(words)
        hardware = connect(REAL, "")
        try:
            zeros = find_zeros(plan, hardware, lambda: time.sleep(_CYCLE_S))
            joints = find_joint_zeros(plan, hardware, lambda: time.sleep(_CYCLE_S))
        finally:
            hardware.close()
        found = {f"output.{name}.zero": zero for name, zero in zeros.items()}
        found |= {f"sensor.{name}.zero": zero for name, zero in joints.items()}
        rewrite(path, found)
        for name, zero in found.items():
            console.print(f"{name} = {zero}")
        console.print(f"wrote {path}")
