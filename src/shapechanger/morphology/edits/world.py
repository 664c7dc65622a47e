"""Edits of the world and of where the trunk starts in it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import Edit, Vector, part_of_the_way, require_vector
from shapechanger.morphology.spec.elements import limbs_and_trunks, select

if TYPE_CHECKING:
    import mujoco

__all__ = ["Gravity", "StartHeight"]

# Ten times that of Jupiter's cloud tops (24.8 m/s²) is a typing mistake.
_LARGEST_GRAVITY: Final = 250.0
_LARGEST_HEIGHT_M: Final = 100.0


class Gravity(Edit, frozen=True):
    """Change the gravity of the world.

    Attributes:
        to: Acceleration of free fall along x, y and z, m/s²; (0, 0, -9.81) on Earth. A vector that
            leans is a floor that slopes.
    """

    to: Vector

    def check(self) -> None:
        """Refuse what is not finite or absurdly strong."""
        require_vector("Gravity", self.to, nonzero=False)
        if math.hypot(*self.to) > _LARGEST_GRAVITY:
            raise MorphologyError(
                f"Gravity is at most {_LARGEST_GRAVITY:g} m/s², got {math.hypot(*self.to):g}."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Set the model's gravity."""
        spec.option.gravity = [
            part_of_the_way(old, new, self.amount)
            for old, new in zip(spec.option.gravity.tolist(), self.to, strict=True)
        ]


class StartHeight(Edit, frozen=True):
    """Change the height at which a trunk starts.

    Attributes:
        body: Name of a body that hangs on the world.
        to: Height of its origin above the world's, m.
    """

    body: str
    to: float

    def check(self) -> None:
        """Refuse a height that is no number."""
        if not abs(self.to) <= _LARGEST_HEIGHT_M:  # Also refuses NaN.
            raise MorphologyError(
                f"A start height is at most {_LARGEST_HEIGHT_M:g} m, got {self.to}."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Raise or lower every trunk that fits."""
        trunks = [body for body in limbs_and_trunks(spec) if body.parent.parent is None]
        for body in select("trunk", self.body, trunks):
            position = body.pos.copy()
            position[2] = part_of_the_way(float(position[2]), self.to, self.amount)
            body.pos = position
