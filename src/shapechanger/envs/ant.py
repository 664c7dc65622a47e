"""Ants: run forwards on whatever legs there are."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra

try:
    from gymnasium.envs.mujoco.ant_v5 import AntEnv as GymnasiumAntEnv
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.embodiments.ant import ANT
from shapechanger.embodiments.family import BodyLike
from shapechanger.envs.layouts import contact_features, position_features, velocity_features
from shapechanger.envs.stepping.actions import check_action
from shapechanger.envs.stepping.tuned import Binding, Outcomes, StepResult, TunedStep
from shapechanger.envs.stepping.watch import ModelWatch
from shapechanger.layout import Feature

__all__ = ["AntEnv", "ExtendedAntEnv"]

# An ant this many times higher than it stands has been thrown up. The ceiling of Ant is then 0.98
# m, where Gymnasium has 1.0, and that of BigAnt 1.80 m, where the 2017 release had 2.0.
_HIGHEST_STANDS: Final = 1.9

_NO_TROUBLE: Final = [0, 0, 0]
# What an ant's infos hold, in their order.
_INFO: Final = (
    *("x_position", "y_position", "distance_from_origin", "x_velocity", "y_velocity"),
    *("reward_forward", "reward_ctrl", "reward_contact", "reward_survive"),
)
_sum: Final = np.add.reduce
_all: Final = np.logical_and.reduce
_any: Final = np.logical_or.reduce


class _Ant(Binding):
    """Views of an ant's data, and room for what is computed from them."""

    def __init__(self, watch: ModelWatch, env: AntEnv) -> None:
        super().__init__(watch, env.data, env.frame_skip)
        data = env.data
        self.main_body = env.main_body
        self.main_xy = data.body(self.main_body).xpos[:2]
        self.qpos_xy = data.qpos[:2]
        self.healthy = np.empty(2)
        self.forces = data.cfrc_ext
        self.clipped = np.empty_like(self.forces)
        self.squared = np.empty_like(self.forces)
        self.observed: list[NDArray[np.float64]] = [
            data.qpos[2:] if env.place_hidden else data.qpos,
            data.qvel,
        ]
        self.state_size = sum(view.size for view in self.observed)
        if env.contacts_observed:
            self.observed.append(self.clipped[1:].ravel())
        self.before = [self.main_xy]
        self.after = [data.qpos, data.qvel, self.main_xy, self.healthy]
        self.after += [self.trouble, data.cfrc_ext.ravel()]


