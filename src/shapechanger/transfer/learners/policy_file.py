"""Trained policies in files.

A file is a zip with Stable-Baselines3's own zip, the normalisation statistics, and a JSON card:
env, learner, steps, seed, version and both layouts. Stable-Baselines3 pickles some attributes of a
model. `load_policy` unpickles them itself and accepts only the classes that such a model consists
of, so that loading a file cannot run code from it.
"""

from __future__ import annotations

import base64
import io
import json
import pickle
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import CorruptStudy, MissingExtra
from shapechanger.layout import Layout
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.files import write_atomic
from shapechanger.transfer.learners.settings import PpoSettings

try:
    from stable_baselines3 import PPO
    from stable_baselines3.common.running_mean_std import RunningMeanStd
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

if TYPE_CHECKING:
    from shapechanger.transfer.learners.evaluation import Act

__all__ = ["Normalisation", "PolicyCard", "TrainedPolicy", "load_policy", "save_policy"]

_CARD: Final = "card.json"
_MODEL: Final = "model.zip"
_STATISTICS: Final = "normalisation.npz"
# Entries of Stable-Baselines3's zip. It reads the `.pth` ones with `weights_only=True`.
_MODEL_ENTRIES: Final = frozenset(
    {
        "_stable_baselines3_version",
        "data",
        "policy.optimizer.pth",
        "policy.pth",
        "pytorch_variables.pth",
        "system_info.txt",
    }
)
_PICKLED: Final = ":serialized:"
# Classes and functions that the pickled attributes of a PPO model with an MlpPolicy refer to.
_KNOWN_SAFE: Final = frozenset(
    {
        ("collections", "deque"),
        ("gymnasium.spaces.box", "Box"),
        ("numpy", "dtype"),
        ("numpy", "ndarray"),
        ("numpy._core.multiarray", "_reconstruct"),
        ("numpy._core.multiarray", "scalar"),
        ("numpy._core.numeric", "_frombuffer"),
        ("numpy.core.multiarray", "_reconstruct"),
        ("numpy.core.multiarray", "scalar"),
        ("numpy.core.numeric", "_frombuffer"),
        ("numpy.random._pcg64", "PCG64"),
        ("numpy.random._pickle", "__bit_generator_ctor"),
        ("numpy.random._pickle", "__generator_ctor"),
        ("numpy.random.bit_generator", "SeedSequence"),
        ("numpy.random.bit_generator", "__pyx_unpickle_SeedSequence"),
        ("stable_baselines3.common.buffers", "RolloutBuffer"),
        ("stable_baselines3.common.policies", "ActorCriticPolicy"),
        ("stable_baselines3.common.utils", "ConstantSchedule"),
        ("stable_baselines3.common.utils", "FloatSchedule"),
    }
)


class PolicyCard(msgspec.Struct, frozen=True):
    """Provenance of a policy.

    Attributes:
        env: The env that it was trained in.
        observation: Layout of its observations.
        action: Layout of its actions.
        learner: Name of the learner.
        settings: Settings of the learner.
        steps: Env steps of training.
        seed: Seed of the training.
        version: Version of Shapechanger.
    """

    env: EnvRef
    observation: Layout
    action: Layout
    learner: str
    settings: PpoSettings
    steps: int
    seed: int
    version: str


@dataclass(frozen=True)
class Normalisation:
    """Running statistics that normalise a policy's observations, and its rewards in training.

    Attributes:
        observation: Mean and variance of each observation.
        reward: Mean and variance of the discounted return.
    """

    observation: RunningMeanStd
    reward: RunningMeanStd


@dataclass(frozen=True)
class TrainedPolicy:
    """A policy with its normalisation and card.

    Attributes:
        model: Stable-Baselines3's model.
        normalisation: The statistics that it was trained with; None if it is not normalised.
        card: Its provenance.
    """

    model: PPO
    normalisation: Normalisation | None
    card: PolicyCard

    @property
    def act(self) -> Act:
        """The policy's mean actions for observations of shape (n, ...)."""
        return actor(self.model, self.normalisation)


def actor(model: PPO, normalisation: Normalisation | None) -> Act:
    """Return a function from the env's observations to the model's mean actions.

    Args:
        model: The model.
        normalisation: Its statistics; None if it is not normalised.
    """

    def act(observations: NDArray[Any]) -> NDArray[Any]:
        inputs = observations
        if normalisation is not None:
            inputs = _normalised(observations, normalisation.observation)
        return model.predict(inputs, deterministic=True)[0]

    return act


