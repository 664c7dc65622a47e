"""Trained policies of Stable-Baselines3: their files, and conversion of Stable-Baselines3's zips.

A file contains the weights, the normalisation statistics and the bounds of the model's spaces. The
model's actions are scaled from the bounds of its action space to the bounds of the action layout;
in files of older versions these bounds are equal.
"""

from __future__ import annotations

import inspect
import pkgutil
import random
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import PolicyError, StudyError, UnknownName, needing_extra, no_policy_file
from shapechanger.layout import Layout
from shapechanger.policy import Policy, PolicyCard
from shapechanger.transfer.actions import ActionScale
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.identities import Identities
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.settings import (
    ImportedSettings,
    OffPolicySettings,
    PpoSettings,
    Sb3Settings,
)
from shapechanger.transfer.transplant.layers import CLIP, EPSILON
from shapechanger.transfer.transplant.model import check_supported

with needing_extra("learn"):
    import torch
    from sb3_contrib import TQC
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.save_util import load_from_zip_file
    from stable_baselines3.common.torch_layers import FlattenExtractor
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv
    from torch import nn

if TYPE_CHECKING:
    from shapechanger.transfer.learners.evaluation import Act

_SHIPPED: Final[dict[str, type[BaseAlgorithm]]] = {"PPO": PPO, "SAC": SAC, "TQC": TQC}
# Packages that a policy file may name; importing other packages could run arbitrary code.
_FILES_MAY_IMPORT: Final = ("stable_baselines3", "sb3_contrib")
# Arguments of algorithms that are not settings.
_GIVEN: Final = ("self", "policy", "env", "envs", "seed", "_init_setup_model")
_WEIGHTS: Final = "policy."
_STATISTICS: Final = "normalisation."
_SPACES: Final = "spaces."
_MOST_ENVS: Final = 4096


@dataclass(frozen=True)
class Normalisation:
    """Running statistics that normalise a policy's observations, and its rewards in training.

    Attributes:
        observation: Mean and variance of each observation.
        reward: Mean and variance of the discounted return.
    """

    observation: RunningMeanStd
    reward: RunningMeanStd


class TrainedPolicy(Policy):
    """A policy with its normalisation and card.

    Attributes:
        model: Model of Stable-Baselines3, with actions from -1 to 1 unless it was trained without
            `shapechanger.transfer.actions`. A loaded model has the weights and settings of the
            trained model, and a new optimiser.
        normalisation: Statistics of the training; None without normalisation.
        card: Provenance of the policy.
    """

    def __init__(
        self, model: BaseAlgorithm, normalisation: Normalisation | None, card: PolicyCard
    ) -> None:
        self.model, self.normalisation, self.card = model, normalisation, card

    @classmethod
    def of_file(
        cls, card: PolicyCard, tensors: Mapping[str, NDArray[Any]], algorithm: str
    ) -> TrainedPolicy:
        """Build the policy of a file, whose card has the settings as a table; see `load_policy`."""
        settings = LearnerSettings.from_builtins(card.settings)
        card = msgspec.structs.replace(card, settings=settings)
        _require_numbers(card, tensors)
        return cls(_model(card, tensors, algorithm), _read_statistics(card, tensors), card)

    @property
    def act(self) -> Act:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Function from observations of shape (n, ...) to mean actions in the env's units."""
        return actor(self.model, self.normalisation, self.card.layouts[1])

    def tensors(self) -> dict[str, NDArray[Any]]:
        """Return the policy's weights, spaces and statistics, keyed by name."""
        tensors: dict[str, NDArray[Any]] = {
            _WEIGHTS + name: value.detach().cpu().numpy()
            for name, value in self.model.policy.state_dict().items()
        }
        for side in ("observation", "action"):
            space = cast("gym.spaces.Box", getattr(self.model, f"{side}_space"))
            tensors |= {f"{_SPACES}{side}.low": space.low, f"{_SPACES}{side}.high": space.high}
        if self.normalisation is not None:
            for side in ("observation", "reward"):
                statistics = getattr(self.normalisation, side)
                for name in ("mean", "var", "count"):
                    tensors[f"{_STATISTICS}{side}.{name}"] = np.asarray(getattr(statistics, name))
        return tensors