class AntEnv(TunedStep, GymnasiumAntEnv):  # pyright: ignore[reportIncompatibleVariableOverride]
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
        fast_model: Whether a model that moves to the last bit like the body's, and costs less, may
            step it, and MuJoCo measures no times (`data.timer`) meanwhile.
        **arguments: All arguments of `Ant-v5`.
    """

    family = ANT
    replaced = (
        *("do_simulation", "_step_mujoco_simulation", "state_vector", "dt"),
        *("_get_obs", "_get_rew", "is_healthy", "healthy_reward", "up"),
        *("control_cost", "contact_cost", "contact_forces"),
    )

    def __init__(
        self,
        body: BodyLike = "Ant",
        healthy_z_range: tuple[float, float] | None = None,
        fast_model: bool = True,
        **arguments: Any,
    ) -> None:
        self.fast_model = fast_model
        self._given_z_range = healthy_z_range
        self.contacts_observed = arguments.get("include_cfrc_ext_in_observation", True)
        self.place_hidden = arguments.get("exclude_current_positions_from_observation", True)
        self._force_range = arguments.get("contact_force_range", (-1.0, 1.0))
        self._begin(body, arguments)
        cast("Any", GymnasiumAntEnv).__init__(
            self, healthy_z_range=healthy_z_range or (-math.inf, math.inf), **arguments
        )
        self._finish({"healthy_z_range": healthy_z_range, "fast_model": fast_model, **arguments})

    def _follow_body(self) -> None:
        super()._follow_body()
        if self._given_z_range is None:
            stands = self.standing_height
            highest = math.inf if stands is None else _HIGHEST_STANDS * stands
            self._healthy_z_range = (-math.inf, highest)

    @property
    def main_body(self) -> int | str:
        """The body whose velocity is rewarded."""
        return self._main_body

    def _bind(self, watch: ModelWatch) -> _Ant:
        return _Ant(watch, self)

    def _advance(self, bound: _Ant, action: Any, out: NDArray[np.float64] | None) -> StepResult:
        # Gymnasium's `step`, `_get_obs`, `_get_rew` and `is_healthy`, each number computed once, in
        # their order and precision: the cost of an action is summed in the action's own.
        if type(action) is not np.ndarray or action.shape != bound.shape:
            action = check_action(self, action)
        ctrl_cost = self._ctrl_cost_weight * _sum(np.square(action), axis=None)
        if not math.isfinite(ctrl_cost):
            check_action(self, action)
        x_before, y_before = bound.main_xy.tolist()
        bound.ctrl[:] = action
        with bound.stopwatch:
            bound.move()
        x_after, y_after = bound.main_xy.tolist()
        x_velocity = np.float64((x_after - x_before) / bound.dt)
        y_velocity = np.float64((y_after - y_before) / bound.dt)

        bound.forces.clip(*self._contact_force_range, out=bound.clipped)
        observation = np.concatenate(bound.observed, out=out)

        qpos = bound.qpos
        x, y, z, _, up_x, up_y = qpos[:6].tolist()
        # A sum is finite only if every number is; one that is not may have overflowed.
        finite = math.isfinite(sum(observation[: bound.state_size].tolist()) + x + y) or bool(
            np.isfinite(qpos).all() and np.isfinite(bound.qvel).all()
        )
        lowest, highest = self._healthy_z_range
        healthy = (
            finite and lowest <= z <= highest and 1.0 - 2.0 * (up_x * up_x + up_y * up_y) > 0.0
        )

        forward_reward = x_velocity * self._forward_reward_weight
        healthy_reward = healthy * self._healthy_reward
        contact_cost = self._contact_cost_weight * _sum(
            np.square(bound.clipped, out=bound.squared), axis=None
        )
        reward = (forward_reward + healthy_reward) - (ctrl_cost + contact_cost)
        info: dict[str, Any] = {
            "x_position": qpos[0],
            "y_position": qpos[1],
            "distance_from_origin": np.float64(math.sqrt(bound.qpos_xy.dot(bound.qpos_xy))),
            "x_velocity": x_velocity,
            "y_velocity": y_velocity,
            "reward_forward": forward_reward,
            "reward_ctrl": -ctrl_cost,
            "reward_contact": -contact_cost,
            "reward_survive": healthy_reward,
        }
        if bound.trouble.tolist() != _NO_TROUBLE:
            info["diverged"] = True
        if self.render_mode == "human":
            self.render()
        return observation, reward, not healthy and self._terminate_when_unhealthy, False, info

    def _kind_of(self, bound: _Ant) -> Hashable:
        if self.render_mode == "human":
            return None
        bound.healthy[:] = self._healthy_z_range
        kind: tuple[Any, ...] = (
            *(self.tuned, bound.qpos.size, bound.qvel.size, bound.forces.size, bound.dt),
            *(self.place_hidden, self.contacts_observed, tuple(self._contact_force_range)),
            *(self._forward_reward_weight, self._healthy_reward, self._terminate_when_unhealthy),
            *(self._ctrl_cost_weight, self._contact_cost_weight),
        )
        return kind, tuple(cast("type[Any]", type(part)) for part in kind)

    def conclude(
        self, before: NDArray[np.float64], after: NDArray[np.float64], actions: NDArray[Any]
    ) -> Outcomes:
        """What ants of this kind see and are given; `_advance` for all of them at once."""
        bound: _Ant = self._bound
        size = bound.qpos.size + bound.qvel.size
        place, state = after[:, :2], after[:, :size]
        main_xy, limits = after[:, size : size + 2], after[:, size + 2 : size + 4]
        trouble, forces = after[:, size + 4 : size + 7].view(np.int64), after[:, size + 7 :]
        ctrl_cost = self._ctrl_cost_weight * _sum(np.square(actions, order="C"), axis=1)
        with np.errstate(over="ignore", invalid="ignore"):  # As of Python's own numbers.
            velocity = (main_xy - before) / bound.dt
            tilt = np.square(after[:, 4:6])
            z, lean = after[:, 2], tilt[:, 0] + tilt[:, 1]
            # `1 - 2 * lean > 0` of `_advance` is this to the last bit: near 0.5 it is exact.
            stands = (limits[:, 0] <= z) & (z <= limits[:, 1]) & (lean < 0.5)
            # The same function as that of `dot`, which need not round a sum of products as NumPy.
            distance = np.sqrt(np.vecdot(place, place))
        healthy = stands & _all(np.isfinite(state), axis=1)
        clipped = forces.clip(*self._contact_force_range)
        observed = [state[:, 2:] if self.place_hidden else state]
        if self.contacts_observed:
            observed.append(clipped[:, bound.forces.shape[1] :])
        observations = np.concatenate(observed, axis=1)
        forward_reward = velocity[:, 0] * self._forward_reward_weight
        healthy_reward = [well * self._healthy_reward for well in healthy.tolist()]
        contact_cost = self._contact_cost_weight * _sum(np.square(clipped, out=clipped), axis=1)
        reward = (forward_reward + healthy_reward) - (ctrl_cost + contact_cost)
        columns = (
            *(place[:, 0], place[:, 1], distance, velocity[:, 0], velocity[:, 1]),
            *(forward_reward, -ctrl_cost, -contact_cost, healthy_reward),
        )
        return Outcomes(
            observations,
            reward,
            ~healthy & bool(self._terminate_when_unhealthy),
            dict(zip(_INFO, columns, strict=True)),
            np.flatnonzero(_any(trouble, axis=1)).tolist() if _any(trouble, axis=None) else (),
        )

    def _observation_features(self, model: Any) -> list[Feature]:
        features = position_features(model)[2 if self.place_hidden else 0 :]
        features += velocity_features(model)
        if self.contacts_observed:
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


AntEnv.tuned = AntEnv


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
