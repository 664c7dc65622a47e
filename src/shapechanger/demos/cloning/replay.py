"""Demonstrations in the replay of a learner that goes on by reward.

Half of each batch is drawn from them (P. Ball and others, Efficient online reinforcement learning
with offline data, ICML 2023), so that what was shown is not forgotten.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray

from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.errors import MissingExtra

try:
    from stable_baselines3 import SAC
    from stable_baselines3.common import preprocessing
    from stable_baselines3.common.buffers import DictReplayBuffer, ReplayBuffer
    from stable_baselines3.common.type_aliases import ReplayBufferSamples
    from stable_baselines3.common.vec_env import VecNormalize
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

__all__ = ["MixedReplay", "keep_demonstrations"]


class MixedReplay(ReplayBuffer):
    """A replay whose batches are half of demonstrations.

    Attributes:
        demonstrations: Where that half comes from; None for none.
    """

    demonstrations: ReplayBuffer | None = None

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """A batch, the demonstrated transitions last."""
        if self.demonstrations is None:
            return super().sample(batch_size, env)
        half = batch_size // 2
        own = cast("Any", super().sample(batch_size - half, env))
        shown = self.demonstrations.sample(half, env)
        both: list[Any] = [
            None if one is None or other is None else torch.cat((one, other))
            for one, other in zip(own, shown, strict=True)
        ]
        return ReplayBufferSamples(*both)


def keep_demonstrations(
    model: SAC,
    observations: NDArray[Any],
    actions: NDArray[np.float32],
    rewards: NDArray[np.float32],
    episodes: Sequence[int],
    ends: NDArray[np.bool_] | None = None,
) -> None:
    """Let half of each batch that a learner draws be of demonstrations.

    Args:
        model: The learner, before it has collected anything: its replay is replaced.
        observations: What was perceived, as its env shows it: pictures of shape (n, H, W, 3), or
            states of shape (n, k).
        actions: What was done, shape (n, m).
        rewards: What each step was worth, shape (n,).
        episodes: How many steps each episode has, in order.
        ends: Which steps were the end, such as a collision, and not only the last that was
            recorded, shape (n,); None for none. The step before the end of a recording leads to
            its last; the last leads nowhere, and counts only where it was the end.

    Raises:
        CloningError: If it does not fit together, or the learner perceives several things at once.
    """
    learner = cast("Any", model)
    if isinstance(learner.replay_buffer, DictReplayBuffer):
        raise CloningError(
            "Demonstrations are kept for a learner that sees or feels, and not both."
        )
    lengths = {len(observations), len(actions), len(rewards), sum(episodes)}
    if len(lengths) > 1 or not np.isfinite(rewards).all():
        raise CloningError("Each demonstrated step needs an observation, an action and a reward.")
    space = learner.observation_space
    if cast("Any", preprocessing).is_image_space(space) and observations.shape[1:] != space.shape:
        observations = observations.transpose(0, 3, 1, 2)  # As SB3 turns what it sees.
    over = np.zeros(len(actions), np.bool_) if ends is None else ends
    shown = ReplayBuffer(len(actions), space, learner.action_space, device=model.device)
    scaled = learner.policy.scale_action(actions)
    at = 0
    for length in episodes:
        for i in range(at, at + length):
            then = min(i + 1, at + length - 1)
            if then == i and not over[i]:
                continue
            shown.add(
                observations[i : i + 1],
                observations[then : then + 1],
                scaled[i : i + 1],
                rewards[i : i + 1],
                over[i : i + 1].astype(np.float32),
                [{}],
            )
        at += length
    mixed = MixedReplay(
        learner.replay_buffer.buffer_size, space, learner.action_space, device=model.device
    )
    mixed.demonstrations = shown
    learner.replay_buffer = mixed
