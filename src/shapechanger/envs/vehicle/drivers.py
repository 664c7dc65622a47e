"""Drivers for `VehicleEnv`: the course expert, a demonstrator, and the shipped camera policies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course
from shapechanger.worlds.expert import CourseExpert, Disturbance
from shapechanger.worlds.expert.traits import traits_of
from shapechanger.worlds.simulation import MujocoWorld
from shapechanger.worlds.world import Pose

BEARINGS_DEG: Final = (-90, -60, -35, -15, 0, 15, 35, 60, 90)
"""Bearings of the distances that a teacher sees, degrees from the heading, positive to the left."""

FARTHEST_M: Final = 6.0
"""Distance that it sees where nothing is nearer, m."""

_BEARINGS: Final = np.radians(BEARINGS_DEG)

# A vehicle that is farther away after one period of 1/20 s was put back, m.
_MOVED_M: Final = 0.3
_FOLDER: Final = Path(__file__).parent / "clones"

CLONES: Final[Mapping[str, Path]] = MappingProxyType(
    {vehicle: _FOLDER / f"{vehicle}.safetensors" for vehicle in ("boat", "car", "tank", "truck")}
)
"""Files of the shipped camera policies by vehicle; `CameraPolicy.load` reads them.

Each was cloned from ten minutes of its expert's driving; `clones/README.md` is their model card.
"""


class VehicleDemonstrator:
    """Expert that makes mistakes and recovers from them, for demonstrations.

    Args:
        world: The world of the vehicle.
        seed: Seed of the mistakes.
    """

    def __init__(self, world: MujocoWorld, seed: int) -> None:
        self._world = world
        self._seeds = np.random.default_rng(seed)
        self.begin()

    def begin(self) -> None:
        """Begin an episode."""
        self._course = self._world.course
        self._expert = CourseExpert(self._course, self._world.vehicle.name, path=self._world.path())
        self._expert.reset(self._world.pose)
        self._disturbance = Disturbance(
            int(self._seeds.integers(2**31)), traits_of(self._world.vehicle.name).sway
        )

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the expert's action, to learn from, and the disturbed one, to take.

        Returns:
            Each has shape (2,): steering and throttle.
        """
        seen = self._world.inputs()
        action = self._expert.act(seen.pose, seen.speed, seen.yaw_rate)
        return action, self._disturbance.applied(action)


def observe_ranges(world: MujocoWorld) -> NDArray[np.float32]:
    """Return what a teacher sees, shape (11,).

    Distances from the middle of the front bumper at `BEARINGS_DEG`, m, up to `FARTHEST_M`; speed
    along the heading, m/s; rate of turn, rad/s, counter-clockwise.
    """
    seen = world.inputs()
    distances = world.ranges_m(_BEARINGS, FARTHEST_M)
    return np.array((*distances, seen.speed, seen.yaw_rate), np.float32)


class TeacherDemonstrator:
    """A policy that sees distances, as a demonstrator that makes mistakes; see `observe_ranges`.

    Args:
        world: The world of the vehicle.
        act: The policy: maps observations, (n, 11), to actions, (n, 2).
        seed: Seed of the mistakes.
    """

    def __init__(
        self, world: MujocoWorld, act: Callable[[NDArray[Any]], NDArray[Any]], seed: int
    ) -> None:
        self._world = world
        self._act = act
        self._seeds = np.random.default_rng(seed)
        self.begin()

    def begin(self) -> None:
        """Begin an episode."""
        self._disturbance = Disturbance(
            int(self._seeds.integers(2**31)), traits_of(self._world.vehicle.name).sway
        )

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the policy's action, to learn from, and the disturbed one, to take."""
        action = self._act(observe_ranges(self._world)[np.newaxis])[0].astype(np.float32)
        return action, self._disturbance.applied(action)


class ExpertDriver:
    """Expert that drives on the present course of a world.

    Args:
        world: The world of the vehicle.
    """

    def __init__(self, world: MujocoWorld) -> None:
        self._world = world
        self._course: Course | None = None

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return an action, (2,), steering and throttle; the observation is ignored."""
        seen = self._world.inputs()
        if self._world.course is not self._course:
            self._course = self._world.course
            self._expert = CourseExpert(
                self._course, self._world.vehicle.name, path=self._world.path()
            )
        elif self._was_moved(seen.pose):
            self._expert.reset(seen.pose)
        self._before = seen.pose
        return self._expert.act(seen.pose, seen.speed, seen.yaw_rate)

    def _was_moved(self, pose: Pose) -> bool:
        return math.hypot(pose.x - self._before.x, pose.y - self._before.y) > _MOVED_M
