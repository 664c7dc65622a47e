"""How a finger moved under which commands, at moments that follow one another."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import DRIVES, JOINTS, TENDONS
from shapechanger.errors import FingerError, UnknownName

__all__ = ["SIGNALS", "FingerLog"]

SIGNALS: Final = {
    "t": 0,
    "commands": len(TENDONS),
    "angles": len(JOINTS),
    "tensions": len(TENDONS),
    "lengths": len(TENDONS),
}
"""The arrays of a log, and how many columns each has; 0 for none."""

# Of a period of control. A clock may jitter; a missing row is a gap.
_LONGEST_STEP: Final = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class FingerLog:
    """What was commanded and measured, a row for each period of control.

    Attributes:
        t: When the row was measured, s, (n,), increasing.
        commands: What acted in the period that ends at `t`, -1 to 1, (n, 7).
        angles: Of the joints, rad, (n, 4); flexion and radial abduction are positive.
        tensions: Of the tendons, N, (n, 7).
        lengths: Of the tendons, as their motors wind them, m, (n, 7); shorter is less.
        actions: What a command means; see `shapechanger.embodiments.finger.DRIVES`.
        control_dt: Period of control, s.
        joints: Names, in the order of `angles`.
        tendons: Names, in the order of the arrays over tendons.
        source: What was recorded, such as an env's id or a robot's name.

    Raises:
        FingerError: If arrays differ in length, hold a number that is not finite, run backwards in
            time or have gaps, or the joints and tendons are not those of the finger; the message
            says where.
        UnknownName: If there is no such mode of action.
    """

    t: NDArray[np.float64]
    commands: NDArray[np.float64]
    angles: NDArray[np.float64]
    tensions: NDArray[np.float64]
    lengths: NDArray[np.float64]
    actions: str
    control_dt: float
    joints: tuple[str, ...] = JOINTS
    tendons: tuple[str, ...] = TENDONS
    source: str = ""

    def __post_init__(self) -> None:
        if self.actions not in DRIVES:
            raise UnknownName("mode of action", self.actions, DRIVES)
        for kind, given, known in (
            ("joints", self.joints, JOINTS),
            ("tendons", self.tendons, TENDONS),
        ):
            if given != known:
                raise FingerError(
                    f"The log is of another finger: its {kind} are {', '.join(given) or 'none'}, "
                    f"not {', '.join(known)}."
                )
        if not 0.0 < self.control_dt < float("inf"):
            raise FingerError(f"The period of control is above 0 s, got {self.control_dt}.")
        for name, columns in SIGNALS.items():
            given = getattr(self, name)
            shape = (len(self.t), columns) if columns else (len(self.t),)
            if given.shape != shape:
                raise FingerError(f"{name} has the shape {given.shape}, not {shape}.")
            rows = ~np.isfinite(given.reshape(len(given), -1)).all(axis=1)
            if rows.any():
                raise FingerError(f"{name} holds no number in row {int(rows.argmax())} of the log.")
        self._check_time()

    def __len__(self) -> int:
        """How many rows there are."""
        return len(self.t)

    @property
    def seconds(self) -> float:
        """From the first row to the last, s."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0

    def part(self, first: int, last: int) -> FingerLog:
        """The rows from `first` to before `last`."""
        rows = {name: getattr(self, name)[first:last] for name in SIGNALS}
        return dataclasses.replace(self, **rows)

    def _check_time(self) -> None:
        steps = np.diff(self.t)
        if (steps <= 0.0).any():
            row = int((steps <= 0.0).argmax()) + 1
            raise FingerError(
                f"Time runs backwards in row {row} of the log: {self.t[row]:.3f} s comes after "
                f"{self.t[row - 1]:.3f} s."
            )
        gaps = steps > _LONGEST_STEP * self.control_dt
        if gaps.any():
            row = int(gaps.argmax())
            raise FingerError(
                f"The log has a gap: between {self.t[row]:.3f} s and {self.t[row + 1]:.3f} s "
                f"there is no row, though one was due every {1e3 * self.control_dt:g} ms."
            )
