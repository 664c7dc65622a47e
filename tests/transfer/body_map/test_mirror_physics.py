"""The mirror of the ants against MuJoCo."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - registers the ids.
from shapechanger.transfer.body_map import BodyMap
from tests.transfer.body_map.bodies import ANT_FLIP, ANT_SWAP

pytest.importorskip("mujoco")

LEGS = {"front_left_leg": "right_back_leg", "front_right_leg": "back_leg"}


@pytest.mark.parametrize("name", ["Ant", "BigAnt", "ExtendedAnt"])
def test_the_mirror_is_a_symmetry_of_the_ant(name: str) -> None:
    env = gym.make(f"shapechanger/{name}-v1")
    ant: Any = env.unwrapped
    layouts = ant.observation_layout, ant.action_layout
    mirrored = BodyMap.mirror(*layouts, swap=ANT_SWAP | LEGS, flip=ANT_FLIP)
    rng = np.random.default_rng(0)
    n_position, n_velocity = ant.model.nq - 2, ant.model.nv  # x and y are not observed.
    env.reset(seed=0)
    touched = 0
    for _ in range(30):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape or ()).astype(np.float32)
        position, velocity = ant.data.qpos.copy(), ant.data.qvel.copy()
        sensed = np.zeros(layouts[0].size)
        sensed[: n_position + n_velocity] = [*position[2:], *velocity]
        turned = mirrored.adapt_observation(sensed)
        ant.set_state(
            np.array([position[0], -position[1], *turned[:n_position]]),
            turned[n_position : n_position + n_velocity],
        )
        ant.data.qacc_warmstart[:] = 0.0
        seen_mirrored, *_ = env.step(mirrored.adapt_action(action))
        ant.set_state(position, velocity)
        ant.data.qacc_warmstart[:] = 0.0
        seen, *_ = env.step(action)
        touched += ant.data.ncon > 0
        np.testing.assert_allclose(mirrored.adapt_observation(seen), seen_mirrored, atol=1e-6)
    assert touched > 5
    env.close()
