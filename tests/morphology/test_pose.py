"""Poses that follow from a body."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.bodies.ant import ANT
from shapechanger.morphology import JointRange, StartHeight, Stretch
from shapechanger.morphology.pose import (
    Lift,
    StartRules,
    standing_height,
    start_pose,
    trunk_joint,
    trunk_lift,
)
from tests.morphology.models import ant, built, gantry, leg, pendulum, posed, spec_of

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
    """A ball of 20 cm whose middle is 1 m up."""
    return built(spec_of(_BALL.format(floor=floor, ball=ball)))


@pytest.mark.parametrize(
    ("floor", "gap"),
    [
        (_PLANE, 0.5),
        ('<geom type="hfield" hfield="hill"/>', 0.8),
        (f'{_PLANE}<geom type="plane" size="1 1 1" pos="0 0 .5"/>', 0.3),
        (f'<body name="stage" pos="0 0 .1">{_PLANE}</body>', 0.4),
        # A table is no floor, and no part of the body that stands on it.
        (f'{_PLANE}<body><geom type="box" size="1 1 .1" pos="5 0 .2"/></body>', 0.5),
        (f'{_PLANE}<geom type="box" size="1 1 .1" pos="0 0 .6"/>', 0.5),
        ('<geom type="plane" size="1 1 1" pos="0 0 1.1"/>', -0.3),
    ],
)
def test_the_floor_is_what_lies_below(floor: str, gap: float) -> None:
    """Every plane and height field that is fixed to the world; the highest counts."""
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
def test_what_does_not_touch_is_no_floor(floor: str, ball: str) -> None:
    """Then there is nothing to stand on, and no height to stand at."""
    model = _ball(floor, ball)
    assert StartRules(model).floor_gap(posed(model)) == 1000.0
    assert standing_height(model) is None
    np.testing.assert_array_equal(start_pose(model), model.qpos0)


def test_either_side_may_allow_the_contact() -> None:
    """MuJoCo lets two geoms touch if one of them is willing."""
    for ball in ('contype="1" conaffinity="0"', 'contype="0" conaffinity="1"'):
        assert standing_height(_ball(_PLANE, ball)) == pytest.approx(0.5)


def test_what_is_fixed_to_the_world_does_not_stand() -> None:
    """It has no trunk that is free, and starts where its joints are."""
    for spec in (pendulum(), gantry()):
        model = built(spec)
        assert trunk_joint(model) is None
        assert standing_height(model) is None
    assert trunk_joint(built(leg())) == 0


def test_the_trunk_is_the_first_free_joint() -> None:
    """Also where other joints come before it."""
    model = built(
        spec_of(
            """<mujoco><worldbody><body><joint name="door"/><geom size=".1"/></body>
            <body><freejoint name="root"/><geom size=".1"/></body>
            <body><freejoint name="ball"/><geom size=".1"/></body></worldbody></mujoco>"""
        )
    )
    assert trunk_joint(model) == 1


@pytest.mark.parametrize(
    ("body", "height"),
    [("Ant", 0.513), ("BigAnt", 0.947), ("ExtendedAnt", 1.292), ("ExtendedAntPassive", 1.292)],
)
def test_standing_heights_of_the_ants(body: str, height: float) -> None:
    """Each joint in the middle of its range, the lowest point on the floor, in metres."""
    model = built(ant(), *ANT.bodies[body])
    assert standing_height(model) == pytest.approx(height, abs=1e-3)


def test_the_standing_height_does_not_depend_on_the_start() -> None:
    """It is a property of the body, not of where the model begins."""
    heights = [standing_height(built(ant(), StartHeight("torso", z))) for z in (-3.0, 0.75, 40.0)]
    assert heights == pytest.approx([heights[0]] * 3)


def test_a_body_starts_inside_its_limits() -> None:
    """By a tenth of the range, and no farther from the model's pose than that takes."""
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
    """The trunk is raised as far as the feet need and not lowered."""
    model = built(ant(), *ANT.bodies[body], Stretch("shank_*", factor))
    pose = start_pose(model)
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    gap = StartRules(model).floor_gap(data)
    assert gap >= -1e-6
    assert pose[2] == model.qpos0[2] or gap == pytest.approx(0.0, abs=1e-6)
    assert pose[2] >= model.qpos0[2]


def test_a_body_that_starts_high_starts_there() -> None:
    """It falls, as its model says."""
    model = built(leg(), StartHeight("trunk", 5.0))
    assert start_pose(model)[2] == 5.0


