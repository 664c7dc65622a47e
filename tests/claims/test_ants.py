"""Documented properties of the ants: starts, health and bodies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from shapechanger.envs import CATALOGUE
from shapechanger.morphology import (
    AddLimb,
    AddSegment,
    Body,
    Cut,
    JointRange,
    Radius,
    Split,
    StartHeight,
    Stretch,
    to_json,
)

_ANTS = [entry.id for entry in CATALOGUE.values() if entry.family == "Ant"]
_LEGS = (4, 1, 2, 3)
_ZERO_TORQUE_STEPS = 1000
_FLIPPED = [0.0, 1.0, 0.0, 0.0]


def _random_body(seed: int) -> Body:
    """Return a body with random legs, ranges, stump, segment, extra leg and start height."""
    rng = np.random.default_rng(seed)

    def factor() -> float:
        return float(np.exp(rng.uniform(-1.0, 1.0)))

    low = rng.uniform(-1.5, 1.2, 4)
    high = low + rng.uniform(0.05, 1.5, 4)
    ranges = [
        JointRange(f"{rng.choice(['hip', 'ankle'])}_{leg}", float(lower), float(upper))
        for leg, lower, upper in zip(_LEGS, low, high, strict=True)
    ]
    cut, grown, split = rng.permutation(_LEGS)[:3]
    body: Body = (
        *(Stretch(f"shank_{leg}", factor()) for leg in _LEGS),
        Stretch("aux_*", factor()),
        Radius("shank_*", float(rng.uniform(0.5, 2.0))),
        *ranges,
        Cut(f"shank_{cut}", float(rng.uniform(0.1, 0.9))),
        AddSegment(f"shank_{grown}", "claw", (0.1, 0.2, float(rng.uniform(-0.5, 0.5)))),
        Split(f"shank_{split}", "shin", float(rng.uniform(0.2, 0.8))),
        AddLimb("aux_1", "_5", float(rng.uniform(-3.0, 3.0)), factor()),
        StartHeight("torso", float(rng.uniform(-0.5, 2.0))),
    )
    return body


def _stretched(seed: int) -> Body:
    rng = np.random.default_rng(seed)
    thighs, shanks = rng.uniform(0.5, 2.5, 2)
    return Stretch("aux_*", float(thighs)), Stretch("shank_*", float(shanks))


def _bodies(*bodies: tuple[str, Body]) -> Any:
    """Parametrize a test over each ant of the catalogue, and over ants with these bodies."""
    cases = [pytest.param(env_id, {}, id=env_id) for env_id in _ANTS]
    passive = {"body": "ExtendedAntPassive"}
    cases.append(pytest.param("shapechanger/ExtendedAnt-v1", passive, id="passive feet"))
    cases += [
        pytest.param("shapechanger/Ant-v1", {"body": to_json(body)}, id=name)
        for name, body in bodies
    ]
    return pytest.mark.parametrize(("env_id", "arguments"), cases)


_any_ant = _bodies(
    *((f"random body {seed}", _random_body(seed)) for seed in range(6)),
    ("starts in the ground", (StartHeight("torso", -1.0),)),
)
_ants_that_stand = _bodies(*((f"stretched {seed}", _stretched(seed)) for seed in range(3)))


@pytest.fixture(params=_ANTS)
def ant(request: pytest.FixtureRequest) -> Iterator[Any]:
    """Each ant of the catalogue, at its start."""
    with gym.make(request.param) as env:
        env.reset(seed=0)
        yield env.unwrapped


def _place(env: Any, height: float, quaternion: list[float] | None = None) -> None:
    pose = env.init_qpos.copy()
    pose[2] = height
    pose[3:7] = quaternion or [1.0, 0.0, 0.0, 0.0]
    env.set_state(pose, np.zeros(env.model.nv))


def _depth(env: Any) -> float:
    """Return the deepest penetration of the floor, m, from MuJoCo's contacts."""
    floor = env.model.geom("floor").id
    return max((-c.dist for c in env.data.contact if floor in c.geom), default=0.0)


