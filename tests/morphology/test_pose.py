"""Poses derived from a body."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.envs.ant import ANT
from shapechanger.morphology import Stretch
from shapechanger.morphology.pose import (
    Lift,
    StartRules,
    standing_height,
    standing_pose,
    start_pose,
    trunk_lift,
)
from tests.morphology.models import ant, built, posed, spec_of

_BALL = """
<mujoco>
  <asset><hfield name="hill" nrow="2" ncol="2" size="9 9 .1 .1" elevation="0 0 0 0"/></asset>
  <worldbody>
    {floor}
    <body name="ball" pos="0 0 1"><freejoint/><geom name="ball" size=".2" {ball}/></body>
  </worldbody>
</mujoco>
"""
_PLANE = '<geom type="plane" size="1 1 1" pos="0 0 .3"/>'


def _ball(floor: str, ball: str = "") -> mujoco.MjModel:
    """Return a ball of 20 cm radius with its centre 1 m above the origin."""
    return built(spec_of(_BALL.format(floor=floor, ball=ball)))


def _at(model: mujoco.MjModel, pose: np.ndarray) -> mujoco.MjData:
    """Return the kinematics of a pose."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    return data


@pytest.mark.parametrize(
    ("floor", "gap"),
    [
        (_PLANE, 0.5),
        ('<geom type="hfield" hfield="hill"/>', 0.8),
        (f'{_PLANE}<geom type="plane" size="1 1 1" pos="0 0 .5"/>', 0.3),
        (f'<body name="stage" pos="0 0 .1">{_PLANE}</body>', 0.4),
        # Boxes, static or on bodies, are no floor.
        (f'{_PLANE}<body><geom type="box" size="1 1 .1" pos="5 0 .2"/></body>', 0.5),
        (f'{_PLANE}<geom type="box" size="1 1 .1" pos="0 0 .6"/>', 0.5),
        ('<geom type="plane" size="1 1 1" pos="0 0 1.1"/>', -0.3),
    ],
)
def test_the_floor_is_the_highest_static_plane(floor: str, gap: float) -> None:
    """Static planes and height fields count, the highest one wins."""
    model = _ball(floor)
    assert StartRules(model).floor_gap(posed(model)) == pytest.approx(gap)
    assert standing_height(model) == pytest.approx(1.0 - gap)


@pytest.mark.parametrize(
    ("floor", "ball"),
    [
        ("", ""),
        ('<geom type="plane" size="1 1 1" contype="0" conaffinity="0"/>', ""),
        (_PLANE, 'contype="0" conaffinity="0"'),
        (_PLANE, 'contype="2" conaffinity="2"'),
    ],
)
def test_geoms_without_contact_are_no_floor(floor: str, ball: str) -> None:
    model = _ball(floor, ball)
    assert StartRules(model).floor_gap(posed(model)) == 1000.0
    assert standing_height(model) is None
    np.testing.assert_array_equal(start_pose(model), model.qpos0)


def test_a_body_starts_inside_its_limits() -> None:
    """Joints move by the least amount to be a tenth of the range inside."""
    model = built(ant())
    pose = start_pose(model)
    for joint in range(1, model.njnt):
        lower, upper = model.jnt_range[joint]
        angle, written = pose[model.jnt_qposadr[joint]], model.qpos0[model.jnt_qposadr[joint]]
        inside = 0.1 * (upper - lower)
        assert lower + inside - 1e-12 <= angle <= upper - inside + 1e-12
        if lower + inside <= written <= upper - inside:
            assert angle == written
        else:
            assert min(abs(angle - lower), abs(angle - upper)) == pytest.approx(inside)
    np.testing.assert_array_equal(model.qpos0, built(ant()).qpos0)