def test_a_pose_is_moved_inside_the_limits() -> None:
    """Hinges and slides to the nearest limit; what has none, and the pose given, stay."""
    model = built(leg(), JointRange("hip", -0.5, 0.5))
    pose = model.qpos0 + 7.0
    inside = StartRules(model).keep_within_limits(pose)
    np.testing.assert_array_equal(inside[:7], pose[:7])
    np.testing.assert_allclose(inside[7:], [0.5, 0.0])
    np.testing.assert_array_equal(pose, model.qpos0 + 7.0)
    free = built(gantry())
    far = np.array([5.0, -5.0, 9.0, 9.0, 5.0])
    np.testing.assert_allclose(StartRules(free).keep_within_limits(far), [2.0, -1.0, 9.0, 9.0, 2.0])


def test_a_body_without_joints_has_a_pose() -> None:
    """An empty one."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    assert (
        start_pose(model).shape == StartRules(model).keep_within_limits(np.zeros(0)).shape == (0,)
    )
    assert standing_height(model) is None


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


def _hopper(
    height: float = 1.0,
    axis: str = "0 0 1",
    ref: float = 0.0,
    turn: str = "0 0 0",
    limits: str = "",
) -> mujoco.MjModel:
    """A ball with a foot half a metre below, on a rail and a slide."""
    text = _HOPPER.format(height=height, axis=axis, ref=ref, turn=turn, limits=limits)
    return built(spec_of(text))


@pytest.mark.parametrize(
    ("axis", "ref", "turn", "lift"),
    [
        ("0 0 1", 0.0, "0 0 0", Lift(1, 1.0, 1.0)),
        ("0 0 3", 1.0, "0 0 0", Lift(1, 1.0, 0.0)),
        ("0 0 -1", 0.25, "0 0 0", Lift(1, -1.0, 1.25)),
        # The axis is the body's own.
        ("0 1 0", 0.0, "90 0 0", Lift(1, 1.0, 1.0)),
        ("0 0 1", 0.0, "180 0 0", Lift(1, -1.0, 1.0)),
    ],
)
def test_a_slide_raises_a_trunk(axis: str, ref: float, turn: str, lift: Lift) -> None:
    """Whichever way it points, and wherever it counts from."""
    model = _hopper(axis=axis, ref=ref, turn=turn)
    found = trunk_lift(model)
    assert found is not None
    assert found == pytest.approx(lift, abs=1e-12)
    pose = model.qpos0.copy()
    found.raise_by(pose, 0.5)
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    assert data.body("torso").xpos[2] == pytest.approx(found.height(pose)) == pytest.approx(1.5)
    assert found.number_at(1.5) == pytest.approx(pose[found.place])


@pytest.mark.parametrize(
    ("axis", "limits"),
    [("0 1 0", ""), ("0 .1 1", ""), ("0 0 1", 'range="-1 1"')],
    ids=["flat", "aslant", "a hoist"],
)
def test_other_slides_raise_nothing(axis: str, limits: str) -> None:
    """Then the body stays where its model puts it."""
    model = _hopper(height=0.1, axis=axis, limits=limits)
    assert trunk_lift(model) is None
    assert standing_height(model) is None
    assert start_pose(model)[1] == model.qpos0[1]


def test_a_free_trunk_raises_itself() -> None:
    """By its third number, which is its height."""
    assert trunk_lift(built(leg())) == Lift(2, 1.0, 0.0)
    for spec in (pendulum(), gantry()):
        assert trunk_lift(built(spec)) is None


@pytest.mark.parametrize("axis", ["0 0 1", "0 0 -1"])
def test_feet_on_a_slide_start_on_the_floor(axis: str) -> None:
    """Raised, not lowered; at the height at which the body stands in that pose."""
    for height in (0.1, 1.0, 9.0):
        model = _hopper(height=height, axis=axis, ref=0.3)
        pose, lift = start_pose(model), trunk_lift(model)
        assert lift is not None
        stands = standing_height(model, pose)
        assert stands is not None
        assert lift.height(pose) == pytest.approx(max(height, stands))


def test_a_start_may_be_at_the_limits() -> None:
    """A joint that the model puts beyond is moved as far inside as is asked for."""
    model = _hopper()
    place = model.joint("leg").qposadr[0]
    starts = [np.rad2deg(start_pose(model, inside)[place]) for inside in (0.0, 0.1, 0.5)]
    assert starts == pytest.approx([-30.0, -42.0, -90.0])
