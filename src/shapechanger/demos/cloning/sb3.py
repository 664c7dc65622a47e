"""A cloned policy as the beginning of reinforcement learning with Stable-Baselines3.

The eyes of the clone stay as they are and the learner sees their features: so it learns on a
hundred numbers in place of a picture, which is many times faster, and its critics do not spoil what
cloning has taught the eyes.
"""

from __future__ import annotations

from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.network import ACTIONS, CameraNetwork
from shapechanger.demos.cloning.pictures import PolicyError, area_shares
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.errors import MissingExtra

__all__ = [
    "IMAGE",
    "LOG_STD",
    "STATE",
    "ChosenActions",
    "ClonedPerception",
    "ClonedPolicy",
    "NormedReLU",
    "SeenByPolicy",
    "as_ppo",
    "as_sac",
    "from_sb3",
    "to_sb3",
]

try:
    from stable_baselines3 import SAC
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error


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


try:
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error


IMAGE: Final = "image"
STATE: Final = "state"

_BRIGHTEST: Final = 255.0
# As in `pictures`: a half goes up, also after a rounding.
_HALF: Final = 0.5 + 1e-4
# Raw pictures are large: a replay of a million, which is SAC's default, would take 50 GB and more.
_BUFFER: Final = 10_000


class ClonedPerception(BaseFeaturesExtractor):
    """The eyes and nerves of a clone, from raw observations to features; nothing in it learns.

    Args:
        observation_space: Pictures, states, or a dict of both under "image" and "state".
        card: The clone's card as JSON.
    """

    def __init__(self, observation_space: Any, card: str) -> None:
        known = msgspec.json.decode(card, type=CloneCard)
        network = CameraNetwork(known)
        size = network.hands.in_features
        super().__init__(observation_space, size)  # pyright: ignore[reportUnknownMemberType]
        self.eyes, self.nerves = network.eyes, network.nerves
        self.network = network
        self._unseen = [known.state_layout.slices[n] for n in known.unseen if known.state_layout]
        if known.eyes != "none":
            space = observation_space
            image = space[IMAGE] if isinstance(space, spaces.Dict) else space
            _, height, width = cast("tuple[int, int, int]", image.shape)  # SB3 has turned it.
            self._first = min(round(height * known.framing.top), height - 1)
            rows = area_shares(height - self._first, known.framing.height)
            self.register_buffer("rows", torch.as_tensor(rows), persistent=False)
            columns = area_shares(width, known.framing.width)
            self.register_buffer("columns", torch.as_tensor(columns), persistent=False)
        del network.hands
        self.requires_grad_(False)

    def forward(self, observations: Tensor | dict[str, Tensor]) -> Tensor:
        """Features, shape (n, features)."""
        if isinstance(observations, dict):
            pictures, states = observations[IMAGE], observations[STATE]
        else:
            pictures = observations if self.eyes is not None else None
            states = observations if self.nerves is not None else None
        if states is not None and self._unseen:
            states = states.clone()
            for place in self._unseen:
                states[:, place] = torch.nan
        return self.network.perceive(None if pictures is None else self._small(pictures), states)

    def _small(self, pictures: Tensor) -> Tensor:
        """What the clone sees of raw pictures, as `pictures.prepare` makes it."""
        rows, columns = cast("Tensor", self.rows), cast("Tensor", self.columns)
        seen = rows @ pictures[:, :, self._first :] @ columns.T
        return torch.floor(seen + _HALF) / _BRIGHTEST


