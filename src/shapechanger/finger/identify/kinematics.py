"""Moment arms and tendon stretch, from a regression of lengths on angles and tensions.

The length that a motor has wound up depends on the joint angles and on the tendon's stretch:

    length = zero - arms · angles - (tension + friction + damping) / stiffness.

Angles are noisy and lengths nearly exact, so a plain regression of lengths on angles would
underestimate the arms. Here residuals are weighted, at each time, by the inverse of the covariance
`V = R S R' + D`, with the moment arms R, the variances S of the angles and D of the lengths. The
estimated arms maximize the likelihood (the structural relation of Fuller 1987, "Measurement error
models", section 2.3). The search starts from a regression on the part of the angles that the other
tendons' lengths explain (instrumental variables).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import least_squares

from shapechanger.finger.anatomy import MOMENT_ARMS, TENDONS
from shapechanger.finger.identify.log import FingerLog

ARMS: Final[NDArray[np.bool_]] = MOMENT_ARMS != 0.0
"""Mask of the tendons that cross each joint, (7, 4)."""

_N_ARMS: Final = int(ARMS.sum())
_N_TENDONS: Final = len(TENDONS)
# Time over which errors of friction and of velocities are correlated, s.
_MEMORY_S: Final = 0.5
# Scale of the speed over which friction changes its sign, m/s; tendons move at 10 to 100 mm/s.
_SLIDES_AT: Final = 0.020
# Time at the start of the log that is ignored, s, while the finger leaves its initial pose.
_SETTLES_S: Final = 0.2
# Iterations of reweighting.
_ROUNDS: Final = 4
# Smallest noise that can be distinguished from rounding, rad and m.
_LEAST_NOISE: Final = 1e-6
# A residual beyond this many standard deviations indicates a slack tendon; the variance is then
# multiplied by the second number.
_OUTLIER: Final = 5.0
_OUTLIER_VARIANCE: Final = 1e4
# Units of the solver's parameters: 1 mm for arms and zeros, 0.1 mm/N for compliance, 0.1 mm for
# friction divided by stiffness, and 1 ms for damping divided by stiffness.
_UNITS: Final = np.array([1e-3] * (_N_ARMS + _N_TENDONS) + [1e-4, 1e-4, 1e-3])


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Moment arms and stretch of a finger, with their standard errors."""

    arms: NDArray[np.float64]  # Moment arms, m, (7, 4).
    arms_sd: NDArray[np.float64]  # m, (7, 4); 0 if a tendon does not cross a joint.
    compliance: float  # Stretch per newton, m/N; near 0 for stiff tendons.
    compliance_sd: float
    joint_noise: NDArray[np.float64]  # Standard deviation of measured angles, rad, (4,).
    angles: NDArray[np.float64]  # Estimates of the true angles, rad, (n, 4).


def fit_kinematics(log: FingerLog) -> Kinematics:
    """Fit moment arms and stretch to a log in which every joint moves."""
    data = _Regression.of(log)
    settled = _Regression.of(log, round(_SETTLES_S / log.control_dt))
    noise = settled.joint_noise()
    x = settled.start()
    solved: Any = None
    length_noise = _LEAST_NOISE
    for _ in range(_ROUNDS):
        length_noise = settled.length_noise(x)
        variance = settled.variance(x, noise, length_noise)
        arguments = settled, noise, variance
        solved = cast("Any", least_squares(_whitened, x, x_scale="jac", max_nfev=8, args=arguments))
        x = np.asarray(solved.x, np.float64)
    times = len(settled.lengths)
    jacobian = np.asarray(solved.jac).reshape(times, _N_TENDONS, -1)
    spread = robust_covariance(jacobian, np.asarray(solved.fun).reshape(times, -1), log.control_dt)
    # The estimated covariance is uncertain, so intervals are at least as wide as for noise alone.
    bread = np.asarray(np.linalg.pinv(solved.jac.T @ solved.jac, hermitian=True), np.float64)
    by_noise = np.sqrt(np.diag(bread))
    wider = np.maximum(1.0, by_noise / np.sqrt(np.diag(spread)))
    spread *= np.outer(wider * _UNITS, wider * _UNITS)
    everywhere = data.variance(x, noise, length_noise)
    return Kinematics(
        arms=_arms(x),
        arms_sd=_placed(np.sqrt(np.diag(spread)[:_N_ARMS])),
        compliance=float(x[-3] * _UNITS[-3]),
        compliance_sd=float(np.sqrt(spread[-3, -3])),
        joint_noise=noise,
        angles=data.angles - data.angle_errors(x, noise, everywhere),
    )


