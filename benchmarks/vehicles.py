"""Speed of the vehicles' envs, and driving of the expert, of clones, and of teachers and students.

All drives are on held-out courses.
"""

from __future__ import annotations

import os
import statistics
import time
from contextlib import closing
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import gymnasium as gym
import mujoco

from benchmarks.clones import blind, find_clone, sighted
from benchmarks.driving import LIMIT_S, METRES, Act, DriveScore, drive
from benchmarks.row import Row, asked
from shapechanger.cli.train import Train
from shapechanger.policy import load_policy
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.vehicles.bodies import VEHICLES
from shapechanger.vehicles.courses.course import HELD_OUT
from shapechanger.vehicles.envs import RangesEnv, VehicleEnv

EXPERT_LAYOUTS: Final = 50
CLONE_LAYOUTS: Final = 20
STUDENT_LAYOUTS: Final = 17  # 510 m.
STUDENT_SEEDS: Final = 3
EXPERT_MPS: Final = 1.88  # In benchmarks/results/vehicles-expert.json.
# Time limit for blind vehicles, which make little progress.
BLIND_S: Final = 60.0

ROUNDS: Final = 15
STEPS: Final = 60  # Per round.


def layouts(usual: int) -> range:
    """Return the courses to drive: `usual` of them, or `LAYOUTS` if set."""
    return HELD_OUT[: int(os.environ.get("LAYOUTS", usual))]


def frames() -> list[Row]:
    """Measure steps per second of each vehicle, with an image in each step."""
    return [_frames_row(vehicle) for vehicle in ("car", *sorted(set(VEHICLES) - {"car"}))]


def _frames_row(vehicle: str) -> Row:
    """Measure the CPU time of all threads, with the graphics driver's and without the expert's."""
    rates: list[float] = []
    with gym.make(f"shapechanger/{vehicle.capitalize()}-v1", put_back=True) as env:
        inner: Any = env.unwrapped
        pilot = inner.expert()
        # All rounds are on one course, and resets are not timed.
        seen, _ = env.reset(seed=0, options={"course": HELD_OUT[0], "start": 0})
        spent = _spent_s(env, pilot, seen)  # The first round warms up.
        for _ in range(ROUNDS):
            seen, _ = env.reset(options={"course": HELD_OUT[0], "start": 0})
            spent = _spent_s(env, pilot, seen)
            rates.append(STEPS / spent)
    rate = statistics.median(rates)
    threads = os.environ.get("LP_NUM_THREADS", "not set")
    return Row(
        f"steps of {vehicle.capitalize()}-v1 with a picture of 160x120 each, one core",
        f"{rate:.0f} steps/s",
        f"{min(rates):.0f} to {max(rates):.0f} in {ROUNDS} rounds of {STEPS}; "
        f"LP_NUM_THREADS {threads}",
        ">= 120 steps/s" if vehicle == "car" else "none",
        vehicle != "car" or rate >= 120.0,
    )


def _spent_s(env: gym.Env[Any, Any], act: Act, seen: Any) -> float:
    spent = 0.0
    for _ in range(STEPS):
        action = act(seen)
        began = time.process_time()
        seen, *_ = env.step(action)
        spent += time.process_time() - began
    return spent


def fast() -> list[Row]:
    """Compare steps of the env with sensors, without images, with steps of the ranges env."""
    rows: list[Row] = []
    for vehicle in ("car", *sorted(set(VEHICLES) - {"car"})):
        with (
            closing(VehicleEnv(vehicle, image=False, put_back=True)) as robot,
            closing(RangesEnv(vehicle, put_back=True)) as ranges,
        ):
            ratios: list[float] = []
            for round_ in range(ROUNDS + 1):
                spent = [_round_s(env, round_) for env in (robot, ranges)]
                ratios.append(spent[0] / spent[1])
            share = statistics.median(_mujoco_share(ranges, start) for start in range(ROUNDS))
        ratio = statistics.median(ratios[1:])  # The first round warms up.
        rows.append(
            Row(
                f"{vehicle}: time of a step of {vehicle.capitalize()}-v1 without an image, in "
                f"steps of {vehicle.capitalize()}Ranges-v1, one core",
                f"{ratio:.1f}",
                f"{min(ratios[1:]):.1f} to {max(ratios[1:]):.1f} in {ROUNDS} rounds of {STEPS}; "
                f"MuJoCo's own steps are {100 * share:.0f} % of the time of the ranges env",
                "<= 2.5" if vehicle == "car" else "none",
                vehicle != "car" or ratio <= 2.5,
            )
        )
    return rows


def _mujoco_share(env: RangesEnv, start: int) -> float:
    """Return the share of MuJoCo's own steps in the time of a round."""
    step, own = mujoco.mj_step, 0.0

    def timed(*arguments: Any, **named: Any) -> None:
        nonlocal own
        began = time.thread_time()
        step(*arguments, **named)
        own += time.thread_time() - began

    with patch.object(mujoco, "mj_step", timed):
        spent = _round_s(env, start)
    return own / spent


def _round_s(env: VehicleEnv | RangesEnv, start: int) -> float:
    env.reset(options={"course": HELD_OUT[0], "start": start})
    pilot = env.expert()
    spent = 0.0
    for _ in range(STEPS):
        action = pilot(None)
        began = time.thread_time()
        env.step(action)
        spent += time.thread_time() - began
    return spent


