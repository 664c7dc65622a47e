"""Edits that turn a robot's description into a robot that can be run: motors, a floor, freedom.

A URDF file has no motors, is fixed to the world and stands nowhere, and the models of many
collections leave the floor to a scene.
"""

from __future__ import annotations

import math
from typing import ClassVar, Final

import mujoco

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import Edit
from shapechanger.morphology.spec.elements import limbs_and_trunks, require_free_name, select
from shapechanger.morphology.spec.strength import add_motor

_J: Final = mujoco.mjtJoint
_MOVES_JOINT: Final = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_MOVES_ONE_WAY: Final = (_J.mjJNT_HINGE, _J.mjJNT_SLIDE)
# MuJoCo's default friction of a geom: sliding, torsional [m] and rolling [m].
_TORSIONAL: Final = 0.005
_ROLLING: Final = 0.0001
_FLOOR_GRID_M: Final = 0.05
# A motor that exists in part is never weaker than this share.
_WEAKEST_PART: Final = 0.01


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
        if self.gear is not None and not (math.isfinite(self.gear) and self.gear != 0.0):
            raise MorphologyError(f"A motor needs a gear that is not zero, got {self.gear}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add a motor to every joint that fits and has none."""
        if not spec.joints:
            raise MorphologyError("The model has no joints, so there is nothing to add a motor to.")
        moved = {actuator.target for actuator in spec.actuators if actuator.trntype in _MOVES_JOINT}
        # Also of a model that makes two joints follow each other: one of them has a motor.
        moved |= {
            coupling.name1
            for coupling in spec.equalities
            if coupling.type == mujoco.mjtEq.mjEQ_JOINT
            and coupling.name2
            and coupling.active
            and coupling.name1 != self.joint
        }
        joints = [
            joint
            for joint in select("joint", self.joint, spec.joints)
            if joint.type in _MOVES_ONE_WAY and joint.name not in moved
        ]
        if not joints:
            raise MorphologyError(
                f"Each hinge and slide that matches {self.joint!r} has a motor, or none matches; "
                "a joint that follows another one needs none."
            )
        for joint in joints:
            gear = self._gear_of(joint) * max(self.amount, _WEAKEST_PART)
            add_motor(spec, joint.name, gear)

    def _gear_of(self, joint: mujoco.MjsJoint) -> float:
        """Return the gear of a joint's motor."""
        if self.gear is not None:
            return self.gear
        strongest = float(abs(joint.actfrcrange).max())
        if not strongest:
            raise MorphologyError(
                f"The model states no largest torque or force of {joint.name!r}: give a gear."
            )
        return strongest


class AddFreeJoint(Edit, frozen=True):
    """Set a body that is fixed to the world free, with everything attached to it.

    Attributes:
        body: Name of a body on the world that has no joint.
    """

    body: str

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the free joint."""
        trunks = [body for body in limbs_and_trunks(spec) if body.parent.parent is None]
        (body,) = select("trunk", self.body, trunks)[:1]
        if body.joints:
            raise MorphologyError(
                f"{body.name!r} is not fixed: it has the joint {body.joints[0].name!r}."
            )
        # A body that MuJoCo has merged with the world cannot move.
        spec.compiler.fusestatic = False
        name = f"{body.name}_free"
        require_free_name(spec, "joint", name)
        body.add_freejoint(name=name)


class AddFloor(Edit, frozen=True):
    """Add a horizontal floor without an edge, named `floor`.

    Attributes:
        friction: Coefficient of sliding friction; MuJoCo uses the larger one of two geoms.
        height: Its height, m.
    """

    friction: float = 1.0
    height: float = 0.0

    def check(self) -> None:
        """Refuse numbers that are not finite, and a negative friction."""
        if not (math.isfinite(self.height) and 0.0 <= self.friction < math.inf):
            raise MorphologyError(f"A floor needs a finite height and friction, got {self}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the floor."""
        require_free_name(spec, "geom", "floor")
        spec.worldbody.add_geom(
            name="floor",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[0.0, 0.0, self.height],
            size=[0.0, 0.0, _FLOOR_GRID_M],
            friction=[self.friction, _TORSIONAL, _ROLLING],
            contype=1,
            conaffinity=1,
        )
