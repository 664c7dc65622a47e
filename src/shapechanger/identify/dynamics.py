"""Joints and friction, from how the finger moves: a fit of its simulation with `mujoco.sysid`.

The simulated finger gets the log's commands, a second at a time, and must come to the angles that
were measured. Its tendons do not stretch, so that it can be simulated fast enough: its motors push
on the joints directly, and are late as their tensions were.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import FingerParameters
from shapechanger.identify.kinematics import Kinematics
from shapechanger.identify.log import FingerLog
from shapechanger.identify.motion_fit import FACTORS, MotionFit
from shapechanger.identify.motors import Motors
from shapechanger.identify.toolbox import sysid_toolbox

__all__ = ["Dynamics", "fit_dynamics"]

_ITERATIONS: Final = 12
# Of a logarithm: differences this far apart, and steps below this end the search.
_STEP: Final = 1e-3
_GOOD_ENOUGH: Final = 1e-3


@dataclass(frozen=True, slots=True)
class Dynamics:
    """What the motion says about joints and friction.

    Attributes:
        values: Of `FACTORS`, by name, in SI units.
        sd: Standard errors of their logarithms, by name, as far as the model is right.
        arms: Moment arms, m, (7, 4); those of the lengths unless they were fitted as well.
        rms: What simulated angles were off by after up to a second, rad.
    """

    values: dict[str, float]
    sd: dict[str, float]
    arms: NDArray[np.float64]
    rms: float


def fit_dynamics(
    log: FingerLog,
    kinematics: Kinematics,
    motors: Motors,
    last: int | None = None,
    *,
    with_arms: bool = False,
    known: FingerParameters | None = None,
) -> Dynamics:
    """Fit joints and friction to a log.

    Args:
        log: The log.
        kinematics: What its lengths say.
        motors: What its tensions say.
        last: The row before which the fit ends; what comes after is left for a check.
        with_arms: Whether to fit the arms once more, beginning with those of the lengths and
            keeping to them as far as their standard errors say.
        known: A finger with its motors; None where nothing is known of them.

    Raises:
        MissingExtra: If `mujoco.sysid` is not there.
    """
    sysid = sysid_toolbox()
    fit = MotionFit(sysid, log, kinematics, motors, last, with_arms=with_arms, known=known)
    found, result = sysid.optimize(
        fit.parameters(),
        fit.residual,
        optimizer="mujoco",
        verbose=False,
        output=io.StringIO(),  # It tells of each iteration, verbose or not.
        max_iters=_ITERATIONS,
        eps=_STEP,
        xtol=_GOOD_ENOUGH,
    )
    x = np.asarray(found.as_vector(), np.float64)
    sd = np.sqrt(np.diag(fit.covariance(x, np.asarray(result.jac, np.float64))))
    return Dynamics(
        values={name: begin * math.exp(x[i]) for i, (name, begin) in enumerate(FACTORS.items())},
        sd={name: float(sd[i]) for i, name in enumerate(FACTORS)},
        arms=fit.arms(x),
        rms=fit.rms(x),
    )
