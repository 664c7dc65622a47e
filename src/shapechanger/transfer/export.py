"""Export trained policies as ONNX, from the env's observations to its actions, in its units.

The metadata contains the names of the layouts and the card, so that a program without Shapechanger
can read the meaning of each number.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from torch import Tensor, nn

from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.policy import PolicyCard, export_network
from shapechanger.transfer.actions import ActionScale
from shapechanger.transfer.identities import identities_in
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.limbs.envs import fitted
from shapechanger.transfer.limbs.rows import LimbRows
from shapechanger.transfer.transplant.layers import CLIP, EPSILON
from shapechanger.transfer.transplant.model import check_supported


def export_onnx(policy: TrainedPolicy, path: Path) -> None:
    """Write a policy as ONNX; TransplantError unless it is an `MlpPolicy` of PPO, SAC or TQC.

    The input `observation` is float64 of shape (n, observations), as the env returns it. The output
    `action` is float32 of shape (n, actions), in the units of the env.
    """
    check_supported(policy.model)
    _write(_MeanActions(policy), policy.card, path)


def export_limbs(policy: TrainedPolicy, env: gym.Env[Any, Any], ref: EnvRef, path: Path) -> None:
    """Write a policy of limbs as ONNX for one body, whose description is constant in the graph.

    Raises:
        TransplantError: If the body belongs to another family than the policy's.
        StudyError: If the body has more limbs than the policy has room for.
    """
    settings: Any = policy.card.settings
    rows = fitted(env, policy.card.layouts[0], settings.room).rows
    observation, action = layouts_of(env)
    exported = policy.carded(
        env=ref, observation=observation, action=action, identity=identities_in(ref, env, settings)
    )
    _write(_LimbActions(policy.model.policy, rows), exported.card, path)


def _write(network: nn.Module, card: PolicyCard, path: Path) -> None:
    observation, action = card.layouts
    export_network(
        network,
        {"observation": torch.zeros((2, observation.size), dtype=torch.float64)},
        card,
        path,
        observation_names=json.dumps(observation.names),
        action_names=json.dumps(action.names),
    )


def _constant(module: nn.Module, **arrays: Any) -> None:
    """Register arrays as buffers of a module without changing their precision."""
    for name, array in arrays.items():
        module.register_buffer(name, torch.as_tensor(np.asarray(array)))


class _MeanActions(nn.Module):
    """The mean actions of a policy, with its normalisation and bounds."""

    def __init__(self, policy: TrainedPolicy) -> None:
        super().__init__()
        model: Any = policy.model
        net, space = model.policy, model.action_space
        self.squashes = not hasattr(net, "mlp_extractor")
        self.network = (
            nn.Sequential(net.actor.latent_pi, net.actor.mu)
            if self.squashes
            else nn.Sequential(net.mlp_extractor.policy_net, net.action_net)
        )
        self.normalises = policy.normalisation is not None
        if policy.normalisation is not None:
            statistics = policy.normalisation.observation
            deviation = np.sqrt(np.asarray(statistics.var, np.float64) + EPSILON)
            _constant(self, mean=np.asarray(statistics.mean, np.float64), deviation=deviation)
        _constant(self, low=space.low.astype(np.float32), high=space.high.astype(np.float32))
        scale = ActionScale.between(space, policy.card.layouts[1])._asdict()
        _constant(self, **{f"env_{n}": side.astype(np.float32) for n, side in scale.items()})

    def forward(self, *given: Tensor) -> Tensor:
        """Return actions, shape (n, actions), in the units of the env, for observations."""
        known: Any = self
        (seen,) = given
        if self.normalises:
            seen = ((seen - known.mean) / known.deviation).clamp(-CLIP, CLIP)
        action = self.network(seen.float())
        if self.squashes:
            action = torch.tanh(action) * (0.5 * (known.high - known.low))
            action = action + 0.5 * (known.high + known.low)
        action = torch.minimum(torch.maximum(action, known.low), known.high)
        action = action * known.env_half + known.env_middle
        return torch.minimum(torch.maximum(action, known.env_low), known.env_high)


class _LimbActions(nn.Module):
    def __init__(self, policy: Any, rows: LimbRows) -> None:
        super().__init__()
        self.network = policy.actor_net
        self.shape = (-1, rows.room + 1, rows.columns.width)
        _constant(
            self,
            scale=rows.scale,
            offset=rows.offset,
            selection=rows.selection,
            constant=rows.constant,
            actuators=rows.actuators.astype(np.int64),
            low=rows.low.astype(np.float32),
            reach=(0.5 * (rows.high - rows.low)).astype(np.float32),
        )

    def forward(self, *given: Tensor) -> Tensor:
        """Return actions, shape (n, actions), in the units of the env, for observations."""
        known: Any = self
        (observation,) = given
        rows = (observation * known.scale + known.offset) @ known.selection + known.constant
        limbs = self.network(rows.float().reshape(self.shape)).clamp(-1.0, 1.0)
        return (limbs[:, known.actuators] + 1.0) * known.reach + known.low
