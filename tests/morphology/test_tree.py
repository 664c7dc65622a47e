"""The robot among a model's bodies, its kinematic tree, and the numbers that describe it."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from shapechanger.morphology import Body, Cut, Gear, Mass, Stretch, TotalMass, compile_body, reshape
from shapechanger.morphology.pose import (
    StartRules,
    floor_height,
    moved_trees,
    robot_bodies,
    standing_height,
    start_pose,
    travelling_body,
    trunk_lift,
)
from shapechanger.morphology.tree import LIMB_NUMBERS, TRUNK_NUMBERS, Tree, tree_of
from tests.models import xml
from tests.morphology.models import ant, built

_ARM = xml("arm_tree")


def _ant(body: Body) -> Tree:
    model = built(ant(), *body)
    return tree_of(model, start_pose(model))


def _number(tree: Tree, joint: str, name: str) -> float:
    limb = next(limb for limb in tree.limbs if limb.joint == joint)
    return limb.numbers[LIMB_NUMBERS.index(name)]


def test_an_ants_tree() -> None:
    """Eight limbs have a motor each; bodies without joints belong to the body that carries them."""
    tree = _ant(())
    assert [limb.joint for limb in tree.limbs[:3]] == ["hip_1", "ankle_1", "hip_2"]
    assert {limb.actuator for limb in tree.limbs} == {limb.joint for limb in tree.limbs}
    assert tree.trunk[0] == "torso"
    legs = {"front_left_leg", "front_right_leg", "back_leg", "right_back_leg"}
    assert set(tree.trunk[1:]) == legs
    assert len(tree.numbers) == len(TRUNK_NUMBERS)
    assert {len(limb.numbers) for limb in tree.limbs} == {len(LIMB_NUMBERS)}
    assert _number(tree, "hip_1", "depth") == 1.0
    assert _number(tree, "ankle_1", "depth") == 2.0


def test_numbers_follow_the_edits() -> None:
    """A longer shank, a stronger motor and a heavier trunk change their numbers."""
    plain = _ant(())
    changed = _ant((Stretch("shank_1", 2.0), Gear("hip_2", 10.0), Mass("torso", 10.0)))
    one, other = (
        [_number(tree, "ankle_1", name) for name in ("end x", "end y", "end z", "length")]
        for tree in (plain, changed)
    )
    assert other == pytest.approx([*one[:3], 2.0 * one[3]])
    assert np.linalg.norm(one[:3]) == pytest.approx(1.0)
    stronger = _number(changed, "hip_2", "strength") - _number(plain, "hip_2", "strength")
    assert stronger == pytest.approx(0.5, abs=0.01)
    assert _number(changed, "hip_4", "strength") == _number(plain, "hip_4", "strength")
    assert changed.numbers[0] > plain.numbers[0]
    assert _ant((Cut("shank_1", 0.25),)).limbs[0] != plain.limbs[0]  # Limb 0 carries less mass.


def test_vectors_are_in_the_frame_of_the_trunk() -> None:
    """Turning the whole body changes no number of its limbs."""
    model = built(ant())
    pose = start_pose(model)
    turned = pose.copy()
    mujoco.mju_axisAngle2Quat(turned[3:7], np.array([0.0, 0.0, 1.0]), 1.0)
    for one, other in zip(tree_of(model, pose).limbs, tree_of(model, turned).limbs, strict=True):
        np.testing.assert_allclose(one.numbers, other.numbers, atol=1e-9)


def test_a_body_on_the_world() -> None:
    """The trunk is the world; the last of several joints of one body has the body's parts."""
    model = mujoco.MjModel.from_xml_string(_ARM)
    tree = tree_of(model, model.qpos0)
    assert tree.trunk == ("world",)
    assert [(limb.joint, limb.bodies, limb.actuator) for limb in tree.limbs] == [
        ("along", (), "pull"),
        ("around", ("slider", "tip", "thin"), ""),
    ]
    assert tree.numbers[TRUNK_NUMBERS.index("friction")] == 0.8
    assert _number(tree, "along", "slides") == 1.0
    assert (_number(tree, "along", "lower"), _number(tree, "around", "upper")) == (-1.0, 0.0)
    assert _number(tree, "around", "strength") == 0.0
    assert _number(tree, "along", "mass") == -3.0  # No mass.
    assert _number(tree, "around", "mass with limbs") == pytest.approx(math.log10(3.0), abs=1e-3)
    # The capsule's end is farther from the joint than the spheres.
    reach = _number(tree, "around", "end x") * _number(tree, "around", "length")
    assert reach == pytest.approx(0.5)
    ball = "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(ball)
    tree = tree_of(model, model.qpos0)
    assert tree.limbs == ()
    assert tree.numbers[TRUNK_NUMBERS.index("friction")] == 1.0  # Without a floor.


_TENDONS = xml("tendons")


