"""Joint ranges, locked joints, motors and freedom."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    AddFreeJoint,
    AddMotor,
    JointRange,
    Lock,
    Mass,
    StartHeight,
    compile_body,
    reshape,
)
from tests.morphology.models import (
    URDF,
    built,
    gantry,
    leg,
    limb,
    spec_of,
    tip,
)


def _range(model: mujoco.MjModel, joint: str) -> list[float]:
    return model.joint(joint).range.tolist()


@pytest.mark.parametrize("degrees", range(-180, 181, 6))
def test_degrees_are_exact(degrees: int) -> None:
    """Limits of whole degrees equal bitwise those of a file in degrees."""
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
    for edit, angle in (
        (Lock("knee"), math.radians(-45.0)),
        (Lock("knee", 0.0), 0.0),
        (Lock("knee", -1.2), -1.2),
    ):
        locked = built(leg(), edit)
        np.testing.assert_allclose(tip(locked, "toe"), tip(free, "toe", {"knee": angle}))
    model = built(limb('<geom size=".1"/>'), Lock("link"))
    np.testing.assert_allclose(model.body("link").quat, [1.0, 0.0, 0.0, 0.0])


def test_a_slide_without_limits_is_locked_at_a_position() -> None:
    assert built(gantry(), Lock("y", 0.3)).njnt == 4
    half = built(gantry(), Lock("y", 0.3).partly(0.5))
    assert _range(half, "y") == pytest.approx([0.3 - 1.0, 0.3 + 1.0])


# --- Motors and freedom ------------------------------------------------------------------------


def test_motors_are_as_strong_as_the_model_allows() -> None:
    """The effort of a URDF is the gear; others need one."""
    model = built(spec_of(URDF), AddMotor("shoulder"), AddMotor("elbow", 3.0))
    assert [model.actuator(i).name for i in range(model.nu)] == ["shoulder", "elbow"]
    np.testing.assert_array_equal(model.actuator_gear[:, 0], [7.0, 3.0])
    np.testing.assert_array_equal(model.actuator_ctrlrange, [[-1.0, 1.0]] * 2)
    with pytest.raises(MorphologyError, match="no largest torque or force of 'elbow': give a gear"):
        reshape(spec_of(URDF), [AddMotor("*")])
    half = built(spec_of(URDF), AddMotor("shoulder", amount=0.5))
    assert half.actuator_gear[0, 0] == 3.5


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
    fixed = built(spec_of(URDF))
    assert (fixed.nq, fixed.body_mass[0]) == (2, 0.0)
    free = compile_body(
        spec_of(URDF), (AddFreeJoint("base"), StartHeight("base", 0.5), Mass("base", scale=2.0))
    )
    assert (free.nq, free.joint(0).name) == (9, "base_free")
    assert free.body("base").mass == 4.0
