"""How well somebody drives: how far it came, in what time, and how often it ran into something."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from shapechanger.envs.vehicle.env import VehicleEnv
from shapechanger.errors import WorldError

__all__ = ["LIMIT_S", "METRES", "Act", "DriveResult", "DriveScore", "drive", "poisson_interval"]

Act = Callable[[Any], NDArray[np.float32]]
"""A driver: from an observation to an action."""

METRES: Final = 30.0
"""Length of a drive, m."""

LIMIT_S: Final = 120.0
"""Longest time for it, s; a tank at a quarter of its top speed gets there."""

_PER_M: Final = 100.0  # Collisions are told per 100 m.


@dataclass(frozen=True, slots=True)
class DriveResult:
    """What came of one drive.

    Attributes:
        course: Seed of the course.
        metres: Net progress along the course, m; driving backward counts down.
        seconds: How long it took, in the vehicle's time, s.
        collisions: How many times it ran into something.
        reached: Whether it came as far as it was to.
    """

    course: int
    metres: float
    seconds: float
    collisions: int
    reached: bool

    @property
    def speed(self) -> float:
        """Mean net speed along the course, m/s."""
        return self.metres / self.seconds


def drive(
    env: VehicleEnv,
    act: Act,
    *,
    course: int,
    start: int | None = None,
    metres: float = METRES,
    limit_s: float = LIMIT_S,
) -> DriveResult:
    """Let somebody drive along one course.

    A vehicle that runs into something is put back on the lane and goes on.

    Args:
        env: The vehicle, made with `put_back=True`.
        act: Who drives.
        course: Seed of the course.
        start: Seed of the start on it; None for that of the course.
        metres: How far to drive, net along the course, m.
        limit_s: When to give up, s.

    Raises:
        WorldError: If a collision ended the drive, because the env puts nothing back.
    """
    seen, info = env.reset(options={"course": course, "start": course if start is None else start})
    period_s = 1.0 / env.metadata["render_fps"]
    steps = 0
    while info["progress"] < metres and steps * period_s < limit_s:
        seen, _, terminated, _, info = env.step(act(seen))
        steps += 1
        if terminated:
            raise WorldError(
                f"The drive along course {course} ended at its first collision: make the env with "
                "put_back=True."
            )
    came = float(info["progress"])
    return DriveResult(course, came, steps * period_s, int(info["collisions"]), came >= metres)


@dataclass(frozen=True, slots=True)
class DriveScore:
    """Some drives in a few numbers.

    Attributes:
        drives: How many.
        metres: Net progress of all of them, m.
        speed: Mean speed, all metres over all seconds, m/s.
        slowest: Mean speed of the slowest drive, m/s.
        fastest: Mean speed of the fastest drive, m/s.
        collisions: Of all of them.
        per_100_m: Collisions per 100 m of net progress; infinite without any progress.
        low: Lower bound of the collisions per 100 m, with 95 % confidence.
        high: Upper bound of them.
        reached: Share of drives that came as far as they were to.
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

    @classmethod
    def of(cls, drives: Sequence[DriveResult]) -> DriveScore:
        """The score of some drives.

        Raises:
            WorldError: If there are none.
        """
        if not drives:
            raise WorldError("There is no drive to score: give at least one.")
        metres = sum(drive.metres for drive in drives)
        collisions = sum(drive.collisions for drive in drives)
        speeds = [drive.speed for drive in drives]
        # Whoever got nowhere gave a collision no metres to be counted by.
        scale = _PER_M / metres if metres > 0.0 else float("inf")
        low, high = poisson_interval(collisions)
        return cls(
            drives=len(drives),
            metres=metres,
            speed=metres / sum(drive.seconds for drive in drives),
            slowest=min(speeds),
            fastest=max(speeds),
            collisions=collisions,
            per_100_m=scale * collisions if collisions else 0.0,
            low=scale * low if low else 0.0,
            high=scale * high,
            reached=sum(drive.reached for drive in drives) / len(drives),
        )


def poisson_interval(count: int, confidence: float = 0.95) -> tuple[float, float]:
    """The exact interval of a mean of which one count is known.

    F. Garwood, "Fiducial limits for the Poisson distribution", Biometrika 28 (1936), by quantiles
    of the chi-squared distribution. It holds where collisions do not bring each other about, for
    which a vehicle is put back after each.

    Args:
        count: What was counted, >= 0.
        confidence: How often the interval holds the mean, at least.
    """
    rest = (1.0 - confidence) / 2.0
    low = float(chi2.ppf(rest, 2 * count)) / 2.0 if count else 0.0
    return low, float(chi2.ppf(1.0 - rest, 2 * count + 2)) / 2.0
