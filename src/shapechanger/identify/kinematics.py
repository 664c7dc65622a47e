"""Moment arms and stretch, from how lengths go with angles and tensions.

A tendon's motor winds what the joints take, and what the tendon gives:

    length = zero - arms · angles - (tension + friction + damping) / stiffness.

Angles are measured with much noise and lengths with hardly any, so that plain regression of lengths
on angles comes out too small. Here the errors of both are weighed at each moment by what they are:
errors of angles pass through the arms themselves, `V = R S R' + D`, and the arms are those that
make the whole most likely (the structural relation of Fuller 1987, "Measurement error models",
section 2.3). What starts it is a regression on the part of the angles that the other tendons'
lengths explain (instrumental variables).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import least_squares

from shapechanger.bodies.finger import TENDONS
from shapechanger.bodies.finger.anatomy import MOMENT_ARMS
from shapechanger.identify.log import FingerLog

__all__ = ["ARMS", "Kinematics", "covariance", "fit_kinematics", "quantile"]

# s. Friction and noise of velocities repeat themselves for less.
_MEMORY_S: Final = 0.5


def _lags(control_dt: float) -> int:
    return max(1, round(_MEMORY_S / control_dt))


def covariance(
    jacobian: NDArray[np.float64], residual: NDArray[np.float64], control_dt: float
) -> NDArray[np.float64]:
    """Covariance of the parameters, (p, p), whatever the residuals' own (a sandwich).

    Residuals of one time may depend on one another, and on those half a second away; the weights
    are those of Newey & West 1987 (Econometrica 55:703).

    Args:
        jacobian: Of the residuals, (times, residuals of a time, p).
        residual: At the optimum, (times, residuals of a time).
        control_dt: From one time to the next, s.
    """
    squares = np.einsum("tip,tiq->pq", jacobian, jacobian)
    bread = np.asarray(np.linalg.pinv(squares, hermitian=True), np.float64)
    pushes = np.asarray(np.einsum("tip,ti->tp", jacobian, residual), np.float64)
    lags = _lags(control_dt)
    filling = pushes.T @ pushes
    for lag in range(1, lags + 1):
        with_later = pushes[lag:].T @ pushes[:-lag]
        filling += (1.0 - lag / (lags + 1)) * (with_later + with_later.T)
    return np.asarray(bread @ filling @ bread, np.float64)


def quantile(times: int, control_dt: float) -> float:
    """How many standard errors a 95 % interval reaches to either side.

    More than 1.96, as `covariance` is itself estimated from few stretches of half a second: the
    cubic of Kiefer & Vogelsang 2005 (Econometric Theory 21:1130, table 1, Bartlett's weights).

    Args:
        times: How many there are.
        control_dt: From one to the next, s.
    """
    b = min(1.0, _lags(control_dt) / times)
    return float(np.polyval([-0.5324, 0.4160, 2.9694, 1.9600], b))


ARMS: Final[NDArray[np.bool_]] = MOMENT_ARMS != 0.0
"""Which tendon passes which joint, (7, 4)."""

_N_ARMS: Final = int(ARMS.sum())
# m/s. Friction has turned over by there; tendons move at 10 to 100 mm/s.
_SLIDES_AT: Final = 0.020
# s. How the finger comes from where it was put, before the log, is left out.
_SETTLES_S: Final = 0.2
_ROUNDS: Final = 4
# Below these nothing is told from rounding: rad and m.
_LEAST_NOISE: Final = 1e-6
# Standard deviations. A length farther off belongs to a slack tendon, and counts for little.
_OUTLIER: Final = 5.0
_OUTLIER_VARIANCE: Final = 1e4
# What the numbers are divided by for the solver: mm of arms and zeros; 0.1 mm/N of compliance;
# 0.1 mm of friction over stiffness; a millisecond of damping over stiffness.
_UNITS: Final = np.array([1e-3] * (_N_ARMS + len(TENDONS)) + [1e-4, 1e-4, 1e-3])


@dataclass(frozen=True, slots=True)
class Kinematics:
    """What lengths say about a finger.

    Attributes:
        arms: Moment arms, m, (7, 4).
        arms_covariance: Of the 25 arms that are not zero, row by row, m², (25, 25).
        compliance: What a newton stretches, m/N; near 0 for tendons that do not give.
        compliance_sd: Its standard error, m/N.
        joint_noise: Standard deviation of measured angles, rad, (4,).
        length_noise: The same of lengths, m, of what the above leaves unexplained.
        angles: What the angles probably were, rad, (n, 4).
    """

    arms: NDArray[np.float64]
    arms_covariance: NDArray[np.float64]
    compliance: float
    compliance_sd: float
    joint_noise: NDArray[np.float64]
    length_noise: float
    angles: NDArray[np.float64]

    @property
    def arms_sd(self) -> NDArray[np.float64]:
        """Standard errors of the arms, m, (7, 4); 0 where there is none."""
        sd = np.zeros(ARMS.shape)
        sd[ARMS] = np.sqrt(np.diag(self.arms_covariance))
        return sd


def fit_kinematics(log: FingerLog) -> Kinematics:
    """Fit arms and stretch to a log in which every joint moves."""
    data = _Data(log)
    settled = data.without(round(_SETTLES_S / log.control_dt))
    noise = settled.joint_noise()
    x = settled.start()
    solved: Any = None
    variance = np.empty(0)
    length_noise = _LEAST_NOISE
    for _ in range(_ROUNDS):
        length_noise = settled.length_noise(x)
        variance = settled.variance(x, noise, length_noise)

        def residual(
            x: NDArray[np.float64], variance: NDArray[np.float64] = variance
        ) -> NDArray[np.float64]:
            factor = np.linalg.cholesky(_total(x, noise, variance))
            whitened: Any = np.linalg.solve(factor, settled.off(x)[..., None])
            return np.asarray(whitened[..., 0].ravel(), np.float64)

        solved = cast("Any", least_squares(residual, x, x_scale="jac", max_nfev=8))
        x = np.asarray(solved.x, np.float64)
    times = len(settled.lengths)
    jacobian = np.asarray(solved.jac).reshape(times, len(TENDONS), -1)
    spread = covariance(jacobian, np.asarray(solved.fun).reshape(times, -1), log.control_dt)
    # What the residuals show is itself uncertain: where the noise alone would spread a parameter
    # more, that counts.
    bread = np.asarray(np.linalg.pinv(solved.jac.T @ solved.jac, hermitian=True), np.float64)
    by_noise = np.sqrt(np.diag(bread))
    wider = np.maximum(1.0, by_noise / np.sqrt(np.diag(spread)))
    spread *= np.outer(wider * _UNITS, wider * _UNITS)
    everywhere = data.variance(x, noise, length_noise)
    return Kinematics(
        arms=_arms(x),
        arms_covariance=spread[:_N_ARMS, :_N_ARMS],
        compliance=float(x[-3] * _UNITS[-3]),
        compliance_sd=float(np.sqrt(spread[-3, -3])),
        joint_noise=noise,
        length_noise=length_noise,
        angles=data.angles - data.angle_errors(x, noise, everywhere),
    )


class _Data:
    """The columns of the regression, (n, ...)."""

    def __init__(self, log: FingerLog) -> None:
        self.lengths, self.angles, self.tensions = log.lengths, log.angles, log.tensions
        self.speeds = np.gradient(log.lengths, log.control_dt, axis=0)
        self.turns = np.tanh(self.speeds / _SLIDES_AT)

    def without(self, first: int) -> _Data:
        """The same but for the first rows."""
        part = object.__new__(_Data)
        for name, values in vars(self).items():
            setattr(part, name, values[first:])
        return part

    def joint_noise(self) -> NDArray[np.float64]:
        """What of each angle no length, tension or speed tells: rad, (4,)."""
        known = np.column_stack([self._own(), self.lengths, np.ones(len(self.lengths))])
        left: Any = self.angles - known @ np.linalg.lstsq(known, self.angles)[0]
        freedom = max(1, len(known) - known.shape[1])
        noise = np.maximum(np.sqrt((left**2).sum(axis=0) / freedom), _LEAST_NOISE)
        return np.asarray(noise, np.float64)

    def start(self) -> NDArray[np.float64]:
        """Parameters to begin with, by instrumental variables; shape as `_UNITS`."""
        arms, own = np.zeros(ARMS.shape), np.empty((len(TENDONS), 3))
        ones = np.ones((len(self.lengths), 1))
        for i in range(len(TENDONS)):
            mine = [v[:, i : i + 1] for v in (self.tensions, self.turns, self.speeds)]
            others = np.delete(self.lengths, i, axis=1)
            known = np.column_stack([others, self._own(), ones])
            told = known @ np.linalg.lstsq(known, self.angles)[0]
            passed = np.flatnonzero(ARMS[i])
            columns = np.column_stack([told[:, passed], *mine, ones])
            solved = np.linalg.lstsq(columns, self.lengths[:, i])[0]
            arms[i, passed] = -solved[: len(passed)]
            own[i] = -solved[len(passed) : -1]
        shared = np.median(own, axis=0)
        x = np.concatenate([arms[ARMS], np.zeros(len(TENDONS)), shared]) / _UNITS
        x[_N_ARMS : _N_ARMS + len(TENDONS)] = self.off(x).mean(axis=0) / 1e-3
        return x

    def off(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measured lengths minus those of the model at the measured angles, m, (n, 7)."""
        zeros = x[_N_ARMS : _N_ARMS + len(TENDONS)] * 1e-3
        compliance, friction, damping = x[-3:] * _UNITS[-3:]
        gives = compliance * self.tensions + friction * self.turns + damping * self.speeds
        return self.lengths - (zeros - self.angles @ _arms(x).T - gives)

    def length_noise(self, x: NDArray[np.float64]) -> float:
        """Standard deviation, m, of the three sums of lengths in which no angle is."""
        free = self.off(x) @ null_space(_arms(x).T)
        return max(_LEAST_NOISE, float(np.median(1.4826 * np.median(np.abs(free), axis=0))))

    def variance(
        self, x: NDArray[np.float64], noise: NDArray[np.float64], length_noise: float
    ) -> NDArray[np.float64]:
        """Of each length, m², (n, 7); large where friction may have any sign, or a tendon hung."""
        friction = x[-2] * _UNITS[-2]
        plain = length_noise**2 + 0.5 * friction**2 * (1.0 - self.turns**2)
        weighed = np.linalg.solve(_total(x, noise, plain), self.off(x)[..., None])[..., 0]
        far = np.abs(plain * weighed) > _OUTLIER * np.sqrt(plain)
        return np.asarray(np.where(far, _OUTLIER_VARIANCE * plain, plain), np.float64)

    def angle_errors(
        self, x: NDArray[np.float64], noise: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """What the measured angles probably were off by, rad, (n, 4)."""
        weighed = np.linalg.solve(_total(x, noise, variance), self.off(x)[..., None])[..., 0]
        return weighed @ _arms(x) * noise**2

    def _own(self) -> NDArray[np.float64]:
        return np.column_stack([self.tensions, self.turns, self.speeds])


def _arms(x: NDArray[np.float64]) -> NDArray[np.float64]:
    arms = np.zeros(ARMS.shape)
    arms[ARMS] = x[:_N_ARMS] * 1e-3
    return arms


def _total(
    x: NDArray[np.float64], noise: NDArray[np.float64], variance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance of the lengths' errors at each time, m², (n, 7, 7)."""
    arms = _arms(x)
    through_angles = (arms * noise**2) @ arms.T
    return through_angles + variance[..., None] * np.eye(len(TENDONS))
