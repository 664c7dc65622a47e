"""Stable-Baselines3 as a learner: training, with evaluations along the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np

from shapechanger.contract.env_ref import (
    EnvRef,
    EnvTraits,
    each_body,
    is_single_instance,
    layouts_of,
)
from shapechanger.errors import MissingExtra, SpaceMismatch, StudyError, TransplantError
from shapechanger.layout import Layout
from shapechanger.transfer.actions import require_ranges
from shapechanger.transfer.body_map import BodyMap, MappedEnv
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.learners import DemonstrationFile, PolicyOrigin, ignore
from shapechanger.transfer.learners.algorithms import build_model
from shapechanger.transfer.learners.cloning import is_clone
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    evaluation_envs,
    evaluation_seed,
)
from shapechanger.transfer.learners.policy_file import (
    Normalisation,
    PolicyCard,
    TrainedPolicy,
    actor,
    load_policy,
    save_policy,
)
from shapechanger.transfer.learners.settings import (
    LimbSettings,
    OffPolicySettings,
    Sb3Settings,
    require_budget,
)
from shapechanger.transfer.learners.vec_env import training_vec_env, with_scaled_actions
from shapechanger.transfer.limbs.envs import LimbVecEnv, rows_of_each
from shapechanger.transfer.limbs.rows import require_same_columns
from shapechanger.transfer.transplant import transplant
from shapechanger.transfer.versions import identities_in

try:
    import torch
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor, VecNormalize
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

OnEvaluation = Callable[[Evaluation], None]
OnSteps = Callable[[int], None]

START_LOG_STD: Final = -1.0
"""Smallest logarithm of the standard deviation of an action, in half its range, at the start of
training from a policy.

A converged policy hardly explores: with the standard deviations of 0.06 to 0.22 of the shipped
finger's policy, fine-tuning reached no target of another finger in 30,720 steps
(`python -m benchmarks.run finger-gap`, measured before this was raised). A source that explores
more keeps its own deviation, and none starts above that of a new policy because of this.
"""


class Sb3Learner:
    """Any algorithm of Stable-Baselines3: a `shapechanger.transfer.learners.Learner`.

    Args:
        name: Name of the learner, for the cards of its policies.
        settings: Its settings.
        tensorboard: Folder of TensorBoard's logs; None for none.
        threads: Threads that step the envs, None for one per core; the result is the same. One by
            default: a study runs as many trainings at a time as there are cores.
    """

    def __init__(
        self,
        name: str,
        settings: Sb3Settings,
        *,
        tensorboard: Path | None = None,
        threads: int | None = 1,
    ) -> None:
        self._name = name
        self._settings = settings
        self._tensorboard = None if tensorboard is None else str(tensorboard)
        self._threads = threads

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env whose spaces are not flat boxes of the sizes of its layouts."""
        check_size(f"observation of {env}", traits.observation_space, traits.observation_layout)
        check_size(f"action of {env}", traits.action_space, traits.action_layout)
        require_ranges(env.id, traits.action_space, traits.action_layout)
        if isinstance(self._settings, LimbSettings):
            rows_of_each(each_body(env), self._settings.room)

    def train(
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        demonstrations: DemonstrationFile | None = None,
        start: TrainedPolicy | None = None,
        body_map: BodyMap | None = None,
        only_last: bool = False,
        callback: BaseCallback | None = None,
        rehearsal: Any = None,
        on_evaluation: OnEvaluation,
        on_steps: OnSteps = lambda steps: None,
    ) -> TrainedPolicy:
        """Train a policy, evaluating it before the first step, along the way, and at the end.

        `steps` are rounded up to whole updates, `on_steps` is called after each step of all envs,
        and `demonstrations` and `only_last` are not used.

        Raises:
            StudyError: If `steps` is smaller than one evaluation, a rehearsal is given, or the
                training diverges.
            TransplantError: If the source policy is of a kind that cannot be transplanted.
        """
        del demonstrations, only_last
        if rehearsal is not None:
            raise StudyError(f"{self._name} learns by trial and rehearses no demonstrations.")
        settings = self._settings
        require_budget(steps, settings)
        # These import the module of the id, if it names one.
        eval_envs = evaluation_envs(env, settings)
        identity = identities_in(env, eval_envs[0], settings)
        if single := is_single_instance(eval_envs[0]):
            # It is trained in the env that it is evaluated in.
            settings = settings.for_one_env()
            together: VecEnv = DummyVecEnv([lambda: eval_envs[0]])
        else:
            together = _training_envs(env, settings, self._threads)
        layouts = layouts_of(eval_envs[0])
        try:
            scaled = with_scaled_actions(together, layouts[1], env.id)
        except SpaceMismatch:
            together.close()
            raise
        envs = _with_statistics(VecMonitor(scaled), settings)
        try:
            if start is not None and isinstance(settings, LimbSettings):
                require_same_columns(start.card.observation, layouts[0], env.id)
            model, explores = _first_model(envs, settings, seed, self._tensorboard, start, body_map)
            first_seed = evaluation_seed(env, settings.eval_episodes)
            evaluations = _PeriodicEvaluation(
                self._name,
                settings,
                eval_envs,
                layouts[1],
                first_seed,
                single,
                on_evaluation,
                on_steps,
            )
            # Before `learn`: it starts with a reset, which already changes the running statistics.
            if on_evaluation is not ignore:
                on_evaluation(evaluations.evaluate(model, envs))
            callbacks: list[BaseCallback] = [] if callback is None else [callback]
            if start is not None and isinstance(settings, OffPolicySettings):
                callbacks.append(_ActFirst(settings.learning_starts))
            callbacks.append(evaluations)
            try:
                cast("Any", model).learn(settings.whole_updates(steps), callback=callbacks)
            except ValueError as error:  # PyTorch refuses distributions of NaN.
                _require_finite(model, self._name)
                raise error
            evaluations.evaluate_now()
            card = PolicyCard(
                env,
                *layouts,
                self._name,
                settings,
                int(cast("Any", model).num_timesteps),
                seed,
                version("shapechanger"),
                identity,
                start_log_std=explores,
            )
            return TrainedPolicy(model, _statistics(envs), card)
        finally:
            envs.close()
            for one in eval_envs:
                one.close()

    def evaluate(self, env: EnvRef, policy: TrainedPolicy, body_map: BodyMap) -> Evaluation:
        """Evaluate a policy through the body map, which a policy of limbs does not need."""
        envs: list[gym.Env[Any, Any]] = evaluation_envs(env, self._settings)
        if isinstance(self._settings, LimbSettings):
            require_same_columns(policy.card.observation, layouts_of(envs[0])[0], env.id)
        else:
            envs = [MappedEnv(one, body_map) for one in envs]
        try:
            episodes = self._settings.eval_episodes
            return evaluate(policy.act, envs, evaluation_seed(env, episodes), episodes=episodes)
        finally:
            for one in envs:
                one.close()

    def load(self, path: Path) -> TrainedPolicy:
        """Load a policy."""
        return load_policy(path, self._settings.algorithm)

    def save(self, policy: TrainedPolicy, path: Path) -> None:
        """Write a policy to a file."""
        save_policy(policy, path)

    def origin(self, path: Path) -> PolicyOrigin:
        """Read where a policy comes from.

        Raises:
            StudyError: If it is a clone, or another algorithm trained it.
        """
        if is_clone(path):
            raise StudyError(
                f"{path} is a clone, and {self._name} does not learn from pictures: give "
                f"--learner cloning, or a policy trained with {self._name}."
            )
        card = self.load(path).card
        if card.settings.algorithm != self._settings.algorithm:
            raise StudyError(
                f"{path} was trained with {card.settings.algorithm}, and {self._name} is "
                f"{self._settings.algorithm}: give --learner {card.learner}."
            )
        return PolicyOrigin(card.env, card.steps, card.identity)


