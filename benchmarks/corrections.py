"""Value of one round of corrections: record, train, drive, correct, train again.

All steps but the driving run the commands that a user would type, in `results/corrections`;
finished steps are not repeated. After ten minutes of the expert there is little to correct, so
another round starts from two minutes and is compared with two more minutes of the expert.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Final

from scipy.stats import binomtest

from benchmarks.clones import sighted
from benchmarks.driving import DriveResult, DriveScore, drive
from benchmarks.row import Row
from benchmarks.vehicles import counted, layouts
from shapechanger.cli import main
from shapechanger.policy import load_policy
from shapechanger.vehicles.envs import VehicleEnv

LAYOUTS: Final = 100
MINUTES: Final = 10
# A clone of ten minutes of driving rarely collides, so a comparison takes long drives.
LONG_LAYOUTS: Final = 300
FEW_MINUTES: Final = 2
FEW_SEEDS: Final = 3
# Offsets of seeds: between recordings of one round, and between seeds of the study.
LATER: Final = 100_000
APART: Final = 1_000


class _Round:
    """One round: minutes of the expert, then as many minutes of corrections.

    Args:
        vehicle: Name of the vehicle.
        minutes: Length of each recording, min.
        courses: Number of courses in the evaluation.
        seed: Seed of the recorded courses and of the training.
    """

    def __init__(self, vehicle: str, minutes: int, courses: int, seed: int = 0) -> None:
        self._vehicle = vehicle
        self._minutes = minutes
        self._courses = layouts(courses)
        self._seed = seed
        self._folder = Path("results", "corrections", f"{vehicle}-{minutes}-{seed}")
        self._shown = self._folder / "shown"

    def first(self) -> list[DriveResult]:
        """Drive with the clone of the expert."""
        return self._driven(self._first())

    def corrected(self) -> list[DriveResult]:
        """Drive with the clone that was also trained on the expert's corrections."""
        by_expert = ["--driver", str(self._first()), "--corrected-by", "expert"]
        corrected = self._recorded("corrected", LATER, by_expert)
        return self._driven(self._trained("both", self._merged("both", corrected)))

    def continued(self) -> list[DriveResult]:
        """Drive with the clone that was trained on more of the expert instead of corrections."""
        more = self._recorded("more", LATER)
        return self._driven(self._trained("longer", self._merged("longer", more)))

    def _first(self) -> Path:
        return self._trained("first", self._recorded("shown"))

    def _recorded(self, name: str, later: int = 0, by: Sequence[str] = ()) -> Path:
        out = self._folder / name
        command = ["record", self._vehicle.capitalize(), "--out", str(out)]
        command += ["--minutes", str(self._minutes), "--seed", str(later + APART * self._seed)]
        # Short episodes give many courses; a collision does not end an episode.
        _once(out, [*command, "--episode-s", "10", "--put-back", *by])
        return out

    def _merged(self, name: str, later: Path) -> Path:
        out = self._folder / name
        _once(out, ["merge", str(self._shown), str(later), "--out", str(out)])
        return out

    def _trained(self, name: str, data: Path) -> Path:
        out = self._folder / f"{name}.safetensors"
        seed = ["--seed", str(self._seed)]
        _once(out, ["train", str(data), "--out", str(out), "--held-out", "0", *seed])
        return out

    def _driven(self, policy: Path) -> list[DriveResult]:
        """Drive on held-out courses and cache the results next to the policy."""
        kept = policy.with_suffix(f".{len(self._courses)}.drives")
        if not kept.exists():
            act = sighted(load_policy(policy))
            with closing(VehicleEnv(self._vehicle, courses="held-out", put_back=True)) as env:
                drives = [drive(env, act, course=course) for course in self._courses]
            kept.write_text(json.dumps([asdict(each) for each in drives]))
        return [DriveResult(**each) for each in json.loads(kept.read_text())]


