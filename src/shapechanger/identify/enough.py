"""Whether a log says enough to find anything out from it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from shapechanger.errors import FingerError
from shapechanger.identify.log import FingerLog

__all__ = ["require_enough"]

# s. Below it the intervals, which rest on how errors repeat within half a second, mean nothing.
_SHORTEST_S: Final = 4.0
# rad, between the 5th and the 95th of a hundred angles. An arm of 9 mm winds 1.5 mm in it.
_LEAST_RANGE: Final = math.radians(10.0)
# rad. What a joint moves beyond what the others' motion tells, as a standard deviation.
_LEAST_OWN: Final = math.radians(2.0)


def require_enough(log: FingerLog) -> None:
    """Let pass a log in which every joint moves, and on its own.

    Raises:
        FingerError: If it is too short, or a joint hardly moved or only along with others; the
            message says which.
    """
    if log.seconds < _SHORTEST_S - 0.5 * log.control_dt:
        raise FingerError(
            f"The log is {log.seconds:.1f} s long; it takes {_SHORTEST_S:g} s at least, and "
            "10 s are good."
        )
    low, high = np.percentile(log.angles, [5.0, 95.0], axis=0)
    for joint, moved in zip(log.joints, high - low, strict=True):
        if moved < _LEAST_RANGE:
            raise FingerError(
                f"{joint} hardly moved, by {math.degrees(moved):.1f} degrees; it takes "
                f"{math.degrees(_LEAST_RANGE):.0f} at least to tell its moment arms."
            )
    centred = log.angles - log.angles.mean(axis=0)
    for j, joint in enumerate(log.joints):
        others = np.delete(centred, j, axis=1)
        shares = np.asarray(np.linalg.lstsq(others, centred[:, j])[0], np.float64)
        own = float(np.std(centred[:, j] - others @ shares))
        if own < _LEAST_OWN:
            raise FingerError(
                f"{joint} moved only along with the other joints, so that their moment arms "
                "cannot be told apart; move each on its own."
            )
