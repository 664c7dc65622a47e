"""Learners of policies that see a body as a trunk and limbs."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from shapechanger.contract.env_ref import EnvRef, EnvTraits, each_body, layouts_of
from shapechanger.errors import TransplantError
from shapechanger.policy import PolicyCard
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners.algorithms import build_model
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import Sb3Settings
from shapechanger.transfer.limbs.envs import (
    LimbVecEnv,
    limb_envs,
    rows_of_each,
)
from shapechanger.transfer.limbs.rows import require_same_columns


class LimbLearner(Sb3Learner):
    """PPO with a policy of limbs, whose weights fit any body of a family."""

    settings: Any

    # Rows of limbs are scaled already.
    _normalises_observations = False

    def require(self, env: EnvRef, traits: EnvTraits) -> None:
        """Refuse an env whose spaces are not flat boxes, and bodies of different families."""
        super().require(env, traits)
        rows_of_each(each_body(env), self.settings.room)

    def evaluation_envs(self, env: EnvRef) -> list[gym.Env[Any, Any]]:
        """Make envs as rows, which have the bodies in turn."""
        return limb_envs(env, self.settings.eval_episodes, self.settings.room)

    def _training_envs(self, env: EnvRef, one: gym.Env[Any, Any]) -> VecEnv:
        del one
        settings = self.settings
        return LimbVecEnv(env, settings.n_envs, threads=self.threads, room=settings.room)

    def _adapted(
        self, envs: list[gym.Env[Any, Any]], policy: TrainedPolicy, body_map: BodyMap
    ) -> list[gym.Env[Any, Any]]:
        del body_map
        name = envs[0].spec.id if envs[0].spec else ""
        require_same_columns(policy.card.layouts[0], layouts_of(envs[0])[0], name)
        return envs

    def _moved(
        self,
        source: TrainedPolicy,
        envs: VecEnv,
        settings: Sb3Settings,
        card: PolicyCard,
        body_map: BodyMap,
        logs: str | None,
    ) -> BaseAlgorithm:
        del body_map
        require_same_columns(source.card.layouts[0], card.layouts[0], card.trained_in.id)
        model = build_model(settings, envs, card.seed, logs)
        try:
            cast("Any", model.policy).load_state_dict(source.model.policy.state_dict())
        except RuntimeError as error:
            raise TransplantError(
                f"The network of the policy of {source.card.trained_in.id} is padded for another "
                "number of limbs than this training's: give the same --set room."
            ) from error
        return model
