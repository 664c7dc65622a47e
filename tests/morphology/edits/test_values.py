"""Edits of one number, of joints and motors, and of places."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    AddMotor,
    Damping,
    Friction,
    Gear,
    JointRange,
    Lock,
    Mass,
    PlaceBody,
    PlaceGeom,
    StartHeight,
    Stiffness,
    Stretch,
    TotalMass,
    compile_body,
    reshape,
)
from tests.morphology.models import (
    URDF,
    ant,
    arm,
    built,
    capsule_inertia,
    capsule_mass,
    gantry,
    leg,
    limb,
    mass,
    spec_of,
    tip,
)

_MOTORS = """
<mujoco>
<worldbody><body name="b"><freejoint name="root"/><geom name="g" size=".1"/></body></worldbody>
<actuator>
  <motor name="jet" joint="root" gear="1 0 -4 0 2 0"/>
  <motor name="idle" joint="root" gear="0 0 0 0 0 0"/>
</actuator></mujoco>
"""


@pytest.mark.parametrize(
    "content",
    [
        '<geom type="capsule" size=".1 .2"/><geom size=".1" pos="0 0 .3" mass="2"/>',
        '<inertial pos=".1 0 0" mass="2" diaginertia=".1 .2 .25"/><geom size=".1"/>',
    ],
)
def test_a_mass_of_geoms_or_of_an_inertial_element_can_be_set(content: str) -> None:
    before, after = built(limb(content)), built(limb(content), Mass("link", to=0.7))
    assert mass(after, "link") == pytest.approx(0.7)
    np.testing.assert_allclose(
        after.body("link").inertia, 0.7 / mass(before, "link") * before.body("link").inertia
    )
    np.testing.assert_allclose(after.body("link").ipos, before.body("link").ipos, atol=1e-12)


def test_a_gear_keeps_its_direction() -> None:
    """`to` sets the strongest axis; the others stay in proportion."""
    for edit, gear in (
        (Gear("jet", scale=2.0), [2.0, 0.0, -8.0, 0.0, 4.0, 0.0]),
        (Gear("jet", to=2.0), [-0.5, 0.0, 2.0, 0.0, -1.0, 0.0]),
        (Gear("jet", to=-2.0), [0.5, 0.0, -2.0, 0.0, 1.0, 0.0]),
    ):
        np.testing.assert_allclose(built(spec_of(_MOTORS), edit).actuator("jet").gear, gear)
    spec = leg()
    spec.actuator("hip").gear = [49.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert built(spec, Gear("hip", to=1.0)).actuator("hip").gear[0] == 1.0  # Without rounding.
    with pytest.raises(MorphologyError, match="'idle' is not a motor, or its gear is zero"):
        built(spec_of(_MOTORS), Gear("*", scale=2.0))


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
    before, after = built(leg()), built(leg(), Friction("sole", to=0.3, component=component))
    expected = np.array(before.geom("sole").friction)
    expected[place] = 0.3
    np.testing.assert_array_equal(after.geom("sole").friction, expected)
    np.testing.assert_array_equal(after.geom("floor").friction, before.geom("floor").friction)


@pytest.mark.parametrize(
    "actuator",
    [
        *('<position name="a" joint="lower" kp="3" kv=".2" forcerange="-2 4"/>',),
        *('<velocity name="a" joint="lower" kv="3"/>', '<motor name="a" joint="lower" gear="3"/>'),
        *('<intvelocity name="a" joint="lower" kp="3" kv="1" actrange="-1 1"/>',),
        *('<damper name="a" joint="lower" kv="3" ctrlrange="0 1"/>',),
        *('<cylinder name="a" joint="lower" area="3" bias="1 2 3" timeconst=".1"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" force="3"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" force=".5"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" scale="3"/>',),
        *('<general name="a" joint="lower" biastype="affine" biasprm="1 2 3 7"/>',),
        *('<general name="a" joint="lower" gainprm="3 0 0 5" biastype="affine" biasprm="1 2 3"/>',),
    ],
)
def test_gear_scales_the_force_of_any_actuator(actuator: str) -> None:
    """The force scales in any state and for any control, so a servo keeps its targets."""
    spec = arm(f"<actuator>{actuator}</actuator>")
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
    np.testing.assert_allclose(new.actuator_forcerange, 0.4 * old.actuator_forcerange)
    first = 4 if "muscle" in actuator else 3  # The numbers from there on are no strengths.
    for field in ("actuator_gainprm", "actuator_biasprm"):
        kept = [getattr(model, field)[:, first:] for model in (old, new)]
        np.testing.assert_array_equal(*kept)


def test_a_largest_force_scales_with_all_of_its_motors() -> None:
    """The joint's force limit is scaled only if the edit scales every motor on the joint.

    If the limit stayed, a stronger motor would have no effect.
    """
    motors = '<motor name="a" joint="upper"/><motor name="b" joint="upper"/>'
    motors += '<motor name="c" joint="lower"/>'
    more = f'<actuator>{motors}</actuator><sensor><jointpos joint="upper"/></sensor>'
    spec = arm(more, joint='actuatorfrcrange="-2 2"')
    spec.joint("lower").actfrcrange = [-1.0, 1.0]
    for pattern, upper, lower in (("*", 6.0, 3.0), ("a", 2.0, 1.0)):
        model = built(spec, Gear(pattern, scale=3.0))
        for joint, largest in (("upper", upper), ("lower", lower)):
            limits = model.jnt_actfrcrange[model.joint(joint).id]
            np.testing.assert_array_equal(limits, [-largest, largest])


def _range(model: mujoco.MjModel, joint: str) -> list[float]:
    return model.joint(joint).range.tolist()


@pytest.mark.parametrize("degrees", range(-180, 181, 6))
def test_degrees_are_exact(degrees: int) -> None:
    spec = limb('<geom size=".1"/>')
    spec.joint("link").range = [degrees, 200.0]
    edited = built(limb('<geom size=".1"/>'), JointRange("link", math.radians(degrees), 3.5))
    assert edited.joint("link").range[0] == built(spec).joint("link").range[0]


def test_partial_limits_of_a_slide_come_from_far_away() -> None:
    edit = JointRange("y", -1.0, 2.0)
    assert _range(built(gantry(), edit), "y") == [-1.0, 2.0]
    assert _range(built(gantry(), edit.partly(0.5)), "y") == [-4.0, 5.0]


def test_joints_are_locked_in_the_middle() -> None:
    free = built(leg())
    middle = tip(free, "toe", {"knee": math.radians(-45.0)})
    np.testing.assert_allclose(tip(built(leg(), Lock("knee")), "toe"), middle)
    model = built(limb('<geom size=".1"/>'), Lock("link"))
    np.testing.assert_allclose(model.body("link").quat, [1.0, 0.0, 0.0, 0.0])


def test_a_slide_without_limits_is_locked_at_a_position() -> None:
    assert built(gantry(), Lock("y", 0.3)).njnt == 4
    half = built(gantry(), Lock("y", 0.3).partly(0.5))
    assert _range(half, "y") == pytest.approx([0.3 - 1.0, 0.3 + 1.0])
    nearly = _range(built(leg(), Lock("knee").partly(1.0 - 1e-9)), "knee")
    middle = math.radians(-45.0)
    assert nearly == pytest.approx([middle - 5e-4, middle + 5e-4])


def test_motors_are_as_strong_as_the_model_allows() -> None:
    """The default gear is the effort limit of a URDF; a joint without one needs a gear."""
    model = built(spec_of(URDF), AddMotor("shoulder"), AddMotor("elbow", 3.0))
    assert [model.actuator(i).name for i in range(model.nu)] == ["shoulder", "elbow"]
    np.testing.assert_array_equal(model.actuator_gear, [[7.0, *[0.0] * 5], [3.0, *[0.0] * 5]])
    np.testing.assert_array_equal(model.actuator_ctrlrange, [[-1.0, 1.0]] * 2)
    with pytest.raises(MorphologyError, match="no largest torque or force of 'elbow': give a gear"):
        reshape(spec_of(URDF), [AddMotor("*")])
    half = built(spec_of(URDF), AddMotor("shoulder", amount=0.5))
    assert half.actuator_gear[0, 0] == 3.5
    manual = limb('<geom size=".1"/>', 'autolimits="false"')
    assert built(manual, AddMotor("link", 2.0)).actuator_ctrllimited[0]


@pytest.mark.parametrize(
    ("coupling", "joint", "motors"),
    [
        ('joint1="lower" joint2="upper"', "*", ["upper", "other"]),
        ('joint1="lower" joint2="upper"', "lower", ["lower"]),
        ('joint1="lower" joint2="upper" active="false"', "*", ["upper", "lower", "other"]),
        ('joint1="lower"', "*", ["upper", "lower", "other"]),
    ],
)
def test_a_joint_that_follows_another_gets_a_motor_only_by_its_name(
    coupling: str, joint: str, motors: list[str]
) -> None:
    model = built(arm(f"<equality><joint {coupling}/></equality>"), AddMotor(joint, 1.0))
    assert [model.actuator(i).name for i in range(model.nu)] == motors


def test_a_motor_of_a_tendon_is_not_a_motor_of_the_joint_of_the_same_name() -> None:
    spec = spec_of(
        """
        <mujoco><worldbody>
          <body><joint name="pull" axis="0 1 0"/><geom size=".1"/></body></worldbody>
        <tendon><fixed name="pull"><joint joint="pull" coef="1"/></fixed></tendon>
        <actuator><motor name="muscle" tendon="pull"/></actuator></mujoco>"""
    )
    assert built(spec, AddMotor("*", 2.0)).nu == 2


def test_a_fixed_robot_is_set_free() -> None:
    """The robot has its whole mass, although MuJoCo merges a URDF's base with the world."""
    fixed = built(spec_of(URDF))
    assert (fixed.nq, fixed.body_mass[0]) == (2, 0.0)
    free = compile_body(
        spec_of(URDF), (AddFreeJoint("base"), StartHeight("base", 0.5), Mass("base", scale=2.0))
    )
    assert (free.nq, free.joint(0).name) == (9, "base_free")
    assert free.body("base").mass == 4.0


