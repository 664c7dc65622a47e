"""Loops, muscles and keyframes after edits."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.morphology import (
    Mass,
    PlaceBody,
    Remove,
    StartHeight,
    Stretch,
)
from tests.morphology.models import (
    ROPE,
    arm,
    built,
    check_at_rest,
    spatial,
)


def test_a_loop_may_close_by_a_ball() -> None:
    """Its keyframe keeps the pose, which is counted from another reference now."""
    ball = """<body name="rod" pos="0 0 .2"><joint name="rod" type="ball"/>
      <geom name="rod" type="capsule" fromto="0 0 0 .2 0 0" size=".01"/></body>"""
    pin = """<equality><connect name="pin" body1="rod" body2="trunk" anchor=".2 0 0"/></equality>
      <keyframe><key name="home" qpos="{} .1 0 0"/></keyframe>"""
    quaternion = np.array([0.8, 0.0, 0.6, 0.0])
    spec = arm(pin.format(" ".join(map(str, quaternion))), trunk=ball)
    before = built(spec)
    after = built(
        spec, PlaceBody("rod", (0.2 - 0.2 * math.cos(0.3), 0.0, 0.2 + 0.2 * math.sin(0.3)))
    )
    check_at_rest(after)
    assert not np.allclose(after.body("rod").quat, before.body("rod").quat)
    frames: list[Any] = []
    for model in (before, after):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_kinematics(model, data)
        frames.append(data.body("rod").xmat.copy())
    np.testing.assert_allclose(frames[1], frames[0], atol=1e-7)


def test_a_pin_that_is_switched_off_keeps_both_places() -> None:
    """Only sites can state a pin that is open in the model's own pose."""
    pin = '<connect {} body1="lower" body2="other" anchor=".4 0 0" active="false"/>'
    pin = f"<equality>{pin}</equality>"
    for name, ends in (('name="pin"', ("pin_1", "pin_2")), ("", ("pin_1", "pin_2"))):
        model = built(arm(pin.format(name)), Stretch("lower", 1.5))
        assert model.eq_objtype[0] == mujoco.mjtObj.mjOBJ_SITE
        np.testing.assert_allclose(model.site(ends[0]).pos, [0.6, 0.0, 0.0])
        np.testing.assert_allclose(model.site(ends[1]).pos, [0.9, -0.3, 0.0])


def test_an_open_equality_stays_as_open_as_it_was() -> None:
    """A model that starts torn is not changed behind the user's back."""
    torn = '<equality><joint joint1="lower" joint2="upper" polycoef=".3 1 0 0 0"/></equality>'
    model = built(arm(torn), Mass("lower", scale=2.0))
    np.testing.assert_array_equal(model.qpos0, 0.0)
    assert model.eq_data[0, 0] == 0.3


def test_a_muscle_is_fitted_to_the_length_of_its_tendon() -> None:
    """A written length range scales with the tendon, as when a model is fitted to a person."""
    muscle = (
        spatial(ROPE) + '<actuator><muscle name="m" tendon="rope" lengthrange=".1 1"/></actuator>'
    )
    old, new = built(arm(muscle)), built(arm(muscle), Stretch("upper", 1.5))
    lengths = [model.tendon_length0[0] for model in (old, new)]
    np.testing.assert_allclose(
        new.actuator_lengthrange, old.actuator_lengthrange * lengths[1] / lengths[0]
    )
    unnamed = arm(spatial(ROPE).replace('name="rope"', ""))
    assert built(unnamed, Stretch("upper", 1.5)).tendon(0).name == ""


_HOME = '<keyframe><key name="home" qpos="{}"/><key name="moving" qvel="{}"/></keyframe>'


def test_a_placed_trunk_starts_there() -> None:
    """In every keyframe that gives positions."""
    spec = arm(_HOME.format("1 2 .5 1 0 0 0 .1 .2 .3", "0 " * 9), root='<freejoint name="root"/>')
    height = built(spec, StartHeight("trunk", 0.8))
    np.testing.assert_allclose(height.key_qpos[0, :7], [1.0, 2.0, 0.8, 1.0, 0.0, 0.0, 0.0])
    half = built(spec, StartHeight("trunk", 0.8).partly(0.5))
    assert half.key_qpos[0, 2] == pytest.approx(0.65)
    place = built(spec, PlaceBody("trunk", (0.0, 0.0, 3.0)))
    np.testing.assert_allclose(place.key_qpos[0, :3], [0.0, 0.0, 3.0])
    assert built(spec, Remove("lower")).key_qpos[0, 7:].tolist() == [0.1, 0.3]


def test_a_trunk_on_a_slide_starts_at_the_height() -> None:
    """The keyframe goes to where the model puts the trunk."""
    slide = '<joint name="lift" type="slide" axis="0 0 1" ref=".2"/>'
    spec = arm(_HOME.format("-.3 .1 .2 .3", "0 0 0 0"), root=slide)
    model = built(spec, StartHeight("trunk", 0.8))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    assert data.body("trunk").xpos[2] == pytest.approx(0.8)
    np.testing.assert_allclose(model.key_qpos[0], [0.2, 0.1, 0.2, 0.3])


def test_a_keyframe_keeps_its_mocap_bodies() -> None:
    """Their pose there, not the model's."""
    spec = arm('<keyframe><key mpos="1 2 3"/></keyframe>')
    spec.worldbody.add_body(name="hand", mocap=True, pos=[0.0, 0.0, 2.0])
    model = built(spec, Mass("lower", scale=2.0))
    np.testing.assert_array_equal(model.key_mpos[0], [1.0, 2.0, 3.0])
