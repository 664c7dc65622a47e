"""Zips of Stable-Baselines3, read with the class that wrote them, and the settings of their models.

Reading one can run code in it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import DummyVecEnv
from torch import nn

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import PolicyError, no_policy_file
from shapechanger.layout import Layout
from shapechanger.policy import PolicyCard
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.identities import Identities
from shapechanger.transfer.learners.algorithms import SpacesOnly, build_model
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.settings import OffPolicySettings, PpoSettings, Sb3Settings
from shapechanger.transfer.transplant.model import check_supported


def convert_zip(
    path: Path, env: EnvRef, layouts: tuple[Layout, Layout], identity: Identities, command: str
) -> TrainedPolicy:
    """Convert a zip of PPO, SAC or TQC; loading it can run code in it.

    Args:
        path: A zip that the model's `save` wrote.
        env: The env that it was trained in.
        layouts: Layouts of the env's observations and actions.
        identity: Version of the env.
        command: The command that converts it.

    Raises:
        PolicyError: If the file is missing or no such zip.
        PolicyError: If it is of another algorithm or policy class.
        SpaceMismatch: If the layouts do not fit the policy's spaces.
    """
    model = load_zip(path)
    check_supported(model)
    observation, action = layouts
    check_size("observation of the policy", model.observation_space, observation)
    check_size("action of the policy", model.action_space, action)
    card = PolicyCard(
        env=env,
        observation=observation,
        action=action,
        learner="converted",
        settings=settings_of_model(model),
        steps=int(model.num_timesteps),
        seed=int(model.seed or 0),
        identity=identity,
        command=command,
    )
    return TrainedPolicy(model, None, card)


def load_zip(path: Path) -> Any:
    """Load a model with the class of Stable-Baselines3 or sb3-contrib that wrote it."""
    try:
        data: Any = load_from_zip_file(path, device="cpu")[0]
        # A2C has PPO's policy, and no clipping.
        kinds: tuple[Any, ...] = (PPO,) if "clip_range" in data else (SAC, TQC)
        for kind in kinds:
            if data["policy_class"] is kind.policy_aliases["MlpPolicy"]:
                return kind.load(path, device="cpu")
    except FileNotFoundError:
        raise PolicyError(no_policy_file(path)) from None
    except Exception as error:  # A damaged pickle can raise anything.
        raise PolicyError(
            f"{path} is not a zip of Stable-Baselines3's PPO, SAC or TQC ({error})."
        ) from error
    raise PolicyError(
        f"{path} is of another algorithm or policy class: the MlpPolicy of PPO, SAC and TQC can be "
        "converted."
    )


def settings_of_model(model: Any) -> Sb3Settings:
    """Return the settings of a model, whose networks must be those that the settings describe."""
    on_policy = hasattr(model, "clip_range")
    activation = nn.Tanh if on_policy else nn.ReLU
    widths = model.policy.net_arch
    of_each: Any = widths if "pi" in widths else {"pi": widths, "critic": widths}
    actor, critic = (list(layers) for layers in of_each.values())
    if actor != critic or model.policy.activation_fn is not activation:
        raise PolicyError(
            f"The actor has layers {actor} and the critic {critic}, with "
            f"{model.policy.activation_fn.__name__}: both must be the same, with "
            f"{activation.__name__}."
        )
    kind: type[PpoSettings | OffPolicySettings]
    if on_policy:
        kind, update = PpoSettings, model.n_envs * model.n_steps
        same = ("n_envs", "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "ent_coef")
        own: dict[str, Any] = {"clip_range": float(model.clip_range(1.0))}
    else:
        frequency, unit = model.train_freq
        if unit.value != "step":
            raise PolicyError("This model updates after episodes: only updates after steps fit.")
        kind, update = OffPolicySettings, model.n_envs * frequency
        same = ("n_envs", "batch_size", "buffer_size", "learning_starts", "gradient_steps", "gamma")
        same = (*same, "tau", "ent_coef")
        own = {"algorithm": type(model).__name__, "train_freq": frequency}
    settings = kind(
        **{name: getattr(model, name) for name in same},
        **own,
        learning_rate=float(model.lr_schedule(1.0)),
        net_arch=tuple(actor),
        steps=max(int(model.num_timesteps), update),
        eval_every=update,
        eval_episodes=5,
    )
    spaces = SpacesOnly(model.observation_space, model.action_space)
    built = build_model(settings, DummyVecEnv([lambda: spaces] * model.n_envs), 0).policy
    shapes = {name: weight.shape for name, weight in model.policy.state_dict().items()}
    if shapes != {name: weight.shape for name, weight in built.state_dict().items()}:
        raise PolicyError(f"These policy_kwargs change the networks: {model.policy_kwargs}.")
    return settings
