"""Half cheetah, hopper, walker, swimmer and humanoid: their families of bodies, and their envs.

All models are Gymnasium's (MIT).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, ClassVar, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MorphologyError, needing_extra

with needing_extra("sim"):
    import mujoco
    from gymnasium.envs.mujoco.half_cheetah_v5 import HalfCheetahEnv as GymnasiumHalfCheetahEnv
    from gymnasium.envs.mujoco.hopper_v5 import HopperEnv as GymnasiumHopperEnv
    from gymnasium.envs.mujoco.humanoid_v5 import HumanoidEnv as GymnasiumHumanoidEnv
    from gymnasium.envs.mujoco.swimmer_v5 import SwimmerEnv as GymnasiumSwimmerEnv
    from gymnasium.envs.mujoco.walker2d_v5 import Walker2dEnv as GymnasiumWalker2dEnv

from shapechanger.contract.env_ref import FORWARD_SPEED, RETURN, Measure
from shapechanger.envs.layouts import (
    body_features,
    drive_features,
    position_features,
    velocity_features,
)
from shapechanger.envs.odrl import published
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Feature
from shapechanger.morphology import Cut, compile_body
from shapechanger.morphology.families import BodyLike, Family, length_axes, strength_axes
from shapechanger.morphology.pose import standing_height, start_pose, trunk_lift


def _runner(name: str, legs: Mapping[str, tuple[str, str, str]]) -> Family:
    """Return a family of runners in a plane, each leg of which has a thigh, a shank and a foot."""
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
    """Mixin for Gymnasium's runners, humanoid and swimmer.

    The start pose is Gymnasium's, with joints beyond a limit moved to the limit, and the trunk high
    enough for the feet. Noise is drawn as in Gymnasium; joints stay inside their limits and feet
    above the floor. The standing height is the height in the start pose, because legs are folded if
    their joints are in the middle of their ranges.

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
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON; None
            for the family's first.
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
    `Box(-1, 1, (6,), float32)`: torques of the motors divided by their gears of 120, 90, 60, 120,
    60 and 30 N·m. An action lasts 0.05 s.

    | Num | Action         | Min | Max | Unit |
    | --- | -------------- | --- | --- | ---- |
    | 0   | `bthigh/motor` | -1  | 1   | 1    |
    | 1   | `bshin/motor`  | -1  | 1   | 1    |
    | 2   | `bfoot/motor`  | -1  | 1   | 1    |
    | 3   | `fthigh/motor` | -1  | 1   | 1    |
    | 4   | `fshin/motor`  | -1  | 1   | 1    |
    | 5   | `ffoot/motor`  | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (17,), float64)`, for the unedited body:

    | Num   | Observation      | Min    | Max   | Unit  |
    | ----- | ---------------- | ------ | ----- | ----- |
    | 0     | `rootz/position` | -inf   | inf   | m     |
    | 1     | `rooty/angle`    | -inf   | inf   | rad   |
    | 2     | `bthigh/angle`   | -0.52  | 1.05  | rad   |
    | 3     | `bshin/angle`    | -0.785 | 0.785 | rad   |
    | 4     | `bfoot/angle`    | -0.4   | 0.785 | rad   |
    | 5     | `fthigh/angle`   | -1     | 0.7   | rad   |
    | 6     | `fshin/angle`    | -1.2   | 0.87  | rad   |
    | 7     | `ffoot/angle`    | -0.5   | 0.5   | rad   |
    | 8     | `rootx/velocity` | -inf   | inf   | m/s   |
    | 9     | `rootz/velocity` | -inf   | inf   | m/s   |
    | 10-16 | `*/velocity`     | -inf   | inf   | rad/s |

    ## Reward
    `forward_reward - ctrl_cost`: the velocity along x, m/s, minus `0.1 sum(action^2)`.

    ## Start
    Gymnasium's pose, with joints beyond a limit moved to this limit and the trunk high enough for
    the feet, with uniform noise of `reset_noise_scale` (0.1) on positions, and normal noise of this
    standard deviation on velocities. Joints stay inside their limits and feet above the floor.

    ## End
    Never terminated; truncated after 1,000 steps.

    ## Info
    `x_position`, m; `x_velocity`, m/s; `reward_forward` and `reward_ctrl`. `diverged` if the
    simulation has diverged.

    ## Arguments
    - `forward_reward_weight` (1): factor of the velocity, s/m.
    - `ctrl_cost_weight` (0.1): factor of the sum of squared actions.
    - `reset_noise_scale` (0.1): size of the noise at the start.
    - `exclude_current_positions_from_observation` (True): whether the trunk's x is left out.
    - `xml_file` ("half_cheetah.xml"): file of the unedited body.
    - `frame_skip` (5): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        **arguments: The arguments in the two lists above.
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
    `Box(-1, 1, (3,), float32)`: torques of the motors divided by their gear of 200 N·m. An action
    lasts 0.008 s.

    | Num | Action              | Min | Max | Unit |
    | --- | ------------------- | --- | --- | ---- |
    | 0   | `thigh_joint/motor` | -1  | 1   | 1    |
    | 1   | `leg_joint/motor`   | -1  | 1   | 1    |
    | 2   | `foot_joint/motor`  | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (11,), float64)`, for the unedited body:

    | Num  | Observation         | Min     | Max    | Unit  |
    | ---- | ------------------- | ------- | ------ | ----- |
    | 0    | `rootz/position`    | -inf    | inf    | m     |
    | 1    | `rooty/angle`       | -inf    | inf    | rad   |
    | 2    | `thigh_joint/angle` | -2.618  | 0      | rad   |
    | 3    | `leg_joint/angle`   | -2.618  | 0      | rad   |
    | 4    | `foot_joint/angle`  | -0.7854 | 0.7854 | rad   |
    | 5    | `rootx/velocity`    | -10     | 10     | m/s   |
    | 6    | `rootz/velocity`    | -10     | 10     | m/s   |
    | 7-10 | `*/velocity`        | -10     | 10     | rad/s |

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost`: 1 while healthy, plus the velocity along x, m/s,
    minus `0.001 sum(action^2)`.

    ## Start
    Gymnasium's pose, with joints beyond a limit moved to this limit and the trunk high enough for
    the feet, with uniform noise of `reset_noise_scale` (0.005). Joints stay inside their limits and
    feet above the floor.

    ## End
    Terminated when the torso is below 0.7 m or leans by more than 0.2 rad, or a number of the state
    is not between -100 and 100. For other bodies these heights scale with their standing height.
    Truncated after 1,000 steps.

    ## Info
    `x_position`, and `z_distance_from_origin`, m; `x_velocity`, m/s; `reward_forward`,
    `reward_ctrl` and `reward_survive`. `diverged` if the simulation has diverged.

    ## Arguments
    - `forward_reward_weight` (1): factor of the velocity, s/m.
    - `ctrl_cost_weight` (0.001): factor of the sum of squared actions.
    - `healthy_reward` (1): reward of each step while healthy.
    - `terminate_when_unhealthy` (True): whether an episode ends when the hopper is unhealthy.
    - `healthy_state_range` (-100, 100): limits of all other numbers of a healthy state.
    - `healthy_angle_range` (-0.2, 0.2): limits of a healthy torso's lean, rad.
    - `reset_noise_scale` (0.005): size of the noise at the start.
    - `exclude_current_positions_from_observation` (True): whether the torso's x is left out.
    - `xml_file` ("hopper.xml"): file of the unedited body.
    - `frame_skip` (4): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Least and largest healthy height of the torso, m; None derives them from
            the body.
        **arguments: The arguments in the two lists above.
    """

    family = HOPPER
    velocity_limit = _CLIPPED_AT


class Walker2dEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumWalker2dEnv
):
    """Walk forwards in a plane: Gymnasium's `Walker2d-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Walker2d-v5`.

    ## Action space
    `Box(-1, 1, (6,), float32)`: torques of the motors divided by their gear of 100 N·m. An action
    lasts 0.008 s.

    | Num | Action                   | Min | Max | Unit |
    | --- | ------------------------ | --- | --- | ---- |
    | 0   | `thigh_joint/motor`      | -1  | 1   | 1    |
    | 1   | `leg_joint/motor`        | -1  | 1   | 1    |
    | 2   | `foot_joint/motor`       | -1  | 1   | 1    |
    | 3   | `thigh_left_joint/motor` | -1  | 1   | 1    |
    | 4   | `leg_left_joint/motor`   | -1  | 1   | 1    |
    | 5   | `foot_left_joint/motor`  | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (17,), float64)`, for the unedited body:

    | Num   | Observation              | Min     | Max    | Unit  |
    | ----- | ------------------------ | ------- | ------ | ----- |
    | 0     | `rootz/position`         | -inf    | inf    | m     |
    | 1     | `rooty/angle`            | -inf    | inf    | rad   |
    | 2     | `thigh_joint/angle`      | -2.618  | 0      | rad   |
    | 3     | `leg_joint/angle`        | -2.618  | 0      | rad   |
    | 4     | `foot_joint/angle`       | -0.7854 | 0.7854 | rad   |
    | 5     | `thigh_left_joint/angle` | -2.618  | 0      | rad   |
    | 6     | `leg_left_joint/angle`   | -2.618  | 0      | rad   |
    | 7     | `foot_left_joint/angle`  | -0.7854 | 0.7854 | rad   |
    | 8     | `rootx/velocity`         | -10     | 10     | m/s   |
    | 9     | `rootz/velocity`         | -10     | 10     | m/s   |
    | 10-16 | `*/velocity`             | -10     | 10     | rad/s |

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost`: 1 while healthy, plus the velocity along x, m/s,
    minus `0.001 sum(action^2)`.

    ## Start
    Gymnasium's pose, with joints beyond a limit moved to this limit and the trunk high enough for
    the feet, with uniform noise of `reset_noise_scale` (0.005). Joints stay inside their limits and
    feet above the floor.

    ## End
    Terminated when the torso is below 0.8 m or above 2 m, or leans by more than 1 rad. For other
    bodies these heights scale with their standing height. Truncated after 1,000 steps.

    ## Info
    `x_position`, and `z_distance_from_origin`, m; `x_velocity`, m/s; `reward_forward`,
    `reward_ctrl` and `reward_survive`. `diverged` if the simulation has diverged.

    ## Arguments
    - `forward_reward_weight` (1): factor of the velocity, s/m.
    - `ctrl_cost_weight` (0.001): factor of the sum of squared actions.
    - `healthy_reward` (1): reward of each step while healthy.
    - `terminate_when_unhealthy` (True): whether an episode ends when the walker is unhealthy.
    - `healthy_angle_range` (-1, 1): limits of a healthy torso's lean, rad.
    - `reset_noise_scale` (0.005): size of the noise at the start.
    - `exclude_current_positions_from_observation` (True): whether the torso's x is left out.
    - `xml_file` ("walker2d_v5.xml"): file of the unedited body.
    - `frame_skip` (4): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Least and largest healthy height of the torso, m; None derives them from
            the body.
        **arguments: The arguments in the two lists above.
    """

    family = WALKER2D
    velocity_limit = _CLIPPED_AT


class SwimmerEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumSwimmerEnv
):
    """Swim forwards in a plane: Gymnasium's `Swimmer-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Swimmer-v5`.

    ## Action space
    `Box(-1, 1, (2,), float32)`: torques of the motors divided by their gear of 150 N·m. An action
    lasts 0.04 s.

    | Num | Action             | Min | Max | Unit |
    | --- | ------------------ | --- | --- | ---- |
    | 0   | `motor1_rot/motor` | -1  | 1   | 1    |
    | 1   | `motor2_rot/motor` | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (8,), float64)`, for the unedited body:

    | Num | Observation           | Min    | Max   | Unit  |
    | --- | --------------------- | ------ | ----- | ----- |
    | 0   | `free_body_rot/angle` | -inf   | inf   | rad   |
    | 1   | `motor1_rot/angle`    | -1.745 | 1.745 | rad   |
    | 2   | `motor2_rot/angle`    | -1.745 | 1.745 | rad   |
    | 3   | `slider1/velocity`    | -inf   | inf   | m/s   |
    | 4   | `slider2/velocity`    | -inf   | inf   | m/s   |
    | 5-7 | `*/velocity`          | -inf   | inf   | rad/s |

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

    ## Arguments
    - `forward_reward_weight` (1): factor of the velocity, s/m.
    - `ctrl_cost_weight` (0.0001): factor of the sum of squared actions.
    - `reset_noise_scale` (0.1): size of the noise at the start.
    - `exclude_current_positions_from_observation` (True): whether the head's x and y are left out.
    - `xml_file` ("swimmer.xml"): file of the unedited body.
    - `frame_skip` (4): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        **arguments: The arguments in the two lists above.
    """

    family = SWIMMER
    place_size = 2


class HumanoidEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumHumanoidEnv
):
    """Walk forwards on two legs with arms and a waist: `Humanoid-v5` with an editable body.

    Actions, observations, rewards and infos are equal to `Humanoid-v5`.

    ## Action space
    `Box(-0.4, 0.4, (17,), float32)`: torques of the motors divided by their gears: 300 N·m for the
    hips' y axes, 200 N·m for the knees, 25 N·m for the arms and 100 N·m for all others. An action
    lasts 0.015 s.

    | Num | Action                  | Min  | Max | Unit |
    | --- | ----------------------- | ---- | --- | ---- |
    | 0   | `abdomen_y/motor`       | -0.4 | 0.4 | 1    |
    | 1   | `abdomen_z/motor`       | -0.4 | 0.4 | 1    |
    | 2   | `abdomen_x/motor`       | -0.4 | 0.4 | 1    |
    | 3   | `right_hip_x/motor`     | -0.4 | 0.4 | 1    |
    | 4   | `right_hip_z/motor`     | -0.4 | 0.4 | 1    |
    | 5   | `right_hip_y/motor`     | -0.4 | 0.4 | 1    |
    | 6   | `right_knee/motor`      | -0.4 | 0.4 | 1    |
    | 7   | `left_hip_x/motor`      | -0.4 | 0.4 | 1    |
    | 8   | `left_hip_z/motor`      | -0.4 | 0.4 | 1    |
    | 9   | `left_hip_y/motor`      | -0.4 | 0.4 | 1    |
    | 10  | `left_knee/motor`       | -0.4 | 0.4 | 1    |
    | 11  | `right_shoulder1/motor` | -0.4 | 0.4 | 1    |
    | 12  | `right_shoulder2/motor` | -0.4 | 0.4 | 1    |
    | 13  | `right_elbow/motor`     | -0.4 | 0.4 | 1    |
    | 14  | `left_shoulder1/motor`  | -0.4 | 0.4 | 1    |
    | 15  | `left_shoulder2/motor`  | -0.4 | 0.4 | 1    |
    | 16  | `left_elbow/motor`      | -0.4 | 0.4 | 1    |

    ## Observation space
    `Box(-inf, inf, (348,), float64)`, for the unedited body:

    | Num     | Observation             | Min     | Max      | Unit            |
    | ------- | ----------------------- | ------- | -------- | --------------- |
    | 0       | `torso/z`               | -inf    | inf      | m               |
    | 1-4     | `torso/qw` to `qz`      | -1      | 1        | 1               |
    | 5       | `abdomen_z/angle`       | -0.7854 | 0.7854   | rad             |
    | 6       | `abdomen_y/angle`       | -1.309  | 0.5236   | rad             |
    | 7       | `abdomen_x/angle`       | -0.6109 | 0.6109   | rad             |
    | 8       | `right_hip_x/angle`     | -0.4363 | 0.08727  | rad             |
    | 9       | `right_hip_z/angle`     | -1.047  | 0.6109   | rad             |
    | 10      | `right_hip_y/angle`     | -1.92   | 0.3491   | rad             |
    | 11      | `right_knee/angle`      | -2.793  | -0.03491 | rad             |
    | 12      | `left_hip_x/angle`      | -0.4363 | 0.08727  | rad             |
    | 13      | `left_hip_z/angle`      | -1.047  | 0.6109   | rad             |
    | 14      | `left_hip_y/angle`      | -1.92   | 0.3491   | rad             |
    | 15      | `left_knee/angle`       | -2.793  | -0.03491 | rad             |
    | 16      | `right_shoulder1/angle` | -1.484  | 1.047    | rad             |
    | 17      | `right_shoulder2/angle` | -1.484  | 1.047    | rad             |
    | 18      | `right_elbow/angle`     | -1.571  | 0.8727   | rad             |
    | 19      | `left_shoulder1/angle`  | -1.047  | 1.484    | rad             |
    | 20      | `left_shoulder2/angle`  | -1.047  | 1.484    | rad             |
    | 21      | `left_elbow/angle`      | -1.571  | 0.8727   | rad             |
    | 22-24   | `torso/vx` to `vz`      | -inf    | inf      | m/s             |
    | 25-27   | `torso/wx` to `wz`      | -inf    | inf      | rad/s           |
    | 28-44   | `*/velocity`            | -inf    | inf      | rad/s           |
    | 45-174  | `*/inertia/*`           | -inf    | inf      | kg·m², kg·m, kg |
    | 175-252 | `*/twist/*`             | -inf    | inf      | rad/s, m/s      |
    | 253-269 | `*/drive`               | -inf    | inf      | N·m             |
    | 270-347 | `*/contact/*`           | -inf    | inf      | N·m, N          |

    ## Reward
    `healthy_reward + forward_reward - ctrl_cost - contact_cost`: 5 while healthy, plus 1.25 times
    the velocity of the centre of mass along x, m/s, minus `0.1 sum(action^2)`, minus `5e-7
    sum(force^2)` of the contact forces and torques, which is at most 10.

    ## Start
    Gymnasium's pose, with joints beyond a limit moved to the limit, and the trunk high enough for
    the feet, with uniform noise of `reset_noise_scale` (0.01). Joints stay inside their limits and
    feet above the floor. The knees start at their limit, bent by 2 degrees, whereas Gymnasium's
    start straight.

    ## End
    Terminated when the torso is below 1 m or above 2 m. For other bodies these heights scale with
    their standing height. Truncated after 1,000 steps.

    ## Info
    `x_position`, `y_position` and `distance_from_origin`, m; `x_velocity` and `y_velocity`, m/s;
    `tendon_length`, m, and `tendon_velocity`, m/s; `reward_forward`, `reward_ctrl`,
    `reward_contact` and `reward_survive`. `diverged` if the simulation has diverged.

    ## Arguments
    - `forward_reward_weight` (1.25): factor of the velocity, s/m.
    - `ctrl_cost_weight` (0.1): factor of the sum of squared actions.
    - `contact_cost_weight` (5e-07): factor of the sum of squared contact forces.
    - `contact_cost_range` (-inf, 10): limits of the cost of contact.
    - `healthy_reward` (5): reward of each step while healthy.
    - `terminate_when_unhealthy` (True): whether an episode ends when the humanoid is unhealthy.
    - `reset_noise_scale` (0.01): size of the noise at the start.
    - `exclude_current_positions_from_observation` (True): whether the torso's x and y are left out.
    - `include_cinert_in_observation` (True): whether inertias are observed.
    - `include_cvel_in_observation` (True): whether twists are observed.
    - `include_qfrc_actuator_in_observation` (True): whether drives are observed.
    - `include_cfrc_ext_in_observation` (True): whether contact forces are observed.
    - `xml_file` ("humanoid.xml"): file of the unedited body.
    - `frame_skip` (5): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON.
        healthy_z_range: Least and largest healthy height of the torso, m; None derives them from
            the body.
        **arguments: The arguments in the two lists above.
    """

    family = HUMANOID
    root = ("free",)
    place_size = 2

    def _begin(self, body: BodyLike, arguments: dict[str, Any]) -> None:
        blocks = {"cinert": "inertia", "cvel": "twist", "qfrc_actuator": "", "cfrc_ext": "contact"}
        seen = {name: arguments.get(f"include_{name}_in_observation", True) for name in blocks}
        self._blocks = [block for name, block in blocks.items() if seen[name]]
        super()._begin(body, arguments)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        features = super()._observation_features(model)
        for block in self._blocks:
            features += body_features(model, block) if block else drive_features(model)
        return features
