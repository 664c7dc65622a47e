"""Motor parameters, from commands and tensions; joint and friction parameters, from motion.

Lag, delay and strength of the motors are fitted first. Then `mujoco.sysid` simulates the finger
under the log's commands, one second at a time, and fits parameters until the simulated angles match
the measured ones. The simulated tendons do not stretch, which allows a longer time step. The motors
have the fitted lag and delay or, in a log with a command path, pull with the measured tensions.
"""

from __future__ import annotations

import copy
import importlib
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.optimize import least_squares
from scipy.signal import lfilter, savgol_filter

from shapechanger.errors import MissingExtra
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.identify.kinematics import Kinematics, robust_covariance
from shapechanger.finger.identify.log import FingerLog
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import drive_of

FINE_S: Final = 0.001
"""Time step of the simulation of motors alone, s."""

# Time at the start of the log that is ignored, s, while commands from before the log still act.
_FORGETS_S: Final = 0.3
# Bounds of the parameters.
_LONGEST_DELAY_S: Final = 0.15
_LAGS_S: Final = (0.002, 0.2)
_STRENGTHS: Final = (0.3, 2.0)
# The fit starts from the best of these delays: its cost has minima one control period apart.
_INITIAL_DELAYS_S: Final = (0.005, 0.03, 0.06, 0.1)
_LEAST_NOISE_N: Final = 1e-4
# Relative step of finite differences, large because clipping makes the residual not smooth.
_MOTOR_STEP: Final = 1e-3
# Smallest share of rows with a saturated tendon that allows the strength to be estimated.
_SATURATED: Final = 0.01


class CommandSignal:
    """Commands of a log as functions of time; the first also acts in the second before the log."""

    def __init__(self, log: FingerLog) -> None:
        self._t = np.concatenate([[log.t[0] - 1.0], log.t])
        steps = np.diff(self._t)[:, None] * log.commands
        # Each command acts in the period that ends with its row.
        self._sums = np.concatenate(
            [np.zeros((1, log.commands.shape[1])), np.cumsum(steps, axis=0)]
        )

    def delayed(self, start: float, dt: float, steps: int, delay: float) -> NDArray[np.float64]:
        """Mean command over each time step, (steps, 7), a continuous function of the delay, s."""
        edges = start + dt * np.arange(steps + 1) - delay
        sums = np.empty((steps + 1, self._sums.shape[1]))
        for i, column in enumerate(self._sums.T):
            sums[:, i] = np.interp(edges, self._t, column)
        return (sums[1:] - sums[:-1]) / dt

    def activations(
        self, start: float, dt: float, steps: int, delay: float, lag: float
    ) -> NDArray[np.float64]:
        """Activations of the motors at the end of each time step, -1 to 1, (steps, 7).

        Activations follow commands with a first-order lag, s, and begin at the first command.
        """
        given = self.delayed(start, dt, steps, delay)
        keeps = np.exp(-dt / lag)
        start_at = keeps * given[:1]
        filtered = cast("Any", lfilter([1.0 - keeps], [1.0, -keeps], given, axis=0, zi=start_at))
        return np.asarray(filtered[0], np.float64)


@dataclass(frozen=True, slots=True)
class Motors:
    """Lag, delay and strength of a finger's motors."""

    lag: float  # Time constant between a command and its force, s.
    delay: float  # Delay of the commands, s.
    strength: float  # Largest tensions, divided by the tensions assumed in the fit.
    sd: tuple[float, float, float]  # Standard errors of `lag`, `delay` and `strength`.
    saturates: bool  # Whether tendons saturate often enough; otherwise the strength is 1.
    tension_noise: float  # Standard deviation of measured tensions, N.


