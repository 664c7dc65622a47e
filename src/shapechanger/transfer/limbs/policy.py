"""A policy for any number of limbs, as a class of policies of Stable-Baselines3.

The network follows URMA (N. Bohlinger and others, One Policy to Run Them All, CoRL 2024), without
its learned temperature and layer normalisation, and with one standard deviation for all actions.
One network encodes each limb. The codes of all limbs are summed with weights that depend only on
the limbs' descriptions. Another network decodes the action of each limb from the sum, its code and
its description.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, cast

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor, nn
from torch.distributions import Normal

from shapechanger.transfer.limbs.rows import DESCRIBED

_CODE = 64
_HIDDEN = 64
_CORE = 128


def _layers(*widths: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.Tanh()]
    return nn.Sequential(*layers[:-1])


class LimbNetwork(nn.Module):
    """Network that maps the rows of a body to a number per limb, or to one number per body."""

    def __init__(self, width: int, *, per_limb: bool) -> None:
        super().__init__()
        self.trunk = nn.Sequential(_layers(width, _HIDDEN), nn.Tanh())
        self.encode = nn.Sequential(_layers(width, _HIDDEN, _CODE), nn.Tanh())
        self.weigh = _layers(DESCRIBED, _HIDDEN, _CODE)
        self.core = nn.Sequential(_layers(_HIDDEN + _CODE, _CORE, _HIDDEN), nn.Tanh())
        self.per_limb = per_limb
        if per_limb:
            self.decode = _layers(_HIDDEN + _CODE + DESCRIBED, _HIDDEN, 1)
        else:
            self.decode = nn.Linear(_HIDDEN, 1)

    def forward(self, rows: Tensor) -> Tensor:
        """Return shape (n, limbs) if `per_limb`, else (n,), for rows of (n, 1 + limbs, width)."""
        limbs = rows[:, 1:]
        description = limbs[..., :DESCRIBED]
        code = self.encode(limbs)
        # Rows without a limb get the weight 0 from the softmax.
        weight = self.weigh(description) + (limbs[..., :1] - 1.0) * 1e4
        summed = (torch.softmax(weight, dim=1) * code).sum(dim=1)
        core = self.core(torch.cat([self.trunk(rows[:, 0]), summed], dim=1))
        if not self.per_limb:
            return self.decode(core).squeeze(-1)
        shared = core.unsqueeze(1).expand(-1, limbs.shape[1], -1)
        return self.decode(torch.cat([shared, code, description], dim=2)).squeeze(-1)


class PaddedNetwork(nn.Module):
    """A multilayer perceptron on all rows, flattened; rows without a limb are zero."""

    def __init__(self, rows: int, width: int, *, per_limb: bool, hidden: Sequence[int]) -> None:
        super().__init__()
        self.per_limb = per_limb
        self.layers = _layers(rows * width, *hidden, rows - 1 if per_limb else 1)

    def forward(self, rows: Tensor) -> Tensor:
        """Return shape (n, limbs) if `per_limb`, else (n,), for rows of (n, 1 + limbs, width)."""
        out = self.layers(rows.flatten(1))
        return out if self.per_limb else out.squeeze(-1)


class LimbPolicy(ActorCriticPolicy):
    """Actor and critic on rows; the probability of an action ignores limbs without a motor."""

    def __init__(
        self,
        observation_space: Any,
        action_space: Any,
        lr_schedule: Any,
        *,
        network: Literal["limbs", "padded"] = "limbs",
        hidden: Sequence[int] = (256, 256),
        **arguments: Any,
    ) -> None:
        self._rows = int(action_space.shape[0]) + 1
        self._width = int(observation_space.shape[0]) // self._rows
        self._network = network
        self._hidden = hidden
        cast("Any", super()).__init__(observation_space, action_space, lr_schedule, **arguments)

    def _build(self, lr_schedule: Any) -> None:
        width = self._width
        if self._network == "limbs":
            self.actor_net: nn.Module = LimbNetwork(width, per_limb=True)
            self.critic_net: nn.Module = LimbNetwork(width, per_limb=False)
        else:
            self.actor_net, self.critic_net = (
                PaddedNetwork(self._rows, width, per_limb=each, hidden=self._hidden)
                for each in (True, False)
            )
        if self.ortho_init:
            for net, gain in ((self.actor_net, 0.01), (self.critic_net, 1.0)):
                linear = [layer for layer in net.modules() if isinstance(layer, nn.Linear)]
                for layer in linear:
                    last = layer is linear[-1]
                    nn.init.orthogonal_(layer.weight, gain if last else np.sqrt(2.0))
                    nn.init.zeros_(layer.bias)
        self.log_std = nn.Parameter(torch.full((1,), float(self.log_std_init)))
        self.optimizer = cast("Any", self.optimizer_class)(
            self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs
        )

    def rows(self, observation: Tensor) -> Tensor:
        """Return observations as rows, shape (n, 1 + limbs, width)."""
        return observation.float().reshape(len(observation), -1, self._width)

    def act(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return mean actions from -1 to 1, shape (n, limbs).

        The observations are flattened rows, shape (n, (1 + limbs) * width).
        """
        with torch.no_grad():
            mean = self.actor_net(self.rows(torch.as_tensor(observations)))
        return mean.clamp(-1.0, 1.0).numpy()

    def _normal(self, rows: Tensor) -> Normal:
        mean = self.actor_net(rows)
        return Normal(mean, self.log_std.exp().expand_as(mean), validate_args=False)

    @staticmethod
    def over_motors(numbers: Tensor, rows: Tensor) -> Tensor:
        """Sum numbers, shape (n, limbs), over the limbs that have a motor."""
        return (numbers * rows[:, 1:, 1]).sum(dim=1)

    def forward(self, obs: Tensor, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return actions, values and log-probabilities of the actions."""
        rows = self.rows(obs)
        normal = self._normal(rows)
        actions = normal.mean if deterministic else normal.sample()
        values = self.critic_net(rows).unsqueeze(-1)
        return actions, values, self.over_motors(normal.log_prob(actions), rows)

    def evaluate_actions(self, obs: Tensor, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return values, log-probabilities of the actions, and the entropy."""
        rows = self.rows(obs)
        normal = self._normal(rows)
        entropy = self.over_motors(normal.entropy(), rows)
        values = self.critic_net(rows).unsqueeze(-1)
        return values, self.over_motors(normal.log_prob(actions), rows), entropy

    def predict_values(self, obs: Tensor) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the values of observations, shape (n, 1)."""
        return self.critic_net(self.rows(obs)).unsqueeze(-1)

    def _predict(self, observation: Tensor, deterministic: bool = False) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        normal = self._normal(self.rows(observation))
        return normal.mean if deterministic else normal.sample()
