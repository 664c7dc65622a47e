"""Edits of numbers: mass, density, strength, resistance, friction, range, gravity.

Most edits take either a ratio to the old value (`scale`) or a new value (`to`). In domain
randomization, these are the operations `scale` and `abs`.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Final, Literal

import mujoco
import numpy as np
from msgspec import Meta

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import Edit, Ratio, Vector, part_of_the_way
from shapechanger.morphology.pose import robot_bodies
from shapechanger.morphology.spec import compiled, geometry, references, select

_D: Final = mujoco.mjtDisableBit
_GAIN: Final = mujoco.mjtGain
_BIAS: Final = mujoco.mjtBias
_LINEAR: Final = (_GAIN.mjGAIN_FIXED, _GAIN.mjGAIN_AFFINE, _BIAS.mjBIAS_NONE, _BIAS.mjBIAS_AFFINE)
# Limits above which a value is a typing mistake: a million in any unit used here, and 250 m/s², ten
# times the gravity at Jupiter's cloud tops (24.8 m/s²).
_LARGEST: Final = 1e6
_LARGEST_GRAVITY: Final = 250.0


class ValueEdit(Edit, frozen=True, tag=None):
    """Base class of edits that scale or set one number.

    Attributes:
        element: Name or glob of the bodies, geoms, joints or actuators.
        scale: New value over old value, 0.01 to 100.
        to: New value, in the SI unit that the edit names, 0 to a million.
    """

    element: str
    scale: Ratio | None = None
    to: Annotated[float, Meta(ge=0.0, le=_LARGEST)] | None = None

    def check(self) -> None:
        """Require either `scale` or `to`."""
        if (self.scale is None) == (self.to is None):
            raise MorphologyError(f"{type(self).__name__} needs either scale or to, got {self}.")

    def changed(self, old: float) -> float:
        """Return the new value that replaces `old`."""
        new = old * self.scale if self.scale is not None else self.to
        assert new is not None  # `check` requires one of the two.
        return part_of_the_way(old, new, self.amount)


class Mass(ValueEdit, frozen=True):
    """Change the mass of bodies, kg; the inertia follows, as if the material became denser.

    `to` is the mass of each body by itself, without attached bodies.
    """

    to: Annotated[float, Meta(gt=0.0, le=_LARGEST)] | None = None

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every body that matches."""
        # Only the compiler computes the volume of every shape.
        whole = compiled(spec) if self.to is not None else None
        for body in select("body", self.element, spec.bodies[1:]):
            # Keyed by name, because an earlier edit may have changed the indices of the bodies.
            old = 1.0 if whole is None else float(whole.body(body.name).mass[0])
            if old <= 0.0:
                raise MorphologyError(f"{body.name!r} has no mass, so none can be set.")
            geometry.scale_mass(body, self.changed(old) / old)


class TotalMass(Edit, frozen=True):
    """Scale all masses and inertias of the robot, so that it has this mass.

    Earlier edits count. Objects, which no actuator moves, keep their masses.

    Attributes:
        to: Mass of the robot's bodies together, kg, at most a million.
    """

    to: Annotated[float, Meta(gt=0.0, le=_LARGEST)]

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Scale the mass of every body of the robot."""
        model = compiled(spec)
        robot = robot_bodies(model)
        old = float(np.where(robot, model.body_mass, 0.0).sum())
        new = part_of_the_way(old, self.to, self.amount)
        for i in np.flatnonzero(robot).tolist():
            geometry.scale_mass(spec.body(model.body(i).name), new / old)


class Density(ValueEdit, frozen=True):
    """Change the density of all geoms of bodies, kg/m³; masses and inertias follow."""

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every body that matches."""
        for body in select("body", self.element, spec.bodies[1:]):
            written = any(not math.isnan(geom.mass) for geom in body.geoms)
            if written or geometry.inertia_is_written_out(spec, body):
                raise MorphologyError(
                    f"{body.name!r} has a mass or inertia written out, so its density has no "
                    "effect: change its mass instead."
                )
            for geom in body.geoms:
                geom.density = self.changed(geom.density)


