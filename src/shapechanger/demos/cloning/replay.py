"""Demonstrations in the replay buffer of a reinforcement learner.

Half of each batch is demonstrations, so that they are not forgotten: P. Ball et al., "Efficient
Online Reinforcement Learning with Offline Data", ICML 2023.
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
    """Replay buffer whose batches consist of demonstrations by half.

    Attributes:
        demonstrations: Buffer with the demonstrations; None for none.
    """

    demonstrations: ReplayBuffer | None = None

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Return a batch, with the demonstrated transitions last.

        Args:
            batch_size: Number of transitions.
            env: As in `ReplayBuffer.sample`.
        """
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
    """Fill half of each batch of a learner with demonstrations.

    Args:
        model: The learner, before it has collected data: its replay buffer is replaced.
        observations: As the env returns them: pictures, shape (n, H, W, 3), or states, shape (n,
            k).
        actions: Shape (n, m).
        rewards: Shape (n,).
        episodes: Number of steps of each episode, in order.
        ends: Mask of the steps that terminated, for example by a collision, shape (n,); None for
            none. The last step of a recording has no next observation, and is used only if it
            terminated.

    Raises:
        CloningError: If the arrays do not match, or the observations of the learner are a
            dictionary.
    """
    learner = cast("Any", model)
    if isinstance(learner.replay_buffer, DictReplayBuffer):
        raise CloningError(
            "Demonstrations can be kept for a learner with pictures or a state, but not both."
        )
    lengths = {len(observations), len(actions), len(rewards), sum(episodes)}
    if len(lengths) > 1 or not np.isfinite(rewards).all():
        raise CloningError(
            "Each demonstrated step needs an observation, an action and a finite reward."
        )
    space = learner.observation_space
    if cast("Any", preprocessing).is_image_space(space) and observations.shape[1:] != space.shape:
        observations = observations.transpose(0, 3, 1, 2)  # SB3 puts the channels first.
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
