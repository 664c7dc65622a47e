"""Edits of structure: lock joints, add motors and free joints; cut, remove, split and add limbs.

A URDF file has no motors and is fixed to the world: with `AddMotor` and `AddFreeJoint` it becomes a
robot that can move.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Final

import mujoco
import numpy as np
from msgspec import Meta

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import Edit, Positive, Ratio, Vector, part_of_the_way
from shapechanger.morphology.edits.values import require_gear, scale_strength
from shapechanger.morphology.spec import (
    LEAST_MASS,
    copy_element,
    copy_limb,
    geometry,
    move,
    references,
    require_free_name,
    select,
    select_limbs,
    share_contacts,
)
from shapechanger.morphology.spec.carried import Keyframes

_J: Final = mujoco.mjtJoint
_O: Final = mujoco.mjtObj
# Smallest range of a partly locked joint, rad or m, because MuJoCo needs a range above zero.
_NARROWEST_RAD: Final = 1e-3
# MuJoCo refuses bodies of almost no mass, so a limb that exists in part has at least this share of
# its full size, and so a millionth of its mass. A motor has at least this share of its strength.
_SMALLEST_PART: Final = 0.01
# Distance within which a geom counts as lying on the axis of its segment, m.
_ON_THE_AXIS_M: Final = 1e-12
# Fields of the resistance of a joint or tendon, and fields that a new hinge copies from another.
_RESISTANCE: Final = ("armature", "damping", "stiffness", "frictionloss")
_HINGE_FIELDS: Final = (
    *(*_RESISTANCE, "margin"),
    *("solref_limit", "solimp_limit", "solref_friction", "solimp_friction"),
)


class Lock(Edit, frozen=True):
    """Lock hinges or slides at a position: remove the joints and their motors, keep the limbs.

    A joint that is coupled to a locked one is held where the coupling puts it. Observation and
    action space shrink, so the transfer of a policy needs a body map; the rule `hold` of the map
    presents the locked position to the policy.

    Attributes:
        joint: Name or glob of the joints.
        position: Position at which a joint is locked, rad or m; None for the middle of its range.
    """

    joint: str
    position: float | None = None

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Lock every joint that matches."""
        joints = select("joint", self.joint, spec.joints)
        by: dict[str, float] = {}
        for joint in joints:
            position, old = self.position, geometry.limits(joint)
            if position is None and old is None:
                raise MorphologyError(
                    f"{joint.name!r} slides without limits, so it has no middle: give a position."
                )
            position = 0.5 * sum(old or ()) if position is None else position
            by[joint.name] = position - geometry.reference_of(joint)
            if self.amount < 1.0:
                far = 1.0 / self.amount
                ends = np.array(old or (position - far, position + far))
                narrow = max(1.0 - self.amount, _NARROWEST_RAD / (ends[1] - ends[0]))
                geometry.set_limits(joint, *(position + narrow * (ends - position)))
        for joint in joints if self.amount == 1.0 else ():
            geometry.displace(joint, by[joint.name])
            references.remove_joint(spec, joint, by)


class AddMotor(Edit, frozen=True):
    """Add a motor to joints that have none, named after the joint, with controls from -1 to 1.

    Attributes:
        joint: Name or glob of the joints. Joints with a motor, free joints and balls are skipped; a
            glob also skips joints that follow another one through an equality.
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
        """Add a motor to every joint that matches and has none."""
        moved = {each.target for each in spec.actuators if each.trntype in references.OF_JOINTS}
        # A glob skips followers; a joint that follows another can get a motor if it is named.
        couplings = [e for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT]
        moved |= {e.name1 for e in couplings if e.name2 and e.active and e.name1 != self.joint}
        found = select("joint", self.joint, spec.joints)
        one_way = (joint for joint in found if joint.type in (_J.mjJNT_HINGE, _J.mjJNT_SLIDE))
        joints = [joint for joint in one_way if joint.name not in moved]
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
            _add_motor(spec, joint.name, gear * max(self.amount, _SMALLEST_PART))


def _add_motor(spec: mujoco.MjSpec, name: str, gear: float) -> None:
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
    """Free a body that is fixed to the world, with everything attached to it.

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


