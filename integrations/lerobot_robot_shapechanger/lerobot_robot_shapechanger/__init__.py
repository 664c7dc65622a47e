"""Robots of Shapechanger for LeRobot: each one a `Robot`, and the person at it a `Teleoperator`.

LeRobot imports this package because its distribution is called `lerobot_robot_…`; the import
registers both under the type `shapechanger`.
"""

from lerobot_robot_shapechanger.config import ShapechangerConfig, ShapechangerConsoleConfig
from lerobot_robot_shapechanger.console import ShapechangerConsole
from lerobot_robot_shapechanger.robot import Shapechanger

# LeRobot finds the class of a device here, by the name of its configuration without "Config".
__all__ = [
    "Shapechanger",
    "ShapechangerConfig",
    "ShapechangerConsole",
    "ShapechangerConsoleConfig",
]
