"""Robots and tasks of the user's own."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger
from shapechanger.contract.env_ref import FORWARD_SPEED, RETURN, EnvRef, env_traits
from shapechanger.errors import (
    BrokenModel,
    EmptyShift,
    EnvArgumentError,
    MorphologyError,
    SpaceMismatch,
    TaskError,
    UnknownName,
)
from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    AddLimb,
    AddMotor,
    AddSegment,
    Edit,
    Lock,
    Mass,
    StartHeight,
    Stretch,
)
from tests.envs.own_robots import DOG, Move, Nonsense, Rear
from tests.envs.vector.sameness import play_side_by_side
from tests.morphology.models import URDF

REAR = "tests.envs.own_robots:Rear"


@pytest.fixture
def dog(tmp_path: Path) -> Path:
    path = tmp_path / "dog.xml"
    path.write_text(DOG)
    return path


def _inner(env: gym.Env[Any, Any]) -> Any:
    return env.unwrapped


def test_a_file_gives_names_units_and_rewards(dog: Path) -> None:
    """Names, units and ranges follow from the model; the reward is the sum of its terms."""
    env = shapechanger.from_mjcf(dog)
    inner = _inner(env)
    motor, servo = inner.action_layout
    assert (motor.name, motor.low, motor.high) == ("front/motor", -2.0, 1.0)
    assert (motor.gain, motor.gain_unit) == (30.0, "N·m")
    assert (servo.name, servo.unit, servo.gain, servo.gain_unit) == ("back/target", "rad", 1.0, "")
    assert inner.dt == pytest.approx(0.02)
    assert inner.measures == (FORWARD_SPEED, RETURN)
    env.reset(seed=0)
    before = float(inner.data.qpos[0])
    _, reward, _, _, info = env.step(np.array([1.0, 0.5], np.float32))
    assert info["x_velocity"] == pytest.approx((inner.data.xpos[1, 0] - before) / 0.02, abs=0.05)
    assert info["reward_alive"] == 1.0
    # Scaled to -1 to 1, the action is 1 (1 in the range -2 to 1) and 0.5 (0.5 in -1 to 1).
    assert info["reward_control"] == pytest.approx(-0.1 * (1.0 + 0.25))
    assert reward == sum(info[f"reward_{term}"] for term in ("forward", "alive", "control"))
    with pytest.raises(ValueError, match="finite"):
        env.step(np.array([np.nan, 0.0]))


def test_a_robot_starts_at_home(dog: Path) -> None:
    """The robot starts in the keyframe; an edited body is raised as high as its feet need."""
    env = shapechanger.from_mjcf(dog, reset_noise_scale=0.0)
    env.reset(seed=0)
    np.testing.assert_allclose(_inner(env).data.qpos[7:], [0.2, -0.2])
    height = _inner(env).data.qpos[2]
    env.reset(options={"body": Stretch("front", 2.0)})
    assert _inner(env).data.qpos[2] > height + 0.2
    # The dog stands on its longer leg.
    assert _inner(env).standing_height == pytest.approx(_inner(env).data.qpos[2])


@pytest.mark.parametrize(
    ("body", "angles"),
    [
        (AddSegment("front", "toe", (0.1, 0.0, 0.0), lower=-1.0, upper=0.0), [0.2, -0.1, -0.2]),
        (Lock("front"), [-0.2]),
        (AddLimb("front", "_2", 1.0), [0.2, -0.2, 0.2]),
        (StartHeight("trunk", 1.25), [0.2, -0.2]),
    ],
)
def test_a_home_is_kept_joint_by_joint(dog: Path, body: Edit, angles: list[float]) -> None:
    """The keyframe keeps its angles if edits add or remove joints, and follows a new height."""
    env = shapechanger.from_mjcf(dog, body=body, reset_noise_scale=0.0)
    env.reset(seed=0)
    np.testing.assert_allclose(_inner(env).data.qpos[7:], angles)
    assert (_inner(env).data.qpos[2] == 1.25) == isinstance(body, StartHeight)


def test_without_a_home_joints_start_in_the_models_pose(dog: Path) -> None:
    """Without a keyframe, joints start in the model's own pose."""
    dog.write_text(DOG[: DOG.index("  <keyframe>")] + "</mujoco>")
    env = shapechanger.from_mjcf(dog, reset_noise_scale=0.0)
    env.reset(seed=0)
    np.testing.assert_array_equal(_inner(env).data.qpos[7:], [0.0, 0.0])


