"""Edits of one number, given as a ratio or as a value."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import (
    AddLimb,
    AddSegment,
    Damping,
    Density,
    Edit,
    Friction,
    Gear,
    Mass,
    Remove,
    Stiffness,
    compile_body,
)
from tests.morphology.models import ant, built, leg, limb, mass, spec_of

_KINDS: list[Any] = [Mass, Density, Gear, Damping, Stiffness, Friction]

_MOTORS = """
<mujoco>
<worldbody><body name="b"><freejoint name="root"/><geom name="g" size=".1"/></body></worldbody>
<actuator>
  <motor name="jet" joint="root" gear="1 0 -4 0 2 0"/>
  <motor name="idle" joint="root" gear="0 0 0 0 0 0"/>
</actuator></mujoco>
"""


@pytest.mark.parametrize("kind", _KINDS)
def test_a_value_is_scaled_or_set(kind: Any) -> None:
    """Exactly one of `scale` and `to` is needed."""
    for wrong in ({}, {"scale": 2.0, "to": 3.0}):
        with pytest.raises(MorphologyError, match=f"{kind.__name__} takes either scale or to, got"):
            kind("*", **wrong)


@pytest.mark.parametrize("kind", _KINDS)
@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf, 1e-3, 1e3])
def test_absurd_ratios_are_refused(kind: Any, scale: float) -> None:
    """Scales outside 0.01 to 100 are refused."""
    with pytest.raises(MorphologyError, match=f"The scale of {kind.__name__} must be a ratio"):
        kind("*", scale=scale)


@pytest.mark.parametrize("kind", _KINDS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_must_be_finite(kind: Any, value: float) -> None:
    """NaN and infinite values are refused."""
    with pytest.raises(MorphologyError, match=f"{kind.__name__} cannot be"):
        kind("*", to=value)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        *((Mass, 0.0), (Mass, -1.0), (Density, -1.0), (Damping, -1.0), (Stiffness, -1.0)),
        *((Friction, -0.1), (Gear, 0.0)),
    ],
)
def test_impossible_values_are_refused(kind: Any, value: float) -> None:
    """Negative values, and zero masses and gears, are refused."""
    with pytest.raises(MorphologyError, match=f"{kind.__name__} cannot be {value}"):
        kind("*", to=value)


@pytest.mark.parametrize(
    ("edit", "kind", "near"),
    [
        (Mass("shinn", scale=2.0), "body", "shin"),
        (Density("shinn", scale=2.0), "body", "shin"),
        (Gear("kneee", scale=2.0), "actuator", "knee"),
        (Damping("kneee", scale=2.0), "joint", "knee"),
        (Stiffness("kneee", to=2.0), "joint", "knee"),
        (Friction("flor", to=2.0), "geom", "floor"),
    ],
)
def test_unknown_elements_are_refused(edit: Edit, kind: str, near: str) -> None:
    """The error suggests the nearest element of the same kind."""
    with pytest.raises(UnknownName, match=rf"No {kind} matches '\w+'\. Did you mean '{near}'\?"):
        built(leg(), edit)


def test_inertia_scales_with_mass() -> None:
    """Nothing else changes."""
    before, after = built(leg()), built(leg(), Mass("shin", scale=3.0))
    assert mass(after, "shin") == pytest.approx(3.0 * mass(before, "shin"))
    np.testing.assert_allclose(after.body("shin").inertia, 3.0 * before.body("shin").inertia)
    np.testing.assert_array_equal(after.body("thigh").mass, before.body("thigh").mass)
    np.testing.assert_array_equal(after.geom_size, before.geom_size)


@pytest.mark.parametrize(
    "content",
    [
        '<geom type="capsule" size=".1 .2"/><geom size=".1" pos="0 0 .3" mass="2"/>',
        '<inertial pos=".1 0 0" mass="2" diaginertia=".1 .2 .25"/><geom size=".1"/>',
    ],
)
def test_a_mass_can_be_set_for_any_form(content: str) -> None:
    """Densities, masses and inertias keep their proportions."""
    before, after = built(limb(content)), built(limb(content), Mass("link", to=0.7))
    assert mass(after, "link") == pytest.approx(0.7)
    np.testing.assert_allclose(
        after.body("link").inertia, 0.7 / mass(before, "link") * before.body("link").inertia
    )
    np.testing.assert_allclose(after.body("link").ipos, before.body("link").ipos, atol=1e-12)


def test_a_mass_applies_to_each_matching_body() -> None:
    """Bodies that earlier edits made or moved are included."""
    model = built(ant(), Remove("aux_1"), AddLimb("aux_2", "_5", 1.0), Mass("aux_*", to=0.2))
    for body in ("aux_2", "aux_3", "aux_4", "aux_2_5"):
        assert mass(model, body) == pytest.approx(0.2)
    assert mass(model, "shank_2") == pytest.approx(mass(built(ant()), "shank_2"))


def test_a_body_without_mass_cannot_be_given_one() -> None:
    """Its distribution would be undefined."""
    spec = limb('<geom size=".1"/><body name="frame" pos="0 0 1"/>')
    with pytest.raises(MorphologyError, match="'frame' has no mass, so none can be set"):
        built(spec, Mass("frame", to=1.0))
    assert mass(built(spec, Mass("frame", scale=2.0)), "frame") == 0.0


def test_a_density_changes_masses_and_inertias() -> None:
    """`to` and `scale` apply to every geom of the body."""
    before = built(leg())
    for edit in (Density("shin", to=1500.0), Density("shin", scale=3.0)):
        after = built(leg(), edit)
        assert mass(after, "shin") == pytest.approx(3.0 * mass(before, "shin"))
        np.testing.assert_allclose(after.body("shin").inertia, 3.0 * before.body("shin").inertia)


def test_a_density_without_effect_is_refused() -> None:
    """The error for explicit masses and inertias suggests an alternative."""
    spec = limb('<geom name="g" size=".1" mass="2"/>')
    with pytest.raises(MorphologyError, match="'g' has its mass written out, so its density has"):
        built(spec, Density("link", scale=2.0))
    spec = limb('<inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/><geom size=".1"/>')
    with pytest.raises(MorphologyError, match="'link' has its inertia written out, so its density"):
        built(spec, Density("link", scale=2.0))


def test_a_gear_keeps_its_direction() -> None:
    """`to` sets the strongest axis; the others stay in proportion."""
    for edit, gear in (
        (Gear("jet", scale=2.0), [2.0, 0.0, -8.0, 0.0, 4.0, 0.0]),
        (Gear("jet", to=2.0), [-0.5, 0.0, 2.0, 0.0, -1.0, 0.0]),
        (Gear("jet", to=-2.0), [0.5, 0.0, -2.0, 0.0, 1.0, 0.0]),
    ):
        np.testing.assert_allclose(built(spec_of(_MOTORS), edit).actuator("jet").gear, gear)
    with pytest.raises(MorphologyError, match="'idle' has a gear of zero, so none can be set"):
        built(spec_of(_MOTORS), Gear("*", scale=2.0))


def test_gears_of_all_motors() -> None:
    """A glob changes every matching actuator exactly."""
    assert set(built(ant(), Gear("*", scale=0.1)).actuator_gear[:, 0]) == {15.0}
    assert set(built(ant(), Gear("hip_*", to=70.0)).actuator_gear[:, 0]) == {70.0, 150.0}


def test_damping_and_stiffness_of_joints() -> None:
    """Other joints do not change."""
    damped = built(leg(), Damping("hip", scale=2.0), Damping("knee", to=7.0))
    assert [damped.dof_damping[damped.joint(j).dofadr[0]] for j in ("hip", "knee")] == [4.0, 7.0]
    stiff = built(leg(), Stiffness("hip", scale=2.0), Stiffness("knee", to=7.0))
    assert [stiff.joint(j).stiffness[0] for j in ("hip", "knee")] == [6.0, 7.0]


def test_polynomial_coefficients() -> None:
    """`scale` scales the whole polynomial, `to` sets the linear part."""
    spec = limb('<geom size=".1"/>')
    spec.joint("link").damping = [1.0, 0.5, 0.25]
    spec.joint("link").stiffness = [2.0, 0.5, 0.25]
    scaled = built(spec, Damping("link", scale=2.0), Stiffness("link", to=8.0))
    plain = built(spec)
    assert np.any(plain.dof_dampingpoly)
    for name in ("dof_damping", "dof_dampingpoly"):
        np.testing.assert_allclose(getattr(scaled, name), 2.0 * getattr(plain, name))
    assert scaled.jnt_stiffness[0] == 8.0
    np.testing.assert_array_equal(scaled.jnt_stiffnesspoly, plain.jnt_stiffnesspoly)


@pytest.mark.parametrize(("component", "place"), [("sliding", 0), ("torsional", 1), ("rolling", 2)])
def test_friction_has_three_coefficients(component: Any, place: int) -> None:
    """One component changes, the other two stay."""
    before, after = built(leg()), built(leg(), Friction("sole", to=0.3, component=component))
    expected = np.array(before.geom("sole").friction)
    expected[place] = 0.3
    np.testing.assert_array_equal(after.geom("sole").friction, expected)
    np.testing.assert_array_equal(after.geom("floor").friction, before.geom("floor").friction)


def test_a_glob_includes_the_floor() -> None:
    """MuJoCo uses the larger of two frictions, so both must change."""
    model = built(leg(), Friction("*", scale=0.5))
    assert set(model.geom_friction[:, 0]) == {0.5}


@pytest.mark.parametrize("kind", [Damping, Stiffness, Friction])
def test_some_values_can_be_zero(kind: Any) -> None:
    """Zero damping, stiffness and friction are accepted."""
    built(leg(), kind("*", to=0.0))


def test_partial_values_are_interpolated() -> None:
    """A partial edit lies between the old and the new value."""
    assert built(leg(), Gear("hip", to=40.0).partly(0.25)).actuator("hip").gear[0] == 25.0
    assert mass(built(leg(), Mass("shin", to=3.0).partly(0.5)), "shin") == pytest.approx(
        0.5 * (3.0 + mass(built(leg()), "shin"))
    )


def test_masses_follow_names_after_additions() -> None:
    """Earlier edits change indices of bodies, not their names."""
    spec = ant()
    foot = AddSegment("shank_1", "foot_1", (0.3, 0.3, 0.0))
    model = compile_body(spec, (foot, Mass("torso", to=0.5), Mass("foot_1", to=0.1)))
    np.testing.assert_allclose(model.body("torso").mass[0], 0.5)
    np.testing.assert_allclose(model.body("foot_1").mass[0], 0.1)


@pytest.mark.parametrize("value", [1e300, 2e6])
def test_values_above_a_million_are_refused(value: float) -> None:
    """Masses, gears and dampings are limited to 1e6."""
    for kind in (Mass, Gear, Damping):
        with pytest.raises(MorphologyError, match="cannot be"):
            kind("*", to=value)