def actor(
    model: BaseAlgorithm,
    normalisation: Normalisation | None,
    action: Layout,
    *,
    deterministic: bool = True,
) -> Act:
    """Return a function from the env's observations to the env's actions, with layout `action`.

    Deterministic actions are the mean actions, without exploration noise.
    """
    if deterministic and hasattr(model.policy, "act"):
        return cast("Any", model).policy.act  # A policy of limbs, which needs no scaling.
    mean = _mean_action(model) if deterministic else None
    scale = ActionScale.between(cast("Any", model).action_space, action)

    def act(observations: NDArray[Any]) -> NDArray[Any]:
        inputs = observations
        if normalisation is not None:
            known = normalisation.observation
            inputs = (observations - known.mean) / np.sqrt(known.var + EPSILON)
            inputs = np.clip(inputs, -CLIP, CLIP).astype(np.float32)
        if mean is not None:
            return scale.to_env(mean(inputs))
        return scale.to_env(model.predict(inputs, deterministic=deterministic)[0])

    return act


def _mean_action(model: BaseAlgorithm) -> Act | None:
    """Return a function of PPO's mean action, four times as fast as `predict`; None for others."""
    policy: Any = model.policy
    kinds: Any = (type(policy), type(policy.features_extractor), type(policy.action_space))
    if kinds != (ActorCriticPolicy, FlattenExtractor, gym.spaces.Box):
        return None
    space = policy.action_space

    def act(observations: NDArray[Any]) -> NDArray[Any]:
        with torch.no_grad():
            features = torch.as_tensor(observations, dtype=torch.float32).flatten(1)
            actions = policy.action_net(policy.mlp_extractor.forward_actor(features))
        actions = actions.numpy().reshape(-1, *space.shape)
        return np.clip(actions, space.low, space.high)

    return act


def _require_numbers(card: PolicyCard, tensors: Mapping[str, NDArray[Any]]) -> None:
    """Refuse numbers that are not finite, a network larger than the file, and too many envs.

    PyTorch allocates a network's memory before it compares sizes.
    """
    for name, value in tensors.items():
        is_bound = name.startswith(f"{_SPACES}observation")  # May be infinite.
        if (np.isnan(value) if is_bound else ~np.isfinite(value)).any():
            raise ValueError(f"its numbers {name!r} must be finite")
    settings: Any = card.settings
    widths = (card.layouts[0].size, *settings.net_arch)
    weights = sum(before * after for before, after in pairwise(widths))
    known = sum(value.size for value in tensors.values())
    # A custom class may ignore `net_arch`.
    if settings.algorithm in {"PPO", "SAC", "TQC"} and weights > known:
        raise ValueError(f"its card needs at least {weights} weights, and it has {known} numbers")
    # Worlds on a device are not limited, because loading a policy does not create them.
    if settings.n_envs > _MOST_ENVS and "device" not in settings.takes:
        raise ValueError(f"its card has {settings.n_envs} envs, more than {_MOST_ENVS}")


def _model(card: PolicyCard, tensors: Mapping[str, NDArray[Any]], algorithm: str) -> BaseAlgorithm:
    """Build the model that the card describes, with the weights of the file."""
    settings: Any = card.settings.for_model()
    if settings.algorithm != algorithm:
        require_class(settings.algorithm)
    spaces: list[gym.spaces.Box] = []
    for side, layout in zip(("observation", "action"), card.layouts, strict=True):
        low, high = (tensors[f"{_SPACES}{side}.{end}"] for end in ("low", "high"))
        if not {low.dtype, high.dtype} <= {np.dtype(np.float32), np.dtype(np.float64)}:
            raise ValueError(f"its bounds of the {side} are {low.dtype} and {high.dtype}")
        if low.shape != (layout.size,):
            raise ValueError(f"its {side} has {low.size} numbers, and its layout {layout.size}")
        spaces.append(gym.spaces.Box(low, high, dtype=low.dtype.type))
    envs = DummyVecEnv([lambda: SpacesOnly(*spaces)] * settings.n_envs)
    # Building a model seeds the global generators, which a running training may be using.
    states = random.getstate(), np.random.get_state(), torch.get_rng_state()  # noqa: NPY002
    try:
        model: Any = build_model(settings, envs, card.seed)
    finally:
        random.setstate(states[0])
        np.random.set_state(states[1])  # noqa: NPY002
        torch.set_rng_state(states[2])
    model.env = None
    weights = {
        name.removeprefix(_WEIGHTS): torch.from_numpy(value.copy())  # pyright: ignore[reportUnknownMemberType]
        for name, value in tensors.items()
        if name.startswith(_WEIGHTS)
    }
    for name, value in model.policy.state_dict().items():
        if name in weights and weights[name].dtype != value.dtype:
            raise ValueError(f"its weights {name} are {weights[name].dtype}, not {value.dtype}")
    model.policy.load_state_dict(weights)
    model.num_timesteps = card.steps
    return model


