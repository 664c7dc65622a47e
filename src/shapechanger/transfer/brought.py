"""A policy that a study is given in place of training its own: where it comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from shapechanger.errors import SpaceMismatch, StudyError
from shapechanger.transfer.cloning import is_clone, load_clone
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.policy_file import load_policy
from shapechanger.transfer.settings import LearnerSettings, Settings

__all__ = ["steps_brought_along"]


class _Origin(NamedTuple):
    """Where a policy comes from: the env that it was trained in, and for how many steps."""

    env: EnvRef
    steps: int


class _Shown(msgspec.Struct):
    """What the card of a clone says of its demonstrations, where a study or `train` wrote it."""

    env: str
    arguments: dict[str, Any]
    demonstrated_steps: int
    tried_steps: int = 0


def steps_brought_along(path: Path, source: EnvRef, learner: str, settings: Settings) -> int:
    """Steps that a policy has cost, if a study can begin with it.

    Args:
        path: Its file.
        source: The source of the study.
        learner: Name of the learner of the study.
        settings: Its settings.

    Raises:
        CorruptStudy: If the file is missing or holds no policy.
        PolicyError: If it holds half a clone.
        StudyError: If the learner does not learn as the policy did.
        SpaceMismatch: If the policy was trained in another env than the source.
    """
    if is_clone(path):
        origin = _of_clone(path, learner, settings)
    else:
        origin = _of_learned(path, learner, settings)
    if origin.env != source:
        raise SpaceMismatch(
            f"The policy that was brought along was trained in {origin.env}, and the source is "
            f"{source}: name the env and the body that it was trained in."
        )
    return origin.steps


def _of_clone(path: Path, learner: str, settings: Settings) -> _Origin:
    if isinstance(settings, LearnerSettings):
        raise StudyError(
            f"{path} is a clone, and {learner} does not learn from pictures: give --learner "
            f"cloning or sac, or bring along a policy of {learner}."
        )
    card = load_clone(path).card
    if card.framing != settings.clone.framing:
        seen = settings.clone.framing
        raise StudyError(
            f"{path} sees pictures of {card.framing.height} x {card.framing.width} pixels from "
            f"{card.framing.top:g} of their height on, and {learner} {seen.height} x {seen.width} "
            f"from {seen.top:g}: bring along one that sees the same."
        )
    try:
        shown = msgspec.convert(card.data, _Shown)
    except msgspec.ValidationError as error:
        raise StudyError(
            f"The card of {path} does not say from which demonstrations it was cloned ({error}): "
            "bring along one that `shapechanger train` or a study has written."
        ) from error
    return _Origin(EnvRef(shown.env, shown.arguments), shown.demonstrated_steps + shown.tried_steps)


def _of_learned(path: Path, learner: str, settings: Settings) -> _Origin:
    card = load_policy(path).card
    if not isinstance(settings, LearnerSettings):
        raise StudyError(
            f"{path} has learned by trying, with {card.learner}, and {learner} begins with "
            f"demonstrations: give --learner {card.learner}, or bring along a clone."
        )
    return _Origin(card.env, card.steps)
