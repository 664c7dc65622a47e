"""Camera policies that are cloned from an expert or from a teacher.

`CloneLearner` records an env's demonstrator, and evaluates a clone at each budget. `train_student`
learns from a teacher, a policy that observes distances, speed and rate of turn, and is trained by
reinforcement learning. First the teacher drives, and the student clones it from images alone (D.
Chen et al., "Learning by Cheating", CoRL 2019). Then the student drives, and its images are
labelled with the teacher's actions (S. Ross et al., "A Reduction of Imitation Learning and
Structured Prediction to No-Regret Online Learning", AISTATS 2011).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef, EnvTraits, TaskDemonstrator, layouts_of
from shapechanger.demos.cloning.clone import CloneSettings, load_clone, prepare
from shapechanger.demos.cloning.learn import learn
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.dataset import Dataset, merged
from shapechanger.errors import PolicyError, StudyError
from shapechanger.files import make_folder
from shapechanger.layout import Layout
from shapechanger.policy import Framing, PolicyCard
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.identities import ENV, identify, known, require_same_env
from shapechanger.transfer.learners import Learner, LearnerSettings, SharedFile, Takes, ignore
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, Evaluation, evaluate
from shapechanger.vehicles.expert import PERIOD_S
from shapechanger.vehicles.waypoints import LEAST_THROTTLE

if TYPE_CHECKING:
    from shapechanger.transfer.learners.policy_file import TrainedPolicy


class CloningSettings(LearnerSettings, msgspec.Struct, frozen=True, kw_only=True, tag="cloning"):
    """Settings of behavioural cloning, in which a step is a demonstrated step."""

    budgets: tuple[int, ...]  # Numbers of steps; a policy is trained on each, from the same start.
    episode_steps: int  # Steps of a demonstration; each demonstration is on another course.
    eval_episodes: int  # Episodes of an evaluation.
    eval_steps: int  # Steps of an evaluation episode.
    clone: CloneSettings = CloneSettings()

    takes = frozenset[Takes]({"demonstrations"})
    learner = f"{__name__}:CloneLearner"
    last_k = 1  # Evaluations are not averaged, because each is of a different clone.
    source_steps = 0

    def __post_init__(self) -> None:
        if min(self.eval_episodes, self.episode_steps, self.eval_steps) < 1:
            raise StudyError("Each number of episodes and steps must be at least 1.")
        if not self.budgets or any(a >= b for a, b in pairwise((0, *self.budgets))):
            raise StudyError(f"Budgets must be increasing numbers above 0, got {self.budgets}.")

    @property
    def steps(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Default number of demonstrated steps."""
        return self.budgets[-1]

    @property
    def eval_every(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The first budget, in demonstrated steps."""
        return self.budgets[0]

    def whole_updates(self, steps: int) -> int:
        """Return the smallest budget of at least `steps`, or the largest if all are smaller."""
        return next((budget for budget in self.budgets if budget >= steps), self.budgets[-1])

    @property
    def episode_limit(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Steps after which an evaluation episode is truncated."""
        return self.eval_steps

    def for_budget(self, steps: int) -> CloningSettings:
        """Return these settings, which do not depend on the budget."""
        return self

    def rhythm(self) -> str:
        """Describe when policies are evaluated and which steps they learn from."""
        budgets = ", ".join(f"{budget:,}" for budget in self.budgets)
        return (
            f"after {budgets} steps. Steps are demonstrated steps: at each budget a policy is "
            "cloned again from the same start, and all arms use the same demonstrations."
        )


def _drive(
    env: gym.Env[Any, Any],
    demonstrator: TaskDemonstrator,
    steps: int,
    framing: Framing,
    seed: int | None,
    chosen: Callable[[NDArray[np.uint8], NDArray[np.float32]], NDArray[np.float32]],
    on_steps: Callable[[int], None] = lambda steps: None,
) -> Dataset:
    """Drive, and record the prepared image and the demonstrator's intended action of each step.

    `chosen` returns the action to take, for an image and the demonstrator's disturbed action. After
    each episode, `on_steps` is called with the number of steps driven.
    """
    pictures: list[NDArray[np.uint8]] = []
    actions = np.empty((steps, 2), np.float32)
    episodes: list[int] = []
    while len(pictures) < steps:
        seen = env.reset(seed=None if episodes else seed)[0]
        demonstrator.begin()
        episodes.append(0)
        over = False
        while not over and len(pictures) < steps:
            actions[len(pictures)], disturbed = demonstrator.act()
            pictures.append(prepare(seen[np.newaxis], framing)[0])
            seen, _, terminated, truncated, _ = env.step(chosen(seen, disturbed))
            episodes[-1] += 1
            over = terminated or truncated
        on_steps(len(pictures))
    return _dataset(np.stack(pictures), actions, episodes, layouts_of(env)[1])


def _dataset(
    pictures: NDArray[np.uint8], actions: NDArray[np.float32], episodes: list[int], layout: Layout
) -> Dataset:
    times_s = PERIOD_S * np.concatenate([np.arange(length) for length in episodes])
    lengths, hz = tuple(episodes), 1.0 / PERIOD_S
    return Dataset(pictures, None, actions, lengths, times_s.astype(float), (), layout, None, hz)


def record_demonstrations(
    env: EnvRef, steps: int, episode_steps: int, seed: int, framing: Framing
) -> Dataset:
    """Record the demonstrator of an env; the env executes its disturbed actions."""
    with closing(env.make(max_episode_steps=episode_steps)) as made:
        inner: Any = made.unwrapped
        if not hasattr(inner, "demonstrator"):
            raise StudyError(f"{env} has no demonstrator to learn from.")
        driver = inner.demonstrator(seed)
        return _drive(made, driver, steps, framing, seed, lambda _, disturbed: disturbed)


def load_or_record(
    file: SharedFile, env: EnvRef, steps: int, episode_steps: int, framing: Framing
) -> Dataset:
    """Load demonstrations from a file if it has enough steps, or record and write them."""
    path, names = file.path, ("pictures", "actions", "episodes")
    if path.exists():
        with np.load(path) as arrays, closing(env.make()) as made:
            pictures, actions, episodes = (arrays[name] for name in names)
            if len(actions) >= steps:
                data = _dataset(pictures, actions, episodes.tolist(), layouts_of(made)[1])
                return _first(data, steps)
    recorded = record_demonstrations(env, steps, episode_steps, file.seed, framing)
    make_folder(path.parent)
    # Two arms may record the same demonstrations at the same time, each in its own process.
    part = path.with_name(f".{path.stem}.{os.getpid()}.npz")
    np.savez(part, **{name: getattr(recorded, name) for name in names})
    part.replace(path)
    return recorded


def _first(data: Dataset, steps: int) -> Dataset:
    return data.part(np.arange(len(data)) < steps)


class CloneLearner(Learner[CloningSettings]):
    """Behavioural cloning of an env's demonstrator.

    All vehicles share one camera and action, so body maps are not used.
    """

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Raise a `StudyError` if the env has no camera or no demonstrator."""
        space = traits.observation_space
        is_image = isinstance(space, gym.spaces.Box) and len(space.shape) == 3
        is_camera = is_image and cast("Any", space).dtype == np.uint8
        if not is_camera or not traits.has_demonstrator:
            raise StudyError(
                f"{env} has no {'demonstrator' if is_camera else 'camera'}, and {self.name} learns "
                "from a demonstrator's images: give a --learner whose name begins with ppo."
            )

    def train(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        env: EnvRef,
        steps: int,
        seed: int,
        *,
        demonstrations: SharedFile,
        start: CameraPolicy | None = None,
        body_map: BodyMap | None = None,
        only_last: bool = False,
        rehearsed: tuple[EnvRef, int, SharedFile] | None = None,
        on_evaluation: Callable[[Evaluation], None] = ignore,
        on_steps: Callable[[int], None] = lambda steps: None,
    ) -> CameraPolicy:
        """Clone the demonstrator at each budget up to `steps`, and return the last clone.

        With `only_last`, it is cloned at `steps` only. Each clone begins at the same start; the
        start and each clone are evaluated. `rehearsed` is an env, a number of
        steps and a file of demonstrations to mix in.
        """
        del body_map
        settings, own_seed = self.settings.clone, seed % 2**31
        policy = CameraPolicy.fresh(settings, seed) if start is None else start
        on_evaluation(self.evaluate(env, policy))
        length = self.settings.episode_steps
        recorded = load_or_record(demonstrations, env, steps, length, settings.framing)
        mixed = None
        if rehearsed is not None:
            of_source, some, file = rehearsed
            mixed = load_or_record(file, of_source, some, length, settings.framing)
        if start is None:
            start = CameraPolicy.fresh(settings, own_seed, recorded.action_layout)
        for budget in (steps,) if only_last else self.settings.budgets:
            if budget > steps:
                break
            policy, _ = learn(
                _first(recorded, budget), settings=settings, seed=own_seed, start=start,
                rehearsal=mixed, symmetric=True,
            )  # fmt: skip
            on_evaluation(msgspec.structs.replace(self.evaluate(env, policy), steps=budget))
            on_steps(budget)
        return stated(policy, env, steps, seed)

    def evaluate(
        self, env: EnvRef, policy: CameraPolicy, body_map: BodyMap | None = None
    ) -> Evaluation:
        """Evaluate a policy."""
        del body_map
        with ExitStack() as stack:
            envs = [stack.enter_context(closing(one)) for one in self.evaluation_envs(env)]
            return evaluate(policy.predict_many, envs, EVALUATION_SEED)

    def load(self, path: Path) -> CameraPolicy:
        """Load a clone."""
        policy = load_clone(path)
        if not isinstance(policy, CameraPolicy):
            raise PolicyError(f"{path} is an exported policy: give the clone it was exported from.")
        return policy

    def origin(self, path: Path) -> PolicyCard:
        """Read the card of a clone that this learner can start from."""
        policy = self.load(path)
        found, wanted = policy.net.framing, self.settings.clone.framing
        if found != wanted:
            raise PolicyError(
                f"{path} uses images of {found.height} x {found.width} pixels without the top "
                f"{found.top:g} of their height, and {self.name} {wanted.height} x {wanted.width} "
                f"without the top {wanted.top:g}: give a clone that uses the same images."
            )
        if policy.card.env is None:
            raise PolicyError(
                f"{path} learned from recordings without an env: give a clone that "
                "`shapechanger train` or a study has written."
            )
        return policy.card


def stated(policy: CameraPolicy, env: EnvRef, steps: int, seed: int, **data: Any) -> CameraPolicy:
    """Return a clone whose card states its env and the steps and seed of its training."""
    identity = known({ENV: identify(env)})
    data = {**policy.card.data, **data}
    return policy.carded(env=env, steps=steps, seed=seed, identity=dict(identity), data=data)


STUDENT_STEPS: Final = 7200
"""Default steps of a student: six minutes, of which the teacher drives a third."""

STUDENT_CLONING: Final = CloneSettings(held_out=0.0, passes=50.0, most_steps=3000)
"""Default settings with which a student clones its teacher."""

_EPISODE_STEPS: Final = 200
# Rounds that the student drives after one round of the teacher. The student is trained again before
# each round. With a single longer round, students had 1.8 collisions per 100 m.
_ROUNDS: Final = 2
# Largest number of training steps of a clone that only drives a round.
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
    """Train a camera policy for an env, such as `Car`, from a teacher, a policy of `CarRanges`.

    The teacher drives a third of the steps, and the student drives the rest. After each episode,
    `on_steps` is called with the number of steps so far. Raises a StudyError if the teacher does
    not fit the env.
    """
    if steps < 1 + _ROUNDS:
        raise StudyError(f"A student needs at least {1 + _ROUNDS} steps, got {steps}.")
    with closing(env.make(max_episode_steps=_EPISODE_STEPS)) as made:
        inner: Any = made.unwrapped
        if not hasattr(inner, "taught_by"):
            raise StudyError(f"{env} has no teachers: choose a vehicle's camera env, such as Car.")
        learned_in = teacher.card.trained_in
        wanted, taught = inner.teacher_env, learned_in.id
        if taught != wanted:
            name = wanted.rpartition("/")[2].removesuffix("-v1")
            raise StudyError(
                f"A teacher for {env.id} is a policy of {wanted}, and this one is of {taught}: "
                f"train one by `shapechanger train {name}`."
            )
        if ENV in teacher.card.identity:
            now = identify(learned_in)
            remedy = "Train the teacher again."
            require_same_env(teacher.card.identity, learned_in, now, "the teacher", remedy)
        driver = inner.taught_by(teacher.act, seed)

        def lesson(steps: int, before: int = 0, student: CameraPolicy | None = None) -> Dataset:
            return _drive(
                made, driver, steps, settings.framing, seed if student is None else None,
                lambda seen, act: _moving(act) if student is None else student.predict(seen),
                lambda done: on_steps(before + done),
            )  # fmt: skip

        each = steps // (1 + _ROUNDS)
        shown = [lesson(steps - _ROUNDS * each)]
        for _ in range(_ROUNDS):
            student = _student(shown, settings, seed, min(_BETWEEN, settings.most_steps))
            shown.append(lesson(each, sum(map(len, shown)), student))
    policy = _student(shown, settings, seed, settings.most_steps)
    return stated(policy, env, steps, seed, teacher=taught)


def _moving(action: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return steering and throttle, (..., 2), with the throttle raised to `LEAST_THROTTLE`.

    Images do not show the speed. If the teacher brakes or starts depending on the speed, a clone
    learns the mean of both actions; without a least throttle, one clone stood still on 1 of 17
    courses.
    """
    return np.maximum(action, np.array((-np.inf, LEAST_THROTTLE), np.float32))


def _student(
    shown: Sequence[Dataset], settings: CloneSettings, seed: int, most_steps: int
) -> CameraPolicy:
    """Clone a teacher from the recorded data in at most `most_steps` training steps."""
    data = merged([replace(part, states=None, state_layout=None) for part in shown])
    actions = _moving(data.actions)
    # Scale the throttle so that its range above the least is the range of the network's output.
    actions[:, 1] = 2.0 * ((actions[:, 1] - LEAST_THROTTLE) / (1.0 - LEAST_THROTTLE)) - 1.0
    settings = msgspec.structs.replace(
        settings, most_steps=most_steps, fewest_steps=min(settings.fewest_steps, most_steps)
    )
    seed %= 2**31
    start = CameraPolicy.fresh(settings, seed, data.action_layout)
    data = replace(data, actions=actions)
    policy, _ = learn(data, settings=settings, seed=seed, start=start, symmetric=True)
    net = msgspec.structs.replace(policy.net, low=(-1.0, LEAST_THROTTLE), high=(1.0, 1.0))
    return policy.carded(clone=net)
