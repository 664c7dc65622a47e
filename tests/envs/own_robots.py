"""Robots and tasks of a user, for tests."""

from __future__ import annotations

import numpy as np

from shapechanger.contract.env_ref import Measure
from shapechanger.envs.own_tasks import RobotState
from tests.models import xml

# A dog with a front and a back leg, each on a hinge; the front one has a motor, the other a servo.
DOG = xml("dog")


class Rear:
    """Raise the trunk with the back leg straight."""

    observe = ("trunk/z", "trunk/q*", "*/angle", "*/velocity", "front/contact/fz")
    measures = (Measure("height", "m", "reward_height"),)

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def reward(self, robot: RobotState) -> dict[str, float]:
        return {"height": self.weight * robot.height, "servo": -abs(robot["back/angle"])}

    def terminated(self, robot: RobotState) -> bool:
        return robot.up < 0.0


class Nonsense:
    """A task whose reward is not a number."""

    def reward(self, robot: RobotState) -> dict[str, float]:
        return {"nonsense": float("nan")}


class Hoist:
    """Hold a mass half a metre up."""

    observe = ("lift/position", "lift/velocity")

    def reward(self, robot: RobotState) -> dict[str, float]:
        return {"near": -abs(robot["lift/position"] - 0.5)}


class Move:
    """Move all joints of any robot."""

    def reward(self, robot: RobotState) -> dict[str, float]:
        return {
            "speed": float(np.clip(np.abs(robot.data.qvel), 0.0, 1.0).mean()),
            "control": -0.1 * float(np.square(robot.scaled_action).mean()),
        }