def expert() -> list[Row]:
    """Score the expert, which knows the course; `ONLY` names vehicles."""
    rows: list[Row] = []
    for vehicle in asked("vehicle", VEHICLES):
        model = VEHICLES[vehicle]
        score = _expert_score(vehicle, layouts(EXPERT_LAYOUTS))
        share = score.speed / model.top_speed_mps
        rows += [
            Row(
                f"expert, {vehicle}: mean speed over top speed",
                f"{100 * share:.0f} %",
                f"{score.speed:.2f} m/s, drives from {score.slowest:.2f} to {score.fastest:.2f}; "
                f"{score.drives} held-out layouts of {METRES:.0f} m, "
                f"{100 * score.reached:.0f} % finished",
                ">= 60 %",
                share >= 0.6,
            ),
            _collision_row(f"expert, {vehicle}", score, 1.0),
        ]
    return rows


def clone() -> list[Row]:
    """Score the shipped policies, which see only images; `ONLY` names vehicles."""
    rows: list[Row] = []
    for vehicle in asked("vehicle", VEHICLES):
        policy = find_clone(vehicle)
        if policy is None:
            rows.append(Row(f"clone, {vehicle}", "skipped", "no policy is shipped", "none", True))
            continue
        courses = layouts(CLONE_LAYOUTS)
        knows = _expert_score(vehicle, courses)
        with closing(_env(vehicle, image=True)) as env:
            score = _score(env, sighted(policy), courses)
        with closing(_env(vehicle, image=False)) as env:  # No rendering needed for black images.
            dark = _score(env, blind(policy), courses, BLIND_S)
        share = score.speed / knows.speed
        rows += [
            Row(
                f"clone, {vehicle}: mean speed over the expert's",
                f"{100 * share:.0f} %",
                f"{score.speed:.2f} m/s, drives from {score.slowest:.2f} to {score.fastest:.2f}; "
                f"the expert {knows.speed:.2f} m/s; {score.drives} held-out layouts, "
                f"{100 * score.reached:.0f} % finished",
                ">= 50 %",
                share >= 0.5,
            ),
            _collision_row(f"clone, {vehicle}", score, 3.0 if vehicle == "car" else None),
            Row(
                f"clone, {vehicle}, black pictures: collisions per 100 m",
                f"{dark.per_100_m:.1f}",
                f"{counted(dark)}; {dark.speed:.2f} m/s",
                "5 times as many at least",
                dark.collisions > 0 and dark.per_100_m >= 5.0 * score.per_100_m,
            ),
        ]
    return rows


def students() -> list[Row]:
    """Score cars trained by RL on distances, and their students, which see only images.

    The command line trains `SEEDS` of each from scratch.
    """
    rows: list[Row] = []
    for seed in range(int(os.environ.get("SEEDS", STUDENT_SEEDS))):
        out = Path("results", "students")
        teacher, student = (out / f"{name}-{seed}.safetensors" for name in ("teacher", "student"))
        began = time.monotonic()
        Train("CarRanges", out=teacher, seed=seed).run()
        Train("Car", teacher=teacher, out=student, seed=seed).run()
        minutes = (time.monotonic() - began) / 60.0
        with closing(RangesEnv("car", courses="held-out", put_back=True)) as env:
            knows = _score(env, _alone(load_policy(teacher)), layouts(STUDENT_LAYOUTS))
        with closing(_env("car", image=True)) as env:
            score = _score(env, sighted(load_policy(student)), layouts(STUDENT_LAYOUTS))
        for name, one in (("teacher", knows), ("student", score)):
            rows += [
                Row(
                    f"{name} of the car, seed {seed}: mean speed",
                    f"{one.speed:.2f} m/s",
                    f"drives from {one.slowest:.2f} to {one.fastest:.2f}; {one.drives} held-out "
                    f"layouts, {100 * one.reached:.0f} % finished; both trained in "
                    f"{minutes:.1f} minutes",
                    "> 1.88 m/s, the expert's",
                    one.speed > EXPERT_MPS,
                ),
                _collision_row(f"{name} of the car, seed {seed}", one, 1.0),
            ]
    return rows


def _alone(policy: TrainedPolicy) -> Act:
    """Return a driver that takes one observation at a time."""
    many = policy.act
    return lambda seen: many(seen[None])[0]


def _env(vehicle: str, *, image: bool) -> VehicleEnv:
    return VehicleEnv(vehicle, courses="held-out", image=image, put_back=True)


def _expert_score(vehicle: str, courses: range) -> DriveScore:
    with closing(_env(vehicle, image=False)) as env:
        return _score(env, env.expert(), courses)


def _score(
    env: VehicleEnv | RangesEnv, act: Act, courses: range, limit_s: float = LIMIT_S
) -> DriveScore:
    return DriveScore.of([drive(env, act, course=course, limit_s=limit_s) for course in courses])


def _collision_row(name: str, score: DriveScore, most: float | None) -> Row:
    return Row(
        f"{name}: collisions per 100 m",
        f"{score.per_100_m:.2f}",
        counted(score),
        "none" if most is None else f"< {most:g}",
        most is None or score.per_100_m < most,
    )


def counted(score: DriveScore) -> str:
    """Return the interval and the counts of a rate of collisions."""
    return (
        f"{score.low:.2f} to {score.high:.2f}, 95 % (Garwood); "
        f"{score.collisions} in {score.metres:.0f} m"
    )
