"""Start poses that satisfy equalities: coupled joints, closed loops and welds."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.morphology.pose import StartRules, start_pose

# A leg whose foot is driven by a rod, on a free trunk, as in Cassie.
_FOUR_BAR = """
<mujoco>
  <compiler angle="radian"/>
  <option jacobian="{jacobian}"/>
  <worldbody>
    <geom type="plane" size="9 9 1"/>
    <body name="trunk" pos="0 0 1"><freejoint/><geom size=".05" mass="3"/>
      <body name="crank"><joint name="crank" axis="0 1 0" range="-1 1"/>
        <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01"/>
        <body name="rod" pos=".1 0 0"><joint name="rod" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".01"/></body></body>
      <body name="shank" pos="0 0 -.3"><joint name="shank" axis="0 1 0" range="-1 1"/>
        <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01"/></body>
    </body>
  </worldbody>
  <equality><connect body1="rod" body2="shank" anchor="0 0 -.3"/></equality>
  <actuator><motor joint="crank" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
_COUPLED = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body><joint name="lead" axis="0 1 0" range="-1 1"/><geom size=".1"/></body>
    <body pos="1 0 0"><joint name="follow" axis="0 1 0" range="{low} {high}"/>
      <geom size=".1"/></body>
    <body pos="2 0 0"><joint name="last" type="slide" range="-2 2"/><geom size=".1"/></body>
  </worldbody>
  <equality>
    <joint joint1="follow" joint2="lead" polycoef="{coefficients}"/>
    <joint joint1="last" joint2="follow" polycoef="0 -.5 0 0 0"/>
  </equality>
  <actuator><motor joint="lead" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


def _gap(model: mujoco.MjModel, pose: np.ndarray) -> float:
    """Return the largest violation of a constraint at a pose as MuJoCo computes it, m or rad."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    return float(np.abs(data.efc_pos[: data.ne]).max())


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@given(seed=st.integers(0, 1000), scale=st.sampled_from([0.05, 0.3]))
def test_a_drawn_start_closes_loops(jacobian: str, seed: int, scale: float) -> None:
    """Inside the limits; velocities open no loop, and the trunk stands above the floor."""
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
    """By their polynomial, also in a chain, and inside the limits; or as well as the file does."""
    text = " ".join(map(str, (*coefficients, 0.0, 0.0)))
    model = mujoco.MjModel.from_xml_string(_COUPLED.format(low=low, high=3.0, coefficients=text))
    rules, start = StartRules(model), start_pose(model)
    pose = rules.feasible(np.array(drawn), mujoco.MjData(model), start)
    assert _gap(model, pose) <= max(1e-4, _gap(model, start))
    assert _gap(model, start) <= max(1e-4, _gap(model, model.qpos0))
    assert -1.0 <= pose[0] <= 1.0
    assert low <= pose[1] <= 3.0


def test_a_start_that_cannot_be_closed_is_the_files_own() -> None:
    """Smaller deviations are tried before; here a joint that its damping locks keeps its noise."""
    text = _COUPLED.format(low=-3, high=3, coefficients="0 1 0 0 0").replace(
        'name="follow"', 'name="follow" damping="1e11"'
    )
    text = text.replace("</equality>", '<joint joint1="follow"/></equality>')
    model = mujoco.MjModel.from_xml_string(text)
    start = np.zeros(3)
    pose = StartRules(model).feasible(np.array([0.4, 0.5, 0.1]), mujoco.MjData(model), start)
    np.testing.assert_array_equal(pose, start)


def test_a_joint_at_its_limit_leaves_the_step_to_others() -> None:
    """The leader cannot go up any more, so the follower comes down to it."""
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
    """Closed, with the elbow bent to its other side; or as closed as its limits allow."""
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
