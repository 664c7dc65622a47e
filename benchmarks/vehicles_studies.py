"""What driving in one body is worth in another, with intervals.

These are studies of hours: they go on from what lies in `results/`, and `SEEDS` says how many runs
each arm has.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final, Literal

import msgspec

from benchmarks.row import Row
from shapechanger.cli.suite import RunSuite
from shapechanger.reports.numbers import estimate_text
from shapechanger.transfer.suite import StudyOutcome

SEEDS: Final = 5
STEPS_A_MINUTE: Final = 1200.0
# Of twelve.
GOOD: Final = 8


def pairs() -> list[Row]:
    """The twelve ordered pairs of vehicles."""
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
    """A car, and the same car with something wrong with its camera."""
    return [_row(crossing) for crossing in _suite("lenses")]


def _suite(name: Literal["vehicles", "lenses"]) -> list[StudyOutcome]:
    out = Path("results", name)
    RunSuite(name, seeds=_seeds(), out=out).run()
    return msgspec.json.decode((out / "suite.json").read_bytes(), type=list[StudyOutcome])


def _seeds() -> int:
    return int(os.environ.get("SEEDS", SEEDS))


def _row(crossing: StudyOutcome) -> Row:
    tuned = crossing.fine_tune_steps
    gains = ", ".join(
        f"{name.replace('_', ' ')} {estimate_text(gain, signed=True)}"
        for name, gain in crossing.gains.items()
    )
    zero_shot = "not asked" if crossing.zero_shot is None else f"{crossing.zero_shot:.1f}"
    reached = "never" if tuned is None else f"after {tuned / STEPS_A_MINUTE:.1f} min"
    return Row(
        f"{crossing.name}: fine-tuning reaches what scratch ends with",
        f"{reached}, scratch after {crossing.scratch_steps / STEPS_A_MINUTE:.1f} min",
        f"{_seeds()} seeds; returns: scratch {crossing.final:.1f}, zero-shot {zero_shot}, "
        f"fine-tuned {crossing.fine_tuned:.1f}; gains in {crossing.unit}s: {gains}",
        "none for a single pair",
        True,
    )
