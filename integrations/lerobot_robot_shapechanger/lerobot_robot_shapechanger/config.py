"""Configurations of the robot and of its console, which LeRobot fills from its command line.

They do not contain the robot's key, because LeRobot logs and saves configurations: `id` is the name
under which `shapechanger robot remember` stored the robot and its key.
"""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


@RobotConfig.register_subclass("shapechanger")
@dataclass(kw_only=True)
class ShapechangerConfig(RobotConfig):
    """A robot on the network.

    Attributes:
        id: Name of a known robot.
        wait_s: Time that `connect` waits until a person drives the robot or lets a program
            drive, s.
    """

    wait_s: float = 60.0


@TeleoperatorConfig.register_subclass("shapechanger")
@dataclass(kw_only=True)
class ShapechangerConsoleConfig(TeleoperatorConfig):
    """The person who drives a robot in its console.

    Attributes:
        id: Name of a known robot.
    """
