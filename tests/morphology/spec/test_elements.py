"""Selection, naming and copies of elements; frames and a total mass that are written out."""

from __future__ import annotations

import math
import warnings

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import AddLimb, Mass, name_elements
from shapechanger.morphology.spec import copy_element, make_explicit, resolve_frames, select
from tests.models import xml
from tests.morphology.models import ant, arm, built, differing, mass, posed, spatial, spec_of
from tests.morphology.scenes import asset_spec

_NAMELESS = xml("nameless")


def test_a_name_is_preferred_to_a_pattern() -> None:
    spec = spec_of(
        "<mujoco><worldbody><body name='a*'><geom size='.1'/></body>"
        "<body name='ab'><geom size='.1'/></body></worldbody></mujoco>"
    )
    assert [b.name for b in select("body", "a*", spec.bodies[1:])] == ["a*"]
    assert [b.name for b in select("body", "a?", spec.bodies[1:])] == ["a*", "ab"]


def test_globs_select_in_model_order() -> None:
    """Matching is case-sensitive."""
    found = select("body", "shank_[14]", ant().bodies[1:])
    assert [body.name for body in found] == ["shank_1", "shank_4"]
    with pytest.raises(UnknownName, match=r"No body matches 'Shank_1'\. Did you mean 'shank_1'"):
        select("body", "Shank_1", ant().bodies[1:])


def test_all_elements_get_unique_names() -> None:
    """Names follow from given names, joints and parents."""
    spec = spec_of(_NAMELESS)
    name_elements(spec, {"knee_3": "shin"})
    assert [body.name for body in spec.bodies] == [
        *("world", "world_part", "knee_2", "shin", "knee", "world_part_part")
    ]
    assert [joint.name for joint in spec.joints] == [
        *("world_part_joint", "knee", "knee_3", "shin_joint")
    ]
    assert [geom.name for geom in spec.geoms] == [
        *("world_geom", "world_part_geom", "world_part_geom_2", "body_part_geom"),
        *("knee_2_geom", "shin_geom", "knee_geom", "world_part_part_geom"),
    ]
    assert [site.name for site in spec.sites] == ["world_part_site"]
    assert [camera.name for camera in spec.cameras] == ["world_part_camera"]
    assert [actuator.name for actuator in spec.actuators] == ["knee", "knee_2", "m"]


# Every kind of element that a frame can contain, in nested frames, in degrees.
_FRAMES = xml("frames")


def test_frames_are_resolved() -> None:
    spec = spec_of(_FRAMES)
    before = built(spec)
    resolve_frames(spec)
    after = built(spec)
    # The rotation of a capsule about its axis affects only its bounding box.
    boxes = ("bvh_aabb", "bvh_child", "bvh_depth", "bvh_nodeid", "geom_aabb", "geom_quat")
    for field in differing(before, after, ignoring=(*boxes, "site_quat")):
        np.testing.assert_allclose(
            getattr(after, field), getattr(before, field), rtol=1e-9, atol=1e-12, err_msg=field
        )
    for name in ("trunk", "beam", "pose"):
        np.testing.assert_allclose(after.geom(name).quat, before.geom(name).quat, atol=1e-12)
    for name in ("ends", "limb"):
        places = [posed(model).geom(name).xmat[[2, 5, 8]] for model in (before, after)]
        np.testing.assert_allclose(places[0], places[1], atol=1e-12)
    assert all(not np.any(frame.pos) for frame in spec.frames)
    once = built(spec)
    resolve_frames(spec)
    assert differing(once, built(spec)) == []


@pytest.mark.parametrize("scaling", ['scale="2"', 'scale="2" massscale="1"'])
def test_frames_that_scale_are_refused(scaling: str) -> None:
    text = f"""<mujoco><worldbody><frame name="big" {scaling}><body name="b"><joint/>
    <geom size=".1"/></body></frame></worldbody></mujoco>"""
    with pytest.raises(MorphologyError, match="The frame 'big' scales its elements: write the"):
        built(spec_of(text), Mass("b", scale=2.0))


def test_a_total_mass_does_not_undo_an_edit() -> None:
    """`settotalmass` of the half cheetah is resolved before edits of masses."""
    spec = asset_spec("half_cheetah")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MuJoCo warns about total masses.
        before = spec.copy().compile()
    make_explicit(spec)
    after = built(spec)
    for field in differing(before, after):
        np.testing.assert_allclose(
            getattr(after, field), getattr(before, field), rtol=1e-9, atol=1e-12, err_msg=field
        )
    heavier = built(asset_spec("half_cheetah"), Mass("torso", scale=2.0))
    assert mass(heavier) == pytest.approx(14.0 + mass(before, "torso"))
    assert mass(built(asset_spec("half_cheetah"), Mass("*", to=0.5))) == pytest.approx(3.5)


def test_least_masses_do_not_undo_an_edit() -> None:
    spec = arm(top='<compiler boundmass="1" boundinertia=".1"/>')
    before = built(spec)
    after = built(spec, Mass("other", to=0.3))
    assert mass(before, "other") == 1.0
    assert mass(after, "other") == pytest.approx(0.3)
    for body in ("upper", "lower"):
        assert mass(after, body) == mass(before, body)
        np.testing.assert_allclose(after.body(body).inertia, before.body(body).inertia)
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    with pytest.raises(MorphologyError, match="The least mass or inertia of the compiler raises"):
        built(spec, Mass("other", to=0.3))


