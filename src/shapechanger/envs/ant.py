"""The ant, a sphere on four legs, each with a hip and an ankle, and its envs: run forwards.

The model is `ant.xml` of Gymnasium (MIT). The bodies come from the original Shapechanger release
(2017); the edits below reproduce its masses, inertias, ranges, gears and lengths exactly. The third
segments of the release had no motors. They have motors here, except in `ExtendedAntPassive`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import needing_extra

with needing_extra("sim"):
    from gymnasium.envs.mujoco.ant_v5 import AntEnv as GymnasiumAntEnv

from shapechanger.contract.env_ref import FORWARD_SPEED, RETURN
from shapechanger.envs.checks import check_action
from shapechanger.envs.layouts import body_features, position_features, velocity_features
from shapechanger.envs.odrl import published
from shapechanger.envs.stepping.tuned import (
    NO_WARNINGS,
    Binding,
    ModelWatch,
    Outcomes,
    StepResult,
    TunedStep,
)
from shapechanger.layout import Feature
from shapechanger.morphology import AddSegment, Body, Cut, JointRange, StartHeight, Stretch
from shapechanger.morphology.families import BodyLike, Family, length_axes, strength_axes

# Legs in the order of the model's motors, with the signs of x and y of their directions. The ankles
# of legs 2 and 3 turn in the opposite direction.
LEGS: Final = {4: (1, -1), 1: (1, 1), 2: (-1, 1), 3: (-1, -1)}
_TURNS_BACK: Final = (2, 3)

# The third segment of the 2017 release (extended_ant.xml).
_FOOT_REACH_M: Final = 0.6  # along x and along y
_FOOT_RANGE_DEG: Final = (30.0, 70.0)
_FOOT_GEAR_NM: Final = 150.0
_ANKLE_RANGE_DEG: Final = (30.0, 50.0)
_EXTENDED_START_HEIGHT_M: Final = 1.25


def _foot(leg: int, gear: float | None) -> tuple[AddSegment, JointRange]:
    """Return the edits that add a third segment to a leg; gear in N·m, None for no motor."""
    end = (LEGS[leg][0] * _FOOT_REACH_M, LEGS[leg][1] * _FOOT_REACH_M, 0.0)
    return (
        AddSegment(f"shank_{leg}", f"foot_{leg}", end, *_range(leg, _FOOT_RANGE_DEG), gear),
        JointRange(f"ankle_{leg}", *_range(leg, _ANKLE_RANGE_DEG)),
    )


def _extended(gear: float | None) -> Body:
    """Return the ant with a third segment on each leg; gear in N·m, None for no motors."""
    feet, ankles = zip(*(_foot(leg, gear) for leg in LEGS), strict=True)
    return (*feet, *ankles, StartHeight("torso", _EXTENDED_START_HEIGHT_M))


def _range(leg: int, degrees: tuple[float, float]) -> tuple[float, float]:
    """Return the range of a leg's joint, rad, from the range for forward-turning legs, degrees."""
    lower, upper = map(math.radians, degrees)
    return (-upper, -lower) if leg in _TURNS_BACK else (lower, upper)


ANT: Final = Family(
    name="Ant",
    bodies={
        "Ant": (),
        "AmputatedAnt": (Cut("shank_4", 0.25),),
        "BigAnt": (Stretch("shank_*", 2.0),),
        "ExtendedAnt": _extended(_FOOT_GEAR_NM),
        "ExtendedAntPassive": _extended(None),
    },
    bodies_by_joint={f"ankle_{leg}": f"shank_{leg}" for leg in LEGS},
    axes=(
        *length_axes((f"aux_{leg}" for leg in sorted(LEGS)), 0.7, 1.4),
        *length_axes((f"shank_{leg}" for leg in sorted(LEGS)), 0.6, 1.5),
        *strength_axes("torso"),
    ),
    parts={
        f"leg {leg}": {
            "stump": (Cut(f"shank_{leg}", 0.25),),
            "foot": _foot(leg, _FOOT_GEAR_NM),
        }
        for leg in sorted(LEGS)
    },
    published=published("ant"),
)


# An ant above this multiple of its standing height has been thrown up. The limit of Ant is 0.98 m,
# Gymnasium's is 1.0; the limit of BigAnt is 1.80 m, the original release's (2017) was 2.0.
_HIGHEST_STANDS: Final = 1.9
# Ants start at 0.75 m or higher; small ants fall from there, and must stay healthy until they land.
_HIGHEST_STARTS: Final = 1.3

