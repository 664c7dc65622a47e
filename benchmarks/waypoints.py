"""Zero-shot transfer of a waypoint policy to other vehicles and to other worlds.

The sources are trained once per seed and kept in `results/waypoints`; `SEEDS` sets the number of
seeds. All drives are on held-out courses.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import asdict, replace
from itertools import permutations
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, cast

import gymnasium as gym
import numpy as np
import tomlkit
from numpy.typing import NDArray

from benchmarks.driving import DriveResult, DriveScore, drive
from benchmarks.remote_drive import drive_remote
from benchmarks.row import Row, asked
from benchmarks.vehicles import counted
from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.cloning.clone import ShrunkFrames
from shapechanger.demos.cloning.learn import learn
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.dataset import Dataset, load_dataset, merged
from shapechanger.demos.drivers import DriverDecision, Pilot, record_steps
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.policy import load_policy
from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.robot import run_robot
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners.presets import LEARNERS
from shapechanger.vehicles.cameras.rectify import CanonicalView
from shapechanger.vehicles.cloning import CloningSettings, record_demonstrations
from shapechanger.vehicles.courses.course import FLOODED, HELD_OUT
from shapechanger.vehicles.envs import VehicleEnv, WaypointEnv
from shapechanger.vehicles.envs.demonstrators import CLONES, waypoint_demonstrator
from shapechanger.vehicles.remote.waypoints import RemoteWaypointEnv
from shapechanger.vehicles.waypoints import as_waypoints

VEHICLES: Final = ("car", "tank", "truck")
SEEDS: Final = 3
COURSES: Final = HELD_OUT[:17]  # Each has 30 m, so a policy drives 510 m.
OUT: Final = Path("results", "waypoints")


class Source(NamedTuple):
    """Demonstrations of a source policy.

    Attributes:
        vehicle: Its vehicle.
        worlds: Its worlds; each gives an equal share of the six minutes.
        randomise: Whether light, textures and the camera's pose are drawn for each episode.
        labels: "path" for points on the path of the expert, which drives by waypoints. If the
            expert drives by steering and throttle: "steering" for the waypoint that these lead to,
            or "path nearby" for points on the path.
    """

    vehicle: str
    worlds: tuple[str, ...] = ("corridor",)
    randomise: bool = False
    labels: Literal["path", "steering", "path nearby"] = "path"


SOURCES: Final = {
    **{vehicle: Source(vehicle) for vehicle in VEHICLES},
    "boat": Source("boat", (FLOODED,)),
    "yard-truck": Source("truck", ("yard",)),
    "yard-random-truck": Source("truck", ("yard",), randomise=True),
    "mixed-truck": Source("truck", ("yard", "corridor")),
    "harbour-boat": Source("boat", ("harbour",)),
    "harbour-random-boat": Source("boat", ("harbour",), randomise=True),
    "mixed-boat": Source("boat", ("harbour", FLOODED)),
}
OWN: Final = tuple(list(SOURCES)[:4])  # Sources that have the name of their vehicle.
# Sources that are taught, at least in part, in other worlds than their targets.
ACROSS: Final = tuple(list(SOURCES)[4:])
# Two clones of the same images, whose labels differ.
BY_STEERING: Final = {
    "car-by-its-steering": Source("car", labels="steering"),
    "car-by-the-path": Source("car", labels="path nearby"),
}
# Keys of a profile's camera. The lab-car's looks level and sees 48.8 degrees, in 160 x 120 pixels.
CAMERAS: Final[dict[str, dict[str, Any]]] = {
    "70 degrees, 8 down": {"pitch_deg": 8.0, "fovy_deg": 70.0},
    "module 3, 2 down": {"pitch_deg": 2.0, "fovy_deg": 41.0, "size": [160, 90]},
}
# Shipped clones, which were trained in the corridor, and the vehicles that they drive.
STEERED: Final = (("car", "tank"), ("tank", "car"))
STEERED_COURSES: Final = COURSES[:6]
# Limit of collisions per 100 m, and number of the six pairs that should not exceed it.
FEW: Final = 4.0
GOOD: Final = 4


def pairs() -> list[Row]:
    """Measure each land vehicle's policy in all three, and two steering clones, in the corridor."""
    found = _measure([*permutations(VEHICLES, 2), *((one, one) for one in VEHICLES)])
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        by_steering = dict(zip(STEERED, pool.map(_steered, STEERED), strict=True))
    few = [
        _score(drives).per_100_m <= FEW
        for (source, target), drives in found.items()
        if source != target
    ]
    rows = [_row(pair, drives) for pair, drives in found.items()]
    rows.append(
        Row(
            f"waypoints: pairs with at most {FEW:g} collisions per 100 m, zero-shot",
            f"{sum(few)} of {len(few)}",
            f"{len(_seeds())} seeds, six minutes of a source's driving each",
            f">= {GOOD}",
            sum(few) >= GOOD,
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


def worlds() -> list[Row]:
    """Measure pairs with the boat, and sources that were taught in other worlds.

    Targets drive in the corridor, the boat in the flooded corridor. `ONLY` names pairs, such as
    `yard-truck-to-car`.
    """
    land = [(source, target) for source in ACROSS for target in VEHICLES]
    boats = [
        ("boat", "boat"),
        *(pair for land in VEHICLES for pair in (("boat", land), (land, "boat"))),
    ]
    named = {f"{source}-to-{target}": (source, target) for source, target in (*boats, *land)}
    wanted = [named[one] for one in asked("pair", named)]
    return [_row(pair, drives) for pair, drives in _measure(wanted).items()]


def labels() -> list[Row]:
    """Compare clones of a driver's own steering with clones of the path, on equal images.

    The driver is the expert, which drives the whole robot of a car by steering and throttle.
    """
    OUT.mkdir(parents=True, exist_ok=True)
    use_one_thread()
    for seed in _seeds():
        _record(seed)
    found = _measure([(source, target) for target in ("car", "tank") for source in BY_STEERING])
    return [_row(pair, drives) for pair, drives in found.items()]


def _seeds() -> range:
    return range(int(os.environ.get("SEEDS", SEEDS)))


def _measure(
    crossings: Sequence[tuple[str, str]],
) -> dict[tuple[str, str], list[list[DriveResult]]]:
    """Train the sources of pairs, and drive them in their targets; cache both.

    Returns:
        For each pair, the drives of each seed.
    """
    OUT.mkdir(parents=True, exist_ok=True)
    seeds = _seeds()
    trained = [(source, seed) for source in dict(crossings) for seed in seeds]
    jobs = [(source, target, seed, False) for source, target in crossings for seed in seeds]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for _ in pool.map(_train, trained):
            pass
        drives = list(pool.map(_driven, jobs))
    n = len(seeds)
    return {pair: drives[n * i : n * (i + 1)] for i, pair in enumerate(crossings)}


def _score(by_seed: list[list[DriveResult]]) -> DriveScore:
    return DriveScore.of([one for each in by_seed for one in each])


def _row(pair: tuple[str, str], drives: list[list[DriveResult]]) -> Row:
    source, target = pair
    score = _score(drives)
    by_seed = ", ".join(f"{DriveScore.of(each).per_100_m:.1f}" for each in drives)
    return Row(
        f"waypoints, {source} to {target}: collisions per 100 m, zero-shot",
        f"{score.per_100_m:.1f}",
        f"{counted(score)}; {score.speed:.2f} m/s; by seed {by_seed}",
        "none for a single pair",
        True,
    )


def whole_robot() -> list[Row]:
    """Compare drives in the env that leaves the robot out with drives of the whole robot.

    Each source drives its own vehicle, along the same courses from the same starts. `SEEDS` is 1 by
    default, and `ONLY` names sources.
    """
    OUT.mkdir(parents=True, exist_ok=True)
    names = asked("source", OWN)
    seeds = range(int(os.environ.get("SEEDS", "1")))
    jobs = [
        (name, name, seed, whole) for name in names for whole in (False, True) for seed in seeds
    ]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for _ in pool.map(_train, [(name, seed) for name in names for seed in seeds]):
            pass
        drives = list(pool.map(_driven, jobs))
    rows: list[Row] = []
    for i, name in enumerate(names):
        first = 2 * i * len(seeds)
        without, whole = (
            _score(drives[at : at + len(seeds)]) for at in (first, first + len(seeds))
        )
        agree = without.low <= whole.per_100_m <= without.high
        agree |= whole.low <= without.per_100_m <= whole.high
        rows.append(
            Row(
                f"waypoints, {name} in the whole robot: collisions per 100 m",
                f"{whole.per_100_m:.1f}",
                f"{counted(whole)}; {whole.speed:.2f} m/s; without the robot "
                f"{without.per_100_m:.1f}, {counted(without)}; {without.speed:.2f} m/s",
                "one rate inside the other's interval",
                agree,
            )
        )
    return rows


def cameras() -> list[Row]:
    """Compare drives of the car's clone with other cameras and with the camera of its training.

    The images are rectified by the profile of each camera. Drives are along the same courses from
    the same starts. `SEEDS` is 1 by default.
    """
    OUT.mkdir(parents=True, exist_ok=True)
    seeds = range(int(os.environ.get("SEEDS", "1")))
    jobs = [(camera, seed) for camera in ("training", *CAMERAS) for seed in seeds]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for _ in pool.map(_train, [("car", seed) for seed in seeds]):
            pass
        drives = list(pool.map(_seen, jobs))
    scores = {
        camera: _score(drives[i * len(seeds) : (i + 1) * len(seeds)])
        for i, camera in enumerate(("training", *CAMERAS))
    }
    known = scores["training"]
    return [
        Row(
            f"waypoints, car behind the camera of {camera}: collisions per 100 m",
            f"{score.per_100_m:.1f}",
            f"{counted(score)}; {score.speed:.2f} m/s",
            f"in the interval of the training's, {known.low:.2f} to {known.high:.2f}",
            known.low <= score.per_100_m <= known.high,
        )
        for camera, score in scores.items()
    ]


def _seen(job: tuple[str, int]) -> list[DriveResult]:
    """Drive the car's clone with a camera; cache the drives."""
    camera, seed = job
    use_one_thread()
    kept = OUT / f"car-{camera.replace(',', '').replace(' ', '-')}-{seed}.json"
    if kept.exists():
        return [DriveResult(**one) for one in json.loads(kept.read_bytes())]
    robot = find_profile("lab-car")
    if camera in CAMERAS:
        stated = tomlkit.parse(robot.read_text(encoding="utf-8"))
        cast("Any", stated["camera"]).update(CAMERAS[camera])
        robot = kept.with_suffix(".toml")
        robot.write_text(tomlkit.dumps(stated), encoding="utf-8")
    policy = taught_source("car", seed)
    with closing(WaypointEnv("car", robot=robot, courses="held-out", put_back=True)) as env:
        drives = [drive(env, policy.predict, course=course) for course in COURSES]
    kept.write_text(json.dumps([asdict(one) for one in drives]), encoding="utf-8")
    return drives


def remote() -> list[Row]:
    """Drive a car with a clone of the tank through guard, daemon and link, on the twin's clock."""
    OUT.mkdir(parents=True, exist_ok=True)
    policy = taught_source("tank", 0)
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
    policy = load_policy(CLONES[source])
    with closing(VehicleEnv(target, courses="held-out", put_back=True)) as env:
        drives = [drive(env, policy.predict, course=course) for course in STEERED_COURSES]
    kept.write_text(json.dumps([asdict(one) for one in drives]), encoding="utf-8")
    return drives


def _train(job: tuple[str, int]) -> None:
    use_one_thread()
    taught_source(*job)


def _driven(job: tuple[str, str, int, bool]) -> list[DriveResult]:
    """Drive a source's policy in a target, or in its whole robot; cache the drives."""
    source, target, seed, whole = job
    use_one_thread()
    kept = OUT / f"{source}-to-{target}-{seed}{'-whole' if whole else ''}.json"
    if kept.exists():
        return [DriveResult(**one) for one in json.loads(kept.read_bytes())]
    policy = taught_source(source, seed)
    with closing(WaypointEnv(target, sensed=whole, courses="held-out", put_back=True)) as env:
        drives = [drive(env, policy.predict, course=course) for course in COURSES]
    kept.write_text(json.dumps([asdict(one) for one in drives]), encoding="utf-8")
    return drives


def taught_source(name: str, seed: int) -> CameraPolicy:
    """Clone the demonstrations of a source; each of its worlds has an equal share of them.

    Args:
        name: Name of the source in `SOURCES` or `BY_STEERING`.
        seed: Seed of the demonstrations and the training; the policy is kept.
    """
    path = OUT / f"{name}-{seed}.safetensors"
    if path.exists():
        return load_policy(path)
    source = SOURCES.get(name) or BY_STEERING[name]
    settings = cast("CloningSettings", LEARNERS["waypoint"])
    if source.labels != "path":
        data = _labelled(seed, source.labels)
        policy, _ = learn(data, settings=settings.clone, head="regression", seed=seed)
        policy.save(path)
        return policy
    env_id = f"shapechanger/{source.vehicle.capitalize()}Waypoint-v1"
    envs = [
        EnvRef(env_id, {"put_back": True, "world": world, "randomise": source.randomise})
        for world in source.worlds
    ]
    steps = settings.steps // len(envs)
    shown = [
        record_demonstrations(env, steps, settings.episode_steps, seed, settings.clone.framing)
        for env in envs
    ]
    data = merged([replace(part, states=None, state_layout=None) for part in shown])
    start = CameraPolicy.fresh(settings.clone, seed, data.action_layout)
    policy, _ = learn(data, settings=settings.clone, seed=seed, start=start, symmetric=True)
    policy.save(path)
    return policy


class _Watched(Pilot):
    """Expert that drives by steering, and reports the waypoints on its path.

    Args:
        env: The env of the vehicle.
        seed: Seed of the mistakes.

    Attributes:
        waypoints: The waypoint at each step.
    """

    def __init__(self, env: VehicleEnv, seed: int) -> None:
        super().__init__(env, None, env.demonstrator(seed))
        self._path = waypoint_demonstrator(env.world, seed)
        self.waypoints: list[NDArray[np.float32]] = []

    def begin(self) -> None:
        super().begin()
        self._path.begin()

    def decide(self, observation: Any) -> DriverDecision:
        self.waypoints.append(self._path.act()[0])
        return super().decide(observation)


def _record(seed: int) -> Path:
    """Record six minutes of a car by steering and throttle, and the path's waypoints."""
    folder = OUT / f"car-by-steering-{seed}"
    waypoints = folder.with_suffix(".npy")
    if waypoints.exists():
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    settings = cast("CloningSettings", LEARNERS["waypoint"])
    env = gym.make(
        "shapechanger/Car-v1", state=True, put_back=True, max_episode_steps=settings.episode_steps
    )
    with closing(env):
        pilot = _Watched(cast("VehicleEnv", env.unwrapped), seed)
        # Each episode takes the next seed.
        record_steps(RecordEpisodes(env, folder), pilot, settings.steps, 1000 * seed)
    np.save(waypoints, np.stack(pilot.waypoints))
    return folder


def _labelled(seed: int, labels: str) -> Dataset:
    """Return the recording of a seed with labels of one kind."""
    folder = _record(seed)
    framing = cast("CloningSettings", LEARNERS["waypoint"]).clone.framing
    shown = as_waypoints(load_dataset(folder, shrink=ShrunkFrames(framing, CanonicalView())))
    if labels == "steering":
        return shown.data
    return replace(shown.data, actions=np.load(folder.with_suffix(".npy"))[shown.kept])
