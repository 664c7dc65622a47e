"""Edits of one number: mass, density, gear, damping, stiffness, friction.

Each is given as a ratio to what it was (`scale`) or as a new value (`to`), never both. The field's
words for these are the operations `scale` and `abs` of domain randomization.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Final, Literal

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
from shapechanger.morphology.spec.elements import compiled, limbs_and_trunks, select
from shapechanger.morphology.spec.geometry import (
    inertia_is_written_out,
    orientation,
    require_geometry,
    rotation,
    scale_mass,
    stretch_segment,
    thicken_geom,
)
from shapechanger.morphology.spec.positions import reference_of
from shapechanger.morphology.spec.references import release_drawings
from shapechanger.morphology.spec.strength import is_motor, scale_clamps, scale_strength

if TYPE_CHECKING:
    from shapechanger.morphology.spec.carried import Keyframes

_D: Final = mujoco.mjtDisableBit
_J: Final = mujoco.mjtJoint
# Share of an axis that is vertical from which a slide raises its body.
_VERTICAL: Final = 1.0 - 1e-6
# A larger value, in any unit here, is a typing mistake, and MuJoCo's numbers overflow.
_LARGEST_VALUE: Final = 1e6

_FRICTION_PLACES: Final = {"sliding": 0, "torsional": 1, "rolling": 2}


class ValueEdit(Edit, frozen=True, tag=None):
    """Base class of edits that scale or set one number.

    Attributes:
        element: Name or glob of the bodies, geoms, joints or actuators.
        scale: New value over old value, 0.01 to 100.
        to: New value, in the SI unit that the edit names.
    """

    element: str
    scale: float | None = None
    to: float | None = None

    def check(self) -> None:
        """Refuse anything but one of `scale` and `to`, or a number out of its range."""
        name = type(self).__name__
        if (self.scale is None) == (self.to is None):
            raise MorphologyError(f"{name} takes either scale or to, got {self}.")
        if self.scale is not None:
            require_factor(f"The scale of {name}", self.scale)
        if self.to is not None and not (self._possible(self.to) and abs(self.to) <= _LARGEST_VALUE):
            raise MorphologyError(f"{name} cannot be {self.to}.")

    @staticmethod
    def _possible(value: float) -> bool:
        """Return whether the number can be set to this."""
        return value >= 0.0

    def changed(self, old: float) -> float:
        """Return the new value that replaces `old`."""
        new = old * self.scale if self.scale is not None else self.to
        assert new is not None  # `check` requires one of the two.
        return part_of_the_way(old, new, self.amount)


class Mass(ValueEdit, frozen=True):
    """Change the mass of bodies, kg; the inertia follows, as if the material became denser.

    `to` is the mass of each body by itself, without what hangs on it.
    """

    @staticmethod
    def _possible(value: float) -> bool:
        return value > 0.0

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every body that fits."""
        bodies = select("body", self.element, limbs_and_trunks(spec))
        # Only the compiler knows the volume of every shape.
        whole = compiled(spec) if self.to is not None else None
        for body in bodies:
            # By name: an earlier edit may have changed the indices of the bodies.
            old = 1.0 if whole is None else float(whole.body(body.name).mass[0])
            if old <= 0.0:
                raise MorphologyError(f"{body.name!r} has no mass, so none can be set.")
            scale_mass(body, self.changed(old) / old)


