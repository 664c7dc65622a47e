"""What edits carry along or refuse, one reference at a time; `tests/laws` has them all at once."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    AddLimb,
    AddMotor,
    Cut,
    Damping,
    Edit,
    Friction,
    Gear,
    Gravity,
    JointRange,
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
from tests.morphology.models import built, mass, posed, spec_of

# An arm of two segments, with places for more elements.
_ARM = """
<mujoco>
  <compiler angle="radian"/>
  {top}
  <worldbody>
    <site name="wall" pos="0 0 1"/>
    <body name="trunk" pos="0 0 1">{root}<geom name="trunk" size=".1"/>
      <site name="shoulder" pos=".1 0 0"/><geom name="ball" size=".02" pos=".1 .1 0"/>
      {trunk}
      <body name="upper" pos=".1 0 0"><joint name="upper" axis="0 1 0" range="-1 1" {joint}/>
        <geom name="upper" type="capsule" fromto="0 0 0 .4 0 0" size=".02"/>
        <site name="middle" pos=".2 0 0"/>
        {upper}
        <body name="lower" pos=".4 0 0"><joint name="lower" axis="0 1 0" range="-1 1"/>
          <geom name="lower" type="capsule" fromto="0 0 0 .4 0 0" size=".02"/>
          <site name="hand" pos=".3 0 0"/>
          {lower}
        </body>
      </body>
      <body name="other" pos="0 .3 0"><joint name="other" axis="0 1 0" range="-1 1"/>
        <geom name="other" type="capsule" fromto="0 0 0 .4 0 0" size=".02"/>
        <site name="other" pos=".4 0 0"/>
      </body>
    </body>
  </worldbody>
  {rest}
