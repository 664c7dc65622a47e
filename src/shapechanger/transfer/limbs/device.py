"""Policies of limbs on many worlds of one device: rows, networks of rsl-rl, and the learner."""

# pyright: reportPrivateUsage=false, reportMissingTypeStubs=false

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import torch
from rsl_rl.models import MLPModel
from rsl_rl.modules.distribution import GaussianDistribution
from tensordict import TensorDict
from torch import Tensor, nn

from shapechanger.contract.env_ref import EnvRef
from shapechanger.transfer.learners.rsl import GROUP, RslLearner, RslTraining, RslVecEnv
from shapechanger.transfer.limbs.envs import LimbLearner, bodies_in_turn, together
from shapechanger.transfer.limbs.policy import LimbPolicy
from shapechanger.transfer.limbs.rows import LimbRows


class DeviceRows:
    """Map between observations and actions of `make_vec(backend="warp")` and rows: `LimbRows`."""

    def __init__(self, envs: Any, each: Sequence[LimbRows]) -> None:
        self.room = each[0].room
        self._apart = isinstance(envs.single_action_space, gym.spaces.Tuple)
        # Worlds of a batch have arrays of the same shapes, with features in the same order.
        self._batches: list[tuple[Tensor, LimbRows]] = []
        floats = ("scale", "offset", "selection", "constant", "low", "high")
        for batch in envs.batches:
            device = batch.numbers.device
            rows = LimbRows.stacked([each[int(i)] for i in batch.numbers.tolist()])
            tensors: dict[str, Any] = {
                name: torch.as_tensor(getattr(rows, name), dtype=torch.float32, device=device)
                for name in floats
            }
            tensors["actuators"] = torch.as_tensor(rows.actuators, device=device)
            self._batches.append((batch.numbers, replace(rows, **tensors)))

    def of(self, observations: Any) -> Tensor:
        """Return the rows of all worlds, flattened, shape (n, (room + 1) * width)."""
        parts = [
            rows.of(observations[i] if self._apart else observations[numbers])
            for i, (numbers, rows) in enumerate(self._batches)
        ]
        return self._gathered(parts)

    def actions(self, limbs: Tensor) -> Tensor | list[Tensor]:
        """Return the actions of all worlds or each batch for numbers from -1 to 1, (n, room)."""
        parts = [rows.actions(limbs[numbers]) for numbers, rows in self._batches]
        return parts if self._apart else self._gathered(parts)

    def _gathered(self, parts: list[Tensor]) -> Tensor:
        count = sum(len(part) for part in parts)
        whole = parts[0].new_empty((count, parts[0].shape[1]))
        for (numbers, _), part in zip(self._batches, parts, strict=True):
            whole[numbers] = part
        return whole


class LimbModel(MLPModel):
    """Adapter that makes a network of `LimbPolicy` an actor or critic of rsl-rl."""

    def __init__(self, policy: LimbPolicy, net: nn.Module, *, acts: bool) -> None:
        # Skips the constructor of MLPModel, which would build its own network.
        nn.Module.__init__(self)
        self.obs_groups, self.obs_normalization = [GROUP], False
        self.obs_normalizer = nn.Identity()
        self.mlp: Any = copy.deepcopy(net)
        # All limbs share one deviation, whatever their number.
        self.distribution: Any = GaussianDistribution(1, std_type="log") if acts else None
        self._as_rows = policy.rows

    def get_latent(self, obs: TensorDict, masks: Any = None, hidden_state: Any = None) -> Tensor:
        """Return the rows, shape (n, 1 + limbs, width)."""
        self._rows = self._as_rows(super().get_latent(obs, masks, hidden_state))
        return self._rows

    def forward(self, *arguments: Any, **more: Any) -> Tensor:
        """Return actions, shape (n, limbs), or values, shape (n, 1)."""
        found = super().forward(*arguments, **more)
        return found.unsqueeze(-1) if self.distribution is None else found

    @property
    def output_entropy(self) -> Tensor:
        """Entropy of the actions of limbs that have a motor, shape (n,)."""
        return LimbPolicy.over_motors(self.distribution._distribution.entropy(), self._rows)

    def get_output_log_prob(self, outputs: Tensor) -> Tensor:
        """Return log-probabilities, shape (n,), of actions of shape (n, limbs)."""
        return LimbPolicy.over_motors(self.distribution._distribution.log_prob(outputs), self._rows)


class LimbTraining(RslTraining):
    """rsl-rl's PPO with the weights of a policy of limbs."""

    def _networks(self, seen: TensorDict) -> tuple[Any, Any]:
        policy = self._model.policy
        return (
            LimbModel(policy, policy.actor_net, acts=True),
            LimbModel(policy, policy.critic_net, acts=False),
        )

    def _pairs(self) -> list[tuple[Any, Any]]:
        policy = self._model.policy
        return [(self._actor.mlp, policy.actor_net), (self._critic.mlp, policy.critic_net)]


class RslLimbLearner(RslLearner, LimbLearner):
    """PPO of rsl-rl with a policy of limbs, on worlds of different bodies."""

    def _worlds(self, env: EnvRef) -> tuple[EnvRef, list[LimbRows]]:
        bodies, rows = bodies_in_turn(env, self.settings.n_envs, self.settings.room)
        return together(bodies), rows

    def _begin(self, worlds: Any, seed: int, rows: Any, model: Any, statistics: Any) -> RslTraining:
        envs = RslVecEnv(worlds, seed, DeviceRows(worlds, rows))
        return LimbTraining(envs, model, statistics, self.settings)
