"""How far off a least-squares fit may be whose errors go on for a while."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["covariance", "quantile"]

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
