"""Lag, delay and strength of the motors, from the tensions that follow the commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from shapechanger.finger.identify.kinematics import robust_covariance
from shapechanger.finger.identify.log import FingerLog
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.tensions import drive_of

FINE_S: Final = 0.001
"""Step at which motors are simulated on their own, s."""

# Start of the log that is left out, s: motors still follow commands from before it.
_FORGETS_S: Final = 0.3
# Bounds of the parameters.
_LONGEST_DELAY_S: Final = 0.15
_LAGS_S: Final = (0.002, 0.2)
_STRENGTHS: Final = (0.3, 2.0)
# Delays to start from: the cost has local minima one control period apart.
_INITIAL_DELAYS_S: Final = (0.005, 0.03, 0.06, 0.1)
_LEAST_NOISE_N: Final = 1e-4
# Relative step of finite differences; clipping gives the residual corners.
_STEP: Final = 1e-3
# Share of the rows with a saturated tendon from which the strength can be estimated.
_SATURATED: Final = 0.01


class CommandSignal:
    """The commands of a log as functions of time; the first is taken to have acted before it."""

    def __init__(self, log: FingerLog) -> None:
        self._t = np.concatenate([[log.t[0] - 1.0], log.t])
        steps = np.diff(self._t)[:, None] * log.commands
        # Each command acts in the period that ends with its row.
        self._sums = np.concatenate(
            [np.zeros((1, log.commands.shape[1])), np.cumsum(steps, axis=0)]
        )

    def delayed(self, start: float, dt: float, steps: int, delay: float) -> NDArray[np.float64]:
        """Mean command over each time step, (steps, 7), a smooth function of the delay, s."""
        edges = start + dt * np.arange(steps + 1) - delay
        sums = np.empty((steps + 1, self._sums.shape[1]))
        for i, column in enumerate(self._sums.T):
            sums[:, i] = np.interp(edges, self._t, column)
        return (sums[1:] - sums[:-1]) / dt

    def activations(
        self, start: float, dt: float, steps: int, delay: float, lag: float
    ) -> NDArray[np.float64]:
        """Activations of the motors at the end of each time step, -1 to 1, (steps, 7).

        They follow the commands with a first-order lag, s, and are at their command at the start.
        """
        given = self.delayed(start, dt, steps, delay)
        keeps = np.exp(-dt / lag)
        start_at = keeps * given[:1]
        filtered = cast("Any", lfilter([1.0 - keeps], [1.0, -keeps], given, axis=0, zi=start_at))
        return np.asarray(filtered[0], np.float64)


@dataclass(frozen=True, slots=True)
class Motors:
    """Lag, delay and strength of a finger's motors.

    Attributes:
        lag: Time constant between a command and its force, s.
        delay: Delay of the commands, s.
        strength: Largest tensions, divided by the largest tensions of the finger assumed in the
            fit.
        sd: Standard errors of these three.
        saturates: Whether a tendon reached its largest tension, so that `strength` is an estimate.
        tension_noise: Standard deviation of measured tensions, N.
    """

    lag: float
    delay: float
    strength: float
    sd: tuple[float, float, float]
    saturates: bool
    tension_noise: float


def fit_motors(log: FingerLog) -> Motors:
    """Fit lag, delay and strength of motors to a log; the strength is relative to known motors."""
    known = log.motors or NOMINAL
    most = np.array(known.most_tension)
    drive = drive_of(log.actions, NOMINAL)
    commands = CommandSignal(log)
    speeds = np.gradient(log.lengths, log.control_dt, axis=0)
    steps = int(np.ceil(log.seconds / FINE_S)) + 1
    fine = log.t[0] + FINE_S * np.arange(1, steps + 1)
    rows = log.t >= log.t[0] + _FORGETS_S

    def demanded(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tensions before they are clipped to their range, N."""
        activations = commands.activations(float(log.t[0]), FINE_S, steps, x[1], x[0])
        at_rows = np.empty(log.commands.shape)
        for i, column in enumerate(activations.T):
            at_rows[:, i] = np.interp(log.t, fine, column)
        return drive.tension(at_rows, log.lengths, speeds)[rows]

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        tensions = np.clip(demanded(x), known.least_tension, x[2] * most)
        return (tensions - log.tensions[rows]).ravel()

    starts = [np.array([NOMINAL.motor_lag, delay, 1.0]) for delay in _INITIAL_DELAYS_S]
    solve: Any = least_squares
    best = solve(
        residual,
        min(starts, key=lambda x: float(np.abs(residual(x)).sum())),
        bounds=([_LAGS_S[0], 0.0, _STRENGTHS[0]], [_LAGS_S[1], _LONGEST_DELAY_S, _STRENGTHS[1]]),
        x_scale=[0.01, 0.01, 0.1],
        loss="soft_l1",
        diff_step=_STEP,
    )
    x = np.asarray(best.x, np.float64)
    left = residual(x).reshape(int(rows.sum()), -1)
    noise = max(_LEAST_NOISE_N, float(1.4826 * np.median(np.abs(left))))
    # Outliers weigh little, such as the readings of a servo that switched itself off.
    weights = np.minimum(1.0, 3.0 * noise / np.maximum(np.abs(left), _LEAST_NOISE_N))
    jacobian = np.asarray(best.jac).reshape(*left.shape, -1)
    saturated = (demanded(x) > x[2] * most).any(axis=1).mean()
    sd = np.sqrt(np.diag(robust_covariance(jacobian, left * weights, log.control_dt)))
    return Motors(
        lag=float(x[0]),
        delay=float(x[1]),
        strength=float(x[2]) if saturated >= _SATURATED else 1.0,
        sd=(float(sd[0]), float(sd[1]), float(sd[2])),
        saturates=bool(saturated >= _SATURATED),
        tension_noise=noise if noise > _LEAST_NOISE_N else 0.0,
    )
