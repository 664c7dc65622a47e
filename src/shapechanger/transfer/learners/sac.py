"""SAC from camera: a clone of a few demonstrations goes on by trying.

The demonstrations stay in its replay: half of each batch is drawn from them (P. Ball and others,
Efficient online reinforcement learning with offline data, ICML 2023). The critics learn on them
alone first, while the clone waits; so they know what driving is worth before they change it. And
each step of SAC is followed by one of cloning, so that what was shown is not forgotten.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NotRequired, Required, TypedDict, Unpack, cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.replay import MixedReplay
from shapechanger.demos.cloning.sb3 import from_sb3, to_sb3
from shapechanger.errors import MissingExtra
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.learners.cloning import (
    DemonstrationFile,
    Demonstrations,
    evaluate_clone,
    load_or_record,
    train_clones,
)
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.settings import CloningSettings, SacSettings

__all__ = [
    "AnchoredSAC",
    "CameraTrainingOptions",
    "MixedReplay",
    "train_camera_policy",
    "train_sac",
]

try:
    from stable_baselines3 import SAC
    from stable_baselines3.common.buffers import ReplayBuffer
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.utils import polyak_update
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error


# As in cloning: where the loss turns from a square into a straight line.
_HUBER_BETA: Final = 0.1


class AnchoredSAC(SAC):
    """SAC that takes a step of cloning after each of its own, so that it forgets nobody's driving.

    Attributes:
        shown: Features and meant actions of the demonstrations, each (n, ...); None for none.
        anchor: Takes the steps of cloning.
    """

    shown: tuple[Tensor, Tensor] | None = None
    anchor: torch.optim.Optimizer | None = None

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """So many steps of both."""
        super().train(gradient_steps, batch_size)
        if self.shown is None or self.anchor is None:
            return
        seen, meant = self.shown
        for _ in range(gradient_steps):
            some = torch.randint(len(seen), (batch_size,))
            acted = cast("Any", self.actor)(seen[some], deterministic=True)
            loss = functional.smooth_l1_loss(acted, meant[some], beta=_HUBER_BETA)
            self.anchor.zero_grad()
            loss.backward()  # pyright: ignore[reportUnknownMemberType]
            self.anchor.step()  # pyright: ignore[reportUnknownMemberType]


def train_sac(
    env: EnvRef,
    settings: SacSettings,
    steps: int,
    seed: int,
    *,
    demonstrations: DemonstrationFile,
    start: CameraPolicy | None = None,
    only_last: bool = False,
    on_evaluation: Callable[[Evaluation], None],
    on_steps: Callable[[int], None] = lambda steps: None,
) -> CameraPolicy:
    """Clone demonstrations, go on by trying, and judge what was learned along the way.

    Args:
        env: The env.
        settings: How.
        steps: How many steps in it, those of the demonstrations included.
        seed: Of everything random in it.
        demonstrations: Where they are, or come to be.
        start: A policy to go on from, in place of none.
        only_last: Whether only the first and the last evaluation are of interest.
        on_evaluation: Called with each evaluation.
        on_steps: Called with the number of steps.

    Returns:
        The policy at the end, without its noise.
    """
    cloning = settings.cloning()
    first = train_clones(
        env,
        cloning,
        settings.demonstrated_steps,
        seed,
        demonstrations=demonstrations,
        start=start,
        on_evaluation=on_evaluation,
    )
    shown = load_or_record(
        demonstrations,
        env,
        settings.demonstrated_steps,
        settings.episode_steps,
        settings.clone.framing,
    )
    tried = steps - settings.demonstrated_steps
    made = env.make(max_episode_steps=settings.episode_steps)
    try:
        model = to_sb3(
            first,
            made,
            learner=AnchoredSAC,
            seed=seed % 2**31,
            learning_rate=settings.learning_rate,
            batch_size=settings.batch_size,
            gamma=settings.gamma,
            ent_coef=settings.ent_coef,
            learning_starts=0,  # Before that SB3 would drive at random.
            buffer_size=max(tried, settings.batch_size),
            replay_buffer_class=MixedReplay,
            device="cpu",
        )
        replay = _as_replay(shown, first, model)
        cast("Any", model.replay_buffer).demonstrations = replay
        _teach_critics(model, replay, settings)
        _drop_anchor(model, shown, first, settings)
        watcher = _Watcher(env, settings, first, tried, only_last, on_evaluation, on_steps)
        cast("Any", model).learn(tried, callback=watcher)
        policy = from_sb3(model, first)
        on_evaluation(evaluate_clone(env, policy, settings, steps))
    finally:
        made.close()
    return policy.described(tried_steps=tried)


def _as_replay(shown: Demonstrations, policy: CameraPolicy, model: SAC) -> ReplayBuffer:
    """Demonstrations as transitions. The last step of an episode has no next picture."""
    learner = cast("Any", model)
    replay = ReplayBuffer(
        len(shown.rewards), learner.observation_space, learner.action_space, device=model.device
    )
    seen = policy.features(shown.pictures)
    at = 0
    for length in shown.episodes:
        for i in range(at, at + length - 1):
            replay.add(
                seen[i : i + 1],
                seen[i + 1 : i + 2],
                shown.done[i : i + 1],
                shown.rewards[i : i + 1],
                np.zeros(1, np.float32),
                [{}],
            )
        at += length
    return replay


def _teach_critics(model: SAC, replay: ReplayBuffer, settings: SacSettings) -> None:
    """Let the critics judge the clone by what was demonstrated, and leave the clone as it is."""
    learner = cast("Any", model)
    for _ in range(settings.critic_warm_up):
        batch = replay.sample(settings.batch_size)
        with torch.no_grad():
            then = learner.actor(batch.next_observations, deterministic=True)
            worth = torch.cat(learner.critic_target(batch.next_observations, then), dim=1)
            best = worth.min(dim=1, keepdim=True).values
            target = batch.rewards + (1.0 - batch.dones) * settings.gamma * best
        found = learner.critic(batch.observations, batch.actions)
        loss = torch.stack([functional.mse_loss(one, target) for one in found]).sum()
        learner.critic.optimizer.zero_grad()
        loss.backward()  # pyright: ignore[reportUnknownMemberType]
        learner.critic.optimizer.step()
        polyak_update(learner.critic.parameters(), learner.critic_target.parameters(), learner.tau)


def _drop_anchor(
    model: SAC, shown: Demonstrations, policy: CameraPolicy, settings: SacSettings
) -> None:
    """Let it go on cloning what was shown, as far as the settings ask for that."""
    if not settings.anchor_rate or not isinstance(model, AnchoredSAC):
        return
    model.shown = torch.as_tensor(policy.features(shown.pictures)), torch.as_tensor(shown.actions)
    hands = cast("nn.Linear", model.actor.mu)
    model.anchor = torch.optim.Adam(hands.parameters(), lr=settings.anchor_rate)


class _Watcher(BaseCallback):
    """Judges the policy every so many steps, but neither before the first nor after the last."""

    def __init__(
        self,
        env: EnvRef,
        settings: SacSettings,
        first: CameraPolicy,
        steps: int,
        only_last: bool,
        on_evaluation: Callable[[Evaluation], None],
        on_steps: Callable[[int], None],
    ) -> None:
        super().__init__()
        self._env = env
        self._settings = settings
        self._first = first
        self._steps = steps
        self._only_last = only_last
        self._on_evaluation = on_evaluation
        self._on_steps = on_steps

    def _on_step(self) -> bool:
        tried = self.num_timesteps
        done = self._settings.demonstrated_steps + tried
        self._on_steps(done)
        is_due = tried % self._settings.eval_every == 0 and tried < self._steps
        if is_due and not self._only_last:
            policy = from_sb3(cast("SAC", self.model), self._first)
            self._on_evaluation(evaluate_clone(self._env, policy, self._settings, done))
        return True


class CameraTrainingOptions(TypedDict):
    """What `train_clones` and `train_sac` both take by name."""

    demonstrations: Required[DemonstrationFile]
    start: NotRequired[CameraPolicy | None]
    only_last: NotRequired[bool]
    on_evaluation: Required[Callable[[Evaluation], None]]
    on_steps: NotRequired[Callable[[int], None]]


def train_camera_policy(
    env: EnvRef,
    settings: CloningSettings | SacSettings,
    steps: int,
    seed: int,
    **options: Unpack[CameraTrainingOptions],
) -> CameraPolicy:
    """Learn as the settings say; see `train_clones` and `train_sac`."""
    if isinstance(settings, CloningSettings):
        return train_clones(env, settings, steps, seed, **options)
    return train_sac(env, settings, steps, seed, **options)
