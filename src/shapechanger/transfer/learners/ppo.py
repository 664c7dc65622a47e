"""The envs that a learner steps together, as Stable-Baselines3 wants them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

import shapechanger
from shapechanger.errors import MissingExtra, StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.env_ref import EnvRef, layouts_of
from shapechanger.transfer.learners.evaluation import (
    Evaluation,
    evaluate,
    evaluation_envs,
    is_single_instance,
)
from shapechanger.transfer.learners.policy_file import (
    Normalisation,
    PolicyCard,
    TrainedPolicy,
    actor,
)
from shapechanger.transfer.learners.settings import LearnerSettings, Settings
from shapechanger.transfer.transplant import transplant

__all__ = [
    "EVALUATION_SEED",
    "OnEvaluation",
    "OnSteps",
    "ThreadVecEnv",
    "require_budget",
    "single_vec_env",
    "train",
    "training_vec_env",
    "use_one_thread",
]

try:
    from stable_baselines3.common import env_util
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error


_Indices = None | int | Iterable[int]


class ThreadVecEnv(VecEnv):
    """Envs of one id, stepped by threads, with the numbers of `DummyVecEnv` to the last bit.

    An env that has ended starts again in the same step. Its info then has the last observation as
    `terminal_observation`, every info says under `TimeLimit.truncated` whether the clock alone
    ended the episode, and rewards are of single precision: all as in `DummyVecEnv`.

    Args:
        env_id: A registered id.
        num_envs: How many envs.
        threads: As in `shapechanger.make_vec`.
        **arguments: All other arguments of `shapechanger.make_vec`.
    """

    def __init__(
        self, env_id: str, num_envs: int, *, threads: int | None = None, **arguments: Any
    ) -> None:
        self._envs = shapechanger.make_vec(
            env_id, num_envs, threads=threads, autoreset_mode="SameStep", **arguments
        )
        self._actions: Any = None
        cast("Any", super()).__init__(
            num_envs, self._envs.single_observation_space, self._envs.single_action_space
        )
        # As DummyVecEnv, which replaces what the base class has put together.
        self.metadata = self._envs.envs[0].metadata

    def reset(self) -> NDArray[Any]:
        """Start an episode in each env, with the seeds and options set before."""
        options = [each or None for each in self._options]
        observations, self.reset_infos = self._envs.reset_each(self._seeds, options)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Take one step in each env; observations, rewards, ends and infos."""
        observations, results = self._envs.step_each(self._actions)
        infos = results.of_each()
        cut_off = results.truncated & ~results.terminated
        for info, cut in zip(infos, cut_off.tolist(), strict=True):
            info["TimeLimit.truncated"] = cut
        for i, restart in results.restarts.items():
            infos[i]["terminal_observation"] = restart.final_observation
            self.reset_infos[i] = restart.info
        ends = results.terminated | results.truncated
        return observations, results.rewards.astype(np.float32), ends, infos

    def close(self) -> None:
        """Close the envs; twice is fine."""
        self._envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """One picture per env."""
        return self._envs.render()

    def get_attr(self, attr_name: str, indices: _Indices = None) -> list[Any]:
        """An attribute of each env, or of some."""
        return [env.get_wrapper_attr(attr_name) for env in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: _Indices = None) -> None:
        """Set an attribute of each env, or of some."""
        for env in self._chosen(indices):
            setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: _Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of each env, or of some."""
        return [
            env.get_wrapper_attr(method_name)(*method_args, **method_kwargs)
            for env in self._chosen(indices)
        ]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: _Indices = None
    ) -> list[bool]:
        """Whether each env, or some, are wrapped by a class."""
        return [env_util.is_wrapped(env, wrapper_class) for env in self._chosen(indices)]

    def _chosen(self, indices: _Indices) -> list[gym.Env[Any, Any]]:
        return [self._envs.envs[i] for i in self._get_indices(indices)]


def training_vec_env(env: EnvRef, num_envs: int, threads: int | None) -> VecEnv:
    """The envs that a learner steps together.

    Envs of the catalogue are stepped by threads. Those of others may share what they change, so
    they are stepped one after another; the numbers would be the same.

    Args:
        env: The env.
        num_envs: How many.
        threads: As in `shapechanger.make_vec`.
    """
    spec = gym.registry.get(env.id.rpartition(":")[2])
    if spec is not None and str(spec.vector_entry_point).startswith("shapechanger."):
        return ThreadVecEnv(env.id, num_envs, threads=threads, **env.kwargs)
    return DummyVecEnv([env.make for _ in range(num_envs)])


def single_vec_env(env: gym.Env[Any, Any]) -> VecEnv:
    """The one env there is, as Stable-Baselines3 wants it."""
    return DummyVecEnv([lambda: env])


try:
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error


# Evaluations start from seeds far from those of training, the same ones for every run and arm.
EVALUATION_SEED = 10_000_000

OnEvaluation = Callable[[Evaluation], None]
OnSteps = Callable[[int], None]


def _make_training_envs(
    env: EnvRef, settings: LearnerSettings, threads: int | None, only: gym.Env[Any, Any] | None
) -> VecEnv:
    """The envs that a learner steps together, normalised if the settings say so.

    Args:
        env: The env.
        settings: Of the learner.
        threads: How many threads step it.
        only: The one there is; None where as many are made as the settings say.
    """
    together = (
        training_vec_env(env, settings.n_envs, threads) if only is None else single_vec_env(only)
    )
    envs: VecEnv = VecMonitor(together)
    return VecNormalize(envs, gamma=settings.gamma) if settings.normalise else envs


def _arguments(settings: LearnerSettings, tensorboard: Path | None) -> dict[str, Any]:
    """The settings as arguments of PPO that go with any shape of network."""
    return {
        "n_steps": settings.n_steps,
        "batch_size": settings.batch_size,
        "n_epochs": settings.n_epochs,
        "learning_rate": settings.learning_rate,
        "gamma": settings.gamma,
        "gae_lambda": settings.gae_lambda,
        "clip_range": settings.clip_range,
        "ent_coef": settings.ent_coef,
        "device": "cpu",
        "tensorboard_log": str(tensorboard) if tensorboard else None,
    }


def _fresh_model(
    envs: VecEnv, settings: LearnerSettings, seed: int, tensorboard: Path | None
) -> PPO:
    """An untrained model."""
    return PPO(
        "MlpPolicy",
        envs,
        seed=seed,
        policy_kwargs={
            "net_arch": list(settings.net_arch),
            "log_std_init": settings.log_std_init,
        },
        **_arguments(settings, tensorboard),
    )


def _moved_model(
    envs: VecEnv,
    settings: LearnerSettings,
    seed: int,
    tensorboard: Path | None,
    source: TrainedPolicy,
    body_map: BodyMap,
) -> PPO:
    """The source policy in the target's shapes, with its statistics, ready to go on learning."""
    gathered = source.normalisation
    if gathered is not None and isinstance(envs, VecNormalize):
        # The critic speaks of rewards divided by these.
        envs.ret_rms = gathered.reward.copy()
    return transplant(
        source.model,
        body_map,
        envs,
        normalisation=None if gathered is None else gathered.observation,
        seed=seed,
        **_arguments(settings, tensorboard),
    )