def corrections() -> list[Row]:
    """Measure one round of ten minutes, and rounds of two minutes with several seeds."""
    vehicle = os.environ.get("VEHICLE", "car")
    knows = _expert(vehicle)
    long = _Round(vehicle, MINUTES, LONG_LAYOUTS)
    before, after = DriveScore.of(long.first()), DriveScore.of(long.corrected())
    rows = [
        _row(f"{vehicle}, cloned from {MINUTES} minutes of the expert", before, knows),
        _row(f"{vehicle}, after a round of {MINUTES} minutes of corrections", after, knows),
        _ratio_row(f"{vehicle}: collisions left after that round", before, after),
    ]
    short = [_Round(vehicle, FEW_MINUTES, LAYOUTS, seed) for seed in range(FEW_SEEDS)]
    begun = [each.first() for each in short]
    mended = [each.corrected() for each in short]
    longer = [each.continued() for each in short]
    few = f"{vehicle}, {FEW_SEEDS} seeds"
    before, after, instead = (_together(drives) for drives in (begun, mended, longer))
    return [
        *rows,
        _row(f"{few}, cloned from {FEW_MINUTES} minutes of the expert", before, knows, begun),
        _row(f"{few}, after a round of {FEW_MINUTES} minutes of corrections", after, knows, mended),
        _row(f"{few}, after {FEW_MINUTES} more of the expert instead", instead, knows, longer),
        _ratio_row(f"{few}: collisions left after that round", before, after),
        _ratio_row(f"{few}: the round against more of the expert", instead, after, asked=False),
    ]


def _once(made: Path, command: list[str]) -> None:
    """Run a command that makes a file or folder, unless it has completed before."""
    done = made.with_name(f"{made.name}.done")
    if not done.exists():
        if made.is_dir():
            shutil.rmtree(made)  # An interrupted recording would be appended to.
        main(["demos", *command])
        done.touch()


def _expert(vehicle: str) -> DriveScore:
    with closing(VehicleEnv(vehicle, courses="held-out", image=False, put_back=True)) as env:
        act = env.expert()
        return DriveScore.of([drive(env, act, course=course) for course in layouts(LAYOUTS)])


def _together(seeds: Sequence[list[DriveResult]]) -> DriveScore:
    return DriveScore.of([each for drives in seeds for each in drives])


def _row(
    name: str, score: DriveScore, knows: DriveScore, seeds: Sequence[list[DriveResult]] = ()
) -> Row:
    """Return the row of a score; only the rounds of ten minutes have a target."""
    share = score.speed / knows.speed
    each = ", ".join(f"{DriveScore.of(drives).per_100_m:.2f}" for drives in seeds)
    spread = f"{counted(score)}; at {100 * share:.0f} % of the expert's speed"
    good = score.per_100_m < 3.0 and share >= 0.5
    return Row(
        f"{name}: collisions per 100 m of held-out courses",
        f"{score.per_100_m:.2f}",
        f"{spread}; by seed {each}" if seeds else spread,
        "none" if seeds else "< 3 at >= 50 % of its speed",
        bool(seeds) or good,
    )


def _ratio_row(name: str, before: DriveScore, after: DriveScore, *, asked: bool = True) -> Row:
    """Return the ratio of two collision rates with its interval.

    Given the sum of both counts, the second count is binomial: J. Przyborowski and
    H. Wilenski, "Homogeneity of results in testing samples from Poisson series", Biometrika 1940.
    """
    together = before.collisions + after.collisions
    fair = after.metres / (before.metres + after.metres)
    shares = binomtest(after.collisions, together, fair).proportion_ci() if together else None
    low, high = (0.0, float("inf")) if shares is None else (_ratio(s, fair) for s in shares)
    ratio = after.per_100_m / before.per_100_m if before.collisions else float("nan")
    return Row(
        name,
        f"{ratio:.2f}x",
        f"{low:.2f} to {high:.2f}, 95 % (conditional binomial)",
        "below 1, and its interval too" if asked else "none",
        high < 1.0 or not asked,
    )


def _ratio(share: float, fair: float) -> float:
    """Return the ratio of two rates from the share of the second in their sum."""
    return float("inf") if share >= 1.0 else share / (1.0 - share) * (1.0 - fair) / fair
