"""The backend `warp` refuses missing packages, devices and tasks, and invalid actions."""

from __future__ import annotations

import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

import shapechanger
from shapechanger.envs.ant import AntEnv
from shapechanger.envs.warp import WarpVectorEnv
from shapechanger.errors import BadAction, MissingExtra, UnknownName, VectorEnvError


@pytest.fixture(scope="module")
def pendulums() -> WarpVectorEnv:
    envs = shapechanger.make_vec("InvertedPendulum", 2, backend="warp", device="cpu")
    envs.reset(seed=0)
    return envs


@pytest.mark.parametrize("package", ["mujoco_warp", "warp", "torch"])
def test_a_missing_package_is_named_with_its_extra(
    package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error has the command that installs it."""
    for name in [name for name in sys.modules if name.startswith("shapechanger.envs.warp")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtra, match=r"pip install 'shapechanger\[gpu\]'"):
        shapechanger.make_vec("Ant", 2, backend="warp")


def test_a_device_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error lists the available devices."""
    with pytest.raises(UnknownName, match=r"No device matches 'cuda:9'.* There are: cpu"):
        shapechanger.make_vec("Ant", 2, backend="warp", device="cuda:9")
    with pytest.raises(UnknownName, match="Did you mean 'cpu'"):
        shapechanger.make_vec("Ant", 2, backend="warp", device="cpuu")


class _HigherReward(AntEnv):
    pass


def test_a_new_or_changed_task_has_no_batched_functions() -> None:
    """The functions of a base class are not used, because the rewards may differ."""
    with pytest.raises(
        VectorEnvError, match=r"no batched functions.*Ant, AmputatedAnt.*Humanoid.* FingerTrack"
    ):
        shapechanger.make_vec("Car", 2, backend="warp", device="cpu")
    gym.register("test/HigherReward-v0", _HigherReward)
    try:
        with pytest.raises(VectorEnvError, match="test/HigherReward-v0 has no batched functions"):
            shapechanger.make_vec("test/HigherReward-v0", 2, backend="warp", device="cpu")
    finally:
        gym.registry.pop("test/HigherReward-v0")


@pytest.mark.parametrize(
    ("actions", "sentence"),
    [
        (torch.zeros(2, 2), r"numbers of shape \(2, 1\), got torch.float32 of shape \(2, 2\)"),
        (torch.zeros(2, 1, dtype=torch.bool), "got torch.bool"),
        (torch.tensor([[0.0], [np.nan]]), "action of world 1 has numbers that are not finite"),
        (np.array([[np.inf], [0.0]]), "action of world 0"),
        ("left", "must be a tensor or an array"),
    ],
)
def test_actions_are_checked_before_anything_moves(
    pendulums: WarpVectorEnv, actions: Any, sentence: str
) -> None:
    """No world has stepped after the error."""
    before = pendulums.batches[0].qpos.clone()
    with pytest.raises(BadAction, match=sentence):
        pendulums.step(actions)
    assert torch.equal(pendulums.batches[0].qpos, before)
