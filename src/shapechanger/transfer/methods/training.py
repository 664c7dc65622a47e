"""Methods that change how Stable-Baselines3 trains: updates of PPO, and replay buffers."""

from __future__ import annotations

from contextlib import closing
from typing import Any, Final, NamedTuple, cast

import msgspec
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils import clip_grad_norm_

from shapechanger.contract.env_ref import EnvRef, EnvTraits, layouts_of
from shapechanger.layout import Layout
from shapechanger.transfer.actions import ActionScale
from shapechanger.transfer.body_map import BodyMap, Learn
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.evaluation import Act, evaluate, evaluation_seed
from shapechanger.transfer.learners.policy_file import TrainedPolicy, actor
from shapechanger.transfer.methods import Method, MethodRun

_LEAST_LAYERS = 2
_PPO = f"PPO with at least {_LEAST_LAYERS} hidden layers"


class FrozenTrunk(Method):
    """Fine-tune the first and the last layer of the policy, and freeze the layers between.

    The first layer depends on the body's sensors and the last one on its motors; the layers between
    depend less on the body. The whole value network is trained.
    """

    name = "frozen-trunk"
    needs = (("on-policy", _PPO), ("callback", "PPO on the CPU"))
    paper = "C. Devin and others, Learning Modular Neural Network Policies, ICRA 2017"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse learners that the method cannot use, and fewer than two hidden layers."""
        super().require(source, target, settings)
        if len(cast("Any", settings).net_arch) < _LEAST_LAYERS:
            raise self._lacks(_PPO)

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune(callback=_Freeze())


class _Freeze(BaseCallback):
    """Excludes the hidden layers after the first from the optimiser's steps."""

    def _on_step(self) -> bool:
        return True

    def _on_training_start(self) -> None:
        hidden = cast("Any", self.model.policy).mlp_extractor.policy_net
        linear = [layer for layer in hidden if isinstance(layer, nn.Linear)]
        for layer in linear[1:]:
            layer.requires_grad_(False)


# Weight of the distillation at the start, and the share of the steps after which it is 0.
_WEIGHT: Final = 1.0
_UNTIL: Final = 0.5


class Kickstart(Method):
    """Learn the target with a new policy that is distilled from the source policy.

    After each update of PPO, one pass over the same observations minimises the divergence from the
    source policy's actions through the body map. Its weight falls linearly to 0 over the first half
    of the steps. The paper adds the two losses. Here updates by the two losses alternate, so that
    PPO of Stable-Baselines3 is unchanged. Actions with the rule `learn` are not distilled.
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
        self._act, self._map = act, body_map
        taught = [not isinstance(entry.rule, Learn) for entry in body_map.action]
        sizes = [feature.size for feature in body_map.target_action]
        self.taught: NDArray[np.bool_] = np.repeat(taught, sizes)

    def __call__(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return actions of shape (n, target actions) for the target's observations."""
        actions = self._act(self._map.adapt_observation(observations))
        return self._map.adapt_action(actions).astype(np.float32)


class _Distillation(BaseCallback):
    """Collects the teacher's actions during a rollout, and distils them after PPO's update."""

    def __init__(self, teacher: MappedTeacher, action: Layout) -> None:
        super().__init__()
        self._teacher, self._action = teacher, action
        self._seen: list[NDArray[Any]] = []
        self._shown: list[NDArray[np.float32]] = []
        # The teacher's actions for the present observations, which belong to the next step.
        self._next = np.empty(0, np.float32)

    def _on_rollout_start(self) -> None:
        # At the first rollout there is no earlier rollout to distil.
        if self._seen:
            self._distil(np.concatenate(self._seen), np.concatenate(self._shown))
        self._seen, self._shown = [], []
        self._next = self._teacher(self._raw_observations())

    def _on_step(self) -> bool:
        # The network's inputs of this step, with normalisation.
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
            # The divergence of two Gaussians with the policy's deviation, which only PPO trains.
            away = (normal.mean - actions[batch]) / normal.stddev.detach()
            loss = 0.5 * away[:, taught].square().sum(dim=1).mean()
            policy.optimizer.zero_grad()
            (weight * loss).backward()
            clip_grad_norm_(policy.parameters(), model.max_grad_norm)
            policy.optimizer.step()
            losses.append(loss.item())
        self.logger.record("train/distillation_loss", float(np.mean(losses)))


# Number of prefilled source transitions, as a share of the target steps.
_PREFILLED: Final = 0.5
# The paper's classifiers have one hidden layer and noisy inputs. Width, standard deviation
# of the noise and size of a batch are not from the paper and were not tuned.
_WIDTH: Final = 256
_NOISE: Final = 0.1
_BATCH: Final = 256
# Steps of each source env between two gradient steps of the classifiers.
_CLASSIFY_EVERY: Final = 4
# Bound on the correction of a single transition's reward.
_LARGEST_CORRECTION: Final = 10.0
_REPLAY: Final = "a learner with a replay buffer, sac or tqc"


