"""The constants of the finger agree with their sources."""

import math

import numpy as np
import pytest

from shapechanger.finger.anatomy import (
    FORCE_POTENTIAL_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
    PHALANX_LENGTH_M,
)

# Effect of 1 N of each tendon at the fingertip of a cadaver's index finger: force sideways, along
# and across it, N, and torque about it, N·m (R/main.r of github.com/bc/stfeasibility).
_ASIDE = [-0.08941, -0.0447, -0.009249, 0.03669, 0.1421, 0.2087, -0.2138]
_ALONG = [-0.04689, -0.1496, 0.052, 0.052, 0.0248, 0.0, 0.0248]
_ACROSS = [0.06472, 0.001953, -0.1518, -0.1518, 0.2919, 0.0568, 0.2067]
_TORQUE = [0.003081, -0.002352, -0.0001649, -0.0001649, -0.0004483, 0.0001579, -0.000685]
_FDS, _DI = 1, 5


def test_moment_arms_follow_from_measured_forces() -> None:
    aside, along, across, torque = map(np.array, (_ASIDE, _ALONG, _ACROSS, _TORQUE))
    # Two tendons have no arm at the last joint, which gives its position relative to the tip.
    y = torque[_DI] / across[_DI]
    z = (torque[_FDS] - y * across[_FDS]) / -along[_FDS]
    assert math.hypot(y, z) == pytest.approx(0.016, abs=1e-4)
    assert math.degrees(math.atan2(abs(y), abs(z))) == pytest.approx(10.0, abs=0.1)
    proximal, middle, _ = PHALANX_LENGTH_M
    level = math.cos(math.radians(45.0)) * proximal
    end = torque - y * across + z * along
    mid = end - middle * along
    knuckle = mid + level * (across - along)
    arms = np.stack([knuckle, aside * (level - y), mid, end], axis=1)
    np.testing.assert_allclose(1e3 * MOMENT_ARMS, 1e3 * arms, atol=0.06)


def test_tension_limits_are_below_the_muscles_force() -> None:
    assert (MOST_TENSION_N <= 0.3 * FORCE_POTENTIAL_N + 1e-12).all()