def train(
    env: EnvRef,
    learner: str,
    settings: LearnerSettings,
    steps: int,
    seed: int,
    *,
    on_evaluation: OnEvaluation,
    on_steps: OnSteps = lambda steps: None,
    source: TrainedPolicy | None = None,
    body_map: BodyMap | None = None,
    tensorboard: Path | None = None,
    threads: int | None = 1,
) -> TrainedPolicy:
    """Train a policy, evaluating it before the first step, along the way, and at the end.

    Args:
        env: The env to train in.
        learner: Name of the learner, for the card.
        settings: Its settings.
        steps: Env steps, rounded up to whole updates.
        seed: Seed of everything random in it.
        on_evaluation: Called with each evaluation as soon as it is there.
        on_steps: Called with the number of steps taken, after each step of all envs.
        source: A policy of another body to begin with, in place of an untrained one.
        body_map: How that body and this one correspond; needed with `source`.
        tensorboard: Folder for TensorBoard's logs.
        threads: How many threads step the env, None for one per core; the result is the same. One
            by default: a study runs as many trainings at a time as there are cores.

    Raises:
        StudyError: If `steps` is smaller than one evaluation.
    """
    require_budget(steps, settings)
    # These import the module of the id, if it names one.
    judged = evaluation_envs(env, settings)
    if alone := is_single_instance(judged[0]):
        # It is trained in what it is judged in, and an update has as many steps as ever.
        n_steps = settings.n_envs * settings.n_steps
        settings = msgspec.structs.replace(settings, n_envs=1, n_steps=n_steps)
    envs = _make_training_envs(env, settings, threads, judged[0] if alone else None)
    try:
        if source is None or body_map is None:
            model = _fresh_model(envs, settings, seed, tensorboard)
        else:
            model = _moved_model(envs, settings, seed, tensorboard, source, body_map)
        # Before `learn`: it begins with a reset, which already moves the running statistics.
        act = actor(model, _statistics(envs))
        on_evaluation(evaluate(act, judged, EVALUATION_SEED, episodes=settings.eval_episodes))
        watcher = _Evaluations(settings, judged, on_evaluation, on_steps)
        cast("Any", model).learn(settings.whole_updates(steps), callback=watcher)
        watcher.evaluate_now()
        observation, action = layouts_of(judged[0])
        card = PolicyCard(
            env,
            observation,
            action,
            learner,
            settings,
            int(cast("Any", model).num_timesteps),
            seed,
            shapechanger.__version__,
        )
        return TrainedPolicy(model, _statistics(envs), card)
    finally:
        envs.close()
        for one in judged:
            one.close()


