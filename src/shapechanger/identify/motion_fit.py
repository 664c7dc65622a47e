"""The residuals of the fit of the motion, as `mujoco.sysid` wants them."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import (
    JOINTS,
    NOMINAL,
    FingerParameters,
    build_finger,
    drive_of,
)
from shapechanger.identify.commands import Commands
from shapechanger.identify.kinematics import ARMS, Kinematics
from shapechanger.identify.log import FingerLog
from shapechanger.identify.motors import Motors
from shapechanger.identify.windows import Window, windows

__all__ = ["FACTORS", "MOTOR_KG", "MotionFit", "with_motors"]

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
        commands = Commands(log)
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
        commands: Commands,
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
