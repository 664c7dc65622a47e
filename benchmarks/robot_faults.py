"""Time to stop after each fault, a hundred trials each.

This takes an hour on a quiet machine, so each trial is written to `results/robot-faults` as it
ends; trials on the same code are not repeated. `ONLY` names faults, with hyphens for spaces.
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
from benchmarks.row import Row, asked
from shapechanger.errors import RobotError
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.twin.check.faults import FAULTS, Fault
from shapechanger.robot.twin.check.trial import Bench, run_trial
from tests.robots import CAR

TRIALS: Final = 100
KEPT: Final = Path("results", "robot-faults")
PILOT: Final = "shapechanger.vehicles.remote.full_throttle"
BARE: Final = "guard and supervisor killed"
# Code that the time to stop depends on.
_CODE: Final = ("cli/robot", "vehicles/remote", "link", "remote", "robot", "twin")


class _Tried(msgspec.Struct, frozen=True):
    """One trial.

    Attributes:
        stopped_ms: See `TrialResult`; None for never.
        limit_ms: Limit of the fault.
        drove: Whether the robot was driving at the fault; other trials do not count.
        unauthorised_ms: Durations of motion without a fresh command; None for unlimited.
    """

    stopped_ms: float | None
    limit_ms: float
    drove: bool
    unauthorised_ms: tuple[float | None, ...]

    @property
    def kept(self) -> bool:
        """Return whether the robot stopped in time and never moved without a command."""
        stopped = self.stopped_ms is not None and self.stopped_ms <= self.limit_ms
        return stopped and not self.unauthorised_ms


def faults(trials: int = int(os.environ.get("TRIALS", TRIALS))) -> list[Row]:
    """Measure every fault, on as many robots at a time as there are cores."""
    wanted = asked("fault", [_hyphened(name) for name in FAULTS])
    chosen = [fault for name, fault in FAULTS.items() if _hyphened(name) in wanted]
    folder = KEPT / _digest()
    folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as place,
        # Processes, not threads: starting a process in one thread would delay the network between
        # driver and robot, and the time of the fault, in the others.
        ProcessPoolExecutor(os.cpu_count() or 1, multiprocessing.get_context("spawn")) as robots,
    ):
        profile = Path(place, "car.toml")
        profile.write_text(CAR)
        work = [robots.submit(_tried, profile, f.name, True, trials, folder) for f in chosen]
        rows = [_row(f, done.result()) for f, done in zip(chosen, work, strict=True)]
        if len(chosen) == len(FAULTS):
            without = robots.submit(_tried, profile, BARE, False, trials, folder)
            rows.append(_without_one_shot(FAULTS[BARE], without.result()))
        return rows


def _hyphened(name: str) -> str:
    return name.replace(" ", "-")


def _tried(profile: Path, name: str, one_shot: bool, trials: int, folder: Path) -> list[_Tried]:
    """Run trials until enough of them drove, and return all."""
    fault = FAULTS[name]
    path = folder / f"{fault.name}{'' if one_shot else ', no one-shot'}.jsonl".replace(" ", "-")
    found: list[_Tried] = []
    if path.exists():
        found = msgspec.json.Decoder(_Tried).decode_lines(path.read_bytes())
    with ExitStack() as opened, path.open("ab") as file:
        bench: Bench | None = None
        while sum(one.drove for one in found) < trials and len(found) < 2 * trials:
            if bench is None:
                bench = Bench(load_profile(profile), one_shot=one_shot, pilot=PILOT)
                opened.callback(bench.close)
            try:
                tried = _as_tried(bench, fault)
            except RobotError:  # The driver lost the link or never drove: start another robot.
                opened.close()
                bench, tried = None, _Tried(None, 0.0, False, ())
            found.append(tried)
            file.write(msgspec.json.encode(tried) + b"\n")
            file.flush()
    return found


def _as_tried(bench: Bench, fault: Fault) -> _Tried:
    result = run_trial(bench, fault)
    return _Tried(
        _finite(result.stopped_ms),
        result.limit_ms,
        result.drove,
        tuple(_finite((one.end_ns - one.start_ns) / 1e6) for one in result.unauthorised),
    )


def _finite(number: float) -> float | None:
    """Return a number that JSON can hold; None for infinity."""
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
    """Return how often a pin keeps its level when nothing cuts its power."""
    drove = [one for one in found if one.drove]
    never = sum(one.stopped_ms is None for one in drove)
    return Row(
        f"{fault.name}, no one-shot fitted: motors that never stop",
        f"{never} of {len(drove)}",
        "throttle at a duty of 0.6, 50 Hz",
        "none: it shows what the one-shot is for",
        True,
    )


def _digest() -> str:
    """Return a digest of the code that stops a robot."""
    root = Path(shapechanger.__file__).parent
    whole = hashlib.sha256()
    for part in _CODE:
        for path in sorted((root / part).rglob("*.py")):
            whole.update(path.read_bytes())
    return whole.hexdigest()[:12]
