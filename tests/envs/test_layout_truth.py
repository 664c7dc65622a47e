"""Layouts agree with the simulator: one change moves only the numbers named after it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from shapechanger.envs import CATALOGUE
from shapechanger.morphology import AddLimb, Lock, Split, to_json
from shapechanger.morphology.pose import trunk_lift
from tests.morphology.scenes import ASSETS

_PLACE = {"exclude_current_positions_from_observation": False}
_NO_CONTACTS = {"include_cfrc_ext_in_observation": False}
_HIDDEN = ("cinert", "cvel", "qfrc_actuator", "cfrc_ext")
_JOINTS = {f"include_{block}_in_observation": False for block in _HIDDEN}
_PLANAR = ("HalfCheetah", "Hopper", "Walker2d", "Swimmer")
_OTHER_BODY = (
    AddLimb("aux_1", "_5", 0.8, 0.7),
    Lock("ankle_3"),
    Split("shank_2", "shin_2", 0.4, -0.3, 0.6, 55.0),
)
_CASES: dict[str, tuple[str, dict[str, Any]]] = {
    **{
        env_id.removeprefix("shapechanger/"): (env_id, {})
        for env_id, entry in CATALOGUE.items()
        # These two observe more blocks; see test_layout_truth_of_blocks.py.
        if entry.family not in ("Humanoid", "InvertedDoublePendulum")
    },
    **{f"{name} with its place": (f"shapechanger/{name}-v1", _PLACE) for name in _PLANAR},
    "Humanoid's joints": ("shapechanger/Humanoid-v1", _JOINTS),
    "Humanoid's joints and place": ("shapechanger/Humanoid-v1", _JOINTS | _PLACE),
    "Ant with its place": ("shapechanger/Ant-v1", _PLACE),
    "BigAnt without contacts": ("shapechanger/BigAnt-v1", _NO_CONTACTS),
    "larger spaces": ("shapechanger/ExtendedAnt-v1", _PLACE | _NO_CONTACTS),
    "no foot motors": ("shapechanger/ExtendedAnt-v1", {"body": "ExtendedAntPassive"}),
    "an ant of a file": ("shapechanger/OwnRobot-v1", {"path": ASSETS + "/ant.xml"}),
    "another body": ("shapechanger/Ant-v1", {"body": to_json(_OTHER_BODY)} | _PLACE),
}
_J = mujoco.mjtJoint
_ONE_NUMBER = {_J.mjJNT_HINGE: "angle", _J.mjJNT_SLIDE: "position"}
_HIGH_M = 50.0
_STEP = 0.01


def _made(case: str) -> Iterator[Any]:
    env_id, arguments = _CASES[case]
    with gym.make(env_id, **arguments) as made:
        made.reset(seed=0)
        yield made.unwrapped


@pytest.fixture(params=_CASES)
def env(request: pytest.FixtureRequest) -> Iterator[Any]:
    yield from _made(request.param)


@pytest.fixture(
    params=[case for case in _CASES if not case.startswith(_PLANAR) and "Pendulum" not in case]
)
def ant(request: pytest.FixtureRequest) -> Iterator[Any]:
    """An unwrapped env with a free trunk, after a reset."""
    yield from _made(request.param)


def _sensed(env: Any, pose: np.ndarray, velocity: np.ndarray) -> dict[str, float]:
    env.set_state(pose, velocity)
    return dict(zip(env.observation_layout.names, env._get_obs(), strict=True))


def moved(before: dict[str, float], after: dict[str, float]) -> dict[str, float]:
    """Return the features that changed, with their new values."""
    return {name: value for name, value in after.items() if value != before[name]}


def _state(env: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return a lifted random pose near the start, and random velocities."""
    rng = np.random.default_rng(1)
    pose = env.init_qpos.copy()
    mujoco.mj_integratePos(env.model, pose, 0.05 * rng.normal(size=env.model.nv), 1.0)
    return _lifted(env, pose), rng.normal(size=env.model.nv)