</mujoco>
"""


def _arm(rest: str = "", **more: str) -> mujoco.MjSpec:
    """Return the arm with more elements."""
    parts = dict.fromkeys(("top", "root", "trunk", "joint", "upper", "lower"), "")
    return spec_of(_ARM.format(rest=rest, **{**parts, **more}))


def _tendon(path: str, more: str = "") -> str:
    return f'<tendon><spatial name="rope" {more}>{path}</spatial></tendon>'


_ROPE = '<site site="shoulder"/><site site="hand"/>'


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
# What the arm has, the edit, and the sentence that refuses it; none where it is made.
_REFUSED: list[tuple[mujoco.MjSpec, Edit, str]] = [
    (_arm(_tendon(_ROPE, 'stiffness="1"')), Remove("lower"), ""),
    (_arm(lower=_FAR), Cut("lower", 0.5), ""),
    (_arm(lower=_TIP), Cut("lower", 0.5), ""),
    (
        _arm(_tendon(_THREE, 'damping="1"')),
        Remove("lower"),
        "The tendon 'rope' also moves what stays when 'lower' is removed",
    ),
    (
        _arm(f'<tendon><fixed name="sum" stiffness="1">{_SUM}</fixed></tendon>'),
        Remove("lower"),
        "The tendon 'sum' also moves what stays",
    ),
    (
        _arm(_equal('<joint joint1="other" joint2="lower"/>')),
        Remove("upper"),
        "'other' follows 'lower', which would be removed: lock one of them first",
    ),
    (
        _arm('<actuator><motor name="jet" site="other" refsite="hand"/></actuator>'),
        Remove("lower"),
        "The actuator 'jet' acts relative to 'hand', which would be removed",
    ),
    (
        _arm(_sensor('<touch site="hand"/>')),
        Cut("lower", 0.5),
        "'hand' lies beyond the cut, but the sensor of 'hand' names it",
    ),
    (
        _arm(_equal('<connect body1="lower" body2="other" anchor=".3 0 0"/>')),
        Cut("lower", 0.5),
        "A pin lies beyond the cut, but the equality names it",
    ),
    (
        _arm('<contact><pair geom1="far" geom2="trunk"/></contact>', lower=_FAR),
        Cut("lower", 0.5),
        "'far' lies beyond the cut, but the contact pair of 'far' names it",
    ),
    (
        _arm(_sensor('<distance name="gap" geom1="lower" geom2="trunk"/>')),
        Split("lower", "far"),
        "'lower' would be cut in two, but the sensor 'gap' names it",
    ),
    (
        _arm(_sensor('<distance name="gap" body1="lower" body2="trunk"/>')),
        Split("lower", "far"),
        "'lower' cannot be split: the sensor 'gap' is about all of its geoms",
    ),
    (
        _arm(_equal('<joint joint1="lower" joint2="upper" polycoef="0 1 1 0 0"/>')),
        Lock("lower", 0.1),
        "'lower' follows 'upper' by a curve, so it cannot be locked: lock 'upper' instead",
    ),
    (
        _arm(_equal('<joint joint1="lower" polycoef=".2 0 0 0 0"/>')),
        Lock("lower", 0.1),
        "'lower' is held 0.2 from its reference by a coupling, so it cannot be locked 0.1",
    ),
    (
        _arm(_equal('<joint joint1="lower" joint2="upper" polycoef="0 3 0 0 0"/>')),
        Lock("upper", 0.5),
        "leave the coupling of 'lower' open by .* no position of its joints within their",
    ),
    (
        _arm(lower=_PLATE),
        Split("lower", "far"),
        "'plate' lies oblique to the plane that would cut it in two: cut 'lower' elsewhere",
    ),
    (
        _arm(_tendon(_ROPE, 'limited="true" range="0 .75"')),
        Stretch("upper", 1.5),
        "The tendon 'rope' would start 0.9 long, outside of its limits",
    ),
    (
        _arm(_tendon(_AROUND), trunk=_OUT),
        PlaceGeom("ball", radius=0.05),
        "The tendon 'rope' would pass a geom on its other side",
    ),
    (
        _arm('<actuator><orientation name="a" site="hand" refsite="wall" kp="1"/></actuator>'),
        Gear("a", scale=2.0),
        "'a' is an actuator whose gains have no common scale",
    ),
    (
        _arm('<actuator><position name="servo" joint="lower" kp="3"/></actuator>'),
        Gear("servo", to=2.0),
        "'servo' is no motor, so its gear is not its strength: give a scale",
    ),
    (_arm(joint=_SPRING), Damping("upper", to=1.0), "takes its damping from"),
    (_arm(joint=_SPRING), Stiffness("*", scale=2.0), "its stiffness from its"),
]


@pytest.mark.parametrize(("spec", "edit", "message"), _REFUSED)
def test_an_edit_refuses_what_it_cannot_carry(
    spec: mujoco.MjSpec, edit: Edit, message: str
) -> None:
    """In a sentence that names the holder of the reference; without one the edit is made."""
    if not message:
        built(spec, edit)
        return
    with pytest.raises(MorphologyError, match=message):
        built(spec, edit)


def test_a_cut_leaves_something() -> None:
    """A segment whose geoms all lie beyond the cut would have no mass."""
    spec = _arm()
    spec.geom("lower").fromto = [0.3, 0.0, 0.0, 0.4, 0.0, 0.0]
    with pytest.raises(MorphologyError, match=r"No geom of 'lower' lies nearer than 0\.5 of its"):
        built(spec, Cut("lower", 0.5))


def test_a_partial_cut_shrinks_what_goes() -> None:
    """Geoms beyond it become small, and points at the end are pulled in by a part of the way."""
    spec = _arm(lower='<geom name="far" size=".01" pos=".35 0 0"/><site name="end" pos=".4 0 0"/>')
    half = built(spec, Cut("lower", 0.5).partly(0.5))
    assert half.geom("far").size[0] == pytest.approx(0.005)
    np.testing.assert_allclose(half.geom("far").pos, [0.35, 0.0, 0.0])
    np.testing.assert_allclose(half.site("end").pos, [0.3, 0.0, 0.0])
    np.testing.assert_allclose(half.site("hand").pos, [0.3, 0.0, 0.0])


@pytest.mark.parametrize("turned", ['euler="0 0 0"', 'euler="0 0 1.5707963267948966"'])
@pytest.mark.parametrize("written", ["size", "ends"])
def test_a_box_is_cut_along_the_segment(turned: str, written: str) -> None:
    """Whichever of its half-sizes lies along it, and however it is written."""
    sides = ".1 .02 .02" if "1.57" not in turned else ".02 .1 .02"
    box = f'type="box" size="{sides}" pos=".2 0 0" {turned}'
    if written == "ends":
        box = 'type="box" size=".02" fromto=".1 0 0 .3 0 0"'
    spec = _arm(
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


def test_a_geom_beside_the_axis_is_divided_where_it_is() -> None:
    """Its farther half stays in line with the nearer one."""
    spec = _arm(lower='<geom name="rib" type="capsule" fromto="0 .05 0 .3 .05 0" size=".01"/>')
    data = posed(built(spec, Split("lower", "far", 0.25)))
    np.testing.assert_allclose(data.geom("rib").xpos, [0.55, 0.05, 1.0], atol=1e-12)
    np.testing.assert_allclose(data.geom("rib_of_far").xpos, [0.7, 0.05, 1.0], atol=1e-12)
    whole = _arm(lower='<geom name="tip" type="capsule" fromto=".3 0 0 .4 0 0" size=".01"/>')
    model = built(whole, Split("lower", "far", 0.5))
    assert model.geom("tip").bodyid[0] == model.body("far").id


# --- Locks --------------------------------------------------------------------------------------

_TWO_SUMS = """
<tendon>
  <fixed name="a"><joint joint="upper" coef="2"/></fixed>
  <fixed name="b"><joint joint="other" coef="1"/></fixed>
