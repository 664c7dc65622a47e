"""Inverted pendulums and double pendulums: keep the poles up by pushing the cart."""

from __future__ import annotations

import math
from typing import Any, Final, cast

import numpy as np

from shapechanger.errors import MorphologyError, needing_extra

with needing_extra("sim"):
    import mujoco
    from gymnasium.envs.mujoco.inverted_double_pendulum_v5 import (
        InvertedDoublePendulumEnv as GymnasiumInvertedDoublePendulumEnv,
    )
    from gymnasium.envs.mujoco.inverted_pendulum_v5 import (
        InvertedPendulumEnv as GymnasiumInvertedPendulumEnv,
    )

from shapechanger.envs.checks import check_action
from shapechanger.envs.layouts import position_features, velocity_features
from shapechanger.envs.reshapable import Reshapable
from shapechanger.envs.stepping.tuned import NO_WARNINGS, Binding, StepResult, TunedStep
from shapechanger.layout import Element, Feature
from shapechanger.morphology import Stretch, compile_body
from shapechanger.morphology.families import BodyLike, Family

# The poles of the original release (2017) end at (0.001, 0, h) m with h = 0.3 and 1.2: stretching
# along z keeps the offset of 1 mm.
PENDULUM: Final = Family(
    "InvertedPendulum",
    {
        "InvertedPendulum": (),
        "SmallInvertedPendulum": (Stretch("pole", 0.5, axis="z"),),
        "BigInvertedPendulum": (Stretch("pole", 2.0, axis="z"),),
    },
)
DOUBLE_PENDULUM: Final = Family("InvertedDoublePendulum", {"InvertedDoublePendulum": ()})

_CART_AND_POLE: Final = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
_CART_AND_POLES: Final = (*_CART_AND_POLE, int(mujoco.mjtJoint.mjJNT_HINGE))

FALLEN_RAD: Final = 0.2
"""Angle at which Gymnasium ends an episode of the single pendulum, rad."""
FALLEN_M: Final = 1.0
"""The tip's height at which Gymnasium ends an episode of the unedited double pendulum, m."""
CLIPPED_AT: Final = 10.0
"""Limit to which Gymnasium clips the double pendulum's velocities, m/s and rad/s, and force, N."""


class InvertedPendulumEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    TunedStep, GymnasiumInvertedPendulumEnv
):
    """Balance a pole on a cart: Gymnasium's `InvertedPendulum-v5` with any body of its family.

    The bodies "SmallInvertedPendulum" and "BigInvertedPendulum" have poles half as long and twice
    as long.

    ## Action space
    `Box(-3, 3, (1,), float32)`: the force on the cart divided by the motor's gear of 100 N. An
    action lasts 0.04 s.

    | Num | Action        | Min | Max | Unit |
    | --- | ------------- | --- | --- | ---- |
    | 0   | `slide/motor` | -3  | 3   | 1    |

    ## Observation space
    `Box(-inf, inf, (4,), float64)`, for the unedited body:

    | Num | Observation       | Min    | Max   | Unit  |
    | --- | ----------------- | ------ | ----- | ----- |
    | 0   | `slider/position` | -1     | 1     | m     |
    | 1   | `hinge/angle`     | -1.571 | 1.571 | rad   |
    | 2   | `slider/velocity` | -inf   | inf   | m/s   |
    | 3   | `hinge/velocity`  | -inf   | inf   | rad/s |

    ## Reward
    `1` for each step after which the pole stands.

    ## Start
    Position and velocity 0, each with uniform noise of `reset_noise_scale` (0.01).

    ## End
    Terminated when the pole leans by more than 0.2 rad, whatever its length, or the state is not
    finite. Truncated after 1,000 steps.

    ## Info
    `reward_survive`. `diverged` if the simulation has diverged.

    ## Arguments
    - `reset_noise_scale` (0.01): size of the noise at the start.
    - `xml_file` ("inverted_pendulum.xml"): file of the unedited body.
    - `frame_skip` (2): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a pendulum, edits of `shapechanger.morphology`, or their JSON.
        **arguments: The arguments in the two lists above.
    """

    family = PENDULUM
    binding = Binding
    replaced = ("do_simulation", "_step_mujoco_simulation", "_get_obs")

    def __init__(self, body: BodyLike = "InvertedPendulum", **arguments: Any) -> None:
        self._begin(body, arguments)
        cast("Any", GymnasiumInvertedPendulumEnv).__init__(self, **arguments)
        self._finish(arguments)

    def _advance(self, bound: Binding, action: Any) -> StepResult:
        # Gymnasium's `step`, with each number computed once.
        if type(action) is not np.ndarray or action.shape != bound.shape:
            action = check_action(self, action)
        if not math.isfinite(sum(action.tolist())):
            check_action(self, action)
        bound.ctrl[:] = action
        bound.move()
        observation = np.concatenate((bound.qpos, bound.qvel))
        numbers = observation.tolist()
        # A finite sum proves that all numbers are finite; an infinite sum may be an overflow.
        finite = math.isfinite(sum(numbers)) or bool(np.isfinite(observation).all())
        terminated = not finite or abs(numbers[1]) > FALLEN_RAD
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


class InvertedDoublePendulumEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Reshapable, GymnasiumInvertedDoublePendulumEnv
):
    """Balance two poles on a cart: Gymnasium's `InvertedDoublePendulum-v5` with an editable body.

    Reward and end use the tip's height relative to the poles' length: Gymnasium's limit of 1 m for
    poles of 1.2 m becomes 2 m for poles twice as long.

    ## Action space
    `Box(-1, 1, (1,), float32)`: the force on the cart divided by the motor's gear of 500 N. An
    action lasts 0.05 s.

    | Num | Action        | Min | Max | Unit |
    | --- | ------------- | --- | --- | ---- |
    | 0   | `slide/motor` | -1  | 1   | 1    |

    ## Observation space
    `Box(-inf, inf, (9,), float64)`, for the unedited body:

    | Num | Observation               | Min | Max | Unit  |
    | --- | ------------------------- | --- | --- | ----- |
    | 0   | `slider/position`         | -1  | 1   | m     |
    | 1   | `hinge/sin`               | -1  | 1   | 1     |
    | 2   | `hinge2/sin`              | -1  | 1   | 1     |
    | 3   | `hinge/cos`               | -1  | 1   | 1     |
    | 4   | `hinge2/cos`              | -1  | 1   | 1     |
    | 5   | `slider/velocity`         | -10 | 10  | m/s   |
    | 6   | `hinge/velocity`          | -10 | 10  | rad/s |
    | 7   | `hinge2/velocity`         | -10 | 10  | rad/s |
    | 8   | `slider/constraint_force` | -10 | 10  | N     |

    ## Reward
    `healthy_reward - distance_penalty - velocity_penalty`: 10 while the poles stand, minus `0.01
    x^2 + (y - 2)^2` of the tip at (x, y), m, minus `0.001 w1^2 + 0.005 w2^2` of the hinges'
    velocities, rad/s.

    ## Start
    At rest and upright, with uniform noise of `reset_noise_scale` (0.1) on positions, and normal
    noise of this standard deviation on velocities.

    ## End
    Terminated when the tip is at 1 m or below. Truncated after 1,000 steps.

    ## Info
    `reward_survive`, `distance_penalty` and `velocity_penalty`. `diverged` if the simulation has
    diverged.

    ## Arguments
    - `healthy_reward` (10): reward of each step while the poles stand.
    - `reset_noise_scale` (0.1): size of the noise at the start.
    - `xml_file` ("inverted_double_pendulum.xml"): file of the unedited body.
    - `frame_skip` (5): physics steps of an action.

    ## Versions
    v1: the first.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON. It
            must keep two hinges, which the observation and the reward rely on.
        **arguments: The arguments in the two lists above.
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
        plain = compile_body(self.family.load(self.fullpath), ()) if self.body else self.model
        self._plain_foot_m, self._plain_length_m = _foot_and_length(plain)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        _foot_and_length(model)
        names = [model.joint(j).name for j in range(model.njnt)]
        cart, *hinges = (Element("joint", name) for name in names)
        force = Feature(f"{cart.name}/constraint_force", "N", -CLIPPED_AT, CLIPPED_AT, cart)
        angles = [
            Feature(f"{hinge.name}/{function}", "1", -1.0, 1.0, hinge)
            for function in ("sin", "cos")
            for hinge in hinges
        ]
        velocities = velocity_features(model, CLIPPED_AT)
        return [position_features(model)[0], *angles, *velocities, force]

    def step(self, action: Any) -> Any:
        """Take one step; the height that ends the episode is proportional to the poles' length."""
        observation, reward, _, truncated, info = cast("Any", super()).step(action)
        return observation, reward, self._fallen, truncated, info

    def _get_rew(self, x: float, y: float, terminated: bool) -> tuple[float, dict[str, float]]:
        """Return Gymnasium's reward for poles of any length with their tip at (x, y), m."""
        height = (y - self._foot_m) * (self._plain_length_m / self._length_m) + self._plain_foot_m
        self._fallen = bool(height <= FALLEN_M)
        return cast("Any", super())._get_rew(x, height, self._fallen)


def _foot_and_length(model: mujoco.MjModel) -> tuple[float, float]:
    """Return the height of the first hinge, and of the tip above it with both poles upright, m."""
    if tuple(model.jnt_type) == _CART_AND_POLES and model.nsite > 0:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        foot = float(data.xanchor[1, 2])
        length = float(data.site_xpos[0, 2]) - foot
        if length > 0.0:
            return foot, length
    raise MorphologyError(
        "A double pendulum needs a cart on a slide, two poles on hinges and a tip above them: its "
        "observation and its reward depend on these."
    )
