"""Which policies have a first and a last layer that a body map can go into."""

from __future__ import annotations

from stable_baselines3 import PPO, SAC
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import (
    BaseFeaturesExtractor,
    FlattenExtractor,
    MlpExtractor,
)
from stable_baselines3.sac.policies import Actor

from shapechanger.errors import TransplantError

__all__ = ["check_supported"]


def check_supported(model: object) -> None:
    """Refuse a model whose weights cannot be moved.

    Raises:
        TransplantError: If it is not PPO or SAC with an `MlpPolicy` on flat observations and plain
            Gaussian exploration.
    """
    problem = _problem(model)
    if problem:
        raise TransplantError(
            f"{problem} What can be transplanted is PPO or SAC with an MlpPolicy, on flat "
            "observations and continuous actions, without gSDE."
        )


def _problem(model: object) -> str:
    """What stands in the way, as a sentence; empty if nothing does."""
    if not isinstance(model, PPO | SAC):
        return f"This model is {type(model).__name__}."
    extractors = [m for m in model.policy.modules() if isinstance(m, BaseFeaturesExtractor)]
    others = [type(m).__name__ for m in extractors if type(m) is not FlattenExtractor]
    if others:
        return f"This policy extracts features with {others[0]}."
    if model.use_sde:
        return "This policy explores with gSDE."
    if isinstance(model, SAC):
        policy = model.policy
        parts = (policy.actor, Actor), (policy.critic, ContinuousCritic)
    else:
        policy = model.policy
        parts = (
            (policy.mlp_extractor, MlpExtractor),
            (policy.action_dist, DiagGaussianDistribution),
        )
    for part, expected in parts:
        if type(part) is not expected:
            return f"This policy has a {type(part).__name__} in place of a {expected.__name__}."
    return ""