def test_no_body_of_a_freed_robot_is_merged_with_another() -> None:
    spec = spec_of(
        """<mujoco><compiler fusestatic="true"/><worldbody><body name="base"><geom size=".1"/>
        <body name="tool"><geom size=".1"/></body></body></worldbody></mujoco>"""
    )
    assert built(spec, AddFreeJoint("base")).body("tool").mass > 0.0


def test_a_body_moves_with_what_it_carries() -> None:
    before, after = built(leg()), built(leg(), PlaceBody("thigh", (0.0, 0.5, 0.1)))
    np.testing.assert_array_equal(after.body("thigh").pos, [0.0, 0.5, 0.1])
    for field in ("geom_pos", "jnt_pos", "site_pos", "body_mass", "body_inertia", "body_ipos"):
        np.testing.assert_array_equal(getattr(after, field), getattr(before, field))
    np.testing.assert_allclose(tip(after, "toe") - tip(before, "toe"), [0.0, 0.3, 0.1])
    spec = leg()
    spec.add_key(name="home", qpos=[0.0, 0.0, 2.0, 0.8, 0.6, 0.0, 0.0, 0.1, -0.2])
    half = built(spec, PlaceBody("trunk", (1, 2, 3)).partly(0.5))  # Whole numbers will do.
    np.testing.assert_allclose(half.body("trunk").pos, [0.5, 1.0, 2.0])
    np.testing.assert_allclose(half.key_qpos[0], [0.5, 1.0, 2.5, 0.8, 0.6, 0.0, 0.0, 0.1, -0.2])


