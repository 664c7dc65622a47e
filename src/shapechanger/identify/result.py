"""A part of a log once more, in simulation: the same commands, the same beginning."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.bodies.finger import (
    JOINTS,
    NOMINAL,
    TENDONS,
    FingerParameters,
    build_finger,
    drive_of,
)
from shapechanger.identify.kinematics import ARMS, Kinematics, fit_kinematics, quantile
from shapechanger.identify.log import FingerLog, require_informative
from shapechanger.identify.motion import (
    MOTOR_KG,
    Dynamics,
    Window,
    fit_dynamics,
    windows,
    with_motors,
)
from shapechanger.identify.motors import CommandSignal, Motors, fit_motors

__all__ = [
    "HeldOut",
    "IdentifiedFinger",
    "ParameterEstimate",
    "estimates_of",
    "identify",
    "parameters_of",
    "replay",
    "untold_of",
]


@dataclass(frozen=True, slots=True)
class HeldOut:
    """What the identified finger and the nominal one make of commands that were not fitted.

    Attributes:
        t: s, (n,), from the beginning of the log.
        measured: Angles, rad, (n, 4).
        identified: Of the identified finger, rad, (n, 4).
        nominal: Of the nominal finger, rad, (n, 4).
    """

    t: NDArray[np.float64]
    measured: NDArray[np.float64]
    identified: NDArray[np.float64]
    nominal: NDArray[np.float64]

    @property
    def off(self) -> tuple[float, float]:
        """Root mean square of what the identified and the nominal finger are off by, rad."""
        found, nominal = (
            float(np.sqrt(np.mean((simulated - self.measured) ** 2)))
            for simulated in (self.identified, self.nominal)
        )
        return found, nominal


def replay(log: FingerLog, parameters: FingerParameters, window: Window) -> NDArray[np.float64]:
    """Angles of a simulated finger, rad, (m + 1, 4), the first of which are the window's.

    Args:
        log: Whose commands it gets.
        parameters: Of the finger.
        window: Where it begins, and for how long it goes on.
    """
    on_time = parameters.replace(command_delay=0.0)  # The commands are late already.
    model = build_finger(on_time, drive_of(log.actions, NOMINAL)).compile()
    skip = math.ceil(log.control_dt / model.opt.timestep - 1e-6)
    step = model.opt.timestep = log.control_dt / skip
    data = mujoco.MjData(model)
    n, arms = len(JOINTS), parameters.arms
    data.qpos[:n], data.qvel[:n] = window.angles[0], window.velocities
    if parameters.tendon_stiffness is not None:
        row = int(np.searchsorted(log.t, window.start - 0.5 * log.control_dt))
        stretch = parameters.backlash + log.tensions[row] / parameters.tendon_stiffness
        data.qpos[n:] = arms @ window.angles[0] + stretch
        data.qvel[n:] = arms @ window.velocities
    commands, delay = CommandSignal(log), parameters.command_delay
    before = math.ceil((window.start - float(log.t[0])) / step)
    data.act[:] = np.clip(
        commands.followed(window.start - before * step, step, before, delay, parameters.motor_lag)[
            -1
        ],
        -1.0,
        1.0,
    )
    periods = len(window.angles) - 1
    late = commands.late(window.start, step, skip * periods, delay)
    angles = [window.angles[0]]
    for period in range(periods):
        for command in late[period * skip : (period + 1) * skip]:
            data.ctrl[:] = command
            mujoco.mj_step(model, data)
        angles.append(data.qpos[:n].copy())
    return np.array(angles)


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One number of a finger.

    Attributes:
        name: Which, such as `moment_arms/FDP/MCP_flexion`.
        unit: Its unit.
        value: What it probably is.
        low: Lower end of its 95 % interval.
        high: Upper end.
        nominal: What it is in the nominal finger; infinite for the stiffness of tendons that do not
            give.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    nominal: float

    @property
    def differs(self) -> bool:
        """Whether the interval leaves out the nominal value."""
        return not self.low <= self.nominal <= self.high


@dataclass(frozen=True, slots=True)
class IdentifiedFinger:
    """A finger as its log shows it.

    Attributes:
        parameters: The finger, to build it or to hand it to an env as `parameters`.
        estimates: What was told, number by number, with intervals; the arms first.
        untold: What this log cannot tell, each with the reason and what is taken in its place.
        held_out: What the identified finger makes of commands that it was not fitted to.
        source: What the log says that it is of.
        seconds: Length of the log, s.
    """

    parameters: FingerParameters
    estimates: tuple[ParameterEstimate, ...]
    untold: tuple[tuple[str, str], ...]
    held_out: HeldOut
    source: str
    seconds: float

    @property
    def arm_intervals(self) -> NDArray[np.float64]:
        """95 % intervals of the moment arms, m, (7, 4, 2); both 0 where there is none."""
        ends = np.zeros((len(TENDONS), len(JOINTS), 2))
        for estimate in self.arms:
            _, tendon, joint = estimate.name.split("/")
            ends[TENDONS.index(tendon), JOINTS.index(joint)] = estimate.low, estimate.high
        return ends

    @property
    def arms(self) -> tuple[ParameterEstimate, ...]:
        """The estimates of moment arms."""
        return tuple(e for e in self.estimates if e.name.startswith("moment_arms/"))


_NORMAL: Final = 1.96
# Standard deviations, of logarithms, of what the fit of the motion is off by because no finger is
# its model: measured over twenty fingers of the gap "real-like" (`benchmarks/finger_identify.py`),
# for the joint that came out worst. Their tendons stretch; those of the fit do not.
_MODEL_ERROR: Final = {"joint_stiffness": 0.15, "joint_damping": 0.20, "tendon_friction": 1.15}
# s. When in its period a sensor is read is not known better, nor is a motor quite of first order.
# In simulation, tensions are those of one or two steps before.
_DELAY_ERROR_S: Final = 0.002
_LAG_ERROR_S: Final = 0.0005
# N/m. What is stiffer would stretch by less than 0.1 mm under all the tension there is.
_STIFFEST: Final = 2.5e5
# rad. Less noise than this is none.
_NO_NOISE: Final = 1e-5


def estimates_of(
    kinematics: Kinematics, motors: Motors, dynamics: Dynamics, rows: int, control_dt: float
) -> tuple[ParameterEstimate, ...]:
    """Each number with its interval, the arms first.

    Args:
        kinematics: What the lengths say.
        motors: What the tensions say.
        dynamics: What the motion says.
        rows: Length of the log.
        control_dt: Its period, s.
    """
    reach = quantile(rows, control_dt)
    found: list[ParameterEstimate] = []
    for i, j in np.argwhere(ARMS).tolist():
        value, sd = float(kinematics.arms[i, j]), float(kinematics.arms_sd[i, j])
        name = f"moment_arms/{TENDONS[i]}/{JOINTS[j]}"
        found.append(_around(name, "m", value, reach * sd, NOMINAL.moment_arms[i][j]))
    found.append(_stiffness(kinematics, reach))
    nominal = {
        **_per_joint("joint_stiffness", NOMINAL.joint_stiffness),
        **_per_joint("joint_damping", NOMINAL.joint_damping),
        "tendon_friction": NOMINAL.tendon_friction,
    }
    units = {
        "joint_stiffness": "N·m/rad",
        "joint_damping": "N·m·s/rad",
        "tendon_friction": "N",
    }
    for name, value in dynamics.values.items():
        kind = name.split("/")[0]
        by = math.exp(_NORMAL * math.hypot(dynamics.sd[name], _MODEL_ERROR[kind]))
        found.append(
            ParameterEstimate(name, units[kind], value, value / by, value * by, nominal[name])
        )
    lag = reach * math.hypot(motors.sd[0], _LAG_ERROR_S)
    delay = reach * math.hypot(motors.sd[1], _DELAY_ERROR_S)
    found.append(_around("motor_lag", "s", motors.lag, lag, NOMINAL.motor_lag, least=0.0))
    found.append(
        _around("command_delay", "s", motors.delay, delay, NOMINAL.command_delay, least=0.0)
    )
    if motors.saturates:
        found.append(_around("strength", "1", motors.strength, reach * motors.sd[2], 1.0))
    return tuple(found)


def parameters_of(
    kinematics: Kinematics,
    motors: Motors,
    dynamics: Dynamics,
    known: FingerParameters | None = None,
) -> FingerParameters:
    """The finger that was found; what could not be told is as it is known, or nominal."""
    stiffness = _plain_stiffness(kinematics)
    noise = float(np.sqrt(np.mean(kinematics.joint_noise**2)))
    values = dynamics.values
    arms: list[list[float]] = kinematics.arms.tolist()
    return with_motors(motors, known).replace(
        moment_arms=tuple(tuple(row) for row in arms),
        joint_stiffness=tuple(values[f"joint_stiffness/{joint}"] for joint in JOINTS),
        joint_damping=tuple(values[f"joint_damping/{joint}"] for joint in JOINTS),
        tendon_friction=values["tendon_friction"],
        tendon_stiffness=stiffness,
        command_delay=motors.delay,
        joint_noise=noise if noise > _NO_NOISE else 0.0,
        tension_noise=motors.tension_noise,
    )


def untold_of(motors: Motors, known: FingerParameters | None = None) -> tuple[tuple[str, str], ...]:
    """What a log cannot tell, each with why and what is taken instead."""
    kg = MOTOR_KG if known is None else known.motor_kg
    damping = "taken as nominal" if known is None else f"taken as {known.tendon_damping:g} N·s/m"
    untold = [
        ("joint_friction", "Slows the joints as friction in the tendons does; taken as nominal."),
        ("tendon_damping", f"Slows the tendons as friction does; {damping}."),
        ("motor_kg", f"Is hidden behind stretch and damping; taken as {1e3 * kg:g} g."),
        ("backlash", "Looks as if a motor counted from another zero; taken as none."),
    ]
    if known is None and not motors.saturates:
        untold.append(
            ("most_tension", "No tendon was asked for more than it could; taken as nominal.")
        )
    return tuple(untold)


def _plain_stiffness(kinematics: Kinematics) -> float | None:
    """N/m; None where no stretch is to be seen."""
    told = kinematics.compliance > _NORMAL * kinematics.compliance_sd
    return 1.0 / kinematics.compliance if told and kinematics.compliance > 1 / _STIFFEST else None


def _stiffness(kinematics: Kinematics, reach: float) -> ParameterEstimate:
    """What stretches is a sum of newtons; how stiff that is has an interval with unequal sides."""
    most = kinematics.compliance + reach * kinematics.compliance_sd
    least = kinematics.compliance - reach * kinematics.compliance_sd
    low = 1.0 / most if most > 0.0 else math.inf
    high = 1.0 / least if least > 1.0 / _STIFFEST else math.inf
    value = _plain_stiffness(kinematics)
    return ParameterEstimate(
        "tendon_stiffness", "N/m", math.inf if value is None else value, low, high, math.inf
    )


def _around(
    name: str, unit: str, value: float, half: float, nominal: float, least: float = -math.inf
) -> ParameterEstimate:
    return ParameterEstimate(name, unit, value, max(least, value - half), value + half, nominal)


def _per_joint(name: str, values: tuple[float, ...]) -> dict[str, float]:
    return {f"{name}/{joint}": value for joint, value in zip(JOINTS, values, strict=True)}


# Of a log, what its motion is fitted to; the rest is for the check.
_FITTED: Final = 0.8


def identify(
    log: FingerLog,
    said: Callable[[str], None] = lambda _: None,
    known: FingerParameters | None = None,
) -> IdentifiedFinger:
    """Find out what a finger is like.

    Arms and stretch come from lengths, angles and tensions of the whole log; motors from commands
    and tensions of the whole log; joints and friction from the motion in its first four fifths, by
    `mujoco.sysid`. The last fifth is simulated with what was found.

    Args:
        log: In which each joint moves through much of its range, under tensions that change; ten
            seconds are good.
        said: Is told what is being done.
        known: A finger whose motors are those of this one, which a log hardly tells of motors with
            gears: what they weigh, how they drag, and how strong they are.

    Raises:
        FingerError: If the log is too short, or a joint hardly moves in it or only along with
            others.
        MissingExtra: If `mujoco.sysid` is not there.
    """
    require_informative(log)
    said("arms and stretch, from lengths")
    kinematics = fit_kinematics(log)
    said("motors, from tensions")
    motors = fit_motors(log, known or NOMINAL)
    said("joints and friction, from motion")
    last = round(_FITTED * len(log))
    dynamics = fit_dynamics(log, kinematics, motors, last, known=known)
    parameters = parameters_of(kinematics, motors, dynamics, known)
    said("the last fifth, simulated")
    rows = len(log) - 1 - last
    dt = log.control_dt
    window = windows(log, kinematics, motors, len(log) + 1, rows * dt, last * dt)[0]
    return IdentifiedFinger(
        parameters=parameters,
        estimates=estimates_of(kinematics, motors, dynamics, len(log), dt),
        untold=untold_of(motors, known),
        held_out=HeldOut(
            t=log.t[last : last + rows + 1] - log.t[0],
            measured=log.angles[last : last + rows + 1],
            identified=replay(log, parameters, window),
            nominal=replay(log, NOMINAL, window),
        ),
        source=log.source,
        seconds=log.seconds,
    )
