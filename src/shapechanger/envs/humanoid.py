"""The humanoid, a trunk with two legs, two arms and a waist, and its env: walk forwards.

The model is Gymnasium's (MIT).
"""

from __future__ import annotations

from typing import Any, Final

import gymnasium as gym

from shapechanger.errors import MissingExtra, translate_errors

with translate_errors(
    *(ImportError, gym.error.DependencyNotInstalled), to=lambda _: MissingExtra("mujoco", "sim")
):
    import mujoco
    from gymnasium.envs.mujoco.humanoid_v5 import HumanoidEnv as GymnasiumHumanoidEnv

from shapechanger.envs import layouts
from shapechanger.envs.runners import HealthyRunner
from shapechanger.layout import Feature
from shapechanger.morphology.families import BodyLike, Family

HUMANOID: Final = Family("Humanoid", {"Humanoid": ()})


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
    | 1       | `torso/qw`              | -1      | 1        | 1               |
    | 2       | `torso/qx`              | -1      | 1        | 1               |
    | 3       | `torso/qy`              | -1      | 1        | 1               |
    | 4       | `torso/qz`              | -1      | 1        | 1               |
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
    | 22      | `torso/vx`              | -inf    | inf      | m/s             |
    | 23      | `torso/vy`              | -inf    | inf      | m/s             |
    | 24      | `torso/vz`              | -inf    | inf      | m/s             |
    | 25      | `torso/wx`              | -inf    | inf      | rad/s           |
    | 26      | `torso/wy`              | -inf    | inf      | rad/s           |
    | 27      | `torso/wz`              | -inf    | inf      | rad/s           |
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

    ## Versions
    v1: the first.

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
            "cinert": layouts.inertia_features,
            "cvel": layouts.twist_features,
            "qfrc_actuator": layouts.drive_features,
            "cfrc_ext": layouts.contact_features,
        }
        seen = {name: arguments.get(f"include_{name}_in_observation", True) for name in blocks}
        self._blocks = [features for name, features in blocks.items() if seen[name]]
        super()._begin(body, arguments)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        features = super()._observation_features(model)
        return features + [feature for block in self._blocks for feature in block(model)]