def _lifted(env: Any, pose: np.ndarray) -> np.ndarray:
    """Return the pose raised until the body has no contacts."""
    result = pose.copy()
    lift = trunk_lift(env.model)
    if lift is not None:
        lift.raise_by(result, _HIGH_M)
    return result


def _in_the_air(env: Any) -> None:
    env.reset(seed=0)
    env.set_state(_lifted(env, env.data.qpos), env.data.qvel.copy())


def _visible(env: Any, values: dict[str, float]) -> dict[str, float]:
    """Return the values that are observed; the trunk's position may be hidden."""
    return {name: value for name, value in values.items() if name in env.observation_layout}


def test_a_joint_changes_its_own_position(env: Any) -> None:
    """Each hinge and slide changes one number, in rad or m, and no other."""
    pose, velocity = _state(env)
    before = _sensed(env, pose, velocity)
    for j in range(env.model.njnt):
        kind = _J(env.model.jnt_type[j])
        if kind not in _ONE_NUMBER:
            continue
        changed = pose.copy()
        place = env.model.jnt_qposadr[j]
        changed[place] += _STEP
        changes = moved(before, _sensed(env, changed, velocity))
        own = {f"{env.model.joint(j).name}/{_ONE_NUMBER[kind]}": changed[place]}
        assert changes == _visible(env, own)


def test_the_trunk_changes_its_own_position(ant: Any) -> None:
    """The height is always observed, x and y only on request."""
    pose, velocity = _state(ant)
    before = _sensed(ant, pose, velocity)
    for place, axis in enumerate("xyz"):
        changed = pose.copy()
        changed[place] += _STEP
        changes = moved(before, _sensed(ant, changed, velocity))
        assert changes == _visible(ant, {f"torso/{axis}": changed[place]})
    assert "torso/z" in before


def test_a_rotation_changes_the_quaternion(ant: Any) -> None:
    pose, velocity = _state(ant)
    pose[3:7] = [1.0, 0.0, 0.0, 0.0]
    before = _sensed(ant, pose, velocity)
    for axis, name in enumerate(("qx", "qy", "qz")):
        changed = pose.copy()
        mujoco.mju_axisAngle2Quat(changed[3:7], np.eye(3)[axis], 0.3)
        changes = moved(before, _sensed(ant, changed, velocity))
        assert changes == pytest.approx(
            {"torso/qw": math.cos(0.15), f"torso/{name}": math.sin(0.15)}, rel=1e-12
        )
    changed[3:7] = [0.5, 0.1, -0.7, 0.5]
    changes = moved(before, _sensed(ant, changed, velocity))
    assert changes.keys() == {"torso/qw", "torso/qx", "torso/qy", "torso/qz"}
    np.testing.assert_array_equal(list(changes.values()), changed[3:7])


def test_a_velocity_changes_its_own_number(env: Any) -> None:
    pose, velocity = _state(env)
    before = _sensed(env, pose, velocity)
    for j in range(env.model.njnt):
        first = env.model.jnt_dofadr[j]
        if env.model.jnt_type[j] == _J.mjJNT_FREE:
            names = [f"torso/{quantity}" for quantity in ("vx", "vy", "vz", "wx", "wy", "wz")]
        else:
            names = [f"{env.model.joint(j).name}/velocity"]
        for place, name in enumerate(names, start=first):
            changed = velocity.copy()
            changed[place] += _STEP
            changes = moved(before, _sensed(env, pose, changed))
            assert changes == {name: changed[place]}


