"""The learners that drive by what a camera sees: all begin with demonstrations."""

from __future__ import annotations

from collections.abc import Callable
from typing import NotRequired, Required, TypedDict, Unpack

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.transfer.cloning import Recording, clone_along
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.evaluation import Evaluation
from shapechanger.transfer.sac import learn_by_trying
from shapechanger.transfer.settings import CloningSettings, SacSettings

__all__ = ["Options", "learn_by_camera"]


class Options(TypedDict):
    """What `clone_along` and `learn_by_trying` both take by name."""

    demonstrations: Required[Recording]
    start: NotRequired[CameraPolicy | None]
    only_last: NotRequired[bool]
    on_evaluation: Required[Callable[[Evaluation], None]]
    on_steps: NotRequired[Callable[[int], None]]


def learn_by_camera(
    env: EnvRef,
    settings: CloningSettings | SacSettings,
    steps: int,
    seed: int,
    **options: Unpack[Options],
) -> CameraPolicy:
    """Learn as the settings say; see `clone_along` and `learn_by_trying`."""
    if isinstance(settings, CloningSettings):
        return clone_along(env, settings, steps, seed, **options)
    return learn_by_trying(env, settings, steps, seed, **options)
