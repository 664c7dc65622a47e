"""`shapechanger robot safe-pins`: put every output at rest."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.setup.doctor import uses_pins


@dataclass(frozen=True)
class SafePins:
    """Put every output of a robot at rest after a crash, as systemd's ExecStopPost."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile."""

    def run(self) -> None:
        """Put the outputs at rest and print failures."""
        from shapechanger.robot.guard.outputs import make_safe
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


def require_pins(plan: GuardPlan, root: Path = Path("/")) -> None:
    """Refuse a machine without GPIO pins.

    Args:
        plan: The robot.
        root: Root of the file system, for tests.

    Raises:
        RobotError: If an output needs a pin and the machine has none.
    """
    if any(map(uses_pins, plan.outputs)) and not any((root / "dev").glob("gpiochip*")):
        raise RobotError(
            f"{plan.name} is on pins, and this machine has none (no /dev/gpiochip0): "
            "`shapechanger robot serve --twin` runs it on simulated ones."
        )
