"""Distributions of real fingers around the nominal one (the reality gap)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import FingerError, require_known
from shapechanger.files import converted
from shapechanger.finger.parameters import NOMINAL, CommandPath, FingerParameters
from shapechanger.finger.tensions import spans_all_torques

# Largest number of draws. Fingers whose tendons cannot balance the joints are rejected: one in
# two hundred with arm errors of 25 %.
_TRIES: Final = 1000

# Parameters that are drawn log-uniformly.
_LOGARITHMIC: Final = frozenset({"joint_factor", "tendon_stiffness", "motor_kg"})

# Relative errors of identified arms and stretch, and of identified stiffness, damping and friction
# of joints; measured by `benchmarks.finger_identify`.
_FOUND: Final = 0.03
_JOINTS_FOUND: Final = 0.2
# Error of an identified delay, s: chosen so that few errors are larger (`benchmarks.finger_path`).
_DELAY_FOUND_S: Final = 0.005

Range = tuple[float, float]


class Gap(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Ranges that the parameters of a finger are drawn from, uniformly unless noted otherwise.

    Attributes:
        arm_error: Largest relative error of each moment arm, in either direction.
        joint_factor: Factor of the stiffness, damping and friction of each joint, drawn
            log-uniformly.
        strength: Factor of the largest tensions.
        tendon_friction: Friction of each tendon, N.
        tendon_stiffness: Stiffness of each tendon, N/m, drawn log-uniformly.
        backlash: Backlash of each tendon, m.
        motor_kg: Mass of each motor at its tendon, kg, drawn log-uniformly.
        motor_lag: Time constant of the motors, s.
        command_delay: Delay of commands, s.
        joint_noise: Standard deviation of measured angles, rad.
        tension_noise: Standard deviation of measured tensions, N.
        tendon_damping: Damping of each tendon, N·s/m.
        least_tension: Smallest tension, N.
        around: Finger that errors and factors refer to; all drawn fingers have its command path.

    Raises:
        FingerError: If a range is empty, not finite or negative, or begins at 0 although it is
            drawn log-uniformly, or if `arm_error` is not in [0, 1).
    """

    arm_error: float
    joint_factor: Range
    strength: Range
    tendon_friction: Range
    tendon_stiffness: Range
    backlash: Range
    motor_kg: Range
    motor_lag: Range
    command_delay: Range
    joint_noise: Range
    tension_noise: Range
    tendon_damping: Range = (NOMINAL.tendon_damping, NOMINAL.tendon_damping)
    least_tension: Range = (NOMINAL.least_tension, NOMINAL.least_tension)
    around: FingerParameters = NOMINAL

    def __post_init__(self) -> None:
        if not 0.0 <= self.arm_error < 1.0:
            raise FingerError(f"arm_error must be 0 to below 1, got {self.arm_error}.")
        for name in self.__struct_fields__[1:-1]:
            value = getattr(self, name)
            if not 0.0 <= value[0] <= value[1] < math.inf:
                raise FingerError(f"{name}: a range must be 0 <= low <= high < inf, got {value}.")
            if name in _LOGARITHMIC and not value[0] > 0.0:
                raise FingerError(f"{name}: the range {value} must begin above zero.")

    def draw(self, rng: np.random.Generator) -> FingerParameters:
        """Draw a finger whose tendons can balance its joints."""
        values: dict[str, Any] = {"moment_arms": self._arms(rng)}

        def drawn(name: str) -> float:
            low, high = cast("Range", getattr(self, name))
            if name in _LOGARITHMIC:
                return math.exp(rng.uniform(math.log(low), math.log(high)))
            return rng.uniform(low, high)

        strength = drawn("strength")
        values["most_tension"] = tuple(strength * most for most in self.around.most_tension)
        for name in ("joint_stiffness", "joint_damping", "joint_friction"):
            middle = getattr(self.around, name)
            values[name] = tuple(value * drawn("joint_factor") for value in middle)
        for name in self.__struct_fields__[3:-1]:
            values[name] = drawn(name)
        return FingerParameters(**values, path=self.around.path)

    def _arms(self, rng: np.random.Generator) -> NDArray[np.float64]:
        middle = self.around.arms
        for _ in range(_TRIES):
            arms = middle * (1.0 + rng.uniform(-self.arm_error, self.arm_error, middle.shape))
            if spans_all_torques(arms):
                return arms
        raise FingerError(
            f"With moment arms off by {self.arm_error:.0%}, tendons can hardly ever balance the "
            "joints: make arm_error smaller."
        )


_DEGREE: Final = math.radians(1.0)

# Rates, slew and tensions of the rig profile in this package; a test compares them.
_RIG: Final = NOMINAL.replace(
    path=CommandPath(control_hz=50.0, tick_hz=100.0, slew_per_s=20.0, slew_down_per_s=20.0)
)
_RIG_MOST_N: Final = (15.0, 15.0, 7.0, 15.0, 6.4, 15.0, 15.0)  # In the order of `TENDONS`.
_RIG_LEAST_N: Final = 1.0

