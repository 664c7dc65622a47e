"""How often a car's teacher, which senses distances, stands for good at starts off the lane.

`SEEDS` teachers are trained with the preset of `CarRanges` and kept in `results/standing`.
All starts are on held-out courses.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from multiprocessing import get_context
from pathlib import Path
from typing import Final, NamedTuple, cast

import numpy as np
from scipy.stats import binomtest

from benchmarks.row import Row
from shapechanger.contract.env_ref import EnvRef
from shapechanger.contract.world import Pose
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners import ignore
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.presets import LEARNERS
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import PpoSettings
from shapechanger.vehicles.courses.course import HELD_OUT
from shapechanger.vehicles.envs import RangesEnv
from shapechanger.vehicles.envs.ranges import observe_ranges

OUT: Final = Path("results", "standing")
SEEDS: Final = 3
STARTS: Final = 100
# Largest offsets of a start from the lane: of the position along each axis, m, and of the heading.
ASIDE_M: Final = 0.3
TURNED_RAD: Final = 1.2
STEPS: Final = 160
# A vehicle stands for good if it has stood for this many steps at the end.
FOR_GOOD: Final = 80
PROGRESS_M: Final = 0.5


class Starts(NamedTuple):
    """Result of the starts of one teacher.

    Attributes:
        stood: Number of starts after which the vehicle stood for good.
        stayed: Number of starts with less than 0.5 m of progress in the last 4 s.
        share: Share of all steps in which the vehicle stood.
        metres: Total progress, m.
        collisions: Number of collisions.
    """

    stood: int
    stayed: int
    share: float
    metres: float
    collisions: int


def teachers() -> list[Row]:
    """Evaluate teachers from starts off the lane and turned away from it, as after a mistake."""
    seeds = range(int(os.environ.get("SEEDS", SEEDS)))
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        found = list(pool.map(_judged, seeds))
    return [_row(seed, one) for seed, one in zip(seeds, found, strict=True)]


def _row(seed: int, found: Starts) -> Row:
    interval = binomtest(found.stood, STARTS).proportion_ci()
    return Row(
        f"teacher of the car, seed {seed}: starts off the lane at which it stands for good",
        f"{found.stood} of {STARTS}",
        f"{100 * interval.low:.1f} to {100 * interval.high:.1f} %, 95 % (Clopper-Pearson); it "
        f"stood in {100 * found.share:.1f} % of the steps, and came less than {PROGRESS_M} m far "
        f"in the last {FOR_GOOD / 20:.0f} s at {found.stayed} starts; {found.collisions} "
        f"collisions in {found.metres:.0f} m",
        "0",
        found.stood == 0,
    )


def _judged(seed: int) -> Starts:
    use_one_thread()
    act = _taught(seed).act
    stood = stayed = steps = collisions = 0
    metres = 0.0
    with closing(RangesEnv("car", courses=HELD_OUT[:50], put_back=True)) as env:
        for _ in _starts(env):
            stands, passed_m = 0, 0.0
            for step in range(STEPS):
                command = act(observe_ranges(env.world)[None])[0]
                *_, info = env.step(command)
                stands = stands + 1 if info["standing"] else 0
                steps += info["standing"]
                if step == STEPS - FOR_GOOD:
                    passed_m = info["progress"]
            stood += stands >= FOR_GOOD
            stayed += info["progress"] - passed_m < PROGRESS_M
            metres += info["progress"]
            collisions += info["collisions"]
    return Starts(stood, stayed, steps / (STARTS * STEPS), metres, collisions)


def _starts(env: RangesEnv) -> Iterator[None]:
    """Put the car at each start."""
    rng = np.random.default_rng(1)
    world = env.world
    for seed in range(STARTS):
        env.reset(seed=seed)
        lane = world.pose
        while True:
            x, y = rng.uniform(-ASIDE_M, ASIDE_M, 2)
            turned = rng.uniform(-TURNED_RAD, TURNED_RAD)
            world.put(Pose(lane.x + x, lane.y + y, math.remainder(lane.heading + turned, math.tau)))
            world.advance(0.02, {})  # Finds contacts.
            if not world.touches:
                break
        yield


def _taught(seed: int) -> TrainedPolicy:
    """Train a teacher, or load it."""
    OUT.mkdir(parents=True, exist_ok=True)
    path = OUT / f"teacher-{seed}.safetensors"
    if not path.exists():
        settings = cast("PpoSettings", LEARNERS["ppo-drive"])
        policy = Sb3Learner("ppo-drive", settings).train(
            EnvRef("shapechanger/CarRanges-v1"), settings.steps, seed, on_evaluation=ignore
        )
        save_policy(policy, path)
    return load_policy(path)
