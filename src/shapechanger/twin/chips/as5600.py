"""The AS5600: the angle of a magnet.

Source: ams, AS5600 data sheet v1-06, 2018-06-20, figures 21 to 23 and "I2C Modes".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, Literal, get_args

from shapechanger.errors import UnknownName

__all__ = ["As5600", "Magnet"]

Magnet = Literal["", "gone", "weak", "strong"]
"""How the magnet is; "" for one that is well."""

_STATUS: Final = 0x0B
_RAW_ANGLE: Final = 0x0C
_ANGLE: Final = 0x0E
_DETECTED: Final = 0x20
_STATUS_OF: Final = {"": _DETECTED, "gone": 0x10, "weak": _DETECTED | 0x10, "strong": 0x28}
_COUNTS_PER_TURN: Final = 4096


class As5600:
    """Registers that are answered from the angle of a joint.

    Args:
        joint: Name of the joint that the magnet turns with.
        angle: The angle as it is measured now, rad.
        zero: Counts at the angle 0.
        direction: 1 if the counts rise with the angle, -1 if they fall.

    Attributes:
        joint: Name of the joint.
    """

    def __init__(self, joint: str, angle: Callable[[], float], zero: int, direction: int) -> None:
        self.joint = joint
        self._angle = angle
        self._zero = zero
        self._direction = direction
        self._magnet: Magnet = ""

    def set_magnet(self, how: Magnet) -> None:
        """Let something happen to the magnet; "" makes it well.

        Raises:
            UnknownName: If that cannot happen to it.
        """
        if how not in get_args(Magnet):  # It may have come from another process.
            raise UnknownName("fault of a magnet", str(how), get_args(Magnet))
        self._magnet = how

    def read(self, register: int, length: int) -> list[int]:
        """Bytes, from a register on.

        Behind the low byte of an angle comes its high byte again, where reading began there.
        """
        counts = self._counts()
        if register in (_RAW_ANGLE, _ANGLE):
            return [self._byte(register + i % 2, counts) for i in range(length)]
        return [self._byte(register + i & 0xFF, counts) for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Nothing: what can be set is not simulated, and nobody sets it."""

    def _counts(self) -> int:
        if self._magnet == "gone":
            return 0
        turned = self._direction * self._angle() / (2.0 * math.pi)
        return (self._zero + round(turned * _COUNTS_PER_TURN)) % _COUNTS_PER_TURN

    def _byte(self, register: int, counts: int) -> int:
        if register == _STATUS:
            return _STATUS_OF[self._magnet]
        if register in (_RAW_ANGLE, _ANGLE):
            return counts >> 8
        if register in (_RAW_ANGLE + 1, _ANGLE + 1):
            return counts & 0xFF
        return 0
