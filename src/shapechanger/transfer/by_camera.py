"""The learners that drive by what a camera sees: all begin with demonstrations."""

from __future__ import annotations

from collections.abc import Callable

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.transfer.cloning import Recording, clone_along
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.evaluation import Evaluation
from shapechanger.transfer.sac import learn_by_trying
from shapechanger.transfer.settings import CloningSettings, SacSettings

__all__ = ["learn_by_camera"]


def learn_by_camera(
    env: EnvRef,
    settings: CloningSettings | SacSettings,
    steps: int,
    seed: int,
    *,
    demonstrations: Recording,
    start: CameraPolicy | None = None,
    only_last: bool = False,
    on_evaluation: Callable[[Evaluation], None],
    on_steps: Callable[[int], None] = lambda steps: None,
) -> CameraPolicy:
    """Learn as the settings say; see `clone_along` and `learn_by_trying`."""
    if isinstance(settings, CloningSettings):
        return clone_along(
            env,
            settings,
            steps,
            seed,
            demonstrations=demonstrations,
            start=start,
            only_last=only_last,
            on_evaluation=on_evaluation,
            on_steps=on_steps,
        )
    return learn_by_trying(
        env,
        settings,
        steps,
        seed,
        demonstrations=demonstrations,
        start=start,
        only_last=only_last,
        on_evaluation=on_evaluation,
        on_steps=on_steps,
    )
