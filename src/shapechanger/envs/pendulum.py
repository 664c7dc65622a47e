"""Inverted pendulums: keep the pole up by pushing the cart."""

from __future__ import annotations

import math
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

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
from shapechanger.envs.stepping.actions import check_action
from shapechanger.envs.stepping.tuned import NO_WARNINGS, Binding, StepResult, TunedStep
from shapechanger.envs.stepping.watch import ModelWatch
from shapechanger.layout import Feature

__all__ = ["InvertedPendulumEnv"]

_CART_AND_POLE: Final = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))

# The lean at which Gymnasium ends an episode.
_FALLEN_RAD: Final = 0.2


class _Pendulum(Binding):
    """Views of a pendulum's data."""

    def __init__(self, watch: ModelWatch, env: InvertedPendulumEnv) -> None:
        super().__init__(watch, env.data, env.frame_skip)
        self.observed = [env.data.qpos, env.data.qvel]


class InvertedPendulumEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    TunedStep, GymnasiumInvertedPendulumEnv
):
    """Gymnasium's `InvertedPendulum-v5` with any body of the family of pendulums.

    Actions, observations, rewards, infos and the start are those of `InvertedPendulum-v5`;
    `observation_layout` and `action_layout` name each number. An episode ends when the pole leans
    by more than 0.2 rad, whatever its length.

    Args:
        body: Name of a pendulum, edits of `shapechanger.morphology`, or their JSON.
        fast_model: Whether a model that moves to the last bit like the body's, and costs less, may
            step it, and MuJoCo measures no times (`data.timer`) meanwhile.
        **arguments: All arguments of `InvertedPendulum-v5`.
    """

    family = PENDULUM
    replaced = ("do_simulation", "_step_mujoco_simulation", "_get_obs")

    def __init__(
        self, body: BodyLike = "InvertedPendulum", fast_model: bool = True, **arguments: Any
    ) -> None:
        self.fast_model = fast_model
        self._begin(body, arguments)
        cast("Any", GymnasiumInvertedPendulumEnv).__init__(self, **arguments)
        self._finish({"fast_model": fast_model, **arguments})

    def _bind(self, watch: ModelWatch) -> _Pendulum:
        return _Pendulum(watch, self)

    def _advance(
        self, bound: _Pendulum, action: Any, out: NDArray[np.float64] | None
    ) -> StepResult:
        # Gymnasium's `step`, with each number computed once.
        if type(action) is not np.ndarray or action.shape != bound.shape:
            action = check_action(self, action)
        if not math.isfinite(sum(action.tolist())):
            check_action(self, action)
        bound.ctrl[:] = action
        with bound.timer:
            bound.move()
        observation = np.concatenate(bound.observed, out=out)
        numbers = observation.tolist()
        # A sum is finite only if every number is; one that is not may have overflowed.
        finite = math.isfinite(sum(numbers)) or bool(np.isfinite(observation).all())
        terminated = not finite or abs(numbers[1]) > _FALLEN_RAD
        reward = int(not terminated)
        info: dict[str, Any] = {"reward_survive": reward}
        if bound.warnings.tolist() != NO_WARNINGS:
            info["diverged"] = True
        if self.render_mode == "human":
            self.render()
        return observation, reward, terminated, False, info

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        if tuple(model.jnt_type[:2]) != _CART_AND_POLE:
            raise MorphologyError(
                "A pendulum needs a cart on a slide and a pole on a hinge, in this order: the end "
                "of an episode is read from the hinge."
            )
        return super()._observation_features(model)


InvertedPendulumEnv.tuned = InvertedPendulumEnv
