"""Whether this machine has the pins that a robot needs."""

from __future__ import annotations

from pathlib import Path

from shapechanger.errors import RobotError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.setup.doctor import uses_pins

__all__ = ["require_pins"]


def require_pins(plan: GuardPlan, root: Path = Path("/")) -> None:
    """Refuse a machine without pins, before anything starts that would fail again and again.

    Args:
        plan: The robot.
        root: Root of the file system, for tests.

    Raises:
        RobotError: If an output needs a pin and there is none.
    """
    if any(map(uses_pins, plan.outputs)) and not any((root / "dev").glob("gpiochip*")):
        raise RobotError(
            f"{plan.name} is on pins, and this machine has none (no /dev/gpiochip0): "
            "`shapechanger robot serve --twin` runs it on simulated ones."
        )
