"""Edits of shapes and places, and of the world: segments, geoms, origins, a floor.

`Stretch` and `Radius` keep a body in proportion. The others change one element alone, so that any
variant of a model that is written as a file can be written as edits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Final, Literal

import mujoco
import numpy as np
from msgspec import Meta

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import Edit, Positive, Ratio, Vector, part_of_the_way
from shapechanger.morphology.spec import geometry, references, require_free_name, select
from shapechanger.morphology.spec.carried import Keyframes

_G: Final = mujoco.mjtGeom
_J: Final = mujoco.mjtJoint
_ROUND: Final = (_G.mjGEOM_SPHERE, *geometry.LONG)
# A slide raises its body if the vertical part of its unit axis is larger than this.
_VERTICAL: Final = 1.0 - 1e-6


class Stretch(Edit, frozen=True):
    """Make segments longer or shorter at the same thickness, held at their joints.

    Elements attached to a segment move outwards with it. Mass and inertia follow from the new
    geometry at the same density. The length of a box or ellipsoid is its longest half-size, or the
    one along the given axis.

    Attributes:
        body: Name or glob of the bodies.
        factor: New length over old length, 0.01 to 100.
        axis: Axis of the body to stretch along; None for all three, which keeps a limb straight.
    """

    body: str
    factor: Ratio
    axis: Literal["x", "y", "z"] | None = None

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Stretch every body that matches."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        axis = None if self.axis is None else "xyz".index(self.axis)
        along = factor if axis is None else np.where(np.arange(3) == axis, factor, 1.0)
        for body in _reshaped(spec, self.body, factor):
            held = geometry.anchor(body)
            for geom in body.geoms:
                with geometry.same_density(geom):
                    geometry.lengthen(geom, factor, axis)
                    geometry.move_outwards(geom, held, along)
            geometry.carry_outwards(body, held, along)


class Radius(Edit, frozen=True):
    """Make segments thicker or thinner at the same length; mass and inertia follow.

    Attributes:
        body: Name or glob of the bodies.
        factor: New radius over old radius, 0.01 to 100. Of a box or ellipsoid the two smaller
            half-sizes are scaled.
    """

    body: str
    factor: Ratio

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Thicken every body that matches."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        for body in _reshaped(spec, self.body, factor):
            for geom in body.geoms:
                with geometry.same_density(geom):
                    is_round = geom.type in _ROUND or geometry.has_ends(geom)
                    thick = np.arange(3) == 0 if is_round else np.arange(3) != np.argmax(geom.size)
                    geom.size[thick] *= factor


def _reshaped(spec: mujoco.MjSpec, pattern: str, factor: float) -> Iterator[mujoco.MjsBody]:
    """Yield the bodies that match, without their skins; none if the factor is 1."""
    for body in select("body", pattern, spec.bodies[1:]):
        geometry.require_geometry(spec, body)
        if factor != 1.0:  # Avoid rounding without a change.
            references.release_drawings(spec, {references.key_of(body)})
            yield body


class PlaceGeom(Edit, frozen=True):
    """Change the place, length and radius of single geoms; other geoms of a body are unchanged.

    Mass and inertia of the body follow at the same density.

    Attributes:
        geom: Name or glob of the geoms.
        start: One end of the axis of a capsule or cylinder, in the frame of its body, m.
        end: The other end.
        middle: Middle of a geom of any shape, in the frame of its body, m; its axes keep their
            directions.
        radius: Radius of a sphere, capsule or cylinder, m.
    """

    geom: str
    start: Vector | None = None
    end: Vector | None = None
    middle: Vector | None = None
    radius: Positive | None = None

    def check(self) -> None:
        """Refuse one end, ends with a middle, equal ends, and no change at all."""
        valid = self.middle is not None or self.radius is not None
        if self.start is not None or self.end is not None:
            valid = None not in (self.start, self.end) and self.start != self.end
            valid &= self.middle is None
        if not valid:
            raise MorphologyError(
                "PlaceGeom needs a radius, two different ends or a middle, and not both ends and a "
                f"middle, got {self}."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every geom that matches."""
        for geom in select("geom", self.geom, spec.geoms):
            if geom.parent.parent is not None:
                geometry.require_geometry(spec, geom.parent)
                references.release_drawings(spec, {references.key_of(geom.parent)})
            with geometry.same_density(geom):
                if self.start is not None:
                    old, new = geometry.axis_ends(geom), np.array([self.start, self.end])
                    if not len(old):
                        raise MorphologyError(
                            f"{geom.name!r} is not a capsule or cylinder, so it has no ends."
                        )
                    # The ends of a geom defined by its pose have no order: match the nearest.
                    here, turned = (np.linalg.norm(old - ends) for ends in (new, new[::-1]))
                    if not geometry.has_ends(geom) and here > turned:
                        old = old[::-1]
                    geom.size = [geom.size[0], 0.0, 0.0]
                    geometry.set_ends(geom, part_of_the_way(old, new, self.amount))
                if self.middle is not None:
                    place, to = geometry.middle_of(geom), np.array(self.middle)
                    geometry.move_by(geom, part_of_the_way(place, to, self.amount) - place)
                if self.radius is not None:
                    if geom.type not in _ROUND:
                        raise MorphologyError(
                            f"{geom.name!r} is not a sphere, capsule or cylinder, so it has no "
                            "radius."
                        )
                    geom.size[0] = part_of_the_way(geom.size[0], self.radius, self.amount)


