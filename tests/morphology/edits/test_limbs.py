"""Cutting, removing, splitting, adding and copying."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    AddLimb,
    AddSegment,
    Cut,
    Edit,
    PlaceGeom,
    Radius,
    Remove,
    Split,
    Stretch,
    reshape,
)
from tests.morphology.models import arm, built, capsule_mass, leg, limb, mass, posed, spec_of
from tests.morphology.scenes import asset_spec


def _bodies(model: mujoco.MjModel) -> list[str]:
    return [model.body(i).name for i in range(1, model.nbody)]


def test_children_beyond_a_cut_are_removed() -> None:
    """Joints and motors are removed too; a child exactly at the cut stays."""
    cut = built(leg(), Cut("thigh", 0.99))
    assert (_bodies(cut), cut.nu, cut.nq) == (["trunk", "thigh"], 1, 8)
    # The knee is at the end of the thigh, but the shin's origin is not.
    assert _bodies(built(leg(), Cut("thigh", 1.0))) == ["trunk", "thigh", "shin"]
    for body in ("thigh", "leg"):
        assert built(asset_spec("hopper"), Cut(body, 1.0)).nbody == 5


def test_a_cut_that_leaves_nothing_is_refused() -> None:
    spec = arm()
    spec.geom("lower").fromto = [0.3, 0.0, 0.0, 0.4, 0.0, 0.0]
    with pytest.raises(MorphologyError, match=r"No geom of 'lower' lies within 0\.5 of its"):
        built(spec, Cut("lower", 0.5))


def test_a_partial_cut_shrinks_elements_beyond_it() -> None:
    """Geoms beyond the cut become small, and points at the end move a part of the way inwards."""
    spec = arm(
        joint='pos=".1 0 0"',
        lower='<geom name="far" size=".01" pos=".35 0 0"/><site name="end" pos=".4 0 0"/>'
        '<geom name="near" type="capsule" size=".01" fromto=".03 .01 .02 .17 .05 .04"/>',
    )
    before, half = built(spec), built(spec, Cut("lower", 0.5).partly(0.5))
    whole = built(spec, Cut("lower", 0.5))
    assert half.nsite == before.nsite == whole.nsite + 1  # The hand lies between cut and end.
    assert half.ngeom == before.ngeom == whole.ngeom + 1
    for field in ("pos", "quat", "size"):
        near = getattr(before.geom("near"), field)
        np.testing.assert_array_equal(getattr(whole.geom("near"), field), near)
    # A child moves towards the joint, which lies 0.1 m from the origin.
    child = built(spec, Cut("upper", 0.5).partly(0.5)).body("lower")
    np.testing.assert_allclose(child.pos, [0.325, 0.0, 0.0])
    assert half.geom("far").size[0] == pytest.approx(0.005)
    np.testing.assert_allclose(half.geom("far").pos, [0.35, 0.0, 0.0])
    np.testing.assert_allclose(half.site("end").pos, [0.3, 0.0, 0.0])


def test_a_glob_removes_parents_and_children_once() -> None:
    assert _bodies(built(leg(), Remove("s*"))) == ["trunk", "thigh"]
    assert _bodies(built(leg(), Remove("[ts]hi*"))) == ["trunk"]


def test_a_split_gives_two_segments() -> None:
    """Both parts together cover the segment, and the new hinge is like the segment's own."""
    spec = leg()
    spec.body("thigh").gravcomp = 0.5
    after = built(spec, Split("thigh", "shank", at=1.0 / 3.0, gear=5.0))
    assert _bodies(after) == ["trunk", "thigh", "shank", "shin"]
    np.testing.assert_allclose(after.body("shank").pos, [0.0, 0.0, -0.1])
    np.testing.assert_allclose(after.geom("thigh").size, [0.03, 0.05, 0.0])
    np.testing.assert_allclose(after.geom("thigh_of_shank").size, [0.03, 0.1, 0.0])
    for body, length in (("thigh", 0.1), ("shank", 0.2)):
        assert mass(after, body) == pytest.approx(capsule_mass(0.03, length, 500.0))
        assert after.body_gravcomp[after.body(body).id] == 0.5
    hinge, own = after.joint("shank"), after.joint("hip")
    for field in ("axis", "armature", "damping", "stiffness", "frictionloss"):
        np.testing.assert_array_equal(getattr(hinge, field), getattr(own, field))
    np.testing.assert_allclose(hinge.range, [-0.5, 0.5])
    assert after.actuator("shank").gear[0] == 5.0
    np.testing.assert_array_equal(after.actuator("shank").ctrlrange, [-1.0, 1.0])


def test_a_split_divides_an_explicit_mass() -> None:
    for content in ('mass="3"', 'density="3"'):
        geom = f'<geom name="g" type="capsule" size=".1" fromto="0 0 0 0 0 1" {content}/>'
        first = built(limb(geom), Split("link", "far", at=0.3).partly(1e-9))
        assert mass(first, "link", "far") == pytest.approx(mass(built(limb(geom)), "link"))
        assert mass(first, "far") > mass(first, "link")


