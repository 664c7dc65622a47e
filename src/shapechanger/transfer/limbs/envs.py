"""Envs whose observations are rows, one for the trunk and one per limb, and their learner.

A row is described in `shapechanger.transfer.limbs.rows`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

from shapechanger.contract.env_ref import EnvRef, EnvTraits, each_body, layouts_of
from shapechanger.errors import StudyError, TransplantError
from shapechanger.layout import Layout
from shapechanger.policy import PolicyCard
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.vec_env import training_vec_env
from shapechanger.transfer.limbs.rows import LimbRows, require_same_columns, rows_of


class LimbEnv(gym.Wrapper[Any, Any, Any, Any]):
    """An env whose observations are rows of numbers, and whose actions are one number per limb.

    The env needs a property `tree`, its kinematic tree. `room` is the number of limbs with rows,
    at least as many as the body has; 0 for as many as the body has.
    """

    def __init__(self, env: gym.Env[Any, Any], room: int = 0) -> None:
        super().__init__(env)
        self.rows = rows_of(env, room)
        self.observation_layout, self.action_layout = self.rows.layouts()
        self.observation_space, self.action_space = limb_spaces(self.rows)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; options that change the body are refused."""
        if options and "body" in options:
            raise StudyError("A reset cannot change the body behind its rows: make another env.")
        observation, info = self.env.reset(seed=seed, options=options)
        return self.rows.of(observation), info

    def step(self, action: NDArray[Any]) -> Any:
        """Take one step with a number from -1 to 1 for each limb, which motorless limbs ignore."""
        observation, *rest = self.env.step(self.rows.actions(action))
        return self.rows.of(observation), *rest


def limb_spaces(rows: LimbRows) -> tuple[gym.spaces.Box, gym.spaces.Box]:
    """Return the spaces of rows, flattened, and of the limbs' actions."""
    size = rows.constant.size
    return (
        gym.spaces.Box(-np.inf, np.inf, (size,), np.float32),
        gym.spaces.Box(-1.0, 1.0, (rows.room,), np.float32),
    )


def limb_envs(env: EnvRef, count: int, room: int = 0) -> list[gym.Env[Any, Any]]:
    """Return `count` envs with rows, which cycle through the bodies and have the same spaces."""
    bodies = each_body(env)
    # The largest body determines the room, even if `count` is too small for an env with it.
    room = rows_of_each(bodies, room)[0].room
    return [LimbEnv(bodies[i % len(bodies)].make(), room) for i in range(count)]


def fitted(env: gym.Env[Any, Any], rows: Layout, room: int = 0) -> LimbEnv:
    """Wrap an env for a policy of limbs; the env's rows must have the columns of `rows`."""
    limbs = LimbEnv(env, room)
    name = env.spec.id if env.spec else type(env.unwrapped).__name__
    require_same_columns(rows, limbs.observation_layout, name)
    return limbs


class LimbVecEnv(DummyVecEnv):
    """Many envs with rows, of bodies that may differ in their number of limbs.

    Envs whose layouts agree are stepped together. The envs cycle through the bodies of `env`, see
    `each_body`, and each body has at least one env. `room` is the number of limbs that
    have rows; 0 for as many as the bodies have.
    """

    def __init__(
        self, env: EnvRef, num_envs: int, *, threads: int | None = 1, room: int = 0
    ) -> None:
        bodies, own = bodies_in_turn(env, num_envs, room)
        # Envs that are stepped together have the same layouts.
        groups: dict[tuple[tuple[str, ...], ...], list[int]] = {}
        for i, rows in enumerate(own):
            groups.setdefault(rows.names, []).append(i)
        # For each group: the indices of its envs, their rows, and the envs as a vector env.
        self._groups: list[tuple[list[int], LimbRows, Any]] = []
        self._own, self.envs = own, cast("list[Any]", [None] * num_envs)
        for numbers in groups.values():
            bodies_here = together([bodies[i] for i in numbers])
            envs: Any = training_vec_env(bodies_here, len(numbers), threads)
            self._groups.append((numbers, LimbRows.stacked([own[i] for i in numbers]), envs))
            for i, one in zip(numbers, envs.envs, strict=True):
                self.envs[i] = one
        # Skips the constructor of DummyVecEnv, which would make its own envs and buffers.
        cast("Any", VecEnv).__init__(self, num_envs, *limb_spaces(own[0]))
        self._actions = np.zeros((num_envs, own[0].room), np.float32)

    def reset(self) -> NDArray[np.float32]:
        """Start an episode in each env with the seeds that were set."""
        seen = np.empty((self.num_envs, self._own[0].constant.size), np.float32)
        for numbers, rows, envs in self._groups:
            envs._seeds = [self._seeds[i] for i in numbers]
            seen[numbers] = rows.of(envs.reset())
            for i, info in zip(numbers, envs.reset_infos, strict=True):
                self.reset_infos[i] = info
        self._reset_seeds()
        self._reset_options()
        return seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store actions of shape (envs, room) for `step_wait`."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step each env; return rows, rewards, ends and infos."""
        seen = np.empty((self.num_envs, self._own[0].constant.size), np.float32)
        rewards, ends = np.empty(self.num_envs, np.float32), np.empty(self.num_envs, np.bool_)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for numbers, rows, envs in self._groups:
            actions = np.stack([self._own[i].actions(self._actions[i]) for i in numbers])
            observed, rewards[numbers], ends[numbers], told = envs.step(actions)
            seen[numbers] = rows.of(observed)
            for i, info in zip(numbers, told, strict=True):
                infos[i] = info
                if "terminal_observation" in info:
                    info["terminal_observation"] = self._own[i].of(info["terminal_observation"])
        return seen, rewards, ends, infos

    def close(self) -> None:
        """Close all envs."""
        for _, _, envs in self._groups:
            envs.close()


