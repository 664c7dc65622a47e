"""What is left of the vehicle and what is right of it, so that a picture may be mirrored."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.errors import CloningError
from shapechanger.layout import Layout

__all__ = ["STEERING", "Mirror", "mirror_of"]

# Parts of a name, between slashes. Seen in the mirror, the first change their sign and the second
# stay as they are; yaw is to the left and y points to the left.
_NEGATED: Final = frozenset({"steering", "yaw_rate", "acceleration_y"})
_KEPT: Final = frozenset(
    {"throttle", "forward", "backward", "speed", "distance", "acceleration_x"}
    | {"bump", "stall", "collision", "battery", "temperature"}
)
_SIDES: Final = {"left": "right", "right": "left"}
_SIDE: Final = re.compile(r"(?<![a-z])(left|right)(?![a-z])")


@dataclass(frozen=True, slots=True)
class Mirror:
    """What becomes of the numbers of a layout when the world is mirrored.

    Attributes:
        order: For each number the place that it comes from.
        signs: For each number 1 or -1.
        rightward: For each number 1 if more of it steers to the right, -1 to the left, 0 neither.
    """

    order: tuple[int, ...]
    signs: tuple[float, ...]
    rightward: tuple[float, ...]

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The mirrored numbers, shape (n, size) in and out."""
        return values[:, list(self.order)] * np.asarray(self.signs, np.float32)

    def even(self, actions: NDArray[np.float32]) -> float:
        """How evenly these actions steer to both sides: 0 for one only, 1 for as much to each.

        A drive that turns to one side only tells which way to go where there are two, and in the
        mirror it would tell the opposite.
        """
        aside = actions @ np.asarray(self.rightward, np.float32)
        right, left = float(aside.clip(min=0.0).sum()), float((-aside).clip(min=0.0).sum())
        return min(right, left) / max(right, left) if max(right, left) else 1.0


STEERING: Final = Mirror((0, 1), (-1.0, 1.0), (1.0, 0.0))
"""Of steering and throttle."""


def mirror_of(layout: Layout) -> Mirror:
    """The mirror of a layout: steering changes its sign, left and right change places.

    Raises:
        CloningError: If nothing is known of the mirror of one of its numbers.
    """
    order: list[int] = []
    signs: list[float] = []
    rightward: list[float] = []
    names = layout.names
    for place, feature in enumerate(layout):
        parts = set(feature.name.split("/"))
        other = _SIDE.sub(lambda found: _SIDES[found[0]], feature.name)
        if feature.shape:
            raise CloningError(f"nothing is known of the mirror of the block {feature.name}")
        if other != feature.name and other in names:
            order.append(names.index(other))
            signs.append(1.0)
            rightward.append(1.0 if _SIDE.findall(feature.name) == ["right"] else -1.0)
        elif parts & _NEGATED and feature.low == -feature.high:
            order.append(place)
            signs.append(-1.0)
            rightward.append(1.0)
        elif parts & _KEPT:
            order.append(place)
            signs.append(1.0)
            rightward.append(0.0)
        else:
            raise CloningError(f"nothing is known of the mirror of {feature.name}")
    return Mirror(tuple(order), tuple(signs), tuple(rightward))
