"""Methods that change the updates of PPO: a frozen trunk, and distillation of the source policy."""

from __future__ import annotations

from typing import Any, Final, cast

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize
from torch import nn
from torch.nn.utils import clip_grad_norm_

from shapechanger.contract.env_ref import EnvTraits
from shapechanger.layout import Layout
from shapechanger.transfer.actions import ActionScale
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.body_map.rules import Learn
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.evaluation import Act
from shapechanger.transfer.methods import Method, MethodRun

_LEAST_LAYERS = 2
_PPO = f"PPO with at least {_LEAST_LAYERS} hidden layers"


class FrozenTrunk(Method):
    """Fine-tune the first and the last layer of the policy, and keep those between.

    The first layer reads the body's sensors and the last one moves its motors; the layers between
    hold the skill, as far as it is independent of the body. The whole value network learns.
    """

    name = "frozen-trunk"
    needs = (("on-policy", _PPO), ("callback", "PPO on the CPU"))
    paper = "C. Devin and others, Learning Modular Neural Network Policies, ICRA 2017"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse learners without what it needs, and networks without a layer in the middle."""
        super().require(source, target, settings)
        if len(cast("Any", settings).net_arch) < _LEAST_LAYERS:
            raise self._lacks(_PPO)

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune(callback=_Freeze())


class _Freeze(BaseCallback):
    """Excludes the hidden layers after the first from the optimiser's steps."""

    def _on_training_start(self) -> None:
        hidden = cast("Any", self.model.policy).mlp_extractor.policy_net
        linear = [layer for layer in hidden if isinstance(layer, nn.Linear)]
        for layer in linear[1:]:
            layer.requires_grad_(False)

    def _on_step(self) -> bool:
        return True


# Weight of the distillation at the start, and the share of the steps after which it is 0.
_WEIGHT: Final = 1.0
_UNTIL: Final = 0.5


class Kickstart(Method):
    """Learn the target with a new policy that is distilled from the source policy.

    After each update of PPO, one pass over the same observations minimises the divergence from the
    source policy's actions through the body map. Its weight falls linearly to 0 over the first half
    of the steps. The paper adds the two losses; here their steps alternate, so that PPO is the one
    of Stable-Baselines3. Actions that the map leaves to be learned are not distilled.
    """

    name = "kickstart"
    needs = (("on-policy", "PPO"), ("callback", "PPO on the CPU"))
    paper = "S. Schmitt and others, Kickstarting Deep Reinforcement Learning, arXiv:1803.03835"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target with the source policy as the teacher."""
        teacher = MappedTeacher(run.source_policy().act, run.body_map)
        return run.train(
            run.target,
            run.steps,
            callback=_Distillation(teacher, run.body_map.target_action),
            on_evaluation=run.report,
        )


class MappedTeacher:
    """The actions of a source policy on the target, through the body map."""

    def __init__(self, act: Act, body_map: BodyMap) -> None:
        self._act = act
        self._map = body_map
        self.taught: NDArray[np.bool_] = np.array(
            [not isinstance(entry.rule, Learn) for entry in body_map.action]
        )

    def __call__(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return actions of shape (n, target actions) for the target's observations."""
        actions = self._act(self._map.adapt_observation(observations))
        return self._map.adapt_action(actions).astype(np.float32)


class _Distillation(BaseCallback):
    """Collects the teacher's actions during a rollout, and learns from them after the update."""

    def __init__(self, teacher: MappedTeacher, action: Layout) -> None:
        super().__init__()
        self._teacher = teacher
        self._action = action
        self._seen: list[NDArray[Any]] = []
        self._shown: list[NDArray[np.float32]] = []
        # The teacher's answer to the observations that the next step acts on.
        self._next = np.empty(0, np.float32)

    def _on_rollout_start(self) -> None:
        # PPO has just updated on the last rollout, if there was one.
        if self._seen:
            self._distil(np.concatenate(self._seen), np.concatenate(self._shown))
        self._seen, self._shown = [], []
        self._next = self._teacher(self._raw_observations())

    def _on_step(self) -> bool:
        # The observations that this step's actions answered, as the network has seen them.
        self._seen.append(self.locals["obs_tensor"].numpy().copy())
        self._shown.append(self._next)
        self._next = self._teacher(self._raw_observations())
        return True

    def _raw_observations(self) -> NDArray[Any]:
        """The present observations before normalisation."""
        envs = self.training_env
        if isinstance(envs, VecNormalize):
            return cast("NDArray[Any]", envs.get_original_obs())
        return cast("Any", self.model)._last_obs

    def _distil(self, seen: NDArray[Any], shown: NDArray[np.float32]) -> None:
        """Take one pass over a rollout."""
        model = cast("Any", self.model)
        weight = _WEIGHT * (1.0 - self.num_timesteps / (_UNTIL * model._total_timesteps))
        if weight <= 0.0:
            return
        policy = model.policy
        taught = torch.from_numpy(self._teacher.taught)  # pyright: ignore[reportUnknownMemberType]
        order = torch.randperm(len(seen))
        observations = torch.from_numpy(seen)[order]  # pyright: ignore[reportUnknownMemberType]
        scaled = ActionScale.between(model.action_space, self._action).to_model(shown)
        actions = torch.from_numpy(scaled)[order]  # pyright: ignore[reportUnknownMemberType]
        losses: list[float] = []
        for start in range(0, len(seen), model.batch_size):
            batch = slice(start, start + model.batch_size)
            normal = policy.get_distribution(observations[batch]).distribution
            # The divergence of two Gaussians of this policy's deviation, which PPO alone changes.
            away = (normal.mean - actions[batch]) / normal.stddev.detach()
            loss = 0.5 * away[:, taught].square().sum(dim=1).mean()
            policy.optimizer.zero_grad()
            (weight * loss).backward()
            clip_grad_norm_(policy.parameters(), model.max_grad_norm)
            policy.optimizer.step()
            losses.append(loss.item())
        self.logger.record("train/distillation_loss", float(np.mean(losses)))
