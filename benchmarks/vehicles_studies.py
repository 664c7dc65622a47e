"""Transfer of driving between vehicles, with intervals.

The studies take hours and resume from `results/`; `SEEDS` sets the number of runs per arm.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.row import Row
from shapechanger.cli.suite import SuiteRun
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.metrics.intervals import estimate_difference
from shapechanger.transfer.report.verdict import estimate_text
from shapechanger.transfer.suite import StudyOutcome
from shapechanger.vehicles.envs.ranges import COLLISION_REWARD

SEEDS: Final = 5
STEPS_A_MINUTE: Final = 1200.0
# Seconds of the target's driving after which the other arms are compared with scratch.
_SECONDS: Final = (15, 30)
# Limit of collisions per 100 m, and number of pairs on which fine-tuning should halve the minutes.
FEW: Final = 3.0
GOOD: Final = 8
_ARMS: Final = ("scratch", "fine-tune", "rehearsal")
RUNS: Final = Path(__file__).parent / "results" / "vehicles-waypoint-runs.json"


def pairs() -> list[Row]:
    """Measure the twelve ordered pairs of vehicles."""
    found = _suite("vehicles")
    halves = sum(crossing.halves for crossing in found)
    return [
        *(_row(crossing) for crossing in found),
        Row(
            "pairs on which fine-tuning reaches scratch's final score with under half its minutes",
            f"{halves} of {len(found)}",
            f"{_seeds()} seeds an arm",
            f">= {GOOD} is good",
            halves >= GOOD,
        ),
    ]


def lenses() -> list[Row]:
    """Measure a car and the same car with a degraded camera."""
    return [_row(crossing) for crossing in _suite("lenses")]


def waypoints() -> list[Row]:
    """Measure all pairs of vehicles with waypoint actions, by seconds of the target's driving."""
    _suite("waypoints")
    return waypoint_rows(Path("results", "waypoints"))


def waypoint_rows(folder: Path) -> list[Row]:
    """Return the results of a suite's studies so far, at 15 and at 30 s of driving.

    Args:
        folder: Folder of the suite.
    """
    pairs = [path.parent for path in sorted(folder.glob("*-to-*/study.json"))]
    keep_runs(pairs)
    rows = [_seconds_row(pair) for pair in pairs]
    for arm in ("fine-tune", "rehearsal"):
        better = dict.fromkeys(_SECONDS, 0)
        with_arm = [pair for pair in pairs if (pair / "runs" / f"{arm}-0").exists()]
        for pair in with_arm:
            scratch, tuned = _by_steps(pair / "runs", "scratch"), _by_steps(pair / "runs", arm)
            for seconds in _SECONDS:
                steps = round(seconds * STEPS_A_MINUTE / 60.0)
                gain = estimate_difference(tuned[steps], scratch[steps])
                better[seconds] += gain.low is not None and gain.low > 0.0
                rows.append(
                    Row(
                        f"{pair.name}: return of {arm} over scratch after {seconds} s",
                        f"{tuned[steps].mean():.1f} to {scratch[steps].mean():.1f}",
                        f"{estimate_text(gain, signed=True)}; zero-shot {tuned[0].mean():.1f}; "
                        f"{len(tuned[steps])} seeds, about 500 m an evaluation",
                        "none for a single pair",
                        True,
                    )
                )
        for seconds, count in better.items():
            if with_arm:
                rows.append(
                    Row(
                        f"waypoints: {arm} beats scratch after {seconds} s, interval above 0",
                        f"{count} of {len(with_arm)} pairs",
                        "seeds as above",
                        "two thirds",
                        3 * count >= 2 * len(with_arm),
                    )
                )
    return rows


