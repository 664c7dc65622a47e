"""Edits of the structure of a body: cut, remove, split, add."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import (
    Edit,
    Vector,
    part_of_the_way,
    require_factor,
    require_vector,
)
from shapechanger.morphology.edits.joints import set_limits
from shapechanger.morphology.spec.elements import (
    limbs_and_trunks,
    require_free_name,
    require_limb,
    select,
    subtree,
)
from shapechanger.morphology.spec.geometry import (
    anchor,
    far_end,
    held_at,
    move_by,
    place_of,
    require_geometry,
    resize_limb,
    scale_geom_mass,
    stretch_geom,
    stretch_segment,
    volume,
)
from shapechanger.morphology.spec.grafting import copy_geom, graft_copy, move_limb, move_point

_SPHERE: Final = mujoco.mjtGeom.mjGEOM_SPHERE
# MuJoCo refuses bodies of almost no mass, so a limb that exists in part is never smaller than this
# share of its full size, which is a millionth of its mass.
_SMALLEST_PART: Final = 0.01
# In kg and in kg·m²: ten times what MuJoCo refuses.
_LEAST: Final = 1e-14


class Cut(Edit, frozen=True):
    """Cut a limb: shorten a segment, and remove what is attached to it beyond the cut.

    Attributes:
        body: Name or glob of the segments; not a trunk.
        keep: Share of the length that is kept, from the joint outwards, 0.01 to 1.
    """

    body: str
    keep: float

    def check(self) -> None:
        """Refuse a part that is not between 0 and 1."""
        require_factor("The part kept by a cut", self.keep)
        if self.keep > 1.0:
            raise MorphologyError(f"A cut keeps at most all of a limb, got {self.keep}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Cut every segment that fits."""
        for name in [body.name for body in select("body", self.body, limbs_and_trunks(spec))]:
            body = spec.body(name)
            if body is None:
                continue  # It was part of a limb that has been cut off.
            require_limb(body, "cut")
            require_geometry(spec, body)
            beyond = _children_beyond(spec, body, self.keep)
            stretch_segment(spec, body, part_of_the_way(1.0, self.keep, self.amount))
            for child in beyond:
                _take_away(spec, child, self.amount)


