"""Accuracy of a controller that has a model of the finger: reaching points, following a circle."""

from __future__ import annotations

import os
from typing import Any, Final

import gymnasium as gym
import numpy as np

from benchmarks.row import Row
from shapechanger.finger.controller import FingerController
from shapechanger.finger.tensions import DRIVES

TARGETS: Final = 1000
# First seed of the evaluation, larger than all seeds used for tuning.
FIRST_SEED: Final = 1_000_000
_TRACKS: Final = 5


def oracle() -> list[Row]:
    """Measure reaching in each action mode, and following a circle of 12 mm."""
    targets = int(os.environ.get("TRIALS", TARGETS))
    rows: list[Row] = []
    for mode in DRIVES:
        successes, distances = reached(mode, targets)
        share, median = float(np.mean(successes)), 1e3 * float(np.median(distances))
        rows.append(
            Row(
                f"controller that knows the finger, {mode}: targets reached within 5 mm",
                f"{share:.1%} of {targets}",
                f"median error {median:.2g} mm, largest {1e3 * max(distances):.2g} mm",
                "99 %, median under 0.1 mm",
                share >= 0.99 and median < 0.1,
            )
        )
    for hz, limit in ((0.5, None), (1.0, 3.0)):
        errors = [tracked_mm(hz, FIRST_SEED + i) for i in range(_TRACKS)]
        worst = max(errors)
        rows.append(
            Row(
                f"the same, circle of 12 mm at {hz:g} Hz, impedance",
                f"{np.mean(errors):.2f} mm RMS",
                f"{min(errors):.2f} to {worst:.2f} mm in {_TRACKS} episodes",
                "none: a reference" if limit is None else f"< {limit:g} mm",
                limit is None or worst < limit,
            )
        )
    return rows


def reached(mode: str, targets: int, **arguments: Any) -> tuple[list[bool], list[float]]:
    """Return whether each target was reached, and the final distance of the fingertip, m."""
    successes: list[bool] = []
    distances: list[float] = []
    with gym.make("shapechanger/Finger-v1", actions=mode, **arguments) as env:
        inner: Any = env.unwrapped
        act = FingerController(inner.observation_layout, mode)
        for i in range(targets):
            observation, info = env.reset(seed=FIRST_SEED + i)
            act.reset()
            ended = False
            while not ended:
                observation, _, terminated, ended, info = env.step(act(observation))
                ended = terminated or ended
            successes.append(bool(info["is_success"]))
            distances.append(float(info["distance"]))
    return successes, distances


def tracked_mm(hz: float, seed: int) -> float:
    """Return the root mean square error on a circle of 12 mm, mm."""
    path = {"kind": "circle", "radius": 0.012, "hz": hz}
    with gym.make("shapechanger/FingerTrack-v1", path=path) as env:
        inner: Any = env.unwrapped
        act = FingerController(inner.observation_layout)
        observation, info = env.reset(seed=seed)
        ended = False
        while not ended:
            observation, _, terminated, ended, info = env.step(act(observation))
            ended = terminated or ended
    return 1e3 * float(info["rms"])