class Gear(ValueEdit, frozen=True):
    """Change the strength of actuators: N·m of torque, or N of force, for a control of 1.

    `to` sets the strongest axis of a motor's gear and keeps its direction. A servo accepts only
    `scale`, which scales its gains, bias and force range and keeps its targets. The force limit of
    a joint or tendon scales too, if all of its actuators change by the same factor.
    """

    needs: ClassVar = (_D.mjDSBL_ACTUATION, "actuators")
    to: Annotated[float, Meta(ge=-_LARGEST, le=_LARGEST)] | None = None

    def check(self) -> None:
        """Refuse a gear of zero too."""
        super().check()
        require_gear(self.to)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every actuator that matches."""
        factors: dict[str, float] = {}
        for actuator in select("actuator", self.element, spec.actuators):
            gear = np.array(actuator.gear)
            strongest = float(gear[np.argmax(np.abs(gear))])
            if _is_motor(actuator) and strongest:
                new = self.changed(strongest)
                factor = new / strongest
                actuator.gear = np.where(gear == strongest, new, gear * factor)
            elif not strongest or self.scale is None:
                raise MorphologyError(
                    f"{actuator.name!r} is not a motor, or its gear is zero, so no gear can be "
                    "set: give a servo a scale instead."
                )
            else:
                factor = self.changed(1.0)
                scale_strength(actuator, factor)
            factors[actuator.name] = factor
        # Without this, a stronger motor of a joint with `actuatorfrcrange` would have no effect.
        driven = references.mentions(spec, "actuator")
        for element in (*spec.joints, *spec.tendons):
            own = references.key_of(element)
            scales = {factors.get(each.holder.name, 1.0) for each in driven if each.element == own}
            if len(scales) == 1:
                element.actfrcrange *= abs(scales.pop())


def require_gear(gear: float | None) -> None:
    """Refuse a gear of zero, with which a motor has no effect."""
    if gear == 0.0:
        raise MorphologyError(f"A motor needs a gear that is not zero, got {gear}.")


def _is_motor(actuator: mujoco.MjsActuator) -> bool:
    """Return whether the force is gain times control, at any position of the actuator."""
    return actuator.gaintype == _GAIN.mjGAIN_FIXED and actuator.biastype == _BIAS.mjBIAS_NONE


def scale_strength(actuator: mujoco.MjsActuator, factor: float) -> None:
    """Scale the force of an actuator; a servo keeps its targets, and a muscle its lengths.

    For a motor, the gear is scaled. The gear of other actuators also scales their measurements, so
    for a servo the gains, the bias and the force range are scaled instead.
    """
    if _is_motor(actuator):
        actuator.gear *= factor
        return
    if actuator.gaintype == _GAIN.mjGAIN_MUSCLE and actuator.biastype == _BIAS.mjBIAS_MUSCLE:
        # The peak force, or the values that it is derived from if it is negative.
        for force in (actuator.gainprm[2:4], actuator.biasprm[2:4]):
            force[force > 0.0] *= factor
    elif actuator.gaintype in _LINEAR and actuator.biastype in _LINEAR:
        # Constant, length and velocity terms.
        actuator.gainprm[:3] *= factor
        actuator.biasprm[:3] *= factor
    else:
        raise MorphologyError(
            f"{actuator.name!r} is an actuator whose gains have no common scale, so its strength "
            "cannot be scaled: write new gains into the model instead."
        )
    actuator.forcerange *= factor


class _Resistance(ValueEdit, frozen=True, tag=None):
    """Base class of edits of damping or stiffness; `scale` also scales nonlinear coefficients."""

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every joint that matches."""
        field = type(self).__name__.lower()
        for joint in select("joint", self.element, spec.joints):
            if all(number > 0.0 for number in joint.springdamper):
                raise MorphologyError(
                    f"{joint.name!r} derives its {field} from its springdamper, which would undo "
                    "the change: write stiffness and damping out in the model."
                )
            numbers = getattr(joint, field)
            for i in range(1 if self.scale is None else len(numbers)):
                numbers[i] = self.changed(float(numbers[i]))