class _Between(nn.Module):
    """From [-1, 1] to the range of the actions."""

    def __init__(self, low: NDArray[np.float32], high: NDArray[np.float32]) -> None:
        super().__init__()
        self.register_buffer("low", torch.as_tensor(low), persistent=False)
        self.register_buffer("half_range", torch.as_tensor(0.5 * (high - low)), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        return cast("Tensor", self.low) + (torch.tanh(x) + 1.0) * cast("Tensor", self.half_range)


class ClonedPolicy(ActorCriticPolicy):
    """PPO's actor and critic, whose mean action is squashed as a clone's is."""

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        space = cast("Any", self).action_space
        if isinstance(space, spaces.Box):
            space = cast("Any", space)
            squashed = _Between(space.low.astype(np.float32), space.high.astype(np.float32))
            self.action_net = nn.Sequential(self.action_net, squashed)


class ChosenActions(gym.ActionWrapper[Any, Any, Any]):
    """An env in which the classes of a policy are chosen by their numbers.

    Args:
        env: Takes the actions that the classes stand for.
        policy: Whose classes.
    """

    def __init__(self, env: gym.Env[Any, Any], policy: CameraPolicy) -> None:
        super().__init__(env)
        self._classes = np.asarray(policy.card.classes, np.float32)
        self.action_space = spaces.Discrete(len(self._classes))

    def action(self, action: Any) -> NDArray[np.float32]:
        """The action of a class."""
        return self._classes[int(action)].copy()


def as_sac(
    policy: CameraPolicy, size: tuple[int, int] | None, *, seed: int = 0, **settings: Any
) -> SAC:
    """The policy as SAC, which does the same without its noise; `save` writes it to a file.

    Its critics do not know yet what is good: let them learn from demonstrations first
    (`replay.MixedReplay`), or its first steps lead it astray. Its first actions are its own
    (`learning_starts` is 0), and its replay holds 10,000 raw observations.

    Args:
        policy: What it begins with.
        size: Rows and columns of the raw pictures; None for a policy without eyes.
        seed: Seed of the learner.
        **settings: Of `stable_baselines3.SAC`, but for the shape of the actor.

    Raises:
        PolicyError: If the policy chooses among classes, which SAC cannot.
    """
    if policy.card.classes:
        raise PolicyError(
            "This policy chooses among classes, and SAC learns numbers: write it for PPO, or train "
            "it with the head regression."
        )
    settings = {"learning_starts": 0, "buffer_size": _BUFFER, "device": "cpu", **settings}
    kwargs = _perception(policy) | {
        "net_arch": {"pi": [], "qf": [256, 256]},
        "activation_fn": NormedReLU,
        "share_features_extractor": True,
    }
    kind = "MultiInputPolicy" if _has_both(policy) else "MlpPolicy"
    env = _Spaces(policy, size)
    model = SAC(kind, env, seed=seed, policy_kwargs=kwargs, **settings)
    actor = cast("Any", model.actor)
    actor.mu.load_state_dict(policy.network.hands.state_dict())
    with torch.no_grad():
        actor.log_std.weight.zero_()
        actor.log_std.bias.fill_(LOG_STD)
    for owner in (actor, model.critic, model.critic_target):
        _teach(cast("Any", owner).features_extractor, policy)
    return model


def as_ppo(
    policy: CameraPolicy, size: tuple[int, int] | None, *, seed: int = 0, **settings: Any
) -> PPO:
    """The policy as PPO, which does the same without its noise; `save` writes it to a file.

    A policy that chooses among classes chooses their numbers: `ChosenActions` makes an env take
    these.

    Args:
        policy: What it begins with.
        size: Rows and columns of the raw pictures; None for a policy without eyes.
        seed: Seed of the learner.
        **settings: Of `stable_baselines3.PPO`, but for the shape of the actor.
    """
    settings = {"device": "cpu", **settings}
    kwargs = _perception(policy) | {"net_arch": {"pi": [], "vf": [64, 64]}, "ortho_init": False}
    if not policy.card.classes:
        kwargs["log_std_init"] = LOG_STD
    model = PPO(ClonedPolicy, _Spaces(policy, size), seed=seed, policy_kwargs=kwargs, **settings)
    acting = cast("Any", model.policy)
    net = acting.action_net if policy.card.classes else acting.action_net[0]
    net.load_state_dict(policy.network.hands.state_dict())
    _teach(acting.features_extractor, policy)
    return model


class _Spaces(gym.Env[Any, Any]):
    """What a policy takes and gives, without a world: it cannot be stepped."""

    def __init__(self, policy: CameraPolicy, size: tuple[int, int] | None) -> None:
        card = policy.card
        parts: dict[str, gym.Space[Any]] = {}
        if card.eyes != "none":
            if size is None:
                raise PolicyError("A policy that sees needs the size of the pictures.")
            parts[IMAGE] = spaces.Box(0, 255, (*size, 3), np.uint8)
        if card.nerves:
            parts[STATE] = spaces.Box(-np.inf, np.inf, (card.state_size,), np.float32)
        self.observation_space = (
            spaces.Dict(parts) if len(parts) > 1 else next(iter(parts.values()))
        )
        if card.classes:
            self.action_space = spaces.Discrete(len(card.classes))
        else:
            low = np.asarray(card.low or (-1.0,) * card.action_size, np.float32)
            high = np.asarray(card.high or (1.0,) * card.action_size, np.float32)
            self.action_space = spaces.Box(low, high, dtype=np.float32)


def _perception(policy: CameraPolicy) -> dict[str, Any]:
    card = msgspec.structs.replace(policy.card, data={}, settings=None, command="")
    return {
        "features_extractor_class": ClonedPerception,
        "features_extractor_kwargs": {"card": msgspec.json.encode(card).decode()},
        "normalize_images": False,
    }


def _has_both(policy: CameraPolicy) -> bool:
    return policy.card.eyes != "none" and bool(policy.card.nerves)


def _teach(perception: ClonedPerception, policy: CameraPolicy) -> None:
    state = policy.network.state_dict()
    known = {name: value for name, value in state.items() if not name.startswith("hands.")}
    perception.network.load_state_dict(known)
