"""Whoever shows how to drive: the expert, with mistakes that it puts right."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course
from shapechanger.worlds.expert import CourseExpert, Disturbance
from shapechanger.worlds.simulation import MujocoWorld
from shapechanger.worlds.world import Pose

__all__ = ["CLONES", "ExpertDriver", "VehicleDemonstrator"]


class VehicleDemonstrator:
    """Shows how to drive in one env.

    Args:
        world: Where the vehicle is.
        seed: Of the mistakes.
    """

    def __init__(self, world: MujocoWorld, seed: int) -> None:
        self._world = world
        self._seeds = np.random.default_rng(seed)
        self.begin()

    def begin(self) -> None:
        """An episode has begun."""
        self._course = self._world.course
        self._expert = CourseExpert(self._course, self._world.vehicle.name, path=self._world.path())
        self._expert.reset(self._world.pose)
        self._disturbance = Disturbance.of(
            self._world.vehicle.name, "both", int(self._seeds.integers(2**31))
        )

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What it means to do now, and what it does: each (2,), steering and throttle.

        The second is to be taken, and the first to be learned.
        """
        seen = self._world.inputs()
        meant = self._expert.act(seen.pose, seen.speed, seen.yaw_rate)
        return meant, self._disturbance.applied(meant)


_MOVED_M: Final = 0.3  # No vehicle drives as far as this in one period of 1/20 s.


class ExpertDriver:
    """Drives in one world, on whatever course is laid out there.

    Args:
        world: Where the vehicle is.
    """

    def __init__(self, world: MujocoWorld) -> None:
        self._world = world
        self._course: Course | None = None

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """What to do now, (2,) steering and throttle; the observation is not looked at."""
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


_FOLDER: Final = Path(__file__).parent / "clones"

CLONES: Final[Mapping[str, Path]] = MappingProxyType(
    {vehicle: _FOLDER / f"{vehicle}.zip" for vehicle in ("boat", "car", "tank", "truck")}
)
"""File of the policy by the name of the vehicle; `CameraPolicy.load` reads it."""