@pytest.mark.parametrize("body", ANT.bodies)
@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_no_foot_starts_in_the_floor(body: str, factor: float) -> None:
    """The trunk is raised as far as needed and never lowered."""
    model = built(ant(), *ANT.bodies[body], Stretch("shank_*", factor))
    pose = start_pose(model)
    data = _at(model, pose)
    gap = StartRules(model).floor_gap(data)
    assert gap >= -1e-6
    assert pose[2] == model.qpos0[2] or gap == pytest.approx(0.0, abs=1e-6)
    assert pose[2] >= model.qpos0[2]


_HOPPER = """
<mujoco>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="torso" pos="0 0 {height}" euler="{turn}">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="{axis}" ref="{ref}" {limits}/>
      <geom size=".2"/>
      <body pos="0 0 -.5"><joint name="leg" range="-150 -30" ref="-20"/><geom size=".1"/></body>
    </body>
  </worldbody>
</mujoco>
"""


def _hopper(height: float = 1.0, axis: str = "0 0 1", **parts: object) -> mujoco.MjModel:
    """Return a ball with a foot 0.5 m below it, on two slides."""
    defaults: dict[str, object] = {"ref": 0.0, "turn": "0 0 0", "limits": ""}
    return built(spec_of(_HOPPER.format(height=height, axis=axis, **(defaults | parts))))


@pytest.mark.parametrize(
    ("axis", "ref", "turn", "lift"),
    [
        ("0 0 1", 0.0, "0 0 0", Lift(1, 1.0, 1.0)),
        ("0 0 3", 1.0, "0 0 0", Lift(1, 1.0, 0.0)),
        ("0 0 -1", 0.25, "0 0 0", Lift(1, -1.0, 1.25)),
        # The axis is in the body's frame.
        ("0 1 0", 0.0, "90 0 0", Lift(1, 1.0, 1.0)),
        ("0 0 1", 0.0, "180 0 0", Lift(1, -1.0, 1.0)),
    ],
)
def test_a_slide_raises_a_trunk(axis: str, ref: float, turn: str, lift: Lift) -> None:
    """Direction and reference of a vertical slide are taken into account."""
    model = _hopper(axis=axis, ref=ref, turn=turn)
    found = trunk_lift(model)
    assert found is not None
    assert found == pytest.approx(lift, abs=1e-12)
    pose = model.qpos0.copy()
    found.raise_by(pose, 0.5)
    data = _at(model, pose)
    assert data.body("torso").xpos[2] == pytest.approx(found.height(pose)) == pytest.approx(1.5)
    assert found.number_at(1.5) == pytest.approx(pose[found.place])


@pytest.mark.parametrize(
    ("axis", "limits"),
    [("0 1 0", ""), ("0 .1 1", ""), ("0 0 1", 'range="-1 1"')],
    ids=["horizontal", "oblique", "limited"],
)
def test_other_slides_raise_nothing(axis: str, limits: str) -> None:
    model = _hopper(height=0.1, axis=axis, limits=limits)
    assert trunk_lift(model) is None
    assert standing_height(model) is None
    assert start_pose(model)[1] == model.qpos0[1]


@pytest.mark.parametrize("axis", ["0 0 1", "0 0 -1"])
def test_feet_on_a_slide_start_on_the_floor(axis: str) -> None:
    """The trunk is raised to its standing height and never lowered."""
    for height in (0.1, 1.0, 9.0):
        model = _hopper(height=height, axis=axis, ref=0.3)
        pose, lift = start_pose(model), trunk_lift(model)
        assert lift is not None
        stands = standing_height(model, pose)
        assert stands is not None
        assert lift.height(pose) == pytest.approx(max(height, stands))


def test_a_standing_pose_touches_the_floor() -> None:
    """A trunk that hangs is lowered, one in the floor is raised, and joints keep their places."""
    model = built(ant())
    for height in (2.0, 0.1):
        pose = model.qpos0.copy()
        pose[2] = height
        standing = standing_pose(model, pose)
        data = _at(model, standing)
        assert StartRules(model).floor_gap(data) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_array_equal(standing[3:], pose[3:])
        assert pose[2] == height
