"""Observed inertias, twists, forces and contacts are what their layouts state."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from shapechanger.transfer.body_map import BodyMap
from tests.envs.test_layout_truth import moved as _moved

_BLOCKS = {
    "cinert": "/inertia/",
    "cvel": "/twist/",
    "qfrc_actuator": "/drive",
    "cfrc_ext": "/contact/",
}


def _sensed(env: Any) -> dict[str, float]:
    return dict(zip(env.observation_layout.names, env._get_obs(), strict=True))


@pytest.fixture
def humanoid() -> Iterator[Any]:
    """A humanoid in the air, in a random pose with random velocities."""
    with gym.make("shapechanger/Humanoid-v1") as made:
        env: Any = made.unwrapped
        made.reset(seed=0)
        rng = np.random.default_rng(1)
        pose = env.init_qpos.copy()
        mujoco.mj_integratePos(env.model, pose, 0.2 * rng.normal(size=env.model.nv), 1.0)
        pose[2] = 50.0
        env.set_state(pose, rng.normal(size=env.model.nv))
        yield env


@pytest.fixture
def poles() -> Iterator[Any]:
    with gym.make("shapechanger/InvertedDoublePendulum-v1") as made:
        made.reset(seed=0)
        yield made.unwrapped


def _bodies(env: Any) -> list[str]:
    return [env.model.body(b).name for b in range(1, env.model.nbody)]


def test_inertias_are_about_the_centre_of_mass(humanoid: Any) -> None:
    """Inertias follow from the parallel axis theorem, in the world's axes."""
    sensed, centre = _sensed(humanoid), humanoid.data.subtree_com[1]
    for name in _bodies(humanoid):
        body, model = humanoid.data.body(name), humanoid.model.body(name)
        (mass,), turn = model.mass, body.ximat.reshape(3, 3)
        arm = body.xipos - centre
        whole = turn @ np.diag(model.inertia) @ turn.T
        whole += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        expected = {
            **{a + b: whole["xyz".index(a), "xyz".index(b)] for a, b in ("xx", "yy", "zz")},
            **{a + b: whole["xyz".index(a), "xyz".index(b)] for a, b in ("xy", "xz", "yz")},
            **dict(zip(("mx", "my", "mz"), mass * arm, strict=True)),
            "mass": mass,
        }
        for quantity, value in expected.items():
            assert sensed[f"{name}/inertia/{quantity}"] == pytest.approx(value, abs=1e-9)


def test_twists_are_velocities_at_the_centre_of_mass(humanoid: Any) -> None:
    """Twists equal MuJoCo's body velocities, moved to the centre of mass."""
    sensed, centre, six = _sensed(humanoid), humanoid.data.subtree_com[1], np.zeros(6)
    for name in _bodies(humanoid):
        body, kind = humanoid.data.body(name), mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(humanoid.model, humanoid.data, kind, body.id, six, 0)
        turning, moving = six[:3], six[3:] + np.cross(six[:3], centre - body.xpos)
        for axis, w, v in zip("xyz", turning, moving, strict=True):
            assert sensed[f"{name}/twist/w{axis}"] == pytest.approx(w, abs=1e-9)
            assert sensed[f"{name}/twist/v{axis}"] == pytest.approx(v, abs=1e-9)


def test_a_motor_changes_the_drive_of_its_joint(humanoid: Any) -> None:
    """The drive is the gain times the control, N·m."""
    humanoid.data.ctrl[:] = 0.0
    mujoco.mj_forward(humanoid.model, humanoid.data)
    before = _sensed(humanoid)
    for a, motor in enumerate(humanoid.action_layout):
        humanoid.data.ctrl[a] = 0.25
        mujoco.mj_forward(humanoid.model, humanoid.data)
        joint = motor.name.partition("/")[0]
        drives = {n: x for n, x in _moved(before, _sensed(humanoid)).items() if "/drive" in n}
        assert drives == {f"{joint}/drive": pytest.approx(0.25 * motor.gain)}
        humanoid.data.ctrl[a] = 0.0


def test_contacts_are_not_clipped(humanoid: Any) -> None:
    before = _sensed(humanoid)
    for name in _bodies(humanoid):
        written = np.array([100.0, -200.0, 300.0, -400.0, 500.0, -600.0])
        humanoid.data.body(name).cfrc_ext[:] = written
        moved = _moved(before, _sensed(humanoid))
        humanoid.data.body(name).cfrc_ext[:] = 0.0
        names = [f"{name}/contact/{quantity}{axis}" for quantity in "tf" for axis in "xyz"]
        assert moved == dict(zip(names, written, strict=True))
    assert math.isinf(humanoid.observation_layout["torso/contact/fz"].high)