def _read_statistics(card: PolicyCard, tensors: Mapping[str, NDArray[Any]]) -> Normalisation | None:
    if not any(name.startswith(_STATISTICS) for name in tensors):
        if card.settings.normalise:
            raise ValueError("its learner normalises, and it has no statistics")
        return None

    def statistics(side: str, shape: tuple[int, ...]) -> RunningMeanStd:
        mean, var, count = (
            tensors[f"{_STATISTICS}{side}.{name}"] for name in ("mean", "var", "count")
        )
        if (mean.shape, var.shape, count.shape) != (shape, shape, ()):
            raise ValueError(f"its statistics of the {side} have other shapes than its layout")
        result = RunningMeanStd(shape=mean.shape)
        result.mean, result.var, result.count = mean, var, float(count)
        return result

    size = card.layouts[0].size
    return Normalisation(statistics("observation", (size,)), statistics("reward", ()))


def build_model(
    settings: Sb3Settings, envs: VecEnv, seed: int, tensorboard: str | None = None
) -> BaseAlgorithm:
    """Build an untrained model on the CPU."""
    made = _load(settings.algorithm)
    arguments = dict(settings.model_arguments)
    try:
        if isinstance(made, type) and issubclass(made, BaseAlgorithm):
            arguments.setdefault("policy_kwargs", {"net_arch": list(settings.net_arch)})
            arguments |= {"seed": seed, "device": "cpu", "tensorboard_log": tensorboard}
            policy: Any = settings.policy_class
            if ":" in policy:
                policy = pkgutil.resolve_name(policy)
            return made(policy, envs, **arguments)
        model = made(envs, seed, **arguments)
    except (TypeError, ValueError, AssertionError) as error:
        if settings.algorithm in _SHIPPED:
            raise
        raise StudyError(f"{settings.algorithm} refuses its arguments: {error}.") from error
    if not isinstance(model, BaseAlgorithm):
        raise StudyError(
            f"{settings.algorithm} returned {type(model).__name__}: it must return a model of "
            "Stable-Baselines3."
        )
    return model


def require_class(algorithm: str) -> None:
    """Refuse an algorithm that is not a class of models, or whose module must not be imported."""
    module = algorithm.partition(":")[0]
    own = algorithm not in _SHIPPED and module not in sys.modules
    if own and module.partition(".")[0] not in _FILES_MAY_IMPORT:
        raise PolicyError(
            f"A policy of {algorithm} needs the module {module}, which a file may not import: "
            f"name it too, as load_policy(path, {algorithm!r}) or --learner {algorithm}."
        )
    made = _load(algorithm)
    if not (isinstance(made, type) and issubclass(made, BaseAlgorithm)):
        raise ValueError(f"its algorithm {algorithm} is a function, which a file may not call")


def checked_settings(settings: ImportedSettings) -> ImportedSettings:
    """Import an algorithm, check the names of its arguments, and set `steps_per_update`."""
    made = _load(settings.algorithm)
    if not callable(made) or (isinstance(made, type) and not issubclass(made, BaseAlgorithm)):
        raise StudyError(
            f"{settings.algorithm} is neither a class of models nor a function that builds one."
        )
    takes = inspect.signature(made).parameters
    known = [name for name in takes if name not in _GIVEN]
    anything = any(each.kind is each.VAR_KEYWORD for each in takes.values())
    for name in settings.arguments:
        if name not in known and not anything:
            raise UnknownName(f"setting of {settings.algorithm}", name, known)
    for name in ("n_steps", "train_freq"):
        # In off-policy algorithms, which have a `buffer_size`, `n_steps` is the length of a return.
        if name == "n_steps" and "buffer_size" in takes:
            continue
        default: Any = takes[name].default if name in takes else None
        every = settings.arguments.get(name, default)
        if isinstance(every, int):
            return msgspec.structs.replace(settings, steps_per_update=every)
    return settings


