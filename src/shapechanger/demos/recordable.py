"""What of an env can be recorded: its pictures, its state, and what its actions mean.

An env may offer more than its spaces say. What is looked for, and left out where it is not there:

- `env.unwrapped.newest_jpeg`: the bytes of the picture in the newest observation, as received;
- `env.unwrapped.welcome.robot` and `.body`: name of the robot, and what it is;
- `env.unwrapped.record_clock`: "real" or "twin", where the times below come from;
- `info["captured_ns"]`: when the picture of this observation was taken, or its state was read;
- `info["decided_ns"]`: when the command of this step reached the robot; same clock;
- `info["action_applied"]`, `info["stop_reason"]`, `info["reward_terms"]`, `info["absent"]`;
- `info["intervene_action"]`: what a person did in place of the action of this step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.errors import DemosError, MissingExtra
from shapechanger.layout import Layout

try:
    import simplejpeg
except ImportError as error:
    raise MissingExtra("simplejpeg", "data") from error

__all__ = ["Seen", "Sight"]

_PICTURE_DIMENSIONS: Final = 3
_CHANNELS: Final = 3


@dataclass(frozen=True, slots=True)
class Seen:
    """What one observation is recorded as.

    Attributes:
        jpeg: Its picture; None without one.
        state: Its numbers; NaN where nothing measures one.
        captured_ns: When it was taken, clock of the robot; None where nobody says.
    """

    jpeg: bytes | None
    state: tuple[float, ...]
    captured_ns: int | None


class Sight:
    """Takes the observations of an env apart.

    Args:
        env: Its observations are a picture, a state, or a Dict of `image` and `state`.
        quality: Of pictures that the env gives as arrays, in percent; their colours are kept at
            full resolution.

    Attributes:
        action_layout: What the numbers of an action mean.
        state_layout: What the numbers of a state mean; None without a state.
        has_picture: Whether there are pictures.

    Raises:
        DemosError: If it shows or takes something else, or does not say what that means.
    """

    def __init__(self, env: gym.Env[Any, Any], quality: int) -> None:
        if not 1 <= quality <= 100:  # Percent.
            raise DemosError(f"The quality of a picture is 1 to 100 %, got {quality}.")
        self._env, self._quality = env, quality
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        space = env.observation_space
        self._is_dict = isinstance(space, spaces.Dict)
        parts: Mapping[str, gym.Space[Any]] = (
            cast("Any", space).spaces
            if self._is_dict
            else {"image" if _is_picture(space) else "state": space}
        )
        picture, state = parts.get("image"), parts.get("state")
        if (
            not parts
            or not parts.keys() <= {"image", "state"}
            or (picture is not None and not _is_picture(picture))
            or (state is not None and not _is_row(state))
        ):
            raise DemosError(
                f"{name} shows {space}, and what can be recorded is a picture (bytes, height x "
                "width x 3), a row of numbers, or a Dict of both as `image` and `state`."
            )
        self.has_picture, self._has_state = picture is not None, state is not None
        seen, self.action_layout = (_layout(env, name, s) for s in ("observation", "action"))
        numbers = tuple(f for f in seen if len(f.shape) != _PICTURE_DIMENSIONS)
        self.state_layout = Layout(numbers) if state is not None else None
        self._places = self.state_layout.slices if self.state_layout else {}
        for what, part, layout in (
            ("state", state, self.state_layout),
            ("action", env.action_space, self.action_layout),
        ):
            if part is None or layout is None:
                continue
            if not _is_row(part) or part.shape != (layout.size,):
                raise DemosError(
                    f"{name}: each {what} is {part}, and its layout has {layout.size} numbers."
                )

    def seen(self, observation: Any, info: Mapping[str, Any]) -> Seen:
        """What an observation is recorded as."""
        return Seen(
            self._jpeg(observation["image"] if self._is_dict else observation)
            if self.has_picture
            else None,
            self._state(observation, info) if self._has_state else (),
            info.get("captured_ns"),
        )

    def _jpeg(self, picture: NDArray[np.uint8]) -> bytes:
        given: bytes | None = getattr(self._env.unwrapped, "newest_jpeg", None)
        if given is not None:
            return given
        return simplejpeg.encode_jpeg(
            np.ascontiguousarray(picture), quality=self._quality, colorsubsampling="444"
        )

    def _state(self, observation: Any, info: Mapping[str, Any]) -> tuple[float, ...]:
        given = observation["state"] if self._is_dict else observation
        state = np.array(given, np.float64).ravel()
        for name in info.get("absent", ()):
            if name in self._places:
                state[self._places[name]] = math.nan
        return tuple(state.tolist())


def _is_picture(space: gym.Space[Any]) -> bool:
    return (
        isinstance(space, spaces.Box)
        and cast("Any", space).dtype == np.uint8
        and len(space.shape) == _PICTURE_DIMENSIONS
        and space.shape[-1] == _CHANNELS
    )


def _is_row(space: gym.Space[Any]) -> bool:
    return isinstance(space, spaces.Box) and len(space.shape) == 1


def _layout(env: gym.Env[Any, Any], name: str, side: str) -> Layout:
    layout = getattr(env.unwrapped, f"{side}_layout", None)
    if not isinstance(layout, Layout):
        raise DemosError(
            f"{name} publishes no {side}_layout, so nothing says what its numbers mean: add it to "
            "the env, as a `shapechanger.Layout`."
        )
    return layout
