"""MuJoCo's toolbox for system identification, which is there only with its extra."""

from __future__ import annotations

import copy
import importlib
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from shapechanger.bodies.finger import (
    JOINTS,
    NOMINAL,
    FingerParameters,
    build_finger,
    drive_of,
)
from shapechanger.errors import MissingExtra
from shapechanger.identify.kinematics import ARMS, Kinematics
from shapechanger.identify.log import FingerLog
from shapechanger.identify.motors import CommandSignal, Motors

__all__ = [
    "FACTORS",
    "MOTOR_KG",
    "Dynamics",
    "MotionFit",
    "Window",
    "fit_dynamics",
    "sysid_toolbox",
    "windows",
    "with_motors",
]


def sysid_toolbox() -> Any:
    """The module `mujoco.sysid`; it has no types.

    Raises:
        MissingExtra: If what it needs is not installed.
    """
    module = importlib.import_module("mujoco.sysid")
    # Without its dependencies it can be imported all the same, but is empty.
    if not hasattr(module, "build_residual_fn"):
        raise MissingExtra("mujoco[sysid]", "identify")
    return module


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
    commands = CommandSignal(log)
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


MOTOR_KG: Final = 0.02
"""What motors are taken to weigh, kg: fitted as well, it came out two to eight times too heavy, as
it takes in what stretch does. Chosen, between a bare spool and a motor with gears."""

_N: Final = len(JOINTS)
FACTORS: Final[Mapping[str, float]] = MappingProxyType(
    {
        **{f"joint_stiffness/{j}": v for j, v in zip(JOINTS, NOMINAL.joint_stiffness, strict=True)},
        **{f"joint_damping/{j}": v for j, v in zip(JOINTS, NOMINAL.joint_damping, strict=True)},
        # N. The nominal finger has none, and zero has no logarithm. Chosen.
        "tendon_friction": 0.5,
    }
)
"""What is fitted, and where the search begins, in SI units. Factors over these are fitted, as
logarithms: none may change its sign."""

# How far from there a parameter is believed to be, as a standard deviation of its logarithm: what
# the motion does not tell stays where it began.
_BELIEF: Final = math.log(3.0)
_FARTHEST: Final = math.log(30.0)
_FARTHEST_ARM: Final = 5.0
# rad. What simulated and measured angles differ by when the model is as good as it gets.
_OFF: Final = math.radians(1.0)
# m². So that the covariance of arms that are known exactly has a root.
_ROUNDING: Final = 1e-18


def with_motors(motors: Motors, known: FingerParameters | None) -> FingerParameters:
    """The nominal finger with motors as they are known, or else as they were found.

    Args:
        motors: What the tensions say.
        known: A finger with its motors; None where nothing is known of them.
    """
    found = NOMINAL.replace(motor_lag=motors.lag)
    if known is None:
        most = motors.strength * np.array(NOMINAL.most_tension)
        return found.replace(most_tension=tuple(most.tolist()), motor_kg=MOTOR_KG)
    return found.replace(
        most_tension=known.most_tension,
        least_tension=known.least_tension,
        motor_kg=known.motor_kg,
        tendon_damping=known.tendon_damping,
    )


