"""Lag, delay and strength of the motors, from what tensions follow on which commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from shapechanger.bodies.finger import NOMINAL, FingerParameters, drive_of
from shapechanger.identify.kinematics import covariance
from shapechanger.identify.log import FingerLog

__all__ = ["CommandSignal", "Motors", "fit_motors"]


class CommandSignal:
    """The commands of a log as functions of time.

    Args:
        log: What was commanded; before its first row the first command is taken to have acted.
    """

    def __init__(self, log: FingerLog) -> None:
        self._t = np.concatenate([[log.t[0] - 1.0], log.t])
        steps = np.diff(self._t)[:, None] * log.commands
        # Each command acts in the period that ends with its row.
        self._sums = np.concatenate(
            [np.zeros((1, log.commands.shape[1])), np.cumsum(steps, axis=0)]
        )

    def late(self, start: float, dt: float, steps: int, delay: float) -> NDArray[np.float64]:
        """What acts in each of some steps, (steps, 7): the mean over the step.

        Means make it a smooth function of the delay.

        Args:
            start: When the first step begins, s.
            dt: Length of a step, s.
            steps: How many.
            delay: How much later commands act, s.
        """
        edges = start + dt * np.arange(steps + 1) - delay
        sums = np.empty((steps + 1, self._sums.shape[1]))
        for i, column in enumerate(self._sums.T):
            sums[:, i] = np.interp(edges, self._t, column)
        return (sums[1:] - sums[:-1]) / dt

    def followed(
        self, start: float, dt: float, steps: int, delay: float, lag: float
    ) -> NDArray[np.float64]:
        """What motors have made of it at the end of each step, (steps, 7).

        Args:
            start: When the first step begins, s; the motors are at their command then.
            dt: Length of a step, s.
            steps: How many.
            delay: See `late`.
            lag: Time constant of the motors, s.
        """
        given = self.late(start, dt, steps, delay)
        keeps = np.exp(-dt / lag)
        start_at = keeps * given[:1]
        filtered = cast("Any", lfilter([1.0 - keeps], [1.0, -keeps], given, axis=0, zi=start_at))
        return np.asarray(filtered[0], np.float64)


_FINE_S: Final = 0.001
# s. By then the motors have forgotten what was before the log.
_FORGETS_S: Final = 0.3
_LONGEST_DELAY_S: Final = 0.15
_LAGS_S: Final = (0.002, 0.2)
_STRENGTHS: Final = (0.3, 2.0)
# Where the search begins; the delay from several places, as it has valleys a period apart.
_BEGIN_DELAYS_S: Final = (0.005, 0.03, 0.06, 0.1)
_LEAST_NOISE_N: Final = 1e-4
# Of a parameter, what differences are taken over: what is clipped has corners.
_STEP: Final = 1e-3
# Of the rows, where some tendon must be at its strongest for the strength to be told.
_SATURATED: Final = 0.01


@dataclass(frozen=True, slots=True)
class Motors:
    """What the tensions say about the motors.

    Attributes:
        lag: Time constant between a command and its force, s.
        delay: How much later a command acts, s.
        strength: Largest tensions, over those that they are thought to have.
        sd: Standard errors of these three.
        saturates: Whether a tendon was at its strongest, so that the strength could be told.
        tension_noise: Standard deviation of measured tensions, N.
    """

    lag: float
    delay: float
    strength: float
    sd: tuple[float, float, float]
    saturates: bool
    tension_noise: float


def fit_motors(log: FingerLog, known: FingerParameters = NOMINAL) -> Motors:
    """Fit the motors to a log.

    Args:
        log: The log.
        known: A finger with the tensions that they are thought to pull.
    """
    most = np.array(known.most_tension)
    drive = drive_of(log.actions, NOMINAL)
    commands = CommandSignal(log)
    speeds = np.gradient(log.lengths, log.control_dt, axis=0)
    pulled = drive.stiffness * log.lengths + drive.damping * speeds
    steps = int(np.ceil(log.seconds / _FINE_S)) + 1
    fine = log.t[0] + _FINE_S * np.arange(1, steps + 1)
    rows = log.t >= log.t[0] + _FORGETS_S

    def asked(x: NDArray[np.float64]) -> NDArray[np.float64]:
        made = commands.followed(float(log.t[0]), _FINE_S, steps, x[1], x[0])
        there = np.empty(log.commands.shape)
        for i, column in enumerate(made.T):
            there[:, i] = np.interp(log.t, fine, column)
        return (drive.offset + drive.gain * there + pulled)[rows]

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        forces = np.clip(asked(x), known.least_tension, x[2] * most)
        return (forces - log.tensions[rows]).ravel()

    bounds = ([_LAGS_S[0], 0.0, _STRENGTHS[0]], [_LAGS_S[1], _LONGEST_DELAY_S, _STRENGTHS[1]])
    scale = [0.01, 0.01, 0.1]

    begins = [np.array([NOMINAL.motor_lag, delay, 1.0]) for delay in _BEGIN_DELAYS_S]
    begin = min(begins, key=lambda x: float(np.abs(residual(x)).sum()))
    solve: Any = least_squares
    best = solve(residual, begin, bounds=bounds, x_scale=scale, loss="soft_l1", diff_step=_STEP)
    x = np.asarray(best.x, np.float64)
    left = residual(x).reshape(int(rows.sum()), -1)
    noise = max(_LEAST_NOISE_N, float(1.4826 * np.median(np.abs(left))))
    # What is far off, such as where a servo gave up, weighs little.
    weights = np.minimum(1.0, 3.0 * noise / np.maximum(np.abs(left), _LEAST_NOISE_N))
    jacobian = np.asarray(best.jac).reshape(*left.shape, -1)
    saturated = (asked(x) > x[2] * most).any(axis=1).mean()
    sd = np.sqrt(np.diag(covariance(jacobian, left * weights, log.control_dt)))
    return Motors(
        lag=float(x[0]),
        delay=float(x[1]),
        strength=float(x[2]) if saturated >= _SATURATED else 1.0,
        sd=(float(sd[0]), float(sd[1]), float(sd[2])),
        saturates=bool(saturated >= _SATURATED),
        tension_noise=noise if noise > _LEAST_NOISE_N else 0.0,
    )
