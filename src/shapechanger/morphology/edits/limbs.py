"""Edits of the structure of a body: cut, remove, split, add."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Final

import mujoco
import numpy as np
from msgspec import Meta

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import (
    Edit,
    Positive,
    Ratio,
    Vector,
    part_of_the_way,
    require_gear,
)
from shapechanger.morphology.edits.joints import add_motor
from shapechanger.morphology.edits.values import scale_strength
from shapechanger.morphology.spec import (
    LEAST_MASS,
    require_free_name,
    select,
    select_limbs,
)
from shapechanger.morphology.spec.geometry import (
    LONG,
    NearPart,
    Plane,
    anchor,
    carry_outwards,
    far_end,
    held_at,
    move_by,
    place_of,
    require_geometry,
    resize_geom,
    scale_geom_mass,
    set_ends,
    set_limits,
    shorten,
    stretched,
    volume,
)
from shapechanger.morphology.spec.grafting import (
    copy_element,
    copy_limb,
    move,
    share_contacts,
)
from shapechanger.morphology.spec.references import (
    elements_of,
    key_of,
    moves_only,
    path_elements,
    references,
    release_drawings,
    remove_limb,
    require_divisible,
    require_removable,
    require_unnamed,
    subtree,
)

if TYPE_CHECKING:
    from shapechanger.morphology.spec.carried import Keyframes

_O: Final = mujoco.mjtObj
# MuJoCo refuses bodies of almost no mass, so a limb that exists in part is never smaller than this
# share of its full size, which is a millionth of its mass.
_SMALLEST_PART: Final = 0.01
# A geom that is divided this far from the axis of its segment lies on it, m.
_ON_THE_AXIS_M: Final = 1e-12
# Fields of a joint's resistance.
_HINGE_FIELDS: Final = (
    *("armature", "damping", "stiffness", "frictionloss", "margin"),
    *("solref_limit", "solimp_limit", "solref_friction", "solimp_friction"),
)


class Cut(Edit, frozen=True):
    """Cut a limb: shorten a segment, and remove what is attached to it beyond the cut.

    The nearer part is unchanged, and geoms that the cut crosses become shorter. Sites, pins
    of loops, cameras and lights at the far end or past it mark the end, and move to the new one.

    Attributes:
        body: Name or glob of the segments; not a trunk.
        keep: Share of the length that is kept, from the joint outwards, 0.01 to 1.
    """

    body: str
    keep: Annotated[float, Meta(ge=0.01, le=1.0)]

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Cut every segment that fits."""
        for body in select_limbs(spec, self.body, "cut"):
            require_geometry(spec, body)
            plane = Plane(body, self.keep)
            if self.keep == 1.0:
                continue
            release_drawings(spec, {key_of(body)})
            self._cut_geoms(spec, body, plane)
            share = part_of_the_way(1.0, self.keep, self.amount)
            for child in plane.children_beyond():
                if self.amount < 1.0:
                    there = held_at(child)
                    child.pos = child.pos + (stretched(there, anchor(body), share) - there)
                _take_away(spec, child, self.amount)
            for point in plane.points_beyond():
                if plane.is_at_end(point):
                    move_by(point, share * plane.along - plane.along)
                    continue
                require_unnamed(spec, key_of(point), "lies beyond the cut")
                if self.amount == 1.0:
                    spec.delete(point)

    def _cut_geoms(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, plane: Plane) -> None:
        """Shorten the geoms that the plane cuts, and remove those that lie beyond it."""
        pieces = [(geom, plane.piece_of(geom)) for geom in body.geoms]
        if not any(piece.share for _, piece in pieces):
            raise MorphologyError(
                f"No geom of {body.name!r} lies nearer than {self.keep:g} of its length, so "
                "nothing would be left of it: keep more."
            )
        for geom, piece in pieces:
            if not piece.share:
                require_unnamed(spec, key_of(geom), "lies beyond the cut")
                if self.amount == 1.0:
                    spec.delete(geom)
                else:
                    resize_geom(geom, place_of(geom), max(1.0 - self.amount, _SMALLEST_PART))
            elif piece.share < 1.0:
                shorten(geom, piece, part_of_the_way(1.0, piece.share, self.amount))


