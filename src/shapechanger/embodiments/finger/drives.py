"""How a number from -1 to 1 becomes the tension of a tendon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger.anatomy import (
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
)
from shapechanger.embodiments.finger.parameters import FingerParameters
from shapechanger.errors import UnknownName

__all__ = ["DRIVES", "Drive", "drive_of"]

# N/m and N·s/m. Like the short-range stiffness of active muscle in kind; the size is chosen: a
# centimetre of stretch is worth 3 N.
_MUSCLE_STIFFNESS: Final = 300.0
_MUSCLE_DAMPING: Final = 6.0
# What a servo holds its spool with. Chosen: a centimetre off is 20 N, nearly all it has.
_SERVO_STIFFNESS: Final = 2000.0
_SERVO_DAMPING: Final = 10.0


@dataclass(frozen=True, slots=True)
class Drive:
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


def _tension(most: NDArray[np.float64]) -> Drive:
    half = 0.5 * (most - LEAST_TENSION_N)
    return Drive(LEAST_TENSION_N + half, half, 0.0, 0.0)


def _impedance(most: NDArray[np.float64]) -> Drive:
    plain = _tension(most)
    rest = -MOMENT_ARMS @ JOINT_REST
    offset = plain.offset - _MUSCLE_STIFFNESS * rest
    return Drive(offset, plain.gain, _MUSCLE_STIFFNESS, _MUSCLE_DAMPING)


def _length(most: NDArray[np.float64]) -> Drive:
    # The longest and shortest that a tendon can be, by the corners of the joints' ranges.
    ends = -MOMENT_ARMS[:, :, None] * JOINT_RANGE[None]
    shortest, longest = ends.min(axis=2).sum(axis=1), ends.max(axis=2).sum(axis=1)
    # Winding up to below the shortest length is what gives the shortest its tension.
    shortest = shortest - most / _SERVO_STIFFNESS
    half, middle = 0.5 * (longest - shortest), 0.5 * (longest + shortest)
    offset = LEAST_TENSION_N - _SERVO_STIFFNESS * middle
    return Drive(offset, _SERVO_STIFFNESS * half, _SERVO_STIFFNESS, _SERVO_DAMPING)


DRIVES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "impedance": "a muscle: the command pulls, and the longer a tendon the more it resists",
        "tension": "a tension: -1 is the least, 1 the most",
        "length": "a length: -1 is the longest, 1 the shortest, held as a servo holds it",
    }
)
"""What each mode of action commands."""

_MAKERS: Final = {"impedance": _impedance, "tension": _tension, "length": _length}


def drive_of(mode: str, parameters: FingerParameters) -> Drive:
    """The drive of a mode of action.

    A drive is what the controller of a finger holds to be true: it rests on the nominal moment
    arms, whatever those of the finger are.

    Raises:
        UnknownName: If there is no such mode.
    """
    if mode not in _MAKERS:
        raise UnknownName("mode of action", str(mode), _MAKERS)
    return _MAKERS[mode](np.array(parameters.most_tension))