class Density(ValueEdit, frozen=True):
    """Change the density of all geoms of bodies, kg/m³; masses and inertias follow."""

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every body that fits."""
        bodies = select("body", self.element, limbs_and_trunks(spec))
        for body in bodies:
            if inertia_is_written_out(spec, body):
                raise MorphologyError(
                    f"{body.name!r} has its inertia written out, so its density has no effect: "
                    "change its mass instead."
                )
        for geom in (geom for body in bodies for geom in body.geoms):
            if not math.isnan(geom.mass):
                raise MorphologyError(
                    f"{geom.name!r} has its mass written out, so its density has no effect: "
                    "change the mass of its body instead."
                )
            geom.density = self.changed(geom.density)


class Gear(ValueEdit, frozen=True):
    """Change the strength of actuators: N·m of torque, or N of force, for a control of 1.

    `to` sets the strongest axis of a motor's gear and keeps its direction. A servo keeps its
    targets: its gains, its bias and its force range scale, and it takes a scale alone. A largest
    force of the joint or tendon scales along where all of its actuators are changed.
    """

    needs: ClassVar = (_D.mjDSBL_ACTUATION, "actuators")

    @staticmethod
    def _possible(value: float) -> bool:
        return value != 0.0

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every actuator that fits."""
        factors: dict[str, float] = {}
        for actuator in select("actuator", self.element, spec.actuators):
            if is_motor(actuator):
                factors[actuator.name] = self._change_gear(actuator)
            elif self.scale is None:
                raise MorphologyError(
                    f"{actuator.name!r} is no motor, so its gear is not its strength: give a scale "
                    "instead of a value."
                )
            else:
                factors[actuator.name] = factor = self.changed(1.0)
                scale_strength(actuator, factor)
        scale_clamps(spec, factors)

    def _change_gear(self, actuator: mujoco.MjsActuator) -> float:
        """Change the gear of a motor, and return its new strength over the old one."""
        gear = np.array(actuator.gear)
        strongest = float(gear[np.argmax(np.abs(gear))])
        if not strongest:
            raise MorphologyError(f"{actuator.name!r} has a gear of zero, so none can be set.")
        new = self.changed(strongest)
        actuator.gear = np.where(gear == strongest, new, gear * (new / strongest))
        return new / strongest


class Damping(ValueEdit, frozen=True):
    """Change the damping of joints: N·m·s/rad of a hinge, N·s/m of a slide."""

    needs: ClassVar = (_D.mjDSBL_DAMPER, "dampers")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every joint that fits."""
        _change_resistance(spec, self, "damping")


class Stiffness(ValueEdit, frozen=True):
    """Change the stiffness of joints: N·m/rad of a hinge, N/m of a slide."""

    needs: ClassVar = (_D.mjDSBL_SPRING, "springs")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every joint that fits."""
        _change_resistance(spec, self, "stiffness")


def _change_resistance(spec: mujoco.MjSpec, edit: ValueEdit, field: str) -> None:
    """Change the linear coefficient of joints, and higher ones by a scale."""
    for joint in select("joint", edit.element, spec.joints):
        if all(number > 0.0 for number in joint.springdamper):
            raise MorphologyError(
                f"{joint.name!r} takes its {field} from its springdamper, which would swallow the "
                "change: write stiffness and damping out in the model."
            )
        numbers = np.array(getattr(joint, field))
        count = 1 if edit.scale is None else len(numbers)
        numbers[:count] = [edit.changed(float(number)) for number in numbers[:count]]
        setattr(joint, field, numbers)


