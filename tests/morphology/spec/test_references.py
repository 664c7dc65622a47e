"""Edits update references between elements, or are refused; here one reference at a time."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    AddLimb,
    Cut,
    Damping,
    Edit,
    Gear,
    Lock,
    Mass,
    PlaceBody,
    PlaceGeom,
    Radius,
    Remove,
    Split,
    StartHeight,
    Stiffness,
    Stretch,
)
from tests.models import xml
from tests.morphology.models import ROPE, arm, built, check_at_rest, spatial, spec_of
from tests.morphology.scenes import asset_spec


def _equal(ends: str) -> str:
    return f"<equality>{ends}</equality>"


def _sensor(sensor: str) -> str:
    return f"<sensor>{sensor}</sensor>"


_THREE = '<site site="shoulder"/><site site="middle"/><site site="hand"/>'
_SUM = '<joint joint="lower" coef="1"/><joint joint="other" coef="1"/>'
_FAR = '<geom name="far" size=".01" pos=".35 0 0"/>'
_PLATE = '<geom name="plate" type="box" size=".1 .02 .02" pos=".2 0 0" euler="0 .5 0"/>'
_AROUND = '<site site="shoulder"/><geom geom="ball" sidesite="out"/><site site="hand"/>'
_OUT = '<site name="out" pos=".1 .13 0"/>'
_TIP = '<geom type="capsule" fromto=".3 0 0 .4 0 0" size=".01"/>'
_SPRING = 'springdamper=".1 1"'
# An arm, an edit, and the message that refuses the edit; empty if the edit is accepted.
_REFUSED: list[tuple[mujoco.MjSpec, Edit, str]] = [
    (arm(spatial(ROPE, 'stiffness="1"')), Remove("lower"), ""),
    (arm(lower=_FAR), Cut("lower", 0.5), ""),
    (arm(lower=_TIP), Cut("lower", 0.5), ""),
    (
        arm(spatial(_THREE, 'damping="1"')),
        Remove("lower"),
        "The tendon 'rope' also moves bodies that stay without 'lower'",
    ),
    (
        arm(f'<tendon><fixed name="sum" stiffness="1">{_SUM}</fixed></tendon>'),
        Remove("lower"),
        "The tendon 'sum' also moves bodies that stay",
    ),
    (
        arm(_equal('<joint joint1="other" joint2="lower"/>')),
        Remove("upper"),
        "'other' follows 'lower', which would be removed: lock one of them first",
    ),
    (
        arm('<actuator><motor name="jet" site="other" refsite="hand"/></actuator>'),
        Remove("lower"),
        "The actuator 'jet' acts relative to 'hand', which would be removed",
    ),
    (
        arm(_sensor('<touch site="hand"/>')),
        Cut("lower", 0.5),
        "'hand' lies beyond the cut, but the sensor of 'hand' names it",
    ),
    (
        arm(_equal('<connect body1="lower" body2="other" anchor=".3 0 0"/>')),
        Cut("lower", 0.5),
        "A pin lies beyond the cut, but the equality names it",
    ),
    (
        arm('<contact><pair geom1="far" geom2="trunk"/></contact>', lower=_FAR),
        Cut("lower", 0.5),
        "'far' lies beyond the cut, but the pair of 'far' names it",
    ),
    (
        arm(_sensor('<distance name="gap" geom1="lower" geom2="trunk"/>')),
        Split("lower", "far"),
        "'lower' would be cut in two, but the sensor 'gap' names it",
    ),
    (
        arm(_sensor('<distance name="gap" body1="lower" body2="trunk"/>')),
        Split("lower", "far"),
        "'lower' cannot be split: the sensor 'gap' needs all of its geoms",
    ),
    (
        arm(_equal('<joint joint1="lower" joint2="upper" polycoef="0 1 1 0 0"/>')),
        Lock("lower", 0.1),
        "'lower' follows 'upper' by a curve, so it cannot be locked: lock 'upper' instead",
    ),
    (
        arm(_equal('<joint joint1="lower" polycoef=".2 0 0 0 0"/>')),
        Lock("lower", 0.1),
        "'lower' is held 0.2 from its reference by a coupling, so it cannot be locked 0.1",
    ),
    (
        arm(_equal('<joint joint1="lower" joint2="upper" polycoef="0 3 0 0 0"/>')),
        Lock("upper", 0.5),
        "coupling of 'lower' open by .* no position of its joints within their",
    ),
    (
        arm(_equal('<connect body1="lower" body2="trunk" anchor="0 0 0"/>')),
        Stretch("upper", 8.0),
        "The edits leave the pin or coupling of 'lower' and 'trunk' open by",
    ),
    (
        arm(lower=_PLATE),
        Split("lower", "far"),
        "'plate' lies oblique to the plane that would cut it in two: cut 'lower' elsewhere",
    ),
    (
        arm(spatial(ROPE, 'limited="true" range="0 .75"')),
        Stretch("upper", 1.5),
        "The tendon 'rope' would start 0.9 long, outside of its limits",
    ),
    (
        arm(spatial(_AROUND), trunk=_OUT),
        PlaceGeom("ball", radius=0.05),
        "The tendon 'rope' would pass a geom on its other side",
    ),
    (
        arm('<actuator><orientation name="a" site="hand" refsite="wall" kp="1"/></actuator>'),
        Gear("a", scale=2.0),
        "'a' is an actuator whose gains have no common scale",
    ),
    (
        arm('<actuator><position name="servo" joint="lower" kp="3"/></actuator>'),
        Gear("servo", to=2.0),
        "'servo' is not a motor, or its gear is zero, .* give a servo a scale",
    ),
    (arm(joint=_SPRING), Damping("upper", to=1.0), "derives its damping from"),
    (arm(joint=_SPRING), Stiffness("*", scale=2.0), "its stiffness from its"),
]


@pytest.mark.parametrize(("spec", "edit", "message"), _REFUSED)
def test_an_edit_refuses_what_it_cannot_carry(
    spec: mujoco.MjSpec, edit: Edit, message: str
) -> None:
    """The message names the element that holds the reference."""
    if not message:
        built(spec, edit)
        return
    with pytest.raises(MorphologyError, match=message):
        built(spec, edit)


_TWO_SUMS = """
<tendon>
  <fixed name="a"><joint joint="upper" coef="2"/></fixed>
  <fixed name="b"><joint joint="other" coef="1"/></fixed>