def _load(algorithm: str) -> Any:
    if algorithm in _SHIPPED:
        return _SHIPPED[algorithm]
    module, _, name = algorithm.partition(":")
    try:
        return getattr(import_module(module), name)
    except (ImportError, ValueError, AttributeError) as error:
        raise UnknownName("algorithm", algorithm, _SHIPPED) from error


class SpacesOnly(gym.Env[Any, Any]):
    """An env that has spaces and cannot be stepped, for models that only act."""

    def __init__(self, observation_space: gym.Space[Any], action_space: gym.Space[Any]) -> None:
        self.observation_space = observation_space
        self.action_space = action_space


def convert_zip(
    path: Path, env: EnvRef, layouts: tuple[Layout, Layout], identity: Identities, command: str
) -> TrainedPolicy:
    """Convert a zip of PPO, SAC or TQC. Loading a zip can run code that it contains.

    Args:
        path: A zip that the model's `save` wrote.
        env: The env that the model was trained in.
        layouts: Layouts of the env's observations and actions.
        identity: Identity of the env.
        command: The command that converts the zip.

    Raises:
        PolicyError: If the file is missing, not a zip of a model, or has another kind of model.
        TransplantError: If the model has discrete actions, gSDE or another features extractor.
        SpaceMismatch: If the layouts do not fit the policy's spaces.
    """
    model = _read_zip(path)
    check_supported(model)
    observation, action = layouts
    check_size("observation of the policy", model.observation_space, observation)
    check_size("action of the policy", model.action_space, action)
    card = PolicyCard(
        env=env,
        observation=observation,
        action=action,
        learner="converted",
        settings=_settings_of(model),
        steps=int(model.num_timesteps),
        seed=int(model.seed or 0),
        identity=identity,
        command=command,
    )
    return TrainedPolicy(model, None, card)


def _read_zip(path: Path) -> Any:
    try:
        data: Any = load_from_zip_file(path, device="cpu")[0]
        # A2C has the same policy class as PPO, but no `clip_range`.
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


def _settings_of(model: Any) -> Sb3Settings:
    """Return the settings of a model; refuse a model whose networks they cannot describe."""
    on_policy = hasattr(model, "clip_range")
    activation = nn.Tanh if on_policy else nn.ReLU
    widths = model.policy.net_arch
    of_each: Any = widths if "pi" in widths else {"pi": widths, "critic": widths}
    actor, critic = (list(layers) for layers in of_each.values())
    if actor != critic or model.policy.activation_fn is not activation:
        raise PolicyError(
            f"The actor has layers {actor} and the critic {critic}, with "
            f"{model.policy.activation_fn.__name__}: the layers must be the same, with "
            f"{activation.__name__}."
        )
    kind: type[PpoSettings | OffPolicySettings] = PpoSettings if on_policy else OffPolicySettings
    kept = {n: getattr(model, n) for n in kind.__struct_fields__ if hasattr(model, n)}
    kept |= {"learning_rate": float(model.lr_schedule(1.0)), "algorithm": type(model).__name__}
    if on_policy:
        kept["clip_range"], per_env = float(model.clip_range(1.0)), model.n_steps
    else:
        kept["train_freq"], unit = model.train_freq
        if unit.value != "step":
            raise PolicyError("This model updates after episodes: it must update after steps.")
        per_env = kept["train_freq"]
    update = model.n_envs * per_env
    steps = max(int(model.num_timesteps), update)
    settings = kind(**kept, net_arch=tuple(actor), steps=steps, eval_every=update)
    spaces = SpacesOnly(model.observation_space, model.action_space)
    built = build_model(settings, DummyVecEnv([lambda: spaces] * model.n_envs), 0).policy
    shapes = {name: weight.shape for name, weight in model.policy.state_dict().items()}
    if shapes != {name: weight.shape for name, weight in built.state_dict().items()}:
        raise PolicyError(f"These policy_kwargs change the networks: {model.policy_kwargs}.")
    return settings
