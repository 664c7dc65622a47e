"""The humanoid: run forwards on two legs."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym

from shapechanger.errors import MissingExtra

try:
    import mujoco
    from gymnasium.envs.mujoco.humanoid_v5 import HumanoidEnv as GymnasiumHumanoidEnv
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.family import BodyLike
from shapechanger.embodiments.plain import HUMANOID
from shapechanger.envs.layouts import (
    contact_features,
    drive_features,
    inertia_features,
    twist_features,
)
from shapechanger.envs.runner import IN_SPACE, HealthyRunner
from shapechanger.layout import Feature

__all__ = ["HumanoidEnv"]


class HumanoidEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumHumanoidEnv
):
    """Gymnasium's `Humanoid-v5` with any body that edits make of it.

    Actions, observations, rewards and infos are those of `Humanoid-v5`. See `HealthyRunner` for the
    arguments, and for the start pose and the healthy heights, which follow from the body: the knees
    start bent by 2 degrees, which is their limit, where Gymnasium's start straight.
    """

    family = HUMANOID
    root = IN_SPACE
    place_size = 2

    def _begin(self, body: BodyLike, arguments: dict[str, Any]) -> None:
        blocks = {
            "cinert": inertia_features,
            "cvel": twist_features,
            "qfrc_actuator": drive_features,
            "cfrc_ext": _unclipped_contact_features,
        }
        self._blocks = [
            features
            for name, features in blocks.items()
            if arguments.get(f"include_{name}_in_observation", True)
        ]
        super()._begin(body, arguments)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        features = super()._observation_features(model)
        for block in self._blocks:
            features += block(model)
        return features


def _unclipped_contact_features(model: mujoco.MjModel) -> list[Feature]:
    return contact_features(model, -math.inf, math.inf)