</tendon>
<equality><tendon name="tie" tendon1="b" tendon2="a"/></equality>
<actuator><motor name="a" tendon="a"/></actuator>
<sensor><tendonpos tendon="a"/></sensor>
"""


def test_a_tendon_is_removed_with_the_last_of_its_joints() -> None:
    """Its motor and its sensor are removed too, and tendons coupled to it are held."""
    model = built(arm(_TWO_SUMS), Lock("upper", 0.2))
    assert (model.ntendon, model.nu, model.nsensor, model.neq) == (1, 0, 0, 1)
    assert model.qpos0[model.joint("other").qposadr[0]] == pytest.approx(0.4)
    check_at_rest(model)


@pytest.mark.parametrize("locked", ["upper", "lower"])
@pytest.mark.parametrize("refs", [0.0, 0.3])
def test_coupled_joints_are_held_at_the_polynomial(locked: str, refs: float) -> None:
    """Locking a leader holds its follower, and locking a follower its leader, also in a chain."""
    chain = """<equality>
      <joint joint1="lower" joint2="upper" polycoef="0 .5 0 0 0"/>
      <joint joint1="other" joint2="lower" polycoef="0 -1 .25 0 0"/>
    </equality>"""
    spec = arm(chain)
    for joint in spec.joints:
        joint.ref = refs
    model = built(spec, Lock(locked, refs + 0.2))
    lower = 0.2 if locked == "lower" else 0.1
    expected = {"lower": lower, "upper": 2.0 * lower, "other": -lower + 0.25 * lower**2}
    for joint in {"upper", "lower", "other"} - {locked}:
        start = model.qpos0[model.joint(joint).qposadr[0]]
        assert start == pytest.approx(refs + expected[joint], abs=1e-9)
    check_at_rest(model)
    if locked == "lower":
        both = built(spec, Lock(locked, refs + 0.2), Lock("other", refs + expected["other"]))
        assert (both.neq, both.njnt) == (1, 1)
    with pytest.raises(MorphologyError, match="'other' follows 'lower' by a curve"):
        built(spec, Lock("other", refs + 0.1))


_TIED = xml("tied")


def test_a_tendon_without_effect_is_removed() -> None:
    """The humanoid's tendons have neither force nor sensor."""
    assert built(asset_spec("humanoid")).ntendon == 2
    model = built(asset_spec("humanoid"), Lock("right_knee"))
    assert model.ntendon == 1
    assert model.tendon(0).name == "left_hipknee"
    coupled = _TIED.format(tendon="", rest='<equality><joint joint1="a"/></equality>')
    model = built(spec_of(coupled), Lock("b", 0.1))
    assert (model.ntendon, model.neq) == (1, 1)


