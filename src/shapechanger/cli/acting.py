"""Policies of any kind in an env, for commands that show or evaluate them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym

from shapechanger.cli.console import say
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.envs.naming import allow_own_modules
from shapechanger.identity import identify_env
from shapechanger.policy import load_policy
from shapechanger.transfer.body_map import BodyMap, Copy, MappedEnv
from shapechanger.transfer.identities import ENV, require_same_env

if TYPE_CHECKING:
    from shapechanger.transfer.learners.evaluation import Act
    from shapechanger.transfer.learners.policy_file import PolicyCard
    from shapechanger.transfer.onnx_policy import OnnxCard


def acting_in(
    env: gym.Env[Any, Any], file: Path, learner: str = "", trained_in: EnvRef | None = None
) -> tuple[gym.Env[Any, Any], Act]:
    """Return an env as a policy senses it, and the policy."""
    policy = load_any_policy(file, learner)
    card: Any = policy.card
    if trained_in is not None and ENV in card.identity:
        remedy = (
            "Train it again, or give the present one with --env, as another env that the policy "
            "is tried in."
        )
        now = identify_env(env, trained_in.id).identity
        require_same_env(card.identity, trained_in, now, file, remedy)
    if hasattr(card, "observation"):
        return _fitting(env, card), policy.act
    if (layout := getattr(env.unwrapped, "action_layout", None)) is not None:
        card.require_layouts(layout, card.state_layout)
    return env, policy.act


def load_any_policy(file: Path, learner: str = "") -> Any:
    """Load a policy of any kind, which may name a learner of the user's own."""
    allow_own_modules(learner)
    return load_policy(file, learner)


def _fitting(env: gym.Env[Any, Any], card: PolicyCard | OnnxCard) -> gym.Env[Any, Any]:
    """Return an env with a policy's layouts, through the body map of same names if needed."""
    settings: Any = getattr(card, "settings", None)
    if settings is not None and "many bodies" in settings.takes:
        from shapechanger.transfer.limbs.envs import fitted  # PyTorch.

        return fitted(env, card.observation, settings.room)
    observation, action = layouts_of(env)
    if (observation, action) == (card.observation, card.action):
        return env
    body_map = BodyMap.between(card.observation, observation, card.action, action)
    entries = (*body_map.observation, *body_map.action)
    filled = [entry.feature for entry in entries if not isinstance(entry.rule, Copy)]
    if filled:
        say(f"Without a counterpart in the other body, and so constant: {', '.join(filled)}.")
    return MappedEnv(env, body_map)
