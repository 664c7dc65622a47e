"""Stable-Baselines3 as a learner: training, with evaluations along the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np

from shapechanger.contract.env_ref import EnvRef, EnvTraits, is_single_instance, layouts_of
from shapechanger.errors import PolicyError, StudyError, needing_extra
from shapechanger.policy import PolicyCard, load_policy
from shapechanger.transfer.actions import require_ranges
from shapechanger.transfer.body_map import BodyMap, MappedEnv
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.identities import identities_in
from shapechanger.transfer.learners import Learner, ignore
from shapechanger.transfer.learners.evaluation import Evaluation, evaluate, evaluation_seed
from shapechanger.transfer.learners.policy_file import (
    Normalisation,
    TrainedPolicy,
    actor,
    build_model,
)
from shapechanger.transfer.learners.settings import Sb3Settings
from shapechanger.transfer.learners.vec_env import training_vec_env, with_scaled_actions
from shapechanger.transfer.transplant import transplant

with needing_extra("learn"):
    import torch
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor, VecNormalize

OnEvaluation = Callable[[Evaluation], None]
OnSteps = Callable[[int], None]

START_LOG_STD: Final = -1.0
"""Smallest logarithm of the standard deviation of an action, in units of half its range, at the
start of training from a policy.

A converged policy hardly explores: the shipped policy of the finger has standard deviations of 0.06
to 0.22, with which fine-tuning reached no target of another finger in 30,720 steps
(`python -m benchmarks.run finger-gap`, measured before the minimum was introduced). A larger
deviation of the source is kept, and none is raised above the deviation of a new policy.
"""


class Sb3Learner(Learner[Sb3Settings]):
    """Any algorithm of Stable-Baselines3."""

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse spaces that are no flat boxes of the layouts' sizes, and unbounded actions."""
        check_size(f"observation of {env}", traits.observation_space, traits.observation_layout)
        check_size(f"action of {env}", traits.action_space, traits.action_layout)
        require_ranges(env.id, traits.action_space, traits.action_layout)

    def train(
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        start: TrainedPolicy | None = None,
        body_map: BodyMap | None = None,
        on_evaluation: OnEvaluation = ignore,
        on_steps: OnSteps = lambda steps: None,
        callback: BaseCallback | None = None,
    ) -> TrainedPolicy:
        """Train a policy; evaluate it at the end, and earlier unless `on_evaluation` is `ignore`.

        `steps` are rounded up to whole updates, `on_steps` is called after each step of all envs,
        and `callback` is a callback of Stable-Baselines3.
        """
        self.settings.require_budget(steps)
        with ExitStack() as stack:
            # Making the envs imports the module that the id may name.
            eval_envs = self.evaluation_envs(env)
            for each in eval_envs:
                stack.callback(each.close)
            one = eval_envs[0]
            # A single instance is trained in the env that it is evaluated in.
            is_single = is_single_instance(one)
            settings = self.settings.for_one_env() if is_single else self.settings
            observation, action = layouts_of(one)
            card = PolicyCard(
                env=env,
                observation=observation,
                action=action,
                learner=self.name,
                settings=settings,
                seed=seed,
                identity=identities_in(env, one, settings),
            )
            together = DummyVecEnv([lambda: one]) if is_single else self._training_envs(env, one)
            stack.callback(together.close)
            envs = VecMonitor(with_scaled_actions(together, action, env.id))
            if settings.normalise:
                gamma = settings.model_arguments.get("gamma", 0.99)
                envs = VecNormalize(envs, norm_obs=self._normalises_observations, gamma=gamma)
            model, explores = self._first_model(envs, card, start, body_map)
            episodes = settings.eval_episodes
            first_seed = evaluation_seed(env, episodes)

            def evaluate_now() -> Evaluation:
                self._require_finite(model)
                act = actor(model, statistics_of(envs), action)
                found = evaluate(act, eval_envs, first_seed, model.num_timesteps, episodes=episodes)
                on_evaluation(found)
                return found

            # Skip evaluations without a recipient: for a finger, they take a third of the time.
            every = math.inf if on_evaluation is ignore else settings.eval_every
            # Evaluate before `learn`, whose first reset changes the running statistics.
            if on_evaluation is not ignore:
                evaluate_now()
            callbacks: list[BaseCallback] = [] if callback is None else [callback]
            if start is not None and "off-policy" in settings.takes:
                callbacks.append(_ActFirst(cast("Any", model).learning_starts))
            progress = Progress(evaluate_now, every, on_steps, is_single)
            self._learn(env, model, envs, settings.whole_updates(steps), callbacks, progress)
            evaluate_now()
            card = msgspec.structs.replace(
                card, steps=int(model.num_timesteps), start_log_std=explores
            )
            return TrainedPolicy(model, statistics_of(envs), card)

    def _learn(
        self,
        env: EnvRef,
        model: BaseAlgorithm,
        envs: VecEnv,
        steps: int,
        callbacks: list[BaseCallback],
        progress: Progress,
    ) -> None:
        """Train a model for whole updates in the envs that it was built with."""
        try:
            cast("Any", model).learn(steps, callback=[*callbacks, progress])
        except ValueError as error:  # PyTorch refuses distributions of NaN.
            self._require_finite(model)
            raise error

    def evaluate(self, env: EnvRef, policy: TrainedPolicy, body_map: BodyMap) -> Evaluation:
        """Evaluate a policy through the body map."""
        episodes = self.settings.eval_episodes
        with ExitStack() as stack:
            envs = self._adapted(self.evaluation_envs(env), policy, body_map)
            for one in envs:
                stack.callback(one.close)
            return evaluate(policy.act, envs, evaluation_seed(env, episodes), episodes=episodes)

    def load(self, path: Path) -> TrainedPolicy:
        """Load a policy."""
        policy = load_policy(path, self.settings.algorithm)
        if not isinstance(policy, TrainedPolicy):
            raise PolicyError(
                f"{path} is a clone or an ONNX policy, which {self.name} cannot train: give a "
                f"policy trained with {self.name}, or --learner cloning for a clone."
            )
        return policy

    def origin(self, path: Path) -> PolicyCard:
        """Read the card of a policy that this learner can start from."""
        card = self.load(path).card
        other: Any = card.settings
        if other.algorithm != self.settings.algorithm:
            raise PolicyError(
                f"{path} was trained with {other.algorithm}, and {self.name} is "
                f"{self.settings.algorithm}: give --learner {card.learner}."
            )
        return card

    def _training_envs(self, env: EnvRef, one: gym.Env[Any, Any]) -> VecEnv:
        """Make the parallel envs of a training; `one` is one of the evaluation envs."""
        return training_vec_env(env, self.settings.n_envs, self.threads)

    def _adapted(
        self, envs: list[gym.Env[Any, Any]], policy: TrainedPolicy, body_map: BodyMap
    ) -> list[gym.Env[Any, Any]]:
        return [MappedEnv(one, body_map) for one in envs]

    _normalises_observations = True

    def _first_model(
        self, envs: VecEnv, card: PolicyCard, start: TrainedPolicy | None, body_map: BodyMap | None
    ) -> tuple[BaseAlgorithm, tuple[float, ...] | None]:
        """Return the model that a training begins with, and its `start_log_std`."""
        if start is None or body_map is None:
            return self._new_model(envs, card), None
        if start.normalisation is not None and isinstance(envs, VecNormalize):
            # The source's critic predicts returns that are normalised by these statistics.
            envs.ret_rms = start.normalisation.reward.copy()
        model = self._moved(start, envs, card, body_map)
        if not isinstance(model.policy, ActorCriticPolicy):
            return model, None
        # Raise small deviations, so that the policy explores.
        log_std: torch.Tensor = model.policy.log_std
        least = min(START_LOG_STD, getattr(card.settings, "log_std_init", START_LOG_STD))
        with torch.no_grad():
            log_std.clamp_(min=least)
        return model, tuple(map(float, log_std.detach().numpy()))

    def _new_model(self, envs: VecEnv, card: PolicyCard) -> BaseAlgorithm:
        logs = None if self.tensorboard is None else str(self.tensorboard)
        return build_model(card.settings.for_model(), envs, card.seed, logs)

    def _moved(
        self, source: TrainedPolicy, envs: VecEnv, card: PolicyCard, body_map: BodyMap
    ) -> BaseAlgorithm:
        """Transplant the source policy into the target's shapes, with its statistics."""
        arguments, statistics = card.settings.for_model().model_arguments, source.normalisation
        return transplant(
            source.model,
            body_map,
            envs,
            normalisation=None if statistics is None else statistics.observation,
            seed=card.seed,
            device="cpu",
            tensorboard_log=None if self.tensorboard is None else str(self.tensorboard),
            **{name: value for name, value in arguments.items() if name != "policy_kwargs"},
        )

    def _require_finite(self, model: BaseAlgorithm) -> None:
        weights = cast("Any", model.policy).state_dict().values()
        if not all(torch.isfinite(one).all() for one in weights):
            raise StudyError(
                f"{self.name} diverged after {model.num_timesteps} steps: its weights are not "
                "finite. Try a smaller learning rate, or change the body less."
            )