def fit_motors(log: FingerLog) -> Motors:
    """Fit lag, delay and strength of motors to a log; strength 1 is the known or nominal one."""
    known = log.motors or NOMINAL
    most = np.array(known.most_tension)
    drive = drive_of(log.actions, NOMINAL)
    commands = CommandSignal(log)
    speeds = np.gradient(log.lengths, log.control_dt, axis=0)
    steps = int(np.ceil(log.seconds / FINE_S)) + 1
    fine = log.t[0] + FINE_S * np.arange(1, steps + 1)
    rows = log.t >= log.t[0] + _FORGETS_S

    def demanded(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tensions, N, before clipping to their range."""
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
        diff_step=_MOTOR_STEP,
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


MOTOR_KG: Final = 0.02
"""Assumed mass of a motor at the tendon, kg, between a bare spool and a motor with gears. The mass
is not fitted: because of the stretch, fitted values were two to eight times too large."""

_N: Final = len(JOINTS)
FACTORS: Final[Mapping[str, float]] = {
    **{f"joint_stiffness/{j}": v for j, v in zip(JOINTS, NOMINAL.joint_stiffness, strict=True)},
    **{f"joint_damping/{j}": v for j, v in zip(JOINTS, NOMINAL.joint_damping, strict=True)},
    # N, chosen: the nominal friction is 0, which has no logarithm.
    "tendon_friction": 0.5,
}
"""Fitted parameters and their initial values, in SI units. The fit changes the logarithm of each
parameter divided by its initial value, so that no parameter can change its sign."""

# Length of a window, s: longer than a joint takes to come to rest, and short enough that errors of
# the initial state and of the model do not add up.
_WINDOW_S: Final = 1.0
# Time at the start of the log that is ignored, s, while the finger leaves its initial pose.
_SETTLES_S: Final = 0.3
# Number of rows that each third-degree polynomial for velocities is fitted to.
_ROWS: Final = 7
# Prior standard deviation of a factor's logarithm. Because of the prior, parameters that the motion
# does not determine keep their initial values.
_PRIOR_SD: Final = math.log(3.0)
_MAX_LOG_FACTOR: Final = math.log(30.0)
# Standard deviation of simulated minus measured angles under the best model, rad.
_ANGLE_SD: Final = math.radians(1.0)
# Lag of a simulated motor whose controls are measured tensions, s.
_INSTANT_S: Final = 1e-4
_ITERATIONS: Final = 12
# Step of finite differences, and the step that ends the search, in logarithms.
_STEP: Final = 1e-3
_TOLERANCE: Final = 1e-3


@dataclass(frozen=True, slots=True)
class Window:
    """Part of a log, and the state at its start."""

    start: float  # Time of the first row, s.
    angles: NDArray[np.float64]  # At the start and after each control period, rad, (m + 1, 4).
    velocities: NDArray[np.float64]  # Angular velocities at the start, rad/s, (4,).
    activations: NDArray[np.float64]  # Activations of the motors at the start, -1 to 1, (7,).


def cut_windows(
    log: FingerLog,
    kinematics: Kinematics,
    motors: Motors,
    last: int | None = None,
    length_s: float = _WINDOW_S,
    first_s: float = _SETTLES_S,
) -> list[Window]:
    """Cut a log, from `first_s`, s, on, into adjacent windows of `length_s`, s.

    The last window ends before the row `last`; None for the end of the log.
    """
    dt = log.control_dt
    velocities = savgol_filter(kinematics.angles, _ROWS, 3, deriv=1, delta=dt, axis=0)
    steps = int(np.ceil(log.seconds / FINE_S)) + 1
    activations = CommandSignal(log).activations(
        float(log.t[0]), FINE_S, steps, motors.delay, motors.lag
    )
    rows = round(length_s / dt)
    last = len(log) if last is None else last
    windows: list[Window] = []
    for row in range(round(first_s / dt), last - rows, rows):
        step = min(steps - 1, round((log.t[row] - log.t[0]) / FINE_S) - 1)
        windows.append(
            Window(
                start=float(log.t[row]),
                angles=kinematics.angles[row : row + rows + 1],
                velocities=np.asarray(velocities[row], np.float64),
                activations=np.clip(activations[max(step, 0)], -1.0, 1.0),
            )
        )
    return windows


def steps_per_period(control_dt: float, timestep: float) -> int:
    """Smallest number of equal steps in a control period, s, each at most `timestep`, s."""
    return math.ceil(control_dt / timestep - 1e-6)


def with_motors(motors: Motors, known: FingerParameters | None) -> FingerParameters:
    """The nominal finger with the fitted lag, and the motors `known`; for None, estimated ones."""
    nominal = NOMINAL.replace(motor_lag=motors.lag)
    if known is None:
        most = motors.strength * np.array(NOMINAL.most_tension)
        return nominal.replace(most_tension=tuple(most.tolist()), motor_kg=MOTOR_KG)
    kept = ("most_tension", "least_tension", "motor_kg", "tendon_damping")
    return nominal.replace(**{name: getattr(known, name) for name in kept})


def fit_dynamics(
    log: FingerLog, kinematics: Kinematics, motors: Motors, last: int | None = None
) -> dict[str, tuple[float, float]]:
    """Fit joint and friction parameters to a log, up to the row `last`, or to its end for None.

    Returns each value, in SI units, and the standard error of its logarithm, keyed by the names of
    `FACTORS`. The standard errors assume that the model is right.
    """
    sysid: Any = importlib.import_module("mujoco.sysid")  # The module has no type annotations.
    # If its dependencies are missing, the module can be imported, but is empty.
    if not hasattr(sysid, "build_residual_fn"):
        raise MissingExtra("mujoco[sysid]", "identify")
    fit = _MotionFit(sysid, log, kinematics, motors, last)
    found, result = sysid.optimize(
        fit.parameters(),
        fit.residual,
        optimizer="mujoco",
        verbose=False,
        output=io.StringIO(),  # It prints each iteration even if not verbose.
        max_iters=_ITERATIONS,
        eps=_STEP,
        xtol=_TOLERANCE,
    )
    x = np.asarray(found.as_vector(), np.float64)
    sd = np.sqrt(np.diag(fit.covariance(x, np.asarray(result.jac, np.float64))))
    return {
        name: (begin * math.exp(x[i]), float(sd[i]))
        for i, (name, begin) in enumerate(FACTORS.items())
    }


class _MotionFit:
    """Residuals of the simulated motion; parameters are logarithms of factors on `FACTORS`."""

    def __init__(
        self, sysid: Any, log: FingerLog, kinematics: Kinematics, motors: Motors, last: int | None
    ) -> None:
        self._sysid = sysid
        self._arms = kinematics.arms
        moved = with_motors(motors, log.motors)
        self._path = None if log.motors is None else log.motors.path
        if self._path is not None:
            # The controls are measured tensions, which already include the lag of the path.
            moved = moved.replace(path=self._path, motor_lag=_INSTANT_S)
        self._least, most = moved.least_tension, np.array(moved.most_tension)
        self._range = most - self._least
        spec = build_finger(moved, drive_of(log.actions, NOMINAL))
        angle, of = mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtObj.mjOBJ_JOINT
        for name in JOINTS:
            spec.add_sensor(name=name, type=angle, objtype=of, objname=name)
        self._skip = steps_per_period(log.control_dt, spec.option.timestep)
        spec.option.timestep = log.control_dt / self._skip
        self._model: mujoco.MjModel = spec.compile()
        windows = cut_windows(log, kinematics, motors, last)
        self._residual = sysid.build_residual_fn(
            models_sequences=[self._sequences(spec, windows, log, motors.delay)],
            build_model=self._build,
            modify_residual=self._compare,
            resample_true=False,
            n_threads=1,
        )

    def parameters(self) -> Any:
        """Initial parameters and their bounds, for `mujoco.sysid`."""
        found, ends = self._sysid.ParameterDict(), np.full(len(FACTORS), _MAX_LOG_FACTOR)
        found.add(self._sysid.Parameter("factors", np.zeros(len(FACTORS)), -ends, ends))
        return found

    def residual(self, x: NDArray[np.float64], parameters: Any, **more: Any) -> Any:
        """Errors of the angles in each window, then of the prior, in standard deviations."""
        errors, predicted, measured = self._residual(x, parameters, **more)
        priors = x / _PRIOR_SD
        return [*errors, priors], predicted, measured

    def covariance(
        self, x: NDArray[np.float64], jacobian: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Sandwich estimate of the covariance at an optimum; windows are independent clusters."""
        parts, _, _ = self.residual(x, self.parameters())
        bread = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        filling = np.eye(len(x)) / _PRIOR_SD**2
        row = 0
        for part in parts[:-1]:
            score = jacobian[row : row + np.size(part)].T @ np.ravel(part)
            filling += np.outer(score, score)
            row += np.size(part)
        windows = len(parts) - 1
        spread = bread @ filling @ bread * (windows / max(1, windows - 1))
        # A few windows may agree by chance, so intervals are at least as wide as for noise alone.
        wider = np.sqrt(np.maximum(1.0, np.diag(bread) / np.diag(spread)))
        return spread * np.outer(wider, wider)

    def _build(self, parameters: Any, spec: mujoco.MjSpec) -> mujoco.MjModel:
        del spec  # Compiling it for each candidate would take most of the time.
        x = parameters.as_vector()
        values = np.array(list(FACTORS.values())) * np.exp(x)
        model = copy.copy(self._model)
        # The stiffness at the ends of the ranges changes in proportion.
        model.jnt_stiffnesspoly[:_N] *= (values[:_N] / model.jnt_stiffness[:_N])[:, None]
        model.jnt_stiffness[:_N] = values[:_N]
        model.dof_damping[:_N] = values[_N : 2 * _N]
        n = len(self._arms)
        model.tendon_frictionloss[:n] = values[2 * _N]
        # The coefficients of fixed tendons: minus the arms, tendon by tendon.
        model.wrap_prm[: n * _N] = -self._arms.ravel()
        return model

    def _sequences(
        self, spec: mujoco.MjSpec, windows: list[Window], log: FingerLog, delay: float
    ) -> Any:
        step = self._model.opt.timestep
        commands = CommandSignal(log)
        tensions = 2.0 * (log.tensions - self._least) / self._range - 1.0
        measured_at = make_interp_spline(log.t, np.clip(tensions, -1.0, 1.0), k=1)
        sensor = self._sysid.SignalType.MjSensor
        columns = {name: (sensor, np.array([j])) for j, name in enumerate(JOINTS)}
        series = self._sysid.TimeSeries
        starts, controls, measured = list[Any](), list[Any](), list[Any]()
        for window in windows:
            begun = window.activations if self._path is None else measured_at(window.start)
            state = (window.angles[0], window.velocities, begun)
            starts.append(self._sysid.create_initial_state(self._model, *state))
            # The series needs one more control than there are steps.
            steps = (len(window.angles) - 1) * self._skip + 1
            at = window.start + step * np.arange(steps)
            late = None if self._path else commands.delayed(window.start, step, steps, delay)
            controls.append(series(at, measured_at(at) if late is None else late))
            times = window.start + log.control_dt * np.arange(len(window.angles))
            measured.append(series(times, window.angles, columns))
        names = [f"{window.start:.1f} s" for window in windows]
        return self._sysid.ModelSequences("finger", spec, names, starts, controls, measured)

    def _compare(
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
        # A row of the state begins with the time; the first row is one step after the start.
        ends = state[self._skip - 1 :: self._skip, 1 : 1 + _N]
        return (ends - measured.data[1:]) / _ANGLE_SD, measured, measured
