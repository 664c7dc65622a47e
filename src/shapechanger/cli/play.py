"""`shapechanger play`: watch a policy in a window or as a video."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.cli.console import say
from shapechanger.cli.env_arguments import Body, EnvId, OwnLearner, opened, policy_file
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.envs.catalogue import allow_own_modules, env_ref
from shapechanger.envs.opengl import has_screen
from shapechanger.errors import StudyError, check_seed
from shapechanger.identity import identify_env
from shapechanger.policy import PolicyCard, load_policy
from shapechanger.reports.films import require_film, write_film
from shapechanger.transfer.body_map import BodyMap, Copy, MappedEnv
from shapechanger.transfer.identities import ENV, require_same_env
from shapechanger.transfer.learners.evaluation import Act, random_actions


@dataclass(frozen=True, kw_only=True)
class Watching:
    """Options of a command that shows episodes."""

    out: Path | None = None
    """A film to write instead of a window, such as ant.mp4; play.mp4 if there is no screen."""
    episodes: int = 1
    """Number of episodes."""
    seed: int = 0
    """Seed of the starts, and of random actions."""
    max_steps: int = 1000
    """Steps after which a shown episode ends."""
    learner: OwnLearner = ""

    def show(self, ref: EnvRef, policy: Path | None, *, trained_in: bool = False) -> None:
        """Show episodes in a window or write them as a film, and print the returns."""
        check_seed(self.seed, StudyError)
        if self.episodes < 1 or self.max_steps < 1:
            raise StudyError("--episodes and --max-steps must be at least 1.")
        out = self.out or (None if has_screen() else Path("play.mp4"))
        if out is not None:
            require_film(out)
            if self.out is None:
                say(f"There is no screen, so this writes {out}; drawing can take minutes.")
        frames: list[NDArray[Any]] = []
        with opened(ref, render_mode="human" if out is None else "rgb_array") as env:
            if policy is None:
                acting, act = env, random_actions(env.action_space, self.seed)
            else:
                acting, act = acting_in(env, policy, self.learner, ref if trained_in else None)
            for episode in range(self.episodes):
                observation, _ = acting.reset(seed=self.seed + episode)
                worth, steps, over, why = 0.0, 0, False, ""
                while not over and steps < self.max_steps:
                    action = act(np.asarray(observation)[None])[0]
                    observation, reward, terminated, truncated, info = acting.step(action)
                    worth, steps = worth + float(reward), steps + 1
                    over = terminated or truncated
                    if terminated and (reason := info.get("stop_reason")):  # Only vehicles have it.
                        why = f": {reason}"
                    if out is not None:
                        frames.append(cast("NDArray[Any]", env.render()))
                say(f"episode {episode}: return {worth:.1f} in {steps} steps{why}")
            if out is not None:
                write_film(frames, out, float(env.metadata["render_fps"]))
                say(f"wrote {out}")


@dataclass(frozen=True)
class Play(Watching):
    """Watch a policy in an env, in a window or as a video."""

    env: EnvId
    policy: Path | None = None
    """A policy that `train`, a study or `policies export` has written, or `reference` for the one
    that ships for the env; random actions if not given. A policy for another body acts through the
    body map that matches names."""
    body: Body = ""

    def run(self) -> None:
        ref = env_ref(self.env, self.body)
        self.show(ref, self.policy and policy_file(self.policy, ref))


def acting_in(
    env: gym.Env[Any, Any], file: Path, learner: str = "", trained_in: EnvRef | None = None
) -> tuple[gym.Env[Any, Any], Act]:
    """Return an env with the layouts of a policy, and the function that computes its actions."""
    policy = load_any_policy(file, learner)
    card: PolicyCard = policy.card
    if trained_in is not None and ENV in card.identity:
        remedy = (
            "Train it again, or give --env to try the policy in the present version of the env."
        )
        now = identify_env(env, trained_in.id)
        require_same_env(card.identity, trained_in, now, file, remedy)
    if card.clone is None:
        return _fitting(env, card), policy.act
    if (layout := getattr(env.unwrapped, "action_layout", None)) is not None:
        card.require_layouts(layout, card.observation)
    return env, policy.act


def load_any_policy(file: Path, learner: str = "") -> Any:
    """Load a policy of any kind; its learner may be in a module of the user."""
    allow_own_modules(learner)
    return load_policy(file, learner)


def _fitting(env: gym.Env[Any, Any], card: PolicyCard) -> gym.Env[Any, Any]:
    """Return an env with a policy's layouts, through the body map that matches names if needed."""
    settings: Any = card.settings
    if settings is not None and "many bodies" in settings.takes:
        from shapechanger.transfer.limbs.envs import fitted  # PyTorch.

        return fitted(env, card.layouts[0], settings.room)
    (observation, action), mine = layouts_of(env), card.layouts
    if (observation, action) == mine:
        return env
    body_map = BodyMap.between(mine[0], observation, mine[1], action)
    entries = (*body_map.observation, *body_map.action)
    filled = [entry.feature for entry in entries if not isinstance(entry.rule, Copy)]
    if filled:
        say(f"Constant, because the other body has no counterpart: {', '.join(filled)}.")
    return MappedEnv(env, body_map)