# A finger on the shipped rig: seven XL330-M077 servos with spools of 1 cm radius.
_REAL_LIKE: Final = Gap(
    # A chosen value; the two sets of moment arms in `anatomy` differ by 40 % in the median.
    arm_error=0.2,
    # The stiffness of four healthy people's knuckles was 0.8 to 1.2 of the nominal one
    # (PMC7775510, table 2). The range is chosen around these values.
    joint_factor=(0.7, 1.4),
    # The rig pulls with 1 to 15 N; the nominal finger with up to 25 N.
    strength=(0.55, 0.65),
    least_tension=(1.0, 1.0),
    # At the tendon, a rotor has 1.4 kg, 4 N·s/m and 0.5 N of friction: the motor's numbers
    # (`shapechanger/robot/drivers/servos/servos.toml`) converted by the spool's radius.
    motor_kg=(1.2, 1.6),
    tendon_damping=(3.0, 5.0),
    tendon_friction=(0.3, 0.8),
    # The current takes 1 ms to settle. A command waits for the guard's tick: up to 10 ms on a
    # rig, and exactly 10 ms on a twin.
    motor_lag=(0.001, 0.005),
    command_delay=(0.005, 0.015),
    # Chosen for cords with a length of some decimetres: 5 to 20 N/mm.
    tendon_stiffness=(5e3, 20e3),
    backlash=(0.0, 0.5e-3),
    # An AS5600 has 0.09 degrees per count; a magnet off its axis errs by up to a degree.
    joint_noise=(0.1 * _DEGREE, _DEGREE),
    tension_noise=(0.1, 0.5),
    around=_RIG,
)

GAPS: Final[Mapping[str, Gap]] = MappingProxyType(
    {
        "real-like": _REAL_LIKE,
        # Ranges for training robust policies, most of them chosen wider than in "real-like".
        "wide": msgspec.structs.replace(
            _REAL_LIKE,
            arm_error=0.25,
            joint_factor=(0.6, 1.6),
            strength=(0.55, 0.75),
            least_tension=(0.5, 1.5),
            motor_kg=(1.0, 2.0),
            tendon_damping=(3.0, 10.0),
            tendon_friction=(0.2, 0.9),
            tendon_stiffness=(5e3, 30e3),
            joint_noise=(0.0, 1.5 * _DEGREE),
            tension_noise=(0.0, 0.6),
        ),
    }
)
"""Gaps, keyed by name."""


def with_gears(parameters: FingerParameters) -> FingerParameters:
    """Return the same finger on geared servos.

    Mass, damping, friction and lag of the motors are in the middle of their ranges in "real-like".
    """
    rig = GAPS["real-like"]
    return parameters.replace(
        motor_kg=math.sqrt(rig.motor_kg[0] * rig.motor_kg[1]),
        tendon_damping=sum(rig.tendon_damping) / 2,
        tendon_friction=sum(rig.tendon_friction) / 2,
        motor_lag=sum(rig.motor_lag) / 2,
    )


def shipped_rig() -> FingerParameters:
    """Return the nominal finger on the shipped rig, with its motors, tensions and command path."""
    return with_gears(_RIG.replace(most_tension=_RIG_MOST_N, least_tension=_RIG_LEAST_N))


def geared_around(found: FingerParameters) -> Gap:
    """Return the gap of a finger on geared servos after identification.

    Arms, joints, stretch and delay are drawn within the errors of the identification. A log hardly
    reveals mass, damping, friction, lag and backlash, so they keep their ranges in "wide".
    """
    late = found.command_delay + _DELAY_FOUND_S
    stiffness = found.tendon_stiffness or GAPS["wide"].tendon_stiffness[1]
    return msgspec.structs.replace(
        GAPS["wide"],
        around=found,
        arm_error=_FOUND,
        joint_factor=(1.0 - _JOINTS_FOUND, 1.0 + _JOINTS_FOUND),
        strength=(1.0, 1.0),
        command_delay=(max(0.0, found.command_delay - _DELAY_FOUND_S), late),
        tendon_stiffness=((1.0 - _FOUND) * stiffness, (1.0 + _FOUND) * stiffness),
        joint_noise=(found.joint_noise, found.joint_noise),
        tension_noise=(found.tension_noise, found.tension_noise),
        least_tension=(found.least_tension, found.least_tension),
    )


def resolve_gap(value: str | Gap | Mapping[str, object]) -> Gap:
    """Return the gap for a `Gap`, a name or a mapping of ranges."""
    if isinstance(value, Gap):
        return value
    if isinstance(value, str):
        require_known("gap", GAPS, value)
        return GAPS[value]
    return converted(value, Gap, FingerError, "The ranges of a gap are malformed")