class Cut(Edit, frozen=True):
    """Cut a limb: shorten a segment, and remove what is attached to it beyond the cut.

    The nearer part is unchanged, and geoms that the cut crosses become shorter. Sites, places of
    `connect` and `weld`, cameras and lights at or beyond the far end of the segment move to the new
    end.

    Attributes:
        body: Name or glob of the segments; not a trunk.
        keep: Share of the length that is kept, from the joint outwards, 0.01 to 1.
    """

    body: str
    keep: Annotated[float, Meta(ge=0.01, le=1.0)]

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Cut every segment that matches."""
        for body in select_limbs(spec, self.body, "cut"):
            geometry.require_geometry(spec, body)
            plane = geometry.Plane(body, self.keep)
            if self.keep == 1.0:
                continue
            references.release_drawings(spec, {references.key_of(body)})
            self._cut_geoms(spec, body, plane)
            share = part_of_the_way(1.0, self.keep, self.amount)
            for child in plane.children:
                if self.amount < 1.0:
                    there, held = geometry.held_at(child), geometry.anchor(body)
                    child.pos += held + share * (there - held) - there
                _take_away(spec, child, self.amount)
            for point in plane.points:
                if plane.is_at_end(point):
                    geometry.move_by(point, share * plane.along - plane.along)
                    continue
                references.require_unnamed(spec, references.key_of(point), "lies beyond the cut")
                if self.amount == 1.0:
                    spec.delete(point)

    def _cut_geoms(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, plane: geometry.Plane) -> None:
        pieces = [(geom, plane.piece_of(geom)) for geom in body.geoms]
        if not any(piece.share for _, piece in pieces):
            raise MorphologyError(
                f"No geom of {body.name!r} lies within {self.keep:g} of its length, so "
                "no geom would be left: keep more."
            )
        for geom, piece in pieces:
            if not piece.share:
                references.require_unnamed(spec, references.key_of(geom), "lies beyond the cut")
                if self.amount == 1.0:
                    spec.delete(geom)
                else:
                    part = max(1.0 - self.amount, _SMALLEST_PART)
                    geometry.resize_geom(geom, geometry.middle_of(geom), part)
            elif piece.share < 1.0:
                geometry.shorten(geom, piece, part_of_the_way(1.0, piece.share, self.amount))


class Remove(Edit, frozen=True):
    """Remove a limb with everything attached to it, including joints and motors.

    Attributes:
        body: Name or glob of the body that the limb begins with; not a trunk.
    """

    body: str

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Remove every limb that matches."""
        for body in select_limbs(spec, self.body, "removed"):
            _take_away(spec, body, self.amount)


def _check_hinge(edit: Split | AddSegment) -> None:
    if not edit.lower < edit.upper:
        raise MorphologyError(
            f"A hinge needs a lower limit below its upper one, got {edit.lower}, {edit.upper}."
        )
    require_gear(edit.gear)
    if edit.axis is not None and not any(edit.axis):
        raise MorphologyError("The axis of a hinge must not be zero.")