def robust_covariance(
    jacobian: NDArray[np.float64], residual: NDArray[np.float64], control_dt: float
) -> NDArray[np.float64]:
    """Sandwich estimate of a least-squares fit's covariance, (p, p), with correlated residuals.

    Residuals at the optimum, (times, k), with the Jacobian (times, k, p), may be correlated within
    half a second; the weights follow Newey & West 1987 (Econometrica 55:703).
    """
    squares = np.einsum("tip,tiq->pq", jacobian, jacobian)
    bread = np.asarray(np.linalg.pinv(squares, hermitian=True), np.float64)
    scores = np.asarray(np.einsum("tip,ti->tp", jacobian, residual), np.float64)
    lags = _lags(control_dt)
    filling = scores.T @ scores
    for lag in range(1, lags + 1):
        with_later = scores[lag:].T @ scores[:-lag]
        filling += (1.0 - lag / (lags + 1)) * (with_later + with_later.T)
    return np.asarray(bread @ filling @ bread, np.float64)


def interval_quantile(times: int, control_dt: float) -> float:
    """Half width of a 95 % interval, in standard errors of `robust_covariance`.

    It is above 1.96, because the covariance is estimated from few periods of half a second. The
    cubic is from Kiefer & Vogelsang 2005 (Econometric Theory 21:1130, table 1, Bartlett's weights).
    """
    b = min(1.0, _lags(control_dt) / times)
    return float(np.polyval([-0.5324, 0.4160, 2.9694, 1.9600], b))


