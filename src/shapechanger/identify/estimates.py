"""Intervals of all that was fitted, and the finger that follows."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from shapechanger.embodiments.finger import JOINTS, NOMINAL, TENDONS, FingerParameters
from shapechanger.identify.dynamics import Dynamics
from shapechanger.identify.identified import Estimate
from shapechanger.identify.kinematics import ARMS, Kinematics
from shapechanger.identify.motion_fit import MOTOR_KG, with_motors
from shapechanger.identify.motors import Motors
from shapechanger.identify.standard_errors import quantile

__all__ = ["estimates_of", "parameters_of", "untold_of"]

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
) -> tuple[Estimate, ...]:
    """Each number with its interval, the arms first.

    Args:
        kinematics: What the lengths say.
        motors: What the tensions say.
        dynamics: What the motion says.
        rows: Length of the log.
        control_dt: Its period, s.
    """
    reach = quantile(rows, control_dt)
    found: list[Estimate] = []
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
        found.append(Estimate(name, units[kind], value, value / by, value * by, nominal[name]))
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


def _stiffness(kinematics: Kinematics, reach: float) -> Estimate:
    """What stretches is a sum of newtons; how stiff that is has an interval with unequal sides."""
    most = kinematics.compliance + reach * kinematics.compliance_sd
    least = kinematics.compliance - reach * kinematics.compliance_sd
    low = 1.0 / most if most > 0.0 else math.inf
    high = 1.0 / least if least > 1.0 / _STIFFEST else math.inf
    value = _plain_stiffness(kinematics)
    return Estimate(
        "tendon_stiffness", "N/m", math.inf if value is None else value, low, high, math.inf
    )


def _around(
    name: str, unit: str, value: float, half: float, nominal: float, least: float = -math.inf
) -> Estimate:
    return Estimate(name, unit, value, max(least, value - half), value + half, nominal)


def _per_joint(name: str, values: tuple[float, ...]) -> dict[str, float]:
    return {f"{name}/{joint}": value for joint, value in zip(JOINTS, values, strict=True)}
