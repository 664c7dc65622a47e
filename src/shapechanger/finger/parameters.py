"""Parameters that differ between fingers: tendons, joints, motors and sensor noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import FingerError, require_known
from shapechanger.files import converted, decoded
from shapechanger.finger.anatomy import (
    AN_1983_ARMS,
    JOINT_DAMPING,
    JOINT_FRICTION,
    JOINT_STIFFNESS,
    JOINTS,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
    TENDONS,
)

# Tolerance of a ratio that must be whole.
_WHOLE: Final = 1e-6

Arms = tuple[tuple[float, float, float, float], ...]


def as_numbers(value: Any) -> NDArray[np.float64]:
    """Return a value as an array of floats; an empty array if it cannot be converted."""
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return np.empty(0)


class CommandPath(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Path from the commands of a rig to tensions, with the names and units of the rig's profile.

    Without a path, each simulation step computes tensions from commands, lengths and speeds. Lag
    and delay are fields of `FingerParameters`, with or without a path.

    Attributes:
        control_hz: Rate at which tensions are computed from commands, lengths and speeds, and then
            held, 1/s.
        tick_hz: Rate at which the guard sends tensions to the servos, 1/s; a multiple of
            `control_hz`.
        slew_per_s: Fastest rise of a tension, in ranges from the least to the most tension per
            second; None for no limit.
        slew_down_per_s: Fastest fall of a tension, in ranges per second; None for no
            limit.
        tension_step: Resolution of the tensions, N, which are rounded down; 0 for none.

    Raises:
        FingerError: If a rate or a slew is not above zero and finite, the step is negative, or
            `tick_hz` is not a multiple of `control_hz`.
    """

    control_hz: float = 50.0
    tick_hz: float = 100.0
    slew_per_s: float | None = None
    slew_down_per_s: float | None = None
    tension_step: float = 0.0

    def __post_init__(self) -> None:
        for name, value in msgspec.structs.asdict(self).items():
            is_step = name == "tension_step" and value == 0.0
            if value is not None and not (is_step or 0.0 < value < math.inf):
                raise FingerError(f"{name} of a path must be above zero and finite, got {value}.")
        ticks = self.tick_hz / self.control_hz
        if abs(ticks - round(ticks)) > _WHOLE * ticks:
            raise FingerError(
                f"tick_hz of a path must be a multiple of control_hz, got {self.tick_hz:g} and "
                f"{self.control_hz:g}."
            )


class FingerParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Mechanics of a finger and errors of its drives and sensors; by default the nominal finger.

    Attributes:
        moment_arms: Torque about each joint per newton of each tendon, m, 7 x 4.
        most_tension: Largest tension of each tendon, N.
        least_tension: Smallest tension of each tendon, N, which keeps tendons taut.
        joint_stiffness: Passive stiffness of the joints, N·m/rad.
        joint_damping: Passive damping of the joints, N·m·s/rad.
        joint_friction: Coulomb friction of the joints, N·m.
        tendon_damping: Damping of the tendons, N·s/m.
        tendon_friction: Coulomb friction between motor and finger, N.
        tendon_stiffness: Stiffness between motor and finger, N/m; None for stiff tendons.
        backlash: Travel of a motor before its tendon pulls, m; only with a stiffness.
        motor_kg: Mass of motor and spool at the tendon, kg.
        motor_lag: Time constant between a command and its force, s.
        command_delay: Delay of the commands, s.
        joint_noise: Standard deviation of a measured angle, rad.
        tension_noise: Standard deviation of a measured tension, N.
        path: Command path of a rig, or its values keyed by name; None for a finger without a path.

    Raises:
        FingerError: If a number is not finite or has the wrong sign, an array has the wrong shape,
            a backlash has no stiffness, or `most_tension` is not above `least_tension`.
        UnknownName: If the name of a path's value is unknown.
    """

    moment_arms: Arms = tuple(map(tuple, MOMENT_ARMS.tolist()))  # pyright: ignore[reportAssignmentType]
    most_tension: tuple[float, ...] = tuple(MOST_TENSION_N.tolist())
    least_tension: float = LEAST_TENSION_N
    joint_stiffness: tuple[float, ...] = tuple(JOINT_STIFFNESS.tolist())
    joint_damping: tuple[float, ...] = tuple(JOINT_DAMPING.tolist())
    joint_friction: tuple[float, ...] = tuple(JOINT_FRICTION.tolist())
    tendon_damping: float = 2.0  # A chosen value.
    tendon_friction: float = 0.0
    tendon_stiffness: float | None = None
    backlash: float = 0.0
    motor_kg: float = 0.010  # Chosen for motors without gears; geared servos have 100 times more.
    motor_lag: float = 0.020  # A chosen value.
    command_delay: float = 0.0
    joint_noise: float = 0.0
    tension_noise: float = 0.0
    path: CommandPath | None = None

    def __post_init__(self) -> None:
        numbers = msgspec.structs.asdict(self)
        path: Any = numbers.pop("path")
        if isinstance(path, Mapping):
            names = cast("Mapping[str, Any]", path)
            require_known("parameter of a command path", CommandPath.__struct_fields__, *names)
            path = converted(path, CommandPath, FingerError, "A command path is malformed")
            msgspec.structs.force_setattr(self, "path", path)
        if self.tendon_stiffness is None:
            if self.backlash:
                raise FingerError("backlash needs a tendon_stiffness: a stiff tendon has none.")
            numbers["tendon_stiffness"] = 1.0
        sizes = {"moment_arms": (len(TENDONS), len(JOINTS)), "most_tension": (len(TENDONS),)}
        joints = ("joint_stiffness", "joint_damping", "joint_friction")
        sizes |= dict.fromkeys(joints, (len(JOINTS),))
        for name, value in numbers.items():
            given, shape = as_numbers(value), sizes.get(name, ())
            least = -math.inf if name == "moment_arms" else 0.0
            if given.shape != shape or not (np.isfinite(given) & (given >= least)).all():
                signs = "" if name == "moment_arms" else " and not below zero"
                raise FingerError(f"{name} must be of shape {shape}, finite{signs}, got {value!r}.")
            if shape:  # Tuples can be compared and encoded as JSON.
                plain: list[Any] = given.tolist()
                rows = plain if given.ndim == 1 else map(tuple, plain)
                msgspec.structs.force_setattr(self, name, tuple(rows))
        for name in ("motor_kg", "motor_lag", "tendon_stiffness"):
            if not numbers[name] > 0.0:
                raise FingerError(f"{name} must be above zero, got {numbers[name]}.")
        if not min(self.most_tension) > self.least_tension:
            raise FingerError(
                f"most_tension must be above least_tension, {self.least_tension} N, which keeps "
                "tendons taut."
            )

    @property
    def arms(self) -> NDArray[np.float64]:
        """Moment arms, m, (7, 4)."""
        return np.array(self.moment_arms)

    @property
    def gives(self) -> bool:
        """Return whether the tendons stretch."""
        return self.tendon_stiffness is not None

    @property
    def taut(self) -> float:
        """Travel of a motor from a slack tendon to its least tension, m; 0 for stiff tendons."""
        if self.tendon_stiffness is None:
            return 0.0
        return self.backlash + self.least_tension / self.tendon_stiffness

    def replace(self, **changes: Any) -> FingerParameters:
        """A copy with some parameters replaced.

        Raises:
            FingerError: If the changed parameters are invalid.
        """
        return msgspec.structs.replace(self, **changes)

    def to_json(self) -> str:
        """Encode as JSON."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> FingerParameters:
        """Decode the result of `to_json`.

        Raises:
            FingerError: If the text is not a valid finger.
        """
        return decoded(text, cls, FingerError, "Invalid finger parameters")


NOMINAL: Final = FingerParameters()
"""Finger with the values of `anatomy`, stiff tendons without friction, and no delay or noise."""

PARAMETER_SETS: Final[Mapping[str, FingerParameters]] = MappingProxyType(
    {"an-1983": NOMINAL.replace(moment_arms=AN_1983_ARMS)}
)
"""Other sets of parameters, keyed by name. Tendons cannot balance the joints with "an-1983"; see
`anatomy.AN_1983_ARMS`."""


def named_set(name: str) -> FingerParameters:
    """Return a set of parameters; raise UnknownName for an unknown name."""
    require_known("set of finger parameters", PARAMETER_SETS, name)
    return PARAMETER_SETS[name]