_sum: Final = np.add.reduce


class _Ant(Binding):
    """Views of an ant's data, and buffers for values computed from them."""

    def __init__(self, watch: ModelWatch, env: Any) -> None:
        super().__init__(watch, env)
        data = env.data
        self.main_xy = data.body(env.main_body).xpos[:2]
        self.qpos_xy = data.qpos[:2]
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
        self.healthy_z_range = np.array(env.healthy_z_range, np.float64)
        # Joining memory is four times as fast as joining arrays of this size.
        after = (data.qpos, data.qvel, self.main_xy, self.healthy_z_range, self.forces.ravel())
        self.after = [memoryview(cast("Any", view)) for view in after]
        self._main_xy = memoryview(self.main_xy)

    def remember(self) -> bytes:
        """Return the main body's position before the physics step, which `conclude` needs."""
        return self._main_xy.tobytes()


class AntEnv(TunedStep, GymnasiumAntEnv):  # pyright: ignore[reportIncompatibleVariableOverride]
    """Run forwards on four legs: Gymnasium's `Ant-v5` with any body of the ant family.

    Actions, observations, rewards and infos are equal to `Ant-v5`. An ant with more joints has
    larger spaces.

    ## Action space
    `Box(-1, 1, (8,), float32)`: torques of the motors divided by their gear of 150 N·m. An action
    lasts 0.05 s.

    | Num | Action          | Min | Max | Unit |
    | --- | --------------- | --- | --- | ---- |
    | 0   | `hip_4/motor`   | -1  | 1   | 1    |
    | 1   | `ankle_4/motor` | -1  | 1   | 1    |
    | 2   | `hip_1/motor`   | -1  | 1   | 1    |
    | 3   | `ankle_1/motor` | -1  | 1   | 1    |
    | 4   | `hip_2/motor`   | -1  | 1   | 1    |
    | 5   | `ankle_2/motor` | -1  | 1   | 1    |
    | 6   | `hip_3/motor`   | -1  | 1   | 1    |
    | 7   | `ankle_3/motor` | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (105,), float64)`, for the unedited body:

    | Num    | Observation        | Min     | Max     | Unit   |
    | ------ | ------------------ | ------- | ------- | ------ |
    | 0      | `torso/z`          | -inf    | inf     | m      |
    | 1-4    | `torso/qw` to `qz` | -1      | 1       | 1      |
    | 5      | `hip_1/angle`      | -0.5236 | 0.5236  | rad    |
    | 6      | `ankle_1/angle`    | 0.5236  | 1.222   | rad    |
    | 7      | `hip_2/angle`      | -0.5236 | 0.5236  | rad    |
    | 8      | `ankle_2/angle`    | -1.222  | -0.5236 | rad    |
    | 9      | `hip_3/angle`      | -0.5236 | 0.5236  | rad    |
    | 10     | `ankle_3/angle`    | -1.222  | -0.5236 | rad    |
    | 11     | `hip_4/angle`      | -0.5236 | 0.5236  | rad    |
    | 12     | `ankle_4/angle`    | 0.5236  | 1.222   | rad    |
    | 13-15  | `torso/vx` to `vz` | -inf    | inf     | m/s    |
    | 16-18  | `torso/wx` to `wz` | -inf    | inf     | rad/s  |
    | 19-26  | `*/velocity`       | -inf    | inf     | rad/s  |
    | 27-104 | `*/contact/*`      | -1      | 1       | N·m, N |

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost - contact_cost`: 1 while healthy, plus the velocity
    of the torso along x, m/s, minus `0.5 sum(action^2)`, minus `0.0005 sum(force^2)` of the contact
    forces and torques, each clipped to [-1, 1].

    ## Start
    The model's own pose, with each joint at least a tenth of its range inside its limits, and the
    torso high enough for the feet. Noise is drawn as in `Ant-v5`, with `reset_noise_scale` (0.1);
    joints stay inside their limits and feet above the floor.

    ## End
    Terminated when the ant is unhealthy: its torso's up axis points down, it is higher than both
    1.9 times its standing height and 1.3 times its start height, or its state is not finite. There
    is no lower limit, because an ant that lies down is as low as a flipped one, which rests at
    0.27 m. Truncated after 1,000 steps.

    ## Info
    `x_position`, `y_position` and `distance_from_origin`, m; `x_velocity` and `y_velocity`, m/s;
    `reward_forward`, `reward_ctrl`, `reward_contact` and `reward_survive`. `diverged` if the
    simulation has diverged.

    ## Arguments
    - `forward_reward_weight` (1): factor of the velocity, s/m.
    - `ctrl_cost_weight` (0.5): factor of the sum of squared actions.
    - `contact_cost_weight` (0.0005): factor of the sum of squared contact forces.
    - `healthy_reward` (1): reward of each step while healthy.
    - `main_body` (1): body whose velocity is rewarded, by number or name.
    - `terminate_when_unhealthy` (True): whether an episode ends when the ant is unhealthy.
    - `contact_force_range` (-1, 1): limits to which contact forces are clipped.
    - `reset_noise_scale` (0.1): size of the noise at the start.
    - `exclude_current_positions_from_observation` (True): whether the torso's x and y are left out.
    - `include_cfrc_ext_in_observation` (True): whether contact forces are observed.
    - `xml_file` ("ant.xml"): file of the unedited body.
    - `frame_skip` (5): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of an ant, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Heights of the torso between which the ant is healthy, m; None derives the
            upper one from the body and sets no lower one.
        **arguments: The arguments in the two lists above.
    """

    family = ANT
    measures = (FORWARD_SPEED, RETURN)
    binding = _Ant
    replaced = (
        *("do_simulation", "_step_mujoco_simulation", "state_vector", "dt"),
        *("_get_obs", "_get_rew", "is_healthy", "healthy_reward", "up"),
        *("control_cost", "contact_cost", "contact_forces"),
    )

    def __init__(
        self,
        body: BodyLike = "Ant",
        healthy_z_range: tuple[float, float] | None = None,
        **arguments: Any,
    ) -> None:
        self._given_z_range = healthy_z_range
        self.contacts_observed = arguments.get("include_cfrc_ext_in_observation", True)
        self.place_hidden = arguments.get("exclude_current_positions_from_observation", True)
        self._force_range = arguments.get("contact_force_range", (-1.0, 1.0))
        if healthy_z_range is not None:
            arguments["healthy_z_range"] = healthy_z_range
        self._begin(body, arguments)
        cast("Any", GymnasiumAntEnv).__init__(
            self, **{"healthy_z_range": (-math.inf, math.inf), **arguments}
        )
        self._finish(arguments)

    def _follow_body(self) -> None:
        super()._follow_body()
        if self._given_z_range is None:
            stands = math.inf if self.standing_height is None else self.standing_height
            highest = max(_HIGHEST_STANDS * stands, _HIGHEST_STARTS * float(self.model.qpos0[2]))
            self._healthy_z_range = (-math.inf, highest)

    @property
    def main_body(self) -> int | str:
        """The body whose velocity is rewarded, by number or name."""
        return self._main_body

    def _advance(self, bound: _Ant, action: Any) -> StepResult:
        # Gymnasium's `step`, `_get_obs` and `is_healthy` with each number computed once, in their
        # order and precision. The cost of an action is summed in the precision of the action.
        if type(action) is not np.ndarray or action.shape != bound.shape:
            action = check_action(self, action)
        ctrl_cost = self._ctrl_cost_weight * _sum(np.square(action), axis=None)
        if not math.isfinite(ctrl_cost):
            check_action(self, action)
        x_before, y_before = bound.main_xy.tolist()
        bound.ctrl[:] = action
        bound.move()
        x_after, y_after = bound.main_xy.tolist()
        x_velocity = np.float64((x_after - x_before) / bound.dt)
        y_velocity = np.float64((y_after - y_before) / bound.dt)

        bound.forces.clip(*self._contact_force_range, out=bound.clipped)
        contact_cost = self._contact_cost_weight * _sum(
            np.square(bound.clipped, out=bound.squared), axis=None
        )
        observation = np.concatenate(bound.observed)

        qpos = bound.qpos
        x, y, z, _, up_x, up_y = qpos[:6].tolist()
        # A finite sum proves that all numbers are finite; an infinite sum may be an overflow.
        finite = math.isfinite(sum(observation[: bound.state_size].tolist()) + x + y) or bool(
            np.isfinite(qpos).all() and np.isfinite(bound.qvel).all()
        )
        healthy = finite and is_upright(z, up_x, up_y, *self._healthy_z_range)
        place = qpos[0], qpos[1], np.float64(math.sqrt(bound.qpos_xy.dot(bound.qpos_xy)))
        velocity = x_velocity, y_velocity
        reward, info = self._reward(place, velocity, ctrl_cost, contact_cost, healthy)
        if bound.warnings.tolist() != NO_WARNINGS:
            info["diverged"] = True
        if self.render_mode == "human":
            self.render()
        return observation, reward, not healthy and self._terminate_when_unhealthy, False, info

    def _reward(
        self, place: Any, velocity: Any, ctrl_cost: Any, contact_cost: Any, healthy: Any
    ) -> tuple[Any, dict[str, Any]]:
        """Return reward and info as Gymnasium's `_get_rew`, for one ant or an array of ants.

        `place` is the torso's x, y and distance from the origin, m; `velocity` is the main body's
        along x and y, m/s.
        """
        (x, y, distance), (x_velocity, y_velocity) = place, velocity
        forward_reward = x_velocity * self._forward_reward_weight
        healthy_reward = healthy * self._healthy_reward
        reward = (forward_reward + healthy_reward) - (ctrl_cost + contact_cost)
        info = {
            "x_position": x,
            "y_position": y,
            "distance_from_origin": distance,
            "x_velocity": x_velocity,
            "y_velocity": y_velocity,
            "reward_forward": forward_reward,
            "reward_ctrl": -ctrl_cost,
            "reward_contact": -contact_cost,
            "reward_survive": healthy_reward,
        }
        return reward, info

    def _kind_of(self, bound: _Ant) -> str:
        if self.render_mode == "human":
            return ""
        bound.healthy_z_range[:] = self._healthy_z_range
        shared = (
            *(id(self.tuned), bound.qpos.size, bound.qvel.size, bound.forces.size),
            *(bound.dt, self.place_hidden, self.contacts_observed),
            *(tuple(self._contact_force_range), self._terminate_when_unhealthy),
            *(self._forward_reward_weight, self._healthy_reward),
            *(self._ctrl_cost_weight, self._contact_cost_weight),
        )
        # `repr` distinguishes types of numbers, because the types of the results depend on them.
        return sys.intern(repr(shared))

    def conclude(
        self,
        bounds: Sequence[_Ant],
        before: Sequence[bytes],
        actions: NDArray[Any],
        out: NDArray[np.float64] | None,
    ) -> Outcomes:
        """Compute observations, rewards, ends and infos of ants of this kind, all at once."""
        n, one = len(bounds), self._bound
        size = one.qpos.size + one.qvel.size
        memory = b"".join([view for bound in bounds for view in bound.after])
        after = np.frombuffer(memory).reshape(n, -1)
        place, state, forces = after[:, :2], after[:, :size], after[:, size + 4 :]
        main_xy, low, high = after[:, size : size + 2], after[:, size + 2], after[:, size + 3]
        main_xy_before = np.frombuffer(b"".join(before)).reshape(n, 2)
        ctrl_cost = self._ctrl_cost_weight * _sum(np.square(actions, order="C"), axis=1)
        clipped = forces.clip(*self._contact_force_range)
        observed = [state[:, 2:] if self.place_hidden else state]
        if self.contacts_observed:
            observed.append(clipped[:, one.forces.shape[1] :])
        observations = np.concatenate(observed, axis=1, out=out)
        contact_cost = self._contact_cost_weight * _sum(np.square(clipped, out=clipped), axis=1)
        with np.errstate(over="ignore", invalid="ignore"):  # Python numbers do not warn either.
            velocity = (main_xy - main_xy_before) / one.dt
            upright = is_upright(after[:, 2], after[:, 4], after[:, 5], low, high)
            # `vecdot` rounds as `dot` does; a sum of products may round differently.
            distance = np.sqrt(np.vecdot(place, place))
        healthy = upright & np.isfinite(state).all(axis=1)
        where = place[:, 0], place[:, 1], distance
        rewards, infos = self._reward(where, velocity.T, ctrl_cost, contact_cost, healthy)
        infos["reward_survive"] = infos["reward_survive"].tolist()  # Python numbers, like step()'s.
        terminated = ~healthy & bool(self._terminate_when_unhealthy)
        return observations, rewards, terminated, infos

    def _observation_features(self, model: Any) -> list[Feature]:
        features = position_features(model)[2 if self.place_hidden else 0 :]
        features += velocity_features(model)
        if self.contacts_observed:
            features += body_features(model, "contact", *self._force_range)
        return features

    @property
    def healthy_z_range(self) -> tuple[float, float]:
        """Heights of the torso between which the ant is healthy, m."""
        return self._healthy_z_range

    @property
    def up(self) -> float:
        """Vertical part of the torso's up axis: 1 upright, 0 on its side, -1 upside down."""
        x, y = self.data.qpos[4:6]
        return float(1.0 - 2.0 * (x * x + y * y))

    @property
    def is_healthy(self) -> bool:
        """Return whether the state is finite and the torso upright within its healthy heights."""
        return bool(super().is_healthy) and self.up > 0.0


