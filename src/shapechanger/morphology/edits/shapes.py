"""Edits of a segment's shape: longer, thicker."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from shapechanger.morphology.edits.edit import Edit, part_of_the_way, require_factor
from shapechanger.morphology.spec.elements import limbs_and_trunks, select
from shapechanger.morphology.spec.segments import require_geometry, stretch_segment, thicken_segment

if TYPE_CHECKING:
    import mujoco

__all__ = ["Radius", "Stretch"]


class Stretch(Edit, frozen=True):
    """Make segments longer or shorter at the same thickness, held at their joints.

    What hangs on a segment is carried outwards. Mass and inertia follow from the new geometry at
    the same density. Of a box or ellipsoid the longest half-size is its length; along an axis it is
    the one that lies along it.

    Attributes:
        body: Name or glob of the bodies.
        factor: New length over old length, 0.01 to 100.
        axis: Axis of the body to stretch along; None for all three, which keeps a limb straight.
    """

    body: str
    factor: float
    axis: Literal["x", "y", "z"] | None = None

    def check(self) -> None:
        """Refuse an absurd factor."""
        require_factor("The factor of a stretch", self.factor)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Stretch every body that fits."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        for body in select("body", self.body, limbs_and_trunks(spec)):
            require_geometry(spec, body)
            stretch_segment(spec, body, factor, self.axis)


class Radius(Edit, frozen=True):
    """Make segments thicker or thinner at the same length; mass and inertia follow.

    Attributes:
        body: Name or glob of the bodies.
        factor: New radius over old radius, 0.01 to 100. Of a box or ellipsoid the two smaller
            half-sizes are scaled.
    """

    body: str
    factor: float

    def check(self) -> None:
        """Refuse an absurd factor."""
        require_factor("The factor of a radius", self.factor)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Thicken every body that fits."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        for body in select("body", self.body, limbs_and_trunks(spec)):
            require_geometry(spec, body)
            thicken_segment(spec, body, factor)
