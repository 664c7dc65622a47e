"""A small env to record, whose position is observed as an image, a state, or both."""

from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.layout import Feature, Layout

Shows = Literal["picture", "state", "both"]
SIZE = (24, 32)


class CorridorEnv(gym.Env[Any, NDArray[np.float32]]):
    """Walk ahead by the throttle, up to a wall at 2 m.

    Attributes:
        done: Actions applied so far.
        more: Additional entries of `info`.
    """

    metadata: dict[str, Any] = {"render_modes": [], "render_fps": 10}  # noqa: RUF012

    def __init__(self, shows: Shows = "both") -> None:
        picture = spaces.Box(0, 255, (*SIZE, 3), np.uint8)
        state = spaces.Box(-np.inf, np.inf, (2,), np.float32)
        self._shows = shows
        camera = Feature("camera/image", "1", 0.0, 255.0, shape=(*SIZE, 3))
        numbers = (Feature("way", "m"), Feature("battery", "V"))
        parts: dict[Shows, tuple[gym.Space[Any], tuple[Feature, ...]]] = {
            "picture": (picture, (camera,)),
            "state": (state, numbers),
            "both": (spaces.Dict({"image": picture, "state": state}), (camera, *numbers)),
        }
        self.observation_space, features = parts[shows]
        self.observation_layout = Layout(features)
        both = ("steering", "throttle")
        self.action_layout = Layout(tuple(Feature(name, "1", -1.0, 1.0) for name in both))
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.done: list[list[float]] = []
        self.more: dict[str, Any] = {}
        self._way = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset; a seed of n starts n centimetres ahead."""
        super().reset(seed=seed)
        self._way = 0.0 if seed is None else 0.01 * seed
        return self._seen(), {**self.more}

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.done.append([float(value) for value in action])
        self._way += 0.1 * float(action[1])
        hit = self._way >= 2.0
        terms = {"reward_velocity": 0.1 * float(action[1]), "reward_collision": -10.0 * hit}
        info = {
            "action_applied": np.array([action[0], 0.5 * action[1]], np.float32),
            "stop_reason": "",
            "reward_terms": terms,
            **self.more,
        }
        return self._seen(), sum(terms.values()), hit, False, info

    def demonstrator(self, seed: int) -> "AlwaysForward":
        return AlwaysForward()

    def _seen(self) -> Any:
        picture = np.full((*SIZE, 3), min(255, round(100 * self._way)), np.uint8)
        picture[: SIZE[0] // 2, :, 0] = 250
        state = np.array([self._way, 7.5], np.float32)
        if self._shows == "both":
            return {"image": picture, "state": state}
        return picture if self._shows == "picture" else state


class AlwaysForward:
    """An expert that intends to go straight at half throttle, and executes a steering error."""

    def begin(self) -> None:
        """Do nothing."""

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return np.array([0.0, 0.5], np.float32), np.array([0.25, 0.5], np.float32)
