"""Train a camera policy from a teacher with privileged observations.

The teacher observes distances, speed and rate of turn, from which reinforcement learning takes two
minutes. First it drives, and the student clones it from pictures alone (D. Chen et al., "Learning
by Cheating", CoRL 2019). Then the student drives, and its pictures are labelled with the teacher's
actions (S. Ross et al., "A Reduction of Imitation Learning and Structured Prediction to No-Regret
Online Learning", AISTATS 2011).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, Final

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import CanBeTaught, EnvRef, TaskDemonstrator
from shapechanger.demos.cloning.learn import clone
from shapechanger.demos.cloning.pictures import prepare
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import StudyError
from shapechanger.transfer.identities import ENV, identify, require_same_env
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.vehicles.cloning import stated
from shapechanger.vehicles.envs.ranges import LEAST_THROTTLE

STUDENT_STEPS: Final = 7200
"""Default steps of a student: six minutes, a third of which the teacher drives."""

STUDENT_CLONING: Final = CloneSettings(held_out=0.0, passes=50.0, most_steps=3000)
"""Default settings of its cloning."""

_EPISODE_STEPS: Final = 200
# Rounds that the student drives, trained anew before each, after one round of the teacher. With one
# round of as many steps students had 1.8 collisions per 100 m.
_ROUNDS: Final = 2
# Pictures do not show the speed. Where the teacher brakes or starts depending on it, a clone takes
# the mean of both actions; one stood still on one course of 17. So it never drives with less than
# `LEAST_THROTTLE`.
# Limit of the training steps of the clones that drive a round.
_BETWEEN: Final = 1500


def train_student(
    env: EnvRef,
    teacher: TrainedPolicy,
    steps: int,
    seed: int,
    *,
    settings: CloneSettings = STUDENT_CLONING,
    on_steps: Callable[[int], None] = lambda steps: None,
) -> CameraPolicy:
    """Train a camera policy from a teacher.

    Args:
        env: The student's env, such as `Car`.
        teacher: A policy of the same vehicle on distances, such as one of `CarRanges`.
        steps: Steps of driving: a third by the teacher, the others by the student.
        seed: Seed of everything random.
        settings: Settings of its cloning.
        on_steps: Called with the number of steps driven, after each episode.

    Raises:
        StudyError: If the env has no teachers, the policy is of another env, or there is not at
            least one step for each round.
    """
    if steps < 1 + _ROUNDS:
        raise StudyError(
            f"The teacher drives at least one step and the student {_ROUNDS}, got {steps} in total."
        )
    with closing(env.make(max_episode_steps=_EPISODE_STEPS)) as made:
        inner = made.unwrapped
        if not isinstance(inner, CanBeTaught):
            raise StudyError(
                f"{env} has no teachers: choose an env of a vehicle's camera, such as Car."
            )
        wanted, taught = inner.teacher_env, teacher.card.env.id
        if taught != wanted:
            name = wanted.rpartition("/")[2].removesuffix("-v1")
            raise StudyError(
                f"A teacher for {env.id} is a policy of {wanted}, and this one is of {taught}: "
                f"train one by `shapechanger train {name}`."
            )
        if ENV in teacher.card.identity:
            now = identify(teacher.card.env).identity
            remedy = "Train the teacher again."
            require_same_env(teacher.card.identity, teacher.card.env, now, "the teacher", remedy)
        lessons = _Lessons(made, inner.taught_by(teacher.act, seed), settings, seed, on_steps)
        each = steps // (1 + _ROUNDS)
        lessons.drive(steps - _ROUNDS * each)
        for _ in range(_ROUNDS):
            lessons.drive(each, lessons.learned(most_steps=_BETWEEN))
        policy = lessons.learned()
    return stated(policy, env, demonstrated_steps=steps, teacher=taught)


@dataclass
class _Lessons:
    """Recorded pictures, labelled with the teacher's actions; see `train_student`."""

    _env: gym.Env[Any, Any]
    _teacher: TaskDemonstrator
    _settings: CloneSettings
    _seed: int
    _on_steps: Callable[[int], None]
    _pictures: list[NDArray[np.uint8]] = field(default_factory=list[NDArray[np.uint8]])
    _actions: list[NDArray[np.float32]] = field(default_factory=list[NDArray[np.float32]])
    _episodes: list[int] = field(default_factory=list[int])

    def drive(self, steps: int, student: CameraPolicy | None = None) -> None:
        """Drive and record steps; without a student the teacher drives, with its disturbances."""
        end = len(self._actions) + steps
        while len(self._actions) < end:
            picture = self._env.reset(seed=None if self._episodes else self._seed)[0]
            self._teacher.begin()
            began = len(self._actions)
            over = False
            while not over and len(self._actions) < end:
                meant, disturbed = (_going(action) for action in self._teacher.act())
                self._pictures.append(prepare(picture[np.newaxis], self._settings.framing)[0])
                # The whole range of the throttle above the least is that of the network's output.
                share = (meant[1] - LEAST_THROTTLE) / (1.0 - LEAST_THROTTLE)
                self._actions.append(np.array((meant[0], 2.0 * share - 1.0), np.float32))
                done = disturbed if student is None else student.predict(picture)
                picture, _, terminated, truncated, _ = self._env.step(done)
                over = terminated or truncated
            self._episodes.append(len(self._actions) - began)
            self._on_steps(len(self._actions))

    def learned(self, most_steps: int | None = None) -> CameraPolicy:
        """Clone the teacher from all that was recorded, in at most this many steps."""
        settings = self._settings
        most = min(most_steps or settings.most_steps, settings.most_steps)
        fewest = min(settings.fewest_steps, most)
        policy, _ = clone(
            np.stack(self._pictures),
            np.stack(self._actions),
            settings=msgspec.structs.replace(settings, most_steps=most, fewest_steps=fewest),
            seed=self._seed % 2**31,
            episodes=self._episodes,
        )
        card = msgspec.structs.replace(policy.card, low=(-1.0, LEAST_THROTTLE), high=(1.0, 1.0))
        return CameraPolicy(policy.network, card)


def _going(action: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return steering and throttle with at least the least throttle."""
    return np.array((action[0], max(action[1], LEAST_THROTTLE)), np.float32)