def use_one_thread() -> None:
    """Let this process compute on one core.

    Networks this small gain nothing from more, several runs share the machine, and sums in another
    order are other sums.
    """
    torch.set_num_threads(1)


def require_budget(steps: int, settings: Settings) -> None:
    """Refuse a budget that ends before the first evaluation.

    Raises:
        StudyError: If it does.
    """
    if steps < settings.eval_every:
        raise StudyError(
            f"A budget of {steps} steps is smaller than one evaluation, which comes every "
            f"{settings.eval_every} steps: give at least that."
        )


def _statistics(envs: VecEnv) -> Normalisation | None:
    if not isinstance(envs, VecNormalize):
        return None
    return Normalisation(envs.obs_rms, envs.ret_rms)  # pyright: ignore[reportArgumentType]


class _Evaluations(BaseCallback):
    """Evaluates between updates, when the policy is the one that the steps so far have made."""

    def __init__(
        self,
        settings: LearnerSettings,
        envs: list[gym.Env[Any, Any]],
        on_evaluation: OnEvaluation,
        on_steps: OnSteps,
    ) -> None:
        super().__init__()
        self._every = settings.eval_every
        self._episodes = settings.eval_episodes
        self._envs = envs
        self._on_evaluation = on_evaluation
        self._on_steps = on_steps
        self._next = settings.eval_every

    def _on_step(self) -> bool:
        self._on_steps(self.num_timesteps)
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self.evaluate_now()
            self._next += self._every
            if is_single_instance(self._envs[0]):
                self._begin_again()

    def evaluate_now(self) -> None:
        """Evaluate the policy as it is."""
        assert isinstance(self.model, PPO)
        act = actor(self.model, _statistics(self.training_env))
        result = evaluate(
            act, self._envs, EVALUATION_SEED, self.num_timesteps, episodes=self._episodes
        )
        self.logger.record("eval/mean_return", result.mean_return)
        self.logger.record("eval/mean_length", result.mean_length)
        for name, value in result.terms.items():
            self.logger.record(f"eval/{name}", value)
        self._on_evaluation(result)

    def _begin_again(self) -> None:
        """Begin another episode where the evaluation has left the env that is trained in."""
        model = cast("Any", self.model)
        model._last_obs = self.training_env.reset()
        model._last_episode_starts = np.ones((self.training_env.num_envs,), bool)