def keep_runs(pairs: Sequence[Path]) -> None:
    """Write the driving of every run at each evaluation next to the rows; other pairs are kept.

    Args:
        pairs: Folders of the studies.
    """
    kept: dict[str, Any] = json.loads(RUNS.read_text()) if RUNS.exists() else {}
    for pair in pairs:
        kept[pair.name] = {
            arm: {
                str(steps): {
                    "returns": [round(one.mean_return, 2) for one in each],
                    "metres": [round(one.terms["reward_velocity"], 2) for one in each],
                    "collisions": [
                        round(one.terms["reward_collision"] / COLLISION_REWARD, 2) for one in each
                    ],
                }
                for steps, each in sorted(_evaluations(pair / "runs", arm).items())
            }
            for arm in _ARMS
            if (pair / "runs" / f"{arm}-0").exists()
        }
    RUNS.write_text(json.dumps(kept, indent=1) + "\n")


def _seconds_row(pair: Path) -> Row:
    """Return the target time until each arm collides at most `FEW` times per 100 m."""
    needed: list[str] = []
    rates: list[str] = []
    for arm in _ARMS:
        runs = _evaluations(pair / "runs", arm)
        found = {steps: _per_100_m(runs[steps]) for steps in sorted(runs)}
        if found:
            enough = next((steps for steps, rate in found.items() if rate <= FEW), None)
            seconds = "never" if enough is None else f"{60 * enough / STEPS_A_MINUTE:g} s"
            needed.append(f"{arm} {seconds}")
            rates.append(f"{arm} {', '.join(f'{rate:.1f}' for rate in found.values())}")
    return Row(
        f"{pair.name}: seconds of the target's driving until at most {FEW:g} collisions per 100 m",
        "; ".join(needed),
        f"collisions per 100 m after 0, 5, 15, 30 and 60 s: {'; '.join(rates)}",
        "none for a single pair",
        True,
    )


def _per_100_m(evaluations: list[Evaluation]) -> float:
    """Return the collisions per 100 m driven forward, over all seeds."""
    collisions = sum(each.terms["reward_collision"] for each in evaluations) / COLLISION_REWARD
    metres = sum(each.terms["reward_velocity"] for each in evaluations)  # One for each metre.
    return 100.0 * collisions / metres if metres > 0.0 else math.inf


def _by_steps(runs: Path, kind: str) -> dict[int, NDArray[np.float64]]:
    """Return the returns of all runs of a kind, by number of target steps."""
    found = _evaluations(runs, kind)
    return {steps: np.array([one.mean_return for one in each]) for steps, each in found.items()}


def _evaluations(runs: Path, kind: str) -> dict[int, list[Evaluation]]:
    """Return the evaluations of all runs of a kind, by number of target steps."""
    found: dict[int, list[Evaluation]] = {}
    for curve in sorted(runs.glob(f"{kind}-*/curve.jsonl")):
        for line in curve.read_bytes().splitlines():
            evaluation = msgspec.json.decode(line, type=Evaluation)
            found.setdefault(evaluation.steps, []).append(evaluation)
    return found


def _suite(name: Literal["vehicles", "lenses", "waypoints"]) -> list[StudyOutcome]:
    out = Path("results", name)
    SuiteRun(name=name, seeds=_seeds(), out=out).run()
    return msgspec.json.decode((out / "suite.json").read_bytes(), type=list[StudyOutcome])


def _seeds() -> int:
    return int(os.environ.get("SEEDS", SEEDS))


def _row(crossing: StudyOutcome) -> Row:
    steps = crossing.arm_steps
    gains = ", ".join(
        f"{name.replace('_', ' ')} {estimate_text(gain, signed=True)}"
        for name, gain in crossing.gains.items()
    )
    zero_shot = "not asked" if crossing.zero_shot is None else f"{crossing.zero_shot:.1f}"
    reached = "never" if steps is None else f"after {steps / STEPS_A_MINUTE:.1f} min"
    return Row(
        f"{crossing.name}: fine-tuning reaches what scratch ends with",
        f"{reached}, scratch after {crossing.scratch_steps / STEPS_A_MINUTE:.1f} min",
        f"{_seeds()} seeds; returns: scratch {crossing.final:.1f}, zero-shot {zero_shot}, "
        f"fine-tuned {crossing.arm_final:.1f}; gains in {crossing.unit}s: {gains}",
        "none for a single pair",
        True,
    )
