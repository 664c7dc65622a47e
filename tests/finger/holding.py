"""Whether the nominal finger can hold a posture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shapechanger.finger.anatomy import LEAST_TENSION_N, MOMENT_ARMS, MOST_TENSION_N
from shapechanger.finger.postures import moving_torque
from shapechanger.finger.tensions import tensions_for_torque


def can_hold(angles: NDArray[np.float64]) -> bool:
    """Return whether feasible tensions hold the nominal finger at these angles, rad, (4,)."""
    torque = moving_torque(angles, np.zeros(4), np.zeros(4))
    return tensions_for_torque(MOMENT_ARMS, torque, LEAST_TENSION_N, MOST_TENSION_N)[1]
