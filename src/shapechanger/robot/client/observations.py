"""Gymnasium spaces and observations from the messages of a robot."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any, Final, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError, LinkError, RobotRefused, SpaceMismatch
from shapechanger.layout import Element, Feature, Layout
from shapechanger.robot.client.connection import Received
from shapechanger.robot.link.messages import Observation, Welcome

IMAGE: Final = "camera/image"
"""Name of the image in an observation layout."""

_ABSENT: Final = "absent"
_BRIGHTEST: Final = 255


def resize_picture(picture: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Resize an image to width and height, pixels; return it as it is if it has this size.

    If width and height shrink by integer factors, each pixel is the rounded mean of its box.
    Otherwise each pixel is the nearest pixel of the original. No part is cropped, so a change of
    proportions stretches the image.
    """
    height, width = picture.shape[:2]
    wide, high = size
    if (width, height) == (wide, high):
        return picture
    if width % wide == 0 and height % high == 0:
        boxes = picture.reshape(high, height // high, wide, width // wide, 3)
        return np.rint(boxes.mean(axis=(1, 3))).astype(np.uint8)
    rows = (2 * np.arange(high) + 1) * height // (2 * high)
    columns = (2 * np.arange(wide) + 1) * width // (2 * wide)
    return picture[rows[:, None], columns[None, :]]


class View(NamedTuple):
    """Observation of an env, and fields for its `info`."""

    observation: Any  # Shares no memory with other observations.
    fresh: bool  # Whether its frame is newer than the previous one; True without images.
    absent: tuple[str, ...]  # Names of the state's features that no sensor measures now.


class RobotSpaces:
    """Spaces and layouts of one robot, and observations from its messages.

    An observation is an image, the state, or both. An image is one block of its layout.
    """

    def __init__(
        self, welcome: Welcome, size: tuple[int, int], image: bool | None, state: bool
    ) -> None:
        has_camera = welcome.image_size is not None
        if image and not has_camera:
            raise RobotRefused(
                f"{welcome.robot} has no camera: leave out `image` to get its state."
            )
        if min(size) < 1:
            raise SpaceMismatch(
                f"An image must have at least 1 x 1 pixels, got {size[0]} x {size[1]}."
            )
        self._size = size
        self.has_image = has_camera if image is None else image
        self._has_state = state or not self.has_image
        self.action_layout = Layout.from_json(welcome.action_layout)
        self.action_space = _box(self.action_layout)
        self._state_layout = Layout.from_json(welcome.state_layout)
        self._places = self._state_layout.slices
        space: gym.Space[Any] = _box(self._state_layout)
        features = self._state_layout.features if self._has_state else ()
        if self.has_image:
            shape = (size[1], size[0], 3)
            camera = Element("camera", "camera")
            features = (Feature(IMAGE, "1", 0.0, _BRIGHTEST, camera, shape), *features)
            image_space = gym.spaces.Box(0, _BRIGHTEST, shape, np.uint8)
            both: dict[str, gym.Space[Any]] = {"image": image_space, "state": space}
            space = gym.spaces.Dict(both) if self._has_state else image_space
        self.observation_layout = Layout(features)
        self.observation_space = space
        self.picture: NDArray[np.uint8] | None = None  # Newest image, at the camera's size.
        self.reconnect()

    def reconnect(self) -> None:
        """Forget the numbers of frames: after a restart, the robot counts from 1 again."""
        self._tried_seq = self._picture_seq = self._viewed_seq = 0

    def values(self, action: Any) -> tuple[float, ...]:
        """Return the values of a command, clipped to the range of the action."""
        array = np.asarray(action, dtype=np.float64)
        if array.shape != self.action_space.shape or not np.isfinite(array).all():
            raise SpaceMismatch(
                f"An action of this robot is {len(self.action_layout)} finite numbers "
                f"({', '.join(self.action_layout.names)}), got {array.tolist()}."
            )
        return tuple(np.clip(array, self.action_layout.low, self.action_layout.high).tolist())

    @property
    def rest(self) -> tuple[float, ...]:
        """The action at rest: 0, or the bound nearest to it."""
        return tuple(min(max(0.0, f.low), f.high) for f in self.action_layout)

    def quantity(self, message: Observation, *names: str) -> tuple[float | None, str]:
        """Return the first measured quantity of these names, or None, and its source.

        The source is the name of the sensor, "estimated" or "absent".
        """
        for name in names:
            source = message.sources.get(name, _ABSENT)
            if name in self._places and source != _ABSENT:
                value = message.state[int(self._places[name].start)]
                if not math.isnan(value):
                    return value, source
        return None, _ABSENT

    def shows(self, received: Received) -> bool:
        """Decode the frame of an observation. Return False for a missing or invalid frame.

        After an invalid frame `picture` is still the previous one, and `View.fresh` is False.
        """
        seq = received.message.frame_seq
        if received.jpeg is None:
            return False
        if seq != self._tried_seq:  # Each frame is decoded at most once, even if it is invalid.
            self._tried_seq = seq
            with suppress(DemosError):
                self.picture = decode_picture(received.jpeg, "")
                self._picture_seq = seq
        return seq == self._picture_seq

    def view(self, received: Received) -> View:
        """Return the env's observation for an observation of the robot."""
        message = received.message
        if len(message.state) != self._state_layout.size:
            raise LinkError(
                f"The state layout has {self._state_layout.size} numbers, and the robot sent "
                f"{len(message.state)}."
            )
        state = np.array(message.state, dtype=np.float32)
        absent: list[str] = []
        for feature in self._state_layout if np.isnan(state).any() else ():
            block = state[self._places[feature.name]]
            if (missing := np.isnan(block)).any():
                absent.append(feature.name)
                block[missing] = feature.middle
        if not self.has_image:
            return View(state, True, tuple(absent))
        self.shows(received)
        if self.picture is None:
            raise LinkError("The robot has sent no image yet.")
        fresh, self._viewed_seq = self._picture_seq != self._viewed_seq, self._picture_seq
        image = resize_picture(self.picture, self._size)
        image = image.copy() if image is self.picture else image
        seen = {"image": image, "state": state} if self._has_state else image
        return View(seen, fresh, tuple(absent))


def _box(layout: Layout) -> gym.spaces.Box[np.float32]:
    return gym.spaces.Box(layout.low.astype(np.float32), layout.high.astype(np.float32))
