"""A robot on the network, as a robot of LeRobot."""

from __future__ import annotations

import contextlib
import logging
import time
from typing import Any, Final

from lerobot.robots import Robot

from lerobot_robot_shapechanger.config import ShapechangerConfig
from lerobot_robot_shapechanger.link import Link, named
from shapechanger.errors import RobotRefused, SpaceMismatch, UnknownName
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.connection import Received
from shapechanger.robot.client.observations import IMAGE, RobotSpaces
from shapechanger.robot.client.operator import Takeover, interruption
from shapechanger.robot.link.messages import Observation

CAMERA: Final = "camera"
"""Name of the image in an observation."""

_TELL_AFTER_S: Final = 2.0  # Shorter waits are not logged.

_log = logging.getLogger(__name__)


class Shapechanger(Robot):
    """A robot of Shapechanger: a car, tank, boat, truck, cat or finger.

    It is a client with the role "program": the robot's lease, deadline and guard apply, a person
    can take control at any time, and only a person arms the robot, unless its profile lets programs
    arm it. While a person has control, actions are suggestions, which the person sees. After an
    emergency stop or a disarm, LeRobot's loop goes on and logs a warning; a lost link ends it.

    Args:
        config: Name of the robot, and time to wait for a person.
    """

    config_class = ShapechangerConfig
    name = "shapechanger"

    def __init__(self, config: ShapechangerConfig) -> None:
        super().__init__(config)
        self.config = config
        self._link = Link(config.id, "lerobot", frames=True)
        self._takeover = Takeover(allowed=True)
        self._seen: Received | None = None
        self._reported: tuple[bool, str, bool, bool] | None = None
        self._absent: tuple[str, ...] = ()

    @property
    def observation_features(self) -> dict[str, Any]:
        """Names of the robot's state, and the shape of its camera's image."""
        return dict.fromkeys(_state_names(self._link.spaces), float) | self.cameras

    @property
    def action_features(self) -> dict[str, type]:
        """Names and types of the robot's actions."""
        return dict.fromkeys(self._link.spaces.action_layout.names, float)

    @property
    def cameras(self) -> dict[str, tuple[int, ...]]:
        """Shape of each camera's image; LeRobot counts them for its threads."""
        spaces = self._link.spaces
        return {CAMERA: spaces.observation_layout[IMAGE].shape} if spaces.has_image else {}

    @property
    def is_connected(self) -> bool:
        """True while the robot can be reached."""
        return self._link.is_open

    @property
    def is_calibrated(self) -> bool:
        """True: robots are calibrated on the robot, by `shapechanger robot calibrate`."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Connect, and wait until a person drives the robot or lets a program drive.

        A robot that lets programs arm it is armed at once, unless a person has control.

        Args:
            calibrate: Unused.

        Raises:
            UnknownName: If there is no known robot of this name.
            LinkError: If the robot cannot be reached, or sends no image.
            RobotRefused: If the robot refuses the client, or nobody lets it move within `wait_s`.
        """
        client = self._link.open()
        try:
            self._seen = self._await_driver(client)
        except BaseException:
            self._link.close()
            raise
        hz = client.welcome.control_hz
        _log.info("%s takes %g commands a second: record with fps=%g.", self.id, hz, hz)

    def calibrate(self) -> None:
        """Do nothing: robots are calibrated by `shapechanger robot calibrate`."""

    def configure(self) -> None:
        """Do nothing: a robot's settings are in its profile."""

    def get_observation(self) -> dict[str, Any]:
        """Return the robot's newest observation.

        State without a measurement is the middle of its range, or 0 if the range is infinite,
        because one NaN would spoil the statistics of a dataset.

        Returns:
            Numbers of the state, keyed by name, and the image, RGB, `uint8`, (height, width, 3).

        Raises:
            LinkError: If the link is lost, or no observation arrives in time.
        """
        received = self._link.latest()
        spaces = self._link.spaces
        view = spaces.view(received)
        self._seen = received
        self._report(received.message, view.absent)
        image = {CAMERA: view.observation["image"]} if spaces.has_image else {}
        state = view.observation["state"] if spaces.has_image else view.observation
        return dict(zip(_state_names(spaces), state.tolist(), strict=True)) | image

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Send a command that answers the last observation; while a person drives, a suggestion.

        Args:
            action: One number for each action of the robot, keyed by name; clipped to its range.

        Returns:
            The command of the person who has control, or else `action` after clipping.

        Raises:
            UnknownName: If a name is not an action of the robot.
            SpaceMismatch: If an action is missing, or not a finite number.
            LinkError: If the link is lost.
        """
        client, spaces = self._link.client, self._link.spaces
        values = _values(spaces, action)
        received = self._seen or self._link.latest()
        self._takeover.act(client, values, received.message)
        return named(spaces, Takeover.action(received.message) or values)

    def disconnect(self) -> None:
        """Stop the robot if this program drives it, and disconnect; may be called again."""
        self._link.close()

    def _await_driver(self, client: RobotClient) -> Received:
        """Wait until this program or a person drives the armed robot, and its first image arrives.

        Raises:
            RobotRefused: If this takes longer than `wait_s`.
        """
        robot, spaces = client.welcome.robot, self._link.spaces
        since, told = time.monotonic(), ""
        while True:
            received = client.ask()
            seen = received.message
            drives = seen.armed and (seen.mine or seen.holder_role == "person")
            if drives and (not spaces.has_image or spaces.shows(received)):
                return received
            with contextlib.suppress(RobotRefused):  # The next observation shows why.
                if not seen.mine:
                    client.take()
                elif client.welcome.arming == "anyone" and not seen.emergency:
                    client.arm()
            waits = (
                f"{robot} sends no picture. Does its camera still work?"
                if drives
                else f"{robot} waits for a person: run `shapechanger robot drive {self.id}`, and "
                "drive, or let this program drive with P."
            )
            waited_s = time.monotonic() - since
            if waited_s > self.config.wait_s:
                why = f" ({seen.stop_reason.rstrip('.')})" if seen.stop_reason else ""
                raise RobotRefused(f"After {self.config.wait_s:g} s{why}, {waits}")
            if waits != told and waited_s > _TELL_AFTER_S:
                told = waits
                _log.warning("%s", waits)

    def _report(self, seen: Observation, absent: tuple[str, ...]) -> None:
        """Log changes of the driver, and state that is no longer measured."""
        now = (seen.mine, seen.holder, seen.armed, seen.emergency)
        if now != self._reported:
            self._reported = now
            because = interruption(seen)
            level = logging.WARNING if because else logging.INFO
            _log.log(level, "%s", because or f"LeRobot drives {self.id}.")
        if new := set(absent) - set(self._absent):
            self._absent += tuple(sorted(new))
            _log.warning("Nothing measures %s: the middle of its range.", ", ".join(sorted(new)))


def _state_names(spaces: RobotSpaces) -> list[str]:
    return [name for name in spaces.observation_layout.names if name != IMAGE]


def _values(spaces: RobotSpaces, action: dict[str, Any]) -> tuple[float, ...]:
    """Return the values of an action in the order of the robot's layout."""
    names = spaces.action_layout.names
    for name in action:
        if name not in names:
            raise UnknownName("action", name, names)
    if missing := [name for name in names if name not in action]:
        raise SpaceMismatch(f"An action has {', '.join(names)}; {', '.join(missing)} is missing.")
    return spaces.values([float(action[name]) for name in names])