class MotionFit:
    """Compares simulated with measured motion.

    Parameters are, in order: the logarithms of the factors over `FACTORS`, (9,), and with arms how
    many standard errors the 25 are off those of the lengths, along the axes of their covariance.

    Args:
        sysid: The module `mujoco.sysid`.
        log: The log.
        kinematics: What its lengths say.
        motors: What its tensions say.
        last: The row before which the last window ends; None for the end of the log.
        with_arms: Whether arms are fitted.
        known: A finger with its motors; None where nothing is known of them.
    """

    def __init__(
        self,
        sysid: Any,
        log: FingerLog,
        kinematics: Kinematics,
        motors: Motors,
        last: int | None,
        *,
        with_arms: bool,
        known: FingerParameters | None = None,
    ) -> None:
        self._sysid = sysid
        self._arms = kinematics.arms
        rounding = _ROUNDING * np.eye(len(kinematics.arms_covariance))
        self._arm_axes = np.linalg.cholesky(kinematics.arms_covariance + rounding)
        self._n_arms = int(ARMS.sum()) if with_arms else 0
        self._believed_sd = np.concatenate([np.full(len(FACTORS), _BELIEF), np.ones(self._n_arms)])
        finger = with_motors(motors, known)
        spec = build_finger(finger, drive_of(log.actions, NOMINAL))
        for name in JOINTS:
            spec.add_sensor(
                name=name,
                type=mujoco.mjtSensor.mjSENS_JOINTPOS,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=name,
            )
        # Whole steps in a period, whatever the log's.
        self._skip = math.ceil(log.control_dt / spec.option.timestep - 1e-6)
        spec.option.timestep = log.control_dt / self._skip
        self._model: mujoco.MjModel = spec.compile()
        commands = CommandSignal(log)
        cut = windows(log, kinematics, motors, last)
        self._residual = sysid.build_residual_fn(
            models_sequences=[self._sequences(spec, cut, commands, motors.delay, log.control_dt)],
            build_model=self._built,
            modify_residual=self._compared,
            resample_true=False,
            n_threads=1,
        )

    def parameters(self) -> Any:
        """Where the fit begins, and its bounds."""
        found = self._sysid.ParameterDict()
        for name, many, most in (
            ("factors", len(FACTORS), _FARTHEST),
            ("arms", self._n_arms, _FARTHEST_ARM),
        ):
            if many:
                zero = np.zeros(many)
                found.add(self._sysid.Parameter(name, zero, zero - most, zero + most))
        return found

    def residual(self, x: NDArray[np.float64], parameters: Any, **more: Any) -> Any:
        """Off in angles, window by window, then off from what was believed, each over its sd."""
        off, predicted, measured = self._residual(x, parameters, **more)
        beliefs = (x.T / self._believed_sd).T
        return [*off, beliefs], predicted, measured

    def arms(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Moment arms of parameters, m, (7, 4)."""
        arms = self._arms.copy()
        if self._n_arms:
            arms[ARMS] += self._arm_axes @ x[len(FACTORS) :]
        return arms

    def rms(self, x: NDArray[np.float64]) -> float:
        """What simulated angles are off by, rad."""
        off, _, _ = self._residual(x, self.parameters())
        return _OFF * float(np.sqrt(np.mean(np.concatenate([np.ravel(o) for o in off]) ** 2)))

    def covariance(
        self, x: NDArray[np.float64], jacobian: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Of the parameters: each window errs on its own, whatever happens in it.

        Args:
            x: The optimum.
            jacobian: Of the residuals there.
        """
        parts, _, _ = self.residual(x, self.parameters())
        bread = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        filling = np.diag(self._believed_sd**-2)
        at = 0
        for part in parts[:-1]:
            push = jacobian[at : at + np.size(part)].T @ np.ravel(part)
            filling += np.outer(push, push)
            at += np.size(part)
        many = len(parts) - 1
        spread = bread @ filling @ bread * (many / max(1, many - 1))
        # Few windows may seem to agree by chance.
        wider = np.sqrt(np.maximum(1.0, np.diag(bread) / np.diag(spread)))
        return spread * np.outer(wider, wider)

    def _built(self, parameters: Any, spec: mujoco.MjSpec) -> mujoco.MjModel:
        del spec  # To compile it again for each candidate would take most of the time.
        x = parameters.as_vector()
        values = np.array(list(FACTORS.values())) * np.exp(x[: len(FACTORS)])
        model = copy.copy(self._model)
        model.jnt_stiffness[:_N] = values[:_N]
        model.dof_damping[:_N] = values[_N : 2 * _N]
        model.tendon_frictionloss[:] = values[2 * _N]
        # A spec's fixed tendons cannot be written, a model's can: minus the arms, tendon by tendon.
        model.wrap_prm[:] = -self.arms(x).ravel()
        return model

    def _sequences(
        self,
        spec: mujoco.MjSpec,
        cut: list[Window],
        commands: CommandSignal,
        delay: float,
        control_dt: float,
    ) -> Any:
        step = self._model.opt.timestep
        kind = self._sysid.SignalType.MjSensor
        columns = {name: (kind, np.array([j])) for j, name in enumerate(JOINTS)}
        series = self._sysid.TimeSeries
        starts: list[Any] = []
        controls: list[Any] = []
        sensed: list[Any] = []
        for window in cut:
            state = (window.angles[0], window.velocities, window.activations)
            starts.append(self._sysid.create_initial_state(self._model, *state))
            # One more than there are steps: the last one is not simulated.
            steps = (len(window.angles) - 1) * self._skip + 1
            late = commands.late(window.start, step, steps, delay)
            controls.append(series(window.start + step * np.arange(steps), late))
            at = window.start + control_dt * np.arange(len(window.angles))
            sensed.append(series(at, window.angles, columns))
        names = [f"{window.start:.1f} s" for window in cut]
        return self._sysid.ModelSequences("finger", spec, names, starts, controls, sensed)

    def _compared(
        self,
        parameters: Any,
        predicted: Any,
        measured: Any,
        model: mujoco.MjModel,
        return_all: bool,
        *,
        state: NDArray[np.float64],
        **more: Any,
    ) -> Any:
        del parameters, predicted, model, return_all, more
        # A row of the state begins with the time; the first is a step after the start.
        ends = state[self._skip - 1 :: self._skip, 1 : 1 + _N]
        return (ends - measured.data[1:]) / _OFF, measured, measured


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
