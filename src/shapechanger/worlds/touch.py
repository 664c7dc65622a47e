"""What a vehicle touches in a simulated world."""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np

from shapechanger.worlds.world import Pose

__all__ = ["Touch"]

BUMPER_SPREAD: Final = math.radians(60.0)
"""How far to each side the bumper at the front reaches, seen from the middle of the vehicle."""

APART_S: Final = 0.5
"""A touch within so many seconds after the last one belongs to the same collision."""


class Touch:
    """Follows what a vehicle touches.

    Args:
        model: The model; the vehicle's geoms are named "vehicle/...", walls and things
            "world/wall/..." and "world/thing/...".

    Attributes:
        collisions: How many times it ran into something since `reset`.
        bumped: Whether something presses its front now.
        touches: Whether it touches anything now.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        names = [model.geom(i).name for i in range(model.ngeom)]
        self._hull = np.array([name.startswith("vehicle/") for name in names])
        self._solid = np.array([name.startswith(("world/wall", "world/thing")) for name in names])
        self.reset()

    def reset(self) -> None:
        """Forget what was touched."""
        self.collisions = 0
        self.let_go()

    def let_go(self) -> None:
        """The vehicle was lifted off whatever it touched: what comes next is another collision."""
        self.bumped = self.touches = False
        self._since_s = math.inf

    def follow(self, data: mujoco.MjData, pose: Pose, dt_s: float) -> None:
        """Take in the contacts after a step of the simulation.

        Args:
            data: With the contacts.
            pose: Of the vehicle.
            dt_s: How long the step was, s.
        """
        self._since_s += dt_s
        self.bumped = self.touches = False
        if data.ncon == 0:
            return
        pairs = data.contact.geom
        if not self._solid[pairs].any():
            return  # As nearly always: wheels are on the ground, and nothing else is touched.
        first, second = pairs[:, 0], pairs[:, 1]
        hits = (self._hull[first] & self._solid[second]) | (self._hull[second] & self._solid[first])
        hits &= data.contact.dist <= 0.0
        if not hits.any():
            return
        self.touches = True
        if self._since_s > APART_S:
            self.collisions += 1
        self._since_s = 0.0
        for x, y, _ in data.contact.pos[hits]:
            bearing = math.atan2(y - pose.y, x - pose.x) - pose.heading
            self.bumped |= abs(math.remainder(bearing, math.tau)) <= BUMPER_SPREAD
