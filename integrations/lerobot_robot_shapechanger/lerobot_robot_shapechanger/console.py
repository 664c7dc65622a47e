"""The person who drives a robot in its console, as a teleoperator of LeRobot."""

from __future__ import annotations

from typing import Any

from lerobot.teleoperators import Teleoperator

from lerobot_robot_shapechanger.config import ShapechangerConsoleConfig
from lerobot_robot_shapechanger.link import Link, named
from shapechanger.robot.client.operator import Takeover


class ShapechangerConsole(Teleoperator):
    """Commands of the person who has control of a robot, from its console.

    The person uses keys, the stick or a gamepad in the console, or `shapechanger robot drive`. The
    person's commands act on the robot directly, and this class only reads them. The action is at
    rest while no person has control of an armed robot.

    Args:
        config: Configuration with the name of the robot.
    """

    config_class = ShapechangerConsoleConfig
    name = "shapechanger"

    def __init__(self, config: ShapechangerConsoleConfig) -> None:
        super().__init__(config)
        self.config = config
        self._link = Link(config.id, "lerobot teleoperator", frames=False)

    @property
    def action_features(self) -> dict[str, type]:
        """Names and types of the robot's actions."""
        return dict.fromkeys(self._link.spaces.action_layout.names, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """Empty, because the person sees the robot in the console."""
        return {}

    @property
    def is_connected(self) -> bool:
        """True while the robot can be reached."""
        return self._link.is_open

    @property
    def is_calibrated(self) -> bool:
        """True: a console has nothing to calibrate."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Connect to the robot without taking control; raises the errors of `Link.open`.

        Args:
            calibrate: Unused.
        """
        self._link.open()

    def calibrate(self) -> None:
        """Do nothing: a console has nothing to calibrate."""

    def configure(self) -> None:
        """Do nothing: a console has no settings."""

    def get_action(self) -> dict[str, float]:
        """Return the person's command, or the action at rest.

        Raises:
            LinkError: If the link is lost.
        """
        by_person = Takeover.action(self._link.latest().message)
        spaces = self._link.spaces
        return named(spaces, spaces.rest if by_person is None else spaces.values(by_person))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: the person sees the robot in the console.

        Args:
            feedback: Unused.
        """

    def disconnect(self) -> None:
        """Disconnect; may be called again."""
        self._link.close()
