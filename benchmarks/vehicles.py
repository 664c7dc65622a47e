"""How fast the vehicles' envs step, and how well the expert and the clones drive in them.

Everything is driven on courses that nothing was learned or tuned on.
"""

from __future__ import annotations

import os
import statistics
import time
from contextlib import closing
from typing import Any, Final

import gymnasium as gym

from benchmarks.clones import blind, find_clone, sighted
from benchmarks.row import Row
from shapechanger.bodies.vehicles import VEHICLES
from shapechanger.envs.vehicle import VehicleEnv
from shapechanger.envs.vehicle.drivers import ExpertDriver
from shapechanger.envs.vehicle.evaluation import LIMIT_S, METRES, Act, DriveScore, drive
from shapechanger.worlds.course import HELD_OUT

__all__ = ["clone", "counted", "expert", "frames", "layouts"]

EXPERT_LAYOUTS: Final = 50
CLONE_LAYOUTS: Final = 20
# A blind vehicle gets nowhere: it need not be waited for as long as for one that drives.
BLIND_S: Final = 60.0

ROUNDS: Final = 15
STEPS: Final = 60  # Of a round.


def layouts(usual: int) -> range:
    """The courses that are driven: `LAYOUTS` of them where the environment says so."""
    return HELD_OUT[: int(os.environ.get("LAYOUTS", usual))]


def frames() -> list[Row]:
    """Steps a second of each vehicle, with a picture each."""
    return [_frames_row(vehicle) for vehicle in ("car", *sorted(set(VEHICLES) - {"car"}))]


def _frames_row(vehicle: str) -> Row:
    """CPU time of all threads, so that a driver's help counts; the expert's is not counted."""
    rates: list[float] = []
    with gym.make(f"shapechanger/{vehicle.capitalize()}-v1", put_back=True) as env:
        inner: Any = env.unwrapped
        pilot = ExpertDriver(inner.world)
        # Long drives on one course: a reset is not what is measured.
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


def expert() -> list[Row]:
    """The expert, which knows where everything is."""
    rows: list[Row] = []
    for vehicle, model in VEHICLES.items():
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
    """The policies that come with the package, which see pictures alone."""
    rows: list[Row] = []
    for vehicle in VEHICLES:
        policy = find_clone(vehicle)
        if policy is None:
            rows.append(Row(f"clone, {vehicle}", "skipped", "no policy is shipped", "none", True))
            continue
        courses = layouts(CLONE_LAYOUTS)
        knows = _expert_score(vehicle, courses)
        with closing(_env(vehicle, image=True)) as env:
            score = _score(env, sighted(policy), courses)
        with closing(_env(vehicle, image=False)) as env:  # Black pictures need not be drawn.
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


def _env(vehicle: str, *, image: bool) -> VehicleEnv:
    return VehicleEnv(vehicle, courses="held-out", image=image, put_back=True)


def _expert_score(vehicle: str, courses: range) -> DriveScore:
    with closing(_env(vehicle, image=False)) as env:
        return _score(env, ExpertDriver(env.world), courses)


def _score(env: VehicleEnv, act: Act, courses: range, limit_s: float = LIMIT_S) -> DriveScore:
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
    """What a rate of collisions rests on."""
    return (
        f"{score.low:.2f} to {score.high:.2f}, 95 % (Garwood); "
        f"{score.collisions} in {score.metres:.0f} m"
    )
