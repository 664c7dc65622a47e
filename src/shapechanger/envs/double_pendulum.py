"""The inverted double pendulum: keep two poles up by pushing the cart."""

from __future__ import annotations

from typing import Any, Final, cast

import gymnasium as gym

from shapechanger.errors import MissingExtra, MorphologyError

try:
    import mujoco
    from gymnasium.envs.mujoco.inverted_double_pendulum_v5 import (
        InvertedDoublePendulumEnv as GymnasiumInvertedDoublePendulumEnv,
    )
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.family import BodyLike
from shapechanger.embodiments.plain import DOUBLE_PENDULUM
from shapechanger.envs.layouts import position_features, velocity_features
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Element, Feature
from shapechanger.morphology import compile_body

__all__ = ["InvertedDoublePendulumEnv"]

# Where Gymnasium clips the velocities, m/s and rad/s, and the force on the cart, N.
_CLIPPED_AT: Final = 10.0
# The poles have fallen when their tip is no higher than this, m, on the model as it is.
_FALLEN_M: Final = 1.0
_JOINTS: Final = (
    mujoco.mjtJoint.mjJNT_SLIDE,
    mujoco.mjtJoint.mjJNT_HINGE,
    mujoco.mjtJoint.mjJNT_HINGE,
)


class InvertedDoublePendulumEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Reshapable, GymnasiumInvertedDoublePendulumEnv
):
    """Gymnasium's `InvertedDoublePendulum-v5` with any body that edits make of it.

    Actions, observations, rewards, infos and the start are those of `InvertedDoublePendulum-v5`;
    `observation_layout` and `action_layout` name each number. Reward and end read the height of the
    poles' tip in parts of their length: Gymnasium's 1 m, of poles that reach up 1.2 m, is 2 m for
    poles twice as long.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON. It
            has two hinges, as the observation and the reward count on them.
        **arguments: All arguments of `InvertedDoublePendulum-v5`.
    """

    family = DOUBLE_PENDULUM

    def __init__(self, body: BodyLike = "InvertedDoublePendulum", **arguments: Any) -> None:
        self._begin(body, arguments)
        cast("Any", GymnasiumInvertedDoublePendulumEnv).__init__(self, **arguments)
        self._finish(arguments)

    def _follow_body(self) -> None:
        super()._follow_body()
        self._fallen = False
        self._foot_m, self._length_m = _foot_and_length(self.model)
        plain = compile_body(self.family.load(self.fullpath), ())
        self._plain_foot_m, self._plain_length_m = _foot_and_length(plain)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        _foot_and_length(model)
        positions = position_features(model)
        hinges = [feature.element for feature in positions[1:]]
        cart = cast("Element", positions[0].element)
        return [
            positions[0],
            *(
                Feature(f"{cast('Element', hinge).name}/{function}", "1", -1.0, 1.0, hinge)
                for function in ("sin", "cos")
                for hinge in hinges
            ),
            *velocity_features(model, _CLIPPED_AT),
            Feature(f"{cart.name}/constraint_force", "N", -_CLIPPED_AT, _CLIPPED_AT, cart),
        ]

    def step(self, action: Any) -> Any:
        """One step of Gymnasium's env, with the end that fits the length of the poles."""
        observation, reward, _, truncated, info = cast("Any", super()).step(action)
        return observation, reward, self._fallen, truncated, info

    def _get_rew(self, x: float, y: float, terminated: bool) -> tuple[float, dict[str, float]]:
        """Gymnasium's reward for poles of any length.

        Args:
            x: Where the tip is along the rail, m.
            y: How high it is, m.
            terminated: What Gymnasium makes of that height, which does not know the length.
        """
        part = (y - self._foot_m) * (self._plain_length_m / self._length_m)
        height = part + self._plain_foot_m
        self._fallen = bool(height <= _FALLEN_M)
        return cast("Any", super())._get_rew(x, height, self._fallen)


def _foot_and_length(model: mujoco.MjModel) -> tuple[float, float]:
    """How high the first pole's hinge is, and how far above it the tip when both are upright, m.

    Raises:
        MorphologyError: If the model is no double pendulum.
    """
    if tuple(model.jnt_type) == tuple(int(kind) for kind in _JOINTS) and model.nsite > 0:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        foot = float(data.xanchor[1, 2])
        length = float(data.site_xpos[0, 2]) - foot
        if length > 0.0:
            return foot, length
    raise MorphologyError(
        "A double pendulum needs a cart on a slide, two poles on hinges and a tip above them: its "
        "observation and its reward count on these."
    )
