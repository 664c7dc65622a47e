"""Whoever shows how to drive: the expert, with mistakes that it puts right."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.pathfinder import Disturbance, Expert
from shapechanger.worlds.simulation import MujocoWorld

__all__ = ["Demonstrator"]


class Demonstrator:
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
        self._expert = Expert(self._course, self._world.vehicle.name, path=self._world.path())
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