# Defaults of Stable-Baselines3's `VecNormalize`.
_EPSILON: Final = 1e-8
_CLIP: Final = 10.0


def _normalised(observations: NDArray[Any], statistics: RunningMeanStd) -> NDArray[np.float32]:
    scaled = (observations - statistics.mean) / np.sqrt(statistics.var + _EPSILON)
    return np.clip(scaled, -_CLIP, _CLIP).astype(np.float32)


def save_policy(policy: TrainedPolicy, path: Path) -> None:
    """Write a policy to one file.

    Args:
        policy: The policy.
        path: The file.

    Raises:
        OutputError: If it cannot be written.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        model = io.BytesIO()
        policy.model.save(model)
        archive.writestr(_MODEL, model.getvalue())
        archive.writestr(_CARD, msgspec.json.encode(policy.card))
        if policy.normalisation is not None:
            statistics = io.BytesIO()
            arrays = {
                f"{side}_{name}": getattr(getattr(policy.normalisation, side), name)
                for side in ("observation", "reward")
                for name in ("mean", "var", "count")
            }
            np.savez(statistics, **arrays)
            archive.writestr(_STATISTICS, statistics.getvalue())
    write_atomic(path, content.getvalue())


def load_policy(path: Path, *, trust: bool = False) -> TrainedPolicy:
    """Read what `save_policy` wrote.

    Args:
        path: The file.
        trust: Unpickle whatever the file contains, which can run code. By default a file with
            anything else than a model that `save_policy` writes is refused.

    Raises:
        CorruptStudy: If the file is missing, is no such policy, or is refused.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            card = msgspec.json.decode(archive.read(_CARD), type=PolicyCard)
            content = archive.read(_MODEL)
            attributes = None if trust else _unpickle_safely(content)
            model = cast("Any", PPO).load(
                io.BytesIO(content), device="cpu", custom_objects=attributes
            )
            normalisation = None
            if _STATISTICS in archive.namelist():
                normalisation = _read_statistics(archive.read(_STATISTICS))
    except FileNotFoundError as error:
        raise CorruptStudy(f"There is no policy file {path}.") from error
    except _UntrustedContent as error:
        raise CorruptStudy(
            f"{path} contains {error}, which a policy of `shapechanger train` or a study never "
            "does, and loading it could run code from the file: load it with --trust (trust=True) "
            "only if you trust its author."
        ) from error
    except (OSError, KeyError, ValueError, zipfile.BadZipFile, msgspec.MsgspecError) as error:
        raise CorruptStudy(
            f"{path} is not a policy that `shapechanger train` or a study has written ({error})."
        ) from error
    return TrainedPolicy(model, normalisation, card)


class _UntrustedContent(Exception):
    """A policy file contains something that `save_policy` does not write."""


class _SafeUnpickler(pickle.Unpickler):
    """Unpickler that refers to the classes of a PPO model only."""

    def find_class(self, module: str, name: str, /) -> Any:
        if (module, name) not in _KNOWN_SAFE:
            raise _UntrustedContent(f"a pickled reference to {module}.{name}")
        return super().find_class(module, name)


def _unpickle_safely(content: bytes) -> dict[str, Any]:
    """Unpickle the pickled attributes of a model, so that Stable-Baselines3 need not.

    Raises:
        _UntrustedContent: If the zip has other entries, or a pickle refers to another class.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for name in archive.namelist():
            if name not in _MODEL_ENTRIES:
                raise _UntrustedContent(f"the entry {name!r}")
        attributes: dict[str, Any] = json.loads(archive.read("data"))
    unpickled: dict[str, Any] = {}
    for name, value in attributes.items():
        if isinstance(value, dict) and _PICKLED in value:
            text = cast("dict[str, str]", value)[_PICKLED]
            try:
                unpickled[name] = _SafeUnpickler(io.BytesIO(base64.b64decode(text))).load()
            except _UntrustedContent:
                raise
            except Exception as error:  # A damaged pickle can raise anything.
                raise ValueError(f"its attribute {name!r} cannot be unpickled: {error}") from error
    return unpickled


def _read_statistics(content: bytes) -> Normalisation:
    with np.load(io.BytesIO(content)) as arrays:

        def statistics(side: str) -> RunningMeanStd:
            result = RunningMeanStd(shape=arrays[f"{side}_mean"].shape)
            result.mean = arrays[f"{side}_mean"]
            result.var = arrays[f"{side}_var"]
            result.count = float(arrays[f"{side}_count"])
            return result

        return Normalisation(statistics("observation"), statistics("reward"))
