"""What one round of corrections is worth: record, train, drive, correct, train again.

Everything is done by the commands that a user would type, one after another, in
`results/corrections`; what lies there already is not done again.
"""

from __future__ import annotations

import os
import shutil
from contextlib import closing
from pathlib import Path
from typing import Final

from scipy.stats import binomtest

from benchmarks.clones import sighted
from benchmarks.row import Row
from benchmarks.vehicles import counted, layouts
from shapechanger.cli import main
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.envs.vehicle import VehicleEnv
from shapechanger.envs.vehicle.drive import DriveScore, drive
from shapechanger.envs.vehicle.pilot import Pilot

__all__ = ["corrections"]

LAYOUTS: Final = 100
MINUTES: Final = 10.0
# Seeds of courses that nobody was recorded on before.
LATER: Final = 100_000


def corrections() -> list[Row]:
    """Ten minutes of the expert, a clone of it, ten minutes of that clone corrected, another."""
    vehicle = os.environ.get("VEHICLE", "car")
    folder = Path("results", "corrections", vehicle)
    shown, corrected, both = (folder / name for name in ("shown", "corrected", "both"))
    first, second = folder / "first.zip", folder / "second.zip"
    _once(shown, _record(vehicle, shown))
    _once(first, ["train", str(shown), "--out", str(first), "--held-out", "0"])
    _once(
        corrected,
        [*_record(vehicle, corrected, LATER), "--driver", str(first), "--corrected-by", "expert"],
    )
    _once(both, ["merge", str(shown), str(corrected), "--out", str(both)])
    _once(second, ["train", str(both), "--out", str(second), "--held-out", "0"])
    before, after = _score(vehicle, first), _score(vehicle, second)
    knows = _expert(vehicle)
    return [
        _row(f"{vehicle}, cloned from {MINUTES:.0f} minutes of the expert", before, knows),
        _row(f"{vehicle}, after one round of corrections", after, knows),
        _ratio_row(vehicle, before, after),
    ]


def _record(vehicle: str, out: Path, seed: int = 0) -> list[str]:
    return [
        *("record", vehicle.capitalize(), "--out", str(out), "--minutes", str(MINUTES)),
        # Short episodes, so that there are many courses; and whoever runs into something goes on.
        *("--episode-s", "10", "--put-back", "--seed", str(seed)),
    ]


def _once(made: Path, command: list[str]) -> None:
    """Do what makes a file or folder, unless it was done to its end."""
    done = made.with_name(f"{made.name}.done")
    if not done.exists():
        if made.is_dir():
            shutil.rmtree(made)  # What was cut off would come on top.
        main(["demos", *command])
        done.touch()


def _score(vehicle: str, policy: Path) -> DriveScore:
    act = sighted(CameraPolicy.load(policy))
    with closing(VehicleEnv(vehicle, courses="held-out", put_back=True)) as env:
        return DriveScore.of([drive(env, act, course=course) for course in layouts(LAYOUTS)])


def _expert(vehicle: str) -> DriveScore:
    with closing(VehicleEnv(vehicle, courses="held-out", image=False, put_back=True)) as env:
        act = Pilot(env.world)
        return DriveScore.of([drive(env, act, course=course) for course in layouts(LAYOUTS)])


def _row(name: str, score: DriveScore, knows: DriveScore) -> Row:
    share = score.speed / knows.speed
    return Row(
        f"{name}: collisions per 100 m of held-out courses",
        f"{score.per_100_m:.2f}",
        f"{counted(score)}; at {100 * share:.0f} % of the expert's speed",
        "< 3 at >= 50 % of its speed",
        score.per_100_m < 3.0 and share >= 0.5,
    )


def _ratio_row(vehicle: str, before: DriveScore, after: DriveScore) -> Row:
    """How many collisions are left, with the interval of a ratio of two counts.

    Given how many there are together, the later ones are binomial: J. Przyborowski and
    H. Wilenski, "Homogeneity of results in testing samples from Poisson series", Biometrika 1940.
    """
    together = before.collisions + after.collisions
    fair = after.metres / (before.metres + after.metres)
    shares = binomtest(after.collisions, together, fair).proportion_ci() if together else None
    low, high = (0.0, float("inf")) if shares is None else (_ratio(s, fair) for s in shares)
    ratio = after.per_100_m / before.per_100_m if before.collisions else float("nan")
    return Row(
        f"{vehicle}: collisions that are left after one round of corrections",
        f"{ratio:.2f}x",
        f"{low:.2f} to {high:.2f}, 95 % (conditional binomial)",
        "below 1, and its interval too",
        high < 1.0,
    )


def _ratio(share: float, fair: float) -> float:
    """The ratio of two rates from the share of the second in their sum."""
    return float("inf") if share >= 1.0 else share / (1.0 - share) * (1.0 - fair) / fair