@pytest.mark.parametrize(
    ("joint", "position"),
    [
        ('type="slide" axis="0 0 2" ref=".5"', 0.5),
        ('type="slide" axis="0 1 1"', 0.2),
        ('type="hinge" axis="0 0 1"', 0.2),
    ],
)
def test_a_start_height_changes_keyframes_of_vertical_slides_only(
    joint: str, position: float
) -> None:
    spec = spec_of(
        f"""<mujoco><worldbody><body name="trunk"><joint {joint}/><geom size=".1"/></body>
        </worldbody><keyframe><key qpos=".2"/></keyframe></mujoco>"""
    )
    assert built(spec, StartHeight("trunk", 0.7)).key_qpos[0, 0] == position


def test_a_stretch_along_an_axis_moves_elements_along_it_only() -> None:
    spec = arm(lower='<site name="off" pos=".1 .2 .3"/>')
    model = built(spec, Stretch("lower", 2.0, axis="x"))
    np.testing.assert_allclose(model.site("off").pos, [0.2, 0.2, 0.3])


def test_a_geom_is_placed_by_its_ends() -> None:
    """The body's mass and inertia follow, and no other element moves."""
    edit = PlaceGeom("thigh", (0.0, 0.0, 0.1), (0.0, 0.3, -0.3), radius=0.05)
    before, after = built(leg()), built(leg(), edit)
    assert after.geom("thigh").size[:2] == pytest.approx([0.05, 0.25])
    np.testing.assert_allclose(after.geom("thigh").pos, [0.0, 0.15, -0.1])
    across, along = capsule_inertia(0.05, 0.5, 500.0)
    assert after.body("thigh").mass == pytest.approx(capsule_mass(0.05, 0.5, 500.0))
    np.testing.assert_allclose(sorted(after.body("thigh").inertia), sorted([across, across, along]))
    for site in ("scar", "knee_cap", "toe"):
        np.testing.assert_array_equal(tip(after, site), tip(before, site))