@pytest.mark.parametrize(
    ("tendon", "rest"),
    [
        *(('stiffness="1"', ""), ('damping="1"', ""), ('frictionloss="1"', "")),
        *(('armature="1"', ""), ('range="0 1"', ""), ('limited="true" range="-1 0"', "")),
        ("", '<actuator><motor tendon="tie"/></actuator>'),
        ("", '<sensor><tendonpos tendon="tie"/></sensor>'),
        ("", '<equality><tendon tendon1="tie"/></equality>'),
    ],
)
def test_a_tendon_with_effect_prevents_the_lock(tendon: str, rest: str) -> None:
    """Removing one of its joints would change its force on the other."""
    spec = spec_of(_TIED.format(tendon=f'name="tie" {tendon}', rest=rest))
    with pytest.raises(MorphologyError, match="'b' is tied to other joints by the tendon 'tie'"):
        built(spec, Lock("b", 0.1))


_CLOTH = """<deformable><flex name="cloth" dim="1" body="lower other" vertex="0 0 0 0 0 0"
  element="0 1"/></deformable>"""


@pytest.mark.parametrize(
    "edit",
    [Stretch("lower", 1.5), Radius("other", 2.0), Remove("upper"), AddLimb("lower", "_2", 1.0)],
)
def test_a_flex_is_not_torn(edit: Edit) -> None:
    with pytest.raises(MorphologyError, match=r"carries a part of the flex 'cloth', which would"):
        built(arm(_CLOTH), edit)


def test_removed_elements_are_removed_from_tuples() -> None:
    text = """<custom><tuple name="both"><element objtype="body" objname="lower" prm="1"/>
      <element objtype="body" objname="other" prm="2"/></tuple></custom>"""
    model = built(arm(text), Remove("lower"))
    assert [model.body(int(i)).name for i in model.tuple_objid] == ["other"]
    assert model.tuple_objprm.tolist() == [2.0]
    assert built(arm(text), Remove("lower"), Remove("other")).ntuple == 0


def test_cameras_and_lights_look_at_the_parent_of_a_removed_limb() -> None:
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody>
        <body name="trunk"><geom size="0.1"/>
          <body name="leg"><joint/><geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02"/></body>
        </body>
        <camera name="eye" mode="targetbody" target="leg" pos="1 0 0"/>
        <light mode="targetbody" target="leg" pos="0 0 2"/></worldbody></mujoco>"""
    )
    model = built(spec, Remove("leg"))
    trunk = model.body("trunk").id
    assert model.cam_targetbodyid.tolist() == [trunk]
    assert model.light_targetbodyid.tolist() == [trunk]


def test_a_loop_may_close_by_a_ball() -> None:
    """The keyframe keeps the pose, in numbers relative to the ball's new reference."""
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
    """The trunk starts at the new place in every keyframe that gives positions."""
    spec = arm(_HOME.format("1 2 .5 1 0 0 0 .1 .2 .3", "0 " * 9), root='<freejoint name="root"/>')
    height = built(spec, StartHeight("trunk", 0.8))
    np.testing.assert_allclose(height.key_qpos[0, :7], [1.0, 2.0, 0.8, 1.0, 0.0, 0.0, 0.0])
    half = built(spec, StartHeight("trunk", 0.8).partly(0.5))
    assert half.key_qpos[0, 2] == pytest.approx(0.65)
    place = built(spec, PlaceBody("trunk", (0.0, 0.0, 3.0)))
    np.testing.assert_allclose(place.key_qpos[0, :3], [0.0, 0.0, 3.0])
    assert built(spec, Remove("lower")).key_qpos[0, 7:].tolist() == [0.1, 0.3]


def test_a_trunk_on_a_slide_starts_at_the_height() -> None:
    """In the keyframe, the trunk has the height at which the model puts it."""
    slide = '<joint name="lift" type="slide" axis="0 0 1" ref=".2"/>'
    spec = arm(_HOME.format("-.3 .1 .2 .3", "0 0 0 0"), root=slide)
    model = built(spec, StartHeight("trunk", 0.8))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    assert data.body("trunk").xpos[2] == pytest.approx(0.8)
    np.testing.assert_allclose(model.key_qpos[0], [0.2, 0.1, 0.2, 0.3])


def test_a_keyframe_keeps_its_mocap_bodies() -> None:
    spec = arm('<keyframe><key mpos="1 2 3"/></keyframe>')
    spec.worldbody.add_body(name="hand", mocap=True, pos=[0.0, 0.0, 2.0])
    model = built(spec, Mass("lower", scale=2.0))
    np.testing.assert_array_equal(model.key_mpos[0], [1.0, 2.0, 3.0])
