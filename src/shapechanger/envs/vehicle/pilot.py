"""The expert as a driver of an env: it looks at the truth and not at the observation."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course
from shapechanger.worlds.pathfinder import Expert
from shapechanger.worlds.simulation import MujocoWorld
from shapechanger.worlds.world import Pose

__all__ = ["Pilot"]

_MOVED_M: Final = 0.3  # No vehicle drives as far as this in one period of 1/20 s.


class Pilot:
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
            self._expert = Expert(self._course, self._world.vehicle.name, path=self._world.path())
        elif self._was_moved(seen.pose):
            self._expert.reset(seen.pose)
        self._before = seen.pose
        return self._expert.act(seen.pose, seen.speed, seen.yaw_rate)

    def _was_moved(self, pose: Pose) -> bool:
        return math.hypot(pose.x - self._before.x, pose.y - self._before.y) > _MOVED_M
