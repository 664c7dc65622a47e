"""Edits that give a robot motors, freedom and a floor."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    AddMotor,
    Mass,
    StartHeight,
    compile_body,
    reshape,
)
from tests.morphology.models import built, leg, spec_of

# An arm of two joints on a base, as URDF: the second joint states no effort.
URDF = """
<robot name="arm">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size=".2 .2 .2"/></geometry></collision></link>
  <link name="upper"><inertial><mass value="1"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><mass value="1"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="7" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 .3"/><axis xyz="0 1 0"/></joint>
</robot>
"""


def urdf() -> mujoco.MjSpec:
    return spec_of(URDF)


def test_motors_are_as_strong_as_the_model_allows() -> None:
    """The effort of a URDF is the gear; others need one."""
    model = built(urdf(), AddMotor("shoulder"), AddMotor("elbow", 3.0))
    assert [model.actuator(i).name for i in range(model.nu)] == ["shoulder", "elbow"]
    np.testing.assert_array_equal(model.actuator_gear[:, 0], [7.0, 3.0])
    np.testing.assert_array_equal(model.actuator_ctrlrange, [[-1.0, 1.0]] * 2)
    with pytest.raises(MorphologyError, match="no largest torque or force of 'elbow': give a gear"):
        reshape(urdf(), [AddMotor("*")])
    half = built(urdf(), AddMotor("shoulder", amount=0.5))
    assert half.actuator_gear[0, 0] == 3.5


def test_a_joint_gets_one_motor() -> None:
    """A glob leaves joints with a motor as they are; nothing to do is refused."""
    model = built(urdf(), AddMotor("elbow", 3.0), AddMotor("*", 5.0))
    np.testing.assert_array_equal(model.actuator_gear[:, 0], [3.0, 5.0])
    with pytest.raises(MorphologyError, match=r"matches '\*' has a motor, or none matches"):
        reshape(leg(), [AddMotor("*")])
    with pytest.raises(UnknownName, match="Did you mean 'elbow'"):
        reshape(urdf(), [AddMotor("elbw")])


def test_a_motor_of_something_else_is_no_motor_of_the_joint() -> None:
    """A tendon and a joint may share a name."""
    spec = spec_of(
        """
        <mujoco><worldbody>
          <body><joint name="pull" axis="0 1 0"/><geom size=".1"/></body></worldbody>
        <tendon><fixed name="pull"><joint joint="pull" coef="1"/></fixed></tendon>
        <actuator><motor name="muscle" tendon="pull"/></actuator></mujoco>"""
    )
    assert built(spec, AddMotor("*", 2.0)).nu == 2


def test_a_fixed_robot_is_set_free() -> None:
    """It falls with its whole mass, although MuJoCo merges a URDF's base with the world."""
    fixed = built(urdf())
    assert (fixed.nq, fixed.body_mass[0]) == (2, 0.0)
    free = compile_body(
        urdf(), (AddFreeJoint("base"), StartHeight("base", 0.5), Mass("base", scale=2.0))
    )
    assert (free.nq, free.joint(0).name) == (9, "base_free")
    assert free.body("base").mass == 4.0
    with pytest.raises(MorphologyError, match="'trunk' is not fixed: it has the joint 'root'"):
        reshape(leg(), [AddFreeJoint("trunk")])
    with pytest.raises(UnknownName, match="No trunk matches 'upper'"):
        reshape(urdf(), [AddFreeJoint("upper")])


def test_a_robot_lands_on_its_floor() -> None:
    """The box of 0.2 m comes to rest 0.1 m above it."""
    body = (AddFreeJoint("base"), StartHeight("base", 0.7), AddFloor(friction=0.5, height=0.5))
    model = compile_body(urdf(), body)
    assert model.geom("floor").friction[0] == 0.5
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=500)
    assert data.qpos[2] == pytest.approx(0.6, abs=0.01)
    with pytest.raises(MorphologyError, match="A new geom needs an unused name, got 'floor'"):
        reshape(leg(), [AddFloor()])
