"""Poses derived from a body: feet on a floor, joints inside their limits, closed loops."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
from shapechanger.morphology.pose import posed as pose_of
from tests.models import xml
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
    return built(spec_of(_BALL.format(floor=floor, ball=ball)))


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
    """Joints move only as far as needed to be a tenth of their range inside their limits."""
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
    data = pose_of(model, pose)
    gap = StartRules(model).floor_gap(data)
    assert gap >= -1e-6
    assert pose[2] == model.qpos0[2] or gap == pytest.approx(0.0, abs=1e-6)
    assert pose[2] >= model.qpos0[2]


_HOPPER = xml("hopper")


def _hopper(height: float = 1.0, axis: str = "0 0 1", **parts: object) -> mujoco.MjModel:
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
    model = _hopper(axis=axis, ref=ref, turn=turn)
    found = trunk_lift(model)
    assert found is not None
    assert found == pytest.approx(lift, abs=1e-12)
    pose = model.qpos0.copy()
    found.raise_by(pose, 0.5)
    data = pose_of(model, pose)
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
    """A trunk above the floor is lowered, one in the floor is raised, and joints do not move."""
    model = built(ant())
    for height in (2.0, 0.1):
        pose = model.qpos0.copy()
        pose[2] = height
        standing = standing_pose(model, pose)
        data = pose_of(model, standing)
        assert StartRules(model).floor_gap(data) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_array_equal(standing[3:], pose[3:])
        assert pose[2] == height


# A leg whose foot is driven by a rod, on a free trunk, like Cassie's.
_FOUR_BAR = xml("four_bar")
_COUPLED = xml("coupled")


def _gap(model: mujoco.MjModel, pose: np.ndarray) -> float:
    """Return the largest violation of a constraint at a pose as MuJoCo computes it, m or rad."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return float(np.abs(data.efc_pos[: data.ne]).max())


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@given(seed=st.integers(0, 1000), scale=st.sampled_from([0.05, 0.3]))
def test_a_drawn_start_closes_loops(jacobian: str, seed: int, scale: float) -> None:
    model = mujoco.MjModel.from_xml_string(_FOUR_BAR.format(jacobian=jacobian))
    data, rules = mujoco.MjData(model), StartRules(model)
    start = start_pose(model)
    rng = np.random.default_rng(seed)
    drawn = start + rng.uniform(-scale, scale, model.nq)
    pose = rules.feasible(drawn, data, start)
    assert _gap(model, pose) < 1e-4
    assert np.abs(pose[[7, 9]]).max() <= 1.0
    np.testing.assert_array_equal(pose, rules.feasible(drawn, data, start))
    velocity = rules.still(pose, rng.standard_normal(model.nv), data)
    moved = pose.copy()
    mujoco.mj_integratePos(model, moved, velocity, 1e-6)
    assert abs(_gap(model, moved) - _gap(model, pose)) < 1e-9


@given(
    coefficients=st.tuples(st.floats(-0.3, 0.3), *[st.floats(-2.0, 2.0)] * 2),
    low=st.sampled_from([-3.0, -0.5]),
    drawn=st.tuples(*[st.floats(-1.5, 1.5)] * 3),
)
def test_coupled_joints_start_coupled(
    coefficients: tuple[float, float, float], low: float, drawn: tuple[float, float, float]
) -> None:
    """The pose follows the polynomials, also in a chain, inside the limits.

    If that is impossible, the couplings are violated no more than in the file.
    """
    text = " ".join(map(str, (*coefficients, 0.0, 0.0)))
    model = mujoco.MjModel.from_xml_string(_COUPLED.format(low=low, high=3.0, coefficients=text))
    rules, start = StartRules(model), start_pose(model)
    pose = rules.feasible(np.array(drawn), mujoco.MjData(model), start)
    assert _gap(model, pose) <= max(1e-4, _gap(model, start))
    assert _gap(model, start) <= max(1e-4, _gap(model, model.qpos0))
    assert -1.0 <= pose[0] <= 1.0
    assert low <= pose[1] <= 3.0


def test_a_start_that_cannot_be_closed_is_the_files_own() -> None:
    """Neither the drawn pose nor nearer ones close: damping locks a joint that must be 0."""
    text = _COUPLED.format(low=-3, high=3, coefficients="0 1 0 0 0").replace(
        'name="follow"', 'name="follow" damping="1e11"'
    )
    text = text.replace("</equality>", '<joint joint1="follow"/></equality>')
    model = mujoco.MjModel.from_xml_string(text)
    start = np.zeros(3)
    pose = StartRules(model).feasible(np.array([0.4, 0.5, 0.1]), mujoco.MjData(model), start)
    np.testing.assert_array_equal(pose, start)


def test_a_joint_at_its_limit_leaves_the_step_to_others() -> None:
    """The leader is at its upper limit and stays there; only the joints that follow it move."""
    text = _COUPLED.format(low=-3, high=3, coefficients="0 1 0 0 0")
    model = mujoco.MjModel.from_xml_string(text)
    pose = StartRules(model).feasible(np.array([1.0, 2.5, -1.25]), mujoco.MjData(model))
    np.testing.assert_allclose(pose, [1.0, 1.0, -0.5], atol=1e-8)


def test_inactive_equalities_close_nothing() -> None:
    text = _COUPLED.format(low=-3, high=3, coefficients="0 1 0 0 0").replace(
        "<joint joint1", '<joint active="false" joint1'
    )
    model = mujoco.MjModel.from_xml_string(text)
    rules, drawn = StartRules(model), np.array([0.5, -0.4, 0.3])
    np.testing.assert_array_equal(rules.feasible(drawn, mujoco.MjData(model)), drawn)
    speed = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(rules.still(drawn, speed, mujoco.MjData(model)), speed)


@pytest.mark.parametrize(("limits", "gap_m"), [("-65 -10", 0.0), ("10 90", 0.0227)])
def test_a_file_that_starts_outside_its_limits_starts_inside(limits: str, gap_m: float) -> None:
    """The loop is closed with the elbow bent to the other side, or as well as the limits allow."""
    model = mujoco.MjModel.from_xml_string(
        f"""
        <mujoco><worldbody>
          <body name="hand" mocap="true"/>
          <body><joint name="shoulder" axis="0 1 0" range="-90 90"/>
            <geom type="capsule" fromto="0 0 0 .5 0 0" size=".02"/>
            <body name="lower" pos=".5 0 0" euler="0 30 0">
              <joint name="elbow" axis="0 1 0" range="{limits}"/>
              <geom type="capsule" fromto="0 0 0 .4 0 0" size=".02"/></body></body>
        </worldbody>
        <equality><connect body1="lower" body2="hand" anchor=".4 0 0"/></equality>
        <actuator><motor joint="elbow" ctrlrange="-1 1"/></actuator></mujoco>"""
    )
    rules, start, data = StartRules(model), start_pose(model), mujoco.MjData(model)
    for pose in (start, rules.feasible(start + 0.02, data, start)):
        assert np.all(rules.lowest <= pose)
        assert np.all(pose <= rules.highest)
        assert _gap(model, pose) <= gap_m + 1e-4