@dataclass(frozen=True, slots=True)
class _Regression:
    """Columns of the regression, one row per time."""

    lengths: NDArray[np.float64]
    angles: NDArray[np.float64]
    tensions: NDArray[np.float64]
    speeds: NDArray[np.float64]  # Rates of the lengths, m/s, (n, 7).
    directions: NDArray[np.float64]  # Smoothed signs of the speeds, -1 to 1, (n, 7).

    @classmethod
    def of(cls, log: FingerLog, first: int = 0) -> _Regression:
        """Return the rows of a log from `first` on."""
        speeds = np.gradient(log.lengths, log.control_dt, axis=0)
        columns = (log.lengths, log.angles, log.tensions, speeds, np.tanh(speeds / _SLIDES_AT))
        return cls(*(column[first:] for column in columns))

    def joint_noise(self) -> NDArray[np.float64]:
        """Standard deviation of each angle given lengths, tensions and speeds, rad, (4,)."""
        known = np.column_stack([self._forces(), self.lengths, np.ones(len(self.lengths))])
        left: Any = self.angles - known @ np.linalg.lstsq(known, self.angles)[0]
        freedom = max(1, len(known) - known.shape[1])
        noise = np.maximum(np.sqrt((left**2).sum(axis=0) / freedom), _LEAST_NOISE)
        return np.asarray(noise, np.float64)

    def start(self) -> NDArray[np.float64]:
        """Initial parameters by instrumental variables, in `_UNITS`."""
        arms, own = np.zeros(ARMS.shape), np.empty((_N_TENDONS, 3))
        ones = np.ones((len(self.lengths), 1))
        for i in range(_N_TENDONS):
            mine = [v[:, i : i + 1] for v in (self.tensions, self.directions, self.speeds)]
            others = np.delete(self.lengths, i, axis=1)
            known = np.column_stack([others, self._forces(), ones])
            explained = known @ np.linalg.lstsq(known, self.angles)[0]
            passed = np.flatnonzero(ARMS[i])
            columns = np.column_stack([explained[:, passed], *mine, ones])
            solved = np.linalg.lstsq(columns, self.lengths[:, i])[0]
            arms[i, passed] = -solved[: len(passed)]
            own[i] = -solved[len(passed) : -1]
        shared = np.median(own, axis=0)
        x = np.concatenate([arms[ARMS], np.zeros(_N_TENDONS), shared]) / _UNITS
        x[_N_ARMS : _N_ARMS + _N_TENDONS] = self.residuals(x).mean(axis=0) / 1e-3
        return x

    def residuals(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measured lengths minus lengths by the model at the measured angles, m, (n, 7)."""
        zeros = x[_N_ARMS : _N_ARMS + _N_TENDONS] * 1e-3
        compliance, friction, damping = x[-3:] * _UNITS[-3:]
        stretch = compliance * self.tensions + friction * self.directions + damping * self.speeds
        return self.lengths - (zeros - self.angles @ _arms(x).T - stretch)

    def length_noise(self, x: NDArray[np.float64]) -> float:
        """Standard deviation, m, of the three combinations of lengths that no angle affects."""
        free = self.residuals(x) @ null_space(_arms(x).T)
        return max(_LEAST_NOISE, float(np.median(1.4826 * np.median(np.abs(free), axis=0))))

    def variance(
        self, x: NDArray[np.float64], noise: NDArray[np.float64], length_noise: float
    ) -> NDArray[np.float64]:
        """Variance of each length, m², (n, 7).

        The variance is large while friction changes its sign, and while a tendon is slack.
        """
        friction = x[-2] * _UNITS[-2]
        plain = length_noise**2 + 0.5 * friction**2 * (1.0 - self.directions**2)
        weighted = np.linalg.solve(_total(x, noise, plain), self.residuals(x)[..., None])[..., 0]
        far = np.abs(plain * weighted) > _OUTLIER * np.sqrt(plain)
        return np.asarray(np.where(far, _OUTLIER_VARIANCE * plain, plain), np.float64)

    def angle_errors(
        self, x: NDArray[np.float64], noise: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Estimated errors of the measured angles, rad, (n, 4)."""
        weighted = np.linalg.solve(_total(x, noise, variance), self.residuals(x)[..., None])
        return weighted[..., 0] @ _arms(x) * noise**2

    def _forces(self) -> NDArray[np.float64]:
        return np.column_stack([self.tensions, self.directions, self.speeds])


def _whitened(
    x: NDArray[np.float64],
    data: _Regression,
    noise: NDArray[np.float64],
    variance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return residuals that are uncorrelated and have a variance of 1, (n * 7,)."""
    factor = np.linalg.cholesky(_total(x, noise, variance))
    whitened: Any = np.linalg.solve(factor, data.residuals(x)[..., None])
    return np.asarray(whitened[..., 0].ravel(), np.float64)


def _lags(control_dt: float) -> int:
    return max(1, round(_MEMORY_S / control_dt))


def _arms(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return _placed(x[:_N_ARMS] * 1e-3)


def _placed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a matrix, (7, 4), with the values at the elements where `ARMS` is true."""
    placed = np.zeros(ARMS.shape)
    placed[ARMS] = values
    return placed


def _total(
    x: NDArray[np.float64], noise: NDArray[np.float64], variance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance of the lengths' errors at each time, m², (n, 7, 7)."""
    arms = _arms(x)
    through_angles = (arms * noise**2) @ arms.T
    return through_angles + variance[..., None] * np.eye(_N_TENDONS)
