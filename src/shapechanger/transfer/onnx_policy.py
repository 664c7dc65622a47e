"""Trained policies from ONNX files, which run without PyTorch; `export` writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import CorruptStudy, StudyError
from shapechanger.identity import Identity
from shapechanger.layout import Layout
from shapechanger.onnx_file import OnnxNetwork


class OnnxCard(msgspec.Struct, frozen=True):
    """Provenance of a policy in an ONNX file: a part of its `PolicyCard`.

    Attributes:
        env: The env that it was trained in.
        observation: Layout of its observations.
        action: Layout of its actions.
        learner: Name of the learner.
        steps: Env steps of training.
        seed: Seed of the training.
        version: Version of Shapechanger.
        identity: Version of the env and of the learner.
    """

    env: EnvRef
    observation: Layout
    action: Layout
    learner: str
    steps: int
    seed: int
    version: str
    identity: dict[str, Identity]


class OnnxPolicy:
    """A policy from an ONNX file.

    Attributes:
        card: Its provenance.

    Args:
        path: The file.

    Raises:
        MissingExtra: If onnxruntime is not installed.
        CorruptStudy: If the file is missing or is not such a policy.
    """

    def __init__(self, path: Path) -> None:
        self._network = OnnxNetwork(path, OnnxCard, _shapes, CorruptStudy)
        self.card = self._network.card

    def act(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return the mean actions, shape (n, actions), for observations of shape (n, observations).

        Raises:
            StudyError: If the observations have another size.
        """
        if observations.ndim != 2 or observations.shape[1] != self.card.observation.size:
            raise StudyError(
                f"This policy takes observations of shape (n, {self.card.observation.size}), got "
                f"{observations.shape}."
            )
        return self._network.run({"observation": np.asarray(observations, np.float64)})


def _shapes(card: OnnxCard) -> dict[str, list[int]]:
    return {"observation": [card.observation.size], "action": [card.action.size]}
