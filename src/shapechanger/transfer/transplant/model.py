"""A model of Stable-Baselines3 for another body."""

from __future__ import annotations

from typing import Any, TypeVar, cast

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from stable_baselines3.sac.policies import SACPolicy

from shapechanger.errors import TransplantError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.transplant.actions import (
    Outputs,
    gaussian_outputs,
    judged_actions,
    squashed_outputs,
)
from shapechanger.transfer.transplant.networks import Edges, first_linear, moved_parameters
from shapechanger.transfer.transplant.normalisation import (
    Affine,
    Scaling,
    observation_affine,
    transplant_normalisation,
)
from shapechanger.transfer.transplant.settings import new_model
from shapechanger.transfer.transplant.supported import check_supported

__all__ = ["transplant"]

# What VecNormalize does unless it is told otherwise.
_EPSILON = 1e-8
_CLIP = 10.0

Model = TypeVar("Model", PPO, SAC)


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
    """A model that does in the target what the source model does through the map.

    The actor, PPO's value network, SAC's critics and their targets, log standard deviations and the
    entropy coefficient are moved; optimisers, buffers and step counts begin anew. An action that is
    to be learned gets the weights, and with PPO the log standard deviation, of an untrained policy.
    A constant action gets the mean log standard deviation of the source's, so that it is explored.

    Observations: where the target env normalises them with `VecNormalize`, its statistics become
    those of the source, see `transplant_normalisation`. Where it does not, the source's statistics
    go into the first layer, which is exact up to the clipping of `VecNormalize`.

    Actions: PPO's are moved before they are clipped to the bounds. Critics stay in the units of the
    rewards that they learned from, so return statistics are moved with them if
    `VecNormalize` is on both sides.

    Args:
        source_model: PPO or SAC with an `MlpPolicy` of any `net_arch`, trained on the source.
        body_map: How the bodies correspond.
        target_env: What the model is to go on learning on; flat spaces of the map's target sizes.
        normalisation: What the source's observations were normalised by: by default that of the
            model's own env. A model that was loaded without its env needs it said.
        seed: Seed of the new model, and so of the weights that are to be learned. As any model of
            Stable-Baselines3, it seeds Python, NumPy and PyTorch.
        device: Where the new model lives; by default where the source model does.
        **settings: Arguments of the model's class that are to differ from the source model's.

    Returns:
        A new model of the same class and settings; the source model is untouched.

    Raises:
        TransplantError: If the policy is of another kind, SAC would have to scale an action, or
            only the target normalises its observations and goes on changing how.
        SpaceMismatch: If a space has not the size of its layout.
    """
    check_supported(source_model)
    source, target = cast("Any", source_model), cast("Any", target_env)
    check_size("source observation", source.observation_space, body_map.source_observation)
    check_size("target observation", target.observation_space, body_map.target_observation)
    source_space = check_size("source action", source.action_space, body_map.source_action)
    target_space = check_size("target action", target.action_space, body_map.target_action)
    if isinstance(source_model, SAC):
        outputs = squashed_outputs(body_map, source_space, target_space)
    else:
        outputs = gaussian_outputs(body_map)
    model = new_model(source_model, target_env, seed, device or source_model.device, settings)
    sensed = _sensed(
        body_map,
        normalisation or source_model.get_vec_normalize_env(),
        model.get_vec_normalize_env(),
    )
    if isinstance(source_model, SAC):
        judged = judged_actions(body_map, outputs, source_space)
        edges = _sac_edges(source_model.policy, sensed, outputs, judged)
    else:
        edges = _ppo_edges(source_model.policy, sensed, outputs)
    parameters = moved_parameters(source_model.policy, model.policy, edges)
    model.policy.to(dtype=next(source_model.policy.parameters()).dtype)
    model.policy.load_state_dict(parameters)
    if isinstance(source_model, SAC) and isinstance(model, SAC):
        _move_entropy_coefficient(source_model, model)
    return model


