"""SAC from a camera, starting from a clone of a few demonstrations.

The demonstrations stay in the replay buffer: half of each batch is drawn from them (P. Ball and
others, Efficient online reinforcement learning with offline data, ICML 2023). The critics are first
trained on them alone, with the actor fixed, so that they are accurate before they change it. Each
SAC update is followed by a cloning step, so that demonstrated behaviour is not forgotten.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NotRequired, Required, TypedDict, Unpack, cast

import msgspec
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.replay import MixedReplay
from shapechanger.demos.cloning.sb3 import from_sb3, to_sb3
from shapechanger.errors import MissingExtra, StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.env_ref import EnvRef, EnvTraits, env_traits
from shapechanger.transfer.learners import PolicyOrigin
from shapechanger.transfer.learners.cloning import (
    DemonstrationFile,
    Demonstrations,
    evaluate_clone,
    is_clone,
    load_clone,
    load_or_record,
    require_camera_env,
    train_clones,
)
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import load_policy
from shapechanger.transfer.learners.settings import CameraSacSettings, CloningSettings

try:
    from stable_baselines3 import SAC
    from stable_baselines3.common.buffers import ReplayBuffer
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.utils import polyak_update
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

__all__ = [
    "AnchoredSAC",
    "CameraLearner",
    "CameraTrainingOptions",
    "MixedReplay",
    "train_camera_policy",
    "train_camera_sac",
]

# As in cloning: where the loss turns from quadratic to linear.
_HUBER_BETA: Final = 0.1


class CameraTrainingOptions(TypedDict):
    """Keyword arguments of both `train_clones` and `train_camera_sac`."""

    demonstrations: Required[DemonstrationFile]
    start: NotRequired[CameraPolicy | None]
    only_last: NotRequired[bool]
    on_evaluation: Required[Callable[[Evaluation], None]]
    on_steps: NotRequired[Callable[[int], None]]


class _CardData(msgspec.Struct):
    """Provenance in the card of a clone that a study or `shapechanger train` wrote."""

    env: str
    arguments: dict[str, Any]
    demonstrated_steps: int
    tried_steps: int = 0


class CameraLearner:
    """Cloning, or SAC that starts from a clone: a `shapechanger.transfer.learners.Learner`.

    Args:
        name: Name of the learner.
        settings: Its settings.
    """

    def __init__(self, name: str, settings: CloningSettings | CameraSacSettings) -> None:
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
        body_map: BodyMap | None = None,
        callback: Any = None,
        **options: Unpack[CameraTrainingOptions],
    ) -> CameraPolicy:
        """Train a policy; all vehicles share one camera and action, so the body map is unused.

        Raises:
            StudyError: If a callback is given.
        """
        del body_map
        if callback is not None:
            raise StudyError(f"{self._name} takes no callback of Stable-Baselines3.")
        return _train(env, self._settings, steps, seed, **options)

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
        steps = data.demonstrated_steps + data.tried_steps
        return PolicyOrigin(EnvRef(data.env, data.arguments), steps)


def train_camera_policy(
    env: EnvRef,
    settings: CloningSettings | CameraSacSettings,
    steps: int,
    seed: int,
    **options: Unpack[CameraTrainingOptions],
) -> CameraPolicy:
    """Train with cloning or SAC, as the settings are; see `train_clones` and `train_camera_sac`.

    Args:
        env: The env.
        settings: The settings.
        steps: Budget, in steps.
        seed: Seed of the training.
        **options: Keyword arguments of `train_clones` and `train_camera_sac`.

    Raises:
        StudyError: If the env has no camera or no demonstrator.
    """
    made = env.make()
    try:
        traits = env_traits(made)
    finally:
        made.close()
    name = "cloning" if isinstance(settings, CloningSettings) else "sac-camera"
    CameraLearner(name, settings).require(env, traits)
    return _train(env, settings, steps, seed, **options)


def _train(
    env: EnvRef,
    settings: CloningSettings | CameraSacSettings,
    steps: int,
    seed: int,
    **options: Unpack[CameraTrainingOptions],
) -> CameraPolicy:
    if isinstance(settings, CloningSettings):
        return train_clones(env, settings, steps, seed, **options)
    return train_camera_sac(env, settings, steps, seed, **options)


class AnchoredSAC(SAC):
    """SAC that takes a cloning step after each update, so that demonstrations are not forgotten.

    Attributes:
        shown: Features and intended actions of the demonstrations, each (n, ...); None for none.
        anchor: Optimiser of the cloning steps.
    """

    shown: tuple[Tensor, Tensor] | None = None
    anchor: torch.optim.Optimizer | None = None

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Take `gradient_steps` steps of both."""
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


def train_camera_sac(
    env: EnvRef,
    settings: CameraSacSettings,
    steps: int,
    seed: int,
    *,
    demonstrations: DemonstrationFile,
    start: CameraPolicy | None = None,
    only_last: bool = False,
    on_evaluation: Callable[[Evaluation], None],
    on_steps: Callable[[int], None] = lambda steps: None,
) -> CameraPolicy:
    """Clone demonstrations, continue with SAC, and evaluate along the way.

    Args:
        env: The env.
        settings: The settings.
        steps: Number of steps, demonstrated ones included.
        seed: Seed of the training.
        demonstrations: File of the demonstrations; recorded if missing.
        start: The policy to start from; None for a new one.
        only_last: Skip all evaluations but the first and the last.
        on_evaluation: Called with each evaluation.
        on_steps: Called with the number of steps.

    Returns:
        The final policy, without exploration noise.
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
            learning_starts=0,  # SB3 would act at random before.
            buffer_size=max(tried, settings.batch_size),
            replay_buffer_class=MixedReplay,
            device="cpu",
        )
        replay = _as_replay(shown, first, model)
        cast("Any", model.replay_buffer).demonstrations = replay
        _warm_up_critics(model, replay, settings)
        _add_anchor(model, shown, first, settings)
        watcher = _PeriodicEvaluation(
            env, settings, first, tried, only_last, on_evaluation, on_steps
        )
        cast("Any", model).learn(tried, callback=watcher)
        policy = from_sb3(model, first)
        on_evaluation(evaluate_clone(env, policy, settings, steps))
    finally:
        made.close()
    return policy.described(tried_steps=tried)


def _as_replay(shown: Demonstrations, policy: CameraPolicy, model: SAC) -> ReplayBuffer:
    """Turn demonstrations into transitions; the last step of an episode has no next picture."""
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


def _warm_up_critics(model: SAC, replay: ReplayBuffer, settings: CameraSacSettings) -> None:
    """Train the critics on the demonstrations with the actor fixed."""
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


def _add_anchor(
    model: SAC, shown: Demonstrations, policy: CameraPolicy, settings: CameraSacSettings
) -> None:
    """Add the cloning step, if the settings have one."""
    if not settings.anchor_rate or not isinstance(model, AnchoredSAC):
        return
    model.shown = torch.as_tensor(policy.features(shown.pictures)), torch.as_tensor(shown.actions)
    hands = cast("nn.Linear", model.actor.mu)
    model.anchor = torch.optim.Adam(hands.parameters(), lr=settings.anchor_rate)


class _PeriodicEvaluation(BaseCallback):
    """Evaluates the policy at regular steps between the first and the last."""

    def __init__(
        self,
        env: EnvRef,
        settings: CameraSacSettings,
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
