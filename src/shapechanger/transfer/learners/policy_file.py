"""A trained policy in one file, with all that is needed to use it or to move it to another body.

The file is a zip that holds Stable-Baselines3's own zip, the normalisation statistics, and a card
in JSON: env, learner, steps, seed, version and both layouts. Like every file of PyTorch's or
Stable-Baselines3's it holds pickles: load only what you trust.
"""

from __future__ import annotations

import io
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
from shapechanger.transfer.learners.settings import LearnerSettings

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


class PolicyCard(msgspec.Struct, frozen=True):
    """Where a policy comes from.

    Attributes:
        env: The env that it was trained in.
        observation: What it senses.
        action: What it moves.
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
    settings: LearnerSettings
    steps: int
    seed: int
    version: str


@dataclass(frozen=True)
class Normalisation:
    """Running statistics that a policy's inputs, and its rewards in training, are divided by.

    Attributes:
        observation: Mean and variance of each observation.
        reward: Mean and variance of the discounted return.
    """

    observation: RunningMeanStd
    reward: RunningMeanStd


@dataclass(frozen=True)
class TrainedPolicy:
    """A policy and what it needs.

    Attributes:
        model: Stable-Baselines3's model.
        normalisation: The statistics that it was trained with; None if it takes plain numbers.
        card: Where it comes from.
    """

    model: PPO
    normalisation: Normalisation | None
    card: PolicyCard

    @property
    def act(self) -> Act:
        """The policy's mean actions for observations of shape (n, ...)."""
        return actor(self.model, self.normalisation)


def actor(model: PPO, normalisation: Normalisation | None) -> Act:
    """The mean actions of a model, for observations as the env gives them."""

    def act(observations: NDArray[Any]) -> NDArray[Any]:
        inputs = observations
        if normalisation is not None:
            inputs = _normalised(observations, normalisation.observation)
        return model.predict(inputs, deterministic=True)[0]

    return act


# Stable-Baselines3's own defaults (`VecNormalize`).
_EPSILON: Final = 1e-8
_CLIP: Final = 10.0


def _normalised(observations: NDArray[Any], statistics: RunningMeanStd) -> NDArray[np.float32]:
    scaled = (observations - statistics.mean) / np.sqrt(statistics.var + _EPSILON)
    return np.clip(scaled, -_CLIP, _CLIP).astype(np.float32)


def save_policy(policy: TrainedPolicy, path: Path) -> None:
    """Write a policy to one file.

    Raises:
        OutputError: If it cannot be written.
    """
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
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
    write_atomic(path, whole.getvalue())


def load_policy(path: Path) -> TrainedPolicy:
    """Read what `save_policy` wrote.

    Raises:
        CorruptStudy: If the file is missing or is no such policy.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            card = msgspec.json.decode(archive.read(_CARD), type=PolicyCard)
            model = cast("Any", PPO).load(io.BytesIO(archive.read(_MODEL)), device="cpu")
            normalisation = None
            if _STATISTICS in archive.namelist():
                normalisation = _read_statistics(archive.read(_STATISTICS))
    except FileNotFoundError as error:
        raise CorruptStudy(f"There is no policy file {path}.") from error
    except (OSError, KeyError, ValueError, zipfile.BadZipFile, msgspec.MsgspecError) as error:
        raise CorruptStudy(
            f"{path} is not a policy that `shapechanger train` or a study has written ({error})."
        ) from error
    return TrainedPolicy(model, normalisation, card)


def _read_statistics(content: bytes) -> Normalisation:
    with np.load(io.BytesIO(content)) as arrays:

        def statistics(side: str) -> RunningMeanStd:
            result = RunningMeanStd(shape=arrays[f"{side}_mean"].shape)
            result.mean = arrays[f"{side}_mean"]
            result.var = arrays[f"{side}_var"]
            result.count = float(arrays[f"{side}_count"])
            return result

        return Normalisation(statistics("observation"), statistics("reward"))
