"""A cloned policy as the beginning of reinforcement learning with Stable-Baselines3.

The eyes of the clone stay as they are and the learner sees their features: so it learns on a
hundred numbers in place of a picture, which is many times faster, and its critics do not spoil what
cloning has taught the eyes.
"""

from __future__ import annotations

from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.errors import PolicyError
from shapechanger.demos.cloning.network import ACTIONS
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.errors import MissingExtra

try:
    from stable_baselines3 import SAC
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

__all__ = ["LOG_STD", "NormedReLU", "SeenByPolicy", "from_sb3", "to_sb3"]

# Logarithm of the first standard deviation of an action before it is squashed: a clone is sure of
# what it does, and would otherwise begin by driving at random.
LOG_STD: Final = -2.0


class SeenByPolicy(gym.ObservationWrapper[NDArray[np.float32], Any, NDArray[np.uint8]]):
    """An env that shows, in place of its pictures, what the eyes of a policy make of them.

    Args:
        env: Its observations are pictures of shape (H, W, 3).
        policy: Whose eyes.

    Raises:
        PolicyError: If its observations are something else.
        CloningError: If their size does not fit the policy.
    """

    def __init__(self, env: gym.Env[NDArray[np.uint8], Any], policy: CameraPolicy) -> None:
        space = cast("gym.Space[Any]", env.observation_space)
        shape = space.shape or ()
        dtype = cast("Any", space).dtype
        if not isinstance(space, spaces.Box) or dtype != np.uint8 or len(shape) != 3:
            raise PolicyError(f"A policy that drives by pictures cannot see {space}.")
        super().__init__(env)
        self._policy = policy
        self.observation_space = spaces.Box(0.0, np.inf, (policy.n_features,), np.float32)
        self.observation(np.zeros(shape, np.uint8))

    def observation(self, observation: NDArray[np.uint8]) -> NDArray[np.float32]:
        """The features of a picture, shape (features,)."""
        return self._policy.features(observation[np.newaxis])[0]


class NormedReLU(nn.Module):
    """A ReLU of numbers that are freed of their mean and spread first.

    Critics with it do not think ever better of actions that nobody has tried: P. Ball and others,
    Efficient online reinforcement learning with offline data, ICML 2023.
    """

    def forward(self, x: Tensor) -> Tensor:
        """Shape (n, k) in and out."""
        return functional.relu(functional.layer_norm(x, x.shape[-1:]))


def to_sb3(
    policy: CameraPolicy,
    env: gym.Env[Any, Any],
    *,
    seed: int = 0,
    learner: type[SAC] = SAC,
    **settings: Any,
) -> SAC:
    """A learner that begins by driving as the policy does.

    Its deterministic action is the policy's. Its critics do not know yet what is good: let them
    learn first, or the actor follows them astray. SAC's first `learning_starts` actions are random,
    unless that is 0.

    Args:
        policy: What to begin with; it stays as it is, and so do its eyes.
        env: Pictures in; steering and throttle, both in [-1, 1], out. It is wrapped, so that the
            learner sees features.
        seed: Seed of the learner.
        learner: Its class.
        **settings: Of `stable_baselines3.SAC`, except for the shape of the actor.

    Raises:
        PolicyError: If the policy cannot act in this env.
        CloningError: If the size of its pictures does not fit.
    """
    actions = cast("Any", env).action_space
    if not isinstance(actions, spaces.Box) or actions.shape != (ACTIONS,):
        raise PolicyError(f"A policy that steers and drives cannot act in {actions}.")
    low, high = _bounds(actions)
    if not ((low == -1.0).all() and (high == 1.0).all()):
        raise PolicyError(f"Steering and throttle lie in [-1, 1], but this env takes {actions}.")
    kwargs = {
        # No layer lies between features and actions, as in the policy.
        "net_arch": {"pi": [], "qf": [256, 256]},
        "activation_fn": NormedReLU,
        **settings.pop("policy_kwargs", {}),
    }
    seen = SeenByPolicy(env, policy)
    model = learner("MlpPolicy", seen, seed=seed, policy_kwargs=kwargs, **settings)
    hands = cast("nn.Linear", model.actor.mu)
    hands.load_state_dict(policy.network.hands.state_dict())
    spread = cast("nn.Linear", model.actor.log_std)
    with torch.no_grad():
        spread.weight.zero_()
        spread.bias.fill_(LOG_STD)
    return model


def from_sb3(model: SAC, policy: CameraPolicy) -> CameraPolicy:
    """What a learner of `to_sb3` drives like now, without its noise.

    Args:
        model: The learner.
        policy: What it began with, which stays as it is.
    """
    learned = policy.copy()
    learned.network.hands.load_state_dict(cast("nn.Linear", model.actor.mu).state_dict())
    return learned


def _bounds(space: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    return space.low, space.high
