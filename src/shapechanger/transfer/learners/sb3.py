"""Stable-Baselines3 as a learner: training, with evaluations along the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

import shapechanger
from shapechanger.errors import MissingExtra, StudyError
from shapechanger.transfer.body_map import BodyMap, MappedEnv
from shapechanger.transfer.body_map.envs import check_size
from shapechanger.transfer.env_ref import EnvRef, EnvTraits, is_single_instance, layouts_of
from shapechanger.transfer.learners import PolicyOrigin
from shapechanger.transfer.learners.algorithms import build_model
from shapechanger.transfer.learners.evaluation import (
    EVALUATION_SEED,
    Evaluation,
    evaluate,
    evaluation_envs,
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
    OffPolicySettings,
    PpoSettings,
    Sb3Settings,
    Settings,
)
from shapechanger.transfer.transplant import transplant

try:
    import torch
    from stable_baselines3.common import env_util
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor, VecNormalize
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

if TYPE_CHECKING:
    from shapechanger.transfer.learners.cloning import DemonstrationFile

OnEvaluation = Callable[[Evaluation], None]
OnSteps = Callable[[int], None]

_Indices = None | int | Iterable[int]


class Sb3Learner:
    """Any algorithm of Stable-Baselines3: a `shapechanger.transfer.learners.Learner`.

    Args:
        name: Name of the learner.
        settings: Its settings.
    """

    def __init__(self, name: str, settings: Sb3Settings) -> None:
        self._name = name
        self._settings = settings

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env whose spaces are not flat boxes of the sizes of its layouts."""
        for side, space, layout in (
            ("observation", traits.observation_space, traits.observation_layout),
            ("action", traits.action_space, traits.action_layout),
        ):
            check_size(f"{side} of {env}", space, layout)

    def train(
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        demonstrations: DemonstrationFile,
        start: TrainedPolicy | None = None,
        body_map: BodyMap | None = None,
        only_last: bool = False,
        callback: BaseCallback | None = None,
        on_evaluation: OnEvaluation,
        on_steps: OnSteps,
    ) -> TrainedPolicy:
        """Train a policy without demonstrations; it is always evaluated along the way."""
        del demonstrations, only_last
        return train(
            env,
            self._name,
            self._settings,
            steps,
            seed,
            on_evaluation=on_evaluation,
            on_steps=on_steps,
            source=start,
            body_map=body_map,
            callback=callback,
        )

    def evaluate(self, env: EnvRef, policy: TrainedPolicy, body_map: BodyMap) -> Evaluation:
        """Evaluate a policy through the body map."""
        envs = [MappedEnv(one, body_map) for one in evaluation_envs(env, self._settings)]
        try:
            return evaluate(
                policy.act, envs, EVALUATION_SEED, episodes=self._settings.eval_episodes
            )
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
            StudyError: If it is a clone.
        """
        from shapechanger.transfer.learners.cloning import is_clone

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
        return PolicyOrigin(card.env, card.steps)


def train(
    env: EnvRef,
    learner: str,
    settings: Sb3Settings,
    steps: int,
    seed: int,
    *,
    on_evaluation: OnEvaluation,
    on_steps: OnSteps = lambda steps: None,
    source: TrainedPolicy | None = None,
    body_map: BodyMap | None = None,
    callback: BaseCallback | None = None,
    tensorboard: Path | None = None,
    threads: int | None = 1,
) -> TrainedPolicy:
    """Train a policy, evaluating it before the first step, along the way, and at the end.

    Args:
        env: The env to train in.
        learner: Name of the learner, for the card.
        settings: Its settings.
        steps: Env steps, rounded up to whole updates.
        seed: Seed of the training.
        on_evaluation: Called with each evaluation.
        on_steps: Called with the number of steps taken, after each step of all envs.
        source: A policy of another body to start from; None for a new policy.
        body_map: Map between that body and this one; needed with `source`.
        callback: A callback of Stable-Baselines3, called before each evaluation.
        tensorboard: Folder of TensorBoard logs.
        threads: Threads that step the envs, None for one per core; the result is the same. One by
            default: a study runs as many trainings at a time as there are cores.

    Raises:
        StudyError: If `steps` is smaller than one evaluation, or the training diverges.
        TransplantError: If the source policy is of a kind that cannot be transplanted.
    """
    require_budget(steps, settings)
    # These import the module of the id, if it names one.
    eval_envs = evaluation_envs(env, settings)
    if single := is_single_instance(eval_envs[0]):
        # It is trained in the env that it is evaluated in.
        settings = _for_one_env(settings)
        together: VecEnv = DummyVecEnv([lambda: eval_envs[0]])
    else:
        together = training_vec_env(env, settings.n_envs, threads)
    envs: VecEnv = VecMonitor(together)
    if settings.normalise:
        envs = VecNormalize(envs, gamma=settings.model_arguments.get("gamma", 0.99))
    logs = None if tensorboard is None else str(tensorboard)
    try:
        if source is None or body_map is None:
            model = build_model(settings, envs, seed, logs)
        else:
            model = _transplanted_model(envs, settings, seed, logs, source, body_map)
        # Before `learn`: it starts with a reset, which already changes the running statistics.
        act = actor(model, _statistics(envs))
        on_evaluation(evaluate(act, eval_envs, EVALUATION_SEED, episodes=settings.eval_episodes))
        evaluations = _PeriodicEvaluation(
            settings, eval_envs, single, on_evaluation, on_steps, learner
        )
        callbacks: list[BaseCallback] = [] if callback is None else [callback]
        if source is not None and isinstance(settings, OffPolicySettings):
            callbacks.append(_ActFirst(settings.learning_starts))
        callbacks.append(evaluations)
        try:
            cast("Any", model).learn(settings.whole_updates(steps), callback=callbacks)
        except ValueError as error:  # PyTorch refuses distributions of NaN.
            _require_finite(model, learner)
            raise error
        evaluations.evaluate_now()
        card = PolicyCard(
            env,
            *layouts_of(eval_envs[0]),
            learner,
            settings,
            int(cast("Any", model).num_timesteps),
            seed,
            shapechanger.__version__,
        )
        return TrainedPolicy(model, _statistics(envs), card)
    finally:
        envs.close()
        for one in eval_envs:
            one.close()


def use_one_thread() -> None:
    """Limit PyTorch in this process to one thread.

    Networks this small gain nothing from more, several runs share the machine, and sums in another
    order are other sums.
    """
    torch.set_num_threads(1)


def require_budget(steps: int, settings: Settings, which: str = "") -> None:
    """Refuse a budget that ends before the first evaluation.

    Args:
        steps: The budget.
        settings: Settings of the learner.
        which: "target" or "source", where there are two budgets.

    Raises:
        StudyError: If it does.
    """
    if steps < settings.eval_every:
        budget = f"{steps} {which} steps" if which else f"{steps} steps"
        raise StudyError(
            f"A budget of {budget} is smaller than one evaluation, which comes every "
            f"{settings.eval_every} steps: give at least that."
        )


class ThreadVecEnv(VecEnv):
    """Envs of one id, stepped by threads, bitwise equal to `DummyVecEnv`.

    As in `DummyVecEnv`, an env that has ended is reset in the same step; its info then holds the
    last observation as `terminal_observation`, `TimeLimit.truncated` in every info tells whether
    only the time limit ended the episode, and rewards are float32.

    Args:
        env_id: A registered id.
        num_envs: Number of envs.
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
        # As DummyVecEnv, which replaces what the base class assembled.
        self.metadata = self._envs.envs[0].metadata

    def reset(self) -> NDArray[Any]:
        """Reset each env with the seeds and options set before."""
        options = [each or None for each in self._options]
        observations, self.reset_infos = self._envs.reset_each(self._seeds, options)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step each env; return observations, rewards, dones and infos."""
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
        """Close the envs; may be called twice."""
        self._envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Render one picture per env."""
        return self._envs.render()

    def get_attr(self, attr_name: str, indices: _Indices = None) -> list[Any]:
        """Return an attribute of the envs."""
        return [env.get_wrapper_attr(attr_name) for env in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: _Indices = None) -> None:
        """Set an attribute of the envs."""
        for env in self._chosen(indices):
            setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: _Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the envs."""
        return [
            env.get_wrapper_attr(method_name)(*method_args, **method_kwargs)
            for env in self._chosen(indices)
        ]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: _Indices = None
    ) -> list[bool]:
        """Return for each env whether it is wrapped by a class."""
        return [env_util.is_wrapped(env, wrapper_class) for env in self._chosen(indices)]

    def _chosen(self, indices: _Indices) -> list[gym.Env[Any, Any]]:
        return [self._envs.envs[i] for i in self._get_indices(indices)]


def training_vec_env(env: EnvRef, num_envs: int, threads: int | None) -> VecEnv:
    """Make the parallel envs of a training.

    Envs of the catalogue are stepped by threads. Those of others may share state, so they are
    stepped one after another; the numbers would be the same.

    Args:
        env: The env.
        num_envs: Number of envs.
        threads: As in `shapechanger.make_vec`.
    """
    spec = gym.registry.get(env.id.rpartition(":")[2])
    if spec is not None and str(spec.vector_entry_point).startswith("shapechanger."):
        return ThreadVecEnv(env.id, num_envs, threads=threads, **env.kwargs)
    return DummyVecEnv([env.make for _ in range(num_envs)])


def _for_one_env(settings: Sb3Settings) -> Sb3Settings:
    """Settings with as many steps per update in a single env."""
    each = settings.update_steps
    if isinstance(settings, PpoSettings):
        return msgspec.structs.replace(settings, n_envs=1, n_steps=each)
    if isinstance(settings, OffPolicySettings):
        return msgspec.structs.replace(settings, n_envs=1, train_freq=each)
    if settings.n_envs > 1:
        raise StudyError(
            f"Only one instance of this env can exist: set n_envs=1, not {settings.n_envs}."
        )
    return settings


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
    return Normalisation(envs.obs_rms, envs.ret_rms)  # pyright: ignore[reportArgumentType]


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
        settings: Sb3Settings,
        envs: list[gym.Env[Any, Any]],
        single: bool,
        on_evaluation: OnEvaluation,
        on_steps: OnSteps,
        learner: str,
    ) -> None:
        super().__init__()
        self._learner = learner
        self._every = settings.eval_every
        self._episodes = settings.eval_episodes
        self._envs = envs
        self._single = single
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
            if self._single:
                self._restart_episode()

    def evaluate_now(self) -> None:
        """Evaluate the current policy."""
        _require_finite(self.model, self._learner)
        act = actor(self.model, _statistics(self.training_env))
        result = evaluate(
            act, self._envs, EVALUATION_SEED, self.num_timesteps, episodes=self._episodes
        )
        self.logger.record("eval/mean_return", result.mean_return)
        self.logger.record("eval/mean_length", result.mean_length)
        for name, value in result.terms.items():
            self.logger.record(f"eval/{name}", value)
        self._on_evaluation(result)

    def _restart_episode(self) -> None:
        """Reset the training env, which the evaluation has used."""
        model = cast("Any", self.model)
        model._last_obs = self.training_env.reset()
        model._last_episode_starts = np.ones((self.training_env.num_envs,), bool)
