"""Edits of one number: mass, density, gear, damping, stiffness, friction.

Each is given as a ratio to what it was (`scale`) or as a new value (`to`), never both. In
domain randomization, these are the operations `scale` and `abs`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal

import mujoco
import numpy as np
from msgspec import Meta

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits import Edit, Ratio, Vector, part_of_the_way, require_gear
from shapechanger.morphology.spec import compiled, select
from shapechanger.morphology.spec.geometry import (
    LONG,
    has_ends,
    inertia_is_written_out,
    require_geometry,
    same_density,
    scale_mass,
    stretch_segment,
)
from shapechanger.morphology.spec.references import key_of, references, release_drawings

_D: Final = mujoco.mjtDisableBit
_GAIN: Final = mujoco.mjtGain
_BIAS: Final = mujoco.mjtBias
_LINEAR: Final = (_GAIN.mjGAIN_FIXED, _GAIN.mjGAIN_AFFINE), (_BIAS.mjBIAS_NONE, _BIAS.mjBIAS_AFFINE)
# A larger value, in any unit here, is a typing mistake, and MuJoCo's numbers overflow.
_LARGEST: Final = 1e6
# Ten times the gravity at Jupiter's cloud tops (24.8 m/s²) is a typing mistake.
_LARGEST_GRAVITY: Final = 250.0
_FRICTION_PLACES: Final = {"sliding": 0, "torsional": 1, "rolling": 2}


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
        """Refuse anything but one of `scale` and `to`."""
        if (self.scale is None) == (self.to is None):
            raise MorphologyError(f"{type(self).__name__} takes either scale or to, got {self}.")

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
        """Change every body that fits."""
        # Only the compiler knows the volume of every shape.
        whole = compiled(spec) if self.to is not None else None
        for body in select("body", self.element, spec.bodies[1:]):
            # Keyed by name, because an earlier edit may have changed the indices of the bodies.
            old = 1.0 if whole is None else float(whole.body(body.name).mass[0])
            if old <= 0.0:
                raise MorphologyError(f"{body.name!r} has no mass, so none can be set.")
            scale_mass(body, self.changed(old) / old)


class Density(ValueEdit, frozen=True):
    """Change the density of all geoms of bodies, kg/m³; masses and inertias follow."""

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every body that fits."""
        for body in select("body", self.element, spec.bodies[1:]):
            written = [geom.name for geom in body.geoms if not math.isnan(geom.mass)]
            if inertia_is_written_out(spec, body) or written:
                what = (
                    f"{written[0]!r} has its mass" if written else f"{body.name!r} has its inertia"
                )
                raise MorphologyError(
                    f"{what} written out, so its density has no effect: change the mass of "
                    f"{body.name!r} instead."
                )
            for geom in body.geoms:
                geom.density = self.changed(geom.density)