@pytest.mark.parametrize("shown", [*itertools.product([True, False], repeat=4)])
def test_blocks_are_optional(shown: tuple[bool, ...]) -> None:
    """The layout has the size of the space for all combinations of blocks."""
    arguments = {
        f"include_{block}_in_observation": show for block, show in zip(_BLOCKS, shown, strict=True)
    }
    hidden = sum(shown) % 2 == 0
    arguments["exclude_current_positions_from_observation"] = hidden
    with gym.make("shapechanger/Humanoid-v1", **arguments) as made:
        layout = made.unwrapped.observation_layout
        assert made.observation_space.shape == (layout.size,)
    for mark, show in zip(_BLOCKS.values(), shown, strict=True):
        assert any(mark in name for name in layout.names) == show
    assert ("torso/x" in layout) != hidden


def test_each_joint_changes_its_own_numbers(poles: Any) -> None:
    """A hinge changes its sine and cosine, a velocity its own number."""
    pose, velocity = np.array([0.1, 0.2, -0.3]), np.array([0.5, -0.6, 0.7])

    def sensed(pose: np.ndarray, velocity: np.ndarray) -> dict[str, float]:
        poles.set_state(pose, velocity)
        return _sensed(poles)

    before = sensed(pose, velocity)
    for place, joint in enumerate(("slider", "hinge", "hinge2")):
        step = 0.05 * np.eye(3)[place]
        q = (pose + step)[place]
        own = {f"{joint}/sin": math.sin(q), f"{joint}/cos": math.cos(q)}
        expected = {"slider/position": q} if joint == "slider" else own
        assert _moved(before, sensed(pose + step, velocity)) == pytest.approx(expected)
        moved = _moved(before, sensed(pose, velocity + step))
        assert moved == {f"{joint}/velocity": (velocity + step)[place]}
        fast = _moved(before, sensed(pose, velocity - 2000.0 * step))
        assert fast == {f"{joint}/velocity": -10.0}


def test_the_rail_limits_give_a_force(poles: Any) -> None:
    """The constraint force on the cart is observed, clipped to 10 N."""
    for place, pushed in ((1.05, -10.0), (-1.05, 10.0), (0.0, 0.0)):
        poles.set_state(np.array([place, 0.0, 0.0]), np.zeros(3))
        assert _sensed(poles)["slider/constraint_force"] == pushed


@pytest.mark.parametrize("name", ["Hopper", "Walker2d"])
def test_planar_velocities_are_clipped(name: str) -> None:
    with gym.make(f"shapechanger/{name}-v1") as made:
        env: Any = made.unwrapped
        made.reset(seed=0)
        for fast, seen in ((30.0, 10.0), (-30.0, -10.0), (3.0, 3.0)):
            env.set_state(env.init_qpos, np.full(env.model.nv, fast))
            velocities = [x for n, x in _sensed(env).items() if n.endswith("/velocity")]
            assert velocities == [seen] * env.model.nv


def test_the_mirror_includes_the_blocks(humanoid: Any) -> None:
    """The mirrored observation equals the observation of the mirrored state."""
    with gym.make(
        "shapechanger/Humanoid-v1", exclude_current_positions_from_observation=False
    ) as made:
        env: Any = made.unwrapped
        made.reset(seed=0)
        layouts = env.observation_layout, env.action_layout
        flip = ("abdomen_x", "abdomen_z", "*_shoulder*")
        image = BodyMap.mirror(*layouts, swap={"right_*": "left_*"}, flip=flip)
        action = np.random.default_rng(2).uniform(-0.4, 0.4, env.model.nu)
        env.data.ctrl[:] = action
        env.set_state(humanoid.data.qpos.copy(), humanoid.data.qvel.copy())
        expected = image.adapt_observation(env._get_obs())
        env.data.ctrl[:] = image.adapt_action(action)
        nq, nv = env.model.nq, env.model.nv
        env.set_state(expected[:nq].copy(), expected[nq : nq + nv].copy())
        np.testing.assert_allclose(env._get_obs(), expected, atol=1e-9)