def test_a_copied_geom_equals_the_original() -> None:
    spec = spec_of(
        """<mujoco><asset><material name="red"/></asset><worldbody>
        <body name="a"><freejoint/><geom name="a" type="ellipsoid" size=".1 .2 .3" pos="1 2 3"
        euler="10 20 30" density="7" contype="2" conaffinity="4" condim="6" priority="3"
        friction=".1 .2 .3" solmix=".4" solref=".03 .5" solimp=".8 .9 .01 .4 3" margin=".01"
        gap=".005" group="3" rgba=".1 .2 .3 .4" material="red" fluidshape="ellipsoid"
        fluidcoef=".6 .3 1.6 1.1 1.2"/></body>
        <body name="b"><freejoint/></body></worldbody></mujoco>"""
    )
    copy_element(spec, spec.geom("a"), spec.body("b"), "b")
    model = built(spec)
    for field in [name for name in dir(model) if name.startswith("geom_")]:
        if field not in ("geom_bodyid",):
            first, second = getattr(model, field)
            np.testing.assert_array_equal(second, first, err_msg=field)
    np.testing.assert_array_equal(model.body("b").inertia, model.body("a").inertia)
    with pytest.raises(MorphologyError, match="A new geom needs an unused name"):
        copy_element(spec, spec.geom("a"), spec.body("b"), "b")


def test_a_copy_aims_and_wraps_like_the_original() -> None:
    """The copy's camera looks at copied bodies, and its tendon bends around copies on the trunk."""
    tendon = spatial(
        '<site site="bar"/><geom geom="ball"/><site site="middle"/><pulley divisor="2"/>'
        '<site site="shoulder"/><site site="hand"/>'
    )
    spec = arm(
        tendon,
        trunk='<site name="bar" type="capsule" size=".01" fromto=".1 .1 .1 .2 .1 .1"/>',
        upper='<camera name="eye" mode="targetbody" target="lower"/>',
    )
    model = built(spec, AddLimb("upper", "_2", math.pi))
    assert model.body(model.camera("eye_2").targetbodyid[0]).name == "lower_2"
    data = posed(model)
    np.testing.assert_allclose(model.site("bar_2").pos, [-0.15, -0.1, 0.1], atol=1e-12)
    np.testing.assert_allclose(model.geom("ball_2").pos, [-0.1, -0.1, 0.0], atol=1e-12)
    assert model.geom("ball_2").contype[0] == 0
    assert mass(model, "trunk") == pytest.approx(mass(built(spec), "trunk"))
    mujoco.mj_forward(model, data)
    lengths = data.ten_length
    assert lengths[0] == pytest.approx(lengths[1])


def test_a_larger_copy_has_larger_tendons() -> None:
    """Strengths and lengths of tendons that lie only on the limb scale with the limb."""
    tendon = spatial(
        '<site site="middle"/><site site="hand"/>',
        'range="0 2" limited="true" springlength="1" stiffness="3"',
    )
    motor = '<actuator><position name="pull" tendon="rope" kp="2"/></actuator>'
    model = built(arm(tendon + motor), AddLimb("upper", "_2", 1.0, 2.0))
    rope = model.tendon("rope_2")
    np.testing.assert_allclose(model.tendon_range[rope.id], [0.0, 4.0])
    np.testing.assert_allclose(model.tendon_lengthspring[rope.id], [2.0, 2.0])
    assert model.tendon_stiffness[rope.id] == 6.0
    np.testing.assert_array_equal(model.actuator("pull_2").gainprm[0], 4.0)
    np.testing.assert_array_equal(model.actuator("pull_2").gear, model.actuator("pull").gear)


def test_limbs_of_attached_models_keep_their_units() -> None:
    """Limits are converted from degrees to radians and from radians to degrees."""
    for inner, outer in (("degree", "radian"), ("radian", "degree")):
        part = spec_of(
            f"""<mujoco><compiler angle="{inner}"/><worldbody><body name="limb">
            <joint name="limb" axis="0 1 0" range="0 {45 if inner == "degree" else math.pi / 4}"/>
            <geom name="limb" size=".1"/></body></worldbody></mujoco>"""
        )
        whole = spec_of(
            f"""<mujoco><compiler angle="{outer}"/><worldbody><body name="trunk">
            <geom name="trunk" size=".1"/></body></worldbody></mujoco>"""
        )
        whole.body("trunk").add_frame().attach_body(part.body("limb"), "", "")
        model = built(whole, AddLimb("limb", "_2", 1.0))
        np.testing.assert_allclose(model.joint("limb_2").range, [0.0, math.pi / 4])


def test_a_plugin_cannot_be_copied() -> None:
    spec = arm()
    spec.activate_plugin("mujoco.pid")
    plugin = spec.add_plugin(name="pid", plugin_name="mujoco.pid", active=True)
    plugin.config = {"kp": "1.0"}
    servo = spec.add_actuator(name="servo", target="lower", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.plugin.active, servo.plugin.name = True, "pid"
    servo.plugin.plugin_name = "mujoco.pid"
    with pytest.raises(MorphologyError, match="'servo' is driven by a plugin, so it cannot be"):
        AddLimb("lower", "_2", 1.0).apply(spec)
