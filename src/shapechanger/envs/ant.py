"""Ants: run forwards on whatever legs there are."""

from __future__ import annotations

import math
from typing import Any, Final, cast

import gymnasium as gym

from shapechanger.errors import MissingExtra

try:
    from gymnasium.envs.mujoco.ant_v5 import AntEnv as GymnasiumAntEnv
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.ant import ANT
from shapechanger.embodiments.family import BodyLike
from shapechanger.envs.layouts import contact_features, position_features, velocity_features
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Feature

__all__ = ["AntEnv", "ExtendedAntEnv"]

# An ant this many times higher than it stands has been thrown up. The ceiling of Ant is then 0.98
# m, where Gymnasium has 1.0, and that of BigAnt 1.80 m, where the 2017 release had 2.0.
_HIGHEST_STANDS: Final = 1.9


class AntEnv(Reshapable, GymnasiumAntEnv):  # pyright: ignore[reportIncompatibleVariableOverride]
    """Gymnasium's `Ant-v5` with any body of the family of ants.

    Actions, observations, rewards and infos are those of `Ant-v5`; `observation_layout` and
    `action_layout` name each number. Three things follow from the body:

    - **Start pose**: the model's own, with each joint moved a tenth of its range inside its limits,
      and the torso no lower than the feet need. Noise is drawn as in `Ant-v5`; joints stay inside
      their limits and feet above the floor.
    - **Healthy range**: an ant is unhealthy when its torso's up axis points down, when it is higher
      than 1.9 times its own standing height, or when its state is not finite. A fixed lower height
      cannot tell a flipped ant, which rests at 0.27 m, from one that lies down.
    - **Spaces**: an ant with more joints has more numbers.

    Args:
        body: Name of an ant, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Heights of the torso between which the ant is healthy, m; None derives the
            upper one from the body and sets no lower one.
        **arguments: All arguments of `Ant-v5`.
    """

    family = ANT

    def __init__(
        self,
        body: BodyLike = "Ant",
        healthy_z_range: tuple[float, float] | None = None,
        **arguments: Any,
    ) -> None:
        self._given_z_range = healthy_z_range
        self._contacts_observed = arguments.get("include_cfrc_ext_in_observation", True)
        self._place_hidden = arguments.get("exclude_current_positions_from_observation", True)
        self._force_range = arguments.get("contact_force_range", (-1.0, 1.0))
        self._begin(body, arguments)
        cast("Any", GymnasiumAntEnv).__init__(
            self, healthy_z_range=healthy_z_range or (-math.inf, math.inf), **arguments
        )
        self._finish({"healthy_z_range": healthy_z_range, **arguments})

    def _follow_body(self) -> None:
        super()._follow_body()
        if self._given_z_range is None:
            stands = self.standing_height
            highest = math.inf if stands is None else _HIGHEST_STANDS * stands
            self._healthy_z_range = (-math.inf, highest)

    def _observation_features(self, model: Any) -> list[Feature]:
        features = position_features(model)[2 if self._place_hidden else 0 :]
        features += velocity_features(model)
        if self._contacts_observed:
            features += contact_features(model, *self._force_range)
        return features

    @property
    def healthy_z_range(self) -> tuple[float, float]:
        """Heights of the torso between which the ant is healthy, m."""
        return self._healthy_z_range

    @property
    def up(self) -> float:
        """How far the torso's up axis points up: 1 upright, 0 on its side, -1 upside down."""
        x, y = self.data.qpos[4:6]
        return float(1.0 - 2.0 * (x * x + y * y))

    @property
    def is_healthy(self) -> bool:
        """Whether the state is finite, the torso upright and not higher than it should be."""
        return bool(super().is_healthy) and self.up > 0.0


class ExtendedAntEnv(AntEnv):
    """The ant with a third segment on each leg, so that both its spaces differ from the ant's.

    Args:
        body: As in `AntEnv`; None for the extended ant.
        actuated_extension: Whether the third segments have motors of their own, 12 in all; the 2017
            release had none there, 8 in all.
        **arguments: All arguments of `AntEnv`.
    """

    def __init__(
        self,
        body: BodyLike | None = None,
        actuated_extension: bool = True,
        **arguments: Any,
    ) -> None:
        if body is None:
            body = "ExtendedAnt" if actuated_extension else "ExtendedAntPassive"
        super().__init__(body, **arguments)