class Split(Edit, frozen=True):
    """Split a segment in two, with a hinge where it was split.

    The nearer part keeps the body's name and joint. Geoms that the plane of the split cuts are
    divided; all other elements go to the part on their side, spheres and ellipsoids by their
    middle. The new hinge has the resistance of the body's own hinge, such as its damping, if any.

    Attributes:
        body: Name of the segment; not a trunk.
        name: Name of the farther part, of its hinge and of its motor.
        at: Position of the split as a share of the segment's length from the joint, 0 to 1.
        lower: Lower limit of the hinge, rad.
        upper: Upper limit of the hinge, rad.
        gear: Torque of a motor for a control of 1, N·m; controls are -1 to 1. None for no motor.
        axis: Axis of the hinge in the body's frame; None for the axis of the body's hinge.
    """

    body: str
    name: str
    at: Annotated[float, Meta(gt=0.0, lt=1.0)] = 0.5
    lower: float = -0.5
    upper: float = 0.5
    gear: float | None = None
    axis: Vector | None = None

    def check(self) -> None:
        """Refuse an empty range, and a gear or axis of zero."""
        _check_hinge(self)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Split the segment."""
        body = next(select_limbs(spec, self.body, "split"))
        geometry.require_geometry(spec, body)
        plane = geometry.Plane(body, self.at)
        pieces = {geom.name: plane.piece_of(geom) for geom in body.geoms}
        cut = [name for name, piece in pieces.items() if 0.0 < piece.share < 1.0]
        halves = {name: f"{name}_of_{self.name}" for name in cut}
        references.require_divisible(spec, body, halves)
        references.release_drawings(spec, {references.key_of(body)})
        beyond = [spec.geom(name) for name, piece in pieces.items() if not piece.share]
        part = _add_segment(spec, body, self, plane.place, self.amount)
        for point in (*beyond, *plane.points, *plane.children):
            geometry.move_by(move(spec, point, part), -plane.place)
        for name, half in halves.items():
            geom = spec.geom(name)
            copy = copy_element(spec, geom, part, half)
            self._divide(geom, copy, pieces[name], plane.place)
        share_contacts(spec, body, part, halves)

    def _divide(self, geom: Any, copy: Any, piece: geometry.NearPart, place: np.ndarray) -> None:
        """Divide a geom: it becomes the nearer half, and `copy` the farther half."""
        whole = geometry.volume(geom)
        # Scale the copy about its near end, and then move that end to the cut.
        geometry.move_by(copy, -piece.near)
        geometry.shorten(copy, piece._replace(near=np.zeros(3)), 1.0 - piece.share)
        end = piece.near + 2.0 * (geometry.middle_of(geom) - piece.near)
        offset = piece.near + piece.share * (end - piece.near) - place
        if float(np.linalg.norm(offset)) > _ON_THE_AXIS_M:
            geometry.move_by(copy, offset)
        geometry.shorten(geom, piece, piece.share)
        # The rounded ends at the split overlap. Their mass grows with the amount of the split.
        volumes = [geometry.volume(half) for half in (geom, copy)]
        rounded_end = 0.5 * (sum(volumes) - whole)
        for half, own in zip((geom, copy), volumes, strict=True):
            without = 1.0 - rounded_end / own
            geometry.scale_geom_mass(half, part_of_the_way(without, 1.0, self.amount))


class AddSegment(Edit, frozen=True):
    """Add a segment, with a hinge, at the far end of another.

    It is a capsule with the thickness, density, friction and appearance of the segment to which it
    is added; its hinge has the resistance of that segment's hinge, such as its damping, if any.

    Attributes:
        body: Name of the segment to which it is added.
        name: Name of the new body, of its hinge, of its motor, and with `_geom` of its geom.
        end: Far end of the new segment relative to its hinge, in the frame of `body`, m.
        lower: Lower limit of the hinge, rad.
        upper: Upper limit of the hinge, rad.
        gear: Torque of a motor for a control of 1, N·m; controls are -1 to 1. None for no motor.
        axis: Axis of the hinge in the frame of `body`; None for the axis of the segment's hinge.
        radius: Radius of the capsule, m; None for the radius of the segment.
    """

    body: str
    name: str
    end: Vector
    lower: float = -0.5
    upper: float = 0.5
    gear: float | None = None
    axis: Vector | None = None
    radius: Positive | None = None

    def check(self) -> None:
        """Refuse an empty range, and a length, gear or axis of zero."""
        _check_hinge(self)
        if not any(self.end):
            raise MorphologyError("The end of a segment must not be zero.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the segment."""
        body = select("body", self.body, spec.bodies[1:])[0]
        geometry.require_geometry(spec, body)
        part = _add_segment(spec, body, self, geometry.far_end(body), 1.0)
        model_geom = next(geom for geom in body.geoms if geom.type in geometry.LONG)
        geom = copy_element(spec, model_geom, part, f"{self.name}_geom")
        geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
        if not math.isnan(geom.mass):
            geom.density, geom.mass = geom.mass / geometry.volume(model_geom), math.nan
        geometry.set_ends(geom, np.array([0.0, 0.0, 0.0, *self.end]))
        if self.radius is not None:
            geom.size = [self.radius, 0.0, 0.0]
        if self.amount != 1.0:
            _shrink(spec, part, self.amount)


