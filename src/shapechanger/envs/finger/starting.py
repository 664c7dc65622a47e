"""Brings a finger on a rig near to a posture, by commands at 50 Hz."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger.anatomy import MOMENT_ARMS
from shapechanger.embodiments.finger.balance import hold
from shapechanger.envs.finger.plant import CONTROL_DT
from shapechanger.envs.finger.postures import moving_torque
from shapechanger.tasks.finger import FingerSenses

__all__ = ["Starting"]

# All tried out on a twin with geared servos, XL330-M077 on spools of 10 mm. As fast as it may go,
# 1/s of what is left and rad/s; and how it is held to that speed, 1/s.
_RATE: Final = 8.0
_MOST_SPEED: Final = 3.0
_GAIN: Final = 30.0
# What rotor and gears weigh at the tendon, kg: with spools of 10 mm tens of times the finger.
_GEARED_KG: Final = 1.44
# What gears hold against, N, and the speed of a tendon, m/s, below which they are not told to.
_GEAR_FRICTION_N: Final = 0.55
_CREEP_M_PER_S: Final = 0.004
# A finger that does not move as it should is pulled more and more: friction and arms differ. N·m
# for a radian that it lags behind, of at most so many rad/s.
_MORE_NM: Final = 0.08
_MOST_LAG: Final = 0.8


class Starting:
    """The way to one posture.

    Args:
        posture: rad, (4,).
        least: What each tendon pulls at least, N, (7,).
        most: What it pulls at most, N, (7,).
    """

    def __init__(
        self, posture: NDArray[np.float64], least: NDArray[np.float64], most: NDArray[np.float64]
    ) -> None:
        self._posture = posture
        self._least, self._most = least, most
        self._held = moving_torque(posture, np.zeros(4), np.zeros(4))
        self._more = np.zeros(4)
        self._inertia = _GEARED_KG * MOMENT_ARMS.T @ MOMENT_ARMS

    def off(self, senses: FingerSenses) -> float:
        """How far the farthest joint is from the posture, rad."""
        return float(np.abs(senses.angles - self._posture).max())

    def tensions(self, senses: FingerSenses) -> NDArray[np.float64]:
        """What to pull with for the next period of control, N, (7,)."""
        left = self._posture - senses.angles
        speed = np.clip(_RATE * left, -_MOST_SPEED, _MOST_SPEED)
        lag = speed - senses.velocities
        self._more += _MORE_NM * CONTROL_DT * np.clip(lag, -_MOST_LAG, _MOST_LAG)
        torque = self._held + self._inertia @ (_GAIN * lag) + self._more
        # Whoever winds in pulls against its gears; whoever lets out is held by them. There is room
        # for both.
        least, most = self._least + _GEAR_FRICTION_N, self._most - _GEAR_FRICTION_N
        pull, _ = hold(MOMENT_ARMS, torque, least, most)
        return pull + _GEAR_FRICTION_N * np.tanh(MOMENT_ARMS @ speed / _CREEP_M_PER_S)
