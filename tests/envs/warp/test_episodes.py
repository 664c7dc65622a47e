"""Episodes of worlds: ends, restarts, time limits, seeds, and worlds that diverge."""

from __future__ import annotations

import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

import shapechanger
from shapechanger.envs.warp import WarpVectorEnv
from shapechanger.envs.warp.kernels import uniforms

WORLDS = 3
PUSH = torch.tensor([[3.0], [0.0], [0.0]])


def pendulums(**arguments: Any) -> WarpVectorEnv:
    """Return three pendulums; pushed with `PUSH`, the first one falls in about ten steps."""
    more = {"backend": "warp", "device": "cpu", **arguments}
    envs = shapechanger.make_vec("InvertedPendulum", WORLDS, **more)
    envs.reset(seed=0)
    return envs


def until_a_fall(envs: WarpVectorEnv) -> Any:
    """Push until the first world's episode ends, and return the results of that step."""
    for _ in range(50):
        results = envs.step(PUSH)
        if bool(results[2][0]):
            return results
    raise AssertionError("The pendulum does not fall.")


def test_same_step_returns_the_start_and_keeps_the_end() -> None:
    """The last observation and info of an episode are in the infos, like Gymnasium's."""
    envs = pendulums()
    observations, rewards, terminated, _, infos = until_a_fall(envs)
    assert terminated.tolist() == infos["_final_obs"].tolist() == [True, False, False]
    assert observations[0].abs().max() <= 0.01
    assert abs(float(infos["final_obs"][0, 1])) > 0.2
    assert infos["final_info"]["_reward_survive"].tolist() == [True, False, False]
    assert infos["final_info"]["reward_survive"][0] == rewards[0] == 0.0
    assert infos["_reward_survive"].tolist() == [False, True, True]
    assert not envs.step(PUSH)[2].any()


def test_infos_of_a_restart_join_those_of_steps() -> None:
    """After a restart the infos have the new position; the last speed is in `final_info`."""
    envs = shapechanger.make_vec("Hopper", 2, backend="warp", device="cpu", max_episode_steps=1)
    envs.reset(seed=0)
    infos = envs.step(torch.zeros(2, 3))[-1]
    assert infos["final_info"]["_x_velocity"].all()
    assert infos["_x_position"].all()
    assert not infos["_x_velocity"].any()


@pytest.mark.parametrize("task_infos", [True, False])
def test_ends_and_divergence_are_always_in_the_infos(task_infos: bool) -> None:
    """`final_obs` and `diverged` are in every step's infos, with and without task infos."""
    infos = pendulums(task_infos=task_infos).step(torch.zeros(WORLDS, 1))[-1]
    always = ("final_obs", "_final_obs", "diverged", "_diverged")
    assert all(len(infos[name]) == WORLDS for name in always)
    assert not (infos["_final_obs"] | infos["diverged"]).any()
    assert ("reward_survive" in infos) == task_infos


def test_worlds_have_the_time_limit_of_the_id() -> None:
    assert pendulums().max_episode_steps == 1000
    envs = pendulums(max_episode_steps=3)
    ends = [envs.step(torch.zeros(WORLDS, 1))[3].all() for _ in range(8)]
    assert [bool(end) for end in ends] == [False, False, True, False, False, True, False, False]


def test_a_seed_gives_the_same_world_anywhere() -> None:
    """Starts depend on a world's seed and episode alone, not on its place or its neighbours."""
    envs = pendulums()
    first, _ = envs.reset(seed=[4, 5, 6])
    second, _ = envs.reset()
    other = shapechanger.make_vec("InvertedPendulum", 1, backend="warp", device="cpu")
    assert torch.equal(other.reset(seed=5)[0][0], first[1])
    assert torch.equal(other.reset()[0][0], second[1])
    assert not torch.equal(first, second)
    # A reset with a mask does not change the seeds of the other worlds.
    third, _ = envs.reset(seed=[None, 5, None], options={"reset_mask": np.array([0, 1, 0], bool)})
    assert torch.equal(third[1], first[1])
    with pytest.raises(ValueError, match="3 envs and 2 seeds"):
        envs.reset(seed=[1, 2])
    envs.reset(seed=2**63 - 3)
    with pytest.raises(ValueError, match=r"A seed must be a whole number from 0 to 92\d+, got 922"):
        envs.reset(seed=2**63)


