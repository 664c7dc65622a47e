"""Inverted pendulums: keep the pole up by pushing the cart."""

from __future__ import annotations

from typing import Any, Final, cast

import gymnasium as gym

from shapechanger.errors import MissingExtra, MorphologyError

try:
    import mujoco
    from gymnasium.envs.mujoco.inverted_pendulum_v5 import (
        InvertedPendulumEnv as GymnasiumInvertedPendulumEnv,
    )
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.family import BodyLike
from shapechanger.embodiments.pendulum import PENDULUM
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Feature

__all__ = ["InvertedPendulumEnv"]

_CART_AND_POLE: Final = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))


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

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        if tuple(model.jnt_type[:2]) != _CART_AND_POLE:
            raise MorphologyError(
                "A pendulum needs a cart on a slide and a pole on a hinge, in this order: the end "
                "of an episode is read from the hinge."
            )
        return super()._observation_features(model)
