"""A user's robots in their scenes: objects, floors and couplings; and copies of their envs."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

import shapechanger
from shapechanger.errors import TaskError
from shapechanger.morphology import AddMotor
from shapechanger.morphology.pose import floor_height
from tests.envs.own_robots import DOG
from tests.models import xml

_BALL = '<body name="ball" pos="3 0 .1"><freejoint/><geom size=".1" mass=".1"/></body>'
_DOOR = (
    '<body name="door" pos="5 0 1"><joint name="door" axis="0 0 1" range="0 90"/>'
    '<geom type="box" size=".5 .02 1"/></body>'
)
_FLOOR = '<geom name="floor" type="plane" size="20 20 1"/>'
_ARM = xml("arm_own")
_MOTORS = (
    '<actuator><motor joint="arm" ctrlrange="-30 30"/>'
    '<position joint="left" kp="10" ctrlrange="0 .04"/></actuator>'
)


def still(robot: Any) -> dict[str, float]:
    del robot
    return {"still": 0.0}


def _env(folder: Path, text: str, task: Any = "walk", **more: Any) -> tuple[Any, Any]:
    file = folder / "robot.xml"
    file.write_text(text)
    env = shapechanger.from_mjcf(file, task, **more)
    return env, env.unwrapped


@pytest.mark.parametrize("first", [True, False])
def test_objects_change_nothing_of_the_robot(tmp_path: Path, first: bool) -> None:
    """Objects before or after the robot change neither its trunk, height, starts nor rewards.

    Objects start as written. The file has no keyframe, because it would depend on all joints.
    """
    dog = DOG[: DOG.index("  <keyframe>")] + "</mujoco>"
    objects = _BALL + _DOOR
    place = _FLOOR if first else "</worldbody>"
    scene = dog.replace(place, place + objects if first else objects + place)
    alone, plain = _env(tmp_path, dog)
    among, inner = _env(tmp_path, scene)
    assert inner.standing_height == plain.standing_height
    for seed in range(3):
        alone.reset(seed=seed)
        among.reset(seed=seed)
        for name in ("trunk", "front", "back"):
            np.testing.assert_array_equal(plain.data.body(name).xpos, inner.data.body(name).xpos)
            np.testing.assert_array_equal(plain.data.body(name).cvel, inner.data.body(name).cvel)
        np.testing.assert_allclose(inner.data.body("ball").xpos, [3.0, 0.0, 0.1])
        assert inner.data.joint("door").qpos[0] == 0.0
    for _ in range(5):
        results = [env.step(np.zeros(2)) for env in (alone, among)]
        assert results[0][1] == pytest.approx(results[1][1])
    assert "ball/x" in inner.observation_layout.names
    assert "trunk/x" not in inner.observation_layout.names


@pytest.mark.parametrize("height", [-1.0, 2.0])
def test_the_floor_may_be_anywhere(tmp_path: Path, height: float) -> None:
    """Heights are measured from the floor, so a robot on a high floor can fall too."""
    moved = DOG.replace(_FLOOR, _FLOOR.replace("/>", f' pos="0 0 {height}"/>'))
    moved = moved.replace(
        'key name="home" qpos="0 0 .47', f'key name="home" qpos="0 0 {height + 0.47}'
    )
    _, plain = _env(tmp_path, DOG)
    env, inner = _env(tmp_path, moved)
    assert inner.standing_height == pytest.approx(plain.standing_height, abs=1e-6)
    assert floor_height(inner.model, inner.init_qpos) == pytest.approx(height)
    env.reset(seed=0)
    for share, stands in ((0.5, True), (0.3, False)):
        inner.data.qpos[2] = height + share * inner.standing_height
        mujoco.mj_kinematics(inner.model, inner.data)
        robot = inner.seen(np.zeros(2), inner.trunk_place())
        assert robot.height == pytest.approx(share * inner.standing_height)
        assert inner.task.healthy(robot) == stands


def test_range_finders_see_all_planes(tmp_path: Path) -> None:
    """The env makes no plane transparent, so its sensors give the values of the plain model."""
    sensor = '<sensor><rangefinder site="eye"/></sensor></mujoco>'
    eye = '<site name="eye" pos=".3 0 .3" zaxis="0 0 -1"/>'
    for material in ("", 'rgba="1 1 1 0"', 'material="tiles"', 'material="tiles" rgba="0 1 0 0"'):
        floor = f'<geom type="plane" size="5 5 1" {material}/>'
        text = _ARM.format(scene=floor + eye, actuators=_MOTORS).replace("</mujoco>", sensor)
        text = text.replace("<worldbody>", '<asset><material name="tiles"/></asset><worldbody>')
        plain = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(plain)
        env, inner = _env(tmp_path, text, still, reset_noise_scale=0.0)
        env.reset(seed=0)
        data.qpos[:] = inner.data.qpos
        mujoco.mj_forward(plain, data)
        np.testing.assert_array_equal(inner.data.sensordata, data.sensordata, err_msg=material)
        np.testing.assert_array_equal(inner.model.geom_rgba[:, 3], plain.geom_rgba[:, 3])
        env.close()


def test_coupled_fingers_start_coupled_and_followers_get_no_motors(tmp_path: Path) -> None:
    """The robot is an arm on a fixed base, and a box is an object that lies still."""
    box = '<body name="box" pos=".5 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>'
    scene = _FLOOR + box
    env, inner = _env(tmp_path, _ARM.format(scene=scene, actuators=_MOTORS), still)
    widths: set[float] = set()
    for seed in range(20):
        env.reset(seed=seed)
        left, right = (inner.data.joint(name).qpos[0] for name in ("left", "right"))
        assert left == pytest.approx(right, abs=1e-8)
        widths.add(round(float(left), 4))
        np.testing.assert_allclose(inner.data.body("box").xpos, [0.5, 0.0, 0.1])
    assert len(widths) > 5
    env, inner = _env(
        tmp_path, _ARM.format(scene=scene, actuators=""), still, rig=AddMotor("*", 2.0)
    )
    assert inner.action_layout.names == ("arm/motor", "left/motor")
    # `AddMotor` adds a motor to a follower only if it is named.
    named = AddMotor("right", 2.0)
    _, inner = _env(tmp_path, _ARM.format(scene=scene, actuators=""), still, rig=named)
    assert inner.action_layout.names == ("right/motor",)


def test_a_base_that_slides_in_a_plane_can_walk(tmp_path: Path) -> None:
    """`walk` then needs no floor, and a box earlier in the file is not used as the trunk."""
    box = '<body name="box" pos="1 0 .1"><freejoint/><geom size=".1"/></body>'
    text = f"""
    <mujoco><worldbody>{box}
      <body name="base" pos="0 0 .2"><geom type="box" size=".3 .2 .05"/>
        <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
        <joint name="yaw" axis="0 0 1"/></body>
    </worldbody><actuator><velocity joint="x" kv="500" ctrlrange="-2 2"/></actuator></mujoco>"""
    env, inner = _env(tmp_path, text)
    assert inner.standing_height == pytest.approx(0.2)
    env.reset(seed=0)
    for _ in range(50):
        _, _, terminated, _, info = env.step(np.array([2.0]))
        assert not terminated
    assert info["x_velocity"] == pytest.approx(2.0, abs=0.05)
    locked = text.replace(' axis="1 0 0"/>', ' axis="1 0 0" damping="1e11"/>')
    locked = locked.replace(' axis="0 1 0"/>', ' axis="0 1 0" damping="1e11"/>')
    with pytest.raises(TaskError, match="needs a robot that can travel"):
        _env(tmp_path, locked)


def test_a_copy_begins_an_episode_of_its_own(tmp_path: Path) -> None:
    """A copy that was made during an episode must be reset before it steps."""
    env, _ = _env(tmp_path, DOG)
    env.reset(seed=0)
    env.step(np.zeros(2))
    other = copy.deepcopy(env)
    with pytest.raises(gym.error.ResetNeeded, match="OwnRobotEnv has no state yet"):
        other.step(np.zeros(2))
    other.reset(seed=3)
    np.testing.assert_array_equal(other.step(np.zeros(2))[0].shape, (15,))
