"""Zero-shot transfer of a waypoint policy to other vehicles.

The sources are trained once per seed and kept in `results/waypoints`; `SEEDS` sets the number of
seeds. All drives are on held-out courses.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import asdict
from itertools import permutations
from multiprocessing import get_context
from pathlib import Path
from typing import Final, cast

from benchmarks.remote_drive import drive_remote
from benchmarks.row import Row
from benchmarks.vehicles import counted
from shapechanger.demos.cloning.learn import clone
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.envs.remote.waypoints import RemoteWaypointEnv
from shapechanger.envs.vehicle import VehicleEnv, WaypointEnv
from shapechanger.envs.vehicle.drivers import CLONES
from shapechanger.envs.vehicle.evaluation import DriveResult, DriveScore, drive
from shapechanger.robot.profile.load import find_profile
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.learners.cloning import record_demonstrations, state_actions
from shapechanger.transfer.learners.sb3 import use_one_thread
from shapechanger.transfer.learners.settings import LEARNERS, CloningSettings
from shapechanger.twin.robot import run_robot
from shapechanger.worlds.course import HELD_OUT

VEHICLES: Final = ("car", "tank", "truck")
SEEDS: Final = 3
COURSES: Final = HELD_OUT[:17]  # Of 30 m: 510 m for each drive.
OUT: Final = Path("results", "waypoints")
# Both clones were trained in the corridor.
STEERED: Final = (("car", "tank"), ("tank", "car"))
STEERED_COURSES: Final = COURSES[:6]
# Limit of collisions per 100 m, and number of the six pairs that should stay below it.
FEW: Final = 4.0
GOOD: Final = 4


def pairs() -> list[Row]:
    """Measure the six ordered pairs of land vehicles, all in the corridor."""
    OUT.mkdir(parents=True, exist_ok=True)
    seeds = range(int(os.environ.get("SEEDS", SEEDS)))
    jobs = [(vehicle, seed) for seed in seeds for vehicle in VEHICLES]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        found = dict(zip(jobs, pool.map(_driven, jobs), strict=True))
        by_steering = dict(zip(STEERED, pool.map(_steered, STEERED), strict=True))
    rows: list[Row] = []
    good = 0
    own = [(vehicle, vehicle) for vehicle in VEHICLES]
    for source, target in (*permutations(VEHICLES, 2), *own):
        each = [DriveScore.of(found[source, seed][target]) for seed in seeds]
        score = DriveScore.of([one for seed in seeds for one in found[source, seed][target]])
        good += source != target and score.per_100_m <= FEW
        by_seed = ", ".join(f"{one.per_100_m:.1f}" for one in each)
        rows.append(
            Row(
                f"waypoints, {source} to {target}: collisions per 100 m, zero-shot",
                f"{score.per_100_m:.1f}",
                f"{counted(score)}; {score.speed:.2f} m/s; by seed {by_seed}",
                "none for a single pair",
                True,
            )
        )
    rows.append(
        Row(
            f"waypoints: pairs with at most {FEW:g} collisions per 100 m, zero-shot",
            f"{good} of 6",
            f"{len(seeds)} seeds, six minutes of a source's driving each",
            f">= {GOOD}",
            good >= GOOD,
        )
    )
    for (source, target), drives in by_steering.items():
        score = DriveScore.of(drives)
        rows.append(
            Row(
                f"steering, {source} to {target}: collisions per 100 m, zero-shot",
                f"{score.per_100_m:.1f}",
                f"{counted(score)}; {score.speed:.2f} m/s; the shipped clone of ten minutes",
                "none: what waypoints are compared with",
                True,
            )
        )
    return rows


def remote() -> list[Row]:
    """A clone of the tank drives a car behind guard, daemon and link, on the twin's clock."""
    OUT.mkdir(parents=True, exist_ok=True)
    policy = _source("tank", 0)
    drives = [_served("car", policy, course) for course in COURSES[:10]]
    score = DriveScore.of(drives)
    return [
        Row(
            "waypoints, tank to a car on the network: collisions per 100 m, zero-shot",
            f"{score.per_100_m:.1f}",
            f"{counted(score)}; {score.speed:.2f} m/s; the car measures its response before each "
            "drive",
            f"<= {FEW:g}",
            score.per_100_m <= FEW,
        )
    ]


def _served(vehicle: str, policy: CameraPolicy, course: int) -> DriveResult:
    """Drive a robot that was started on this course."""
    profile = find_profile(f"lab-{vehicle}")
    with run_robot(profile, clock="twin", seed=course, arguments=("--world", "corridor")) as robot:
        known = robot.known
        with robot.operator() as operator:
            env = RemoteWaypointEnv(
                known.address,
                key=known.key,
                fingerprint=known.fingerprint,
                pace="lockstep",
                reward={"collision_ends_episode": 0.0},
                on_reset=lambda seed: operator.place(course if seed is None else seed),
            )
            with closing(env):
                return drive_remote(env, operator, policy.predict, course=course)


def _steered(pair: tuple[str, str]) -> list[DriveResult]:
    """Drive a vehicle with the shipped clone of another one, which predicts steering."""
    source, target = pair
    use_one_thread()
    kept = OUT / f"steering-{source}-{target}.json"
    if kept.exists():
        return [DriveResult(**one) for one in json.loads(kept.read_bytes())]
    policy = CameraPolicy.load(CLONES[source])
    with closing(VehicleEnv(target, courses="held-out", put_back=True)) as env:
        drives = [drive(env, policy.predict, course=course) for course in STEERED_COURSES]
    kept.write_text(json.dumps([asdict(one) for one in drives]), encoding="utf-8")
    return drives


def _driven(job: tuple[str, int]) -> dict[str, list[DriveResult]]:
    """Train a source and drive it in all vehicles; cache both."""
    vehicle, seed = job
    use_one_thread()
    kept = OUT / f"{vehicle}-{seed}.json"
    if kept.exists():
        drives = json.loads(kept.read_bytes())
        return {name: [DriveResult(**one) for one in each] for name, each in drives.items()}
    policy = _source(vehicle, seed)
    results: dict[str, list[DriveResult]] = {}
    for target in VEHICLES:
        with closing(WaypointEnv(target, courses="held-out", put_back=True)) as env:
            results[target] = [drive(env, policy.predict, course=course) for course in COURSES]
    plain = {name: [asdict(one) for one in each] for name, each in results.items()}
    kept.write_text(json.dumps(plain), encoding="utf-8")
    return results


def _source(vehicle: str, seed: int) -> CameraPolicy:
    path = OUT / f"{vehicle}-{seed}.safetensors"
    if path.exists():
        return CameraPolicy.load(path)
    settings = cast("CloningSettings", LEARNERS["waypoint"])
    env = EnvRef(f"shapechanger/{vehicle.capitalize()}Waypoint-v1", {"put_back": True})
    shown = record_demonstrations(
        env, settings.steps, settings.episode_steps, seed, settings.clone.framing
    )
    policy, _ = clone(
        shown.pictures, shown.actions, settings=settings.clone, seed=seed, episodes=shown.episodes
    )
    policy = state_actions(policy, env)
    policy.save(path)
    return policy