class Remove(Edit, frozen=True):
    """Remove a limb with everything attached to it, including joints and motors.

    Attributes:
        body: Name or glob of the body that the limb begins with; not a trunk.
    """

    body: str

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Remove every limb that fits."""
        for body in select_limbs(spec, self.body, "removed"):
            _take_away(spec, body, self.amount)


class Split(Edit, frozen=True):
    """Split a segment in two, with a hinge where it was split.

    The nearer part keeps the body's name and joint. Elements on one side of the plane of the
    split are not divided and go to that part, spheres and ellipsoids by their middle; geoms that
    the plane cuts are divided. The new hinge has the armature, damping and stiffness of the body's
    own joint.

    Attributes:
        body: Name of the segment; not a trunk.
        name: Name of the farther part, of its hinge and of its motor.
        at: Position of the split as a share of its length from the joint, between 0 and 1.
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
        """Refuse a range, gear or axis of zero."""
        _check_hinge(self)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Split the segment."""
        body = next(select_limbs(spec, self.body, "split"))
        require_geometry(spec, body)
        plane = Plane(body, self.at)
        pieces = {geom.name: plane.piece_of(geom) for geom in body.geoms}
        halves = {
            n: f"{n}_of_{self.name}" for n, piece in pieces.items() if 0.0 < piece.share < 1.0
        }
        require_divisible(spec, body, halves)
        release_drawings(spec, {key_of(body)})
        beyond = [spec.geom(name) for name, piece in pieces.items() if not piece.share]
        points, children = plane.points_beyond(), plane.children_beyond()
        part = _add_segment(spec, body, self, plane.place, self.amount)
        for point in (*beyond, *points):
            move_by(move(spec, point, part), -plane.place)
        for name, half in halves.items():
            geom, piece = spec.geom(name), pieces[name]
            copy = copy_element(spec, geom, part, half)
            self._divide(geom, copy, piece, plane.place)
        for child in children:
            offset = child.pos - plane.place
            move(spec, child, part).pos = offset
        share_contacts(spec, body, part, halves)

    def _divide(
        self, geom: mujoco.MjsGeom, copy: mujoco.MjsGeom, piece: NearPart, place: np.ndarray
    ) -> None:
        """Divide a geom: it becomes the nearer half, a copy on the other body the farther one."""
        whole = volume(geom)
        # Scaled about its near end, which is then moved to the cut.
        move_by(copy, -piece.near)
        shorten(copy, piece._replace(near=np.zeros(3)), 1.0 - piece.share)
        end = piece.near + 2.0 * (place_of(geom) - piece.near)
        offset = piece.near + piece.share * (end - piece.near) - place
        if float(np.linalg.norm(offset)) > _ON_THE_AXIS_M:
            move_by(copy, offset)
        shorten(geom, piece, piece.share)
        # The rounded ends at the split overlap. Their mass grows with the amount of the split.
        volumes = [volume(half) for half in (geom, copy)]
        rounded_end = 0.5 * (sum(volumes) - whole)
        for half, own in zip((geom, copy), volumes, strict=True):
            without = 1.0 - rounded_end / own
            scale_geom_mass(half, part_of_the_way(without, 1.0, self.amount))


class AddSegment(Edit, frozen=True):
    """Add a segment, with a hinge, at the far end of another.

    It is a capsule with the thickness, density, friction and appearance of the segment to which it
    is added; its hinge has the armature, damping and stiffness of that segment's joint.

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
        """Refuse a length, range, gear or axis of zero."""
        _check_hinge(self)
        if not any(self.end):
            raise MorphologyError("The end of a segment must not be zero.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the segment."""
        body = select("body", self.body, spec.bodies[1:])[0]
        require_geometry(spec, body)
        part = _add_segment(spec, body, self, far_end(body), 1.0)
        model_geom = next(geom for geom in body.geoms if geom.type in LONG)
        geom = copy_element(spec, model_geom, part, f"{self.name}_geom")
        geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
        if not math.isnan(geom.mass):
            geom.density, geom.mass = geom.mass / volume(model_geom), math.nan
        set_ends(geom, np.array([0.0, 0.0, 0.0, *self.end]))
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


def _check_hinge(edit: Split | AddSegment) -> None:
    """Refuse a hinge that MuJoCo would refuse."""
    if not edit.lower < edit.upper:
        raise MorphologyError(
            f"A hinge needs a lower limit below its upper one, got {edit.lower}, {edit.upper}."
        )
    require_gear(edit.gear)
    if edit.axis is not None and not any(edit.axis):
        raise MorphologyError("The axis of a hinge must not be zero.")


def _take_away(spec: mujoco.MjSpec, limb: mujoco.MjsBody, amount: float) -> None:
    """Remove a limb; at an amount below 1, make it smaller and weaker instead."""
    if amount == 1.0:
        remove_limb(spec, limb)
    else:
        require_removable(spec, limb)
        _shrink(spec, limb, 1.0 - amount)


def _shrink(spec: mujoco.MjSpec, limb: mujoco.MjsBody, part: float) -> None:
    """Scale a limb that exists only in part, in size and strength."""
    _resize_limb(spec, limb, max(part, _SMALLEST_PART))
    # If a limb is scaled by two edits, masses can fall below MuJoCo's minimum.
    spec.compiler.boundmass = max(spec.compiler.boundmass, LEAST_MASS)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, LEAST_MASS)


