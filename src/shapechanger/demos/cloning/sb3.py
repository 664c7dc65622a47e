"""Cloned policies as starting points for reinforcement learning with Stable-Baselines3.

The encoders of the clone are frozen, and the learner works on their features, so untrained critics
cannot destroy the encoders.
"""

from __future__ import annotations

from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.network import CameraNetwork, CameraPolicy
from shapechanger.errors import MissingExtra, PolicyError, translate_errors
from shapechanger.policy import PolicyCard

with translate_errors(ImportError, to=lambda _: MissingExtra("stable-baselines3", "learn")):
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

# Logarithm of the initial standard deviation of an action before it is squashed. A larger one would
# drown the actions of the clone in noise.
_LOG_STD: Final = -2.0
_BUFFER: Final = 10_000  # Observations; SAC's default of a million images would take 50 GB.


class NormedReLU(nn.Module):
    """Layer normalisation followed by a ReLU.

    It keeps critics from overestimating actions without data: P. Ball et al., "Efficient Online
    Reinforcement Learning with Offline Data", ICML 2023.
    """

    def forward(self, x: Tensor) -> Tensor:
        """Apply the layer; shape (n, k) in and out."""
        return functional.relu(functional.layer_norm(x, x.shape[-1:]))


class ClonedPerception(BaseFeaturesExtractor):
    """Frozen encoders of a clone, from raw observations to features.

    Observations are images, states, or a Dict of both; the card of the clone is JSON.
    """

    def __init__(self, observation_space: Any, card: str) -> None:
        network = CameraNetwork(msgspec.json.decode(card, type=PolicyCard))
        super().__init__(observation_space, network.hands.in_features)  # pyright: ignore[reportUnknownMemberType]
        self.network = network
        del network.hands
        self.requires_grad_(False)

    def forward(self, observations: Tensor | dict[str, Tensor]) -> Tensor:
        """Return the features, shape (n, features)."""
        if not isinstance(observations, dict):
            observations = {"image" if self.network.seen else "state": observations}
        pictures, states = observations.get("image"), observations.get("state")
        return self.network.features(  # Stable-Baselines3 has colours first, and numbers as floats.
            None if pictures is None else pictures.permute(0, 2, 3, 1).byte().numpy(force=True),
            None if states is None else states.numpy(force=True),
        )


class _Between(nn.Module):
    """Map from (-inf, inf) to the range of the actions."""

    def __init__(self, space: Any) -> None:
        super().__init__()
        low, high = (torch.as_tensor(end.astype(np.float32)) for end in (space.low, space.high))
        self.register_buffer("low", low, persistent=False)
        self.register_buffer("half_range", 0.5 * (high - low), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        return cast("Tensor", self.low) + (torch.tanh(x) + 1.0) * cast("Tensor", self.half_range)


class ClonedPolicy(ActorCriticPolicy):
    """Actor and critic of PPO, with a squashed mean action as in a clone."""

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        space = cast("Any", self).action_space
        if isinstance(space, spaces.Box):
            self.action_net = nn.Sequential(self.action_net, _Between(space))


def as_sac(
    policy: CameraPolicy, size: tuple[int, int] | None, *, seed: int = 0, **settings: Any
) -> SAC:
    """Return the policy as a SAC model of Stable-Baselines3 on raw observations.

    Its deterministic action equals the policy's. Its critics are untrained, and lead the actor
    astray at first. `size` is the rows and columns of the raw images, None without images. The
    settings are arguments of `stable_baselines3.SAC`; by default, `learning_starts` is 0, and the
    replay buffer holds 10,000 observations.
    """
    if policy.net.classes:
        text = "This policy chooses among fixed actions, but SAC needs numbers"
        raise PolicyError(f"{text}: use PPO, or train the policy with --head regression.")
    settings = {"learning_starts": 0, "buffer_size": _BUFFER, "device": "cpu", **settings}
    kwargs = _perception(policy) | {
        # Like the policy, it has no layer between features and actions.
        "net_arch": {"pi": [], "qf": [256, 256]},
        "activation_fn": NormedReLU,
        "share_features_extractor": True,
    }
    env = _Spaces(policy, size)
    kind = "MultiInputPolicy" if isinstance(env.observation_space, spaces.Dict) else "MlpPolicy"
    model = SAC(kind, env, seed=seed, policy_kwargs=kwargs, **settings)
    actor = cast("Any", model.actor)
    with torch.no_grad():
        actor.log_std.weight.zero_()
        actor.log_std.bias.fill_(_LOG_STD)
    _copy_weights(policy, actor.mu, model.actor, model.critic, model.critic_target)
    return model


def as_ppo(
    policy: CameraPolicy, size: tuple[int, int] | None, *, seed: int = 0, **settings: Any
) -> PPO:
    """Return the policy as a PPO model, as `as_sac` does; `settings` are arguments of PPO.

    The actions of a policy with classes are indices of `policy.net.classes`: wrap the env in
    `gymnasium.wrappers.TransformAction`.
    """
    settings = {"device": "cpu", **settings}
    kwargs = _perception(policy) | {"net_arch": {"pi": [], "vf": [64, 64]}, "ortho_init": False}
    if not policy.net.classes:
        kwargs["log_std_init"] = _LOG_STD
    model = PPO(ClonedPolicy, _Spaces(policy, size), seed=seed, policy_kwargs=kwargs, **settings)
    acting = cast("Any", model.policy)
    _copy_weights(policy, acting.action_net if policy.net.classes else acting.action_net[0], acting)
    return model


class _Spaces(gym.Env[Any, Any]):
    """Spaces of a policy as an env that cannot be stepped."""

    def __init__(self, policy: CameraPolicy, size: tuple[int, int] | None) -> None:
        net, card = policy.net, policy.card
        parts: dict[str, gym.Space[Any]] = {}
        if net.eyes != "none":
            if size is None:
                raise PolicyError("The size of the images is needed for this policy.")
            parts["image"] = spaces.Box(0, 255, (*size, 3), np.uint8)
        if card.observation is not None:
            parts["state"] = spaces.Box(-np.inf, np.inf, (card.observation.size,), np.float32)
        whole = spaces.Dict(parts)
        self.observation_space = whole if len(parts) > 1 else next(iter(parts.values()))
        if net.classes:
            self.action_space = spaces.Discrete(len(net.classes))
        else:
            low = np.asarray(net.low or (-1.0,) * card.action_size, np.float32)
            high = np.asarray(net.high or (1.0,) * card.action_size, np.float32)
            self.action_space = spaces.Box(low, high, dtype=np.float32)


def _perception(policy: CameraPolicy) -> dict[str, Any]:
    card = policy.carded(data={}, settings=None, command="").card
    return {
        "features_extractor_class": ClonedPerception,
        "features_extractor_kwargs": {"card": msgspec.json.encode(card).decode()},
        "normalize_images": False,
    }


def _copy_weights(policy: CameraPolicy, hands: nn.Module, *owners: Any) -> None:
    """Copy a policy's output layer to `hands`, its encoders to each owner's features extractor."""
    hands.load_state_dict(policy.network.hands.state_dict())
    state = policy.network.state_dict()
    known = {name: value for name, value in state.items() if not name.startswith("hands.")}
    for owner in owners:
        owner.features_extractor.network.load_state_dict(known)
