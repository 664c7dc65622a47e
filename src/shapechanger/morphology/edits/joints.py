"""Edits of joints: their range, locks, motors, and the freedom of a body that is fixed.

A URDF file has no motors and is fixed to the world: `AddMotor` and `AddFreeJoint` make a robot of
it that can be run.
"""

from __future__ import annotations

from typing import ClassVar, Final

import mujoco

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import Edit, part_of_the_way, require_gear
from shapechanger.morphology.spec import require_free_name, select
from shapechanger.morphology.spec.geometry import displace, limits, reference_of, set_limits
from shapechanger.morphology.spec.references import OF_JOINTS, remove_joint

# MuJoCo needs a range above zero: smallest range of a partly locked joint.
_NARROWEST_RAD: Final = 1e-3
# A motor that exists in part is never weaker than this share.
_WEAKEST_PART: Final = 0.01


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
        if self.lower is None and self.upper is None:
            raise MorphologyError(f"A joint range needs a lower or upper limit, got {self}.")
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise MorphologyError(f"The lower limit must be below the upper one, got {self}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every joint that fits."""
        for joint in select("joint", self.joint, spec.joints):
            old = limits(joint)
            if old is None:
                if self.lower is None or self.upper is None:
                    raise MorphologyError(
                        f"{joint.name!r} slides without limits: give both of them."
                    )
                # The smaller the amount, the wider.
                reach = (self.upper - self.lower) / self.amount
                old = self.lower - reach, self.upper + reach
            lower, upper = (
                o if n is None else part_of_the_way(o, n, self.amount)
                for o, n in zip(old, (self.lower, self.upper), strict=True)
            )
            if not lower < upper:
                raise MorphologyError(
                    f"The range of {joint.name!r} would be {lower:.4g} to {upper:.4g}."
                )
            set_limits(joint, lower, upper)


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

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Lock every joint that fits."""
        joints = select("joint", self.joint, spec.joints)
        positions = {joint.name: self._position_of(joint) for joint in joints}
        by = {joint.name: positions[joint.name] - reference_of(joint) for joint in joints}
        for joint in joints:
            if self.amount == 1.0:
                displace(joint, by[joint.name])
                remove_joint(spec, joint, by)
                continue
            position, far = positions[joint.name], 1.0 / self.amount
            lower, upper = limits(joint) or (position - far, position + far)
            narrow = max(1.0 - self.amount, _NARROWEST_RAD / (upper - lower))
            ends = (position + narrow * (lower - position), position + narrow * (upper - position))
            set_limits(joint, *ends)

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


class AddMotor(Edit, frozen=True):
    """Add a motor to joints that have none, named after the joint, with controls from -1 to 1.

    Attributes:
        joint: Name or glob of the joints; those of a glob that have a motor, that an equality
            makes follow another joint, or that no single motor can move, are left as they are.
        gear: Torque, N·m, or force, N, for a control of 1; None for the largest that the model
            allows the joint (`effort` in URDF, `actuatorfrcrange` in MJCF).
    """

    needs: ClassVar = (mujoco.mjtDisableBit.mjDSBL_ACTUATION, "actuators")
    joint: str
    gear: float | None = None

    def check(self) -> None:
        """Refuse a gear of zero."""
        require_gear(self.gear)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add a motor to every joint that fits and has none."""
        if not spec.joints:
            raise MorphologyError("The model has no joints, so there is nothing to add a motor to.")
        moved = {actuator.target for actuator in spec.actuators if actuator.trntype in OF_JOINTS}
        # This includes models that make two joints follow each other: one of them has a motor.
        couplings = [e for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT]
        moved |= {e.name1 for e in couplings if e.name2 and e.active and e.name1 != self.joint}
        one_way = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
        found = select("joint", self.joint, spec.joints)
        joints = [joint for joint in found if joint.type in one_way and joint.name not in moved]
        if not joints:
            raise MorphologyError(
                f"Each hinge and slide that matches {self.joint!r} has a motor, or none matches; "
                "a joint that follows another one needs none."
            )
        for joint in joints:
            gear = float(abs(joint.actfrcrange).max()) if self.gear is None else self.gear
            if not gear:
                raise MorphologyError(
                    f"The model states no largest torque or force of {joint.name!r}: give a gear."
                )
            add_motor(spec, joint.name, gear * max(self.amount, _WEAKEST_PART))


def add_motor(spec: mujoco.MjSpec, name: str, gear: float) -> None:
    """Add a motor to the joint of its name; its gear is the N·m or N for a control of 1."""
    require_free_name(spec, "actuator", name)
    motor = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=[-1.0, 1.0],
        gear=[gear, 0.0, 0.0, 0.0, 0.0, 0.0],
    )
    motor.set_to_motor()


class AddFreeJoint(Edit, frozen=True):
    """Set a body that is fixed to the world free, with everything attached to it.

    Attributes:
        body: Name of a body on the world that has no joint.
    """

    body: str

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the free joint."""
        body = select("trunk", self.body, spec.worldbody.bodies)[0]
        if body.joints:
            raise MorphologyError(
                f"{body.name!r} is not fixed: it has the joint {body.joints[0].name!r}."
            )
        # A body that MuJoCo has merged with the world cannot move.
        spec.compiler.fusestatic = False
        require_free_name(spec, "joint", f"{body.name}_free")
        body.add_freejoint(name=f"{body.name}_free")
