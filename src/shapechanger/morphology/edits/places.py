"""Edits that put a body, a geom or a floor where a model has it, and set a total mass.

`Stretch` and similar edits keep a body in proportion. These change one element alone, so that any
variant of a model that is written as a file can be written as edits.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Final

import mujoco
import numpy as np
from msgspec import Meta

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import Edit, Positive, Vector, part_of_the_way
from shapechanger.morphology.pose import robot_bodies
from shapechanger.morphology.spec import (
    compiled,
    require_free_name,
    select,
)
from shapechanger.morphology.spec.geometry import (
    LONG,
    axis_ends,
    has_ends,
    move_by,
    orientation,
    place_of,
    reference_of,
    require_geometry,
    rotation,
    same_density,
    scale_mass,
    set_ends,
)
from shapechanger.morphology.spec.references import key_of, release_drawings

if TYPE_CHECKING:
    from shapechanger.morphology.spec.carried import Keyframes

_J: Final = mujoco.mjtJoint
_G: Final = mujoco.mjtGeom
# Share of an axis that is vertical from which a slide raises its body.
_VERTICAL: Final = 1.0 - 1e-6
# MuJoCo's default friction of a geom: torsional and rolling, m.
_TORSIONAL: Final = 0.005
_ROLLING: Final = 0.0001
_FLOOR_GRID_M: Final = 0.05


class PlaceBody(Edit, frozen=True):
    """Move the origin of a body, with its joints, its geoms and everything attached to it.

    Attributes:
        body: Name or glob of the bodies.
        to: Position of the origin in the frame of the body that carries it, m.
    """

    body: str
    to: Vector

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Move every body that fits."""
        for body in select("body", self.body, spec.bodies[1:]):
            body.pos = self._placed(body.pos)

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Place the bodies that float in every keyframe too."""
        for body in select("body", self.body, spec.bodies[1:]):
            for joint in (j for j in body.joints if j.type == _J.mjJNT_FREE):
                keyframes.change(joint.name, self._placed)

    def _placed(self, pose: np.ndarray) -> np.ndarray:
        """Return a position that begins with x, y and z, at the new place."""
        place = part_of_the_way(pose[:3], np.array(self.to, float), self.amount)
        return np.concatenate([place, pose[3:]])


class StartHeight(Edit, frozen=True):
    """Change the height at which a trunk starts.

    Attributes:
        body: Name of a body on the world.
        to: Height of its origin above the world's, -100 to 100 m.
    """

    body: str
    to: Annotated[float, Meta(ge=-100.0, le=100.0)]

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Raise or lower every trunk that fits."""
        for body in select("trunk", self.body, spec.worldbody.bodies):
            body.pos = self._raised(body.pos)

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Raise or lower the trunks in every keyframe too, because robots start in one."""
        trunks = select("trunk", self.body, spec.worldbody.bodies)
        for joint in (joint for body in trunks for joint in body.joints):
            axis = rotation(orientation(joint.parent)) @ joint.axis
            vertical = joint.type == _J.mjJNT_SLIDE and abs(axis[2]) > _VERTICAL * math.hypot(*axis)
            if joint.type == _J.mjJNT_FREE:
                keyframes.change(joint.name, self._raised)
            elif vertical:
                # At its reference the body is where the model puts it.
                own = np.array([reference_of(joint)])
                keyframes.change(joint.name, lambda old, own=own: old + self.amount * (own - old))

    def _raised(self, pose: np.ndarray) -> np.ndarray:
        """Return a position that begins with x, y and z, at the new height."""
        pose = pose.copy()
        pose[2] = part_of_the_way(float(pose[2]), self.to, self.amount)
        return pose


class PlaceGeom(Edit, frozen=True):
    """Change the place, length and radius of one geom only; the rest of its body is unchanged.

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
    radius: Positive | None = None

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

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every geom that fits."""
        for geom in select("geom", self.geom, spec.geoms):
            if geom.parent.parent is not None:
                require_geometry(spec, geom.parent)
                release_drawings(spec, {key_of(geom.parent)})
            with same_density(geom):
                if self.start is not None:
                    self._place_ends(geom)
                if self.middle is not None:
                    place = place_of(geom)
                    to = np.array(self.middle, float)
                    move_by(geom, part_of_the_way(place, to, self.amount) - place)
                if self.radius is not None:
                    if geom.type not in (_G.mjGEOM_SPHERE, *LONG):
                        raise MorphologyError(
                            f"{geom.name!r} is no sphere, capsule or cylinder, so it has no radius."
                        )
                    size = np.array(geom.size)
                    size[0] = part_of_the_way(float(size[0]), self.radius, self.amount)
                    geom.size = size

    def _place_ends(self, geom: mujoco.MjsGeom) -> None:
        """Set both ends of the axis."""
        ends, new = axis_ends(geom), np.array([self.start, self.end], float)
        if ends is None:
            raise MorphologyError(f"{geom.name!r} is no capsule or cylinder, so it has no ends.")
        old = np.array(ends)
        # The ends of a geom that is given by its pose have no order: match the nearest.
        here, turned = (np.linalg.norm(old - n, axis=1).sum() for n in (new, new[::-1]))
        if not has_ends(geom) and here > turned:
            old = old[::-1]
        geom.size = [geom.size[0], 0.0, 0.0]
        set_ends(geom, part_of_the_way(old, new, self.amount))


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
            size=[0.0, 0.0, _FLOOR_GRID_M],
            friction=[self.friction, _TORSIONAL, _ROLLING],
            contype=1,
            conaffinity=1,
        )


class TotalMass(Edit, frozen=True):
    """Scale all masses and inertias of the robot, so that it has this mass.

    It acts on the robot as the edits before it have left it. Objects, which no actuator moves, keep
    theirs.

    Attributes:
        to: Mass of the robot's bodies together, kg, at most a million.
    """

    to: Annotated[float, Meta(gt=0.0, le=1e6)]

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Scale the mass of every body."""
        # Only the compiler knows the volume of every shape.
        model = compiled(spec)
        robot = robot_bodies(model)
        old = float(np.where(robot, model.body_mass, 0.0).sum())
        names = {model.body(i).name for i in np.flatnonzero(robot)}
        for body in spec.bodies[1:]:
            if body.name in names:
                scale_mass(body, part_of_the_way(old, self.to, self.amount) / old)
