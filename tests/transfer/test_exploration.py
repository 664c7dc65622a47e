"""Training from a policy explores, however little that policy does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import torch
from stable_baselines3.common.callbacks import BaseCallback

from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners import ignore
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.sb3 import START_LOG_STD, Sb3Learner
from shapechanger.transfer.learners.settings import Sb3Settings
from tests.transfer.studies import BIG, SMALL, TINY

_LONG = msgspec.structs.replace(TINY, n_steps=256, eval_every=512, steps=512)


class _Actions(BaseCallback):
    """Collects the actions of the first rollout, and what the mean would have been."""

    def __init__(self) -> None:
        super().__init__()
        self.noise = np.empty(0)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        model: Any = self.model
        seen = torch.as_tensor(model.rollout_buffer.observations.reshape(-1, 4))
        with torch.no_grad():
            mean = model.policy.get_distribution(seen).mode().numpy()
        self.noise = model.rollout_buffer.actions.reshape(mean.shape) - mean


def _source(log_std: float) -> TrainedPolicy:
    """A policy whose actions have this standard deviation."""
    policy = Sb3Learner("tiny", TINY).train(SMALL, 32, 0, on_evaluation=lambda _: None)
    model: Any = policy.model
    model.policy.log_std.data.fill_(log_std)
    return policy


def _tuned(source: TrainedPolicy, settings: Sb3Settings = _LONG) -> tuple[TrainedPolicy, Any]:
    actions = _Actions()
    body_map = BodyMap.between(
        source.card.observation, source.card.observation, source.card.action, source.card.action
    )
    policy = Sb3Learner("tiny", settings).train(
        BIG, 512, 0, start=source, body_map=body_map, callback=actions, on_evaluation=lambda _: None
    )
    return policy, actions.noise


@pytest.mark.parametrize(
    ("source", "start"), [(-4.0, START_LOG_STD), (-1.3, START_LOG_STD), (-0.3, -0.3)]
)
def test_fine_tuning_explores(source: float, start: float, tmp_path: Path) -> None:
    """A collapsed deviation is raised to the stated one, a larger one kept; the card says so."""
    policy, noise = _tuned(_source(source))
    assert policy.card.start_log_std == (pytest.approx(start),)
    assert noise.std() == pytest.approx(np.exp(start), rel=0.15)
    save_policy(policy, tmp_path / "policy.safetensors")
    assert load_policy(tmp_path / "policy.safetensors").card == policy.card


def test_it_never_explores_more_than_a_new_policy() -> None:
    """Where a learner starts with less, so does fine-tuning."""
    policy, _ = _tuned(_source(-4.0), msgspec.structs.replace(_LONG, log_std_init=-2.0))
    assert policy.card.start_log_std == (pytest.approx(-2.0),)


def test_a_new_policy_has_no_such_start() -> None:
    assert _source(-4.0).card.start_log_std is None


def test_evaluations_that_nobody_reads_are_left_out() -> None:
    learner = Sb3Learner("tiny", TINY)
    steps: list[int] = []
    seen = learner.train(SMALL, 96, 0, on_evaluation=lambda e: steps.append(e.steps))
    unseen = learner.train(SMALL, 96, 0, on_evaluation=ignore)
    assert steps == [0, 32, 64, 96]
    weights: list[Any] = [policy.model.policy.state_dict() for policy in (seen, unseen)]
    for name, tensor in weights[0].items():
        assert torch.equal(tensor, weights[1][name]), name