def _lowest(env: Any) -> float:
    """Return the height of the lowest point of spheres and capsules, m."""
    model, data = env.model, env.data
    heights = []
    for geom in np.flatnonzero(model.geom_bodyid > 0):
        radius, half, _ = model.geom_size[geom]
        sphere = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE
        slope = 0.0 if sphere else abs(data.geom_xmat[geom, 8])
        heights.append(data.geom_xpos[geom, 2] - slope * half - radius)
    return min(heights)


# Start poses


@_any_ant
@pytest.mark.parametrize("noise", [0.1, 0.8])
def test_no_ant_starts_outside_its_limits_or_in_the_floor(
    env_id: str, arguments: dict[str, Any], noise: float
) -> None:
    """Fifty starts of each body: joints are within limits, and no geom is in the floor."""
    with gym.make(env_id, reset_noise_scale=noise, **arguments) as made:
        env: Any = made.unwrapped
        limited = np.flatnonzero(env.model.jnt_limited)
        low, high = env.model.jnt_range[limited].T
        for seed in range(50):
            made.reset(seed=seed)
            angles = env.data.qpos[env.model.jnt_qposadr[limited]]
            assert (low <= angles).all()
            assert (angles <= high).all()
            assert _depth(env) <= 1e-9
            assert _lowest(env) >= -1e-9
            np.testing.assert_allclose(np.linalg.norm(env.data.qpos[3:7]), 1.0, rtol=1e-12)


@_any_ant
def test_a_start_is_close_to_the_models_pose(env_id: str, arguments: dict[str, Any]) -> None:
    """Joints keep a tenth of their range from limits, and the trunk is only raised as needed."""
    with gym.make(env_id, reset_noise_scale=0.0, **arguments) as made:
        made.reset(seed=0)
        env: Any = made.unwrapped
    own = env.model.qpos0
    for j in np.flatnonzero(env.model.jnt_limited):
        low, high = env.model.jnt_range[j]
        inside = 0.1 * (high - low)
        place = env.model.jnt_qposadr[j]
        expected = np.clip(own[place], low + inside, high - inside)
        assert env.data.qpos[place] == pytest.approx(expected, abs=1e-12)
    lifted = env.data.qpos[2] - own[2]
    assert lifted >= 0.0
    if lifted > 0.0:
        assert _lowest(env) == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_array_equal(env.data.qpos[[0, 1, 3, 4, 5, 6]], own[[0, 1, 3, 4, 5, 6]])


@_any_ant
def test_the_standing_height_is_where_the_lowest_point_touches(
    env_id: str, arguments: dict[str, Any]
) -> None:
    """Joints are in the middle of their ranges, and the trunk is upright."""
    with gym.make(env_id, **arguments) as made:
        env: Any = made.unwrapped
        limited = np.flatnonzero(env.model.jnt_limited)
        pose = env.model.qpos0.copy()
        pose[env.model.jnt_qposadr[limited]] = env.model.jnt_range[limited].mean(axis=1)
        pose[2] = env.standing_height
        env.set_state(pose, np.zeros(env.model.nv))
    assert _lowest(env) == pytest.approx(0.0, abs=1e-6)


# Healthy range


@_ants_that_stand
def test_an_ant_without_torque_stays_healthy(env_id: str, arguments: dict[str, Any]) -> None:
    """An ant that lies down does not end its episode."""
    with gym.make(env_id, **arguments) as made:
        env: Any = made.unwrapped
        made.reset(seed=11)
        zeros = np.zeros(env.model.nu, np.float32)
        for step in range(_ZERO_TORQUE_STEPS):
            _, _, terminated, truncated, info = made.step(zeros)
            assert not terminated
            assert truncated == (step == _ZERO_TORQUE_STEPS - 1)
            assert info["reward_survive"] == 1.0
        if "body" not in arguments:
            assert 0.27 <= env.data.qpos[2] <= 1.3


