"""Robot files of other projects work in `OwnRobotEnv`, or are refused with a reason.

`make test-robots` installs the packages of `tests/robot_files.txt`, of which only models are read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

import gymnasium as gym
import msgspec
import mujoco
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import shapechanger
from shapechanger.contract.env_ref import EnvRef
from shapechanger.contract.testing import PROMISES, BrokenPromise, examine
from shapechanger.errors import EmptyShift, MorphologyError, ShapechangerError
from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    AddMotor,
    Body,
    Mass,
    Radius,
    Stretch,
    to_json,
)
from shapechanger.morphology.pose import StartRules, robot_bodies
from shapechanger.transfer.learners import ignore
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.learners.sb3 import Sb3Learner
from tests.envs.own_robots import Move

FILES: Final = Path(".robot-files")
_DM: Final = "dm_control"
_GYM: Final = "gymnasium_robotics/envs/assets"
_MYO: Final = "myo_sim/models/legacy"
_SUITE: Final = "robosuite/models/assets"
_URDF: Final = "cmeel.prefix/share/example-robot-data/robots"
_BIG: Final = 1.5
# A pose counts as closed below this gap, m or rad, or below the gap in the file's own pose.
_CLOSED: Final = 1e-3

_INERTIA: Final = r"'.+' has its inertia written out, so it would not follow a new shape"
_MOTORS: Final = (AddMotor("*"),)
_WILD: Final = r"The simulation diverges at step \d+ of random actions: give the actuators"
_AT_ONCE: Final = r"The simulation diverges at step 1 of random actions: give the actuators"
_MESH: Final = r"'.+' holds '.+', a mesh, height field or SDF; only spheres"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FILES.is_dir(), reason="needs robot files: run `make test-robots`"),
    # MuJoCo's compiler warns of files for older versions.
    pytest.mark.filterwarnings("ignore:.*is deprecated:UserWarning"),
]


class _Robot(NamedTuple):
    """A robot file.

    Attributes:
        path: Path in the folder of packages.
        rig: Edits that the robot needs.
        no_scale: Message that refuses to scale the robot; empty if it can be scaled.
        no_exam: Message with which a robot with too strong actuators fails the exam; empty if it
            passes.
    """

    path: str
    rig: Body = ()
    no_scale: str = ""
    no_exam: str = ""

    @property
    def file(self) -> Path:
        return FILES / self.path

    def make(self, body: Body = (), **arguments: Any) -> gym.Env[Any, Any]:
        return shapechanger.from_mjcf(self.file, Move, rig=self.rig, body=body, **arguments)


ROBOTS: Final = (
    _Robot(f"{_DM}/suite/cheetah.xml"),
    _Robot(f"{_DM}/suite/finger.xml"),
    _Robot(f"{_DM}/suite/fish.xml"),
    _Robot(f"{_DM}/suite/quadruped.xml"),
    _Robot(f"{_DM}/suite/humanoid_CMU.xml"),
    _Robot(f"{_DM}/locomotion/walkers/assets/humanoid_CMU_V2020.xml"),
    _Robot(f"{_DM}/locomotion/walkers/assets/rodent.xml"),
    _Robot(f"{_DM}/suite/dog.xml", no_scale=_INERTIA),
    _Robot(f"{_DM}/suite/manipulator.xml", no_scale=_INERTIA),
    _Robot(f"{_GYM}/adroit_hand/adroit_hammer.xml", no_scale=_INERTIA),
    _Robot(f"{_GYM}/fetch/pick_and_place.xml", no_scale=_INERTIA),
    _Robot(f"{_GYM}/hand/manipulate_block_touch_sensors.xml", no_scale=_INERTIA),
    _Robot(f"{_GYM}/kitchen_franka/kitchen_assets/kitchen_env_model.xml", no_scale=_MESH),
    _Robot("gym_aloha/assets/bimanual_viperx_insertion.xml", no_scale=_MESH, no_exam=_WILD),
    _Robot("metaworld/assets/sawyer_xyz/sawyer_reach_v3.xml", no_scale=_MESH),
    _Robot(f"{_MYO}/elbow/myoelbow_2dof6muscles.xml", no_scale=_INERTIA),
    _Robot(f"{_MYO}/finger/myofinger_v0.xml", no_scale="The tendon 'dflx' would start .+ long"),
    # In the file's own pose, the loops of the knees are open by 5 cm.
    _Robot(f"{_MYO}/osl/myolegs_osl.xml", no_scale=_INERTIA),
    _Robot(f"{_SUITE}/grippers/jaco_three_finger_gripper.xml", no_scale=_INERTIA),
    _Robot(f"{_SUITE}/robots/baxter/robot.xml", no_scale=_INERTIA),
    # Its motors have 20,000 N·m, and its joints, without damping or armature, diverge at 10 N·m.
    _Robot(f"{_SUITE}/robots/gr1/robot.xml", no_scale=_INERTIA, no_exam=_AT_ONCE),
    _Robot(f"{_SUITE}/robots/panda/robot.xml", no_scale=_INERTIA),
    _Robot(f"{_SUITE}/robots/ur5e/robot.xml", no_scale=_INERTIA),
    # The robot has no collision shapes, so MuJoCo keeps no shape at all.
    _Robot(
        f"{_URDF}/alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", _MOTORS, _INERTIA
    ),
    _Robot(
        f"{_URDF}/go2_description/urdf/go2.urdf",
        (*_MOTORS, AddFreeJoint("base"), AddFloor()),
        _INERTIA,
    ),
    _Robot(f"{_URDF}/panda_description/urdf/panda.urdf", _MOTORS, _INERTIA),
    # With the file's limit of 10 N·m it diverges. A Feetech STS3215 stalls at 30 kg·cm (12 V).
    _Robot(f"{_URDF}/so_arm_description/urdf/so101.urdf", (AddMotor("*", 3.0),), _INERTIA),
    # 12 joints of its hands follow others.
    _Robot(f"{_URDF}/talos_data/robots/talos_full_v2.urdf", _MOTORS, _INERTIA),
    _Robot(f"{_URDF}/ur_description/urdf/ur5_robot.urdf", _MOTORS, _INERTIA),
)

REFUSED: Final = {
    f"{_DM}/suite/swimmer.xml": "has no actuators: add them",
    f"{_GYM}/fetch/reach.xml": "has no actuators: add them",
    f"{_SUITE}/grippers/robotiq_gripper_85.xml": "repeated name 'robotiq_arg2f_base_link' in mesh",
    f"{_SUITE}/grippers/xarm7_gripper.xml": "unrecognized attribute: 'group'",
    f"{_URDF}/allegro_hand_description/urdf/allegro_right_hand.urdf": "inertia must satisfy",
    f"{_URDF}/baxter_description/urdf/baxter.urdf": "MuJoCo does not read COLLADA: convert it",
    f"{_URDF}/double_pendulum_description/urdf/double_pendulum.urdf": "no largest torque or force",
    f"{_URDF}/go1_description/urdf/go1.urdf": "inertia must have positive eigenvalues",
    f"{_URDF}/iris_description/robots/iris_simple.urdf": "has no joints, so it cannot move",
    f"{_URDF}/simple_humanoid_description/urdf/simple_humanoid.urdf": "number of faces should be",
}


def _name(robot: _Robot) -> str:
    parts = Path(robot.path).parts
    return f"{parts[0]}/{parts[-2]}/{parts[-1]}"


each_robot = pytest.mark.parametrize("robot", ROBOTS, ids=_name)


@pytest.mark.parametrize(("path", "sentence"), REFUSED.items())
def test_a_file_without_a_valid_robot_is_refused(path: str, sentence: str) -> None:
    """The message gives the reason, before anything is simulated."""
    with pytest.raises(ShapechangerError, match=sentence):
        _Robot(path, _MOTORS if path.endswith(".urdf") else ()).make()


@each_robot
def test_a_robot_starts_with_closed_loops_and_steps(robot: _Robot) -> None:
    """The start is inside the limits, with equalities closed as in the file; steps are finite."""
    env = robot.make()
    inner: Any = env.unwrapped
    model, data = inner.model, mujoco.MjData(inner.model)
    written = _gap(model, model.qpos0, data)
    for seed in range(5):
        env.reset(seed=seed)
        assert _gap(model, inner.data.qpos, data) <= max(_CLOSED, written)
    env.action_space.seed(0)
    for _ in range(50):
        observation, reward, terminated, _, _ = env.step(env.action_space.sample())
        assert np.isfinite(observation).all()
        assert np.isfinite(reward)
        if terminated:
            env.reset()
    env.close()


@each_robot
def test_a_robot_is_scaled_or_refused(robot: _Robot) -> None:
    """Lengths grow by the factor and masses by its cube; equalities stay closed."""
    body = (Stretch("*", _BIG), Radius("*", _BIG))
    if robot.no_scale:
        with pytest.raises(MorphologyError, match=robot.no_scale):
            robot.make(body)
        return
    before: Any = robot.make().unwrapped
    after: Any = robot.make(body).unwrapped
    moving = before.model.body_mass > 0.0
    np.testing.assert_allclose(
        after.model.body_mass[moving], _BIG**3 * before.model.body_mass[moving], rtol=1e-9
    )
    old, new = _distances(before.model), _distances(after.model)
    np.testing.assert_allclose(new, _BIG * old, rtol=1e-6, atol=1e-9)
    data = mujoco.MjData(after.model)
    written = _gap(before.model, before.model.qpos0, mujoco.MjData(before.model))
    after.reset(seed=0)
    assert _gap(after.model, after.data.qpos, data) <= max(_CLOSED, _BIG * written)


@each_robot
def test_the_shift_of_a_robot_is_certified(robot: _Robot) -> None:
    """A change of all masses is a shift; without an edit, the shift is refused as empty."""
    source, target = robot.make(), robot.make((Mass("*", scale=1.3),))
    certificate = source.unwrapped.certify_shift(source, target)
    assert "mass" in str(certificate)
    with pytest.raises(EmptyShift, match="behave the same"):
        source.unwrapped.certify_shift(source, robot.make())


@each_robot
def test_a_robot_passes_the_exam(robot: _Robot) -> None:
    """The robot passes `shapechanger envs --check`, or fails with the expected message."""
    if robot.no_exam:
        with pytest.raises(BrokenPromise, match=robot.no_exam):
            list(examine(robot.make))
        return
    assert len(list(examine(robot.make))) == len(PROMISES)


@each_robot
def test_a_training_on_a_robot_gives_finite_weights(robot: _Robot) -> None:
    task = f"{Move.__module__}:{Move.__qualname__}"
    arguments = {"path": str(robot.file), "task": task, "rig": to_json(robot.rig)}
    env = EnvRef("shapechanger/OwnRobot-v1", {**arguments, "max_episode_steps": 50})
    short = {"n_envs": 8, "n_steps": 256, "eval_every": 2048, "eval_episodes": 1}
    settings = msgspec.structs.replace(learner_settings("ppo-run"), **short)
    policy = Sb3Learner("ppo-run", settings).train(env, 2048, 0, on_evaluation=ignore)
    assert policy.card.steps == 2048
    for name, weights in policy.model.policy.state_dict().items():
        assert torch.isfinite(weights).all(), name


def _gap(model: mujoco.MjModel, pose: NDArray[np.float64], data: mujoco.MjData) -> float:
    """Return the largest violation of an equality or a joint limit at a pose, m or rad."""
    data.qpos[:] = pose
    mujoco.mj_fwdPosition(model, data)
    rules = StartRules(model)
    held = pose[rules.limited_places]
    gaps = (np.abs(data.efc_pos[: data.ne]), rules.lowest - held, held - rules.highest)
    return max(float(gap.max(initial=0.0)) for gap in gaps)


def _distances(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the distances between all geoms and joints of a robot, (n, n), m."""
    data, robot = mujoco.MjData(model), robot_bodies(model)
    mujoco.mj_kinematics(model, data)
    geoms = data.geom_xpos[robot[model.geom_bodyid]]
    places = np.concatenate([geoms, data.xanchor[robot[model.jnt_bodyid]]])
    return np.linalg.norm(places[:, None] - places[None], axis=-1)
