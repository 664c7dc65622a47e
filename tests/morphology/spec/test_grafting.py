"""Copying and moving of limbs, with assets and many kinds of references."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    AddLimb,
)
from shapechanger.morphology.spec import copy_element
from tests.morphology.models import (
    arm,
    built,
    mass,
    posed,
    spatial,
    spec_of,
)


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
    """Its camera looks at its own bodies, and its tendon runs around copies on the trunk."""
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
    """Strengths and lengths of tendons that lie on the limb alone scale with it."""
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
    """Their limits are copied from degrees into a model in radians, and the other way."""
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
    """Its state belongs to one element."""
    spec = arm()
    spec.activate_plugin("mujoco.pid")
    plugin = spec.add_plugin(name="pid", plugin_name="mujoco.pid", active=True)
    plugin.config = {"kp": "1.0"}
    servo = spec.add_actuator(name="servo", target="lower", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.plugin.active, servo.plugin.name = True, "pid"
    servo.plugin.plugin_name = "mujoco.pid"
    with pytest.raises(MorphologyError, match="'servo' is driven by a plugin, so it cannot be"):
        AddLimb("lower", "_2", 1.0).apply(spec)
