"""How a number from -1 to 1 becomes the tension of a tendon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog, lsq_linear, nnls

from shapechanger.bodies.finger.anatomy import (
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
)
from shapechanger.bodies.finger.parameters import FingerParameters
from shapechanger.errors import UnknownName

__all__ = [
    "DRIVES",
    "TendonDrive",
    "co_contraction",
    "drive_of",
    "spans_all_torques",
    "tensions_for_torque",
]

# N/m and N·s/m. Like the short-range stiffness of active muscle in kind; the size is chosen: a
# centimetre of stretch is worth 3 N.
_MUSCLE_STIFFNESS: Final = 300.0
_MUSCLE_DAMPING: Final = 6.0
# What a servo holds its spool with. Chosen: a centimetre off is 20 N, nearly all it has.
_SERVO_STIFFNESS: Final = 2000.0
_SERVO_DAMPING: Final = 10.0


@dataclass(frozen=True, slots=True)
class TendonDrive:
    """Tension = `offset` + `gain` u + `stiffness` l + `damping` dl/dt, kept in the tendon's range.

    u is the command, -1 to 1, and l the tendon's length beyond that of the straight finger, m.

    Attributes:
        offset: N, (7,).
        gain: N, (7,), above zero where 1 pulls most.
        stiffness: N/m.
        damping: N·s/m.
    """

    offset: NDArray[np.float64]
    gain: NDArray[np.float64]
    stiffness: float
    damping: float

    def tension(
        self,
        command: NDArray[np.float64],
        length: NDArray[np.float64],
        speed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """What a command asks of each tendon, N, (7,), before it is kept in its range."""
        pulled = self.stiffness * length + self.damping * speed
        return self.offset + self.gain * command + pulled

    def command(
        self,
        tension: NDArray[np.float64],
        length: NDArray[np.float64],
        speed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """The command, (7,), that asks for a tension, N; it may lie beyond -1 to 1."""
        pulled = self.stiffness * length + self.damping * speed
        return (tension - self.offset - pulled) / self.gain


def _tension(most: NDArray[np.float64]) -> TendonDrive:
    half = 0.5 * (most - LEAST_TENSION_N)
    return TendonDrive(LEAST_TENSION_N + half, half, 0.0, 0.0)


def _impedance(most: NDArray[np.float64]) -> TendonDrive:
    plain = _tension(most)
    rest = -MOMENT_ARMS @ JOINT_REST
    offset = plain.offset - _MUSCLE_STIFFNESS * rest
    return TendonDrive(offset, plain.gain, _MUSCLE_STIFFNESS, _MUSCLE_DAMPING)


def _length(most: NDArray[np.float64]) -> TendonDrive:
    # The longest and shortest that a tendon can be, by the corners of the joints' ranges.
    ends = -MOMENT_ARMS[:, :, None] * JOINT_RANGE[None]
    shortest, longest = ends.min(axis=2).sum(axis=1), ends.max(axis=2).sum(axis=1)
    # Winding up to below the shortest length is what gives the shortest its tension.
    shortest = shortest - most / _SERVO_STIFFNESS
    half, middle = 0.5 * (longest - shortest), 0.5 * (longest + shortest)
    offset = LEAST_TENSION_N - _SERVO_STIFFNESS * middle
    return TendonDrive(offset, _SERVO_STIFFNESS * half, _SERVO_STIFFNESS, _SERVO_DAMPING)


DRIVES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "impedance": "a muscle: the command pulls, and the longer a tendon the more it resists",
        "tension": "a tension: -1 is the least, 1 the most",
        "length": "a length: -1 is the longest, 1 the shortest, held as a servo holds it",
    }
)
"""What each mode of action commands."""

_MAKERS: Final = {"impedance": _impedance, "tension": _tension, "length": _length}


def drive_of(mode: str, parameters: FingerParameters) -> TendonDrive:
    """The drive of a mode of action.

    A drive is what the controller of a finger holds to be true: it rests on the nominal moment
    arms, whatever those of the finger are.

    Raises:
        UnknownName: If there is no such mode.
    """
    if mode not in _MAKERS:
        raise UnknownName("mode of action", str(mode), _MAKERS)
    return _MAKERS[mode](np.array(parameters.most_tension))


# N·m. A hundredth of what a fingertip of 4 g in the air weighs about its joint.
_TOLERANCE_NM: Final = 1e-6
_LITTLE: Final = 1e-3
# N. The solver wants room between its bounds, however little.
_NOTHING: Final = 1e-9


def co_contraction(arms: ArrayLike) -> NDArray[np.float64] | None:
    """The smallest tensions, each at least 1, that move no joint; None if there are none.

    With such tensions, and moment arms of full rank, every torque can be made: whatever a tendon
    would have to push with is added to all.

    Args:
        arms: Torque about each joint for a newton of each tendon, m, (tendons, joints).

    Returns:
        Shape (tendons,), in multiples of the smallest.
    """
    r = np.asarray(arms, np.float64)
    # Scaled, so that the solver's tolerance is a millionth of a typical arm.
    scale = np.abs(r).max()
    if not scale > 0.0:
        return None
    found = cast(
        "Any",
        linprog(np.ones(len(r)), A_eq=r.T / scale, b_eq=np.zeros(r.shape[1]), bounds=(1.0, None)),
    )
    return np.asarray(found.x) if found.success else None


def spans_all_torques(arms: ArrayLike) -> bool:
    """Whether pulling alone gives every torque, as a finger needs that moves at will."""
    r = np.asarray(arms, np.float64)
    return bool(np.linalg.matrix_rank(r) == r.shape[1]) and co_contraction(r) is not None


def tensions_for_torque(
    arms: ArrayLike, torque: ArrayLike, least: ArrayLike, most: ArrayLike
) -> tuple[NDArray[np.float64], bool]:
    """Tensions that give a torque with as little co-contraction as can be, or come nearest to it.

    Args:
        arms: m, (tendons, joints).
        torque: N·m, (joints,).
        least: Smallest tensions, N, a number or (tendons,).
        most: Largest tensions, N, a number or (tendons,).

    Returns:
        Tensions, N, (tendons,), and whether they give the torque to within a µN·m.
    """
    r = np.asarray(arms, np.float64)
    low, high = (np.broadcast_to(np.asarray(b, np.float64), len(r)) for b in (least, most))
    wanted = np.asarray(torque, np.float64)
    # In mN·m; what the tensions weigh beside the torque only chooses among those that give it.
    matrix = np.concatenate([r.T * 1e3, _LITTLE * np.eye(len(r))])
    goal = np.concatenate([(wanted - r.T @ low) * 1e3, np.zeros(len(r))])
    above = np.asarray(cast("Any", nnls(matrix, goal))[0])
    if (above > high - low).any():
        bounds = (np.zeros(len(r)), np.maximum(high - low, _NOTHING))
        above = np.asarray(cast("Any", lsq_linear(matrix, goal, bounds=bounds, method="bvls")).x)
    tensions = low + above
    return tensions, bool(np.abs(r.T @ tensions - wanted).max() <= _TOLERANCE_NM)
