"""`shapechanger robot safe-pins`: every output at rest, whoever left it elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError

__all__ = ["SafePins"]


@dataclass(frozen=True)
class SafePins:
    """Put every output of a robot at rest; for after a crash, as systemd's ExecStopPost."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""

    def run(self) -> None:
        """Do it, and say what could not be done."""
        from shapechanger.cli.robot.pins_here import require_pins
        from shapechanger.robot.guard.safe_pins import make_safe
        from shapechanger.robot.hardware import REAL, connect
        from shapechanger.robot.profile.load import find_profile, load_profile

        plan = load_profile(find_profile(self.profile)).guard_plan()
        require_pins(plan)
        hardware = connect(REAL, "")
        try:
            failures = make_safe(plan, hardware)
        finally:
            hardware.close()
        if failures:
            raise RobotError(
                "Not everything is at rest: take the battery off. " + " ".join(failures)
            )
        plain_console().print(f"All {len(plan.outputs)} outputs of {plan.name} are at rest.")
