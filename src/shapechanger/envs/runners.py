"""Half cheetah, hopper, walker, swimmer and humanoid: their families of bodies, and their envs.

All models are Gymnasium's (MIT).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, ClassVar, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra, MorphologyError

try:
    import mujoco
    from gymnasium.envs.mujoco.half_cheetah_v5 import HalfCheetahEnv as GymnasiumHalfCheetahEnv
    from gymnasium.envs.mujoco.hopper_v5 import HopperEnv as GymnasiumHopperEnv
    from gymnasium.envs.mujoco.humanoid_v5 import HumanoidEnv as GymnasiumHumanoidEnv
    from gymnasium.envs.mujoco.swimmer_v5 import SwimmerEnv as GymnasiumSwimmerEnv
    from gymnasium.envs.mujoco.walker2d_v5 import Walker2dEnv as GymnasiumWalker2dEnv
except (ImportError, gym.error.DependencyNotInstalled) as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.contract.env_ref import FORWARD_SPEED, RETURN, Measure
from shapechanger.envs.layouts import (
    contact_features,
    drive_features,
    inertia_features,
    position_features,
    twist_features,
    velocity_features,
)
from shapechanger.envs.odrl import published
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Feature
from shapechanger.morphology import Cut, compile_body
from shapechanger.morphology.families import BodyLike, Family, length_axes, strength_axes
from shapechanger.morphology.pose import standing_height, start_pose, trunk_lift


def _runner(name: str, legs: Mapping[str, tuple[str, str, str]]) -> Family:
    """Family of runners in a plane: legs of thigh, shank and foot, which edits can shorten."""
    limbs = [limb for leg in legs.values() for limb in leg]
    return Family(
        name,
        {name: ()},
        axes=length_axes(limbs, 0.7, 1.4) + strength_axes("torso"),
        parts={leg: {"stump": (Cut(limbs[-1], 0.4),)} for leg, limbs in legs.items()},
        published=published(name.lower()),
    )


HALF_CHEETAH: Final = _runner(
    "HalfCheetah",
    {"back leg": ("bthigh", "bshin", "bfoot"), "front leg": ("fthigh", "fshin", "ffoot")},
)
HOPPER: Final = _runner("Hopper", {"leg": ("thigh", "leg", "foot")})
_LEFT: Final = ("thigh_left", "leg_left", "foot_left")
WALKER2D: Final = _runner("Walker2d", {"right leg": ("thigh", "leg", "foot"), "left leg": _LEFT})
SWIMMER: Final = Family("Swimmer", {"Swimmer": ()})
HUMANOID: Final = Family("Humanoid", {"Humanoid": ()})

# Limit to which Gymnasium clips the velocities that Hopper and Walker2d observe, m/s and rad/s.
_CLIPPED_AT: Final = 10.0


class Runner(Reshapable):
    """Mixin for Gymnasium's runners, which start upright with straight legs.

    The start pose is Gymnasium's, with joints beyond a limit moved to the limit, and the trunk high
    enough for the feet. Noise is drawn as in Gymnasium; joints stay inside their limits and feet
    above the floor. The standing height is the height in the start pose, because these legs are
    folded if joints are in the middle of their ranges.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON; None
            for the family's first.
        **arguments: All arguments of Gymnasium's env and of `Reshapable`.

    Attributes:
        measures: Metrics of a policy.
        root: Types of the joints that determine the trunk's position.
        place_size: How many numbers of the trunk's position the observation omits by default.
        velocity_limit: Limit to which observed velocities are clipped, m/s and rad/s.
    """

    measures: ClassVar[tuple[Measure, ...]] = (FORWARD_SPEED, RETURN)
    root: ClassVar[tuple[str, ...]] = ("slide", "slide", "hinge")
    place_size: ClassVar[int] = 1
    velocity_limit: ClassVar[float] = math.inf

    def __init__(self, body: BodyLike | None = None, **arguments: Any) -> None:
        self._place_hidden = arguments.get("exclude_current_positions_from_observation", True)
        self._begin(self.family.name if body is None else body, arguments)
        cast("Any", super()).__init__(**arguments)
        self._finish(arguments)

    def _start_and_height(self, model: mujoco.MjModel) -> tuple[NDArray[np.float64], float | None]:
        pose = start_pose(model, inside=0.0)
        return pose, standing_height(model, pose)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        trunk = [
            mujoco.mjtJoint(kind).name.removeprefix("mjJNT_").lower()
            for kind, body in zip(model.jnt_type, model.jnt_bodyid, strict=True)
            if body == model.jnt_bodyid[0]
        ]
        if tuple(trunk) != self.root:
            raise MorphologyError(
                f"The task reads the place of the {self.family.name} from the joints of its trunk, "
                f"which must be {', '.join(self.root)}; here they are {', '.join(trunk) or 'none'}."
            )
        features = position_features(model)[self.place_size if self._place_hidden else 0 :]
        return features + velocity_features(model, self.velocity_limit)


class HealthyRunner(Runner):
    """Runner that is healthy while its trunk is neither too low nor too high.

    For the unedited body the heights are Gymnasium's; for any other they scale with its standing
    height.

    Args:
        body: As in `Runner`.
        healthy_z_range: Heights of the trunk between which the body is healthy, m, as positions of
            the joint that raises it; None derives them from the body.
        **arguments: All other arguments of Gymnasium's env.
    """

    _healthy_z_range: tuple[float, float]

    def __init__(
        self,
        body: BodyLike | None = None,
        healthy_z_range: tuple[float, float] | None = None,
        **arguments: Any,
    ) -> None:
        self._given_z_range = healthy_z_range
        if healthy_z_range is not None:
            arguments["healthy_z_range"] = healthy_z_range
        super().__init__(body, **arguments)

    def _finish(self, arguments: dict[str, Any]) -> None:
        self._gymnasiums_z_range = self._healthy_z_range
        super()._finish(arguments)

    def _follow_body(self) -> None:
        super()._follow_body()
        if self._given_z_range is None:
            self._healthy_z_range = self._derived_z_range()

    def _derived_z_range(self) -> tuple[float, float]:
        """Scale Gymnasium's range by the standing height relative to the unedited body's."""
        if not self.body:
            return self._gymnasiums_z_range
        lift, plain = trunk_lift(self.model), compile_body(self.family.load(self.fullpath), ())
        plain_lift, (_, plain_stands) = trunk_lift(plain), self._start_and_height(plain)
        if not (lift and plain_lift and plain_stands and self.standing_height):
            return self._gymnasiums_z_range
        growth = self.standing_height / plain_stands
        # From positions of the trunk's joint to heights, m, and back.
        heights = (plain_lift.at_zero_m + plain_lift.up * z for z in self._gymnasiums_z_range)
        low, high = (lift.number_at(growth * height_m) for height_m in heights)
        return low, high

    @property
    def healthy_z_range(self) -> tuple[float, float]:
        """Heights between which the body is healthy, m, as positions of the trunk's joint."""
        return self._healthy_z_range


class HalfCheetahEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumHalfCheetahEnv
):
    """Run forwards in a plane on two legs: Gymnasium's `HalfCheetah-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `HalfCheetah-v5`.

    ## Action space
    `Box(-1, 1, (6,), float32)`: torques of the motors at `bthigh`, `bshin`, `bfoot`, `fthigh`,
    `fshin` and `ffoot`, divided by their gears of 120, 90, 60, 120, 60 and 30 N·m. An action lasts
    0.05 s.

    ## Observation space
    `Box(-inf, inf, (17,), float64)` for the unedited body: height of the torso, m, and its pitch,
    rad; angles of the joints in the order of the motors, rad; velocity of the torso along x and z,
    m/s; and angular velocities of torso and joints, rad/s.

    ## Reward
    `forward_reward - ctrl_cost`: the velocity along x, m/s, minus `0.1 sum(action^2)`.

    ## Start
    The pose of `Runner`, with uniform noise of `reset_noise_scale` (0.1) on positions, and normal
    noise of this standard deviation on velocities.

    ## End
    Never terminated; truncated after 1,000 steps.

    ## Info
    `x_position`, m; `x_velocity`, m/s; `reward_forward` and `reward_ctrl`. `diverged` if the
    simulation has diverged.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        **arguments: All arguments of `HalfCheetah-v5` and of `Reshapable`.
    """

    family = HALF_CHEETAH

    def _initialize_simulation(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        with warnings.catch_warnings():
            # MuJoCo deprecates how Gymnasium's file sets the cheetah's mass; any other way would
            # change the last bits.
            warnings.filterwarnings("ignore", message=".*settotalmass.*")
            return super()._initialize_simulation()


class HopperEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumHopperEnv
):
    """Hop forwards on one leg: Gymnasium's `Hopper-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Hopper-v5`.

    ## Action space
    `Box(-1, 1, (3,), float32)`: torques of the motors at `thigh_joint`, `leg_joint` and
    `foot_joint`, divided by their gear of 200 N·m. An action lasts 0.008 s.

    ## Observation space
    `Box(-inf, inf, (11,), float64)` for the unedited body: height of the torso, m, and its pitch,
    rad; angles of the joints in the order of the motors, rad; velocity of the torso along x and z,
    m/s; and angular velocities of torso and joints, rad/s. Velocities are clipped to [-10, 10].

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost`: 1 while healthy, plus the velocity along x, m/s,
    minus `0.001 sum(action^2)`.

    ## Start
    The pose of `Runner`, with uniform noise of `reset_noise_scale` (0.005).

    ## End
    Terminated when the torso is below 0.7 m or leans by more than 0.2 rad, or a number of the state
    is not between -100 and 100. For other bodies these heights scale with their standing height.
    Truncated after 1,000 steps.

    ## Info
    `x_position`, and `z_distance_from_origin`, m; `x_velocity`, m/s; `reward_forward`,
    `reward_ctrl` and `reward_survive`. `diverged` if the simulation has diverged.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Heights of the torso between which the body is healthy, m; None
            derives them from the body.
        **arguments: All other arguments of `Hopper-v5` and of `Reshapable`.
    """

    family = HOPPER
    velocity_limit = _CLIPPED_AT