AntEnv.tuned = AntEnv


def is_upright(z: Any, x: Any, y: Any, low: Any, high: Any) -> Any:
    """Return whether a torso at a height z, m, with x and y of its quaternion, is healthy.

    A healthy torso is between low and high, m, and its up axis points above the horizon.
    """
    return (low <= z) & (z <= high) & (1.0 - 2.0 * (x * x + y * y) > 0.0)


class ExtendedAntEnv(AntEnv):
    """Run forwards on four legs of three segments, which make both spaces larger than the ant's.

    ## Action space
    `Box(-1, 1, (12,), float32)`: torques of the motors divided by their gear of 150 N·m. An action
    lasts 0.05 s.

    | Num | Action          | Min | Max | Unit |
    | --- | --------------- | --- | --- | ---- |
    | 0   | `hip_4/motor`   | -1  | 1   | 1    |
    | 1   | `ankle_4/motor` | -1  | 1   | 1    |
    | 2   | `hip_1/motor`   | -1  | 1   | 1    |
    | 3   | `ankle_1/motor` | -1  | 1   | 1    |
    | 4   | `hip_2/motor`   | -1  | 1   | 1    |
    | 5   | `ankle_2/motor` | -1  | 1   | 1    |
    | 6   | `hip_3/motor`   | -1  | 1   | 1    |
    | 7   | `ankle_3/motor` | -1  | 1   | 1    |
    | 8   | `foot_4/motor`  | -1  | 1   | 1    |
    | 9   | `foot_1/motor`  | -1  | 1   | 1    |
    | 10  | `foot_2/motor`  | -1  | 1   | 1    |
    | 11  | `foot_3/motor`  | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (137,), float64)`, for the unedited body:

    | Num    | Observation        | Min     | Max     | Unit   |
    | ------ | ------------------ | ------- | ------- | ------ |
    | 0      | `torso/z`          | -inf    | inf     | m      |
    | 1-4    | `torso/qw` to `qz` | -1      | 1       | 1      |
    | 5      | `hip_1/angle`      | -0.5236 | 0.5236  | rad    |
    | 6      | `ankle_1/angle`    | 0.5236  | 0.8727  | rad    |
    | 7      | `foot_1/angle`     | 0.5236  | 1.222   | rad    |
    | 8      | `hip_2/angle`      | -0.5236 | 0.5236  | rad    |
    | 9      | `ankle_2/angle`    | -0.8727 | -0.5236 | rad    |
    | 10     | `foot_2/angle`     | -1.222  | -0.5236 | rad    |
    | 11     | `hip_3/angle`      | -0.5236 | 0.5236  | rad    |
    | 12     | `ankle_3/angle`    | -0.8727 | -0.5236 | rad    |
    | 13     | `foot_3/angle`     | -1.222  | -0.5236 | rad    |
    | 14     | `hip_4/angle`      | -0.5236 | 0.5236  | rad    |
    | 15     | `ankle_4/angle`    | 0.5236  | 0.8727  | rad    |
    | 16     | `foot_4/angle`     | 0.5236  | 1.222   | rad    |
    | 17-19  | `torso/vx` to `vz` | -inf    | inf     | m/s    |
    | 20-22  | `torso/wx` to `wz` | -inf    | inf     | rad/s  |
    | 23-34  | `*/velocity`       | -inf    | inf     | rad/s  |
    | 35-136 | `*/contact/*`      | -1      | 1       | N·m, N |

    ## Versions
    v1: the first.

    Args:
        body: As for `AntEnv`, such as "ExtendedAntPassive", whose third segments have no motors.
        **arguments: `healthy_z_range` of `AntEnv`, and the arguments in the two lists above.
    """

    def __init__(self, body: BodyLike = "ExtendedAnt", **arguments: Any) -> None:
        super().__init__(body, **arguments)
