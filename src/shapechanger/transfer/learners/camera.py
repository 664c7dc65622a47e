"""Cloning as a learner: policies that drive by a camera."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.errors import StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.env_ref import EnvRef, EnvTraits
from shapechanger.transfer.learners import PolicyOrigin
from shapechanger.transfer.learners.cloning import (
    DemonstrationFile,
    evaluate_clone,
    is_clone,
    load_clone,
    require_camera_env,
    train_clones,
)
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import load_policy
from shapechanger.transfer.learners.settings import CloningSettings


class _CardData(msgspec.Struct):
    """Provenance in the card of a clone that a study or `shapechanger train` wrote."""

    env: str
    arguments: dict[str, Any]
    demonstrated_steps: int


class CameraLearner:
    """Cloning: a `shapechanger.transfer.learners.Learner`.

    Args:
        name: Name of the learner.
        settings: Its settings.
    """

    def __init__(self, name: str, settings: CloningSettings) -> None:
        self._name = name
        self._settings = settings

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env without a camera or a demonstrator."""
        require_camera_env(str(env), traits.observation_space, traits.has_demonstrator, self._name)

    def train(
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        demonstrations: DemonstrationFile,
        start: CameraPolicy | None = None,
        body_map: BodyMap | None = None,
        only_last: bool = False,
        callback: Any = None,
        on_evaluation: Callable[[Evaluation], None],
        on_steps: Callable[[int], None] = lambda steps: None,
    ) -> CameraPolicy:
        """Clone a policy; all vehicles share one camera and action, so the body map is unused.

        Raises:
            StudyError: If a callback is given.
        """
        del body_map
        if callback is not None:
            raise StudyError(f"{self._name} takes no callback of Stable-Baselines3.")
        return train_clones(
            env,
            self._settings,
            steps,
            seed,
            demonstrations=demonstrations,
            start=start,
            only_last=only_last,
            on_evaluation=on_evaluation,
            on_steps=on_steps,
        )

    def evaluate(self, env: EnvRef, policy: CameraPolicy, body_map: BodyMap) -> Evaluation:
        """Evaluate a policy; all vehicles share one camera and action."""
        del body_map
        return evaluate_clone(env, policy, self._settings)

    def load(self, path: Path) -> CameraPolicy:
        """Load a clone."""
        return load_clone(path)

    def save(self, policy: CameraPolicy, path: Path) -> None:
        """Write a clone to a file."""
        policy.save(path)

    def origin(self, path: Path) -> PolicyOrigin:
        """Read where a clone comes from.

        Raises:
            StudyError: If the policy is not a clone, or sees other pictures.
        """
        if not is_clone(path):
            card = load_policy(path).card
            raise StudyError(
                f"{path} was trained with {card.learner}, and {self._name} starts from "
                f"demonstrations: give --learner {card.learner}, or a clone."
            )
        card = load_clone(path).card
        wanted = self._settings.clone.framing
        if card.framing != wanted:
            raise StudyError(
                f"{path} takes pictures of {card.framing.height} x {card.framing.width} pixels "
                f"from {card.framing.top:g} of their height on, and {self._name} "
                f"{wanted.height} x {wanted.width} from {wanted.top:g}: give a clone that takes "
                "the same pictures."
            )
        try:
            data = msgspec.convert(card.data, _CardData)
        except msgspec.ValidationError as error:
            raise StudyError(
                f"The card of {path} lacks the demonstrations that it was cloned from ({error}): "
                "give a clone that `shapechanger train` or a study has written."
            ) from error
        return PolicyOrigin(EnvRef(data.env, data.arguments), data.demonstrated_steps)
