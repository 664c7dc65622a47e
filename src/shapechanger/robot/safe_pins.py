"""Put every output of a robot at rest after a crash.

`python -m shapechanger.robot.safe_pins PROFILE` runs it, as the robot's systemd unit does whenever
the robot's process has ended.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.check.pins import require_pins
from shapechanger.robot.guard.outputs import make_safe
from shapechanger.robot.hardware import REAL, connect
from shapechanger.robot.profile.load import find_profile, load_profile


def main(arguments: Sequence[str] | None = None) -> None:
    """Put the outputs of a profile at rest; exit with 2 and one sentence if one is not."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        if len(given) != 1:
            raise RobotError("Give the robot's profile: shapechanger.robot.safe_pins PROFILE.")
        plan = load_profile(find_profile(given[0])).guard_plan()
        require_pins(plan)
        with closing(connect(REAL, "")) as hardware:
            failures = make_safe(plan, hardware)
        if failures:
            raise RobotError(
                "Not all outputs are at rest: disconnect the battery. " + " ".join(failures)
            )
    except ShapechangerError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    print(f"All {len(plan.outputs)} outputs of {plan.name} are at rest.")


if __name__ == "__main__":
    main()
