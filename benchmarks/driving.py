"""Evaluate driving: distance, time and collisions on given courses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from shapechanger.errors import WorldError

Act = Callable[[Any], NDArray[np.float32]]
"""A driver: maps an observation to an action."""

METRES: Final = 30.0
"""Length of a drive, m."""

LIMIT_S: Final = 120.0
"""Time limit of a drive, s, in which a tank drives 30 m at a quarter of its top speed."""

_PER_M: Final = 100.0  # Collisions are reported per 100 m.


@dataclass(frozen=True, slots=True)
class DriveResult:
    """Result of one drive.

    Attributes:
        course: Seed of the course.
        metres: Net progress along the course, m; driving backward subtracts.
        seconds: Duration in the vehicle's time, s.
        collisions: Number of collisions.
        reached: Whether the vehicle reached the required distance.
        standing: Share of the time in which the vehicle stood still.
    """

    course: int
    metres: float
    seconds: float
    collisions: int
    reached: bool
    standing: float = 0.0

    @property
    def speed(self) -> float:
        """Mean net speed along the course, m/s."""
        return self.metres / self.seconds


def drive(
    env: gym.Env[Any, Any],
    act: Act,
    *,
    course: int,
    start: int | None = None,
    metres: float = METRES,
    limit_s: float = LIMIT_S,
) -> DriveResult:
    """Drive along one course.

    After a collision the vehicle is put back on the lane and goes on.

    Args:
        env: The vehicle, made with `put_back=True`.
        act: The driver.
        course: Seed of the course.
        start: Seed of the start; None for the seed of the course.
        metres: Required net progress along the course, m.
        limit_s: Time limit, s.

    Raises:
        WorldError: If a collision ended the drive, because the env does not put the vehicle back.
    """
    seen, info = env.reset(options={"course": course, "start": course if start is None else start})
    period_s = 1.0 / env.metadata["render_fps"]
    steps = stood = 0
    while info["progress"] < metres and steps * period_s < limit_s:
        seen, _, terminated, _, info = env.step(act(seen))
        steps += 1
        stood += bool(info.get("standing", False))
        if terminated:
            raise WorldError(
                f"The drive along course {course} ended at its first collision: make the env with "
                "put_back=True."
            )
    came = float(info["progress"])
    return DriveResult(
        course,
        came,
        steps * period_s,
        int(info["collisions"]),
        came >= metres,
        stood / max(steps, 1),
    )


@dataclass(frozen=True, slots=True)
class DriveScore:
    """Statistics of several drives.

    Attributes:
        drives: Number of drives.
        metres: Total net progress, m.
        speed: Mean speed, all metres divided by all seconds, m/s.
        slowest: Mean speed of the slowest drive, m/s.
        fastest: Mean speed of the fastest drive, m/s.
        collisions: Total number of collisions.
        per_100_m: Collisions per 100 m of net progress; infinite if it collided without progress.
        low: Lower bound of the collisions per 100 m, with 95 % confidence.
        high: Upper bound of the collisions per 100 m, with 95 % confidence.
        reached: Share of drives that reached the required distance.
        standing: Share of the time in which the vehicle stood still.
    """

    drives: int
    metres: float
    speed: float
    slowest: float
    fastest: float
    collisions: int
    per_100_m: float
    low: float
    high: float
    reached: float
    standing: float

    @classmethod
    def of(cls, drives: Sequence[DriveResult]) -> DriveScore:
        """Summarise drives.

        Raises:
            WorldError: If there are no drives.
        """
        if not drives:
            raise WorldError("There is no drive to score: give at least one.")
        metres = sum(drive.metres for drive in drives)
        collisions = sum(drive.collisions for drive in drives)
        seconds = sum(drive.seconds for drive in drives)
        speeds = [drive.speed for drive in drives]
        # Without progress, the rate of collisions is infinite.
        scale = _PER_M / metres if metres > 0.0 else float("inf")
        low, high = poisson_interval(collisions)
        return cls(
            drives=len(drives),
            metres=metres,
            speed=metres / seconds,
            slowest=min(speeds),
            fastest=max(speeds),
            collisions=collisions,
            per_100_m=scale * collisions if collisions else 0.0,
            low=scale * low if low else 0.0,
            high=scale * high,
            reached=sum(drive.reached for drive in drives) / len(drives),
            standing=sum(drive.standing * drive.seconds for drive in drives) / seconds,
        )


def poisson_interval(count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the exact confidence interval of a Poisson mean, given one count.

    F. Garwood, "Fiducial limits for the Poisson distribution", Biometrika 28 (1936), by quantiles
    of the chi-squared distribution. It assumes that collisions are independent, which
    is why a vehicle is put back after each.

    Args:
        count: The count, >= 0.
        confidence: Least probability that the interval contains the mean.
    """
    rest = (1.0 - confidence) / 2.0
    low = float(chi2.ppf(rest, 2 * count)) / 2.0 if count else 0.0
    return low, float(chi2.ppf(1.0 - rest, 2 * count + 2)) / 2.0