@pytest.mark.parametrize(
    ("actuators", "movers"),
    [
        ('<motor name="e" tendon="flex_elbow"/>', {"elbow": "e"}),
        # If moments are equal, the joint nearer to the trunk gets the actuator.
        ('<motor name="b" tendon="both"/>', {"shoulder": "b"}),
        # A joint keeps its own motor, wherever the motor is in the file.
        (
            '<motor name="b" tendon="both"/><motor name="s" joint="shoulder"/>',
            {"shoulder": "s", "elbow": "b"},
        ),
        ('<motor name="w" tendon="wrist_most" gear="3"/>', {"wrist": "w"}),
        ('<muscle name="m" tendon="biceps" lengthrange=".01 .5"/>', {"elbow": "m"}),
        ('<muscle name="m" tendon="biceps" lengthrange=".01 .5" force="7"/>', {"elbow": "m"}),
        ('<motor name="jet" site="lower" gear="1 0 0 0 0 0"/>', {"shoulder": "jet"}),
        ('<adhesion name="grip" body="hand" ctrlrange="0 1"/>', {"wrist": "grip"}),
        ('<motor name="nothing" tendon="slack"/>', {}),
    ],
)
def test_an_actuator_goes_to_the_joint_that_it_turns_most(
    actuators: str, movers: dict[str, str]
) -> None:
    """Indices of tendons, sites and bodies are not used as indices of joints."""
    model = mujoco.MjModel.from_xml_string(_TENDONS.format(actuators))
    tree = tree_of(model, np.zeros(model.nq))
    assert {limb.joint: limb.actuator for limb in tree.limbs if limb.actuator} == movers


@pytest.mark.parametrize(
    ("actuators", "torque"),
    [
        ('<motor name="w" tendon="wrist_most" gear="3"/>', 6.0),
        ('<position name="w" tendon="wrist_most" kp="4"/>', 8.0),
        ('<muscle name="w" tendon="wrist_most" lengthrange="-1 1" force="7"/>', 14.0),
    ],
)
def test_the_strength_of_a_tendon_is_a_torque(actuators: str, torque: float) -> None:
    """The strength is the tendon's force times its moment arm about the joint."""
    model = mujoco.MjModel.from_xml_string(_TENDONS.format(actuators))
    strength = _number(tree_of(model, np.zeros(model.nq)), "wrist", "strength")
    assert strength == pytest.approx(math.log10(1.0 + torque) / 2.0)


# Objects come first, so that code that relies on the order of the file fails.
_SCENE = xml("scene_tree")
_MOVED_BY_JOINT = '<actuator><motor joint="arm" ctrlrange="-1 1"/></actuator>'
_ROBOT = ["base", "arm"]
# A flex, whose equality couples no bodies.
_CLOTH = """<worldbody><flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2"
  radius=".01" pos="0 3 1"><edge equality="true"/></flexcomp></worldbody>"""


