"""Behavioural cloning in a study: record demonstrations, clone them, evaluate at each budget."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.learn import clone
from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.cloning.policy import KIND, CameraPolicy
from shapechanger.errors import StudyError
from shapechanger.tensor_file import kind_of
from shapechanger.transfer.env_ref import EnvRef, HasDemonstrator
from shapechanger.transfer.files import make_folder
from shapechanger.transfer.learners.evaluation import Evaluation, evaluate, evaluation_envs
from shapechanger.transfer.learners.settings import CloningSettings

_CLONE_EVALUATION_SEED = 10_000_000
"""Seed of the first evaluation episode, the same for every run and arm."""


class Demonstrations(NamedTuple):
    """Recorded demonstrations.

    Attributes:
        pictures: (n, h, w, 3) as a policy sees them.
        actions: (n, 2) intended action of the demonstrator at each picture.
        done: (n, 2) executed action.
        rewards: (n,) reward of the executed action.
        episodes: Number of steps of each episode, in order.
    """

    pictures: NDArray[np.uint8]
    actions: NDArray[np.float32]
    done: NDArray[np.float32]
    rewards: NDArray[np.float32]
    episodes: tuple[int, ...]

    def first(self, steps: int) -> Demonstrations:
        """Return the first `steps` steps."""
        episodes: list[int] = []
        left = steps
        for length in self.episodes:
            if left > 0:
                episodes.append(min(length, left))
                left -= length
        return Demonstrations(
            self.pictures[:steps],
            self.actions[:steps],
            self.done[:steps],
            self.rewards[:steps],
            tuple(episodes),
        )


class DemonstrationFile(NamedTuple):
    """File of demonstrations, shared by the runs that learn from them.

    Attributes:
        path: The file.
        seed: Seed of the recording.
    """

    path: Path
    seed: int


def record_demonstrations(
    env: EnvRef,
    steps: int,
    episode_steps: int,
    seed: int,
    framing: Framing,
    on_steps: Callable[[int], None] = lambda steps: None,
) -> Demonstrations:
    """Record the demonstrator of an env.

    Args:
        env: An env with a camera and a demonstrator.
        steps: Number of steps to record.
        episode_steps: Maximum number of steps of an episode.
        seed: Seed of the starts and of the demonstrator's mistakes.
        framing: The part and size of a picture that a policy sees.
        on_steps: Called with the number of steps from time to time.

    Raises:
        StudyError: If the env has no demonstrator.
    """
    made = env.make(max_episode_steps=episode_steps)
    try:
        if not isinstance(made.unwrapped, HasDemonstrator):
            raise StudyError(f"{env} has no demonstrator to learn from.")
        driver = made.unwrapped.demonstrator(seed)
        pictures: list[NDArray[np.uint8]] = []
        actions, executed = np.empty((2, steps, 2), np.float32)
        rewards = np.empty(steps, np.float32)
        episodes: list[int] = []
        while sum(episodes) < steps:
            seen = made.reset(seed=seed if not episodes else None)[0]
            driver.begin()
            episodes.append(0)
            over = False
            while not over and sum(episodes) < steps:
                step = sum(episodes)
                actions[step], executed[step] = driver.act()
                pictures.append(prepare(seen[np.newaxis], framing)[0])
                seen, rewards[step], terminated, truncated, _ = made.step(executed[step])
                episodes[-1] += 1
                over = terminated or truncated
            on_steps(sum(episodes))
    finally:
        made.close()
    return Demonstrations(np.stack(pictures), actions, executed, rewards, tuple(episodes))


def load_or_record(
    file: DemonstrationFile, env: EnvRef, steps: int, episode_steps: int, framing: Framing
) -> Demonstrations:
    """Load demonstrations from a file that has enough of them, or record and write it.

    Args:
        file: The file and the seed of the recording.
        env: An env with a camera and a demonstrator.
        steps: Number of steps.
        episode_steps: Maximum number of steps of an episode.
        framing: The part and size of a picture that a policy sees.
    """
    path = file.path
    if path.exists():
        with np.load(path) as arrays:
            named = {name: arrays[name] for name in Demonstrations._fields[:-1]}
            found = Demonstrations(**named, episodes=tuple(arrays["episodes"].tolist()))
        if len(found.actions) >= steps:
            return found.first(steps)
    recorded = record_demonstrations(env, steps, episode_steps, file.seed, framing)
    make_folder(path.parent)
    # Two arms may record the same demonstrations at the same time, each in its own process.
    part = path.with_name(f".{path.stem}.{os.getpid()}.npz")
    np.savez(part, **recorded._asdict())
    part.replace(path)
    return recorded


def train_clones(
    env: EnvRef,
    settings: CloningSettings,
    steps: int,
    seed: int,
    *,
    demonstrations: DemonstrationFile,
    start: CameraPolicy | None = None,
    only_last: bool = False,
    on_evaluation: Callable[[Evaluation], None],
    on_steps: Callable[[int], None] = lambda steps: None,
) -> CameraPolicy:
    """Clone the demonstrator at each budget, and evaluate each clone.

    Args:
        env: The env.
        settings: The settings.
        steps: The last budget.
        seed: Seed of the trainings.
        demonstrations: File of the demonstrations; recorded if missing.
        start: The policy to start from at each budget; None for a new one.
        only_last: Skip all budgets but the last.
        on_evaluation: Called with each evaluation.
        on_steps: Called with the number of demonstrated steps used.

    Returns:
        The clone of the last budget.
    """
    policy = CameraPolicy.fresh(settings.clone, seed) if start is None else start
    on_evaluation(evaluate_clone(env, policy, settings))
    recorded = load_or_record(
        demonstrations, env, steps, settings.episode_steps, settings.clone.framing
    )
    for budget in (steps,) if only_last else settings.within(steps):
        part = recorded.first(budget)
        policy, _ = clone(
            part.pictures,
            part.actions,
            settings=settings.clone,
            seed=seed % 2**31,
            episodes=part.episodes,
            start=start,
        )
        on_evaluation(evaluate_clone(env, policy, settings, budget))
        on_steps(budget)
    return state_actions(policy, env).described(
        env=env.id, arguments=env.kwargs, demonstrated_steps=steps, seed=seed
    )


def state_actions(policy: CameraPolicy, env: EnvRef) -> CameraPolicy:
    """State in a clone's card what its actions mean, unless they are steering and throttle.

    Args:
        policy: A clone of the env's demonstrator.
        env: The env.
    """
    made = env.make()
    try:
        layout = getattr(made.unwrapped, "action_layout", None)
    finally:
        made.close()
    if layout is None or layout.names == ("steering", "throttle"):
        return policy
    card = msgspec.structs.replace(policy.card, action_layout=layout)
    return CameraPolicy(policy.network, card)


def evaluate_clone(
    env: EnvRef, policy: CameraPolicy, settings: CloningSettings, steps: int = 0
) -> Evaluation:
    """Evaluate a clone.

    Args:
        env: The env.
        policy: The clone.
        settings: Settings of its learner.
        steps: Training steps so far, for the result.
    """
    envs = evaluation_envs(env, settings)
    try:
        return evaluate(policy.predict_many, envs, _CLONE_EVALUATION_SEED, steps)
    finally:
        for one in envs:
            one.close()


def require_camera_env(
    name: str, observation_space: gym.Space[Any], has_demonstrator: bool, learner: str
) -> None:
    """Refuse an env without a camera or a demonstrator.

    Args:
        name: Name of the env, for the message.
        observation_space: Its observation space.
        has_demonstrator: Whether it has an expert for its task.
        learner: Name of the learner, for the message.

    Raises:
        StudyError: If it lacks one.
    """
    is_camera = (
        isinstance(observation_space, gym.spaces.Box)
        and np.dtype(np.uint8) == cast("Any", observation_space).dtype
        and len(observation_space.shape) == 3
    )
    missing = [
        what
        for what, there in (("no camera", is_camera), ("no demonstrator", has_demonstrator))
        if not there
    ]
    if missing:
        raise StudyError(
            f"{name} has {' and '.join(missing)}, and {learner} learns from the pictures of a "
            "demonstrator: give a --learner that begins with ppo."
        )


def is_clone(path: Path) -> bool:
    """Return whether a file holds a clone, rather than another policy or something else."""
    return kind_of(path) == KIND


def load_clone(path: Path) -> CameraPolicy:
    """Load a clone.

    Raises:
        PolicyError: If the file holds none.
    """
    return CameraPolicy.load(path)
