"""PPO of rsl-rl on many worlds of one device, with the policies of Stable-Baselines3.

Worlds, networks, statistics and batches are on the device. A training begins with the weights of a
model of Stable-Baselines3's PPO with the same settings. The trained weights are copied back into
this model, which is evaluated in the CPU env and saved. So cards, curves, transplants and exports
are the same as for other learners.
"""

# This module uses private members of the learner of Stable-Baselines3.
# pyright: reportPrivateUsage=false, reportMissingTypeStubs=false

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import StudyError, needing_extra
from shapechanger.registry import MAKERS
from shapechanger.transfer.actions import ActionScale, learners_space, require_ranges
from shapechanger.transfer.learners.policy_file import SpacesOnly
from shapechanger.transfer.learners.sb3 import Progress, Sb3Learner

with needing_extra("gpu"):
    import torch
    from rsl_rl.algorithms import PPO
    from rsl_rl.env import VecEnv as RslEnvs
    from rsl_rl.models import MLPModel
    from rsl_rl.storage import RolloutStorage
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize
    from tensordict import TensorDict
    from torch import Tensor

# The group of observations that actor and critic read.
GROUP: Final = "policy"
# Values of Stable-Baselines3's PPO, which rsl-rl's PPO must use too.
_VALUE_WEIGHT: Final = 0.5
_LONGEST_GRADIENT: Final = 0.5
_ADAMS_EPSILON: Final = 1e-5
_CLIPPED_REWARD: Final = 10.0


class RslVecEnv(RslEnvs):
    """Worlds of `shapechanger.make_vec(backend="warp")` with the interface of rsl-rl's envs.

    Observations are in the group `policy`. A world whose episode has ended starts again in the same
    step, and `time_outs` is true for worlds whose episode was truncated without terminating.
    Actions are clipped to the range from -1 to 1, like Stable-Baselines3's. `rows` are `DeviceRows`
    for a policy of limbs, or None for the body's observations and actions.
    """

    def __init__(self, envs: Any, seed: int | None = None, rows: Any = None) -> None:
        seen = envs.reset(seed=seed)[0]
        if rows is None and isinstance(seen, tuple):
            raise StudyError(
                "rsl-rl needs worlds with equal spaces: make one vector env for each body, or give "
                "the rows of each body's limbs."
            )
        self.envs = envs
        self.num_envs = envs.num_envs
        self.max_episode_length = envs.max_episode_steps or 0
        self.device = envs.device
        self.cfg = {}
        self._rows = rows
        if self._rows is not None:
            self.num_actions = self._rows.room
        else:
            space, layout = envs.single_action_space, envs.action_layout
            require_ranges("this env", space, layout)
            self.num_actions = layout.size
            scale = ActionScale.between(learners_space(space), layout)
            self._middle, self._half, self._low, self._high = (
                torch.as_tensor(each, dtype=torch.float32, device=self.device) for each in scale
            )
        self._observations: Tensor = seen if self._rows is None else self._rows.of(seen)

    @property
    def episode_length_buf(self) -> Tensor:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Steps of each world's episode so far, shape (n,)."""
        return self.envs.episode_steps

    @episode_length_buf.setter
    def episode_length_buf(self, steps: Tensor) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self.envs.episode_steps[:] = steps

    def get_observations(self) -> TensorDict:
        """Return the present observations."""
        return TensorDict({GROUP: self._observations}, batch_size=[self.num_envs])

    def step(self, actions: Tensor) -> tuple[TensorDict, Tensor, Tensor, dict[str, Any]]:
        """Step each world with actions, (n, num_actions).

        Returns observations, rewards, whether each episode has ended, and extras with `time_outs`.
        """
        moved: Any = actions.clamp(-1.0, 1.0)
        if self._rows is not None:
            moved = self._rows.actions(moved)
        else:
            moved = (self._middle + self._half * moved).clamp(self._low, self._high)
        seen, rewards, terminated, truncated, _ = self.envs.step(moved)
        self._observations = seen if self._rows is None else self._rows.of(seen)
        ends = terminated | truncated
        return self.get_observations(), rewards, ends, {"time_outs": truncated & ~terminated}


