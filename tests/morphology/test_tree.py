"""The kinematic tree of bodies, and the numbers that describe it."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from shapechanger.envs.ant import ANT
from shapechanger.morphology import Body, Cut, Gear, Mass, Stretch, compile_body
from shapechanger.morphology.pose import start_pose
from shapechanger.morphology.tree import LIMB_NUMBERS, TRUNK_NUMBERS, Tree, tree_of

_ARM = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" friction="0.8"/>
    <geom name="base" type="box" size="0.1 0.1 0.1"/>
    <body name="slider" pos="0 0 1">
      <joint name="along" type="slide" axis="1 0 0" range="-1 1" limited="true"/>
      <joint name="around" axis="0 0 1"/>
      <geom type="sphere" size="0.1" mass="2"/>
      <body name="tip" pos="0.5 0 0"><geom type="capsule" size="0.05 0.2" mass="1"/></body>
      <body name="thin" pos="0 0.2 0">
        <joint name="ball" type="ball"/>
        <geom type="sphere" size="0.1" mass="0.0001"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="pull" joint="along" gear="9"/></actuator>
</mujoco>
"""


def _ant(body: Body) -> Tree:
    model = compile_body(ANT.load(_path()), body)
    return tree_of(model, start_pose(model))


def _path() -> str:
    from gymnasium.envs.mujoco import mujoco_env

    return f"{mujoco_env.__file__.rpartition('/')[0]}/assets/ant.xml"


def _number(tree: Tree, joint: str, name: str) -> float:
    limb = next(limb for limb in tree.limbs if limb.joint == joint)
    return limb.numbers[LIMB_NUMBERS.index(name)]


def test_an_ants_tree() -> None:
    """Eight joints with a motor each; parts without joints belong to what carries them."""
    tree = _ant(())
    assert [limb.joint for limb in tree.limbs[:3]] == ["hip_1", "ankle_1", "hip_2"]
    assert {limb.actuator for limb in tree.limbs} == {limb.joint for limb in tree.limbs}
    assert tree.trunk[0] == "torso"
    assert set(tree.trunk[1:]) == {
        "front_left_leg",
        "front_right_leg",
        "back_leg",
        "right_back_leg",
    }
    assert len(tree.numbers) == len(TRUNK_NUMBERS)
    assert {len(limb.numbers) for limb in tree.limbs} == {len(LIMB_NUMBERS)}
    assert _number(tree, "hip_1", "depth") == 1.0
    assert _number(tree, "ankle_1", "depth") == 2.0


def test_numbers_follow_the_edits() -> None:
    """A longer shank ends farther away, a stronger motor and a heavier trunk show, no other."""
    plain, changed = (
        _ant(()),
        _ant((Stretch("shank_1", 2.0), Gear("hip_2", 10.0), Mass("torso", 10.0))),
    )
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
    assert _ant((Cut("shank_1", 0.25),)).limbs[0] != plain.limbs[0]  # It carries less.


def test_vectors_are_in_the_frame_of_the_trunk() -> None:
    """Turning the whole body changes no number of its limbs."""
    model = compile_body(ANT.load(_path()), ())
    pose = start_pose(model)
    turned = pose.copy()
    mujoco.mju_axisAngle2Quat(turned[3:7], np.array([0.0, 0.0, 1.0]), 1.0)
    for one, other in zip(tree_of(model, pose).limbs, tree_of(model, turned).limbs, strict=True):
        np.testing.assert_allclose(one.numbers, other.numbers, atol=1e-9)


def test_a_body_on_the_world() -> None:
    """The trunk is the world; joints of one body share it, and the last one has its parts."""
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
    assert _number(tree, "along", "mass") == -3.0  # Of nothing.
    assert _number(tree, "around", "mass with limbs") == pytest.approx(math.log10(3.0), abs=1e-3)
    # The capsule's end is farther from the joint than the spheres.
    reach = _number(tree, "around", "end x") * _number(tree, "around", "length")
    assert reach == pytest.approx(0.5)
    ball = "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(ball)
    tree = tree_of(model, model.qpos0)
    assert tree.limbs == ()
    assert tree.numbers[TRUNK_NUMBERS.index("friction")] == 1.0  # Without a floor.


_TENDONS = """
<mujoco>
  <worldbody>
    <site name="wall" pos="0.1 0 0.15"/><site name="floor"/>
    <body name="upper"><joint name="shoulder" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/>
      <site name="upper" pos=".03 0 .25"/>
      <body name="lower" pos="0 0 .3"><joint name="elbow" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/>
        <site name="lower" pos=".03 0 .1"/>
        <body name="hand" pos="0 0 .3"><joint name="wrist" axis="0 1 0"/><geom size=".02"/></body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="flex_elbow"><joint joint="elbow" coef="1"/></fixed>
    <fixed name="both"><joint joint="shoulder" coef="-.5"/><joint joint="elbow" coef=".5"/></fixed>
    <fixed name="wrist_most"><joint joint="elbow" coef="1"/><joint joint="wrist" coef="2"/></fixed>
    <spatial name="biceps"><site site="upper"/><site site="lower"/></spatial>
    <spatial name="slack"><site site="wall"/><site site="floor"/></spatial>
  </tendon>
  <actuator>{}</actuator>
</mujoco>
"""


@pytest.mark.parametrize(
    ("actuators", "movers"),
    [
        ('<motor name="e" tendon="flex_elbow"/>', {"elbow": "e"}),
        # Of equal moments, the joint nearer to the trunk.
        ('<motor name="b" tendon="both"/>', {"shoulder": "b"}),
        # A joint with a motor is left to it, wherever the motor stands in the file.
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
    """Ids of tendons, sites and bodies are not taken for those of joints."""
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
    """Its force counts with its moment about the joint."""
    model = mujoco.MjModel.from_xml_string(_TENDONS.format(actuators))
    strength = _number(tree_of(model, np.zeros(model.nq)), "wrist", "strength")
    assert strength == pytest.approx(math.log10(1.0 + torque) / 2.0)