@pytest.mark.parametrize("ends", [(0.1, 0.9), (0.9, 0.1)])
def test_half_the_amount_moves_both_ends_halfway(ends: tuple[float, float]) -> None:
    """The ends of a geom given by its pose have no order: each goes to the nearer new one."""
    model = limb('<geom name="rod" type="capsule" size=".1 .2" pos="0 0 .3"/>')
    start, end = ((0.0, 0.0, height) for height in ends)
    whole = built(model, PlaceGeom("rod", start, end))
    assert whole.geom("rod").size[1] == pytest.approx(0.4)
    half = built(model, PlaceGeom("rod", start, end, amount=0.5))
    assert half.geom("rod").size[1] == pytest.approx(0.3)
    assert half.geom("rod").pos[2] == pytest.approx(0.4)
    # The ends of a geom given by its ends have an order.
    turned = built(leg(), PlaceGeom("thigh", (0.0, 0.0, -0.3), (0.0, 0.0, 0.1), amount=0.5))
    assert turned.geom("thigh").size[1] == pytest.approx(0.025)


def test_a_geom_is_moved_by_its_middle() -> None:
    """A geom of any shape moves, by half the way at half the amount, and does not turn."""
    before = built(leg())
    for geom in ("sole", "shin", "trunk"):
        after = built(leg(), PlaceGeom(geom, middle=(0.0, 0.1, 0.2)))
        np.testing.assert_allclose(after.geom(geom).pos, [0.0, 0.1, 0.2], atol=1e-15)
        np.testing.assert_array_equal(after.geom(geom).quat, before.geom(geom).quat)
        half = built(leg(), PlaceGeom(geom, middle=(0.0, 0.1, 0.2), amount=0.5))
        np.testing.assert_allclose(
            half.geom(geom).pos,
            0.5 * (before.geom(geom).pos + np.array([0.0, 0.1, 0.2])),
            atol=1e-15,
        )


def test_the_total_mass_is_set() -> None:
    """Earlier edits count, the inertia scales too, and half the amount goes half the way."""
    before = built(ant(), Mass("torso", scale=3.0))
    after = built(ant(), Mass("torso", scale=3.0), TotalMass(14.0))
    assert after.body_mass.sum() == pytest.approx(14.0, rel=1e-12)
    factor = 14.0 / before.body_mass.sum()
    np.testing.assert_allclose(after.body_inertia, factor * before.body_inertia, rtol=1e-9)
    half = built(ant(), Mass("torso", scale=3.0), TotalMass(14.0, amount=0.5))
    assert half.body_mass.sum() == pytest.approx(0.5 * (14.0 + before.body_mass.sum()))


def test_a_robot_lands_on_its_floor() -> None:
    """The middle of the box of 0.2 m comes to rest 0.1 m above the floor."""
    body = (AddFreeJoint("base"), StartHeight("base", 0.7), AddFloor(friction=0.5, height=0.5))
    model = compile_body(spec_of(URDF), body)
    assert model.geom("floor").friction[0] == 0.5
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=500)
    assert data.qpos[2] == pytest.approx(0.6, abs=0.01)


def test_a_floor_does_not_depend_on_the_defaults_of_the_model() -> None:
    spec = spec_of('<mujoco><default><geom contype="0" conaffinity="0"/></default></mujoco>')
    floor = built(spec, AddFloor(friction=0.5, height=0.5)).geom("floor")
    np.testing.assert_array_equal(floor.pos, [0.0, 0.0, 0.5])
    np.testing.assert_array_equal(floor.size, [0.0, 0.0, 0.05])
    np.testing.assert_array_equal(floor.friction, [0.5, 0.005, 0.0001])
    assert (floor.contype[0], floor.conaffinity[0]) == (1, 1)