class PlaceBody(Edit, frozen=True):
    """Move the origin of a body, with its joints, its geoms and everything attached to it.

    Attributes:
        body: Name or glob of the bodies.
        to: Position of the origin in the frame of the body that carries it, m.
    """

    body: str
    to: Vector

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Move every body that matches."""
        for body in select("body", self.body, spec.bodies[1:]):
            body.pos = self._placed(body.pos)

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Move bodies with a free joint in every keyframe too."""
        for body in select("body", self.body, spec.bodies[1:]):
            for joint in (j for j in body.joints if j.type == _J.mjJNT_FREE):
                keyframes.change(joint.name, self._placed)

    def _placed(self, pose: np.ndarray) -> np.ndarray:
        place = part_of_the_way(pose[:3], np.array(self.to), self.amount)
        return np.concatenate([place, pose[3:]])


class StartHeight(Edit, frozen=True):
    """Change the height at which a trunk starts.

    Attributes:
        body: Name or glob of bodies on the world.
        to: Height of its origin above the world's, -100 to 100 m.
    """

    body: str
    to: Annotated[float, Meta(ge=-100.0, le=100.0)]

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Raise or lower every trunk that matches."""
        for body in select("trunk", self.body, spec.worldbody.bodies):
            body.pos = self._raised(body.pos)

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Raise or lower the trunks in every keyframe too, because a robot may start in one."""
        trunks = select("trunk", self.body, spec.worldbody.bodies)
        for joint in (joint for body in trunks for joint in body.joints):
            axis = geometry.rotation(geometry.orientation(joint.parent)) @ joint.axis
            vertical = joint.type == _J.mjJNT_SLIDE and abs(axis[2]) > _VERTICAL * math.hypot(*axis)
            if joint.type == _J.mjJNT_FREE:
                keyframes.change(joint.name, self._raised)
            elif vertical:
                # When the slide is at its reference, the body is where the model puts it.
                own = np.array([geometry.reference_of(joint)])
                keyframes.change(joint.name, lambda old, own=own: old + self.amount * (own - old))

    def _raised(self, pose: np.ndarray) -> np.ndarray:
        height = part_of_the_way(float(pose[2]), self.to, self.amount)
        return np.concatenate([pose[:2], [height], pose[3:]])


class AddFloor(Edit, frozen=True):
    """Add a horizontal floor without an edge, named `floor`.

    Attributes:
        friction: Coefficient of sliding friction; MuJoCo uses the larger one of two geoms.
        height: Its height, m.
    """

    friction: Annotated[float, Meta(ge=0.0)] = 1.0
    height: float = 0.0

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Add the floor."""
        require_free_name(spec, "geom", "floor")
        spec.worldbody.add_geom(
            name="floor",
            type=_G.mjGEOM_PLANE,
            pos=[0.0, 0.0, self.height],
            size=[0.0, 0.0, 0.05],  # Infinite along x and y; spacing of the drawn grid, m.
            friction=[self.friction, 0.005, 0.0001],  # The last two are MuJoCo's defaults, m.
            contype=1,
            conaffinity=1,
        )
