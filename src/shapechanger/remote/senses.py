"""From what a robot says it senses and moves to spaces, layouts and observations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LinkError, RobotRefused, SpaceMismatch
from shapechanger.layout import Element, Feature, Layout
from shapechanger.link.messages import Observation, Welcome
from shapechanger.remote.inbox import Received
from shapechanger.remote.picture import decoded, resized

__all__ = ["IMAGE", "Senses", "View"]

IMAGE: Final = "camera/image"
"""Name of the picture in an observation layout."""

_ABSENT: Final = "absent"
_BRIGHTEST: Final = 255


@dataclass(frozen=True, slots=True)
class View:
    """What an observation shows.

    Attributes:
        observation: What the env returns; shares memory with nothing.
        fresh: Whether its picture is another one than before; True without pictures.
        absent: Names of the numbers of the state that nothing measures now.
    """

    observation: Any
    fresh: bool
    absent: tuple[str, ...]


class Senses:
    """The spaces of one robot, and how its messages fill them.

    Args:
        welcome: What the robot is.
        size: Width and height of the pictures in pixels.
        image: Whether observations have a picture; None for when the robot has a camera.
        state: Whether observations have the state besides the picture.

    Raises:
        RobotRefused: If a picture is asked for and there is no camera.
        SpaceMismatch: If the size is no size.
    """

    def __init__(
        self, welcome: Welcome, size: tuple[int, int], image: bool | None, state: bool
    ) -> None:
        has_camera = welcome.image_size is not None
        if image and not has_camera:
            raise RobotRefused(
                f"{welcome.robot} has no camera: leave out `image`, to get its state."
            )
        if min(size) < 1:
            raise SpaceMismatch(f"A picture cannot be {size[0]} x {size[1]} pixels.")
        self._size = size
        self._has_image = has_camera if image is None else image
        self._has_state = state or not self._has_image
        self._state_layout = Layout.from_json(welcome.state_layout)
        self._places: dict[str, int] = {
            name: place.start for name, place in self._state_layout.slices.items()
        }
        self.action_layout = Layout.from_json(welcome.action_layout)
        """What the numbers of an action mean."""
        self.action_space = gym.spaces.Box(
            self.action_layout.low.astype(np.float32), self.action_layout.high.astype(np.float32)
        )
        """One number for each action of the robot."""
        self.observation_layout = self._layout()
        """What the numbers of an observation mean; a picture is one block."""
        self.observation_space = self._space()
        """Pictures, the state, or both."""
        self._picture: NDArray[np.uint8] | None = None
        self._picture_seq = 0
        self._viewed_seq = 0

    @property
    def has_image(self) -> bool:
        """Whether observations have a picture."""
        return self._has_image

    @property
    def picture(self) -> NDArray[np.uint8] | None:
        """The newest picture at the robot's own size; None before the first."""
        return self._picture

    def values(self, action: Any) -> tuple[float, ...]:
        """The numbers of a command, clipped to the range of the action.

        Raises:
            SpaceMismatch: If there are too many or too few, or one of them is no number.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self.action_space.shape or not np.isfinite(given).all():
            raise SpaceMismatch(
                f"An action of this robot is {len(self.action_layout)} finite numbers "
                f"({', '.join(self.action_layout.names)}), got {given.tolist()}."
            )
        clipped = np.clip(given, self.action_layout.low, self.action_layout.high)
        return tuple(clipped.tolist())

    @property
    def rest(self) -> tuple[float, ...]:
        """The action that moves nothing: 0, or the bound nearest to it."""
        return tuple(min(max(0.0, f.low), f.high) for f in self.action_layout)

    def quantity(self, message: Observation, name: str) -> float | None:
        """A quantity of the state by its name; None where nothing measures it."""
        value = self._number(message, name)
        return None if math.isnan(value) or self.source(message, name) == _ABSENT else value

    def source(self, message: Observation, name: str) -> str:
        """Where a quantity comes from: name of the sensor, "estimated" or "absent"."""
        if math.isnan(self._number(message, name)):
            return _ABSENT
        return message.sources.get(name, _ABSENT)

    def _number(self, message: Observation, name: str) -> float:
        place = self._places.get(name)
        return math.nan if place is None else message.state[place]

    def shows(self, received: Received) -> bool:
        """Whether the picture of an observation is there and can be seen.

        Bytes that are no picture change nothing: the newest picture is then an old one, and
        `View.fresh` says so.
        """
        seq = received.message.frame_seq
        if received.jpeg is None or seq == self._picture_seq:
            return received.jpeg is not None
        try:
            self._picture = decoded(received.jpeg)
        except LinkError:
            return False
        self._picture_seq = seq
        return True

    def view(self, received: Received) -> View:
        """What an observation shows.

        Raises:
            LinkError: If the state is not what the robot promised, or there is no picture yet.
        """
        message = received.message
        if len(message.state) != self._state_layout.size:
            raise LinkError(
                f"The robot promised {self._state_layout.size} numbers of state and sent "
                f"{len(message.state)}."
            )
        state, absent = self._state(message)
        if not self._has_image:
            return View(state, True, absent)
        self.shows(received)
        if self._picture is None:
            raise LinkError("The robot has sent no picture yet.")
        fresh, self._viewed_seq = self._picture_seq != self._viewed_seq, self._picture_seq
        image = resized(self._picture, self._size)
        image = image.copy() if image is self._picture else image
        seen = {"image": image, "state": state} if self._has_state else image
        return View(seen, fresh, absent)

    def _state(self, message: Observation) -> tuple[NDArray[np.float32], tuple[str, ...]]:
        """The state; a number that nothing measures is the middle of its range, and is named."""
        state = np.array(message.state, dtype=np.float32)
        missing = np.isnan(state)
        if not missing.any():
            return state, ()
        features, places = self._state_layout.features, self._state_layout.slices
        absent = [f for f in features if missing[places[f.name]].any()]
        for feature in absent:
            block = state[places[feature.name]]
            block[np.isnan(block)] = feature.middle
        return state, tuple(feature.name for feature in absent)

    def _layout(self) -> Layout:
        features: list[Feature] = []
        if self._has_image:
            shape = (self._size[1], self._size[0], 3)
            camera = Element("camera", "camera")
            features.append(Feature(IMAGE, "1", 0.0, _BRIGHTEST, camera, shape))
        if self._has_state:
            features += self._state_layout.features
        return Layout(tuple(features))

    def _space(self) -> gym.Space[Any]:
        low, high = (
            bound.astype(np.float32) for bound in (self._state_layout.low, self._state_layout.high)
        )
        state = gym.spaces.Box(low, high)
        if not self._has_image:
            return state
        image = gym.spaces.Box(0, _BRIGHTEST, (self._size[1], self._size[0], 3), np.uint8)
        return gym.spaces.Dict({"image": image, "state": state}) if self._has_state else image