def bodies_in_turn(
    env: EnvRef, num_envs: int, room: int = 0
) -> tuple[list[EnvRef], list[LimbRows]]:
    """Return the body and the rows of each env, if `num_envs` envs cycle through the bodies."""
    bodies = each_body(env)
    if len(bodies) > num_envs:
        raise StudyError(
            f"{len(bodies)} bodies need as many envs, and there are {num_envs}: give "
            f"--set n_envs={len(bodies)}."
        )
    own = rows_of_each(bodies, room)
    turns = [i % len(bodies) for i in range(num_envs)]
    return [bodies[i] for i in turns], [own[i] for i in turns]


def together(bodies: Sequence[EnvRef]) -> EnvRef:
    """Combine references that differ only in `body` into one with the argument `bodies`."""
    if "body" not in bodies[0].kwargs:
        return bodies[0]
    edits = [body.kwargs["body"] for body in bodies]
    return bodies[0].without("body").having({"bodies": edits})


def rows_of_each(bodies: Sequence[EnvRef], room: int = 0) -> list[LimbRows]:
    """Return the rows of the bodies of some envs, all with the same room."""
    with ExitStack() as stack:
        made = [stack.enter_context(closing(body.make())) for body in bodies]
        trees: list[Any] = [getattr(one.unwrapped, "tree", None) for one in made]
        room = room or max(len(tree.limbs) if tree else 0 for tree in trees)
        own = [rows_of(one, room) for one in made]
    if others := [rows.columns for rows in own if rows.columns != own[0].columns]:
        raise StudyError(f"These bodies have different columns: {own[0].columns} and {others[0]}.")
    return own


class LimbLearner(Sb3Learner):
    """PPO with a policy of limbs, which can act in other bodies of the same family."""

    settings: Any

    # Observations as rows are already scaled.
    _normalises_observations = False

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env whose spaces are not flat boxes, or whose bodies have different columns."""
        super().require(env, traits)
        rows_of_each(each_body(env), self.settings.room)

    def evaluation_envs(self, env: EnvRef) -> list[gym.Env[Any, Any]]:
        """Make envs with rows, which cycle through the bodies."""
        return limb_envs(env, self.settings.eval_episodes, self.settings.room)

    def _training_envs(self, env: EnvRef, one: gym.Env[Any, Any]) -> VecEnv:
        settings = self.settings
        return LimbVecEnv(env, settings.n_envs, threads=self.threads, room=settings.room)

    def _adapted(
        self, envs: list[gym.Env[Any, Any]], policy: TrainedPolicy, body_map: BodyMap
    ) -> list[gym.Env[Any, Any]]:
        name = envs[0].spec.id if envs[0].spec else ""
        require_same_columns(policy.card.layouts[0], layouts_of(envs[0])[0], name)
        return envs

    def _moved(
        self, source: TrainedPolicy, envs: VecEnv, card: PolicyCard, body_map: BodyMap
    ) -> BaseAlgorithm:
        require_same_columns(source.card.layouts[0], card.layouts[0], card.trained_in.id)
        model = self._new_model(envs, card)
        try:
            cast("Any", model.policy).load_state_dict(source.model.policy.state_dict())
        except RuntimeError as error:
            raise TransplantError(
                f"The network of the policy of {source.card.trained_in.id} is padded for another "
                "number of limbs than this training's: give the same --set room."
            ) from error
        return model