class Transitions(NamedTuple):
    """Transitions of one env in order, each array of shape (n, ...).

    `terminated` is true if the task ended; a time limit does not count.
    """

    observations: NDArray[np.float64]
    actions: NDArray[np.float32]
    rewards: NDArray[np.float64]
    next_observations: NDArray[np.float64]
    terminated: NDArray[np.bool_]


class PrefilledReplay(Method):
    """Learn the target with a new policy whose replay buffer starts with mapped source transitions.

    The source policy acts in the source with its exploration noise for half as many steps as there
    are target steps. Observations are mapped by matching names, and actions by the study's body
    map. Rewards are unchanged. The learner cannot distinguish these transitions from its own.
    """

    name = "prefilled-replay"
    needs = (("off-policy", _REPLAY),)
    paper = "A. Lazaric, M. Restelli and A. Bonarini, Transfer of Samples in Batch RL, ICML 2008"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target."""
        steps = int(_PREFILLED * run.steps)
        seen = collect(run.source, run.source_policy(), steps, run.seed)
        return run.train(
            run.target,
            run.steps,
            callback=_Prefill(_mapped(seen, run.body_map), run.body_map.target_action),
            on_evaluation=run.report,
        )


class OffDynamics(Method):
    """Learn in the source, with rewards corrected for the target's dynamics (DARC).

    Two classifiers distinguish source from target, one by (s, a, s') and one by (s, a). Their
    difference estimates log p_target(s' | s, a) - log p_source(s' | s, a), which is added to the
    source's reward. So transitions that are unlikely on the target are penalised. The policy is
    trained on source steps only, as many as a source policy has. It also acts on the target for the
    budget of target steps, which only train the classifiers.
    """

    name = "off-dynamics"
    needs = (("off-policy", _REPLAY),)
    paper = "B. Eysenbach and others, Off-Dynamics Reinforcement Learning (DARC), ICLR 2021"
    uses_source_policy = False

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse learners without a replay buffer or with normalisation, and unequal layouts."""
        super().require(source, target, settings)
        if not source.same_layouts(target):
            raise self._lacks("two bodies with the same spaces")
        if cast("Any", settings).normalise:
            raise self._lacks("a learner with normalise=false")

    def learn(self, run: MethodRun) -> Any:
        """Train in the source while acting on the target."""
        with closing(_Correction(run)) as correction:
            return run.train(run.source, run.source_steps, callback=correction)


def collect(env: EnvRef, policy: TrainedPolicy, steps: int, seed: int) -> Transitions:
    """Return the transitions of a policy that acts in an env with its exploration noise."""
    act = actor(policy.model, policy.normalisation, policy.card.layouts[1], deterministic=False)
    rows: list[tuple[Any, ...]] = []
    with closing(env.make()) as made:
        torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
        seen, _ = made.reset(seed=seed)
        for _ in range(steps):
            action = act(np.asarray(seen)[None])[0]
            then, reward, terminated, truncated, _ = made.step(action)
            rows.append((seen, action, float(reward), then, terminated))
            seen = then
            if terminated or truncated:
                seed += 1
                seen, _ = made.reset(seed=seed)
    return Transitions(*(np.asarray(column) for column in zip(*rows, strict=True)))


def _mapped(seen: Transitions, body_map: BodyMap) -> Transitions:
    """Return transitions of the source as transitions of the target."""
    observation, sees, action, acts = body_map.layouts
    onto_target = BodyMap.between(sees, observation, acts, action)
    return seen._replace(
        observations=onto_target.adapt_observation(seen.observations),
        actions=body_map.adapt_action(seen.actions).astype(np.float32),
        next_observations=onto_target.adapt_observation(seen.next_observations),
    )


class _Prefill(BaseCallback):
    def __init__(self, transitions: Transitions, action: Layout) -> None:
        super().__init__()
        self._transitions, self._action = transitions, action

    def _on_step(self) -> bool:
        return True

    def _on_training_start(self) -> None:
        model = cast("Any", self.model)
        space = model.action_space
        scale = ActionScale.between(space, self._action)
        together = model.n_envs
        whole = len(self._transitions.rewards) // together * together
        for at in range(0, whole, together):
            seen, acted, rewards, then, ended = (
                column[at : at + together] for column in self._transitions
            )
            inside = np.clip(scale.to_model(acted), space.low, space.high)
            model.replay_buffer.add(
                seen, then, model.policy.scale_action(inside), rewards, ended, [{}] * together
            )


class DomainClassifiers(nn.Module):
    """Two classifiers that distinguish source from target, by (s, a, s') and by (s, a)."""

    def __init__(self, n_observations: int, n_actions: int, learning_rate: float = 3e-4) -> None:
        super().__init__()  # pyright: ignore[reportUnknownMemberType]
        both = n_observations + n_actions
        self._of_step, self._of_action = (
            nn.Sequential(nn.Linear(inputs, _WIDTH), nn.ReLU(), nn.Linear(_WIDTH, 1))
            for inputs in (both + n_observations, both)
        )
        self._optimiser = torch.optim.Adam(self.parameters(), lr=learning_rate)

    def forward(self, seen: Tensor, acted: Tensor, then: Tensor) -> tuple[Tensor, Tensor]:
        """Return log p(target) - log p(source) by each classifier, each of shape (n,).

        Observations and next observations have the shape (n, k), actions (n, m).
        """
        of_action = torch.cat([seen, acted], dim=1).float()
        of_step = torch.cat([of_action, then.float()], dim=1)
        return self._of_step(of_step).squeeze(1), self._of_action(of_action).squeeze(1)

    def correction(self, seen: Tensor, acted: Tensor, then: Tensor) -> Tensor:
        """Estimate log p_target(s' | s, a) - log p_source(s' | s, a), shape (n,); see `forward`."""
        with torch.no_grad():
            of_step, of_action = self(seen, acted, then)
        return (of_step - of_action).clamp(-_LARGEST_CORRECTION, _LARGEST_CORRECTION)

    def fit(self, source: tuple[Tensor, ...], target: tuple[Tensor, ...]) -> float:
        """Take one gradient step on (s, a, s'), each of shape (n, ...); return the loss."""
        inputs = [torch.cat(pair) for pair in zip(source, target, strict=True)]
        # Noise prevents overconfident classifiers if the dynamics are nearly deterministic.
        noisy = [one + _NOISE * torch.randn_like(one) for one in inputs]
        labels = torch.cat([torch.zeros(len(source[0])), torch.ones(len(target[0]))])
        loss = torch.stack(
            [functional.binary_cross_entropy_with_logits(one, labels) for one in self(*noisy)]
        ).sum()
        self._optimiser.zero_grad()
        loss.backward()  # pyright: ignore[reportUnknownMemberType]
        self._optimiser.step()  # pyright: ignore[reportUnknownMemberType]
        return loss.item()


class _CorrectedReplay(ReplayBuffer):
    classifiers: DomainClassifiers

    def sample(self, batch_size: int, env: Any = None) -> ReplayBufferSamples:
        batch = super().sample(batch_size, env)
        extra = self.classifiers.correction(
            batch.observations, batch.actions, batch.next_observations
        )
        return batch._replace(rewards=batch.rewards + extra.unsqueeze(1))


class _Correction(BaseCallback):
    """Acts on the target during the training in the source, and corrects the rewards."""

    def __init__(self, run: MethodRun) -> None:
        super().__init__()
        self._run = run
        self._env = run.target.make()
        self._action = layouts_of(self._env)[1]
        self._judges = run.learner.evaluation_envs(run.target)
        self._seen, _ = self._env.reset(seed=run.seed)
        self._next = 0
        self._steps = 0

    def close(self) -> None:
        for one in (self._env, *self._judges):
            one.close()

    def _on_training_start(self) -> None:
        model = cast("Any", self.model)
        torch.manual_seed(self._run.seed)  # pyright: ignore[reportUnknownMemberType]
        spaces = model.observation_space, model.action_space
        self._classifiers = DomainClassifiers(spaces[0].shape[0], spaces[1].shape[0])
        size = min(model.buffer_size, self._run.source_steps)
        corrected = _CorrectedReplay(size, *spaces, device="cpu", n_envs=model.n_envs)
        corrected.classifiers = self._classifiers
        model.replay_buffer = corrected
        self._of_target = ReplayBuffer(self._run.steps, *spaces, device="cpu")

    def _on_step(self) -> bool:
        run, model = self._run, cast("Any", self.model)
        # Target steps are spread evenly over the source steps.
        due = min(run.steps, self.num_timesteps * run.steps // run.source_steps)
        while self._steps < due:
            self._evaluate_if_due()
            action, _ = model.predict(self._seen)
            scale = ActionScale.between(model.action_space, self._action)
            then, reward, terminated, truncated, _ = self._env.step(scale.to_env(action))
            ends = np.array([reward]), np.array([terminated])
            scaled = model.policy.scale_action(action)
            self._of_target.add(np.asarray(self._seen), np.asarray(then), scaled, *ends, [{}])
            self._steps += 1
            self._seen = self._env.reset()[0] if terminated or truncated else then
        if self.n_calls % _CLASSIFY_EVERY == 0 and self._of_target.size() >= _BATCH:
            batches = (
                ReplayBuffer.sample(model.replay_buffer, _BATCH),
                self._of_target.sample(_BATCH),
            )
            source, target = (
                (batch.observations, batch.actions, batch.next_observations) for batch in batches
            )
            self._classifiers.fit(source, target)
        return True

    def _on_training_end(self) -> None:
        self._evaluate_if_due(last=True)

    def _evaluate_if_due(self, *, last: bool = False) -> None:
        """Evaluate on the target, at the same steps as scratch."""
        run = self._run
        if not last and self._steps < self._next:
            return
        self._next += run.settings.eval_every
        found = evaluate(
            actor(cast("Any", self.model), None, self._action),
            self._judges,
            evaluation_seed(run.target, run.settings.eval_episodes),
            episodes=run.settings.eval_episodes,
        )
        run.report(msgspec.structs.replace(found, steps=run.steps if last else self._steps))