def test_angular_velocities_are_in_the_trunks_frame(ant: Any) -> None:
    """Angular velocities are in the trunk's frame.

    With the trunk on its side, its z axis is the world's x axis. Linear velocities are in the
    world's frame.
    """
    pose, _ = _state(ant)
    mujoco.mju_axisAngle2Quat(pose[3:7], np.array([0.0, 1.0, 0.0]), math.pi / 2)
    for axis, in_world in zip("xyz", ([0, 0, -1], [0, 1, 0], [1, 0, 0]), strict=True):
        velocity = np.zeros(ant.model.nv)
        velocity[3 + "xyz".index(axis)] = 1.0
        sensed = _sensed(ant, pose, velocity)
        assert sensed[f"torso/w{axis}"] == 1.0
        # MuJoCo's velocity of the body: rotation first, in the world's axes.
        six = np.zeros(6)
        mujoco.mj_objectVelocity(
            ant.model, ant.data, mujoco.mjtObj.mjOBJ_BODY, ant.data.body("torso").id, six, 0
        )
        np.testing.assert_allclose(six[:3], in_world, atol=1e-12)


def test_a_force_changes_the_contacts_of_its_body(env: Any) -> None:
    """Each body has six numbers: torque before force, in the world's axes, N·m and N."""
    for body in (env.model.body(b).name for b in range(1, env.model.nbody)):
        # A force with a lever is also a torque; a torque gives no force.
        for kind, first, others in (("f", 0, "tf"), ("t", 3, "t")):
            _in_the_air(env)
            applied = np.array([0.2, -0.3, 0.4])
            env.data.body(body).xfrc_applied[first : first + 3] = applied
            observation, *_ = env.step(np.zeros(env.model.nu))
            env.data.body(body).xfrc_applied[:] = 0.0
            sensed = dict(zip(env.observation_layout.names, observation, strict=True))
            changes = {name: x for name, x in sensed.items() if "/contact/" in name and x != 0.0}
            assert changes.keys() <= {f"{body}/contact/{q}{axis}" for q in others for axis in "xyz"}
            names = [f"{body}/contact/{kind}{axis}" for axis in "xyz"]
            expected = _visible(env, dict(zip(names, applied, strict=True)))
            assert {name: changes[name] for name in expected} == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("push_n", "seen"), [(50.0, 2.0), (-50.0, -0.5), (0.25, 0.25)])
def test_contacts_are_clipped_to_their_range(push_n: float, seen: float) -> None:
    """The range is an argument and stated by the layout."""
    with gym.make("shapechanger/Ant-v1", contact_force_range=(-0.5, 2.0)) as made:
        env: Any = made.unwrapped
        _in_the_air(env)
        env.data.body("shank_2").xfrc_applied[1] = push_n
        observation, *_ = env.step(np.zeros(8))
    feature = env.observation_layout["shank_2/contact/fy"]
    assert (feature.low, feature.high, feature.unit) == (-0.5, 2.0, "N")
    places = env.observation_layout.slices["shank_2/contact/fy"]
    np.testing.assert_allclose(observation[places], seen, rtol=1e-12)


def test_a_motor_drives_its_own_joint(env: Any) -> None:
    """A control c gives gain times c, in N·m or N, on one joint."""
    for a, feature in enumerate(env.action_layout):
        control = 0.25
        action = np.zeros(env.model.nu)
        action[a] = control
        _in_the_air(env)
        env.step(action)
        assert feature.element is not None
        # The pendulum's motor `slide` drives the joint `slider`.
        joint = {"slide": "slider"}.get(feature.element.name, feature.element.name)
        hinge = env.model.joint(joint).type == _J.mjJNT_HINGE
        assert (feature.unit, feature.gain_unit) == ("1", "N·m" if hinge else "N")
        expected = np.zeros(env.model.nv)
        expected[env.model.joint(joint).dofadr] = feature.gain * control
        np.testing.assert_allclose(env.data.qfrc_actuator, expected, rtol=1e-12)


def test_features_name_elements_of_the_model(env: Any) -> None:
    for feature in (*env.observation_layout, *env.action_layout):
        assert feature.element is not None
        assert getattr(env.model, feature.element.kind)(feature.element.name).id >= 0
        assert feature.name.startswith(f"{feature.element.name}/")
