"""Motion logs of a finger: one row per control period, kept in an `.npz` file."""

from __future__ import annotations

import io
import math
import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import layouts_of
from shapechanger.errors import FingerError, require_known
from shapechanger.files import read_file, writing
from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.controller import FingerBabble, places_of
from shapechanger.finger.parameters import FingerParameters
from shapechanger.finger.plant import CONTROL_DT
from shapechanger.finger.tensions import DRIVES

SIGNALS: Final = {
    "t": (),
    "commands": (len(TENDONS),),
    "angles": (len(JOINTS),),
    "tensions": (len(TENDONS),),
    "lengths": (len(TENDONS),),
}
"""Arrays of a log and the shapes of their rows."""
_SETTINGS: Final = ("actions", "control_dt", "source", "motors")

# Longest time between two rows, in control periods. It allows jitter, but no missing row.
_LONGEST_STEP: Final = 1.5
_MAX_BYTES: Final = 256 << 20  # An hour at 50 Hz has 37 MB.
# Shortest log, s. The intervals need several periods of half a second.
_SHORTEST_S: Final = 4.0
# Smallest range of each joint, rad, from the 5th to the 95th percentile. Over this range, a tendon
# with an arm of 9 mm moves 1.5 mm.
_LEAST_RANGE: Final = math.radians(10.0)
# Smallest standard deviation, rad, of the part of a joint's motion that the other joints do not
# explain.
_LEAST_OWN: Final = math.radians(2.0)


