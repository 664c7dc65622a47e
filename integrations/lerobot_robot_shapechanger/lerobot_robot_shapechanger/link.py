"""Link from a device of LeRobot to a known robot."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final

from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.connection import Received
from shapechanger.robot.client.known_robots import known_names, recall
from shapechanger.robot.client.observations import RobotSpaces
from shapechanger.robot.link.messages import Welcome

_NO_CAMERA: Final = (160, 120)  # Placeholder for the image size of a robot without a camera.


class Link:
    """Connection to a known robot in the role of a program, from `open` to `close`.

    Args:
        robot: Name of the known robot; None if LeRobot got no name.
        called: Display name of the program.
        frames: Whether observations contain frames.
    """

    def __init__(self, robot: str | None, called: str, *, frames: bool) -> None:
        self._robot = robot
        self._called = called
        self._frames = frames
        self._client: RobotClient | None = None
        self._spaces: RobotSpaces | None = None
        self._acknowledged = 0

    @property
    def is_open(self) -> bool:
        """True while the robot can be reached."""
        return self._client is not None and self._client.alive

    @property
    def client(self) -> RobotClient:
        """The client.

        Raises:
            DeviceNotConnectedError: If the link was never opened, or was closed.
        """
        if self._client is None:
            raise DeviceNotConnectedError(f"{self._robot} is not connected: call connect() first.")
        return self._client

    @property
    def spaces(self) -> RobotSpaces:
        """The robot's layouts and spaces; if unknown, read over a short connection.

        Raises:
            UnknownName: If there is no known robot of this name.
            LinkError: If the robot cannot be reached.
        """
        if self._spaces is None:
            with self._reach() as client:
                self._spaces = _spaces_of(client.welcome)
        return self._spaces

    def open(self) -> RobotClient:
        """Connect.

        Raises:
            DeviceAlreadyConnectedError: If the link is open.
            UnknownName: If there is no known robot of this name.
            LinkError: If the robot cannot be reached.
            RobotRefused: If the robot refuses the client, or its time moves in steps.
        """
        if self.is_open:
            raise DeviceAlreadyConnectedError(f"{self._robot} is connected already.")
        client = self._reach()
        if client.welcome.clock == "twin":
            client.close()
            raise RobotRefused(
                f"The time of {client.welcome.robot} moves only in steps (`serve --clock twin`), "
                "and LeRobot follows the clock: serve it with `--clock real`."
            )
        self._spaces = _spaces_of(client.welcome)
        self._client, self._acknowledged = client, 0
        return client

    def latest(self) -> Received:
        """Return the newest observation; if it is older than one period, wait for the next.

        Raises:
            LinkError: If the link is lost, or no observation arrives in time.
        """
        client = self.client
        received = client.newest
        period_s = 1.0 / client.welcome.control_hz
        if received is None or time.monotonic() - received.received_at > period_s:
            received = client.ask()
        if received.message.seq != self._acknowledged:
            self._acknowledged = received.message.seq
            client.acknowledge()  # Request the next observation.
        return received

    def close(self) -> None:
        """Give control back, and disconnect; may be called again."""
        client, self._client = self._client, None
        if client is None:
            return
        if client.alive:
            client.release()
        client.close()

    def _reach(self) -> RobotClient:
        if not self._robot:
            names = ", ".join(known_names()) or "none"
            raise LinkError(f"A robot needs `id`, the name of a known robot. There are: {names}.")
        return RobotClient.connect(recall(self._robot), name=self._called, frames=self._frames)


def named(spaces: RobotSpaces, values: Sequence[float]) -> dict[str, float]:
    """Return the values of an action, keyed by name, as LeRobot passes them."""
    return dict(zip(spaces.action_layout.names, values, strict=True))


def _spaces_of(welcome: Welcome) -> RobotSpaces:
    return RobotSpaces(welcome, welcome.image_size or _NO_CAMERA, image=None, state=True)
