"""Tendon tensions: drives convert commands to tensions, a solver torques to tensions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog, lsq_linear, nnls

from shapechanger.errors import require_known
from shapechanger.finger.anatomy import (
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    TENDONS,
)
from shapechanger.finger.parameters import FingerParameters

# Stiffness and damping of an active muscle divided by its tension, 1/m and s/m. Both grow with
# tension, as Cui, Perreault, Maas & Sandercock 2008 measured (J. Biomechanics 41:1945, PMC2488157).
# The stiffness is for a slow stretch; the first millimetres are ten times as stiff. At full
# flexion, 18 mm shorter than at rest, a flexor with fibres of 65 mm keeps about half of its force,
# as on the ascending limb of the force-length curve. The damping is chosen.
_MUSCLE_STIFFNESS: Final = 25.0
_MUSCLE_DAMPING: Final = 1.0
# Lower limit of the strength of a shortened muscle when a command is computed.
_WEAKEST: Final = 0.05
# Chosen gains of a servo that holds its spool: 20 N per centimetre, nearly its largest force.
_SERVO_STIFFNESS: Final = 2000.0
_SERVO_DAMPING: Final = 10.0


@dataclass(frozen=True, slots=True)
class TendonDrive:
    """Map from commands to tensions.

    tension = (`offset` + `gain` u) (1 + `muscle_stiffness` (l - `rest`) + `muscle_damping` dl/dt)
    + `stiffness` l + `damping` dl/dt, with the command u, -1 to 1, and the tendon's length l, m,
    relative to the straight finger. The arrays may be tensors.
    """

    offset: NDArray[np.float64]  # Tension of the command 0 at the length `rest`, N, (7,).
    gain: NDArray[np.float64]  # Tension per command, N, (7,), > 0.
    stiffness: float = 0.0  # N/m.
    damping: float = 0.0  # N·s/m.
    muscle_stiffness: float = 0.0  # Stiffness divided by tension, 1/m.
    muscle_damping: float = 0.0  # Damping divided by tension, s/m.
    # Length of each tendon at which a muscle has the tension of its command, m, (7,).
    rest: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(TENDONS)))

    def tension(
        self, command: NDArray[np.float64], length: NDArray[np.float64], speed: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Tensions, N, of a command, -1 to 1, at lengths, m, and their rates, m/s, (7,) each.

        Tensions are not clipped to the range of the tendons.
        """
        pulled = self.stiffness * length + self.damping * speed
        return (self.offset + self.gain * command) * self._strength(length, speed) + pulled

    def command(
        self, tension: NDArray[np.float64], length: NDArray[np.float64], speed: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Command that gives tensions, N, at lengths, m, and their rates, m/s, (7,) each.

        The command may be outside of -1 to 1.
        """
        pulled = self.stiffness * length + self.damping * speed
        # A very short muscle has no strength, so a minimum is assumed.
        strength = self._strength(length, speed).clip(_WEAKEST)
        return ((tension - pulled) / strength - self.offset) / self.gain

    def _strength(
        self, length: NDArray[np.float64], speed: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Tension of a muscle divided by the tension of its command at rest, (7,)."""
        stretch = length - self.rest
        return 1.0 + self.muscle_stiffness * stretch + self.muscle_damping * speed


DRIVES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "impedance": "a muscle: the command sets its tension, which grows with its length",
        "tension": "a tension: -1 is the least, 1 the most",
        "length": "a length: -1 is the longest, 1 the shortest, held as by a servo",
    }
)
"""Modes of action, and the meaning of a command in each."""


