"""Time to stop after each fault, a hundred trials each.

This takes an hour on a quiet machine, so each trial is written to `results/robot-faults` as it
ends; trials on the same code are not repeated. `ONLY` names faults, with hyphens for spaces.
"""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

import shapechanger
from benchmarks.row import Row, asked
from shapechanger.errors import RobotError
from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.twin.check.faults import FAULTS, Fault
from shapechanger.robot.twin.check.trial import Bench, TrialResult, run_trials
from tests.robots import CAR

TRIALS: Final = 100
KEPT: Final = Path("results", "robot-faults")
PILOT: Final = "shapechanger.vehicles.remote.full_throttle"
BARE: Final = "guard and supervisor killed"
# Code that the time to stop depends on: the robot, its plan, its commands, and the policy.
_CODE: Final = ("cli/robot", "contract", "layout.py", "robot", "vehicles/remote")


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


def _tried(
    profile: Path, name: str, one_shot: bool, trials: int, folder: Path
) -> list[TrialResult]:
    """Run trials until the robot drove in `trials` of them, at most twice as many; return all."""
    fault = FAULTS[name]
    path = folder / f"{fault.name}{'' if one_shot else ', no one-shot'}.jsonl".replace(" ", "-")
    lines = path.read_text().splitlines() if path.exists() else []
    # Python's json, unlike msgspec, can write infinity, the time of a robot that never stopped.
    found = [msgspec.convert(json.loads(line), TrialResult) for line in lines]

    def keep(result: TrialResult) -> None:
        found.append(result)
        file.write(json.dumps(asdict(result)) + "\n")
        file.flush()

    bench = Bench(load_profile(profile), one_shot=one_shot, pilot=PILOT)
    with closing(bench), path.open("a") as file:
        while (drove := sum(one.drove for one in found)) < trials and len(found) < 2 * trials:
            try:
                for result in run_trials(bench, fault, trials - drove):
                    keep(result)
            except RobotError:  # The driver lost the link or never drove: start another robot.
                bench.close()
                keep(TrialResult(math.inf, fault.limit_ms(bench.profile.limits), drove=False))
    return found


def _row(fault: Fault, found: list[TrialResult]) -> Row:
    drove = [one for one in found if one.drove]
    times = np.array([one.stopped_ms for one in drove])
    strangers = sum(bool(one.unauthorised) for one in drove)
    idle = len(found) - len(drove)
    return Row(
        f"at rest after: {fault.name}",
        f"p50 {np.percentile(times, 50):.1f}, p99 {np.percentile(times, 99):.1f} ms",
        f"max {times.max():.1f} ms, {len(drove)} trials, {strangers} unauthorised"
        + (f"; {idle} more in which it did not drive" if idle else ""),
        f"< {drove[0].limit_ms:.0f} ms",
        all(one.kept for one in drove),
    )


def _without_one_shot(fault: Fault, found: list[TrialResult]) -> Row:
    """Return how often a pin keeps its level when nothing cuts its power."""
    drove = [one for one in found if one.drove]
    never = sum(math.isinf(one.stopped_ms) for one in drove)
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
    whole.update(CAR.encode())
    for part in (root / name for name in _CODE):
        paths = sorted(part.rglob("*.py")) or [part]
        for path in paths:  # Reading a missing part raises an error.
            whole.update(path.read_bytes())
    return whole.hexdigest()[:12]
