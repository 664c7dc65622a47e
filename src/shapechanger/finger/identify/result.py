"""Identification of a finger: parameters with intervals, and a validation on later motion.

`identify` runs the fits of this package and collects the results.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.identify.kinematics import (
    ARMS,
    Kinematics,
    fit_kinematics,
    interval_quantile,
)
from shapechanger.finger.identify.log import FingerLog, require_informative
from shapechanger.finger.identify.motion import (
    FACTORS,
    MOTOR_KG,
    CommandSignal,
    Motors,
    Window,
    cut_windows,
    fit_dynamics,
    fit_motors,
    steps_per_period,
    with_motors,
)
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.plant import HeldTensions, hold_controls
from shapechanger.finger.tensions import drive_of

# Share of the log that the motion is fitted to; the rest is for validation.
_FITTED: Final = 0.8
_NORMAL: Final = 1.96
# Standard deviations, in logarithms, of errors of the motion fit that come from its model, measured
# on twenty fingers of the gap "real-like" (`benchmarks/finger_identify.py`). Tendons stretch in
# these fingers, but not in the fit's model. The hood hides the stiffness of the end joint. Without
# a rig's command path, stretch hides friction.
_MODEL_ERROR: Final = {
    "joint_stiffness": 0.15,
    "joint_stiffness/DIP_flexion": 0.40,
    "joint_damping": 0.20,
    "tendon_friction": 1.15,
}
_RIG_FRICTION_ERROR: Final = 0.15
# Standard deviations of errors of the stretch, as a share of it, and of moment arms on a rig, m.
# Backlash and friction of the gears cause the errors.
_STRETCH_ERROR: Final = 0.02
RIG_ARM_ERROR_M: Final = 0.04e-3
# Standard deviations of errors of delay and lag, s. The time at which a sensor is read varies,
# and motors are not exactly first-order. In simulation, tensions are one or two steps old.
_DELAY_ERROR_S: Final = 0.002
_LAG_ERROR_S: Final = 0.0005
# Interval between the delays with which the motion is replayed, s.
_DELAY_STEP_S: Final = 0.0025
PATH_DELAY_ERROR_S: Final = 0.009
"""Half the 95 % interval of a delay found from motion, s. Errors were below 9 ms for nineteen of
twenty fingers with backlash (`benchmarks/finger_identify.py`), and 2.6 to 4.8 ms on twins."""
# Largest stiffness, N/m, that can be distinguished from infinity: at this stiffness, the largest
# tension stretches a tendon by 0.1 mm.
_STIFFEST: Final = 2.5e5
# Standard deviation of angles, rad, below which they count as free of noise.
_NO_NOISE: Final = 1e-5
_UNITS: Final = {
    "joint_stiffness": "N·m/rad",
    "joint_damping": "N·m·s/rad",
    "tendon_friction": "N",
}


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One parameter of a finger with its 95 % interval.

    Attributes:
        name: Name, such as `moment_arms/FDP/MCP_flexion`.
        unit: SI unit of the four values below.
        value: Estimate.
        low: Lower end of the interval.
        high: Upper end of the interval.
        nominal: Value of the nominal finger; infinite for `tendon_stiffness`.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    nominal: float

    @property
    def differs(self) -> bool:
        """Return whether the nominal value lies outside the interval."""
        return not self.low <= self.nominal <= self.high


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Measured and simulated motion in the part of a log that the motion fit did not use."""

    t: NDArray[np.float64]  # Time since the start of the log, s, (n,).
    measured: NDArray[np.float64]  # Measured angles, rad, (n, 4).
    identified: NDArray[np.float64]  # Angles of the identified finger, rad, (n, 4).
    nominal: NDArray[np.float64]  # Angles of the nominal finger, rad, (n, 4).

    @property
    def off(self) -> tuple[float, float]:
        """Root mean square errors of the identified and of the nominal finger, rad."""
        off = (one - self.measured for one in (self.identified, self.nominal))
        identified, nominal = (float(np.sqrt(np.mean(one**2))) for one in off)
        return identified, nominal