def _model(more: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(_SCENE.format(more=more))


def _robot(model: mujoco.MjModel) -> list[str]:
    return [model.body(i).name for i in np.flatnonzero(robot_bodies(model))]


@pytest.mark.parametrize(
    "more",
    [
        _MOVED_BY_JOINT,
        '<actuator><motor jointinparent="arm"/></actuator>',
        '<tendon><fixed name="t"><joint joint="arm" coef="1"/></fixed></tendon>'
        '<actuator><motor tendon="t"/></actuator>',
        '<tendon><spatial name="t"><site site="tip"/><site site="crank"/></spatial></tendon>'
        '<actuator><motor tendon="t"/></actuator>',
        '<actuator><motor site="tip"/></actuator>',
        '<actuator><motor cranksite="crank" slidersite="tip" cranklength=".1"/></actuator>',
        '<actuator><adhesion body="arm" ctrlrange="0 1"/></actuator>',
        '<actuator><orientation site="tip" refsite="crank" kp="1"/></actuator>',
        _CLOTH + _MOVED_BY_JOINT,
    ],
)
def test_the_robot_is_what_actuators_move(more: str) -> None:
    """Any transmission counts; the robot includes fixed bodies that carry it, but no objects."""
    assert _robot(_model(more)) == _ROBOT


@pytest.mark.parametrize(
    ("coupling", "also"),
    [
        ('<joint joint1="door" joint2="arm"/>', ["door"]),
        ('<joint joint1="door" joint2="arm" active="false"/>', []),
        ('<joint joint1="door"/>', []),
        ('<connect body1="arm" body2="door" anchor="0 0 0"/>', ["door"]),
        ('<weld site1="tip" site2="knob"/>', ["door"]),
        ('<weld body1="ball" body2="door"/>', []),
        ('<weld body1="ball" body2="door"/><weld body1="door" body2="arm"/>', ["ball", "door"]),
        ('<tendon tendon1="one" tendon2="other"/>', ["door"]),
    ],
)
def test_what_an_equality_couples_to_the_robot_is_part_of_it(
    coupling: str, also: list[str]
) -> None:
    """The coupling may be direct, as for a second finger, or through a third body."""
    tendons = "".join(
        f'<fixed name="{name}"><joint joint="{joint}" coef="1"/></fixed>'
        for name, joint in (("one", "arm"), ("other", "door"))
    )
    model = _model(f"<tendon>{tendons}</tendon><equality>{coupling}</equality>{_MOVED_BY_JOINT}")
    assert set(_robot(model)) == {*_ROBOT, *also}


def test_without_actuators_every_tree_is_part_of_the_robot() -> None:
    """Motors may be added to such a model later. Neither the world nor a fixed table is part."""
    assert _robot(_model("")) == ["ball", "door", "base", "arm"]


def test_the_trunk_is_the_tree_that_most_actuators_move() -> None:
    """The trunk is neither a ball without actuators nor a robot with fewer motors."""
    assert travelling_body(_model(_MOVED_BY_JOINT)) is None
    assert trunk_lift(_model(_MOVED_BY_JOINT)) is None
    model = _model(
        '<actuator><motor site="tip"/><adhesion body="ball" ctrlrange="0 1"/></actuator>'
    )
    assert model.body(travelling_body(model)).name == "ball"
    assert moved_trees(model)[0] == model.body_treeid[model.body("ball").id]
    drones = """
    <mujoco><worldbody>
      <body name="tug"><freejoint/><geom size=".1"/><site name="tug"/></body>
      <body name="drone"><freejoint/><geom size=".1"/><site name="left"/><site name="right"/></body>
    </worldbody><actuator><motor site="tug"/><motor site="left"/><motor site="right"/></actuator>
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(drones)
    assert model.body(travelling_body(model)).name == "drone"


_WALKER = xml("walker")


def test_objects_neither_carry_the_robot_nor_move() -> None:
    """Standing height, start, mass and limbs depend only on the robot."""
    model = mujoco.MjModel.from_xml_string(_WALKER)
    rules = StartRules(model)
    start = start_pose(model)
    trunk, low, flap = (
        int(model.joint(int(model.body(name).jntadr[0])).qposadr[0])
        for name in ("trunk", "low", "flap")
    )
    assert start[flap] == 0.0
    assert start[low + 2] == -0.2
    leg_only = np.cos(0.1) * 0.4 + 0.05
    assert start[trunk + 2] == pytest.approx(leg_only)
    assert standing_height(model, start) == pytest.approx(leg_only)
    drawn = start + 0.3
    feasible = rules.feasible(drawn, mujoco.MjData(model))
    np.testing.assert_array_equal(feasible[[low, flap]], drawn[[low, flap]])
    assert rules.robot_places.sum() == 8
    assert rules.robot_dofs.sum() == 7
    assert [limb.joint for limb in tree_of(model, start).limbs] == ["leg"]
    assert tree_of(model, start).trunk == ("trunk",)
    spec = mujoco.MjSpec.from_string(_WALKER)
    heavier = reshape(spec, [TotalMass(6.0)]).compile()
    assert heavier.body("trunk").mass[0] + heavier.body("leg").mass[0] == pytest.approx(6.0)
    assert heavier.body("low").mass[0] == pytest.approx(7.0)


def test_a_joint_that_its_damping_locks_is_at_rest() -> None:
    locked = _WALKER.replace('name="leg" axis', 'name="leg" damping="1e11" axis')
    rules = StartRules(mujoco.MjModel.from_xml_string(locked))
    assert rules.robot_dofs.sum() == 6


@pytest.mark.parametrize(("floor", "height"), [('pos="0 0 -.7"', -0.7), ('contype="0"', 0.0)])
def test_the_floor_need_not_be_at_zero(floor: str, height: float) -> None:
    """The floor's height is 0 if there is no floor that the robot can touch."""
    text = _WALKER.replace('size="9 9 1"/>', f'size="9 9 1" {floor} conaffinity="0"/>')
    text = text.replace('conaffinity="0"', "") if "pos" in floor else text
    model = mujoco.MjModel.from_xml_string(text)
    assert floor_height(model, start_pose(model)) == pytest.approx(height)


def test_large_models_have_dense_jacobians_on_mujoco_4_0_0() -> None:
    """In this version, Newton's solver factorises a wrong Hessian from 60 degrees of freedom on."""
    spec = mujoco.MjSpec()
    body = spec.worldbody
    for i in range(61):
        body = body.add_body(name=f"link{i}", pos=[0.0, 0.0, 0.1])
        body.add_joint(name=f"joint{i}", axis=[0.0, 1.0, 0.0])
        body.add_geom(size=[0.02, 0.02, 0.02])
    assert mujoco.mj_isSparse(spec.copy().compile())
    sparse = mujoco.mj_isSparse(compile_body(spec))
    assert sparse == (mujoco.__version__ != "4.0.0")