@pytest.mark.parametrize("turned", ['euler="0 0 0"', 'euler="0 0 1.5707963267948966"'])
@pytest.mark.parametrize("written", ["size", "ends"])
def test_a_box_is_cut_along_the_segment(turned: str, written: str) -> None:
    """Any half-size of the box may lie along the segment, in any notation of the box."""
    sides = ".1 .02 .02" if "1.57" not in turned else ".02 .1 .02"
    box = f'type="box" size="{sides}" pos=".2 0 0" {turned}'
    if written == "ends":
        box = 'type="box" size=".02" fromto=".1 0 0 .3 0 0"'
    spec = arm(
        lower=f'<geom name="box" {box}/><geom name="side" type="box" size=".01 .01 .01" '
        'pos=".05 0 0" euler="0 .5 0"/>'
    )
    whole = mass(built(spec), "lower")
    model = built(spec, Split("lower", "far", 0.375))
    data = posed(model)
    for name, middle, half in (("box", 0.625, 0.025), ("box_of_far", 0.725, 0.075)):
        assert data.geom(name).xpos[0] == pytest.approx(middle)
        assert sorted(model.geom(name).size)[-1] == pytest.approx(max(half, 0.02))
    assert model.geom("side").bodyid[0] == model.body("lower").id
    assert mass(model, "lower", "far") > whole - 1e-9
    away = spec.copy()
    away.geom("lower").fromto = [0.1, 0.0, 0.0, 0.4, 0.0, 0.0]
    parts = built(away, Split("lower", "far", 0.625))
    ends = posed(parts)
    assert ends.geom("lower").xpos[0] == pytest.approx(0.5 + 0.175)
    assert ends.geom("lower_of_far").xpos[0] == pytest.approx(0.5 + 0.325)


def test_a_divided_geom_keeps_its_distance_from_the_axis() -> None:
    spec = arm(lower='<geom name="rib" type="capsule" fromto="0 .05 0 .3 .05 0" size=".01"/>')
    data = posed(built(spec, Split("lower", "far", 0.25)))
    np.testing.assert_allclose(data.geom("rib").xpos, [0.55, 0.05, 1.0], atol=1e-12)
    np.testing.assert_allclose(data.geom("rib_of_far").xpos, [0.7, 0.05, 1.0], atol=1e-12)
    whole = arm(lower='<geom name="tip" type="capsule" fromto=".3 0 0 .4 0 0" size=".01"/>')
    model = built(whole, Split("lower", "far", 0.5))
    assert model.geom("tip").bodyid[0] == model.body("far").id


@pytest.mark.parametrize("name", ["shin", "hip", "knee", "", "shin_1"])
def test_used_names_are_refused(name: str) -> None:
    spec = leg()
    spec.geom("sole").name = "thigh_of_shin_1"
    with pytest.raises(MorphologyError, match=r"A new \w+ needs an unused name, got '\w*'"):
        built(spec, Split("thigh", name))
    spec.geom("thigh_of_shin_1").name = "shin_1_geom"
    with pytest.raises(MorphologyError, match=r"A new \w+ needs an unused name, got '\w*'"):
        built(spec, AddSegment("thigh", name, (0.0, 0.0, 1.0)))


def test_a_segment_grows_at_the_far_end() -> None:
    """The new segment has the thickness, density, friction and hinge of its parent."""
    spec = leg()
    spec.geom("shin").friction = [0.7, 0.01, 0.001]
    model = built(spec, AddSegment("shin", "foot", (0.1, 0.0, 0.0), gear=4.0))
    np.testing.assert_allclose(model.body("foot").pos, [0.0, 0.0, -0.25])
    np.testing.assert_allclose(model.geom("foot_geom").size, [0.02, 0.05, 0.0])
    np.testing.assert_array_equal(model.geom("foot_geom").friction, model.geom("shin").friction)
    assert mass(model, "foot") == pytest.approx(capsule_mass(0.02, 0.1, 500.0))
    assert model.joint("foot").damping[0] == model.joint("knee").damping[0] == 1.0
    np.testing.assert_array_equal(model.joint("foot").axis, model.joint("knee").axis)
    assert model.actuator("foot").gear[0] == 4.0


@pytest.mark.parametrize(
    "geom",
    [
        'type="capsule" size=".1 .2" pos="0 0 .2"',
        'type="cylinder" size=".1 .2" pos="0 0 .2" euler="0 180 0"',
        'type="capsule" size=".1" fromto="0 0 0 0 0 .4"',
    ],
)
@pytest.mark.parametrize("given", ["", 'density="50"', 'mass="2"'])
def test_a_segment_grows_from_any_form_of_geom(geom: str, given: str) -> None:
    spec = limb(f'<geom name="g" {geom} {given}/>')
    before = built(spec)
    model = built(spec, AddSegment("link", "tip", (0.0, 0.0, 0.3)))
    np.testing.assert_allclose(posed(model).geom("tip_geom").xpos, [0.0, 0.0, 1.55], atol=1e-9)
    volume = mass(built(limb(f'<geom {geom} density="1"/>')), "link")
    density = mass(before, "link") / volume
    assert mass(model, "tip") == pytest.approx(capsule_mass(0.1, 0.3, density))