class Friction(ValueEdit, frozen=True):
    """Change a friction coefficient of geoms, dimensionless for sliding, m for the other two.

    MuJoCo uses the larger coefficient of the two geoms that touch: on a floor of 1, a foot of 0.2
    slides like a foot of 1, and `certify` reports no change. Change the floor too, or all geoms
    with `"*"`.

    Attributes:
        component: Which coefficient.
    """

    needs: ClassVar = (_D.mjDSBL_CONTACT, "contacts")
    component: Literal["sliding", "torsional", "rolling"] = "sliding"

    def require_effect(self, spec: mujoco.MjSpec) -> None:
        """Refuse it where contacts are switched off, or their parameters overridden."""
        super().require_effect(spec)
        if spec.option.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
            raise MorphologyError(
                "Friction would change nothing, because the model overrides the parameters of all "
                "contacts: change its <flag> first."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every geom that fits."""
        place = _FRICTION_PLACES[self.component]
        for geom in select("geom", self.element, spec.geoms):
            friction = np.array(geom.friction)
            friction[place] = self.changed(float(friction[place]))
            geom.friction = friction


class Stretch(Edit, frozen=True):
    """Make segments longer or shorter at the same thickness, held at their joints.

    What is attached to a segment moves outwards with it. Mass and inertia follow from the new
    geometry at the same density. The length of a box or ellipsoid is its longest half-size, or the
    one along the given axis.

    Attributes:
        body: Name or glob of the bodies.
        factor: New length over old length, 0.01 to 100.
        axis: Axis of the body to stretch along; None for all three, which keeps a limb straight.
    """

    body: str
    factor: float
    axis: Literal["x", "y", "z"] | None = None

    def check(self) -> None:
        """Refuse a factor out of range."""
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
        """Refuse a factor out of range."""
        require_factor("The factor of a radius", self.factor)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Thicken every body that fits."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        for body in select("body", self.body, limbs_and_trunks(spec)):
            require_geometry(spec, body)
            release_drawings(spec, {(mujoco.mjtObj.mjOBJ_BODY, body.name)})
            for geom in body.geoms:
                thicken_geom(spec, geom, factor)


# Ten times that of Jupiter's cloud tops (24.8 m/s²) is a typing mistake.
_LARGEST_GRAVITY: Final = 250.0
_LARGEST_HEIGHT_M: Final = 100.0


class Gravity(Edit, frozen=True):
    """Change the gravity of the world.

    Attributes:
        to: Acceleration of free fall along x, y and z, m/s²; (0, 0, -9.81) on Earth. A tilted
            vector corresponds to a sloping floor.
    """

    needs: ClassVar = (_D.mjDSBL_GRAVITY, "gravity")
    to: Vector

    def check(self) -> None:
        """Refuse a vector that is not finite or out of range."""
        require_vector("Gravity", self.to, nonzero=False)
        if math.hypot(*self.to) > _LARGEST_GRAVITY:
            raise MorphologyError(
                f"Gravity is at most {_LARGEST_GRAVITY:g} m/s², got {math.hypot(*self.to):g}."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Set the model's gravity."""
        old = np.array(spec.option.gravity)
        spec.option.gravity = part_of_the_way(old, np.array(self.to, float), self.amount)


class StartHeight(Edit, frozen=True):
    """Change the height at which a trunk starts.

    Attributes:
        body: Name of a body on the world.
        to: Height of its origin above the world's, m.
    """

    body: str
    to: float

    def check(self) -> None:
        """Refuse a height that is not a finite number."""
        if not abs(self.to) <= _LARGEST_HEIGHT_M:  # Also refuses NaN.
            raise MorphologyError(
                f"A start height is at most {_LARGEST_HEIGHT_M:g} m, got {self.to}."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Raise or lower every trunk that fits."""
        for body in self._trunks(spec):
            position = body.pos.copy()
            position[2] = part_of_the_way(float(position[2]), self.to, self.amount)
            body.pos = position

    def follow_in_keyframes(self, spec: mujoco.MjSpec, keyframes: Keyframes) -> None:
        """Raise or lower the trunks in every keyframe too, because robots start in one."""
        for joint in (joint for body in self._trunks(spec) for joint in body.joints):
            axis = rotation(orientation(spec, joint.parent)) @ joint.axis
            vertical = joint.type == _J.mjJNT_SLIDE and abs(axis[2]) > _VERTICAL * math.hypot(*axis)
            if joint.type == _J.mjJNT_FREE:
                keyframes.change(joint.name, self._raised)
            elif vertical:
                # At its reference the body is where the model puts it.
                own = np.array([reference_of(joint)])
                keyframes.change(joint.name, lambda old, own=own: old + self.amount * (own - old))

    def _raised(self, pose: np.ndarray) -> np.ndarray:
        """Return the position of a free joint, shape (7,), at the new height."""
        pose = pose.copy()
        pose[2] = part_of_the_way(float(pose[2]), self.to, self.amount)
        return pose

    def _trunks(self, spec: mujoco.MjSpec) -> list[mujoco.MjsBody]:
        """Return the trunks that fit."""
        trunks = [body for body in limbs_and_trunks(spec) if body.parent.parent is None]
        return select("trunk", self.body, trunks)
