"""Inverted pendulums: keep the pole up by pushing the cart."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym

from shapechanger.errors import MissingExtra

try:
    from gymnasium.envs.mujoco.inverted_pendulum_v5 import (
        InvertedPendulumEnv as GymnasiumInvertedPendulumEnv,
    )
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.family import BodyLike
from shapechanger.embodiments.pendulum import PENDULUM
from shapechanger.envs.reshapable import Reshapable

__all__ = ["InvertedPendulumEnv"]


class InvertedPendulumEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Reshapable, GymnasiumInvertedPendulumEnv
):
    """Gymnasium's `InvertedPendulum-v5` with any body of the family of pendulums.

    Actions, observations, rewards, infos and the start are those of `InvertedPendulum-v5`;
    `observation_layout` and `action_layout` name each number. An episode ends when the pole leans
    by more than 0.2 rad, whatever its length.

    Args:
        body: Name of a pendulum, edits of `shapechanger.morphology`, or their JSON.
        **arguments: All arguments of `InvertedPendulum-v5`.
    """

    family = PENDULUM

    def __init__(self, body: BodyLike = "InvertedPendulum", **arguments: Any) -> None:
        self._begin(body, arguments)
        cast("Any", GymnasiumInvertedPendulumEnv).__init__(self, **arguments)
        self._finish(arguments)