</tendon>
<equality><tendon name="tie" tendon1="b" tendon2="a"/></equality>
<actuator><motor name="a" tendon="a"/></actuator>
<sensor><tendonpos tendon="a"/></sensor>
"""


def test_a_tendon_goes_with_all_of_its_joints() -> None:
    """With its motor and its sensor; what is coupled to it is held."""
    model = built(_arm(_TWO_SUMS), Lock("upper", 0.2))
    assert (model.ntendon, model.nu, model.nsensor, model.neq) == (1, 0, 0, 1)
    assert model.qpos0[model.joint("other").qposadr[0]] == pytest.approx(0.4)
    _at_rest(model)


@pytest.mark.parametrize("locked", ["upper", "lower"])
@pytest.mark.parametrize("refs", [0.0, 0.3])
def test_coupled_joints_are_held_at_the_polynomial(locked: str, refs: float) -> None:
    """A leader holds its follower, and a follower its leader, in a chain of couplings."""
    chain = """<equality>
      <joint joint1="lower" joint2="upper" polycoef="0 .5 0 0 0"/>
      <joint joint1="other" joint2="lower" polycoef="0 -1 .25 0 0"/>
    </equality>"""
    spec = _arm(chain)
    for joint in spec.joints:
        joint.ref = refs
    model = built(spec, Lock(locked, refs + 0.2))
    lower = 0.2 if locked == "lower" else 0.1
    expected = {"lower": lower, "upper": 2.0 * lower, "other": -lower + 0.25 * lower**2}
    for joint in {"upper", "lower", "other"} - {locked}:
        start = model.qpos0[model.joint(joint).qposadr[0]]
        assert start == pytest.approx(refs + expected[joint], abs=1e-9)
    _at_rest(model)
    if locked == "lower":
        both = built(spec, Lock(locked, refs + 0.2), Lock("other", refs + expected["other"]))
        assert (both.neq, both.njnt) == (1, 1)
    with pytest.raises(MorphologyError, match="'other' follows 'lower' by a curve"):
        built(spec, Lock("other", refs + 0.1))


def _at_rest(model: mujoco.MjModel) -> None:
    """Check that all equalities hold in the model's own pose."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rows = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    np.testing.assert_allclose(data.efc_pos[rows], 0.0, atol=1e-8)


# --- Loops --------------------------------------------------------------------------------------


def test_a_loop_may_close_by_a_ball() -> None:
    """Its keyframe keeps the pose, which is counted from another reference now."""
    ball = """<body name="rod" pos="0 0 .2"><joint name="rod" type="ball"/>
      <geom name="rod" type="capsule" fromto="0 0 0 .2 0 0" size=".01"/></body>"""
    pin = """<equality><connect name="pin" body1="rod" body2="trunk" anchor=".2 0 0"/></equality>
      <keyframe><key name="home" qpos="{} .1 0 0"/></keyframe>"""
    quaternion = np.array([0.8, 0.0, 0.6, 0.0])
    spec = _arm(pin.format(" ".join(map(str, quaternion))), trunk=ball)
    before = built(spec)
    after = built(
        spec, PlaceBody("rod", (0.2 - 0.2 * math.cos(0.3), 0.0, 0.2 + 0.2 * math.sin(0.3)))
    )
    _at_rest(after)
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
        model = built(_arm(pin.format(name)), Stretch("lower", 1.5))
        assert model.eq_objtype[0] == mujoco.mjtObj.mjOBJ_SITE
        np.testing.assert_allclose(model.site(ends[0]).pos, [0.6, 0.0, 0.0])
        np.testing.assert_allclose(model.site(ends[1]).pos, [0.9, -0.3, 0.0])


