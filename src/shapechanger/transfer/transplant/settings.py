"""A new model with the settings of another."""

from __future__ import annotations

import copy
import inspect
from typing import Any, Final, TypeVar, cast

import gymnasium as gym
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.buffers import NStepReplayBuffer
from stable_baselines3.common.vec_env import VecEnv

from shapechanger.errors import TransplantError

__all__ = ["new_model"]

Model = TypeVar("Model", PPO, SAC)

_GIVEN_ANEW: Final = frozenset({"self", "policy", "env", "seed", "device", "_init_setup_model"})
# Arguments that a model keeps under another name.
_KEPT_AS: Final = {"stats_window_size": "_stats_window_size"}


def new_model(
    source: Model,
    env: gym.Env[Any, Any] | VecEnv,
    seed: int,
    device: torch.device | str,
    changes: dict[str, Any],
) -> Model:
    """An untrained model of the class and the settings of `source`.

    Args:
        source: The model whose settings are wanted.
        env: What the new one is to learn on.
        seed: Its seed.
        device: Where it lives.
        changes: Arguments of the class that are to differ.

    Raises:
        TransplantError: If the source explores by action noise and nobody says what becomes of it.
    """
    kept: dict[str, Any] = {}
    for name in inspect.signature(type(source).__init__).parameters:
        attribute = _KEPT_AS.get(name, name)
        if name not in _GIVEN_ANEW and hasattr(source, attribute):
            kept[name] = getattr(source, attribute)
    if kept.get("action_noise") is not None and "action_noise" not in changes:
        raise TransplantError(
            "The source model adds action noise, which is made for the shape of its actions: say "
            "what the target is to have, as in transplant(..., action_noise=None)."
        )
    kept["policy_kwargs"] = copy.deepcopy(source.policy_kwargs)
    if isinstance(source, SAC):
        _undo_set_up(source, kept)
    kept |= {"policy": source.policy_class, "env": env, "seed": seed, "device": device}
    return type(source)(**(kept | changes))


def _undo_set_up(source: SAC, kept: dict[str, Any]) -> None:
    """What "auto" has become in a model turns back into "auto", since it depends on the body."""
    if source.target_entropy == -float(cast("Any", source).action_space.shape[0]):
        kept["target_entropy"] = "auto"
    if source.replay_buffer_class is NStepReplayBuffer:
        kept["replay_buffer_class"] = None
        own = {"n_steps", "gamma"}
        buffer = source.replay_buffer_kwargs
        kept["replay_buffer_kwargs"] = {k: v for k, v in buffer.items() if k not in own}