class RslLearner(Sb3Learner):
    """PPO of rsl-rl on a device."""

    settings: Any

    @property
    def device(self) -> str:
        """The device that trains: "CPU", or the name of a GPU."""
        device = self.settings.device or ("cuda" if torch.cuda.is_available() else "cpu")
        return "CPU" if device == "cpu" else torch.cuda.get_device_name(device)

    def _training_envs(self, env: EnvRef, one: gym.Env[Any, Any]) -> VecEnv:
        """Return an env that only has the model's spaces; `_learn` makes the worlds."""
        spaces = SpacesOnly(one.observation_space, one.action_space)
        return DummyVecEnv([lambda: spaces])

    def _learn(
        self,
        env: EnvRef,
        model: Any,
        envs: VecEnv,
        steps: int,
        callbacks: list[BaseCallback],
        progress: Progress,
    ) -> None:
        if callbacks:
            raise StudyError(f"{self.name} cannot use callbacks of Stable-Baselines3.")
        made, rows = self._worlds(env)
        worlds = MAKERS.load("make_vec")(
            made.id,
            self.settings.n_envs,
            backend="warp",
            device=self.settings.device or None,
            task_infos=False,
            **made.kwargs,
        )
        with closing(worlds):
            training = self._begin(worlds, model.seed, rows, model, envs)
            following = progress.every
            while model.num_timesteps < steps:
                training.update(model.num_timesteps, progress.on_steps)
                model.num_timesteps += self.settings.update_steps
                if following <= model.num_timesteps < steps:
                    training.write_back()
                    progress.evaluate_now()
                    following += progress.every
            training.write_back()

    def _worlds(self, env: EnvRef) -> tuple[EnvRef, Any]:
        """Return the env of all worlds, and the rows of each body; None without limbs."""
        return env, None

    def _begin(self, worlds: Any, seed: int, rows: Any, model: Any, statistics: Any) -> RslTraining:
        return RslTraining(RslVecEnv(worlds, seed), model, statistics, self.settings)


class _Returns:
    """Discounted returns of worlds, by whose deviation rewards are divided, as `VecNormalize` does.

    All tensors stay on the device. Sums have the precision and order of `RunningMeanStd`.
    """

    def __init__(
        self, count: int, device: Any, statistics: VecNormalize | None, gamma: float
    ) -> None:
        self._statistics: Any = statistics
        self._gamma = gamma
        self._returns = torch.zeros(count, device=device)
        if statistics is not None:
            found: Any = statistics.ret_rms
            self._mean, self._var, self._count = (
                torch.tensor(float(number), dtype=torch.float64, device=device)
                for number in (found.mean, found.var, found.count)
            )

    def scaled(self, rewards: Tensor, ends: Tensor) -> Tensor:
        """Return rewards, (n,), divided by the returns' deviation, within ±10; `ends`: (n,)."""
        if self._statistics is None:
            return rewards
        self._returns = self._returns * self._gamma + rewards
        found = self._returns.double()
        delta, count = found.mean() - self._mean, found.numel()
        whole = self._count + count
        squares = self._var * self._count + found.var(unbiased=False) * count
        squares = squares + delta.square() * self._count * count / whole
        self._mean, self._var = self._mean + delta * count / whole, squares / whole
        self._count = whole
        self._returns = self._returns.masked_fill(ends, 0.0)
        scale = (self._var + self._statistics.epsilon).sqrt()
        return (rewards / scale).clamp(-_CLIPPED_REWARD, _CLIPPED_REWARD).to(rewards.dtype)

    def write_back(self) -> None:
        if self._statistics is not None:
            found: Any = self._statistics.ret_rms
            found.mean, found.var = self._mean.cpu().numpy(), self._var.cpu().numpy()
            found.count = float(self._count)


