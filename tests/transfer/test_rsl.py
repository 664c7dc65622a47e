"""PPO of rsl-rl on worlds of a device, with the policies of Stable-Baselines3."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import torch

import shapechanger
from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.learners import ignore
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.rsl import RslLearner, RslVecEnv
from shapechanger.transfer.learners.settings import RslPpoSettings
from shapechanger.transfer.runs import learner_of

PENDULUM = EnvRef("shapechanger/InvertedPendulum-v1")
SETTINGS = RslPpoSettings(
    n_envs=8,
    n_steps=64,
    batch_size=128,
    n_epochs=10,
    learning_rate=2e-3,
    normalise=True,
    steps=2048,
    eval_every=2048,
    device="cpu",
)


def worlds(**arguments: Any) -> Any:
    """Return four pendulums that restart in the step of their end."""
    return shapechanger.make_vec("InvertedPendulum", 4, backend="warp", device="cpu", **arguments)


def test_a_short_training_balances_longer(tmp_path: Path) -> None:
    """The return rises, and the policy in the file acts as the trained one, on the CPU env."""
    found: list[Evaluation] = []
    counted: list[int] = []
    learner = learner_of("rsl-ppo", SETTINGS)
    policy = learner.train(PENDULUM, 2048, 0, on_evaluation=found.append, on_steps=counted.append)
    assert [evaluation.steps for evaluation in found] == [0, 2048]
    assert counted == list(range(8, 2049, 8))
    assert found[-1].mean_return > 2.0 * found[0].mean_return
    assert policy.card.steps == 2048
    assert policy.card.settings == SETTINGS
    path = tmp_path / "pendulum.safetensors"
    save_policy(policy, path)
    again = load_policy(path)
    assert again.card == policy.card
    seen = np.random.default_rng(0).normal(size=(5, 4))
    np.testing.assert_array_equal(again.act(seen), policy.act(seen))
    assert learner.origin(path).steps == 2048


def test_a_policy_of_any_number_of_worlds_is_loaded(tmp_path: Path) -> None:
    """A device steps more worlds than there may be envs of other learners."""
    few = msgspec.structs.replace(SETTINGS, n_steps=2, batch_size=16, eval_every=16)
    trained = RslLearner("rsl-ppo", few).train(PENDULUM, 16, 0, on_evaluation=ignore)
    many = msgspec.structs.replace(SETTINGS, n_envs=8192, eval_every=2**20)
    trained.carded(settings=many).save(tmp_path / "many.safetensors")
    loaded = load_policy(tmp_path / "many.safetensors")
    assert loaded.card.settings.n_envs == 8192
    seen = np.zeros((1, 4))
    np.testing.assert_array_equal(loaded.act(seen), trained.act(seen))


def test_what_the_adapter_promises() -> None:
    """Shapes, ends and `time_outs` are as rsl-rl reads them."""
    envs = RslVecEnv(worlds(max_episode_steps=2), seed=0)
    assert (envs.num_envs, envs.num_actions, envs.max_episode_length) == (4, 1, 2)
    assert envs.get_observations()["policy"].shape == (4, 4)
    actions = torch.zeros(4, 1)
    assert not envs.step(actions)[2].any()
    assert envs.episode_length_buf.tolist() == [1] * 4
    observations, rewards, ends, extras = envs.step(actions)
    assert ends.all()
    assert extras["time_outs"].all()
    assert rewards.tolist() == [1.0] * 4
    assert observations["policy"].abs().max() <= 0.01
    envs.episode_length_buf = torch.tensor([1, 0, 0, 0])
    assert envs.step(actions)[2].tolist() == [True, False, False, False]


def test_what_it_refuses() -> None:
    """Callbacks and budgets below one evaluation, which other learners take."""
    learner = RslLearner("rsl-ppo", SETTINGS)
    with pytest.raises(StudyError, match="takes no callback"):
        learner.train(PENDULUM, 2048, 0, callback=object(), on_evaluation=print)
    with pytest.raises(StudyError, match="smaller than one evaluation"):
        learner.train(PENDULUM, 512, 0, on_evaluation=print)