class Remove(Edit, frozen=True):
    """Remove a limb with everything attached to it, including joints and motors.

    Attributes:
        body: Name or glob of the body that the limb begins with; not a trunk.
    """

    body: str

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Remove every limb that fits."""
        for name in [body.name for body in select("body", self.body, limbs_and_trunks(spec))]:
            body = spec.body(name)
            if body is not None:  # Else it was part of a limb that has been removed.
                require_limb(body, "removed")
                _take_away(spec, body, self.amount)


class Split(Edit, frozen=True):
    """Split a segment in two, with a hinge where it was split.

    The nearer part keeps the body's name and joint; what is attached to the farther part moves with
    it, and so do its sites and spheres. The new hinge has the armature, damping and stiffness of
    the body's own joint.

    Attributes:
        body: Name of the segment; not a trunk.
        name: Name of the farther part, of its hinge and of its motor.
        at: Position of the split as a share of its length from the joint, between 0 and 1.
        lower: Lower limit of the hinge, rad.
        upper: Upper limit of the hinge, rad.
        gear: Torque of a motor for a control of 1, N·m; controls are -1 to 1. None for no motor.
        axis: Axis of the hinge in the body's frame; None for that of the body's own hinge.
    """

    body: str
    name: str
    at: float = 0.5
    lower: float = -0.5
    upper: float = 0.5
    gear: float | None = None
    axis: Vector | None = None

    def check(self) -> None:
        """Refuse a place outside the segment, and a range or gear of zero."""
        if not 0.0 < self.at < 1.0:
            raise MorphologyError(f"A segment is split between 0 and 1, got {self.at}.")
        _check_hinge(self.lower, self.upper, self.gear, self.axis)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Split the segment."""
        (body,) = select("body", self.body, limbs_and_trunks(spec))[:1]
        require_limb(body, "split")
        require_geometry(spec, body)
        place = anchor(body) + self.at * (far_end(spec, body) - anchor(body))
        is_beyond = _beyond(spec, body, self.at)
        children = _children_beyond(spec, body, self.at)
        part = _new_segment(spec, body, self.name, place)
        points = [*body.sites, *(geom for geom in body.geoms if geom.type == _SPHERE)]
        for point in [point for point in points if is_beyond(place_of(point))]:
            move_by(move_point(spec, point, part), -place)
        self._share(spec, body, part)
        for child in children:
            offset = child.pos - place
            move_limb(spec, child, part).pos = offset
        _add_hinge(spec, body, part, self, self.amount)

    def _share(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, part: mujoco.MjsBody) -> None:
        """Split every geom that has a length between both parts."""
        held = anchor(body)
        for geom in [geom for geom in body.geoms if geom.type != _SPHERE]:
            whole = volume(spec, geom)
            copy = copy_geom(spec, geom, part, f"{geom.name}_of_{self.name}")
            move_by(copy, -held)
            stretch_geom(spec, copy, np.zeros(3), 1.0 - self.at)
            stretch_geom(spec, geom, held, self.at)
            # The rounded ends at the split overlap. Their mass grows with the amount of the split.
            volumes = [volume(spec, half) for half in (geom, copy)]
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
        axis: Axis of the hinge in the frame of `body`; None for that of the segment's own hinge.
        radius: Radius of the capsule, m; None for that of the segment.
    """

    body: str
    name: str
    end: Vector
    lower: float = -0.5
    upper: float = 0.5
    gear: float | None = None
    axis: Vector | None = None
    radius: float | None = None

    def check(self) -> None:
        """Refuse a length, range, gear or radius of zero."""
        require_vector("The end of a segment", self.end)
        _check_hinge(self.lower, self.upper, self.gear, self.axis)
        if self.radius is not None and not (math.isfinite(self.radius) and self.radius > 0.0):
            raise MorphologyError(f"A radius must be above zero, got {self.radius}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the segment."""
        (body,) = select("body", self.body, limbs_and_trunks(spec))[:1]
        require_geometry(spec, body)
        place = far_end(spec, body)
        model_geom = _long_geom(body)
        part = _new_segment(spec, body, self.name, place)
        geom = copy_geom(spec, model_geom, part, f"{self.name}_geom")
        geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
        if not math.isnan(geom.mass):
            geom.density, geom.mass = geom.mass / volume(spec, model_geom), math.nan
        # MuJoCo takes either both ends or a pose.
        geom.pos, geom.quat = np.zeros(3), [1.0, 0.0, 0.0, 0.0]
        geom.fromto = [0.0, 0.0, 0.0, *self.end]
        if self.radius is not None:
            geom.size = [self.radius, 0.0, 0.0]
        _add_hinge(spec, body, part, self, 1.0)
        if self.amount != 1.0:
            _shrink(spec, part, self.amount)