@dataclass(frozen=True, slots=True)
class IdentifiedFinger:
    """Result of `identify`.

    Attributes:
        parameters: The finger, for `build_finger` or the env's argument `parameters`.
        estimates: Identified parameters with intervals, the moment arms first.
        undetermined: Names of parameters that the log cannot determine, each with the reason.
        held_out: Validation on the part of the log that the motion fit did not use.
        source: Source named in the log.
        seconds: Length of the log, s.
    """

    parameters: FingerParameters
    estimates: tuple[ParameterEstimate, ...]
    undetermined: tuple[tuple[str, str], ...]
    held_out: HeldOut
    source: str
    seconds: float

    @property
    def arms(self) -> tuple[ParameterEstimate, ...]:
        """Estimates of the moment arms."""
        return tuple(e for e in self.estimates if e.name.startswith("moment_arms/"))

    @property
    def arm_intervals(self) -> NDArray[np.float64]:
        """95 % intervals of the moment arms, m, (7, 4, 2); 0 if a tendon does not cross a joint."""
        ends = np.zeros((len(TENDONS), len(JOINTS), 2))
        for estimate in self.arms:
            _, tendon, joint = estimate.name.split("/")
            ends[TENDONS.index(tendon), JOINTS.index(joint)] = estimate.low, estimate.high
        return ends


def identify(log: FingerLog, progress: Callable[[str], None] = lambda _: None) -> IdentifiedFinger:
    """Estimate the parameters of a finger from a log.

    Arms and stretch are estimated from the lengths, angles and tensions of the whole log, and
    motors from its commands and tensions. Joint and friction parameters are fitted to the first
    four fifths of the motion by `mujoco.sysid`. The last fifth is simulated for validation. On the
    path of a rig, tensions do not show delays below a period, so the motion determines the delay.

    Args:
        log: A log, such as of ten seconds, in which each joint moves through much of its range
            under varying tensions.
        progress: Called with the name of each step before it starts.

    Raises:
        FingerError: If the log is too short, or a joint hardly moves or moves only with others.
        MissingExtra: If the dependencies of `mujoco.sysid` are not installed.
    """
    require_informative(log)
    progress("arms and stretch, from lengths")
    kinematics = fit_kinematics(log)
    progress("motors, from tensions")
    motors = fit_motors(log)
    progress("joints and friction, from motion")
    last = round(_FITTED * len(log))
    dynamics = fit_dynamics(log, kinematics, motors, last)
    parameters = _parameters(kinematics, motors, dynamics, log.motors)
    if parameters.path is not None:
        progress("delay, from motion")
        late = _delay(log, parameters, cut_windows(log, kinematics, motors, last))
        motors = dataclasses.replace(motors, lag=parameters.motor_lag, delay=late)
        parameters = parameters.replace(command_delay=late)
    progress("the last fifth, simulated")
    rows = len(log) - 1 - last
    dt = log.control_dt
    window = cut_windows(log, kinematics, motors, len(log) + 1, rows * dt, last * dt)[0]
    return IdentifiedFinger(
        parameters=parameters,
        estimates=_estimates(kinematics, motors, dynamics, log),
        undetermined=_undetermined(motors, log.motors),
        held_out=HeldOut(
            t=log.t[last:] - log.t[0],
            measured=log.angles[last:],
            identified=replay(log, parameters, window),
            nominal=replay(log, NOMINAL, window),
        ),
        source=log.source,
        seconds=log.seconds,
    )


