"""One driver in process and behind guard, daemon and link: results should agree."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.clones import find_clone, sighted
from benchmarks.remote_drive import drive_remote
from benchmarks.row import Row
from benchmarks.vehicles import counted, layouts
from shapechanger.envs.remote.vehicle import RemoteVehicleEnv
from shapechanger.envs.vehicle import VehicleEnv
from shapechanger.envs.vehicle.evaluation import Act, DriveResult, DriveScore, drive
from shapechanger.layout import Layout
from shapechanger.robot.profile.load import find_profile
from shapechanger.twin.robot import run_robot

LAYOUTS: Final = 10
_CLOCKS: Final[dict[Literal["twin", "real"], Literal["lockstep", "realtime"]]] = {
    "twin": "lockstep",
    "real": "realtime",
}
_NEAR_M: Final = 1.5
_CLEAR_M: Final = 2.5


class _Turner:
    """Driver that turns to one side until the distance ahead is free.

    Args:
        layout: Layout of the state.
    """

    def __init__(self, layout: Layout) -> None:
        self._distance = layout.slices["distance"].start
        self._side = 0.0
        self._last_side = -1.0

    def __call__(self, state: NDArray[np.float32]) -> NDArray[np.float32]:
        ahead_m = float(state[self._distance])
        if self._side and ahead_m > _CLEAR_M:
            self._last_side, self._side = self._side, 0.0
        elif not self._side and ahead_m < _NEAR_M:
            self._side = -self._last_side
        return np.array([self._side, 0.4], np.float32)


def twin(vehicle: str = "car") -> list[Row]:
    """Measure mean speed and collisions in process, on the twin's clock and in real time."""
    policy = find_clone(vehicle)
    courses = layouts(LAYOUTS)

    def driver(layout: Layout) -> Act:
        return _Turner(layout) if policy is None else sighted(policy)

    image = policy is not None
    with closing(VehicleEnv(vehicle, courses="held-out", image=image, put_back=True)) as env:
        here = DriveScore.of(
            [drive(env, driver(env.observation_layout), course=course) for course in courses]
        )
    rows = [
        Row(
            f"{vehicle}, in process: mean speed, collisions per 100 m",
            f"{here.speed:.3f} m/s, {here.per_100_m:.2f}",
            f"drives from {here.slowest:.2f} to {here.fastest:.2f} m/s; {counted(here)}; "
            f"driven by {'the clone' if image else 'the distance ahead, as no clone is shipped'}",
            "none",
            True,
        )
    ]
    for clock, pace in _CLOCKS.items():
        there = DriveScore.of(
            [_served(vehicle, clock, course, image, driver) for course in courses]
        )
        rows += _compared(f"{vehicle}, served, {clock} clock, {pace}", here, there)
    return rows


def _compared(name: str, here: DriveScore, there: DriveScore) -> list[Row]:
    ratio = there.speed / here.speed
    alike = here.low <= there.per_100_m <= here.high or there.low <= here.per_100_m <= there.high
    return [
        Row(
            f"{name}: mean speed over that in process",
            f"{ratio:.3f}",
            f"drives from {there.slowest:.2f} to {there.fastest:.2f} m/s, "
            f"{there.drives} held-out layouts",
            "0.9 to 1.1",
            0.9 <= ratio <= 1.1,
        ),
        Row(
            f"{name}: collisions per 100 m",
            f"{there.per_100_m:.2f}",
            counted(there),
            "one rate inside the other's interval",
            alike,
        ),
    ]


def _served(
    vehicle: str,
    clock: Literal["twin", "real"],
    course: int,
    image: bool,
    driver: Callable[[Layout], Act],
) -> DriveResult:
    """Drive a robot that was started on this course.

    Each course gets a new robot: laying out a course takes 0.1 s, which would stall a guard in real
    time.
    """
    profile = find_profile(f"lab-{vehicle}")
    with run_robot(profile, clock=clock, seed=course) as robot, robot.operator() as operator:
        known = robot.known
        env = RemoteVehicleEnv(
            known.address,
            key=known.key,
            fingerprint=known.fingerprint,
            image=image,
            pace=_CLOCKS[clock],
            reward={"collision_ends_episode": 0.0},
            on_reset=lambda seed: operator.place(course if seed is None else seed),
        )
        with closing(env):
            return drive_remote(env, operator, driver(env.observation_layout), course=course)
