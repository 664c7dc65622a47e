"""Transplant a model of Stable-Baselines3."""

from __future__ import annotations

import copy
import inspect
from typing import Any, Final, TypeVar, cast

import gymnasium as gym
import numpy as np
import torch
from sb3_contrib.tqc import policies as tqc
from scipy.linalg import block_diag
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import NStepReplayBuffer
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy, ContinuousCritic
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.torch_layers import (
    BaseFeaturesExtractor,
    FlattenExtractor,
    MlpExtractor,
)
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from stable_baselines3.sac.policies import Actor, SACPolicy

from shapechanger.errors import TransplantError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.transplant.layers import (
    CLIP,
    EPSILON,
    Affine,
    BoundaryLayers,
    PolicyOutputs,
    Scaling,
    critic_actions,
    first_linear,
    gaussian_outputs,
    move_parameters,
    observation_affine,
    squashed_outputs,
    transplant_normalisation,
)

Model = TypeVar("Model", bound=BaseAlgorithm)

_POLICIES: Final = (ActorCriticPolicy, SACPolicy, tqc.TQCPolicy)
_GIVEN_ANEW: Final = frozenset({"self", "policy", "env", "seed", "device", "_init_setup_model"})
# Arguments that a model stores under another name.
_KEPT_AS: Final = {"stats_window_size": "_stats_window_size"}


def _new_model(
    source: Model,
    env: gym.Env[Any, Any] | VecEnv,
    seed: int,
    device: torch.device | str,
    changes: dict[str, Any],
) -> Model:
    """Build an untrained model with the class and settings of `source`, except for `changes`."""
    kept: dict[str, Any] = {}
    for name in inspect.signature(cast("Any", type(source)).__init__).parameters:
        attribute = _KEPT_AS.get(name, name)
        if name not in _GIVEN_ANEW and hasattr(source, attribute):
            kept[name] = getattr(source, attribute)
    if kept.get("action_noise") is not None and "action_noise" not in changes:
        raise TransplantError(
            "The source model adds action noise in the shape of its actions: state the noise of "
            "the target, for example transplant(..., action_noise=None)."
        )
    kept["policy_kwargs"] = copy.deepcopy(source.policy_kwargs)
    if _is_squashed(source):
        # "auto" settings are resolved again, because they depend on the body.
        squashed = cast("Any", source)
        if squashed.target_entropy == -float(squashed.action_space.shape[0]):
            kept["target_entropy"] = "auto"
        if squashed.replay_buffer_class is NStepReplayBuffer:
            kept["replay_buffer_class"] = None
            buffer = squashed.replay_buffer_kwargs.items()
            own = {"n_steps", "gamma"}
            kept["replay_buffer_kwargs"] = {k: v for k, v in buffer if k not in own}
    kept |= {"policy": source.policy_class, "env": env, "seed": seed, "device": device}
    return type(source)(**(kept | changes))


def _is_squashed(model: BaseAlgorithm) -> bool:
    """Return whether a model's policy squashes its actions to the bounds, like SAC's."""
    return isinstance(model.policy, SACPolicy | tqc.TQCPolicy)


def check_supported(model: object) -> None:
    """Refuse a model whose weights cannot be transplanted."""
    if problem := _problem(model):
        raise TransplantError(
            f"{problem} Only models with the MlpPolicy of PPO, SAC or TQC can be transplanted, on "
            "flat observations and continuous actions, without gSDE."
        )


def _problem(model: object) -> str:
    """Return a sentence with the reason if the model is not supported; otherwise empty."""
    if not isinstance(model, BaseAlgorithm):
        return f"This model is {type(model).__name__}."
    policy = model.policy
    if type(policy) not in _POLICIES:
        return f"This model has a {type(policy).__name__}."
    extractors = [m for m in policy.modules() if isinstance(m, BaseFeaturesExtractor)]
    others = [type(m).__name__ for m in extractors if type(m) is not FlattenExtractor]
    if others:
        return f"This policy extracts features with {others[0]}."
    if model.use_sde:
        return "This policy explores with gSDE."
    if isinstance(policy, SACPolicy):
        parts = (policy.actor, Actor), (policy.critic, ContinuousCritic)
    elif isinstance(policy, tqc.TQCPolicy):
        parts = (policy.actor, tqc.Actor), (policy.critic, tqc.Critic)
    else:
        ours = cast("ActorCriticPolicy", policy)
        parts = (ours.mlp_extractor, MlpExtractor), (ours.action_dist, DiagGaussianDistribution)
    for part, expected in parts:
        if type(part) is not expected:
            return f"This policy has a {type(part).__name__} instead of a {expected.__name__}."
    return ""


