"""Drivers for `VehicleEnv`: the course expert, a demonstrator, and the shipped camera policies."""

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
        self._disturbance = Disturbance.of(
            self._world.vehicle.name, "both", int(self._seeds.integers(2**31))
        )

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the expert's action, to learn from, and the disturbed one, to take.

        Returns:
            Each has shape (2,): steering and throttle.
        """
        seen = self._world.inputs()
        action = self._expert.act(seen.pose, seen.speed, seen.yaw_rate)
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