def test_an_open_equality_stays_as_open_as_it_was() -> None:
    """A model that starts torn is not changed behind the user's back."""
    torn = '<equality><joint joint1="lower" joint2="upper" polycoef=".3 1 0 0 0"/></equality>'
    model = built(_arm(torn), Mass("lower", scale=2.0))
    np.testing.assert_array_equal(model.qpos0, 0.0)
    assert model.eq_data[0, 0] == 0.3


# --- Copies -------------------------------------------------------------------------------------


def test_a_copy_aims_and_wraps_like_the_original() -> None:
    """Its camera looks at its own bodies, and its tendon runs around copies on the trunk."""
    tendon = _tendon(
        '<site site="bar"/><geom geom="ball"/><site site="middle"/><pulley divisor="2"/>'
        '<site site="shoulder"/><site site="hand"/>'
    )
    spec = _arm(
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
    tendon = _tendon(
        '<site site="middle"/><site site="hand"/>',
        'range="0 2" limited="true" springlength="1" stiffness="3"',
    )
    motor = '<actuator><position name="pull" tendon="rope" kp="2"/></actuator>'
    model = built(_arm(tendon + motor), AddLimb("upper", "_2", 1.0, 2.0))
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
    spec = _arm()
    spec.activate_plugin("mujoco.pid")
    plugin = spec.add_plugin(name="pid", plugin_name="mujoco.pid", active=True)
    plugin.config = {"kp": "1.0"}
    servo = spec.add_actuator(name="servo", target="lower", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.plugin.active, servo.plugin.name = True, "pid"
    servo.plugin.plugin_name = "mujoco.pid"
    with pytest.raises(MorphologyError, match="'servo' is driven by a plugin, so it cannot be"):
        AddLimb("lower", "_2", 1.0).apply(spec)


# --- Drawings, flexes and tuples ----------------------------------------------------------------

_CLOTH = """<deformable><flex name="cloth" dim="1" body="lower other" vertex="0 0 0 0 0 0"
  element="0 1"/></deformable>"""


@pytest.mark.parametrize(
    "edit",
    [Stretch("lower", 1.5), Radius("other", 2.0), Remove("upper"), AddLimb("lower", "_2", 1.0)],
)
def test_a_flex_is_not_torn(edit: Edit) -> None:
    """Its vertices belong to several bodies."""
    with pytest.raises(MorphologyError, match=r"carries a part of the flex 'cloth', which would"):
        built(_arm(_CLOTH), edit)


def test_equalities_of_a_flex_are_kept() -> None:
    """They name no body."""
    tied = _CLOTH + '<equality><flex flex="cloth"/></equality>'
    assert built(_arm(tied), Stretch("upper", 1.1)).neq == 1


def test_a_tuple_loses_what_is_removed() -> None:
    """And keeps the rest."""
    text = """<custom><tuple name="both"><element objtype="body" objname="lower" prm="1"/>
      <element objtype="body" objname="other" prm="2"/></tuple></custom>"""
    model = built(_arm(text), Remove("lower"))
    assert [model.body(int(i)).name for i in model.tuple_objid] == ["other"]
    assert model.tuple_objprm.tolist() == [2.0]
    assert built(_arm(text), Remove("lower"), Remove("other")).ntuple == 0


# --- Strengths ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "actuator",
    [
        *('<position name="a" joint="lower" kp="3" kv=".2" forcerange="-2 4"/>',),
        *('<velocity name="a" joint="lower" kv="3"/>', '<motor name="a" joint="lower" gear="3"/>'),
        *('<intvelocity name="a" joint="lower" kp="3" kv="1" actrange="-1 1"/>',),
        *('<damper name="a" joint="lower" kv="3" ctrlrange="0 1"/>',),
        *('<cylinder name="a" joint="lower" area="3" bias="1 2 3" timeconst=".1"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" force="3"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" scale="3"/>',),
        *('<general name="a" joint="lower" gainprm="3" biastype="affine" biasprm="1 2 3"/>',),
    ],
)
def test_gear_scales_the_force_of_any_actuator(actuator: str) -> None:
    """In any state and for any control, so a servo keeps its targets."""
    spec = _arm(f"<actuator>{actuator}</actuator>")
    old, new = built(spec), built(spec, Gear("a", scale=0.4))
    for seed in range(3):
        forces: list[Any] = []
        for model in (old, new):
            rng, data = np.random.default_rng(seed), mujoco.MjData(model)
            data.qpos[:], data.qvel[:] = rng.uniform(-1.0, 1.0, (2, model.nv))
            data.ctrl[:] = rng.uniform(0.0, 1.0, model.nu)
            data.act[:] = rng.uniform(0.0, 1.0, model.na)
            mujoco.mj_forward(model, data)
            forces.append(data.qfrc_actuator.copy())
        np.testing.assert_allclose(forces[1], 0.4 * forces[0], rtol=1e-9, atol=1e-12)
        assert np.any(forces[0])


def test_a_largest_force_scales_with_all_of_its_motors() -> None:
    """Else a stronger motor would change nothing; one of two does not change it."""
    motors = '<actuator><motor name="a" joint="upper"/><motor name="b" joint="upper"/></actuator>'
    spec = _arm(motors, joint='actuatorfrcrange="-2 2"')
    for pattern, largest in (("*", 6.0), ("a", 2.0)):
        model = built(spec, Gear(pattern, scale=3.0))
        limits = model.jnt_actfrcrange[model.joint("upper").id]
        np.testing.assert_array_equal(limits, [-largest, largest])


def test_a_muscle_is_fitted_to_the_length_of_its_tendon() -> None:
    """A written length range scales with the tendon, as when a model is fitted to a person."""
    muscle = (
        _tendon(_ROPE) + '<actuator><muscle name="m" tendon="rope" lengthrange=".1 1"/></actuator>'
    )
    old, new = built(_arm(muscle)), built(_arm(muscle), Stretch("upper", 1.5))
    lengths = [model.tendon_length0[0] for model in (old, new)]
    np.testing.assert_allclose(
        new.actuator_lengthrange, old.actuator_lengthrange * lengths[1] / lengths[0]
    )
    unnamed = _arm(_tendon(_ROPE).replace('name="rope"', ""))
    assert built(unnamed, Stretch("upper", 1.5)).tendon(0).name == ""


# --- Settings that swallow an edit ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("flag", "edit", "what"),
    [
        ("gravity", Gravity((0.0, 0.0, -1.0)), "gravity"),
        ("damper", Damping("*", to=1.0), "dampers"),
        ("spring", Stiffness("*", to=1.0), "springs"),
        ("actuation", AddMotor("*", 1.0), "actuators"),
        ("limit", JointRange("lower", 0.0, 1.0), "limits of joints"),
        ("contact", Friction("*", to=0.5), "contacts"),
    ],
)
def test_an_edit_of_what_is_switched_off_is_refused(flag: str, edit: Edit, what: str) -> None:
    spec = _arm(top=f'<option><flag {flag}="disable"/></option>')
    with pytest.raises(MorphologyError, match=f"would change nothing, .* switches {what} off"):
        built(spec, edit)
    if what == "contacts":
        override = _arm(top='<option><flag override="enable"/></option>')
        with pytest.raises(MorphologyError, match="overrides the parameters of all contacts"):
            built(override, edit)