def _resize_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, factor: float) -> None:
    """Scale a limb in size and strength, in place, with everything attached to it."""
    for body in subtree(limb):
        require_geometry(spec, body)
        held = anchor(body)
        for geom in body.geoms:
            resize_geom(geom, held, factor)
        carry_outwards(body, held, factor)
        for joint in body.joints:
            _scale_resistance(joint, factor)
    elements = elements_of(limb)
    release_drawings(spec, elements)
    for tendon in spec.tendons:
        path = {*path_elements(tendon)}
        if path.isdisjoint(elements) or not moves_only(spec, tendon, elements):
            continue
        elements.add(key_of(tendon))
        _scale_resistance(tendon, factor)
        if path <= elements and _O.mjOBJ_JOINT not in {kind for kind, _ in path}:
            tendon.range = tendon.range * factor
            # A negative length stands for the length in the reference pose.
            lengths = np.array(tendon.springlength)
            tendon.springlength = np.where(lengths > 0.0, lengths * factor, lengths)
    for mention in references(spec, "actuator"):
        strong = mention.element[0] in (_O.mjOBJ_JOINT, _O.mjOBJ_TENDON)
        if strong and mention.element in elements:
            scale_strength(mention.holder, factor)


def _scale_resistance(element: Any, factor: float) -> None:
    """Scale the armature, damping, stiffness and friction of a joint or tendon."""
    for field in ("armature", "damping", "stiffness", "frictionloss"):
        setattr(element, field, getattr(element, field) * factor)


def _add_segment(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    edit: Split | AddSegment,
    place: np.ndarray,
    amount: float,
) -> mujoco.MjsBody:
    """Add a body without geoms at `place` of `body`, on a hinge like its own, with its motor."""
    for kind in ("body", "joint", "actuator"):
        require_free_name(spec, kind, edit.name)
    own = next((j for j in body.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE), None)
    axis = edit.axis if own is None or edit.axis is not None else own.axis
    if axis is None:
        raise MorphologyError(f"{body.name!r} has no hinge to take the axis from: give one.")
    part = body.add_body(name=edit.name, pos=place, gravcomp=body.gravcomp)
    hinge = part.add_joint(name=edit.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
    for field in _HINGE_FIELDS if own is not None else ():
        setattr(hinge, field, getattr(own, field))
    strength = max(amount, _SMALLEST_PART)
    set_limits(hinge, strength * edit.lower, strength * edit.upper)
    if edit.gear is not None:
        add_motor(spec, edit.name, strength * edit.gear)
    return part
