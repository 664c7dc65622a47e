"""Edits that put one body or one geom where a published model has it, and set a total mass.

`Stretch` and its like keep a body in proportion. These change one element alone, so that any
variant of a model that is written as a file can be written as edits.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import Edit, Vector, part_of_the_way, require_vector
from shapechanger.morphology.robot import robot_bodies
from shapechanger.morphology.spec.elements import compiled, limbs_and_trunks, select
from shapechanger.morphology.spec.geometry import (
    axis_ends,
    has_ends,
    keep_density,
    move_by,
    place_of,
    require_geometry,
    scale_mass,
    volume,
)
from shapechanger.morphology.spec.references import release_drawings

if TYPE_CHECKING:
    from shapechanger.morphology.spec.carried import Keyframes

# A robot of a million kilograms is a typing mistake.
_LARGEST_MASS_KG = 1e6


class PlaceBody(Edit, frozen=True):
    """Move the origin of a body, with its joints, its geoms and everything attached to it.

    Attributes:
        body: Name or glob of the bodies.
        to: Position of the origin in the frame of the body that carries it, m.
    """

    body: str
    to: Vector

    def check(self) -> None:
        """Refuse anything but three finite numbers."""
        require_vector("The place of a body", self.to, nonzero=False)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Move every body that fits."""
        for body in select("body", self.body, limbs_and_trunks(spec)):
            body.pos = part_of_the_way(np.array(body.pos), np.array(self.to, float), self.amount)

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Place the bodies that float in every keyframe too."""
        for body in select("body", self.body, limbs_and_trunks(spec)):
            for joint in (j for j in body.joints if j.type == mujoco.mjtJoint.mjJNT_FREE):
                keyframes.change(joint.name, self._placed)

    def _placed(self, pose: np.ndarray) -> np.ndarray:
        """Return the position of a free joint, shape (7,), at the new place."""
        place = part_of_the_way(pose[:3], np.array(self.to, float), self.amount)
        return np.concatenate([place, pose[3:]])


class PlaceGeom(Edit, frozen=True):
    """Change the place, length and radius of one geom alone; nothing attached to its body moves.

    Mass and inertia of its body follow at the same density.

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
    radius: float | None = None

    def check(self) -> None:
        """Refuse one end alone, ends together with a middle, equal ends, and no change at all."""
        if (self.start is None) != (self.end is None):
            raise MorphologyError(f"An axis has a start and an end, got {self}.")
        if self.start is not None and (self.middle is not None or self.start == self.end):
            raise MorphologyError(
                f"A geom is placed by two different ends or by its middle, got {self}."
            )
        if self.start is None and self.middle is None and self.radius is None:
            raise MorphologyError(f"PlaceGeom takes two ends, a middle or a radius, got {self}.")
        for name, point in (("start", self.start), ("end", self.end), ("middle", self.middle)):
            if point is not None:
                require_vector(f"The {name} of a geom", point, nonzero=False)
        if self.radius is not None and not 0.0 < self.radius < math.inf:
            raise MorphologyError(f"A radius must be above zero, got {self.radius}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every geom that fits."""
        for geom in select("geom", self.geom, spec.geoms):
            if geom.parent.parent is not None:
                require_geometry(spec, geom.parent)
                release_drawings(spec, {(mujoco.mjtObj.mjOBJ_BODY, geom.parent.name)})
            before = volume(spec, geom)
            if self.start is not None and self.end is not None:
                self._place_ends(spec, geom, np.array(self.start, float), np.array(self.end, float))
            if self.middle is not None:
                place = place_of(geom)
                to = np.array(self.middle, float)
                move_by(geom, part_of_the_way(place, to, self.amount) - place)
            if self.radius is not None:
                self._set_radius(geom, self.radius)
            keep_density(spec, geom, before)

    def _place_ends(
        self, spec: mujoco.MjSpec, geom: mujoco.MjsGeom, start: np.ndarray, end: np.ndarray
    ) -> None:
        """Set both ends of the axis."""
        old = axis_ends(spec, geom)
        if old is None:
            raise MorphologyError(f"{geom.name!r} is no capsule or cylinder, so it has no ends.")
        # Which end of an axis comes first means nothing: each goes to the nearer one.
        if not has_ends(geom) and _apart(old, (start, end)) > _apart(old, (end, start)):
            old = old[::-1]
        ends = [part_of_the_way(o, n, self.amount) for o, n in zip(old, (start, end), strict=True)]
        geom.size = [geom.size[0], 0.0, 0.0]
        # MuJoCo takes either both ends or a pose.
        geom.pos, geom.quat = np.zeros(3), [1.0, 0.0, 0.0, 0.0]
        geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        geom.fromto = np.concatenate(ends)

    def _set_radius(self, geom: mujoco.MjsGeom, radius: float) -> None:
        """Set the radius of a round geom."""
        kinds = mujoco.mjtGeom
        if geom.type not in (kinds.mjGEOM_SPHERE, kinds.mjGEOM_CAPSULE, kinds.mjGEOM_CYLINDER):
            raise MorphologyError(
                f"{geom.name!r} is no sphere, capsule or cylinder, so it has no radius."
            )
        size = np.array(geom.size)
        size[0] = part_of_the_way(float(size[0]), radius, self.amount)
        geom.size = size


class TotalMass(Edit, frozen=True):
    """Scale all masses and inertias of the robot, so that it has this mass.

    It acts on the robot as the edits before it have left it. Objects, which no actuator moves, keep
    theirs.

    Attributes:
        to: Mass of the robot's bodies together, kg.
    """

    to: float

    def check(self) -> None:
        """Refuse a mass that is not above zero."""
        if not 0.0 < self.to <= _LARGEST_MASS_KG:  # Also refuses NaN.
            raise MorphologyError(f"A robot cannot have a mass of {self.to} kg.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Scale the mass of every body."""
        # Only the compiler knows the volume of every shape.
        model = compiled(spec)
        robot = robot_bodies(model)
        old = float(np.where(robot, model.body_mass, 0.0).sum())
        names = {model.body(i).name for i in np.flatnonzero(robot)}
        for body in limbs_and_trunks(spec):
            if body.name in names:
                scale_mass(body, part_of_the_way(old, self.to, self.amount) / old)


def _apart(old: tuple[np.ndarray, np.ndarray], new: tuple[np.ndarray, np.ndarray]) -> float:
    """Return the sum of the distances between two pairs of points, m."""
    return sum(float(np.linalg.norm(o - n)) for o, n in zip(old, new, strict=True))