def replay(log: FingerLog, parameters: FingerParameters, window: Window) -> NDArray[np.float64]:
    """Simulate a finger under the commands of a log, from the state at the start of a window.

    Returns angles, rad, (m + 1, 4); the first row is the first row of the window.
    """
    drive, delay = drive_of(log.actions, NOMINAL), parameters.command_delay
    if parameters.path is None:  # The commands below are delayed already.
        parameters = parameters.replace(command_delay=0.0)
    model = build_finger(parameters, drive).compile()
    skip = steps_per_period(log.control_dt, model.opt.timestep)
    step = model.opt.timestep = log.control_dt / skip
    data = mujoco.MjData(model)
    n, arms = len(JOINTS), parameters.arms
    data.qpos[:n], data.qvel[:n] = window.angles[0], window.velocities
    row = int(np.searchsorted(log.t, window.start - 0.5 * log.control_dt))
    if parameters.tendon_stiffness is not None:
        stretch = parameters.backlash + log.tensions[row] / parameters.tendon_stiffness
        data.qpos[n:] = arms @ window.angles[0] + stretch
        data.qvel[n:] = arms @ window.velocities
    periods = len(window.angles) - 1
    angles = [window.angles[0]]
    if parameters.path is not None:
        held = HeldTensions(parameters.path, parameters, drive, log.control_dt, step)
        hold_controls(model, data, held.start(log.tensions[row]))
        for command in log.commands[row + 1 : row + 1 + periods]:
            held.advance(model, data, command)
            angles.append(data.qpos[:n].copy())
        return np.array(angles)
    commands = CommandSignal(log)
    before = math.ceil((window.start - float(log.t[0])) / step)
    activations = commands.activations(
        window.start - before * step, step, before, delay, parameters.motor_lag
    )
    data.act[:] = np.clip(activations[-1], -1.0, 1.0)
    late = commands.delayed(window.start, step, skip * periods, delay)
    for period in range(periods):
        for command in late[period * skip : (period + 1) * skip]:
            data.ctrl[:] = command
            mujoco.mj_step(model, data)
        angles.append(data.qpos[:n].copy())
    return np.array(angles)


def _delay(log: FingerLog, parameters: FingerParameters, windows: list[Window]) -> float:
    """Return the delay of the commands, s, with the smallest errors of the replayed angles."""
    delays = np.arange(0.0, 1.5 * log.control_dt, _DELAY_STEP_S)
    errors: list[float] = []
    for delay in delays.tolist():
        late = parameters.replace(command_delay=delay)
        errors.append(sum(float(np.sum((replay(log, late, w) - w.angles) ** 2)) for w in windows))
    at = min(max(int(np.argmin(errors)), 1), len(delays) - 2)
    # Take the minimum of the parabola through the lowest error and its two neighbours.
    before, lowest, after = errors[at - 1 : at + 2]
    bend = before - 2.0 * lowest + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(delays[at] + _DELAY_STEP_S * min(max(shift, -1.0), 1.0))


def _estimates(
    kinematics: Kinematics,
    motors: Motors,
    dynamics: Mapping[str, tuple[float, float]],
    log: FingerLog,
) -> tuple[ParameterEstimate, ...]:
    """All identified parameters with their intervals, the moment arms first."""
    reach = interval_quantile(len(log), log.control_dt)
    on_rig = log.motors is not None and log.motors.path is not None
    found: list[ParameterEstimate] = []
    for i, j in np.argwhere(ARMS).tolist():
        value, sd = float(kinematics.arms[i, j]), float(kinematics.arms_sd[i, j])
        if on_rig:
            sd = math.hypot(sd, RIG_ARM_ERROR_M)
        name = f"moment_arms/{TENDONS[i]}/{JOINTS[j]}"
        found.append(_around(name, "m", value, reach * sd, NOMINAL.moment_arms[i][j]))
    found.append(_stiffness_estimate(kinematics, reach))
    nominal = {**FACTORS, "tendon_friction": NOMINAL.tendon_friction}
    for name, (value, sd) in dynamics.items():
        kind = name.split("/")[0]
        error = _MODEL_ERROR.get(name, _MODEL_ERROR[kind])
        if on_rig and name == "tendon_friction":
            error = _RIG_FRICTION_ERROR
        by = math.exp(_NORMAL * math.hypot(sd, error))
        unit = _UNITS[kind]
        found.append(ParameterEstimate(name, unit, value, value / by, value * by, nominal[name]))
    if on_rig:
        late = _around("command_delay", "s", motors.delay, PATH_DELAY_ERROR_S, 0.0, least=0.0)
        return (*found, late)
    lag = reach * math.hypot(motors.sd[0], _LAG_ERROR_S)
    delay = reach * math.hypot(motors.sd[1], _DELAY_ERROR_S)
    found += [
        _around("motor_lag", "s", motors.lag, lag, NOMINAL.motor_lag, least=0.0),
        _around("command_delay", "s", motors.delay, delay, NOMINAL.command_delay, least=0.0),
    ]
    if motors.saturates:
        found.append(_around("strength", "1", motors.strength, reach * motors.sd[2], 1.0))
    return tuple(found)