def transplant(
    source_model: Model,
    body_map: BodyMap,
    target_env: gym.Env[Any, Any] | VecEnv,
    *,
    normalisation: RunningMeanStd | VecNormalize | None = None,
    seed: int = 0,
    device: torch.device | str | None = None,
    **settings: Any,
) -> Model:
    """Return a model for the target that acts like the source model through the map.

    The actor, PPO's value network, the critics and target critics of SAC and TQC, log standard
    deviations and the entropy coefficient are moved; optimisers, buffers and step counts are new.
    An action with the rule `learn` gets the weights, and with PPO the log standard deviation, of an
    untrained policy. A constant action gets the mean log standard deviation of the source, so that
    it is explored.

    If source and target env normalise observations, the source's statistics replace the target's,
    see `transplant_normalisation`. If only the source does, the first layer absorbs its statistics,
    which is exact up to the clipping of `VecNormalize`.

    The map is in the units of the layouts. A model with another action space scales its actions to
    the ranges of the layout, see `shapechanger.transfer.actions`. PPO's actions are mapped
    before they are clipped to the bounds. Critics keep the units of the rewards that they were
    trained on, so return statistics are moved too if both envs use `VecNormalize`.

    Args:
        source_model: A model with the `MlpPolicy` of PPO, SAC or TQC, of any `net_arch`, trained on
            the source.
        body_map: Map between the bodies.
        target_env: The env to continue training in; flat spaces of the map's target sizes.
        normalisation: Normalisation of the source's observations; by default the normalisation of
            the model's own env. Needed for a model that was loaded without its env.
        seed: Seed of the new model and of its untrained weights. Like every new model of
            Stable-Baselines3, it seeds Python, NumPy and PyTorch.
        device: Device of the new model; by default the source model's.
        **settings: Arguments of the model's class that differ from the source model's.

    Returns:
        A new model of the same class and settings; the source model is untouched.

    Raises:
        TransplantError: If the policy is of another kind, SAC would have to scale an action, action
            noise is not restated, or only the target normalises, with changing statistics.
        SpaceMismatch: If a space does not have the size of its layout.
    """
    check_supported(source_model)
    source, target = cast("Any", source_model), cast("Any", target_env)
    check_size("source observation", source.observation_space, body_map.source_observation)
    check_size("target observation", target.observation_space, body_map.target_observation)
    source_space = check_size("source action", source.action_space, body_map.source_action)
    target_space = check_size("target action", target.action_space, body_map.target_action)
    squashed = _is_squashed(source_model)
    outputs_of = squashed_outputs if squashed else gaussian_outputs
    outputs = outputs_of(body_map, source_space, target_space)
    model = _new_model(source_model, target_env, seed, device or source_model.device, settings)
    known = normalisation or source_model.get_vec_normalize_env()
    sensed = _sensed(body_map, known, model.get_vec_normalize_env())
    if squashed:
        judged = critic_actions(body_map, outputs, source_space)
        boundary = _squashed_boundary(source.policy, sensed, outputs, judged)
    else:
        boundary = _gaussian_boundary(source.policy, sensed, outputs)
    parameters = move_parameters(source_model.policy, model.policy, boundary)
    model.policy.to(dtype=next(source_model.policy.parameters()).dtype)
    model.policy.load_state_dict(parameters)
    learned: Any = getattr(model, "log_ent_coef", None)
    # A constant entropy coefficient is a setting.
    if learned is not None and source.log_ent_coef is not None:
        with torch.no_grad():
            learned.copy_(source.log_ent_coef)
    return model


def _sensed(
    body_map: BodyMap, source: RunningMeanStd | VecNormalize | None, target: VecNormalize | None
) -> Affine:
    """Return the map from the target network's inputs to the source's; set target statistics."""
    statistics = cast("RunningMeanStd | None", source)
    if isinstance(source, VecNormalize):
        statistics = cast("RunningMeanStd", source.obs_rms) if source.norm_obs else None
    normaliser = target if target is not None and target.norm_obs else None
    if normaliser is not None and normaliser.training and statistics is None:
        raise TransplantError(
            "The source's observations were not normalised, and the target env normalises them by "
            "statistics that keep changing, which would undo the training: build its VecNormalize "
            "with norm_obs=False or training=False, or give the source's statistics."
        )
    if isinstance(source, VecNormalize) and target is not None:
        if source.norm_reward and target.norm_reward:
            target.ret_rms = source.ret_rms.copy()
        if statistics is not None:
            target.epsilon, target.clip_obs = source.epsilon, source.clip_obs
    before = Scaling.none(body_map.source_observation.size)
    after = Scaling.none(body_map.target_observation.size)
    if statistics is not None:
        settings = source if isinstance(source, VecNormalize) else target
        defaults = EPSILON, CLIP
        constants = (settings.epsilon, settings.clip_obs) if settings is not None else defaults
        before = Scaling.of(statistics, *constants)
        if normaliser is not None:
            normaliser.obs_rms = transplant_normalisation(statistics, body_map)  # pyright: ignore[reportAttributeAccessIssue]
    if normaliser is not None:
        gathered = cast("RunningMeanStd", normaliser.obs_rms)
        after = Scaling.of(gathered, normaliser.epsilon, normaliser.clip_obs)
    return observation_affine(body_map, before, after)


def _gaussian_boundary(
    policy: ActorCriticPolicy, sensed: Affine, outputs: PolicyOutputs
) -> BoundaryLayers:
    extractor = policy.mlp_extractor
    layers = (
        *first_linear(extractor.policy_net, "mlp_extractor.policy_net", ["action_net"]),
        *first_linear(extractor.value_net, "mlp_extractor.value_net", ["value_net"]),
    )
    heads = {"action_net": outputs.mean, "log_std": outputs.log_std}
    return BoundaryLayers(dict.fromkeys(layers, sensed), heads)


def _squashed_boundary(
    policy: SACPolicy, sensed: Affine, outputs: PolicyOutputs, judged: Affine
) -> BoundaryLayers:
    heads = {"actor.mu": outputs.mean, "actor.log_std": outputs.log_std}
    layers = first_linear(policy.actor.latent_pi, "actor.latent_pi", heads)
    inputs = dict.fromkeys(layers, sensed)
    matrix: Any = block_diag(sensed.matrix, judged.matrix)
    both = Affine(matrix, np.concatenate([sensed.offset, judged.offset]))
    for index, network in enumerate(policy.critic.q_networks):
        for name in ("critic", "critic_target"):
            inputs |= dict.fromkeys(first_linear(network, f"{name}.qf{index}"), both)
    return BoundaryLayers(inputs, heads)
