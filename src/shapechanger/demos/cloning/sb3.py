"""A cloned policy as the beginning of reinforcement learning with Stable-Baselines3."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor, nn

from shapechanger.demos.cloning.errors import PolicyError
from shapechanger.demos.cloning.network import ACTIONS, Eyes
from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.errors import MissingExtra

try:
    from stable_baselines3 import SAC
    from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

__all__ = ["CameraFeatures", "PreparedPictures", "from_sb3", "to_sb3"]


class CameraFeatures(BaseFeaturesExtractor):
    """The eyes of a `CameraPolicy` as Stable-Baselines3 asks for them.

    Args:
        observation_space: Prepared pictures, their colours first.
        framing: Their size.
        channels: Filters of each layer.
        features: How many features.
    """

    def __init__(
        self,
        observation_space: spaces.Box,
        framing: Framing,
        channels: tuple[int, ...],
        features: int,
    ) -> None:
        super().__init__(observation_space, features)  # pyright: ignore[reportUnknownMemberType]
        self.eyes = Eyes(framing, channels, features)

    def forward(self, observations: Tensor) -> Tensor:
        """Features, shape (n, features), of pictures in [0, 1]."""
        return self.eyes(observations)


class PreparedPictures(gym.ObservationWrapper[NDArray[np.uint8], Any, NDArray[np.uint8]]):
    """An env that shows its pictures as a policy sees them: a learner keeps thousands of them.

    Args:
        env: Its observations are pictures of shape (H, W, 3).
        framing: What the policy sees.

    Raises:
        PolicyError: If its observations are something else.
        CloningError: If their size does not fit the framing.
    """

    def __init__(self, env: gym.Env[NDArray[np.uint8], Any], framing: Framing) -> None:
        space = cast("gym.Space[Any]", env.observation_space)
        shape = space.shape or ()
        dtype = cast("Any", space).dtype
        if not isinstance(space, spaces.Box) or dtype != np.uint8 or len(shape) != 3:
            raise PolicyError(f"A policy that drives by pictures cannot see {space}.")
        super().__init__(env)
        self._framing = framing
        self.observation_space = spaces.Box(0, 255, framing.shape, np.uint8)
        self.observation(np.zeros(shape, np.uint8))

    def observation(self, observation: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture as the policy sees it."""
        return prepare(observation[np.newaxis], self._framing)[0]


def to_sb3(
    policy: CameraPolicy, env: gym.Env[Any, Any] | VecEnv, *, seed: int = 0, **settings: Any
) -> SAC:
    """A learner that begins by driving as the policy does.

    Its deterministic action is the policy's, on the prepared picture. Its critics see as the policy
    does, but do not know yet what is good: a small learning rate keeps the actor from following
    them astray. SAC's first `learning_starts` actions are random, unless that is 0.

    Args:
        policy: What to begin with; it stays as it is.
        env: Pictures in; steering and throttle, both in [-1, 1], out. Pictures that are not
            prepared are prepared by a wrapper; a vector env must show prepared ones.
        seed: Seed of the learner.
        **settings: Of `stable_baselines3.SAC`, except for the shape of the actor.

    Raises:
        PolicyError: If the policy cannot act in this env.
        CloningError: If the size of its pictures does not fit.
    """
    card = policy.card
    actions = cast("Any", env).action_space
    if not isinstance(actions, spaces.Box) or actions.shape != (ACTIONS,):
        raise PolicyError(f"A policy that steers and drives cannot act in {actions}.")
    low, high = _bounds(actions)
    if not ((low == -1.0).all() and (high == 1.0).all()):
        raise PolicyError(f"Steering and throttle lie in [-1, 1], but this env takes {actions}.")
    if not isinstance(env, VecEnv) and env.observation_space.shape != card.framing.shape:
        env = PreparedPictures(env, card.framing)
    kwargs = {
        # No layer lies between features and actions, as in the policy.
        "net_arch": {"pi": [], "qf": [256, 256]},
        "share_features_extractor": False,
        **settings.pop("policy_kwargs", {}),
        "features_extractor_class": CameraFeatures,
        "features_extractor_kwargs": {
            "framing": card.framing,
            "channels": card.channels,
            "features": card.features,
        },
    }
    model = SAC("CnnPolicy", env, seed=seed, policy_kwargs=kwargs, **settings)
    for part in (model.actor, model.critic, model.critic_target):
        _give_eyes(part, policy)
    hands = cast("nn.Linear", model.actor.mu)
    hands.load_state_dict(policy.network.hands.state_dict())
    # A clone is sure of what it does; without this it would begin by driving at random.
    spread = cast("nn.Linear", model.actor.log_std)
    with torch.no_grad():
        spread.weight.zero_()
        spread.bias.fill_(-2.0)
    return model


def from_sb3(model: SAC, policy: CameraPolicy) -> CameraPolicy:
    """What a learner of `to_sb3` drives like now, without its noise.

    Args:
        model: The learner.
        policy: What it began with, which stays as it is.
    """
    learned = policy.copy()
    for module in model.actor.modules():
        if isinstance(module, CameraFeatures):
            learned.network.eyes.load_state_dict(module.eyes.state_dict())
    learned.network.hands.load_state_dict(cast("nn.Linear", model.actor.mu).state_dict())
    return learned


def _bounds(space: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    return space.low, space.high


def _give_eyes(part: nn.Module, policy: CameraPolicy) -> None:
    """What the policy sees helps the critics, too."""
    for module in part.modules():
        if isinstance(module, CameraFeatures):
            module.eyes.load_state_dict(policy.network.eyes.state_dict())