class AddLimb(Edit, frozen=True):
    """Add a limb: a copy of another, with its joints and motors, turned about the trunk.

    Attributes:
        like: Name of the body that the limb to copy begins with; not a trunk.
        suffix: Suffix of the copied names, such as `_5`.
        angle: Turn of the copy about the z axis of the body to which the limb is attached, rad;
            positive is counter-clockwise seen from above.
        size: Size of the copy over that of the limb, 0.01 to 100.
    """

    like: str
    suffix: str
    angle: float
    size: float = 1.0

    def check(self) -> None:
        """Refuse an absurd size, an empty suffix, or an angle that is not a finite number."""
        require_factor("The size of a limb", self.size)
        if not self.suffix or not math.isfinite(self.angle):
            raise MorphologyError(f"A copied limb needs a suffix and a finite angle, got {self}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the limb."""
        (limb,) = select("body", self.like, limbs_and_trunks(spec))[:1]
        require_limb(limb, "copied")
        for body in subtree(limb):
            require_free_name(spec, "body", body.name + self.suffix)
            for kind, elements in (("joint", body.joints), ("geom", body.geoms)):
                for element in elements:
                    require_free_name(spec, kind, element.name + self.suffix)
        copy = graft_copy(spec, limb, self.suffix, self.angle)
        if self.size != 1.0:
            resize_limb(spec, copy, self.size)
        if self.amount != 1.0:
            _shrink(spec, copy, self.amount)


def _check_hinge(lower: float, upper: float, gear: float | None, axis: Vector | None) -> None:
    """Refuse a hinge that MuJoCo would refuse."""
    if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
        raise MorphologyError(
            f"A hinge needs a lower limit below its upper one, got {lower}, {upper}."
        )
    if gear is not None and not (math.isfinite(gear) and gear != 0.0):
        raise MorphologyError(f"A motor needs a gear that is not zero, got {gear}.")
    if axis is not None:
        require_vector("The axis of a hinge", axis)


def _beyond(spec: mujoco.MjSpec, body: mujoco.MjsBody, part: float) -> Callable[[np.ndarray], bool]:
    """Return a test whether a point lies farther out on the segment than `part` of its length."""
    held = anchor(body)
    along = far_end(spec, body) - held
    # A point exactly at the cut counts as within; rounding must not decide it.
    reach = (part + 1e-9) * float(along @ along)
    return lambda point: float((point - held) @ along) > reach


def _children_beyond(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: float
) -> list[mujoco.MjsBody]:
    """Return the children attached farther out along the segment than `part` of its length."""
    is_beyond = _beyond(spec, body, part)
    return [child for child in body.bodies if is_beyond(held_at(spec, child))]


def _take_away(spec: mujoco.MjSpec, limb: mujoco.MjsBody, amount: float) -> None:
    """Remove a limb; at an amount below 1, make it smaller and weaker instead."""
    if amount == 1.0:
        spec.delete(limb)
    else:
        _shrink(spec, limb, 1.0 - amount)


def _shrink(spec: mujoco.MjSpec, limb: mujoco.MjsBody, part: float) -> None:
    """Scale a limb that exists only in part, in size and strength."""
    resize_limb(spec, limb, max(part, _SMALLEST_PART))
    # Of a limb that is scaled by two edits, masses can fall below what MuJoCo accepts.
    spec.compiler.boundmass = max(spec.compiler.boundmass, _LEAST)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, _LEAST)


def _new_segment(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, place: np.ndarray
) -> mujoco.MjsBody:
    """Add an empty body to `body`, at `place` in its frame."""
    require_free_name(spec, "body", name)
    require_free_name(spec, "joint", name)
    require_free_name(spec, "actuator", name)
    return body.add_body(name=name, pos=place, gravcomp=body.gravcomp)


def _long_geom(body: mujoco.MjsBody) -> mujoco.MjsGeom:
    """The body's first capsule or cylinder; `far_end` has refused a body without one."""
    return next(
        geom
        for geom in body.geoms
        if geom.type in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER)
    )


# Fields of a joint's resistance.
_HINGE_FIELDS: Final = (
    *("armature", "damping", "stiffness", "frictionloss", "margin"),
    *("solref_limit", "solimp_limit", "solref_friction", "solimp_friction"),
)


def _add_hinge(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    part: mujoco.MjsBody,
    edit: Split | AddSegment,
    amount: float,
) -> None:
    """Attach `part` to `body` by a hinge like the body's own, with a motor if the edit has one."""
    own = next((j for j in body.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE), None)
    axis = edit.axis if own is None or edit.axis is not None else own.axis
    if axis is None:
        raise MorphologyError(f"{body.name!r} has no hinge to take the axis from: give one.")
    part.add_joint(name=edit.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
    hinge = spec.joint(edit.name)
    if own is not None:
        for field in _HINGE_FIELDS:
            setattr(hinge, field, getattr(own, field))
    strength = max(amount, _SMALLEST_PART)
    set_limits(hinge, strength * edit.lower, strength * edit.upper)
    if edit.gear is not None:
        motor = spec.add_actuator(
            name=edit.name,
            target=edit.name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            ctrlrange=[-1.0, 1.0],
            gear=[strength * edit.gear, 0.0, 0.0, 0.0, 0.0, 0.0],
        )
        motor.set_to_motor()
