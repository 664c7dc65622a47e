"""Cards of trained policies, and policies from ONNX files, which run without PyTorch."""

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
from shapechanger.onnx_file import read_network
from shapechanger.transfer.learners import LearnerSettings


class PolicyCard(msgspec.Struct, frozen=True, kw_only=True):
    """Provenance of a policy.

    Attributes:
        env: The env that it was trained in.
        observation: Layout of its observations.
        action: Layout of its actions.
        learner: Name of the learner.
        settings: Settings of the learner; None in an ONNX file.
        steps: Env steps of training.
        seed: Seed of the training.
        version: Version of Shapechanger.
        identity: Version of the env and of the learner, see `shapechanger.transfer.versions`.
        command: The command that wrote it; empty in a study, where `study.json` holds it.
        start_log_std: Logarithm of the standard deviation of each action where its training started
            from another policy; None if it did not, or if the deviation is no parameter.
    """

    env: EnvRef
    observation: Layout
    action: Layout
    learner: str
    settings: LearnerSettings | None = None
    steps: int
    seed: int
    version: str
    identity: dict[str, Identity]
    command: str = ""
    start_log_std: tuple[float, ...] | None = None


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
        self.card, self._run = read_network(
            path,
            PolicyCard,
            lambda card: {"observation": [card.observation.size], "action": [card.action.size]},
            CorruptStudy,
        )

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
        return self._run({"observation": np.asarray(observations, np.float64)})
