"""Unedited bodies step as in Gymnasium, bitwise, and start with the same noise."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from shapechanger.morphology.pose import StartRules, trunk_lift


def test_the_ant_starts_with_gymnasiums_noise() -> None:
    """Starts have the noise of Ant-v5, except where limits or the floor forbid it."""
    with gym.make("shapechanger/Ant-v1") as made, gym.make("Ant-v5") as other:
        ours: Any = made.unwrapped
        theirs: Any = other.unwrapped
        for seed in range(10):
            ours.reset(seed=seed)
            theirs.reset(seed=seed)
            np.testing.assert_array_equal(ours.data.qvel, theirs.data.qvel)
            noise = theirs.data.qpos - theirs.init_qpos
            drawn = ours.init_qpos + noise
            np.testing.assert_allclose(ours.data.qpos[:2], drawn[:2], atol=1e-12)
            hips = [ours.model.joint(f"hip_{leg}").qposadr[0] for leg in (1, 2, 3, 4)]
            np.testing.assert_allclose(ours.data.qpos[hips], drawn[hips], atol=1e-12)
            turned = drawn[3:7] / np.linalg.norm(drawn[3:7])
            np.testing.assert_allclose(ours.data.qpos[3:7], turned, atol=1e-12)


_PLACE = {"exclude_current_positions_from_observation": False}
_HEIGHTS = {"healthy_z_range": (0.2, 1.0)}
_CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "Ant": ("Ant", _HEIGHTS),
    "Ant with positions": ("Ant", _HEIGHTS | _PLACE | {"contact_force_range": (-5.0, 5.0)}),
    "Ant without contacts": (
        "Ant",
        _HEIGHTS | {"include_cfrc_ext_in_observation": False, "forward_reward_weight": 2.0},
    ),
    "HalfCheetah": ("HalfCheetah", {}),
    "HalfCheetah with positions": ("HalfCheetah", _PLACE | {"frame_skip": 2}),
    "Hopper": ("Hopper", {}),
    "Hopper with positions": ("Hopper", _PLACE | {"healthy_z_range": (1.2, 1.3)}),
    "Walker2d": ("Walker2d", {}),
    "Walker2d with positions": ("Walker2d", _PLACE | {"healthy_angle_range": (-0.1, 0.1)}),
    "Swimmer": ("Swimmer", {}),
    "Swimmer with positions": ("Swimmer", _PLACE | {"ctrl_cost_weight": 0.1}),
    "Humanoid": ("Humanoid", {}),
    "Humanoid with positions": ("Humanoid", _PLACE | {"include_cvel_in_observation": False}),
    "InvertedPendulum": ("InvertedPendulum", {}),
    "InvertedDoublePendulum": ("InvertedDoublePendulum", {}),
    "InvertedDoublePendulum, healthy_reward": ("InvertedDoublePendulum", {"healthy_reward": 2.0}),
}


@pytest.mark.parametrize("case", _CASES)
def test_steps_equal_gymnasiums(case: str) -> None:
    """Equal states and actions give equal results until the end of an episode."""
    name, arguments = _CASES[case]
    rng = np.random.default_rng(5)
    with (
        gym.make(f"shapechanger/{name}-v1", **arguments) as made,
        gym.make(f"{name}-v5", **arguments) as other,
    ):
        ours: Any = made.unwrapped
        theirs: Any = other.unwrapped
        assert ours.action_space == theirs.action_space
        assert ours.observation_space == theirs.observation_space
        assert ours.metadata == theirs.metadata
        high = ours.action_space.high
        ends = 0
        for seed in range(3):
            ours.reset(seed=seed)
            pose, velocity = ours.data.qpos.copy(), ours.data.qvel.copy()
            for env in (ours, theirs):
                # Clear data of the last episode that `set_state` does not set.
                mujoco.mj_resetData(env.model, env.data)
                env.set_state(pose, velocity)
            theirs.init_qpos = ours.init_qpos
            for _ in range(60):
                action = rng.uniform(-high, high).astype(np.float32)
                (observation, *rest, info), (expected, *expected_rest, expected_info) = (
                    env.step(action) for env in (ours, theirs)
                )
                np.testing.assert_array_equal(observation, expected)
                assert rest == expected_rest
                np.testing.assert_equal(info, expected_info)
                if rest[1]:
                    ends += 1
                    break
    assert ends > 0 or name in ("Ant", "HalfCheetah", "Swimmer")


@pytest.mark.parametrize("name", [name for name in dict(_CASES.values()) if name != "Ant"])
def test_other_envs_start_with_gymnasiums_noise(name: str) -> None:
    """Starts have Gymnasium's noise, except where limits or the floor forbid it."""
    untouched = 0
    with gym.make(f"shapechanger/{name}-v1") as made, gym.make(f"{name}-v5") as other:
        ours: Any = made.unwrapped
        theirs: Any = other.unwrapped
        limited = theirs.model.jnt_limited != 0
        places = theirs.model.jnt_qposadr[limited]
        low, high = theirs.model.jnt_range[limited].T
        lift = trunk_lift(theirs.model)
        for seed in range(10):
            ours.reset(seed=seed)
            theirs.reset(seed=seed)
            np.testing.assert_array_equal(ours.data.qvel, theirs.data.qvel)
            pose, drawn = ours.data.qpos, theirs.data.qpos.copy()
            raised = lift is not None and StartRules(theirs.model).floor_gap(theirs.data) < 0.0
            inside = (drawn[places] >= low) & (drawn[places] <= high)
            untouched += bool(inside.all() and not raised)
            same = np.ones(drawn.size, bool)
            same[places[~inside]] = False
            if lift is not None and raised:
                same[lift.place] = False
                assert lift.height(pose) > lift.height(drawn)
            if name == "Humanoid":
                drawn[3:7] /= np.linalg.norm(drawn[3:7])
                np.testing.assert_allclose(pose[3:7], drawn[3:7], atol=1e-12)
                same[3:7] = False
            np.testing.assert_array_equal(pose[same], drawn[same])
            np.testing.assert_array_less(low - 1e-12, pose[places])
            np.testing.assert_array_less(pose[places], high + 1e-12)
    # Straight knees are at their limit, so half of the noise is beyond it.
    assert untouched > 0 or name in ("Walker2d", "Humanoid")
