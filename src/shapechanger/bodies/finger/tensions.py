"""Tendon tensions: the drives that commands act through, and the tensions that hold a torque."""

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

# N/m and N·s/m, like the short-range stiffness of active muscle. The size is chosen: 3 N per
# centimetre of stretch.
_MUSCLE_STIFFNESS: Final = 300.0
_MUSCLE_DAMPING: Final = 6.0
# Gains of a servo that holds its spool. Chosen: 20 N, nearly its largest force, per centimetre.
_SERVO_STIFFNESS: Final = 2000.0
_SERVO_DAMPING: Final = 10.0


@dataclass(frozen=True, slots=True)
class TendonDrive:
    """Affine map from commands to tensions, which are clipped to the tendons' range.

    tension = `offset` + `gain` u + `stiffness` l + `damping` dl/dt, with the command u, -1 to 1,
    and the tendon's length l beyond that of the straight finger, m.

    Attributes:
        offset: Tension at rest, N, (7,).
        gain: Tension per command, N, (7,), > 0.
        stiffness: Stiffness, N/m.
        damping: Damping, N·s/m.
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
        """Tensions of a command, N, (7,), before clipping.

        Args:
            command: Command, -1 to 1, (7,).
            length: Lengths, m, (7,).
            speed: Rates of the lengths, m/s, (7,).
        """
        pulled = self.stiffness * length + self.damping * speed
        return self.offset + self.gain * command + pulled

    def command(
        self,
        tension: NDArray[np.float64],
        length: NDArray[np.float64],
        speed: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Command that gives a tension, (7,); it may lie outside -1 to 1.

        Args:
            tension: Tensions, N, (7,).
            length: Lengths, m, (7,).
            speed: Rates of the lengths, m/s, (7,).
        """
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
    # The largest and smallest length of each tendon, from the ends of the joints' ranges.
    ends = -MOMENT_ARMS[:, :, None] * JOINT_RANGE[None]
    shortest, longest = ends.min(axis=2).sum(axis=1), ends.max(axis=2).sum(axis=1)
    # The servo winds up below the shortest length, to have its full tension there.
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
"""Modes of action, and the meaning of a command in each."""

_MAKERS: Final = {"impedance": _impedance, "tension": _tension, "length": _length}


def drive_of(mode: str, parameters: FingerParameters) -> TendonDrive:
    """Make the drive of a mode of action.

    A drive is part of the controller, so it uses the nominal moment arms, whatever those of the
    finger are.

    Args:
        mode: One of `DRIVES`.
        parameters: Finger with the range of tensions.

    Raises:
        UnknownName: If the mode is unknown.
    """
    if mode not in _MAKERS:
        raise UnknownName("mode of action", str(mode), _MAKERS)
    return _MAKERS[mode](np.array(parameters.most_tension))


# Tolerance of a torque, N·m: a hundredth of that of a fingertip of 4 g about its joint.
_TOLERANCE_NM: Final = 1e-6
_LITTLE: Final = 1e-3
# Smallest distance between bounds that the solver accepts, N.
_NOTHING: Final = 1e-9


def co_contraction(arms: ArrayLike) -> NDArray[np.float64] | None:
    """Smallest tensions, each at least 1, without torque about any joint; None if there are none.

    With such tensions and moment arms of full rank, every torque is possible: a negative tension is
    made positive by adding a multiple of them.

    Args:
        arms: Torque about each joint per newton of each tendon, m, (tendons, joints).

    Returns:
        Tensions in multiples of the smallest, (tendons,).
    """
    r = np.asarray(arms, np.float64)
    # Scaled to make the solver's tolerance a millionth of a typical arm.
    scale = np.abs(r).max()
    if not scale > 0.0:
        return None
    found = cast(
        "Any",
        linprog(np.ones(len(r)), A_eq=r.T / scale, b_eq=np.zeros(r.shape[1]), bounds=(1.0, None)),
    )
    return np.asarray(found.x) if found.success else None


def spans_all_torques(arms: ArrayLike) -> bool:
    """Return whether non-negative tensions can give every torque.

    Args:
        arms: Moment arms, m, (tendons, joints).
    """
    r = np.asarray(arms, np.float64)
    return bool(np.linalg.matrix_rank(r) == r.shape[1]) and co_contraction(r) is not None


def tensions_for_torque(
    arms: ArrayLike, torque: ArrayLike, least: ArrayLike, most: ArrayLike
) -> tuple[NDArray[np.float64], bool]:
    """Tensions that give a torque, or the nearest possible one, with the least co-contraction.

    Args:
        arms: Moment arms, m, (tendons, joints).
        torque: Torque, N·m, (joints,).
        least: Smallest tensions, N, a number or (tendons,).
        most: Largest tensions, N, a number or (tendons,).

    Returns:
        Tensions, N, (tendons,), and whether they give the torque to within 1 µN·m.
    """
    r = np.asarray(arms, np.float64)
    low, high = (np.broadcast_to(np.asarray(b, np.float64), len(r)) for b in (least, most))
    wanted = np.asarray(torque, np.float64)
    # In mN·m; the small weight of the tensions only chooses among those that give the torque.
    matrix = np.concatenate([r.T * 1e3, _LITTLE * np.eye(len(r))])
    goal = np.concatenate([(wanted - r.T @ low) * 1e3, np.zeros(len(r))])
    above = np.asarray(cast("Any", nnls(matrix, goal))[0])
    if (above > high - low).any():
        bounds = (np.zeros(len(r)), np.maximum(high - low, _NOTHING))
        above = np.asarray(cast("Any", lsq_linear(matrix, goal, bounds=bounds, method="bvls")).x)
    tensions = low + above
    return tensions, bool(np.abs(r.T @ tensions - wanted).max() <= _TOLERANCE_NM)
