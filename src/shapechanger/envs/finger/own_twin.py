"""A twin of a rig that an env serves for itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from shapechanger.envs.finger.gap import GAPS
from shapechanger.errors import FingerError, UnknownName

if TYPE_CHECKING:
    from shapechanger.twin.running import RunningRobot

__all__ = ["NOMINAL_TWIN", "serve_twin"]

NOMINAL_TWIN: Final = "nominal"
"""The twin whose bones, joints and tendons are those of the nominal finger."""

_PROFILE: Final = "finger"


def serve_twin(twin: str, finger_seed: int | None) -> RunningRobot:
    """Serve the shipped profile of a rig on a twin's own clock, as `shapechanger robot serve` does.

    Args:
        twin: "nominal", or the name of the gap that its finger is drawn from.
        finger_seed: Which finger of the gap; the first one if not given.

    Raises:
        UnknownName: If there is no such gap.
        FingerError: If a finger is asked for of what is no gap.
        RobotError: If it does not start.
    """
    from shapechanger.robot.profile.load import find_profile
    from shapechanger.twin.running import run_robot

    if twin not in ("", NOMINAL_TWIN, *GAPS):
        raise UnknownName("twin of a finger", twin, (NOMINAL_TWIN, *GAPS))
    if twin not in GAPS and finger_seed is not None:
        raise FingerError("finger_seed says which finger of a gap it is: give a gap as twin, too.")
    drawn = ("--gap", twin, "--finger-seed", str(finger_seed or 0))
    return run_robot(
        find_profile(_PROFILE), clock="twin", arguments=() if twin == NOMINAL_TWIN else drawn
    )
