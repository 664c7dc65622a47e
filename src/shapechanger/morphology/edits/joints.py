"""Edits of joints: their range, and locking them."""

from __future__ import annotations

import math
from typing import ClassVar, Final

import mujoco

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import Edit, part_of_the_way
from shapechanger.morphology.spec.elements import select
from shapechanger.morphology.spec.positions import displace, limits, reference_of, set_limits
from shapechanger.morphology.spec.references import remove_joint

# MuJoCo needs a range above zero; that of a partly locked joint is at least this.
_NARROWEST_RAD: Final = 1e-3


class JointRange(Edit, frozen=True):
    """Change how far hinges and slides move; a joint without limits becomes limited.

    A slide without limits needs both. At a smaller amount, its limits are farther apart.

    Attributes:
        joint: Name or glob of the joints.
        lower: New lower limit, rad or m; None keeps the old one.
        upper: New upper limit, rad or m; None keeps the old one.
    """

    needs: ClassVar = (mujoco.mjtDisableBit.mjDSBL_LIMIT, "limits of joints")
    joint: str
    lower: float | None = None
    upper: float | None = None

    def check(self) -> None:
        """Refuse an empty range, or none at all."""
        limits = [x for x in (self.lower, self.upper) if x is not None]
        if not limits or not all(math.isfinite(x) for x in limits):
            raise MorphologyError(f"A joint range needs a finite lower or upper limit, got {self}.")
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise MorphologyError(f"The lower limit must be below the upper one, got {self}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every joint that fits."""
        for joint in select("joint", self.joint, spec.joints):
            old = limits(joint)
            if old is None:
                old = self._far_limits(joint)
            new = [
                o if n is None else part_of_the_way(o, n, self.amount)
                for o, n in zip(old, (self.lower, self.upper), strict=True)
            ]
            if not new[0] < new[1]:
                raise MorphologyError(
                    f"The range of {joint.name!r} would be {new[0]:.4g} to {new[1]:.4g}."
                )
            set_limits(joint, *new)

    def _far_limits(self, joint: mujoco.MjsJoint) -> tuple[float, float]:
        """Return limits for a slide without limits: the smaller the amount, the wider.

        Raises:
            MorphologyError: If the edit gives one limit only.
        """
        if self.lower is None or self.upper is None:
            raise MorphologyError(f"{joint.name!r} slides without limits: give both of them.")
        reach = (self.upper - self.lower) / self.amount
        return self.lower - reach, self.upper + reach


class Lock(Edit, frozen=True):
    """Lock hinges or slides at a position: remove the joints and their motors, keep the limbs.

    A joint that is coupled to a locked one is held where the coupling puts it. Both spaces shrink,
    so a policy needs a body map to be transferred; the rule `hold` of the map presents the locked
    position to the policy.

    Attributes:
        joint: Name or glob of the joints.
        position: Position at which it is locked, rad or m; None for the middle of its range.
    """

    joint: str
    position: float | None = None

    def check(self) -> None:
        """Refuse a position that is not a finite number."""
        if self.position is not None and not math.isfinite(self.position):
            raise MorphologyError(f"A joint cannot be locked at {self.position}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Lock every joint that fits."""
        joints = select("joint", self.joint, spec.joints)
        positions = {joint.name: self._position_of(joint) for joint in joints}
        if self.amount == 1.0:
            displacements = {
                joint.name: positions[joint.name] - reference_of(joint) for joint in joints
            }
            for joint in joints:
                displace(spec, joint, displacements[joint.name])
                remove_joint(spec, joint, displacements)
            return
        for joint in joints:
            position, far = positions[joint.name], 1.0 / self.amount
            lower, upper = limits(joint) or (position - far, position + far)
            narrow = max(1.0 - self.amount, _NARROWEST_RAD / (upper - lower))
            set_limits(
                joint,
                position + narrow * (lower - position),
                position + narrow * (upper - position),
            )

    def _position_of(self, joint: mujoco.MjsJoint) -> float:
        """Return the position at which a joint is locked, rad or m."""
        old = limits(joint)
        if self.position is not None:
            return self.position
        if old is None:
            raise MorphologyError(
                f"{joint.name!r} slides without limits, so it has no middle: give a position."
            )
        return 0.5 * (old[0] + old[1])
