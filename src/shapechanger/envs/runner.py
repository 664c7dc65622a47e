"""What Gymnasium's running bodies have in common once they can change their shape."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Final, cast

import mujoco

from shapechanger.embodiments.family import BodyLike
from shapechanger.envs.layouts import position_features, velocity_features
from shapechanger.envs.reshapable import Reshapable
from shapechanger.errors import MorphologyError
from shapechanger.layout import Feature
from shapechanger.morphology import compile_body
from shapechanger.morphology.pose import Lift, standing_height, start_pose, trunk_lift

__all__ = ["IN_A_PLANE", "IN_SPACE", "HealthyRunner", "Runner"]

# The joints by which a trunk moves in the world.
IN_A_PLANE: Final = ("slide", "slide", "hinge")
IN_SPACE: Final = ("free",)

_KINDS: Final = {
    mujoco.mjtJoint.mjJNT_FREE: "free",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_SLIDE: "slide",
    mujoco.mjtJoint.mjJNT_HINGE: "hinge",
}


class Runner(Reshapable):
    """Mixed in before one of Gymnasium's runners, which start upright with straight legs.

    The start pose is Gymnasium's, with each joint at the nearest limit where the model puts it
    beyond, and the trunk no lower than the feet need. Noise is drawn as in Gymnasium; joints stay
    inside their limits and feet above the floor. The standing height is that of the start pose: in
    the middle of their ranges these legs are folded.

    Args:
        body: Name of a body of the family, edits of `shapechanger.morphology`, or their JSON; None
            for the family's first.
        **arguments: All arguments of Gymnasium's env.

    Attributes:
        root: Kinds of the joints that the task reads the trunk's place from.
        place_size: How many numbers of the trunk's place the observation leaves out by default.
        velocity_limit: Where the observation clips velocities, m/s and rad/s.
    """

    root: ClassVar[tuple[str, ...]] = IN_A_PLANE
    place_size: ClassVar[int] = 1
    velocity_limit: ClassVar[float] = math.inf

    def __init__(self, body: BodyLike | None = None, **arguments: Any) -> None:
        self._place_hidden = arguments.get("exclude_current_positions_from_observation", True)
        self._begin(self.family.name if body is None else body, arguments)
        cast("Any", super()).__init__(**arguments)
        self._finish(arguments)

    def _follow_body(self) -> None:
        super()._follow_body()
        self.init_qpos = start_pose(self.model, inside=0.0)
        self.standing_height = standing_height(self.model, self.init_qpos)

    def _observation_features(self, model: mujoco.MjModel) -> list[Feature]:
        trunk = [
            _KINDS[mujoco.mjtJoint(kind)]
            for kind, body in zip(model.jnt_type, model.jnt_bodyid, strict=True)
            if body == model.jnt_bodyid[0]
        ]
        if tuple(trunk) != self.root:
            raise MorphologyError(
                f"The task reads where the {self.family.name} is from the joints of its trunk, "
                f"which must be {', '.join(self.root)}; here they are {', '.join(trunk) or 'none'}."
            )
        features = position_features(model)[self.place_size if self._place_hidden else 0 :]
        return features + velocity_features(model, self.velocity_limit)


class HealthyRunner(Runner):
    """A runner that is healthy while its trunk is neither too low nor too high.

    The heights are Gymnasium's for the body as it is; for any other they grow with the height at
    which it stands.

    Args:
        body: As in `Runner`.
        healthy_z_range: Heights of the trunk between which the body is healthy, m, as the joint
            that raises it counts them; None derives them from the body.
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
        """Gymnasium's range, as much higher as the body stands higher than the model as it is."""
        lift, plain = trunk_lift(self.model), compile_body(self.family.load(self.fullpath), ())
        plain_lift, plain_stands = trunk_lift(plain), _stands(plain)
        if not (lift and plain_lift and plain_stands and self.standing_height):
            return self._gymnasiums_z_range
        growth = self.standing_height / plain_stands
        low, high = self._gymnasiums_z_range
        return _grown(low, growth, plain_lift, lift), _grown(high, growth, plain_lift, lift)

    @property
    def healthy_z_range(self) -> tuple[float, float]:
        """Heights between which the body is healthy, m, as the joint of the trunk counts them."""
        return self._healthy_z_range


def _stands(model: mujoco.MjModel) -> float | None:
    return standing_height(model, start_pose(model, inside=0.0))


def _grown(number: float, growth: float, before: Lift, after: Lift) -> float:
    """The number that raises the trunk of one body, for another that is `growth` times as high."""
    height_m = before.at_zero_m + before.up * number
    return after.number_at(growth * height_m)
