"""From the JPEG of a robot to the picture of an observation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LinkError, MissingExtra, RobotRefused, SpaceMismatch
from shapechanger.layout import Element, Feature, Layout
from shapechanger.link.messages import Observation, Welcome
from shapechanger.remote.inbox import Received
from shapechanger.tasks.drive import DriveReward

__all__ = ["BUMP", "IMAGE", "RobotSpaces", "StepScorer", "View", "decode_picture", "resize_picture"]

try:
    import simplejpeg  # pyright: ignore[reportMissingTypeStubs]  # Typed, but for its arrays.
except ImportError as error:
    raise MissingExtra("simplejpeg", "remote") from error


# Pixels. A few bytes of JPEG can claim a picture of 65,535 x 65,535, which is 12 GB.
_MOST_PIXELS: Final = 4096 * 4096


def decode_picture(jpeg: bytes) -> NDArray[np.uint8]:
    """The picture, RGB, shape (height, width, 3).

    Raises:
        LinkError: If these bytes are no picture, or one too large to be meant.
    """
    try:
        height, width = (int(n) for n in simplejpeg.decode_jpeg_header(jpeg)[:2])
        if height * width > _MOST_PIXELS:
            raise LinkError(f"A picture of {width} x {height} pixels is too large.")
        return simplejpeg.decode_jpeg(jpeg, colorspace="RGB")
    except ValueError as error:
        raise LinkError(f"The robot sent bytes that are no JPEG: {error}.") from None


def resize_picture(picture: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """The picture at another size, without a library for it.

    Where width and height shrink by whole numbers, each pixel is the mean of its box, rounded.
    Otherwise each is the pixel nearest to its middle. The whole picture is kept, so a change of
    proportions stretches it.

    Args:
        picture: Shape (height, width, 3).
        size: Width and height in pixels, each at least 1.

    Returns:
        Shape (size[1], size[0], 3); the picture itself where the size is its own.
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


class RobotSpaces:
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
            self._picture = decode_picture(received.jpeg)
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
        image = resize_picture(self._picture, self._size)
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


BUMP: Final = "bump"
"""Name of the event of a bump, and of the quantity."""

_NS_PER_S: Final = 1e9
_QUANTITIES: Final = ("speed", "collision", "stall")


class StepScorer:
    """Judges the steps of one robot, one after another.

    Args:
        senses: Reads the robot's messages.
        reward: Weights of the task.
    """

    def __init__(self, senses: RobotSpaces, reward: DriveReward) -> None:
        self._senses = senses
        self._reward = reward
        self._touched = False

    def start(self, seen: Observation) -> None:
        """Begin an episode: what it touches now is no collision of this episode."""
        self._touched = bool(self._touches(seen)[0])

    def judge(
        self, before: Observation, seen: Observation, bumped: bool
    ) -> tuple[bool, dict[str, float]]:
        """Whether the task is over, and the terms of the reward.

        Args:
            before: The observation before.
            seen: The one after.
            bumped: Whether there was a bump, which may be over by now.
        """
        touches = self._touches(seen)[0]
        stall = self._senses.quantity(seen, "stall")
        hits = bool(touches) or bumped
        collided = None if touches is None else hits and not self._touched
        self._touched = hits
        dt_s = max(0, seen.state_ns - before.state_ns) / _NS_PER_S
        speed = self._senses.quantity(seen, "speed")
        stalled = None if stall is None else bool(stall)
        return self._reward.ends(collided), self._reward.terms(speed, collided, stalled, dt_s)

    def sources(self, seen: Observation) -> dict[str, str]:
        """Which sensor each quantity of the reward comes from."""
        sources = {name: self._senses.source(seen, name) for name in _QUANTITIES}
        return sources | {"collision": self._touches(seen)[1]}

    def _touches(self, seen: Observation) -> tuple[float | None, str]:
        """Whether it touches something, 0 or 1, and which sensor says so."""
        for quantity in ("collision", BUMP):
            value = self._senses.quantity(seen, quantity)
            if value is not None:
                return value, self._senses.source(seen, quantity)
        return None, _ABSENT
