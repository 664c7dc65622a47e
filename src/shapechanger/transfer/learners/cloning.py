"""Learning by demonstrations in a study: record, clone, and judge at each budget."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.cloning.policy import WEIGHTS, CameraPolicy
from shapechanger.demos.cloning.train import clone
from shapechanger.errors import StudyError
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.files import make_folder
from shapechanger.transfer.learners.evaluation import Evaluation, evaluate, evaluation_envs
from shapechanger.transfer.learners.settings import CloningSettings, SacSettings

__all__ = [
    "CLONE_EVALUATION_SEED",
    "DemonstrationFile",
    "Demonstrations",
    "TaskDemonstrator",
    "evaluate_clone",
    "is_clone",
    "load_clone",
    "load_or_record",
    "record_demonstrations",
    "train_clones",
]

CLONE_EVALUATION_SEED = 10_000_000
"""Seed of the first episode that a clone is judged in: the same ones for every run and arm."""


class TaskDemonstrator(Protocol):
    """Somebody who can do the task of an env; `env.unwrapped.demonstrator(seed)` gives one."""

    def begin(self) -> None:
        """An episode has begun."""
        ...

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What they mean to do now, which is learned, and what they do, which is carried out."""
        ...


class Demonstrations(NamedTuple):
    """What was seen and done.

    Attributes:
        pictures: (n, h, w, 3) as a policy sees them.
        actions: (n, 2) what the demonstrator meant to do on seeing each.
        done: (n, 2) what was done instead.
        rewards: (n,) what it was worth.
        episodes: How many of them each episode has, in order.
    """

    pictures: NDArray[np.uint8]
    actions: NDArray[np.float32]
    done: NDArray[np.float32]
    rewards: NDArray[np.float32]
    episodes: tuple[int, ...]

    def first(self, steps: int) -> Demonstrations:
        """The first so many steps."""
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
    """Where demonstrations are kept, so that several runs learn from the same ones.

    Attributes:
        path: The file.
        seed: What they follow from.
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
    """Let the demonstrator of an env do its task for so many steps.

    Args:
        env: The env; it has a camera and a demonstrator.
        steps: How many.
        episode_steps: How many of them an episode has at most.
        seed: Of the starts, and of the demonstrator's mistakes.
        framing: What a policy sees of a picture.
        on_steps: Called with the number of steps, from time to time.

    Raises:
        StudyError: If the env has nobody who shows how.
    """
    made = env.make(max_episode_steps=episode_steps)
    try:
        driver = _demonstrator(made, env, seed)
        pictures: list[NDArray[np.uint8]] = []
        actions, carried_out = np.empty((2, steps, 2), np.float32)
        rewards = np.empty(steps, np.float32)
        episodes: list[int] = []
        while sum(episodes) < steps:
            seen = made.reset(seed=seed if not episodes else None)[0]
            driver.begin()
            episodes.append(0)
            over = False
            while not over and sum(episodes) < steps:
                step = sum(episodes)
                actions[step], carried_out[step] = driver.act()
                pictures.append(prepare(seen[np.newaxis], framing)[0])
                seen, rewards[step], terminated, truncated, _ = made.step(carried_out[step])
                episodes[-1] += 1
                over = terminated or truncated
            on_steps(sum(episodes))
    finally:
        made.close()
    return Demonstrations(np.stack(pictures), actions, carried_out, rewards, tuple(episodes))


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
    """Clone the demonstrator at each budget, and judge each clone.

    Args:
        env: The env.
        settings: How.
        steps: The last budget.
        seed: Of everything random in the trainings.
        demonstrations: Where they are, or come to be.
        start: A policy to go on from at each budget, in place of none.
        only_last: Whether only the last budget is of interest.
        on_evaluation: Called with each evaluation.
        on_steps: Called with the number of demonstrated steps that were used.

    Returns:
        The clone of the last budget.
    """
    policy = CameraPolicy.fresh(settings.clone, seed) if start is None else start
    on_evaluation(evaluate_clone(env, policy, settings))
    shown = load_or_record(
        demonstrations, env, steps, settings.episode_steps, settings.clone.framing
    )
    for budget in (steps,) if only_last else settings.within(steps):
        part = shown.first(budget)
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
    return policy.described(
        env=env.id, arguments=env.kwargs, demonstrated_steps=steps, tried_steps=0, seed=seed
    )


def evaluate_clone(
    env: EnvRef, policy: CameraPolicy, settings: CloningSettings | SacSettings, steps: int = 0
) -> Evaluation:
    """How good a clone is in an env, after so many demonstrated steps."""
    envs = evaluation_envs(env, settings)
    try:
        return evaluate(policy.predict_many, envs, CLONE_EVALUATION_SEED, steps)
    finally:
        for one in envs:
            one.close()


def is_clone(path: Path) -> bool:
    """Whether a file is one that a clone was saved to, and no other policy."""
    try:
        with zipfile.ZipFile(path) as archive:
            return WEIGHTS in archive.namelist()
    except (OSError, zipfile.BadZipFile):
        return False


def load_clone(path: Path) -> CameraPolicy:
    """The clone in a file.

    Raises:
        PolicyError: If there is none.
    """
    return CameraPolicy.load(path)


def _demonstrator(made: gym.Env[Any, Any], env: EnvRef, seed: int) -> TaskDemonstrator:
    give = getattr(made.unwrapped, "demonstrator", None)
    if give is None:
        raise StudyError(f"{env} has no demonstrator, so there is nobody to learn from.")
    return cast("TaskDemonstrator", give(seed))


def load_or_record(
    recording: DemonstrationFile, env: EnvRef, steps: int, episode_steps: int, framing: Framing
) -> Demonstrations:
    """The demonstrations of an env, from their file if it is there; see `record_demonstrations`."""
    path = recording.path
    if path.exists():
        with np.load(path) as arrays:
            named = {name: arrays[name] for name in Demonstrations._fields[:-1]}
            found = Demonstrations(**named, episodes=tuple(arrays["episodes"].tolist()))
        if len(found.actions) >= steps:
            return found.first(steps)
    shown = record_demonstrations(env, steps, episode_steps, recording.seed, framing)
    make_folder(path.parent)
    # Two arms may record the same ones at the same time, each in a process of its own.
    part = path.with_name(f".{path.stem}.{os.getpid()}.npz")
    np.savez(part, **shown._asdict())
    part.replace(path)
    return shown
