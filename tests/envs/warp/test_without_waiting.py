"""A step reads one result from the device and copies no data to it, except for `FingerTrack`."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import shapechanger
from shapechanger.morphology import Stretch
from shapechanger.transfer.learners.rsl import RslVecEnv, _Returns  # pyright: ignore[reportPrivateUsage]
from tests.envs.warp.fake_device import fake_device

LONG = [Stretch("*shank*", 1.2)]


def _actions(envs: Any, number: int) -> Any:
    generator = torch.Generator().manual_seed(number)
    parts = [
        2.0 * torch.rand(len(batch.numbers), batch.action_layout.size, generator=generator) - 1.0
        for batch in envs.batches
    ]
    moved = [part.to(envs.device) for part in parts]
    return moved if isinstance(envs.action_space, gym.spaces.Tuple) else moved[0]


@pytest.mark.parametrize(
    ("name", "syncs", "copies", "arguments"),
    [
        ("Ant", 1, 0, {"bodies": ["Ant", "ExtendedAnt", LONG]}),
        ("Ant", 1, 0, {"pool": ["Ant", LONG]}),
        ("Ant", 1, 0, {"task_infos": False}),
        ("Hopper", 1, 0, {}),
        ("InvertedDoublePendulum", 1, 0, {}),
        ("Humanoid", 1, 0, {}),
        ("Finger", 1, 0, {}),
        # Paths are NumPy functions: a second synchronisation reads which worlds have started, and a
        # copy writes the points of the paths.
        ("FingerTrack", 2, 1, {}),
    ],
)
def test_a_step_waits_only_to_check_its_actions(
    name: str,
    syncs: int,
    copies: int,
    arguments: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ends, restarts and divergence add no wait except for FingerTrack; no call mixes devices."""
    with fake_device(monkeypatch) as device:
        envs = shapechanger.make_vec(name, 3, backend="warp", max_episode_steps=4, **arguments)
        envs.reset(seed=0)
        ended = 0
        for number in range(6):
            actions = _actions(envs, number)
            if number == 2:
                envs.batches[0].qvel[0] = torch.nan
            device.forget()
            _, _, terminated, truncated, infos = envs.step(actions)
            counted = dict(device.syncs), dict(device.copies), dict(device.mixed)
            if name != "FingerTrack" or not bool((terminated | truncated).any()):
                assert sum(counted[0].values()) == syncs, counted
                assert sum(counted[1].values()) == copies, counted
            assert not any(counted[2].values()), counted
            assert bool(infos["diverged"][0]) == (number == 2)
            ended += int((terminated | truncated).sum())
        assert ended >= 3
        envs.close()


def test_a_learner_adds_no_synchronisation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The learner scales rewards by the standard deviation of returns on the device."""
    with fake_device(monkeypatch) as device:
        envs = RslVecEnv(
            shapechanger.make_vec("Ant", 3, backend="warp", max_episode_steps=3, task_infos=False),
            seed=0,
        )
        spaces = DummyVecEnv([lambda: gym.make("CartPole-v1")])
        returns = _Returns(3, "cuda:0", VecNormalize(spaces), 0.99)
        actions = torch.zeros(3, 8).to("cuda:0")
        for _ in range(4):
            device.forget()
            _, rewards, ends, _ = envs.step(actions)
            scaled = returns.scaled(rewards, ends)
            assert scaled.device.type == "cuda"
            assert sum(device.syncs.values()) == 1, device.syncs
            assert not sum(device.copies.values()), device.copies
            assert not sum(device.mixed.values()), device.mixed