def test_a_flipped_ant_is_unhealthy_at_once(ant: Any) -> None:
    low, high = ant.healthy_z_range
    for height in (0.27, ant.standing_height):
        assert low <= height <= high
        _place(ant, height, _FLIPPED)
        assert ant.up == -1.0
        assert not ant.is_healthy
        *_, terminated, _, info = ant.step(np.zeros(ant.model.nu))
        assert terminated
        assert info["reward_survive"] == 0.0


def test_a_flipped_ant_rests_at_27_centimetres(ant: Any) -> None:
    """An ant that lies down is hardly higher, so the height cannot distinguish the two."""
    _place(ant, 0.5, _FLIPPED)
    for _ in range(200):
        ant.step(np.zeros(ant.model.nu))
    assert ant.data.qpos[2] == pytest.approx(0.27, abs=0.005)
    assert ant.up < -0.9
    assert not ant.is_healthy


@pytest.mark.parametrize("lean_deg", [0.0, 60.0, 89.0, 91.0, 120.0, 180.0])
def test_up_is_the_cosine_of_the_lean(ant: Any, lean_deg: float) -> None:
    """An ant whose `up` is negative is unhealthy."""
    for heading in (0.0, 1.0, -2.5):
        lean = math.radians(lean_deg)
        quaternion, turn = np.zeros(4), np.zeros(4)
        axis = np.array([math.cos(heading), math.sin(heading), 0.0])
        mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), 0.7)
        mujoco.mju_axisAngle2Quat(quaternion, axis, lean)
        mujoco.mju_mulQuat(quaternion, quaternion.copy(), turn)
        _place(ant, ant.standing_height, quaternion.tolist())
        assert ant.up == pytest.approx(math.cos(lean), abs=1e-12)
        assert ant.up == pytest.approx(ant.data.body("torso").xmat[8], abs=1e-12)
        assert ant.is_healthy == (lean_deg < 90.0)


def test_a_thrown_ant_is_unhealthy(ant: Any) -> None:
    """For the ants of the catalogue, the upper limit is 1.9 times the standing height."""
    for factor, healthy in ((1.89, True), (1.91, False)):
        _place(ant, factor * ant.standing_height)
        assert ant.is_healthy == healthy


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_ant_whose_state_is_not_finite_is_unhealthy(ant: Any, value: float) -> None:
    ant.data.qvel[7] = value
    assert not ant.is_healthy


def test_healthy_z_range_can_be_set() -> None:
    """The range of Ant-v5 applies to any body; a flipped ant is still unhealthy."""
    with gym.make("shapechanger/Ant-v1", healthy_z_range=(0.2, 1.0)) as made:
        env: Any = made.unwrapped
        for body in ("Ant", "BigAnt"):
            made.reset(seed=0, options={"body": body})
            assert env.healthy_z_range == (0.2, 1.0)
            for height, healthy in ((0.19, False), (0.21, True), (0.99, True), (1.01, False)):
                _place(env, height)
                assert env.is_healthy == healthy
            _place(env, 0.5, _FLIPPED)
            assert not env.is_healthy


# Compiled bodies


def test_motors_are_in_gymnasiums_order_and_the_feet_last() -> None:
    """The motors of leg 4 come first; each has 150 N·m."""
    for name, joints, numbers in (("Ant", (), 105), ("ExtendedAnt", ("foot",), 137)):
        with gym.make(f"shapechanger/{name}-v1") as env:
            layout = env.unwrapped.action_layout
            assert env.observation_space.shape == (numbers,)
        motors = [f"{joint}_{leg}/motor" for leg in _LEGS for joint in ("hip", "ankle")]
        motors += [f"{joint}_{leg}/motor" for joint in joints for leg in _LEGS]
        assert list(layout.names) == motors
        assert {feature.gain for feature in layout} == {150.0}