class Damping(_Resistance, frozen=True):
    """Change the damping of joints: N·m·s/rad of a hinge, N·s/m of a slide."""

    needs: ClassVar = (_D.mjDSBL_DAMPER, "dampers")


class Stiffness(_Resistance, frozen=True):
    """Change the stiffness of joints: N·m/rad of a hinge, N/m of a slide."""

    needs: ClassVar = (_D.mjDSBL_SPRING, "springs")


class Friction(ValueEdit, frozen=True):
    """Change a friction coefficient of geoms, dimensionless for sliding, m for the other two.

    MuJoCo uses the larger coefficient of the two geoms that touch: on a floor of 1, a foot of 0.2
    slides like a foot of 1, and `certify` refuses the shift. Change the floor too, or all geoms
    with `"*"`.

    Attributes:
        component: The coefficient to change.
    """

    needs: ClassVar = (_D.mjDSBL_CONTACT, "contacts")
    component: Literal["sliding", "torsional", "rolling"] = "sliding"

    def require_effect(self, spec: mujoco.MjSpec) -> None:
        """Refuse the edit if contacts are switched off, or their parameters overridden."""
        super().require_effect(spec)
        if spec.option.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
            raise MorphologyError(
                "Friction would change nothing, because the model overrides the parameters of all "
                "contacts: change its <flag> first."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every geom that matches."""
        place = ("sliding", "torsional", "rolling").index(self.component)
        for geom in select("geom", self.element, spec.geoms):
            geom.friction[place] = self.changed(float(geom.friction[place]))


class JointRange(Edit, frozen=True):
    """Change how far hinges and slides move; a joint without limits becomes limited.

    A slide without limits needs both limits, which are farther apart at an amount below 1.

    Attributes:
        joint: Name or glob of the joints.
        lower: New lower limit, rad or m; None keeps the old one.
        upper: New upper limit, rad or m; None keeps the old one.
    """

    needs: ClassVar = (_D.mjDSBL_LIMIT, "limits of joints")
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
        """Change every joint that matches."""
        for joint in select("joint", self.joint, spec.joints):
            if (old := geometry.limits(joint)) is None:
                if self.lower is None or self.upper is None:
                    raise MorphologyError(f"{joint.name!r} is a slide without limits: give both.")
                # The smaller the amount, the wider the range.
                reach = (self.upper - self.lower) / self.amount
                old = self.lower - reach, self.upper + reach
            lower, upper = (
                o if n is None else part_of_the_way(o, n, self.amount)
                for o, n in zip(old, (self.lower, self.upper), strict=True)
            )
            if not lower < upper:
                raise MorphologyError(f"The range of {joint.name!r} would be {lower} to {upper}.")
            geometry.set_limits(joint, lower, upper)


class Gravity(Edit, frozen=True):
    """Change the gravity of the world.

    Attributes:
        to: Acceleration of free fall along x, y and z, m/s²; (0, 0, -9.81) on Earth. A tilted
            vector corresponds to a sloping floor.
    """

    needs: ClassVar = (_D.mjDSBL_GRAVITY, "gravity")
    to: Vector

    def check(self) -> None:
        """Refuse an acceleration that is too large."""
        if (size := math.hypot(*self.to)) > _LARGEST_GRAVITY:
            limit = f"at most {_LARGEST_GRAVITY:g} m/s²"
            raise MorphologyError(f"Gravity must be {limit}, got {size:g}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Set the model's gravity."""
        old = np.array(spec.option.gravity)
        spec.option.gravity = part_of_the_way(old, np.array(self.to), self.amount)
