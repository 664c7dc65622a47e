"""Robots of Shapechanger as LeRobot's `Robot`, and their consoles as LeRobot's `Teleoperator`.

LeRobot imports this package because its distribution is called `lerobot_robot_…`; the import
registers both under the type `shapechanger`.
"""

from lerobot_robot_shapechanger.config import ShapechangerConfig, ShapechangerConsoleConfig
from lerobot_robot_shapechanger.console import ShapechangerConsole
from lerobot_robot_shapechanger.robot import Shapechanger

# LeRobot looks up the class of a device here: the name of its configuration without "Config".
__all__ = [
    "Shapechanger",
    "ShapechangerConfig",
    "ShapechangerConsole",
    "ShapechangerConsoleConfig",
]