def test_a_body_without_hinge_needs_an_axis() -> None:
    spec = spec_of(
        """<mujoco><worldbody><body name="b"><freejoint/><geom name="g" type="capsule"
        size=".1 .2"/></body></worldbody></mujoco>"""
    )
    with pytest.raises(
        MorphologyError, match="'b' has no hinge whose axis can be used: give an axis"
    ):
        built(spec, AddSegment("b", "tail", (0.0, 0.0, 1.0)))
    model = built(spec, AddSegment("b", "tail", (0.0, 0.0, 1.0), axis=(1.0, 0.0, 0.0)))
    assert model.joint("tail").type == mujoco.mjtJoint.mjJNT_HINGE


@pytest.mark.parametrize(
    "edit",
    [
        Split("shin", "foot", lower=-0.2, upper=0.7, axis=(0.0, 1.0, 0.0)),
        AddSegment("shin", "foot", (0.1, 0.0, 0.0), -0.2, 0.7, axis=(0.0, 1.0, 0.0), radius=0.05),
    ],
)
def test_axis_range_and_the_lack_of_a_motor_can_be_given(edit: Edit) -> None:
    spec = leg()
    spec.default.joint.type = mujoco.mjtJoint.mjJNT_SLIDE
    model = built(spec, edit)
    assert model.nu == 2
    assert model.joint("foot").type == mujoco.mjtJoint.mjJNT_HINGE
    np.testing.assert_allclose(model.joint("foot").range, [-0.2, 0.7])
    np.testing.assert_array_equal(model.joint("foot").axis, [0.0, 1.0, 0.0])
    if isinstance(edit, AddSegment):
        np.testing.assert_allclose(model.geom("foot_geom").size, [0.05, 0.05, 0.0])


@pytest.mark.parametrize(
    ("edit", "geom", "motor", "like"),
    [
        (AddSegment("shin", "foot", (0.1, 0.0, 0.0), gear=4.0), "foot_geom", "foot", (4.0, 1.0)),
        (AddLimb("thigh", "_2", math.pi, size=2.0), "thigh_2", "hip_2", (20.0, 2.0)),
    ],
)
def test_a_partial_limb_is_small_and_weak(
    edit: Edit, geom: str, motor: str, like: tuple[float, float]
) -> None:
    """Size, gear and armature scale with the amount, from 0.01, and masses with its cube."""
    full, (gear, size) = built(leg(), edit), like
    assert reshape(leg(), [edit]).compiler.boundmass == 0.0
    for amount, part in ((1e-9, 0.01), (0.25, 0.25)):
        model = built(leg(), edit.partly(amount))
        share = part if size == 1.0 else model.geom(geom).size[0] / full.geom(geom).size[0]
        np.testing.assert_allclose(model.geom(geom).size, share * full.geom(geom).size)
        assert model.actuator(motor).gear[0] == pytest.approx(share * gear * size)
        assert model.joint(motor).armature[0] == pytest.approx(share * size * 0.1)
        np.testing.assert_allclose(model.joint(motor).range, full.joint(motor).range)
        body = model.geom(geom).bodyid[0]
        assert model.body_mass[body] == pytest.approx(share**3 * full.body_mass[body])
    if size != 1.0:
        assert full.body("thigh_2").mass == pytest.approx(size**3 * full.body("thigh").mass)


@pytest.mark.parametrize(
    ("edit", "skins"),
    [
        *((Cut("other", 0.5), 0), (Split("other", "far"), 0), (PlaceGeom("other", radius=0.02), 0)),
        *((Remove("other").partly(0.5), 0), (Stretch("other", 2.0), 0), (Radius("other", 1.0), 1)),
    ],
)
def test_a_skin_over_a_changed_body_is_removed(edit: Edit, skins: int) -> None:
    bone = 'bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2" vertweight="1 1 1"'
    spec = arm(
        '<deformable><skin name="cover" vertex="0 0 0 1 0 0 0 1 0" face="0 1 2">'
        f'<bone body="other" {bone}/></skin></deformable>'
    )
    assert built(spec).nskin == 1
    assert built(spec, edit).nskin == skins


def test_a_copied_limb_has_the_pose_of_the_original_in_keyframes() -> None:
    spec = leg()
    spec.add_key(name="bent", qpos=[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.3, -0.7], ctrl=[0.1, 0.2])
    model = built(spec, AddLimb("thigh", "_2", 2.0))
    key = model.key("bent")
    np.testing.assert_array_equal(key.qpos[7:], [0.3, -0.7] * 2)
    np.testing.assert_array_equal(key.ctrl, [0.1, 0.2] * 2)
