"""Stretches of a log, each with the state that it begins in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from shapechanger.identify.commands import Commands
from shapechanger.identify.kinematics import Kinematics
from shapechanger.identify.log import FingerLog
from shapechanger.identify.motors import Motors

__all__ = ["Window", "windows"]

# s. Longer than a joint takes to come to rest, short enough that errors of the start and of the
# model do not pile up.
_WINDOW_S: Final = 1.0
# s. How the finger comes from where it was put is left out.
_SETTLES_S: Final = 0.3
# Rows of a polynomial of third degree, from which velocities come.
_ROWS: Final = 7
_FINE_S: Final = 0.001


@dataclass(frozen=True, slots=True)
class Window:
    """A stretch of a log.

    Attributes:
        start: When it begins, s.
        angles: At its start and at the end of each of its periods, rad, (m + 1, 4).
        velocities: At its start, rad/s, (4,).
        activations: Of the motors at its start, as commands, (7,).
    """

    start: float
    angles: NDArray[np.float64]
    velocities: NDArray[np.float64]
    activations: NDArray[np.float64]


def windows(
    log: FingerLog,
    kinematics: Kinematics,
    motors: Motors,
    last: int | None = None,
    length_s: float = _WINDOW_S,
    first_s: float = _SETTLES_S,
) -> list[Window]:
    """Cut a log up to row `last` into stretches, one after the other.

    Args:
        log: The log.
        kinematics: What its lengths say, for the angles.
        motors: What its tensions say, for the motors' state.
        last: The row before which the last stretch ends; None for the log's end.
        length_s: Of each stretch, s.
        first_s: When the first begins, s after the log's beginning.
    """
    dt = log.control_dt
    velocities = savgol_filter(kinematics.angles, _ROWS, 3, deriv=1, delta=dt, axis=0)
    commands = Commands(log)
    steps = int(np.ceil(log.seconds / _FINE_S)) + 1
    made = commands.followed(float(log.t[0]), _FINE_S, steps, motors.delay, motors.lag)
    rows = round(length_s / dt)
    last = len(log) if last is None else last
    cut: list[Window] = []
    for row in range(round(first_s / dt), last - rows, rows):
        fine = min(steps - 1, round((log.t[row] - log.t[0]) / _FINE_S) - 1)
        cut.append(
            Window(
                start=float(log.t[row]),
                angles=kinematics.angles[row : row + rows + 1],
                velocities=np.asarray(velocities[row], np.float64),
                activations=np.clip(made[max(fine, 0)], -1.0, 1.0),
            )
        )
    return cut