def statistics_of(envs: VecEnv) -> Normalisation | None:
    """Return the normalisation statistics of envs; None if they do not normalise."""
    if not isinstance(envs, VecNormalize):
        return None
    observation = (
        envs.obs_rms if envs.norm_obs else RunningMeanStd(shape=envs.observation_space.shape)
    )  # pyright: ignore[reportArgumentType]
    return Normalisation(observation, envs.ret_rms)  # pyright: ignore[reportArgumentType]


class _ActFirst(BaseCallback):
    """Lets a transplanted policy act before the first update, when a new one acts randomly."""

    def __init__(self, learning_starts: int) -> None:
        super().__init__()
        self._learning_starts = learning_starts
        self._gradient_steps = 0

    def _on_training_start(self) -> None:
        model = cast("Any", self.model)
        self._gradient_steps = model.gradient_steps
        model.learning_starts = 0
        model.gradient_steps = 0

    def _on_step(self) -> bool:
        if self.num_timesteps > self._learning_starts:
            cast("Any", self.model).gradient_steps = self._gradient_steps
        return True


@dataclass(eq=False)
class Progress(BaseCallback):
    """Counts steps, and evaluates between updates, when the policy reflects all steps so far.

    Attributes:
        evaluate_now: Evaluates and reports the present policy.
        every: Steps between two evaluations.
        on_steps: Called with the number of steps done.
        restarts: Whether evaluations use the training env, which must then be reset after each.
    """

    evaluate_now: Callable[[], Evaluation]
    every: float
    on_steps: OnSteps
    restarts: bool

    def __post_init__(self) -> None:
        super().__init__()
        self._next = self.every

    def _on_step(self) -> bool:
        self.on_steps(self.num_timesteps)
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps < self._next:
            return
        self._next += self.every
        found = self.evaluate_now()
        means = {"mean_return": found.mean_return, "mean_length": found.mean_length, **found.terms}
        if found.standing is not None:
            means["standing"] = found.standing
        for name, value in means.items():
            self.logger.record(f"eval/{name}", value)
        if self.restarts:
            model = cast("Any", self.model)
            model._last_obs = self.training_env.reset()
            model._last_episode_starts = np.ones((self.training_env.num_envs,), bool)