class AddLimb(Edit, frozen=True):
    """Add a limb: a copy of another, with its joints and motors, turned about the trunk.

    Attributes:
        like: Name of the body that the limb to copy begins with; not a trunk.
        suffix: Suffix of the copied names, such as `_5`.
        angle: Turn of the copy about the z axis of the body to which the limb is attached, rad;
            positive is counter-clockwise seen from above.
        size: Size of the copy relative to the limb, 0.01 to 100.
    """

    like: str
    suffix: Annotated[str, Meta(min_length=1)]
    angle: float
    size: Ratio = 1.0

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the limb."""
        limb = next(select_limbs(spec, self.like, "copied"))
        copy = copy_limb(spec, limb, self.suffix, self.angle)
        if self.size != 1.0:
            _resize_limb(spec, copy, self.size)
        if self.amount != 1.0:
            _shrink(spec, copy, self.amount)

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Pose the copy like the limb that it was copied from."""
        named = [element.name for element in (*spec.joints, *spec.actuators, *spec.bodies)]
        keyframes.copy({n: n.removesuffix(self.suffix) for n in named if n.endswith(self.suffix)})


def _take_away(spec: mujoco.MjSpec, limb: mujoco.MjsBody, amount: float) -> None:
    """Remove a limb; at an amount below 1, make it smaller and weaker instead."""
    if amount == 1.0:
        references.remove_limb(spec, limb)
    else:
        references.require_removable(spec, limb)
        _shrink(spec, limb, 1.0 - amount)


def _shrink(spec: mujoco.MjSpec, limb: mujoco.MjsBody, part: float) -> None:
    """Scale a limb that exists only in part, in size and strength."""
    _resize_limb(spec, limb, max(part, _SMALLEST_PART))
    # If a limb is scaled by two edits, masses can fall below MuJoCo's minimum.
    spec.compiler.boundmass = max(spec.compiler.boundmass, LEAST_MASS)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, LEAST_MASS)


def _resize_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, factor: float) -> None:
    """Scale a limb in size and strength, in place, with everything attached to it."""
    for body in (e for e in references.whole(limb) if isinstance(e, mujoco.MjsBody)):
        geometry.require_geometry(spec, body)
        held = geometry.anchor(body)
        for geom in body.geoms:
            geometry.resize_geom(geom, held, factor)
        geometry.carry_outwards(body, held, factor)
        for joint in body.joints:
            _scale_resistance(joint, factor)
    elements = references.elements_of(limb)
    references.release_drawings(spec, elements)
    for tendon in spec.tendons:
        path = {*references.path_elements(tendon)}
        if path.isdisjoint(elements) or not references.moves_only(spec, tendon, elements):
            continue
        elements.add(references.key_of(tendon))
        _scale_resistance(tendon, factor)
        if path <= elements and _O.mjOBJ_JOINT not in {kind for kind, _ in path}:
            tendon.range *= factor
            # A negative length stands for the length in the reference pose.
            tendon.springlength[tendon.springlength > 0.0] *= factor
    for mention in references.mentions(spec, "actuator"):
        strong = mention.element[0] in (_O.mjOBJ_JOINT, _O.mjOBJ_TENDON)
        if strong and mention.element in elements:
            scale_strength(mention.holder, factor)


def _scale_resistance(element: Any, factor: float) -> None:
    for field in _RESISTANCE:
        setattr(element, field, getattr(element, field) * factor)


def _add_segment(
    spec: mujoco.MjSpec, body: Any, edit: Split | AddSegment, place: np.ndarray, amount: float
) -> mujoco.MjsBody:
    """Add a body without geoms at `place` of `body`, on a new hinge, with its motor."""
    for kind in ("body", "joint", "actuator"):
        require_free_name(spec, kind, edit.name)
    own = next((j for j in body.joints if j.type == _J.mjJNT_HINGE), None)
    axis = edit.axis if own is None or edit.axis is not None else own.axis
    if axis is None:
        raise MorphologyError(f"{body.name!r} has no hinge whose axis can be used: give an axis.")
    part = body.add_body(name=edit.name, pos=place, gravcomp=body.gravcomp)
    hinge = part.add_joint(name=edit.name, type=_J.mjJNT_HINGE, axis=axis)
    for field in _HINGE_FIELDS if own is not None else ():
        setattr(hinge, field, getattr(own, field))
    strength = max(amount, _SMALLEST_PART)
    geometry.set_limits(hinge, strength * edit.lower, strength * edit.upper)
    if edit.gear is not None:
        _add_motor(spec, edit.name, strength * edit.gear)
    return part
