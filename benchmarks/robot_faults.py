"""The time to stop after each fault, a hundred times each.

This takes an hour on a quiet machine, so each trial is written down as it ends, below
`results/robot-faults`; what was tried on the same code is not tried again.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

import shapechanger
from benchmarks.row import Row
from shapechanger.cli.robot.trial import FAULTS, Fault, Trial
from shapechanger.errors import RobotError
from shapechanger.robot.profile.load import load_profile
from tests.robots import CAR

TRIALS: Final = 100
KEPT: Final = Path("results", "robot-faults")
BARE: Final = "guard and supervisor killed"
# What the time to stop depends on.
_CODE: Final = ("cli/robot", "link", "remote", "robot", "twin")


class _Tried(msgspec.Struct, frozen=True):
    """One trial.

    Attributes:
        stopped_ms: See `TrialResult`; None for never.
        limit_ms: What is promised.
        drove: Whether it was driving when the fault came; otherwise the trial says nothing.
        unauthorised_ms: How long something propelled without a fresh command; None for for ever.
    """

    stopped_ms: float | None
    limit_ms: float
    drove: bool
    unauthorised_ms: tuple[float | None, ...]

    @property
    def kept(self) -> bool:
        """Whether the promise was kept."""
        stopped = self.stopped_ms is not None and self.stopped_ms <= self.limit_ms
        return stopped and not self.unauthorised_ms


def faults(trials: int = int(os.environ.get("TRIALS", TRIALS))) -> list[Row]:
    """Every fault, on as many robots at a time as there are cores."""
    folder = KEPT / _digest()
    folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as place,
        # No threads: what lies between driver and robot, and when a fault is said to have happened,
        # would wait for ever so long while another thread starts a process.
        ProcessPoolExecutor(os.cpu_count() or 1, multiprocessing.get_context("spawn")) as robots,
    ):
        profile = Path(place, "car.toml")
        profile.write_text(CAR)
        work = [robots.submit(_tried, profile, name, True, trials, folder) for name in FAULTS]
        without = robots.submit(_tried, profile, BARE, False, trials, folder)
        rows = [_row(f, done.result()) for f, done in zip(FAULTS.values(), work, strict=True)]
        return [*rows, _without_one_shot(FAULTS[BARE], without.result())]


def _tried(profile: Path, name: str, one_shot: bool, trials: int, folder: Path) -> list[_Tried]:
    """So many trials in which the robot drove, and those in between in which it did not."""
    fault = FAULTS[name]
    path = folder / f"{fault.name}{'' if one_shot else ', no one-shot'}.jsonl".replace(" ", "-")
    found: list[_Tried] = []
    if path.exists():
        found = msgspec.json.Decoder(_Tried).decode_lines(path.read_bytes())
    with ExitStack() as opened, path.open("ab") as file:
        trial: Trial | None = None
        while sum(one.drove for one in found) < trials and len(found) < 2 * trials:
            if trial is None:
                trial = opened.enter_context(Trial(load_profile(profile), one_shot=one_shot))
            try:
                tried = _as_tried(trial, fault)
            except RobotError:  # Its driver lost the link, or never drove: begin with another.
                opened.close()
                trial, tried = None, _Tried(None, 0.0, False, ())
            found.append(tried)
            file.write(msgspec.json.encode(tried) + b"\n")
            file.flush()
    return found


def _as_tried(trial: Trial, fault: Fault) -> _Tried:
    result = trial.run(fault)
    return _Tried(
        _finite(result.stopped_ms),
        result.limit_ms,
        result.drove,
        tuple(_finite((one.end_ns - one.start_ns) / 1e6) for one in result.unauthorised),
    )


def _finite(number: float) -> float | None:
    """A number as JSON can hold it."""
    return None if np.isinf(number) else number


def _row(fault: Fault, found: list[_Tried]) -> Row:
    drove = [one for one in found if one.drove]
    times = np.array([np.inf if one.stopped_ms is None else one.stopped_ms for one in drove])
    strangers = sum(bool(one.unauthorised_ms) for one in drove)
    idle = len(found) - len(drove)
    return Row(
        f"at rest after: {fault.name}",
        f"p50 {np.percentile(times, 50):.1f}, p99 {np.percentile(times, 99):.1f} ms",
        f"max {times.max():.1f} ms, {len(drove)} trials, {strangers} unauthorised"
        + (f"; {idle} more in which it did not drive" if idle else ""),
        f"< {drove[0].limit_ms:.0f} ms",
        all(one.kept for one in drove),
    )


def _without_one_shot(fault: Fault, found: list[_Tried]) -> Row:
    """What is left to the pull-downs and to chance: a pin keeps the level of that moment."""
    drove = [one for one in found if one.drove]
    never = sum(one.stopped_ms is None for one in drove)
    return Row(
        f"{fault.name}, no one-shot fitted: motors that run on for ever",
        f"{never} of {len(drove)}",
        "throttle at a duty of 0.6, 50 Hz",
        "none: it shows what the one-shot is for",
        True,
    )


def _digest() -> str:
    """Of the code that stops a robot."""
    root = Path(shapechanger.__file__).parent
    whole = hashlib.sha256()
    for part in _CODE:
        for path in sorted((root / part).rglob("*.py")):
            whole.update(path.read_bytes())
    return whole.hexdigest()[:12]
