"""How a finger moved under which commands, at moments that follow one another."""

from __future__ import annotations

import dataclasses
import math
import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from shapechanger.bodies.finger import DRIVES, JOINTS, TENDONS
from shapechanger.errors import FingerError, OutputError, UnknownName

__all__ = ["SIGNALS", "FingerLog", "load_log", "require_informative", "save_log"]

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
        actions: What a command means; see `shapechanger.bodies.finger.DRIVES`.
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


_FORMAT: Final = "shapechanger finger log"
_VERSION: Final = 1


class _Header(msgspec.Struct, frozen=True, kw_only=True):
    """What the arrays do not say."""

    format: str
    version: int
    actions: str
    control_dt: float
    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    source: str = ""


def save_log(log: FingerLog, path: str | os.PathLike[str]) -> None:
    """Write a log; a file that is there already is replaced.

    Raises:
        OutputError: If the file cannot be written.
    """
    header = _Header(
        format=_FORMAT,
        version=_VERSION,
        actions=log.actions,
        control_dt=log.control_dt,
        joints=log.joints,
        tendons=log.tendons,
        source=log.source,
    )
    arrays = {name: getattr(log, name) for name in SIGNALS}
    said = np.frombuffer(msgspec.json.encode(header), np.uint8)
    try:
        with Path(path).open("wb") as file:  # Given a name, NumPy would add an ending to it.
            np.savez_compressed(file, header=said, **arrays)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from error


def load_log(path: str | os.PathLike[str]) -> FingerLog:
    """Read what `save_log` wrote.

    Raises:
        FingerError: If it is no log, is cut short, is of a later version, or says what no finger
            does; see `FingerLog`.
        UnknownName: If its mode of action is none.
    """
    name = Path(path).name
    try:
        with Path(path).open("rb") as raw:  # Of a damaged file NumPy forgets to close it.
            loaded: Any = np.load(raw, allow_pickle=False)
            if not isinstance(loaded, NpzFile):
                raise ValueError("an array, not a file of arrays")
            read: dict[str, Any] = {key: loaded[key] for key in loaded.files}
    except FileNotFoundError as error:
        raise FingerError(f"There is no file {path}.") from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FingerError(_not_whole(Path(path), name)) from error
    header = _header(name, read)
    missing = [key for key in SIGNALS if key not in read]
    if missing:
        raise FingerError(f"{name} is no whole log: it lacks {', '.join(missing)}.")
    try:
        arrays = {key: np.asarray(read[key], np.float64) for key in SIGNALS}
    except ValueError as error:
        raise FingerError(f"{name} is no log of a finger: its arrays hold no numbers.") from error
    if arrays["t"].ndim != 1:
        raise FingerError(f"{name} is no log of a finger: t is no list of times.")
    return FingerLog(
        **arrays,
        actions=header.actions,
        control_dt=header.control_dt,
        joints=header.joints,
        tendons=header.tendons,
        source=header.source,
    )


def _not_whole(path: Path, name: str) -> str:
    """Why a file cannot be read."""
    try:
        with path.open("rb") as file:
            begins_as_one = file.read(2) == b"PK"
    except OSError as error:
        return f"{name} cannot be read: {error.strerror}."
    if begins_as_one:
        return f"{name} is cut short or damaged: record it again."
    return f"{name} is no log of a finger; `shapechanger finger record` writes one."


def _header(name: str, read: dict[str, Any]) -> _Header:
    if "header" not in read:
        raise FingerError(f"{name} is no log of a finger: it has no header.")
    try:
        header = msgspec.json.decode(bytes(read["header"]), type=_Header)
    except (msgspec.MsgspecError, TypeError, ValueError) as error:
        raise FingerError(f"{name} is no log of a finger: its header says {error}.") from error
    if header.format != _FORMAT:
        raise FingerError(f"{name} is no log of a finger, but {header.format!r}.")
    if header.version > _VERSION:
        raise FingerError(
            f"{name} is of version {header.version}, and this Shapechanger reads up to {_VERSION}."
        )
    return header


# s. Below it the intervals, which rest on how errors repeat within half a second, mean nothing.
_SHORTEST_S: Final = 4.0
# rad, between the 5th and the 95th of a hundred angles. An arm of 9 mm winds 1.5 mm in it.
_LEAST_RANGE: Final = math.radians(10.0)
# rad. What a joint moves beyond what the others' motion tells, as a standard deviation.
_LEAST_OWN: Final = math.radians(2.0)


def require_informative(log: FingerLog) -> None:
    """Let pass a log in which every joint moves, and on its own.

    Raises:
        FingerError: If it is too short, or a joint hardly moved or only along with others; the
            message says which.
    """
    if log.seconds < _SHORTEST_S - 0.5 * log.control_dt:
        raise FingerError(
            f"The log is {log.seconds:.1f} s long; it takes {_SHORTEST_S:g} s at least, and "
            "10 s are good."
        )
    low, high = np.percentile(log.angles, [5.0, 95.0], axis=0)
    for joint, moved in zip(log.joints, high - low, strict=True):
        if moved < _LEAST_RANGE:
            raise FingerError(
                f"{joint} hardly moved, by {math.degrees(moved):.1f} degrees; it takes "
                f"{math.degrees(_LEAST_RANGE):.0f} at least to tell its moment arms."
            )
    centred = log.angles - log.angles.mean(axis=0)
    for j, joint in enumerate(log.joints):
        others = np.delete(centred, j, axis=1)
        shares = np.asarray(np.linalg.lstsq(others, centred[:, j])[0], np.float64)
        own = float(np.std(centred[:, j] - others @ shares))
        if own < _LEAST_OWN:
            raise FingerError(
                f"{joint} moved only along with the other joints, so that their moment arms "
                "cannot be told apart; move each on its own."
            )