def _training_envs(env: EnvRef, settings: Sb3Settings, threads: int | None) -> VecEnv:
    """Make the parallel envs of a training."""
    if isinstance(settings, LimbSettings):
        return LimbVecEnv(env, settings.n_envs, threads=threads, room=settings.room)
    return training_vec_env(env, settings.n_envs, threads)


def _with_statistics(envs: VecEnv, settings: Sb3Settings) -> VecEnv:
    """Return envs that keep the statistics of a learner that normalises."""
    if not settings.normalise:
        return envs
    # Rows of limbs are scaled already.
    seen = not isinstance(settings, LimbSettings)
    gamma = settings.model_arguments.get("gamma", 0.99)
    return VecNormalize(envs, norm_obs=seen, gamma=gamma)


def _first_model(
    envs: VecEnv,
    settings: Sb3Settings,
    seed: int,
    tensorboard: str | None,
    start: TrainedPolicy | None,
    body_map: BodyMap | None,
) -> tuple[BaseAlgorithm, tuple[float, ...] | None]:
    """Return the model that a training begins with.

    Returns:
        The model, and what `_explore` returns if it begins with the weights of a policy.
    """
    if start is None or body_map is None:
        return build_model(settings, envs, seed, tensorboard), None
    if isinstance(settings, LimbSettings):
        model = build_model(settings, envs, seed, tensorboard)
        _take_weights(model, envs, start)
    else:
        model = _transplanted_model(envs, settings, seed, tensorboard, start, body_map)
    return model, _explore(model, settings)


def _take_weights(model: BaseAlgorithm, envs: VecEnv, source: TrainedPolicy) -> None:
    """Give a model the weights of a policy of limbs, which fit any body of its family.

    Raises:
        TransplantError: If its network is padded for another number of limbs.
    """
    statistics = source.normalisation
    if statistics is not None and isinstance(envs, VecNormalize):
        envs.ret_rms = statistics.reward.copy()
    try:
        cast("Any", model.policy).load_state_dict(source.model.policy.state_dict())
    except RuntimeError as error:
        raise TransplantError(
            f"The network of the policy of {source.card.env.id} is padded for another number of "
            "limbs than this training's: give the same --set room."
        ) from error