def test_least_masses_do_not_swallow_an_edit() -> None:
    """They are written out, and bind nothing any more."""
    spec = _arm(top='<compiler boundmass="1" boundinertia=".1"/>')
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


def test_bodies_that_the_compiler_merges_can_be_weighed() -> None:
    spec = _arm(
        top='<compiler fusestatic="true"/>',
        lower='<body name="cap" pos=".4 0 0"><geom name="cap" size=".01"/></body>',
    )
    before = mass(built(spec))
    weight = mass(built(spec, Mass("cap", to=0.5)))
    assert weight == pytest.approx(before - 1000.0 * 4.0 / 3.0 * math.pi * 0.01**3 + 0.5)


# --- Keyframes ----------------------------------------------------------------------------------

_HOME = '<keyframe><key name="home" qpos="{}"/><key name="moving" qvel="{}"/></keyframe>'


def test_a_placed_trunk_starts_there() -> None:
    """In every keyframe that gives positions."""
    spec = _arm(_HOME.format("1 2 .5 1 0 0 0 .1 .2 .3", "0 " * 9), root='<freejoint name="root"/>')
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
    spec = _arm(_HOME.format("-.3 .1 .2 .3", "0 0 0 0"), root=slide)
    model = built(spec, StartHeight("trunk", 0.8))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    assert data.body("trunk").xpos[2] == pytest.approx(0.8)
    np.testing.assert_allclose(model.key_qpos[0], [0.2, 0.1, 0.2, 0.3])