def _parameters(
    kinematics: Kinematics,
    motors: Motors,
    dynamics: Mapping[str, tuple[float, float]],
    known: FingerParameters | None,
) -> FingerParameters:
    """The identified finger, in which undetermined parameters are known or assumed ones."""
    noise = float(np.sqrt(np.mean(kinematics.joint_noise**2)))
    plain = with_motors(motors, known)
    if known is not None and known.path is not None:
        plain = plain.replace(path=known.path, motor_lag=known.motor_lag)
    joints = {
        kind: tuple(dynamics[f"{kind}/{joint}"][0] for joint in JOINTS)
        for kind in ("joint_stiffness", "joint_damping")
    }
    return plain.replace(
        moment_arms=kinematics.arms,
        tendon_friction=dynamics["tendon_friction"][0],
        tendon_stiffness=_stiffness(kinematics),
        command_delay=motors.delay,
        joint_noise=noise if noise > _NO_NOISE else 0.0,
        tension_noise=motors.tension_noise,
        **joints,
    )


def _undetermined(motors: Motors, known: FingerParameters | None) -> tuple[tuple[str, str], ...]:
    """Names of the parameters that the log cannot determine, each with the reason."""
    kg = MOTOR_KG if known is None else known.motor_kg
    damping = "nominal" if known is None else f"{known.tendon_damping:g} N·s/m"
    undetermined = {
        "joint_friction": "Acts like friction in the tendons; assumed nominal.",
        "tendon_damping": f"Acts like friction in the tendons; assumed {damping}.",
        "motor_kg": f"Masked by stretch and damping; assumed {1e3 * kg:.0f} g.",
        "backlash": "Acts like an offset of a motor's zero; assumed none.",
    }
    if known is not None and known.path is not None:
        lag = f"Hidden by the control period; assumed {1e3 * known.motor_lag:g} ms."
        undetermined["motor_lag"] = lag
    if known is None and not motors.saturates:
        undetermined["most_tension"] = "No tendon reached its largest tension; assumed nominal."
    return tuple(undetermined.items())


def _stiffness(kinematics: Kinematics) -> float | None:
    """Stiffness of the tendons, N/m; None if no stretch is visible."""
    compliance = kinematics.compliance
    visible = compliance > max(_NORMAL * kinematics.compliance_sd, 1.0 / _STIFFEST)
    return 1.0 / compliance if visible else None


def _stiffness_estimate(kinematics: Kinematics, reach: float) -> ParameterEstimate:
    """Estimate the stiffness as the inverse of the compliance, so its interval is asymmetric."""
    half = reach * math.hypot(kinematics.compliance_sd, _STRETCH_ERROR * kinematics.compliance)
    most, least = kinematics.compliance + half, kinematics.compliance - half
    low = 1.0 / most if most > 0.0 else math.inf
    high = 1.0 / least if least > 1.0 / _STIFFEST else math.inf
    value = _stiffness(kinematics) or math.inf
    return ParameterEstimate("tendon_stiffness", "N/m", value, low, high, math.inf)


def _around(
    name: str, unit: str, value: float, half: float, nominal: float, least: float = -math.inf
) -> ParameterEstimate:
    return ParameterEstimate(name, unit, value, max(least, value - half), value + half, nominal)