def use_one_thread() -> None:
    """Limit PyTorch in this process to one thread.

    Networks this small gain nothing from more, several runs share the machine, and sums in another
    order are other sums.
    """
    torch.set_num_threads(1)


def _transplanted_model(
    envs: VecEnv,
    settings: Sb3Settings,
    seed: int,
    tensorboard: str | None,
    source: TrainedPolicy,
    body_map: BodyMap,
) -> BaseAlgorithm:
    """The source policy in the target's shapes, with its statistics, ready for training."""
    statistics = source.normalisation
    if statistics is not None and isinstance(envs, VecNormalize):
        # The critic predicts rewards divided by these.
        envs.ret_rms = statistics.reward.copy()
    arguments = {
        name: value for name, value in settings.model_arguments.items() if name != "policy_kwargs"
    }
    return transplant(
        source.model,
        body_map,
        envs,
        normalisation=None if statistics is None else statistics.observation,
        seed=seed,
        device="cpu",
        tensorboard_log=tensorboard,
        **arguments,
    )


def _explore(model: BaseAlgorithm, settings: Sb3Settings) -> tuple[float, ...] | None:
    """Raise standard deviations that have collapsed to `START_LOG_STD`.

    Returns:
        Logarithms of the standard deviations that the training starts with; None for policies whose
        deviation depends on the observation, as SAC's, which their entropy target raises.
    """
    if not isinstance(model.policy, ActorCriticPolicy):
        return None
    log_std: torch.Tensor = model.policy.log_std
    with torch.no_grad():
        log_std.clamp_(min=min(START_LOG_STD, getattr(settings, "log_std_init", START_LOG_STD)))
    return tuple(map(float, log_std.detach().numpy()))


def _require_finite(model: BaseAlgorithm, learner: str) -> None:
    """Refuse a model whose weights are not all finite."""
    weights = cast("Any", model.policy).state_dict().values()
    if not all(torch.isfinite(one).all() for one in weights):
        raise StudyError(
            f"{learner} diverged after {model.num_timesteps} steps: its weights are not finite. "
            "Try a smaller learning rate or a milder body."
        )


def _statistics(envs: VecEnv) -> Normalisation | None:
    if not isinstance(envs, VecNormalize):
        return None
    observation = (
        envs.obs_rms if envs.norm_obs else RunningMeanStd(shape=envs.observation_space.shape)
    )  # pyright: ignore[reportArgumentType]
    return Normalisation(observation, envs.ret_rms)  # pyright: ignore[reportArgumentType]


class _ActFirst(BaseCallback):
    """Lets a transplanted policy act itself before the first update, where a new one is random."""

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


class _PeriodicEvaluation(BaseCallback):
    """Evaluates between updates, when the policy reflects all steps so far."""

    def __init__(
        self,
        learner: str,
        settings: Sb3Settings,
        envs: list[gym.Env[Any, Any]],
        action: Layout,
        first_seed: int,
        single: bool,
        on_evaluation: OnEvaluation,
        on_steps: OnSteps,
    ) -> None:
        super().__init__()
        self._learner = learner
        self._settings = settings
        self._envs = envs
        self._action = action
        self._first_seed = first_seed
        self._single = single
        self._on_evaluation = on_evaluation
        self._on_steps = on_steps
        # A third of the time of a finger's training is evaluation.
        self._next = math.inf if on_evaluation is ignore else settings.eval_every

    def _on_step(self) -> bool:
        self._on_steps(self.num_timesteps)
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self.evaluate_now()
            self._next += self._settings.eval_every
            if self._single:
                self._restart_episode()

    def evaluate(self, model: BaseAlgorithm, envs: VecEnv, steps: int = 0) -> Evaluation:
        """Evaluate a model.

        Args:
            model: The model.
            envs: Its training envs, for their statistics.
            steps: Training steps so far.
        """
        return evaluate(
            actor(model, _statistics(envs), self._action),
            self._envs,
            self._first_seed,
            steps,
            episodes=self._settings.eval_episodes,
        )

    def evaluate_now(self) -> None:
        """Evaluate, log and report the current policy."""
        _require_finite(self.model, self._learner)
        result = self.evaluate(self.model, self.training_env, self.num_timesteps)
        self.logger.record("eval/mean_return", result.mean_return)
        self.logger.record("eval/mean_length", result.mean_length)
        if result.standing is not None:
            self.logger.record("eval/standing", result.standing)
        for name, value in result.terms.items():
            self.logger.record(f"eval/{name}", value)
        self._on_evaluation(result)

    def _restart_episode(self) -> None:
        """Reset the training env, which the evaluation has used."""
        model = cast("Any", self.model)
        model._last_obs = self.training_env.reset()
        model._last_episode_starts = np.ones((self.training_env.num_envs,), bool)
