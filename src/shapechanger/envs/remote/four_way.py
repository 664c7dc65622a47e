"""The action of 2017: one of four keys."""

from __future__ import annotations

import operator
from contextlib import suppress
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import SpaceMismatch

__all__ = ["FOUR_WAYS", "FourWay"]

FOUR_WAYS: Final = ("forward", "backward", "right", "left")
"""What the numbers 0 to 3 mean, in the order of the columns of 2017's `labels.csv`."""

_STEERING_THROTTLE: Final = 2


class FourWay(gym.ActionWrapper[Any, np.int64, NDArray[np.float32]]):
    """Drive with one of four keys, as the car of 2017 was driven.

    In 2017 an action was four numbers of which one was 1. A key that steers did not drive.

    Args:
        env: An env whose action is [steering, throttle], in [-1, 1].
        throttle: How much forward and backward are, 0 to 1.
        steering: How much right and left are, 0 to 1.
        throttle_in_turns: How much right and left drive, -1 to 1; 0 as in 2017.

    Raises:
        SpaceMismatch: If the env has other actions.
    """

    def __init__(
        self,
        env: gym.Env[Any, NDArray[np.float32]],
        throttle: float = 1.0,
        steering: float = 1.0,
        throttle_in_turns: float = 0.0,
    ) -> None:
        if env.action_space.shape != (_STEERING_THROTTLE,):
            raise SpaceMismatch(
                f"Four keys drive what has [steering, throttle]; this env has {env.action_space}."
            )
        super().__init__(env)
        self.action_space = gym.spaces.Discrete(len(FOUR_WAYS))
        self._actions = np.array(
            [
                (0.0, throttle),
                (0.0, -throttle),
                (steering, throttle_in_turns),
                (-steering, throttle_in_turns),
            ],
            np.float32,
        )

    def action(self, action: np.int64 | int) -> NDArray[np.float32]:
        """[steering, throttle] of a key, see `FOUR_WAYS`.

        Raises:
            SpaceMismatch: If it is the number of no key.
        """
        key = -1
        with suppress(TypeError):  # Neither 1.5 nor a list nor text is a whole number.
            key = operator.index(action)
        if not 0 <= key < len(FOUR_WAYS):
            keys = ", ".join(f"{number} ({way})" for number, way in enumerate(FOUR_WAYS))
            raise SpaceMismatch(f"The four keys are {keys}; got {action!r}.")
        return self._actions[key].copy()
