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

from shapechanger.contract.measure import FORWARD_SPEED, RETURN, Measure
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
from shapechanger.morphology.pose import Lift, standing_height, start_pose, trunk_lift


def _runner(name: str, legs: Mapping[str, tuple[str, str, str]]) -> Family:
    """Family of runners in a plane, whose parts are feet cut short.

    Args:
        name: Its name.
        legs: Thigh, shank and foot of each leg.
    """
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
WALKER2D: Final = _runner(
    "Walker2d",
    {
        "right leg": ("thigh", "leg", "foot"),
        "left leg": ("thigh_left", "leg_left", "foot_left"),
    },
)
SWIMMER: Final = Family("Swimmer", {"Swimmer": ()})
HUMANOID: Final = Family("Humanoid", {"Humanoid": ()})

# Where Gymnasium clips the velocities that Hopper and Walker2d observe, m/s and rad/s.
_CLIPPED_AT: Final = 10.0
# The joints that move a trunk in the world.
IN_A_PLANE: Final = ("slide", "slide", "hinge")
IN_SPACE: Final = ("free",)

_KINDS: Final = {
    mujoco.mjtJoint.mjJNT_FREE: "free",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_SLIDE: "slide",
    mujoco.mjtJoint.mjJNT_HINGE: "hinge",
}


class Runner(Reshapable):
    """Mixin for Gymnasium's runners, which start upright with straight legs.

    The start pose is Gymnasium's, with each joint moved to its nearest limit where the model puts
    it beyond, and the trunk high enough for the feet. Noise is drawn as in Gymnasium; joints stay
    inside their limits and feet above the floor. The standing height is the start pose's,
    because in the middle of their ranges these legs are folded.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON; None
            for the family's first.
        **arguments: All arguments of Gymnasium's env and of `Reshapable`.

    Attributes:
        measures: What a policy is measured by.
        root: Types of the joints that the task reads the trunk's place from.
        place_size: How many numbers of the trunk's place the observation omits by default.
        velocity_limit: Where the observation clips velocities, m/s and rad/s.
    """

    measures: ClassVar[tuple[Measure, ...]] = (FORWARD_SPEED, RETURN)
    root: ClassVar[tuple[str, ...]] = IN_A_PLANE
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
            _KINDS[mujoco.mjtJoint(kind)]
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
        low, high = self._gymnasiums_z_range
        return _grown(low, growth, plain_lift, lift), _grown(high, growth, plain_lift, lift)

    @property
    def healthy_z_range(self) -> tuple[float, float]:
        """Heights between which the body is healthy, m, as positions of the trunk's joint."""
        return self._healthy_z_range


def _grown(number: float, growth: float, before: Lift, after: Lift) -> float:
    """Convert a position of one trunk's joint to a body that stands `growth` times as high."""
    height_m = before.at_zero_m + before.up * number
    return after.number_at(growth * height_m)


class HalfCheetahEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumHalfCheetahEnv
):
    """Gymnasium's `HalfCheetah-v5` with an editable body.

    Actions, observations, rewards and infos equal `HalfCheetah-v5`'s. See `Runner` for the
    arguments, and for the start pose, which follows from the body.
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
    """Gymnasium's `Hopper-v5` with an editable body.

    Actions, observations, rewards and infos equal `Hopper-v5`'s. See `HealthyRunner` for the
    arguments, and for the start pose and the healthy heights, which follow from the body.
    """

    family = HOPPER
    velocity_limit = _CLIPPED_AT


class Walker2dEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumWalker2dEnv
):
    """Gymnasium's `Walker2d-v5` with an editable body.

    Actions, observations, rewards and infos equal `Walker2d-v5`'s. See `HealthyRunner` for the
    arguments, and for the start pose and the healthy heights, which follow from the body.
    """

    family = WALKER2D
    velocity_limit = _CLIPPED_AT


class SwimmerEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Runner, GymnasiumSwimmerEnv
):
    """Gymnasium's `Swimmer-v5` with an editable body.

    Actions, observations, rewards and infos equal `Swimmer-v5`'s. It swims in the horizontal
    plane and has no standing height. See `Runner` for the arguments.
    """

    family = SWIMMER
    place_size = 2


class HumanoidEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    HealthyRunner, GymnasiumHumanoidEnv
):
    """Gymnasium's `Humanoid-v5` with an editable body.

    Actions, observations, rewards and infos equal `Humanoid-v5`'s. See `HealthyRunner` for the
    arguments, and for the start pose and the healthy heights, which follow from the body: the knees
    start at their limit, bent by 2 degrees, where Gymnasium's start straight.
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