def test_a_custom_task(dog: Path) -> None:
    """A custom task names its observations, ends episodes, and has options and measures."""
    env = shapechanger.from_mjcf(dog, Rear, task_options={"weight": 2.0})
    inner = _inner(env)
    assert inner.observation_layout.names[-1] == "front/contact/fz"
    assert "trunk/vx" not in inner.observation_layout.names
    assert inner.measures == Rear.measures
    observation, info = env.reset(seed=0)
    assert list(info) == ["x_position", "y_position"]
    observation, reward, terminated, _, info = env.step(np.zeros(2))
    assert info["reward_height"] == pytest.approx(2.0 * inner.data.xpos[1, 2])
    assert reward == info["reward_height"] + info["reward_servo"]
    assert not terminated
    np.testing.assert_array_equal(observation[-1], inner.data.cfrc_ext[2, 5])
    inner.set_state(np.array([0.0, 0.0, 2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(8))
    assert env.step(np.zeros(2))[2]


def test_a_robot_without_shapes_is_accepted(tmp_path: Path) -> None:
    """The reach of a URDF without shapes is computed from the origins of its links."""
    path = tmp_path / "arm.urdf"
    start, end = URDF.index("<collision>"), URDF.index("</collision>") + len("</collision>")
    path.write_text(URDF[:start] + URDF[end:])
    inner = _inner(shapechanger.from_mjcf(path, Move, rig=AddMotor("*", 1.0)))
    assert inner.model.ngeom == 0
    # The elbow is 0.3 m above base and shoulder.
    assert inner.reach == pytest.approx(0.15)


def test_every_number_can_be_read(dog: Path) -> None:
    inner = _inner(shapechanger.from_mjcf(dog, Rear))
    robot = inner.seen(np.zeros(2), np.zeros(3))
    assert robot["trunk/x"] == inner.data.qpos[0]
    with pytest.raises(UnknownName, match="Did you mean 'front/angle'"):
        robot["front/angel"]


def test_a_robot_is_upright_at_its_start(tmp_path: Path) -> None:
    """A robot is upright at its start even if the frame of its trunk lies on its side."""
    path = tmp_path / "dog.xml"
    path.write_text(DOG.replace('qpos="0 0 .47 1 0 0 0', 'qpos="0 0 .47 .7071 .7071 0 0'))
    inner = _inner(shapechanger.from_mjcf(path, Rear))
    assert inner.seen(np.zeros(2), np.zeros(3)).up == pytest.approx(1.0)


def test_a_diverging_simulation_is_reported(dog: Path) -> None:
    """Divergence ends the episode with a reward of 0, and no error of the task is reported."""
    env = shapechanger.from_mjcf(dog, Nonsense())
    env.reset(seed=0)
    _inner(env).data.qvel[:] = 1e12
    _, reward, terminated, _, info = env.step(np.zeros(2))
    assert (reward, terminated, info["diverged"]) == (0.0, True, True)


def test_a_robot_is_made_again_from_its_spec(dog: Path) -> None:
    """The spec names the task's class, so that it can be JSON and sent to worker processes."""
    env = shapechanger.from_mjcf(dog, Rear, body=Stretch("back", 1.2), max_episode_steps=7)
    assert env.spec is not None
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    copies = [again, pickle.loads(pickle.dumps(_inner(env)))]
    expected = env.reset(seed=3)[0]
    for copy in copies:
        np.testing.assert_array_equal(copy.reset(seed=3)[0], expected)
    assert again.spec is not None
    assert again.spec.max_episode_steps == 7
    assert again.spec.kwargs["task"] == REAR


def test_a_study_makes_the_env_by_id(dog: Path) -> None:
    """All arguments can be JSON; body and rig are lists of objects."""
    edits = [{"edit": "stretch", "body": "front", "factor": 1.5}]
    ref = EnvRef("shapechanger/OwnRobot-v1", {"path": str(dog), "task": REAR, "body": edits})
    with ref.make() as env:
        assert _inner(env).body == (Stretch("front", 1.5),)
        traits = env_traits(env)
    assert traits.family == str(dog)
    assert traits.measures == (*Rear.measures, RETURN)


def test_bodies_change_at_a_reset(dog: Path) -> None:
    env = shapechanger.from_mjcf(dog)
    env.reset(seed=0, options={"body": Mass("trunk", scale=2.0)})
    assert _inner(env).model.body("trunk").mass == 6.0
    env.reset(options={"body": "dog"})
    assert _inner(env).model.body("trunk").mass == 3.0
    with pytest.raises(SpaceMismatch, match="observation space from 15 to 13"):
        env.reset(options={"body": Lock("front")})
    assert _inner(env).model.nq == 9


def test_certificates_name_the_files(dog: Path, tmp_path: Path) -> None:
    """A certificate names the files, and the differences between two bodies or two files."""
    one = shapechanger.from_mjcf(dog)
    other = shapechanger.from_mjcf(dog, body=Stretch("front", 1.5))
    text = str(_inner(one).certify_shift(one, other))
    assert "front: length 0.4123 m -> 0.6185 m (x1.5)" in text
    with pytest.raises(EmptyShift, match="dog and dog behave the same"):
        _inner(one).certify_shift(one, shapechanger.from_mjcf(dog))
    cat = tmp_path / "cat.xml"
    cat.write_text(DOG.replace('mass="3"', 'mass="1"'))
    assert "dog" in str(_inner(one).certify_shift(one, shapechanger.from_mjcf(cat)))


def test_many_at_once_equal_one_by_one(dog: Path) -> None:
    """The vector env equals single envs to the last bit, also after the end of an episode."""
    options: dict[str, Any] = {"path": str(dog), "task": REAR, "max_episode_steps": 5}
    many = shapechanger.make_vec("shapechanger/OwnRobot-v1", 3, threads=2, **options)
    sync = gym.make_vec("shapechanger/OwnRobot-v1", 3, vectorization_mode="sync", **options)
    assert play_side_by_side(many, sync, 12, "NextStep") == 6
    many.close()
    sync.close()


def test_a_urdf_stands_on_a_floor(tmp_path: Path) -> None:
    """The rig adds motors, a free joint and a floor."""
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    rig = (AddMotor("*", 2.0), AddFreeJoint("base"), AddFloor())
    env = shapechanger.from_mjcf(path, rig=rig, frame_skip=4)
    env.reset(seed=0, options={"body": Mass("base", scale=1.5)})
    assert _inner(env).dt == pytest.approx(0.008)
    assert _inner(env).observation_layout.names[0] == "base/z"
    _, _, terminated, _, _ = env.step(np.zeros(2))
    assert not terminated


def test_robots_in_a_plane_hide_their_place(tmp_path: Path) -> None:
    """A slide along the floor is hidden, one that raises the trunk is seen."""
    path = tmp_path / "hopper.xml"
    text = DOG.replace(
        "<freejoint/>",
        '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>',
    )
    path.write_text(text[: text.index("  <keyframe>")] + "</mujoco>")
    names = _inner(shapechanger.from_mjcf(path)).observation_layout.names
    assert names[:2] == ("z/position", "front/angle")
    assert "x/velocity" in names


def test_fixed_robots_have_tasks_too(tmp_path: Path) -> None:
    """An arm's observation has all positions, and its first body is its trunk."""
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)

    def reach(robot: Any) -> dict[str, float]:
        return {"elbow": -abs(robot["elbow/angle"])}

    env = shapechanger.from_mjcf(path, reach, rig=AddMotor("*", 2.0))
    assert _inner(env).observation_layout.names[:2] == ("shoulder/angle", "elbow/angle")
    env.reset(seed=0)
    assert env.step(np.zeros(2))[4]["x_velocity"] == 0.0
    with pytest.raises(TaskError, match="fixed to the world"):
        shapechanger.from_mjcf(path, rig=AddMotor("*", 2.0))


def test_velocity_servos_have_a_unit(dog: Path) -> None:
    dog.write_text(
        DOG.replace(
            '<position name="back" joint="back" kp="40"',
            '<velocity name="back" joint="back" kv="3"',
        )
    )
    assert _inner(shapechanger.from_mjcf(dog)).action_layout.features[1].unit == "rad/s"
    damper = '<general name="back" joint="back" biastype="affine" gainprm="2" biasprm="0 -1 0"'
    dog.write_text(DOG.replace('<position name="back" joint="back" kp="40"', damper))
    feature = _inner(shapechanger.from_mjcf(dog)).action_layout.features[1]
    assert (feature.name, feature.gain) == ("back/motor", 2.0)


@pytest.mark.parametrize(
    ("arguments", "error", "sentence"),
    [
        ({"path": ""}, EnvArgumentError, "needs the file of a robot: give path=FILE"),
        ({"task": "wlak"}, UnknownName, "Did you mean 'walk'"),
        ({"tsk": "walk"}, UnknownName, "No argument of dog matches 'tsk'. Did you mean 'task'"),
        ({"body": "cat"}, UnknownName, "No body of the family dog matches 'cat'"),
        ({"body": Stretch("tail", 2.0)}, UnknownName, "No body matches 'tail'"),
        ({"frame_skip": 0}, EnvArgumentError, "frame_skip must be at least 1"),
        ({"reset_noise_scale": -1.0}, EnvArgumentError, "reset_noise_scale must be a number"),
        ({"width": "wide"}, EnvArgumentError, "width must be a number"),
        ({"rig": AddMotor("*", 1.0)}, MorphologyError, "has a motor, or none matches"),
    ],
)
def test_wrong_arguments_are_refused(
    dog: Path, arguments: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    """The message names the valid value or the nearest name."""
    with pytest.raises(error, match=sentence):
        EnvRef("shapechanger/OwnRobot-v1", {"path": str(dog), **arguments}).make()


def test_observed_numbers_must_exist(dog: Path) -> None:
    """A glob that matches nothing is a typing mistake."""

    class Blind(Rear):
        observe = ("*/angel",)

    with pytest.raises(UnknownName, match="No observed number matches"):
        shapechanger.from_mjcf(dog, Blind)


_MASSLESS = DOG.replace('name="front" pos', 'name="paw" pos').replace(' mass="3"', ' mass="0"')


@pytest.mark.parametrize(
    ("text", "error", "sentence"),
    [
        (_MASSLESS, BrokenModel, r"compile dog\.xml: mass and inertia of moving bodies"),
        (
            '<mujoco><worldbody><body><geom size=".1"/></body></worldbody></mujoco>',
            *(MorphologyError, r"dog\.xml has no joints, so it cannot move"),
        ),
        # A floor that the geoms of the robot cannot touch.
        (
            DOG.replace('name="floor"', 'name="floor" contype="2" conaffinity="2"'),
            *(TaskError, "would fall through the world"),
        ),
    ],
)
def test_models_that_cannot_walk_are_refused(
    dog: Path, text: str, error: type[Exception], sentence: str
) -> None:
    dog.write_text(text)
    with pytest.raises(error, match=sentence):
        shapechanger.from_mjcf(dog)