class Gear(ValueEdit, frozen=True):
    """Change the strength of actuators: N·m of torque, or N of force, for a control of 1.

    `to` sets the strongest axis of a motor's gear and keeps its direction. A servo keeps its
    targets: its gains, its bias and its force range scale, and it takes a scale alone. A largest
    force of the joint or tendon scales along where all of its actuators are changed.
    """

    needs: ClassVar = (_D.mjDSBL_ACTUATION, "actuators")
    to: Annotated[float, Meta(ge=-_LARGEST, le=_LARGEST)] | None = None

    def check(self) -> None:
        """Refuse a gear of zero too."""
        super().check()
        require_gear(self.to)

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every actuator that fits."""
        factors: dict[str, float] = {}
        for actuator in select("actuator", self.element, spec.actuators):
            if not _is_motor(actuator):
                if self.scale is None:
                    raise MorphologyError(
                        f"{actuator.name!r} is no motor, so its gear is not its strength: give a "
                        "scale instead of a value."
                    )
                factors[actuator.name] = self.changed(1.0)
                scale_strength(actuator, factors[actuator.name])
                continue
            gear = np.array(actuator.gear)
            strongest = float(gear[np.argmax(np.abs(gear))])
            if not strongest:
                raise MorphologyError(f"{actuator.name!r} has a gear of zero, so none can be set.")
            new = self.changed(strongest)
            factors[actuator.name] = new / strongest
            actuator.gear = np.where(gear == strongest, new, gear * (new / strongest))
        _scale_clamps(spec, factors)


def _is_motor(actuator: mujoco.MjsActuator) -> bool:
    """Return whether the force does not depend on where the actuator is: gain times control."""
    return actuator.gaintype == _GAIN.mjGAIN_FIXED and actuator.biastype == _BIAS.mjBIAS_NONE


def scale_strength(actuator: mujoco.MjsActuator, factor: float) -> None:
    """Scale the force of an actuator; a servo keeps its targets, and a muscle its lengths.

    For a motor, the gear is scaled. The gear of other actuators also scales their measurements, so
    for a servo the gains, the bias and the force range are scaled instead.
    """
    if _is_motor(actuator):
        actuator.gear = actuator.gear * factor
        return
    gain, bias = np.array(actuator.gainprm), np.array(actuator.biasprm)
    if actuator.gaintype == _GAIN.mjGAIN_MUSCLE and actuator.biastype == _BIAS.mjBIAS_MUSCLE:
        # The peak force, or the values that it is derived from if it is negative.
        for force in (gain[2:4], bias[2:4]):
            force[force > 0.0] *= factor
    elif actuator.gaintype in _LINEAR[0] and actuator.biastype in _LINEAR[1]:
        # Constant, length and velocity terms.
        gain[:3] *= factor
        bias[:3] *= factor
    else:
        raise MorphologyError(
            f"{actuator.name!r} is an actuator whose gains have no common scale, so its strength "
            "cannot be scaled: write new gains into the model instead."
        )
    actuator.gainprm, actuator.biasprm = gain, bias
    actuator.forcerange = actuator.forcerange * factor


def _scale_clamps(spec: mujoco.MjSpec, factors: Mapping[str, float]) -> None:
    """Scale the largest force of the joints and tendons whose actuators have all become as strong.

    Without it, a stronger motor of a joint with `actuatorfrcrange` would have no effect. The
    factors are new forces over old ones, by the names of actuators.
    """
    driven = [(each.element, each.holder.name) for each in references(spec, "actuator")]
    for element in (*spec.joints, *spec.tendons):
        scales = {factors.get(name, 1.0) for target, name in driven if target == key_of(element)}
        if len(scales) == 1 and np.any(element.actfrcrange):
            element.actfrcrange = element.actfrcrange * abs(scales.pop())


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
        """Stretch every body that fits."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        for body in select("body", self.body, spec.bodies[1:]):
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
    factor: Ratio

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Thicken every body that fits."""
        factor = part_of_the_way(1.0, self.factor, self.amount)
        for body in select("body", self.body, spec.bodies[1:]):
            require_geometry(spec, body)
            release_drawings(spec, {key_of(body)})
            for geom in body.geoms:
                with same_density(geom):
                    size = np.array(geom.size)
                    is_round = geom.type in (*LONG, mujoco.mjtGeom.mjGEOM_SPHERE) or has_ends(geom)
                    thick = np.arange(3) == 0 if is_round else np.arange(3) != np.argmax(size)
                    size[thick] *= factor
                    geom.size = size


class Gravity(Edit, frozen=True):
    """Change the gravity of the world.

    Attributes:
        to: Acceleration of free fall along x, y and z, m/s²; (0, 0, -9.81) on Earth. A tilted
            vector corresponds to a sloping floor.
    """

    needs: ClassVar = (_D.mjDSBL_GRAVITY, "gravity")
    to: Vector

    def check(self) -> None:
        """Refuse one that is out of range."""
        if math.hypot(*self.to) > _LARGEST_GRAVITY:
            raise MorphologyError(
                f"Gravity is at most {_LARGEST_GRAVITY:g} m/s², got {math.hypot(*self.to):g}."
            )

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Set the model's gravity."""
        old = np.array(spec.option.gravity)
        spec.option.gravity = part_of_the_way(old, np.array(self.to, float), self.amount)