class RslTraining:
    """rsl-rl's PPO with the weights and statistics of a model of Stable-Baselines3."""

    def __init__(self, envs: RslVecEnv, model: Any, statistics: Any, settings: Any) -> None:
        self._envs = envs
        self._model = model
        self._statistics = statistics if isinstance(statistics, VecNormalize) else None
        self._settings = settings
        device = envs.device
        seen = envs.get_observations()
        self._actor, self._critic = self._networks(seen)
        self._read()
        storage = cast("Any", RolloutStorage)(
            "rl", envs.num_envs, settings.n_steps, seen, [envs.num_actions], device
        )
        self._ppo: Any = cast("Any", PPO)(
            self._actor,
            self._critic,
            storage,
            num_learning_epochs=settings.n_epochs,
            num_mini_batches=max(1, settings.update_steps // settings.batch_size),
            clip_param=settings.clip_range,
            gamma=settings.gamma,
            lam=settings.gae_lambda,
            value_loss_coef=_VALUE_WEIGHT,
            entropy_coef=settings.ent_coef,
            learning_rate=settings.learning_rate,
            max_grad_norm=_LONGEST_GRADIENT,
            use_clipped_value_loss=False,
            schedule="fixed",
            normalize_advantage_per_mini_batch=True,
            device=device,
        )
        for group in self._ppo.optimizer.param_groups:
            group["eps"] = _ADAMS_EPSILON
        self._ppo.train_mode()
        self._seen = seen
        self._returns = _Returns(envs.num_envs, device, self._statistics, settings.gamma)

    def _networks(self, seen: TensorDict) -> tuple[Any, Any]:
        """Return an actor and a critic with the shapes of the model's networks."""
        groups = {"actor": [GROUP], "critic": [GROUP]}
        shape: dict[str, Any] = {
            "hidden_dims": self._settings.net_arch,
            "activation": "tanh",  # The activation of Stable-Baselines3's PPO.
            "obs_normalization": self._settings.normalise,
        }
        actor = cast("Any", MLPModel)(
            seen,
            groups,
            "actor",
            self._envs.num_actions,
            **shape,
            distribution_cfg={
                "class_name": "rsl_rl.modules.distribution:GaussianDistribution",
                "std_type": "log",
            },
        )
        return actor, cast("Any", MLPModel)(seen, groups, "critic", 1, **shape)

    def update(self, done: int, on_steps: Callable[[int], None]) -> None:
        """Collect the steps of an update, and train the networks on them."""
        with torch.inference_mode():
            for step in range(self._settings.n_steps):
                actions = self._ppo.act(self._seen)
                self._seen, rewards, ends, extras = self._envs.step(actions)
                scaled = self._returns.scaled(rewards, ends)
                self._ppo.process_env_step(self._seen, scaled, ends, extras)
                on_steps(done + (step + 1) * self._envs.num_envs)
            self._ppo.compute_returns(self._seen)
        self._ppo.update()

    def _pairs(self) -> list[tuple[Any, Any]]:
        policy = self._model.policy
        extractor = policy.mlp_extractor
        pairs: list[tuple[Any, Any]] = []
        for network, hidden, head in (
            (self._actor, extractor.policy_net, policy.action_net),
            (self._critic, extractor.value_net, policy.value_net),
        ):
            ours = [layer for layer in network.mlp if isinstance(layer, torch.nn.Linear)]
            theirs = [layer for layer in hidden if isinstance(layer, torch.nn.Linear)]
            pairs += zip(ours, [*theirs, head], strict=True)
        return pairs

    def _read(self) -> None:
        """Copy weights and statistics from the model."""
        with torch.no_grad():
            for ours, theirs in self._pairs():
                ours.load_state_dict(theirs.state_dict())
            self._actor.distribution.log_std_param.copy_(self._model.policy.log_std)
            if self._statistics is not None and self._statistics.norm_obs:
                found: Any = self._statistics.obs_rms
                for network in (self._actor, self._critic):
                    normaliser = network.obs_normalizer
                    # rsl-rl adds its epsilon to the deviation, Stable-Baselines3 to the variance.
                    deviation = np.sqrt(found.var + self._statistics.epsilon) - normaliser.eps
                    normaliser._std.copy_(torch.as_tensor(deviation.clip(min=0.0)))
                    normaliser._var.copy_(normaliser._std.square())
                    normaliser._mean.copy_(torch.as_tensor(found.mean))
                    normaliser.count.fill_(int(found.count))

    def write_back(self) -> None:
        """Copy the present weights and statistics to the model."""
        with torch.no_grad():
            for ours, theirs in self._pairs():
                theirs.load_state_dict(cast("dict[str, Any]", ours.state_dict()))
            self._model.policy.log_std.copy_(self._actor.distribution.log_std_param)
        self._returns.write_back()
        if self._statistics is not None and self._statistics.norm_obs:
            normaliser, found = self._actor.obs_normalizer, cast("Any", self._statistics.obs_rms)
            found.mean = normaliser._mean[0].double().cpu().numpy()
            deviation = normaliser._std[0].double() + normaliser.eps
            found.var = deviation.square().cpu().numpy() - self._statistics.epsilon
            found.count = float(normaliser.count)
