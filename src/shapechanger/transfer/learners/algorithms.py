"""The algorithms of Stable-Baselines3, sb3-contrib and others, built from settings."""

from __future__ import annotations

import inspect
import pkgutil
import sys
from importlib import import_module
from typing import Any, Final

import gymnasium as gym
import msgspec

from shapechanger.errors import MissingExtra, PolicyError, StudyError, UnknownName
from shapechanger.transfer.learners.settings import ImportedSettings, Sb3Settings

try:
    from sb3_contrib import TQC
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise MissingExtra("stable-baselines3 and sb3-contrib", "learn") from error

_SHIPPED: Final[dict[str, type[BaseAlgorithm]]] = {"PPO": PPO, "SAC": SAC, "TQC": TQC}
# Packages that a file may name; importing any other could run any code.
_FILES_MAY_IMPORT: Final = ("stable_baselines3", "sb3_contrib")
# Arguments that are not settings.
_GIVEN: Final = ("self", "policy", "env", "envs", "seed", "_init_setup_model")


def build_model(
    settings: Sb3Settings, envs: VecEnv, seed: int, tensorboard: str | None = None
) -> BaseAlgorithm:
    """Build an untrained model on the CPU."""
    made = _load(settings.algorithm)
    arguments = dict(settings.model_arguments)
    try:
        if _is_class(made):
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


def _is_class(algorithm: object) -> bool:
    """Return whether this is a class of models, not a function that builds one."""
    return isinstance(algorithm, type) and issubclass(algorithm, BaseAlgorithm)


def require_class(algorithm: str) -> None:
    """Refuse the name of an algorithm that is not a class of models, before importing it."""
    module = algorithm.partition(":")[0]
    own = algorithm not in _SHIPPED and module not in sys.modules
    if own and module.partition(".")[0] not in _FILES_MAY_IMPORT:
        raise PolicyError(
            f"A policy of {algorithm} needs the module {module}, which a file may not import: "
            f"name it too, as load_policy(path, {algorithm!r}) or --learner {algorithm}."
        )
    try:
        known = _is_class(_load(algorithm))
    except UnknownName as error:
        raise ValueError(f"its algorithm {algorithm} cannot be imported") from error
    if not known:
        raise ValueError(f"its algorithm {algorithm} is a function, which a file may not call")


def checked_settings(settings: ImportedSettings) -> ImportedSettings:
    """Import an algorithm, check the names of its arguments, and fill in how often it updates."""
    made = _load(settings.algorithm)
    if not callable(made) or (isinstance(made, type) and not _is_class(made)):
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
        # Off-policy algorithms have both, and their `n_steps` counts the steps of a return.
        if name == "n_steps" and "buffer_size" in takes:
            continue
        default: Any = takes[name].default if name in takes else None
        every = settings.arguments.get(name, default)
        if isinstance(every, int):
            return msgspec.structs.replace(settings, steps_per_update=every)
    return settings


def _load(algorithm: str) -> Any:
    """Return the class or function of a name."""
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