def drive_of(mode: str, parameters: FingerParameters) -> TendonDrive:
    """Return the drive of a mode of action, from `LEAST_TENSION_N` to a finger's largest tensions.

    A drive is part of the controller, so it assumes the nominal moment arms.
    """
    require_known("mode of action", DRIVES, mode)
    most = np.array(parameters.most_tension)
    if mode == "length":
        # The largest and smallest length of each tendon, from the ends of the joints' ranges.
        ends = -MOMENT_ARMS[:, :, None] * JOINT_RANGE[None]
        longest = ends.max(axis=2).sum(axis=1)
        # The servo aims below the shortest length, so that its tension there is the largest.
        shortest = ends.min(axis=2).sum(axis=1) - most / _SERVO_STIFFNESS
        half, middle = 0.5 * (longest - shortest), 0.5 * (longest + shortest)
        offset = LEAST_TENSION_N - _SERVO_STIFFNESS * middle
        return TendonDrive(offset, _SERVO_STIFFNESS * half, _SERVO_STIFFNESS, _SERVO_DAMPING)
    half = 0.5 * (most - LEAST_TENSION_N)
    muscle = (_MUSCLE_STIFFNESS, _MUSCLE_DAMPING) if mode == "impedance" else (0.0, 0.0)
    rest = -MOMENT_ARMS @ JOINT_REST if mode == "impedance" else np.zeros(len(TENDONS))
    return TendonDrive(LEAST_TENSION_N + half, half, 0.0, 0.0, *muscle, rest)


# Tolerance of a torque, N·m; the weight of a fingertip, 3 g, turns its joint with 300 times more.
_TOLERANCE_NM: Final = 1e-6
_LITTLE: Final = 1e-3
# Smallest distance between bounds that the solver accepts, N.
_NOTHING: Final = 1e-9


def co_contraction(arms: ArrayLike) -> NDArray[np.float64] | None:
    """Smallest tensions, each at least 1, without torque about any joint; None if impossible.

    Moment arms are in m, (tendons, joints); tensions have any unit. If the tensions exist and the
    moment arms have full rank, every torque is possible: adding a multiple of the tensions makes
    all tensions of a solution positive.
    """
    r = np.asarray(arms, np.float64)
    # The solver's tolerance is absolute, so the largest arm is scaled to 1.
    scale = np.abs(r).max()
    if not scale > 0.0:
        return None
    found = cast(
        "Any",
        linprog(np.ones(len(r)), A_eq=r.T / scale, b_eq=np.zeros(r.shape[1]), bounds=(1.0, None)),
    )
    return np.asarray(found.x) if found.success else None


def spans_all_torques(arms: ArrayLike) -> bool:
    """Return whether non-negative tensions with moment arms, m, can give every torque."""
    r = np.asarray(arms, np.float64)
    return bool(np.linalg.matrix_rank(r) == r.shape[1]) and co_contraction(r) is not None


def tensions_for_torque(
    arms: ArrayLike, torque: ArrayLike, least: ArrayLike, most: ArrayLike
) -> tuple[NDArray[np.float64], bool]:
    """Tensions that give a torque, or the nearest possible one, with the least co-contraction.

    Moment arms are in m, (tendons, joints), the torque in N·m, (joints,), and the smallest and
    largest tensions in N, numbers or (tendons,). The second result is whether the tensions, N,
    give the torque to within 1 µN·m.
    """
    r = np.asarray(arms, np.float64)
    low, high = (np.broadcast_to(np.asarray(b, np.float64), len(r)) for b in (least, most))
    wanted = np.asarray(torque, np.float64)
    # Torques are in mN·m. The small weight of the tensions selects among equivalent solutions.
    matrix = np.concatenate([r.T * 1e3, _LITTLE * np.eye(len(r))])
    goal = np.concatenate([(wanted - r.T @ low) * 1e3, np.zeros(len(r))])
    above = np.asarray(cast("Any", nnls(matrix, goal))[0])
    if (above > high - low).any():
        bounds = (np.zeros(len(r)), np.maximum(high - low, _NOTHING))
        above = np.asarray(cast("Any", lsq_linear(matrix, goal, bounds=bounds, method="bvls")).x)
    tensions = low + above
    return tensions, bool(np.abs(r.T @ tensions - wanted).max() <= _TOLERANCE_NM)
