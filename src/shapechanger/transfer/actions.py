"""Actions of learners, from -1 to 1, and actions of envs, in the units of their actuators.

A learner explores with the same deviation in every action, which is too small for an actuator of
±200 N·m and too large for one of ±0.1 rad. Every learner therefore acts from -1 to 1. Layouts, body
maps, `TrainedPolicy.act`, exported policies, recordings and evaluations use the units of the env.
"""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from shapechanger.errors import SpaceMismatch
from shapechanger.layout import Layout

_Array = NDArray[np.float64]


class ActionScale(NamedTuple):
    """The scale of a model's actions: action of the env = middle + half * action of the model.

    Each array has the shape (n,) and the unit of each action; `half` is above zero. Actions of the
    env are clipped to `low` and `high`, unless the whole scale is the identity.
    """

    middle: _Array
    half: _Array
    low: _Array
    high: _Array

    @classmethod
    def between(cls, space: Any, layout: Layout) -> ActionScale:
        """Return the scale from a model's own action space to the range of a layout.

        An action is not scaled if its two ranges are equal, as for policies that were trained
        without a scale, or if it has no finite range in the space or in the layout.
        """
        box = cast("Box[Any]", space)
        # Bounds of a space are in single precision, bounds of a layout in double.
        low, high = (
            side.astype(box.dtype).astype(np.float64) for side in (layout.low, layout.high)
        )
        own_low, own_high = box.low.astype(np.float64), box.high.astype(np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            half = (high - low) / (own_high - own_low)
            middle = low - half * own_low
        plain = ~(np.isfinite(middle) & np.isfinite(half) & (half > 0.0))
        half[plain], middle[plain] = 1.0, 0.0
        return cls(middle, half, middle + half * own_low, middle + half * own_high)

    @property
    def is_identity(self) -> bool:
        """Whether the model acts in the units of the env."""
        return not self.middle.any() and bool((self.half == 1.0).all())

    def to_env(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Return a model's actions, shape (..., n), in the units of the env; see the class."""
        if self.is_identity:
            return actions
        scaled = np.clip(self.middle + self.half * actions, self.low, self.high)
        return scaled.astype(actions.dtype)

    def to_model(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Return actions of the env, shape (..., n), in the units of the model."""
        if self.is_identity:
            return actions
        return ((actions - self.middle) / self.half).astype(actions.dtype)

    def of_squashed(self, space: Any) -> tuple[_Array, _Array]:
        """Return the middle and half width, each (n,), of a bounded model space in env units."""
        box = cast("Box[Any]", space)
        low, high = box.low.astype(np.float64), box.high.astype(np.float64)
        return (self.middle + self.half * (0.5 * (low + high)), self.half * (0.5 * (high - low)))


def learners_space(space: Any) -> Box[np.float32]:
    """Return the action space in which a learner acts: -1 to 1 for each action."""
    return Box(-1.0, 1.0, space.shape, np.float32)


def require_ranges(env: str, space: Any, layout: Layout) -> None:
    """Refuse actions whose range is infinite or empty, or differs from the range in the layout."""
    box = cast("Box[Any]", space)
    names = [feature.name for feature in layout for _ in range(feature.size)]
    for name, low, high, stated_low, stated_high in zip(
        names, box.low, box.high, layout.low, layout.high, strict=True
    ):
        if not np.isfinite([low, high]).all() or not low < high:
            raise SpaceMismatch(
                f"The action {name!r} of {env} ranges from {low:g} to {high:g}, and a learner "
                "needs a finite range that is not empty: give its action space and its layout one."
            )
        if not np.allclose((low, high), (stated_low, stated_high)):
            raise SpaceMismatch(
                f"The action {name!r} of {env} ranges from {low:g} to {high:g} in its action space "
                f"and from {stated_low:g} to {stated_high:g} in its layout: make them equal."
            )