@dataclass(frozen=True, slots=True, eq=False)
class FingerLog:
    """Commands and measurements of a finger, one row per control period.

    Attributes:
        t: Time of each measurement, s, (n,), increasing.
        commands: Commands that acted in the period ending at `t`, -1 to 1, (n, 7).
        angles: Joint angles, rad, (n, 4); flexion and radial abduction are positive.
        tensions: Tendon tensions, N, (n, 7).
        lengths: Lengths of the tendons at the motors, m, (n, 7); winding up shortens them.
        actions: Meaning of a command; see `shapechanger.finger.tensions.DRIVES`.
        control_dt: Control period, s.
        source: Recorded env or robot, such as an env id.
        motors: A finger with the rig's motors, tension range and command path, because a log
            hardly identifies geared motors; None if they are unknown.

    Raises:
        FingerError: If `control_dt` is not above 0 and finite, the arrays differ in length or
            contain a number that is not finite, or the times do not increase or have gaps.
        UnknownName: If `actions` is not a known mode.
    """

    t: NDArray[np.float64]
    commands: NDArray[np.float64]
    angles: NDArray[np.float64]
    tensions: NDArray[np.float64]
    lengths: NDArray[np.float64]
    actions: str
    control_dt: float
    source: str = ""
    motors: FingerParameters | None = None

    def __post_init__(self) -> None:
        require_known("mode of action", DRIVES, self.actions)
        if not 0.0 < self.control_dt < float("inf"):
            raise FingerError(f"control_dt must be above 0 s and finite, got {self.control_dt}.")
        for name, row in SIGNALS.items():
            given, shape = getattr(self, name), (self.t.size, *row)
            if given.shape != shape:
                raise FingerError(f"{name} must have the shape {shape}, got {given.shape}.")
            rows = ~np.isfinite(given).all(axis=tuple(range(1, given.ndim)))
            if rows.any():
                raise FingerError(f"{name} is not finite in row {int(rows.argmax())} of the log.")
        steps = np.diff(self.t)
        if (wrong := ~((steps > 0.0) & (steps <= _LONGEST_STEP * self.control_dt))).any():
            row = int(wrong.argmax())
            raise FingerError(
                f"Time repeats, runs backwards or has a gap in row {row + 1}: rows are due every "
                f"{1e3 * self.control_dt:g} ms, and {self.t[row + 1]:.3f} s comes after "
                f"{self.t[row]:.3f} s."
            )

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    @property
    def seconds(self) -> float:
        """Time from the first row to the last, s."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0


def require_informative(log: FingerLog) -> None:
    """Raise a FingerError unless the log is long enough and each joint moves on its own."""
    if log.seconds < _SHORTEST_S - 0.5 * log.control_dt:
        raise FingerError(
            f"The log is {log.seconds:.1f} s long; identification needs at least "
            f"{_SHORTEST_S:g} s, and works well with 10 s."
        )
    low, high = np.percentile(log.angles, [5.0, 95.0], axis=0)
    for joint, moved in zip(JOINTS, high - low, strict=True):
        if moved < _LEAST_RANGE:
            raise FingerError(
                f"{joint} moved by {math.degrees(moved):.1f} degrees only; its moment arms need at "
                f"least {math.degrees(_LEAST_RANGE):.0f}."
            )
    centred = log.angles - log.angles.mean(axis=0)
    for j, joint in enumerate(JOINTS):
        others = np.delete(centred, j, axis=1)
        shares = np.asarray(np.linalg.lstsq(others, centred[:, j])[0], np.float64)
        own = float(np.std(centred[:, j] - others @ shares))
        if own < _LEAST_OWN:
            raise FingerError(
                f"{joint} moved only along with the other joints, so their moment arms cannot be "
                "separated; move each joint on its own."
            )


class _Header(msgspec.Struct, frozen=True, kw_only=True):
    """Fields of a log that are not arrays, stored as JSON."""

    format: Literal["shapechanger finger log"]
    version: Literal[1]
    actions: str
    control_dt: float
    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    source: str = ""
    motors: FingerParameters | None = None


def save_log(log: FingerLog, path: str | os.PathLike[str]) -> None:
    """Write a log to a file, replacing an existing one.

    Args:
        log: The log.
        path: File to write; no suffix is added.

    Raises:
        OutputError: If the file cannot be written.
    """
    own: dict[str, Any] = {key: getattr(log, key) for key in _SETTINGS}
    header = _Header(
        format="shapechanger finger log", version=1, joints=JOINTS, tendons=TENDONS, **own
    )
    arrays = {name: getattr(log, name) for name in SIGNALS}
    encoded = np.frombuffer(msgspec.json.encode(header), np.uint8)
    # NumPy would add a suffix to a path.
    with writing(Path(path)), Path(path).open("wb") as file:
        np.savez_compressed(file, header=encoded, **arrays)


def load_log(path: str | os.PathLike[str]) -> FingerLog:
    """Read a log written by `save_log`.

    Raises:
        FingerError: If the file cannot be read, is not a log, is damaged or has a later version, or
            if `FingerLog` rejects the log.
        UnknownName: If the mode of action of the log is unknown.
    """
    place = Path(path)
    try:
        raw = io.BytesIO(read_file(place, _MAX_BYTES))
        with zipfile.ZipFile(raw) as archive:
            claimed = sum(info.file_size for info in archive.infolist())
        if claimed > _MAX_BYTES:  # A few bytes of an archive can unpack to any size.
            raise ValueError(f"it unpacks to {claimed} bytes, more than {_MAX_BYTES}")
        loaded: Any = np.load(raw, allow_pickle=False)
        header = msgspec.json.decode(loaded["header"].tobytes(), type=_Header)
        arrays = {key: np.asarray(loaded[key], np.float64) for key in SIGNALS}
        if (header.joints, header.tendons) != (JOINTS, TENDONS):
            given = ", ".join((*header.joints, *header.tendons)) or "none"
            raise ValueError(f"its joints and tendons are {given}, which are not the finger's")
    except OSError as error:
        raise FingerError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (
        *(EOFError, KeyError, MemoryError, RuntimeError, TypeError, ValueError),
        *(zipfile.BadZipFile, zlib.error, msgspec.MsgspecError),
    ) as error:
        raise FingerError(
            f"{place.name} is damaged, or not a finger log: {str(error).rstrip('.')}. Record one "
            "with `shapechanger finger record`."
        ) from error
    return FingerLog(**arrays, **{key: getattr(header, key) for key in _SETTINGS})


def record_babble(
    env: gym.Env[Any, Any], seconds: float, seed: int = 0, actions: str = "impedance"
) -> FingerLog:
    """Record a log of a finger that `FingerBabble` moves.

    Args:
        env: Env with the layout of a finger, simulated or on a rig, without a time limit.
        seconds: Duration, s.
        seed: Seed of the motions and of the env.
        actions: Mode of action of the env, such as "impedance".

    Raises:
        LayoutError: If the env publishes no layouts.
        UnknownName: If the env's layout is not a finger's, or no mode of action is named `actions`.
        FingerError: If the env's observations are not a vector, or the episode ends too early.
    """
    if not isinstance(env.observation_space, gym.spaces.Box):
        raise FingerError("Recording a finger needs Box observations: omit `goal`.")
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    layout, _ = layouts_of(env)
    control_dt = 1.0 / float(env.metadata.get("render_fps") or 1.0 / CONTROL_DT)
    babble = FingerBabble(layout, actions, seed, control_dt)
    angles = places_of(layout, JOINTS, "angle")
    tensions, lengths, commands = (
        places_of(layout, TENDONS, kind) for kind in ("tension", "length", "command")
    )
    observation, _ = env.reset(seed=seed)
    rows: list[NDArray[np.float64]] = [np.array(observation, np.float64)]
    for step in range(round(seconds / control_dt)):
        observation, _, terminated, truncated, info = env.step(babble(observation))
        if terminated or truncated or info.get("diverged"):
            because = str(info.get("truncated_because") or "").rstrip(".")
            raise FingerError(
                f"The env ended after {(step + 1) * control_dt:.1f} s of {seconds:g} s"
                + (f": {because}." if because else ".")
            )
        rows.append(np.array(observation, np.float64))
    seen = np.array(rows)
    return FingerLog(
        t=np.asarray(control_dt * np.arange(len(seen)), np.float64),
        commands=seen[:, commands],
        angles=seen[:, angles],
        tensions=seen[:, tensions],
        lengths=seen[:, lengths],
        actions=actions,
        control_dt=control_dt,
        source=name,
        motors=getattr(env.unwrapped, "motors", None),
    )