class Walker2dEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumWalker2dEnv
):
    """Walk forwards in a plane: Gymnasium's `Walker2d-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Walker2d-v5`.

    ## Action space
    `Box(-1, 1, (6,), float32)`: torques of the motors at `thigh_joint`, `leg_joint`, `foot_joint`
    and at the same joints of the left leg, divided by their gear of 100 N·m. An action lasts
    0.008 s.

    ## Observation space
    `Box(-inf, inf, (17,), float64)` for the unedited body: height of the torso, m, and its pitch,
    rad; angles of the joints in the order of the motors, rad; velocity of the torso along x and z,
    m/s; and angular velocities of torso and joints, rad/s. Velocities are clipped to [-10, 10].

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost`: 1 while healthy, plus the velocity along x, m/s,
    minus `0.001 sum(action^2)`.

    ## Start
    The pose of `Runner`, with uniform noise of `reset_noise_scale` (0.005).

    ## End
    Terminated when the torso is below 0.8 m or above 2 m, or leans by more than 1 rad. For other
    bodies these heights scale with their standing height. Truncated after 1,000 steps.

    ## Info
    `x_position`, and `z_distance_from_origin`, m; `x_velocity`, m/s; `reward_forward`,
    `reward_ctrl` and `reward_survive`. `diverged` if the simulation has diverged.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Heights of the torso between which the body is healthy, m; None
            derives them from the body.
        **arguments: All other arguments of `Walker2d-v5` and of `Reshapable`.
    """

    family = WALKER2D
    velocity_limit = _CLIPPED_AT


class SwimmerEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumSwimmerEnv
):
    """Swim forwards in a plane: Gymnasium's `Swimmer-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Swimmer-v5`.

    ## Action space
    `Box(-1, 1, (2,), float32)`: torques of the motors at the two joints, divided by their gear of
    150 N·m. An action lasts 0.04 s.

    ## Observation space
    `Box(-inf, inf, (8,), float64)` for the unedited body: angle of the first link and of both
    joints, rad; velocity of the first link along x and y, m/s; and its angular velocity and the
    joints', rad/s.

    ## Reward
    `forward_reward - ctrl_cost`: the velocity along x, m/s, minus `0.0001 sum(action^2)`.

    ## Start
    Straight and at rest, with uniform noise of `reset_noise_scale` (0.1); it has no standing
    height.

    ## End
    Never terminated; truncated after 1,000 steps.

    ## Info
    `x_position`, `y_position` and `distance_from_origin`, m; `x_velocity` and `y_velocity`, m/s;
    `reward_forward` and `reward_ctrl`. `diverged` if the simulation has diverged.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        **arguments: All arguments of `Swimmer-v5` and of `Reshapable`.
    """

    family = SWIMMER
    place_size = 2


class HumanoidEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumHumanoidEnv
):
    """Walk forwards on two legs with arms and a waist: `Humanoid-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Humanoid-v5`.

    ## Action space
    `Box(-0.4, 0.4, (17,), float32)`: torques of the motors divided by their gears: 100 N·m for the
    waist and the hips' x and z axes, 300 N·m for their y axes, 200 N·m for the knees, and 25 N·m
    for the arms. An action lasts 0.015 s.

    ## Observation space
    `Box(-inf, inf, (348,), float64)` for the unedited body: height, m, and orientation of the torso
    as a quaternion; angles of the joints, rad; velocity, m/s, and angular velocity, rad/s, of the
    torso; velocities of the joints, rad/s; inertia (kg·m², kg·m, kg) and twist (rad/s, m/s) of each
    body; torques of the motors at the joints, N·m; and contact torque and force on each body, N·m
    and N.

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost - contact_cost`: 5 while healthy, plus 1.25 times
    the velocity of the centre of mass along x, m/s, minus `0.1 sum(action^2)`, minus `5e-7
    sum(force^2)` of the contact forces and torques, which is at most 10.

    ## Start
    The pose of `Runner`, with uniform noise of `reset_noise_scale` (0.01). The knees start at their
    limit, bent by 2 degrees, whereas Gymnasium's start straight.

    ## End
    Terminated when the torso is below 1 m or above 2 m. For other bodies these heights scale with
    their standing height. Truncated after 1,000 steps.

    ## Info
    `x_position`, `y_position` and `distance_from_origin`, m; `x_velocity` and `y_velocity`, m/s;
    `tendon_length`, m, and `tendon_velocity`, m/s; `reward_forward`, `reward_ctrl`,
    `reward_contact` and `reward_survive`. `diverged` if the simulation has diverged.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Heights of the torso between which the body is healthy, m; None
            derives them from the body.
        **arguments: All other arguments of `Humanoid-v5` and of `Reshapable`.
    """

    family = HUMANOID
    root = ("free",)
    place_size = 2

    def _begin(self, body: BodyLike, arguments: dict[str, Any]) -> None:
        blocks = {
            "cinert": inertia_features,
            "cvel": twist_features,
            "qfrc_actuator": drive_features,
            "cfrc_ext": contact_features,
        }
        seen = {name: arguments.get(f"include_{name}_in_observation", True) for name in blocks}
        self._blocks = [features for name, features in blocks.items() if seen[name]]
        super()._begin(body, arguments)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        features = super()._observation_features(model)
        return features + [feature for block in self._blocks for feature in block(model)]