def _sensed(
    body_map: BodyMap,
    source: RunningMeanStd | VecNormalize | None,
    target: VecNormalize | None,
) -> Affine:
    """The source network's inputs from the target's, which gets its statistics here."""
    statistics = _statistics(source)
    normaliser = target if target is not None and target.norm_obs else None
    if normaliser is not None and normaliser.training and statistics is None:
        raise TransplantError(
            "The source saw its observations as they are, and the target env normalises them by "
            "statistics that go on changing, which would undo what was learned: build its "
            "VecNormalize with norm_obs=False or training=False, or say what the source's "
            "statistics are."
        )
    if isinstance(source, VecNormalize) and target is not None:
        if source.norm_reward and target.norm_reward:
            target.ret_rms = source.ret_rms.copy()
        if statistics is not None:
            target.epsilon, target.clip_obs = source.epsilon, source.clip_obs
    settings = source if isinstance(source, VecNormalize) else target
    epsilon = settings.epsilon if settings is not None else _EPSILON
    clip = settings.clip_obs if settings is not None else _CLIP
    before = Scaling.none(body_map.source_observation.size)
    after = Scaling.none(body_map.target_observation.size)
    if statistics is not None:
        before = Scaling.of(statistics, epsilon, clip)
        if normaliser is not None:
            normaliser.obs_rms = transplant_normalisation(statistics, body_map)  # pyright: ignore[reportAttributeAccessIssue]
    if normaliser is not None:
        gathered = cast("RunningMeanStd", normaliser.obs_rms)
        after = Scaling.of(gathered, normaliser.epsilon, normaliser.clip_obs)
    return observation_affine(body_map, before, after)


def _statistics(source: RunningMeanStd | VecNormalize | None) -> RunningMeanStd | None:
    """What the source's observations were normalised by, if they were."""
    if isinstance(source, VecNormalize):
        return cast("RunningMeanStd", source.obs_rms) if source.norm_obs else None
    return source


def _ppo_edges(policy: ActorCriticPolicy, sensed: Affine, outputs: Outputs) -> Edges:
    """Where the policy and the value network of PPO meet the body."""
    extractor = policy.mlp_extractor
    edges = Edges(outputs={"action_net": outputs.mean, "log_std": outputs.log_std})
    for layer in (
        *first_linear(extractor.policy_net, "mlp_extractor.policy_net", ["action_net"]),
        *first_linear(extractor.value_net, "mlp_extractor.value_net", ["value_net"]),
    ):
        edges.inputs[layer] = sensed
    return edges


def _sac_edges(policy: SACPolicy, sensed: Affine, outputs: Outputs, judged: Affine) -> Edges:
    """Where the actor and the critics of SAC meet the body; a critic senses and judges."""
    heads = {"actor.mu": outputs.mean, "actor.log_std": outputs.log_std}
    edges = Edges(outputs=dict(heads))
    for layer in first_linear(policy.actor.latent_pi, "actor.latent_pi", heads):
        edges.inputs[layer] = sensed
    both = Affine(
        np.block(
            [
                [sensed.matrix, np.zeros((len(sensed.matrix), judged.matrix.shape[1]))],
                [np.zeros((len(judged.matrix), sensed.matrix.shape[1])), judged.matrix],
            ]
        ),
        np.concatenate([sensed.offset, judged.offset]),
    )
    for index, network in enumerate(policy.critic.q_networks):
        for name in ("critic", "critic_target"):
            for layer in first_linear(network, f"{name}.qf{index}"):
                edges.inputs[layer] = both
    return edges


def _move_entropy_coefficient(source: SAC, target: SAC) -> None:
    """Copy what was learned about how much to explore; a constant is a setting."""
    if source.log_ent_coef is not None and target.log_ent_coef is not None:
        with torch.no_grad():
            target.log_ent_coef.copy_(source.log_ent_coef)