def test_worlds_without_seeds_differ() -> None:
    one, other = (
        shapechanger.make_vec("InvertedPendulum", 2, backend="warp", device="cpu").reset()[0]
        for _ in range(2)
    )
    assert not torch.equal(one[0], one[1])
    assert not torch.equal(one, other)


def test_the_noise_is_uniform_or_normal() -> None:
    """Means and variances fit the distributions; seeds and episodes are independent."""
    seeds, episodes = torch.arange(200), torch.zeros(200, dtype=torch.int64)
    flat = uniforms(seeds, episodes, 0, 500)
    assert flat.min() >= 0.0
    assert flat.max() < 1.0
    assert abs(float(flat.mean()) - 0.5) < 4e-3
    assert abs(float(flat.var()) - 1.0 / 12.0) < 2e-3
    bell = uniforms(seeds, episodes, 1, 500, normal=True)
    assert abs(float(bell.mean())) < 0.02
    assert abs(float(bell.var()) - 1.0) < 0.02
    rows = torch.cat([flat, uniforms(seeds, episodes + 1, 0, 500)])
    assert torch.corrcoef(rows)[0, 1:].abs().max() < 0.2


def test_the_noise_never_changes() -> None:
    """The numbers of a seed stay the same from release to release."""
    drawn = uniforms(torch.tensor([0, -7]), torch.tensor([0, 3]), 1, 2)
    expected = torch.tensor(
        [[0.6524484863740322, 0.7012121095215252], [0.363035577252116, 0.6020647478730022]],
        dtype=torch.float64,
    )
    torch.testing.assert_close(drawn, expected, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("velocity", [torch.nan, 1e12])
def test_a_world_that_diverges_restarts_alone(velocity: float) -> None:
    """A diverged world has a reward of 0 and is marked in `diverged`; the others are unaffected."""
    whole, broken = pendulums(), pendulums()
    still = torch.zeros(WORLDS, 1)
    broken.batches[0].qvel[1] = velocity
    expected, found = whole.step(still), broken.step(still)
    for one, other in zip(found[:4], expected[:4], strict=True):
        assert torch.equal(one[[0, 2]], other[[0, 2]])
    observations, rewards, terminated, _, infos = found
    assert terminated.tolist() == [False, True, False]
    assert rewards[1] == 0.0
    assert observations.isfinite().all()
    for told in (infos, infos["final_info"]):
        assert told["diverged"].tolist() == told["_diverged"].tolist() == [False, True, False]
    for _ in range(5):
        found = broken.step(still)
        assert not found[-1]["diverged"].any()
        assert found[0].isfinite().all()


def test_worlds_step_inside_and_outside_inference_mode_without_gradients() -> None:
    """Worlds that stepped in inference mode can step and be reset outside it, without a graph."""
    envs = pendulums()
    with torch.inference_mode():
        for _ in range(2):
            envs.step(torch.zeros(WORLDS, 1))
    envs.reset(seed=1)
    actions = torch.zeros(WORLDS, 1, requires_grad=True)
    observations, rewards, *_ = envs.step(actions)
    assert not observations.requires_grad
    assert not rewards.requires_grad
    assert not envs.batches[0].qpos.requires_grad


def test_a_closed_or_new_vector_env_does_not_step() -> None:
    """The error names the call that is needed."""
    envs = shapechanger.make_vec("InvertedPendulum", 2, backend="warp", device="cpu")
    with pytest.raises(gym.error.ResetNeeded, match=re.escape("call `reset` first")):
        envs.step(torch.zeros(2, 1))
    with pytest.raises(gym.error.ResetNeeded, match="without a mask"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.close()
    for call in (envs.reset, lambda: envs.step(torch.zeros(2, 1))):
        with pytest.raises(gym.error.ClosedEnvironmentError, match="make another one"):
            call()
