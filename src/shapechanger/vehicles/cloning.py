"""Behavioural cloning as a learner: record demonstrations, clone them, evaluate at each budget."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef, EnvTraits, HasDemonstrator, layouts_of
from shapechanger.demos.cloning.learn import clone
from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.cloning.policy import KIND, CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import StudyError
from shapechanger.files import make_folder
from shapechanger.policy import kind_of, load_policy
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.identities import ENV, identify, known
from shapechanger.transfer.learners import (
    Learner,
    LearnerSettings,
    PolicyOrigin,
    SharedFile,
    Takes,
    ignore,
)
from shapechanger.transfer.learners.evaluation import (
    EVALUATION_SEED,
    Evaluation,
    evaluate,
)


class CloningSettings(LearnerSettings, msgspec.Struct, frozen=True, kw_only=True, tag="cloning"):
    """Settings of behavioural cloning, in which a step is a demonstrated step.

    Attributes:
        budgets: Numbers of demonstrated steps; a policy is trained on each, from the same start.
        episode_steps: Steps of a demonstration; the next begins on another course.
        eval_episodes: Episodes of an evaluation.
        eval_steps: Steps of each of them.
        clone: Settings of each training.
    """

    budgets: tuple[int, ...]
    episode_steps: int
    eval_episodes: int
    eval_steps: int
    clone: CloneSettings = CloneSettings()

    takes = frozenset[Takes]({"demonstrations"})
    learner = f"{__name__}:CloneLearner"
    last_k = 1  # Each evaluation is of another clone.
    source_steps = 0

    def __post_init__(self) -> None:
        if self.eval_episodes < 1 or min(self.episode_steps, self.eval_steps) < 1:
            raise StudyError("A learner needs at least one episode, of at least one step.")
        if (
            not self.budgets
            or self.budgets[0] < 1
            or any(a >= b for a, b in pairwise(self.budgets))
        ):
            raise StudyError(f"Budgets are numbers of steps that grow, got {self.budgets}.")

    @property
    def steps(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Default number of demonstrated steps."""
        return self.budgets[-1]

    @property
    def eval_every(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The first budget; later ones are farther apart."""
        return self.budgets[0]

    def whole_updates(self, steps: int) -> int:
        """Round `steps` up to a budget; the largest if all are smaller."""
        return next((budget for budget in self.budgets if budget >= steps), self.budgets[-1])

    @property
    def episode_limit(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Steps after which an evaluation episode is truncated."""
        return self.eval_steps

    def for_budget(self, steps: int) -> CloningSettings:
        """Return the settings for a shorter budget: the same."""
        return self

    def rhythm(self) -> str:
        """Return when policies are evaluated, and what they learn from."""
        budgets = ", ".join(f"{budget:,}" for budget in self.budgets)
        return (
            f"after {budgets} steps. Steps are demonstrated steps: at each budget a policy is "
            "cloned anew from the same start, and all arms use the same demonstrations."
        )

    def within(self, steps: int) -> tuple[int, ...]:
        """Return the budgets up to `steps`."""
        return tuple(budget for budget in self.budgets if budget <= steps)


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


def record_demonstrations(
    env: EnvRef,
    steps: int,
    episode_steps: int,
    seed: int,
    framing: Framing,
) -> Demonstrations:
    """Record the demonstrator of an env."""
    with closing(env.make(max_episode_steps=episode_steps)) as made:
        if not isinstance(made.unwrapped, HasDemonstrator):
            raise StudyError(f"{env} has no demonstrator to learn from.")
        driver = made.unwrapped.demonstrator(seed)
        pictures: list[NDArray[np.uint8]] = []
        actions, executed = np.empty((2, steps, 2), np.float32)
        rewards = np.empty(steps, np.float32)
        episodes: list[int] = []
        while len(pictures) < steps:
            seen = made.reset(seed=seed if not episodes else None)[0]
            driver.begin()
            episodes.append(0)
            over = False
            while not over and len(pictures) < steps:
                step = len(pictures)
                actions[step], executed[step] = driver.act()
                pictures.append(prepare(seen[np.newaxis], framing)[0])
                seen, rewards[step], terminated, truncated, _ = made.step(executed[step])
                episodes[-1] += 1
                over = terminated or truncated
    return Demonstrations(np.stack(pictures), actions, executed, rewards, tuple(episodes))


def load_or_record(
    file: SharedFile, env: EnvRef, steps: int, episode_steps: int, framing: Framing
) -> Demonstrations:
    """Load demonstrations from a file that has enough of them, or record and write it."""
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


class _CardData(msgspec.Struct):
    """Provenance in the card of a clone that a study or `shapechanger train` wrote."""

    env: str
    arguments: dict[str, Any]
    demonstrated_steps: int


class CloneLearner(Learner[CloningSettings]):
    """Behavioural cloning of an env's demonstrator.

    All vehicles share one camera and action, so body maps are not used.
    """

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env without a camera or a demonstrator."""
        space = traits.observation_space
        is_camera = (
            isinstance(space, gym.spaces.Box)
            and np.dtype(np.uint8) == cast("Any", space).dtype
            and len(space.shape) == 3
        )
        missing: list[str] = []
        if not is_camera:
            missing.append("no camera")
        if not traits.has_demonstrator:
            missing.append("no demonstrator")
        if missing:
            raise StudyError(
                f"{env} has {' and '.join(missing)}, and {self.name} learns from the pictures of "
                "a demonstrator: give a --learner that begins with ppo."
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
        """Clone the demonstrator at each budget, from the same start, and evaluate each clone.

        Besides the arguments of every learner, `demonstrations` is the file of the demonstrations,
        `only_last` says that only the last budget is needed, and `rehearsed` names an env, steps
        and a file of demonstrations to mix in.

        Returns:
            The clone of the last budget.
        """
        del body_map
        settings = self.settings.clone
        policy = CameraPolicy.fresh(settings, seed) if start is None else start
        on_evaluation(self.evaluate(env, policy))
        length = self.settings.episode_steps
        recorded = load_or_record(demonstrations, env, steps, length, settings.framing)
        mixed = None
        if rehearsed is not None:
            of_source, some, file = rehearsed
            seen = load_or_record(file, of_source, some, length, settings.framing)
            mixed = seen.pictures, seen.actions
        for budget in (steps,) if only_last else self.settings.within(steps):
            part = recorded.first(budget)
            policy, _ = clone(
                part.pictures,
                part.actions,
                settings=settings,
                seed=seed % 2**31,
                episodes=part.episodes,
                start=start,
                rehearsal=mixed,
            )
            on_evaluation(msgspec.structs.replace(self.evaluate(env, policy), steps=budget))
            on_steps(budget)
        return stated(policy, env, demonstrated_steps=steps, seed=seed)

    def evaluate(
        self, env: EnvRef, policy: CameraPolicy, body_map: BodyMap | None = None
    ) -> Evaluation:
        """Evaluate a policy."""
        del body_map
        envs = self.evaluation_envs(env)
        try:
            return evaluate(policy.predict_many, envs, EVALUATION_SEED)
        finally:
            for one in envs:
                one.close()

    def load(self, path: Path) -> CameraPolicy:
        """Load a clone."""
        return CameraPolicy.load(path)

    def origin(self, path: Path) -> PolicyOrigin:
        """Read where a clone comes from."""
        if kind_of(path) != KIND:
            card = load_policy(path).card
            raise StudyError(
                f"{path} was trained with {card.learner}, and {self.name} starts from "
                f"demonstrations: give --learner {card.learner}, or a clone."
            )
        card = CameraPolicy.load(path).card
        wanted = self.settings.clone.framing
        if card.framing != wanted:
            raise StudyError(
                f"{path} takes pictures of {card.framing.height} x {card.framing.width} pixels "
                f"from {card.framing.top:g} of their height on, and {self.name} "
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
        env = EnvRef(data.env, data.arguments)
        return PolicyOrigin(env, data.demonstrated_steps, card.identity)


def stated(policy: CameraPolicy, env: EnvRef, **data: Any) -> CameraPolicy:
    """State in a clone's card its env, and what its actions mean."""
    identity = known({ENV: identify(env).identity})
    policy = state_actions(policy, env)
    return policy.described(identity=identity, env=env.id, arguments=env.kwargs, **data)


def state_actions(policy: CameraPolicy, env: EnvRef) -> CameraPolicy:
    """State in a clone's card what its actions mean, unless they are steering and throttle."""
    with closing(env.make()) as made:
        _, layout = layouts_of(made)
    if layout.names == ("steering", "throttle"):
        return policy
    card = msgspec.structs.replace(policy.card, action_layout=layout)
    return CameraPolicy(policy.network, card)
