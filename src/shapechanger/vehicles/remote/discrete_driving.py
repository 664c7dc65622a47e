"""Action wrapper with the four keys of the original release of 2017."""

from __future__ import annotations

from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import SpaceMismatch

FOUR_WAYS: Final = ("forward", "backward", "right", "left")
"""Meanings of the actions 0 to 3, in the order of columns in `labels.csv` of the 2017 release."""


class DiscreteDriving(gym.ActionWrapper[Any, np.int64, NDArray[np.float32]]):
    """Wrapper for driving with one of four keys, like the car of the original release of 2017.

    In the original release, an action was a one-hot vector of four numbers, and steering keys did
    not drive.

    Args:
        env: An env whose action is [steering, throttle], in [-1, 1].
        throttle: Throttle of forward and backward, 0 to 1.
        steering: Steering of right and left, 0 to 1.
        throttle_in_turns: Throttle of right and left, -1 to 1; 0 as in the original release.

    Raises:
        SpaceMismatch: If the env's actions are not two numbers.
    """

    def __init__(
        self,
        env: gym.Env[Any, NDArray[np.float32]],
        throttle: float = 1.0,
        steering: float = 1.0,
        throttle_in_turns: float = 0.0,
    ) -> None:
        if env.action_space.shape != (2,):
            raise SpaceMismatch(
                f"The env's actions must be [steering, throttle], got {env.action_space}."
            )
        super().__init__(env)
        self.action_space = gym.spaces.Discrete(len(FOUR_WAYS))
        ways = (0.0, throttle), (0.0, -throttle)
        turns = (steering, throttle_in_turns), (-steering, throttle_in_turns)
        self._actions = np.array((*ways, *turns), np.float32)

    def action(self, action: np.int64 | int) -> NDArray[np.float32]:
        """Return [steering, throttle] of an action; see `FOUR_WAYS`."""
        if not self.action_space.contains(action):
            keys = ", ".join(f"{number} ({way})" for number, way in enumerate(FOUR_WAYS))
            raise SpaceMismatch(f"An action must be {keys}, got {action!r}.")
        return self._actions[int(action)].copy()
