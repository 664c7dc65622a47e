"""Transplanted policies compute what the source policy computes through the map."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

from shapechanger.errors import MissingExtra, SpaceMismatch, TransplantError
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold
from shapechanger.transfer.transplant import transplant, transplant_normalisation
from shapechanger.transfer.transplant.layers import (
    Scaling,
    critic_actions,
    gaussian_outputs,
    observation_affine,
    squashed_outputs,
)
from tests.transfer.body_map.bodies import (
    ANT_FLIP,
    ANT_SWAP,
    ant_action,
    ant_observation,
    carts,
    motor,
    pendulum_action,
    pendulum_observation,
)

Model = PPO | SAC
Numbers = dict[str, NDArray[np.float64]]


class Box(gym.Env[np.ndarray, np.ndarray]):
    """An env with given layouts and random observations."""

    def __init__(self, observation: Layout, action: Layout) -> None:
        n = observation.size
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (n,), np.float64)
        low, high = (bound.astype(np.float32) for bound in (action.low, action.high))
        self.action_space = gym.spaces.Box(low, high, dtype=np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, Any]:
        super().reset(seed=seed)
        return self.np_random.normal(size=self.observation_space.shape), {}

    def step(self, action: Any) -> Any:
        end = bool(self.np_random.uniform() < 0.1)
        observation = self.np_random.normal(size=self.observation_space.shape)
        return observation, float(action.sum()), end, False, {}


def envs(observation: Layout, action: Layout, *, normalised: bool = False) -> Any:
    one = DummyVecEnv([lambda: Box(observation, action)])
    return VecNormalize(one) if normalised else one


def targets(body_map: BodyMap, *, normalised: bool = False) -> Any:
    return envs(body_map.target_observation, body_map.target_action, normalised=normalised)


def ant_map(source_feet: bool, target_feet: bool, **options: Any) -> BodyMap:
    return BodyMap.between(
        ant_observation(feet=source_feet),
        ant_observation(feet=target_feet),
        ant_action(feet=source_feet),
        ant_action(feet=target_feet),
        **options,
    )


MAPS: dict[str, BodyMap] = {
    "identity": BodyMap.identity(ant_observation(), ant_action()),
    "growth": ant_map(False, True, rules={"foot_[12]/motor": "zero", "foot_*": Hold(0.25)}),
    "shrink": ant_map(True, False, rules={"foot_*/angle": "hold"}),
    "mirror": BodyMap.mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=ANT_FLIP),
    "copies": ant_map(
        False,
        True,
        rules={"foot_*/motor": "copy ankle_*/motor"},
        observation_rules={"hip_1/angle": "copy hip_2/angle", "torso/vx": Copy("torso/vx", -2.0)},
    ),
}
ARCHITECTURES: dict[str, tuple[Any, Any]] = {
    "[64, 64]": ([64, 64], [64, 64]),
    "[]": ([], []),
    "asymmetric": ({"pi": [12], "vf": [10, 8]}, {"pi": [12], "qf": [10, 8]}),
}

each_map = pytest.mark.parametrize("body_map", MAPS.values(), ids=MAPS.keys())
each_net = pytest.mark.parametrize("net_arch", ARCHITECTURES.values(), ids=ARCHITECTURES.keys())
each_class = pytest.mark.parametrize("kind", [PPO, SAC])


def trained(
    kind: type[Model],
    body_map: BodyMap,
    net_arch: Any = ([16], [16]),
    *,
    normalised: bool = False,
    seed: int = 0,
    env: Any = None,
    policy: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Model:
    env = env or envs(body_map.source_observation, body_map.source_action, normalised=normalised)
    kwargs = {"net_arch": net_arch[kind is SAC], **(policy or {})}
    quick = {"n_steps": 32, "batch_size": 16} if kind is PPO else {"buffer_size": 64}
    model = kind("MlpPolicy", env, policy_kwargs=kwargs, seed=seed, **(quick | settings))
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter += 0.2 * torch.randn(parameter.shape, generator=generator)
    if normalised:
        rng = np.random.default_rng(seed)
        env.obs_rms.mean = rng.normal(size=body_map.source_observation.size)
        env.obs_rms.var = rng.uniform(0.01, 4.0, size=body_map.source_observation.size)
        env.obs_rms.count = 1234.0
        env.ret_rms.var = np.asarray(7.0)
    return model


def sensed(model: Model, observation: NDArray[np.float64]) -> NDArray[np.float64]:
    normalize = model.get_vec_normalize_env()
    if normalize is None or not normalize.norm_obs:
        return observation
    rms = normalize.obs_rms
    assert isinstance(rms, RunningMeanStd)
    z = (observation - rms.mean) / np.sqrt(rms.var + normalize.epsilon)
    return np.clip(z, -normalize.clip_obs, normalize.clip_obs)


def computed(model: Model, z: NDArray[np.float64], u: NDArray[np.float64] | None = None) -> Numbers:
    dtype = next(model.policy.parameters()).dtype
    inputs = torch.as_tensor(z, dtype=dtype)
    with torch.no_grad():
        if isinstance(model, PPO):
            policy = model.policy
            mean = policy.action_net(policy.mlp_extractor.forward_actor(inputs))
            value = policy.value_net(policy.mlp_extractor.forward_critic(inputs))
            results = {"mean": mean, "log_std": policy.log_std.expand(mean.shape), "value": value}
        else:
            latent = model.actor.latent_pi(inputs)
            results = {"mean": model.actor.mu(latent), "log_std": model.actor.log_std(latent)}  # type: ignore[operator]
            both = torch.cat([inputs, torch.as_tensor(u, dtype=dtype)], dim=1)
            for name, critic in (("q", model.critic), ("target q", model.critic_target)):
                for i, network in enumerate(critic.q_networks):
                    results[f"{name} {i}"] = network(both)
    return {name: tensor.detach().double().numpy() for name, tensor in results.items()}


def expected(
    source: Model, body_map: BodyMap, observation: NDArray[np.float64], u: NDArray[np.float64]
) -> tuple[Numbers, NDArray[np.float64]]:
    """Return the source's outputs through the map, and which actions copy an action.

    `observation` and `u` are observations and actions of the target; critics evaluate `u`.
    """
    z = sensed(source, body_map.adapt_observation(observation))
    numbers = computed(source, z, back_to_source(body_map, u))
    taken = np.any(body_map.action_matrix, axis=1)
    rows = np.abs(body_map.action_matrix)
    numbers["mean"] = numbers["mean"] @ body_map.action_matrix.T
    if isinstance(source, PPO):
        numbers["mean"] += body_map.action_offset
    scales = np.log(np.where(taken, rows.sum(axis=1), 1.0))
    numbers["log_std"] = numbers["log_std"] @ (rows != 0).T + scales
    return numbers, taken


def back_to_source(body_map: BodyMap, u: NDArray[np.float64]) -> NDArray[np.float64]:
    column = {name: place.start for name, place in body_map.target_action.slices.items()}
    signed: dict[str, NDArray[np.float64]] = {}
    for entry in body_map.action:
        if isinstance(entry.rule, Copy):
            taken = entry.rule.feature
            if taken not in signed or entry.feature == taken:
                signed[taken] = u[:, column[entry.feature]] * np.sign(entry.rule.scale)
    still = np.zeros(len(u))
    return np.stack([signed.get(name, still) for name in body_map.source_action.names], axis=1)


def check_same_function(source: Model, target: Model, body_map: BodyMap, atol: float) -> None:
    """Check that both models compute the same, for all actions that are copied."""
    rng = np.random.default_rng(5)
    normalize = target.get_vec_normalize_env()
    observation = rng.normal(size=(32, body_map.target_observation.size))
    if normalize is not None and isinstance(normalize.obs_rms, RunningMeanStd):
        observation = normalize.obs_rms.mean + observation * np.sqrt(normalize.obs_rms.var)
    u = rng.uniform(-1.0, 1.0, size=(32, body_map.target_action.size))
    numbers, taken = expected(source, body_map, observation, u)
    ours = computed(target, sensed(target, observation), u)
    for name in ours.keys() - {"mean", "log_std"}:
        np.testing.assert_allclose(ours[name], numbers[name], rtol=atol, atol=atol, err_msg=name)
    for name in ("mean", "log_std"):
        np.testing.assert_allclose(
            ours[name][:, taken], numbers[name][:, taken], rtol=atol, atol=atol, err_msg=name
        )


@each_class
@each_map
@each_net
@pytest.mark.parametrize("normalised", [False, True], ids=["raw", "normalised"])
def test_the_transplanted_networks_compute_the_same(
    kind: type[Model], body_map: BodyMap, net_arch: Any, normalised: bool
) -> None:
    """Actor, value and critics agree in double precision, up to rounding."""
    source = trained(kind, body_map, net_arch, normalised=normalised)
    source.policy.double()
    env = targets(body_map, normalised=normalised)
    target = transplant(source, body_map, env, seed=1)
    assert next(target.policy.parameters()).dtype == torch.float64
    check_same_function(source, target, body_map, 1e-12)


@pytest.mark.parametrize("kind", [PPO, SAC, TQC])
def test_the_identity_changes_no_bit(kind: type[Any]) -> None:
    source = trained(kind, MAPS["identity"], normalised=True)
    env = envs(ant_observation(), ant_action(), normalised=True)
    target = transplant(source, MAPS["identity"], env)
    theirs, ours = source.policy.state_dict(), target.policy.state_dict()
    assert theirs.keys() == ours.keys()
    for name, values in theirs.items():
        assert torch.equal(values, ours[name]), name


def test_each_weight_goes_to_its_name() -> None:
    observation = Layout(tuple(Feature(name, "1") for name in ("a", "b", "c")))
    seen = Layout(tuple(Feature(name, "1") for name in ("c", "new", "a", "b")))
    body_map = BodyMap.between(
        observation,
        seen,
        Layout((motor("x"), motor("y"))),
        Layout((motor("y"), motor("z"), motor("x"))),
        rules={"b": Copy("b", -3.0)},
    )
    source = trained(PPO, body_map, ([], []))
    with torch.no_grad():
        source.policy.action_net.weight.copy_(torch.tensor([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
        source.policy.action_net.bias.copy_(torch.tensor([0.1, 0.2]))
        source.policy.value_net.weight.copy_(torch.tensor([[7.0, 8.0, 9.0]]))
    target = transplant(source, body_map, envs(seen, body_map.target_action))
    expected_weight = [[6.0, 0.0, 4.0, -15.0], [0.0] * 4, [3.0, 0.0, 1.0, -6.0]]
    np.testing.assert_array_equal(target.policy.action_net.weight.detach(), expected_weight)
    np.testing.assert_allclose(target.policy.action_net.bias.detach(), [0.2, 0.0, 0.1])
    np.testing.assert_array_equal(target.policy.value_net.weight.detach(), [[9.0, 0.0, 7.0, -24.0]])


@pytest.mark.parametrize("net_arch", [([16], [16]), ([], [])], ids=["[16]", "[]"])
@each_class
def test_learned_actions_have_fresh_weights(kind: type[Model], net_arch: Any) -> None:
    body_map = ant_map(False, True, rules={"foot_*": "learn"})
    source = trained(kind, body_map, net_arch, policy={"log_std_init": -1.5})

    def rows(seed: int) -> tuple[np.ndarray, np.ndarray]:
        env = targets(body_map)
        target = transplant(source, body_map, env, seed=seed)
        layer = target.policy.action_net if kind is PPO else target.actor.mu
        spread = target.policy.log_std if kind is PPO else target.actor.log_std.weight  # type: ignore[union-attr]
        return layer.weight[8:].detach().numpy(), spread[8:].detach().numpy()  # type: ignore[union-attr]

    first, spread = rows(1)
    assert np.all(np.any(first != 0.0, axis=1))
    np.testing.assert_array_equal(first, rows(1)[0])
    assert not np.array_equal(first, rows(2)[0])
    if kind is PPO:
        assert np.abs(first).max() < 0.02  # Orthogonal rows of length 0.01.
        np.testing.assert_array_equal(spread, -1.5)


def test_constant_actions_are_explored() -> None:
    body_map = MAPS["growth"]
    env = targets(body_map)
    places = body_map.target_action.slices
    held, still = places["foot_3/motor"].start, places["foot_1/motor"].start
    observation = np.random.default_rng(0).normal(size=(4, body_map.target_observation.size))

    ppo = trained(PPO, body_map)
    ours = computed(transplant(ppo, body_map, env), observation)
    np.testing.assert_array_equal(ours["mean"][:, held], 0.25)
    np.testing.assert_array_equal(ours["mean"][:, still], 0.0)
    theirs = ppo.policy.log_std.detach().double().numpy().mean()
    np.testing.assert_allclose(ours["log_std"][:, [held, still]], theirs, rtol=1e-6)

    sac = trained(SAC, body_map)
    ours = computed(transplant(sac, body_map, env), observation, np.zeros((4, 12)))
    np.testing.assert_allclose(np.tanh(ours["mean"][:, held]), 0.25, rtol=1e-6)
    np.testing.assert_array_equal(ours["mean"][:, still], 0.0)
    theirs = computed(sac, body_map.adapt_observation(observation), np.zeros((4, 8)))["log_std"]
    np.testing.assert_allclose(ours["log_std"][:, held], theirs.mean(axis=1), atol=1e-6)

    at_bound = ant_map(False, True, rules={"foot_*": Hold(1.0)})
    action, _ = transplant(sac, at_bound, env).predict(observation, deterministic=True)
    np.testing.assert_allclose(action[:, 8:], 1.0, atol=1e-5)


def test_ppo_scales_its_actions_and_their_spread() -> None:
    body_map = carts(pendulum_action(100.0), pendulum_action(200.0), units="torque")
    source = trained(PPO, body_map)
    target = transplant(source, body_map, targets(body_map))
    z = np.random.default_rng(0).normal(size=(8, 4))
    theirs, ours = computed(source, z), computed(target, z)
    np.testing.assert_allclose(ours["mean"], 0.5 * theirs["mean"], rtol=1e-6)
    np.testing.assert_allclose(np.exp(ours["log_std"]), 0.5 * np.exp(theirs["log_std"]), rtol=1e-6)


@pytest.mark.parametrize(("low", "high"), [(-0.5, 0.5), (-1.0, 3.0)])
def test_sac_cannot_scale_or_shift_its_actions(low: float, high: float) -> None:
    wide = Layout((Feature("slide/motor", "1", low, high, gain=100.0, gain_unit="N"),))
    body_map = carts(pendulum_action(), wide)
    with pytest.raises(TransplantError, match=r"tanh, .* 'slide/motor' the source's range"):
        transplant(trained(SAC, body_map), body_map, targets(body_map))


def test_sac_accepts_a_scale_equal_to_the_ratio_of_the_ranges() -> None:
    """A motor with half the range gets half of the source's action."""
    narrow = Layout((Feature("slide/motor", "1", -0.5, 0.5, gain=200.0, gain_unit="N"),))
    body_map = carts(pendulum_action(), narrow, units="torque")
    source = trained(SAC, body_map)
    target = transplant(source, body_map, targets(body_map))
    z = np.random.default_rng(0).normal(size=(8, 4))
    ours, _ = target.predict(z, deterministic=True)
    np.testing.assert_allclose(ours, 0.5 * source.predict(z, deterministic=True)[0], atol=1e-6)


def test_critics_use_the_equal_name_or_the_mean() -> None:
    """Critics are exact for the policy's actions; new and lost motors have no weight."""
    cart = Layout((motor("a"), motor("b"), Feature("lost/motor", "1", 0.0, 1.0)))
    copies = Layout((motor("c"), motor("d"), motor("e"), motor("b"), motor("new")))
    rules = {"[cd]/motor": "copy a/motor", "e/motor": Copy("b/motor", -1.0), "new/motor": "learn"}
    body_map = carts(cart, copies, rules=rules)
    source = trained(SAC, body_map)
    target = transplant(source, body_map, targets(body_map))
    rng = np.random.default_rng(0)
    z, u = rng.normal(size=(8, 4)), rng.uniform(-1.0, 1.0, size=(8, 5))
    # A lost motor has the action 0, here an end of its range.
    judged = np.stack([0.5 * (u[:, 0] + u[:, 1]), u[:, 3], -np.ones(8)], axis=1)
    theirs, ours = computed(source, z, judged), computed(target, z, u)
    for name in ("q 0", "q 1", "target q 0", "target q 1"):
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-5, atol=1e-5)


def test_statistics_go_with_their_names() -> None:
    """Copied numbers get the source's scaled mean and variance; new ones depend on their range."""
    body_map = BodyMap.between(
        Layout((Feature("copy", "m"), Feature("z", "m"), Feature("angle", "rad"))),
        Layout(
            (
                Feature("new", "rad", -1.0, 3.0),
                Feature("angle", "rad"),
                Feature("free", "m"),
                Feature("z", "m"),
                Feature("stuck", "m", 2.0, 2.0),
                Feature("narrow", "m", 0.0, 0.6),
            )
        ),
        pendulum_action(),
        pendulum_action(),
        rules={"copy": "copy z", "angle": Copy("angle", -2.0)},
    )
    source = RunningMeanStd(shape=(3,))
    source.mean, source.var = np.array([5.0, 1.0, 8.0]), np.array([9.0, 4.0, 16.0])
    source.count = 1000.0
    carried = transplant_normalisation(source, body_map)
    np.testing.assert_array_equal(carried.mean, [1.0, -4.0, 0.0, 1.0, 2.0, 0.3])
    np.testing.assert_allclose(carried.var, [16.0 / 12.0, 4.0, 1.0, 4.0, 1.0, 0.03])
    assert carried.count == 1000.0
    assert source.mean.tolist() == [5.0, 1.0, 8.0]


def test_a_constant_is_clipped_like_any_number() -> None:
    body_map = MAPS["shrink"]
    source = trained(PPO, body_map, normalised=True)
    source.get_vec_normalize_env().obs_rms.mean[
        body_map.source_observation.slices["foot_1/velocity"]
    ] = 100.0
    env = targets(body_map, normalised=True)
    check_same_function(source, transplant(source, body_map, env), body_map, 1e-4)


@each_class
def test_statistics_of_the_target_env_are_replaced(kind: type[Model]) -> None:
    """Clipping and return statistics move too; the source's are not changed."""
    body_map = MAPS["growth"]
    source = trained(kind, body_map, normalised=True)
    theirs = source.get_vec_normalize_env()
    theirs.clip_obs, theirs.epsilon = 5.0, 1e-3
    env = targets(body_map, normalised=True)
    target = transplant(source, body_map, env)
    assert (env.clip_obs, env.epsilon, env.ret_rms.var) == (5.0, 1e-3, 7.0)
    assert env.ret_rms is not theirs.ret_rms
    assert env.obs_rms.count == 1234.0
    check_same_function(source, target, body_map, 1e-4)


@each_class
@pytest.mark.parametrize(("given", "epsilon"), [(False, 0.5), (True, 1e-8)])
def test_statistics_can_be_folded_into_the_weights(
    kind: type[Model], given: bool, epsilon: float
) -> None:
    """If the target does not normalise, the first layer absorbs the source's statistics."""
    body_map = MAPS["mirror"]
    source = trained(kind, body_map, normalised=True)
    theirs = source.get_vec_normalize_env()
    theirs.clip_obs, theirs.epsilon = np.inf, epsilon
    source.policy.double()
    statistics = theirs.obs_rms if given else None  # Without an epsilon: SB3's default is used.
    target = transplant(source, body_map, targets(body_map), normalisation=statistics)
    check_same_function(source, target, body_map, 1e-12)


def test_statistics_can_be_named_for_a_model_without_an_env(tmp_path: Any) -> None:
    body_map = MAPS["growth"]
    source = trained(PPO, body_map, normalised=True)
    source.save(tmp_path / "model")
    loaded = PPO.load(tmp_path / "model")
    theirs = source.get_vec_normalize_env()
    for normalisation in (theirs, theirs.obs_rms):
        env = targets(body_map, normalised=True)
        target = transplant(loaded, body_map, env, normalisation=normalisation)
        check_same_function(source, target, body_map, 1e-4)


def test_only_the_target_normalises() -> None:
    """Statistics of the target alone are refused while they change, and used if they are frozen."""
    body_map = MAPS["growth"]
    source = trained(PPO, body_map)
    env = targets(body_map, normalised=True)
    with pytest.raises(TransplantError, match="statistics that keep changing"):
        transplant(source, body_map, env)
    env.training = False
    env.obs_rms.mean += 0.5
    env.obs_rms.var *= 4.0
    check_same_function(source, transplant(source, body_map, env), body_map, 1e-4)
    env.training, env.norm_obs = True, False
    assert transplant(source, body_map, env).get_vec_normalize_env() is env


def test_rewards_alone_may_be_normalised() -> None:
    """Return statistics move also where observations are not normalised."""
    body_map = MAPS["growth"]
    source = trained(PPO, body_map, normalised=True)
    source.get_vec_normalize_env().norm_obs = False
    env = targets(body_map, normalised=True)
    env.norm_obs = False
    target = transplant(source, body_map, env)
    assert env.ret_rms.var == 7.0
    check_same_function(source, target, body_map, 1e-4)
    source.get_vec_normalize_env().norm_reward = False
    env = targets(body_map, normalised=True)
    env.norm_obs = False
    transplant(source, body_map, env)
    assert env.ret_rms.var == 1.0


def test_settings_are_kept_or_changed() -> None:
    body_map = MAPS["growth"]
    env = targets(body_map)
    ppo = trained(PPO, body_map, gamma=0.9, clip_range=0.3, target_kl=0.5, learning_rate=1e-4)
    target = transplant(ppo, body_map, env, seed=3, gae_lambda=0.8)
    assert (target.gamma, target.target_kl, target.learning_rate) == (0.9, 0.5, 1e-4)
    assert target.clip_range(1.0) == 0.3  # type: ignore[operator]
    assert (target.seed, target.gae_lambda, target.n_steps) == (3, 0.8, 32)
    assert target.policy_kwargs == ppo.policy_kwargs
    assert target.policy_kwargs["net_arch"] is not ppo.policy_kwargs["net_arch"]
    short = trained(PPO, body_map, stats_window_size=7)
    assert transplant(short, body_map, env)._stats_window_size == 7

    settings = {"n_steps": 3, "replay_buffer_kwargs": {"handle_timeout_termination": False}}
    sac = trained(SAC, body_map, tau=0.1, train_freq=(2, "step"), **settings)
    moved = transplant(sac, body_map, env)
    assert moved.replay_buffer_kwargs["handle_timeout_termination"] is False
    assert transplant(sac, body_map, env, n_steps=1).replay_buffer_class is ReplayBuffer
    assert (moved.tau, moved.n_steps, moved.target_entropy) == (0.1, 3, -12.0)
    assert moved.train_freq == sac.train_freq
    assert moved.replay_buffer_class is sac.replay_buffer_class
    stubborn = trained(SAC, body_map, target_entropy=-3.0)
    assert transplant(stubborn, body_map, env).target_entropy == -3.0


def test_the_entropy_coefficient_is_moved() -> None:
    body_map = MAPS["growth"]
    env = targets(body_map)
    source = trained(SAC, body_map, ent_coef="auto_0.1")
    with torch.no_grad():
        source.log_ent_coef.fill_(-4.5)
    target = transplant(source, body_map, env)
    assert target.log_ent_coef.item() == -4.5
    assert target.log_ent_coef.requires_grad
    source = trained(SAC, body_map, ent_coef=0.2)
    assert transplant(source, body_map, env).ent_coef_tensor.item() == pytest.approx(0.2)


def test_action_noise_is_not_guessed() -> None:
    body_map = MAPS["growth"]
    env = targets(body_map)
    noise = NormalActionNoise(np.zeros(8), np.ones(8))
    source = trained(SAC, body_map, action_noise=noise)
    with pytest.raises(TransplantError, match=r"action_noise=None"):
        transplant(source, body_map, env)
    assert transplant(source, body_map, env, action_noise=None).action_noise is None


@each_class
def test_a_transplanted_model_can_be_trained(kind: type[Model]) -> None:
    """The model trains from step 0, and the source model is unchanged."""
    body_map = MAPS["growth"]
    source = trained(kind, body_map, normalised=True)
    before = {name: values.clone() for name, values in source.policy.state_dict().items()}
    env = targets(body_map, normalised=True)
    settings = {} if kind is PPO else {"learning_starts": 8, "batch_size": 8}
    target = transplant(source, body_map, env, **settings)
    start = {name: values.clone() for name, values in target.policy.state_dict().items()}
    target.learn(32)
    assert target.num_timesteps == 32
    changed = target.policy.state_dict()
    assert any(not torch.equal(values, changed[name]) for name, values in start.items())
    for name, values in source.policy.state_dict().items():
        assert torch.equal(values, before[name])


def _custom_mlp(body_map: BodyMap) -> Any:
    source = trained(PPO, body_map)
    source.policy.mlp_extractor = nn.Sequential()  # type: ignore[assignment]
    return source


@pytest.mark.parametrize(
    ("kind", "policy"),
    [
        (PPO, {"activation_fn": nn.PReLU}),
        (PPO, {"share_features_extractor": False}),
        (SAC, {"share_features_extractor": True}),
    ],
)
def test_other_settings_of_a_policy_are_moved(kind: type[Model], policy: dict[str, Any]) -> None:
    """Activations with parameters are copied, and extractors need not be shared."""
    body_map = MAPS["growth"]
    source = trained(kind, body_map, policy=policy)
    source.policy.double()
    env = targets(body_map)
    check_same_function(source, transplant(source, body_map, env), body_map, 1e-12)


class OwnPolicy(ActorCriticPolicy):
    """An unsupported policy."""


def _custom_policy(body_map: BodyMap) -> Any:
    env = envs(body_map.source_observation, body_map.source_action)
    return PPO(OwnPolicy, env, n_steps=32, batch_size=16)


class Own(FlattenExtractor):
    """An unsupported layer."""


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda ants: trained(PPO, ants, use_sde=True), r"^This policy explores with gSDE\. "),
        (lambda ants: trained(SAC, ants, use_sde=True), r"^This policy explores with gSDE\. "),
        (_custom_mlp, "has a Sequential instead of a MlpExtractor"),
        (
            lambda ants: trained(PPO, ants, policy={"features_extractor_class": Own}),
            "extracts features with Own",
        ),
        (_custom_policy, r"^This model has a OwnPolicy\. "),
        (
            lambda ants: trained(SAC, ants, policy={"features_extractor_class": Own}),
            "extracts features with Own",
        ),
        (
            lambda _: PPO("MlpPolicy", gym.make("CartPole-v1"), n_steps=32, batch_size=16),
            "has a CategoricalDistribution instead",
        ),
        (lambda body_map: nn.Linear(1, 1), "This model is Linear"),
    ],
)
def test_other_policies_are_refused(make: Callable[[BodyMap], Any], message: str) -> None:
    body_map = MAPS["identity"]
    with pytest.raises(TransplantError, match=message) as caught:
        transplant(make(body_map), body_map, targets(body_map))
    assert "Only models with the MlpPolicy of PPO, SAC or TQC" in str(caught.value)
    source = trained(PPO, body_map)
    source.policy.extra = nn.PReLU()
    with pytest.raises(TransplantError, match=r"parameters extra\.weight of this policy"):
        transplant(source, body_map, targets(body_map))


@pytest.mark.parametrize("wrong", ["source", "target"])
def test_spaces_must_be_those_of_the_map(wrong: str) -> None:
    there, stay = MAPS["growth"], MAPS["identity"]
    body_map = there if wrong == "target" else there.inverse()
    with pytest.raises(SpaceMismatch, match=f"layout of the {wrong} observation has 59"):
        transplant(trained(PPO, stay), body_map, targets(stay))
    arms = Layout((motor("a"), motor("b")))
    rules = {"a/motor": "copy slide/motor", "b/motor": "zero"}
    wider = carts(arms, arms) if wrong == "source" else carts(pendulum_action(), arms, rules=rules)
    model = trained(PPO, carts(pendulum_action(), pendulum_action()))
    with pytest.raises(SpaceMismatch, match=f"layout of the {wrong} action has 2"):
        transplant(model, wider, envs(pendulum_observation(), pendulum_action()))


def test_gaussian_outputs_by_hand() -> None:
    """Models act from -1 to 1; the map is in the units of the envs."""
    source = Layout((Feature("a", "1", 0.0, 4.0), Feature("lost", "1", -1.0, 1.0)))
    target = Layout((Feature("a", "1", -2.0, 14.0), Feature("held", "1", 0.0, 8.0)))
    rules = {"a": Copy("a", 3.0), "held": Hold(6.0)}
    body_map = carts(source, target, rules=rules)
    own = gym.spaces.Box(-1.0, 1.0, (2,))
    outputs = gaussian_outputs(body_map, own, own)
    # The source's output x is the action 2 + 2 x, and 3 (2 + 2 x) is the target's action 6 + 8 y.
    np.testing.assert_allclose(outputs.mean.matrix, [[0.75, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(outputs.mean.offset, [0.0, 0.5])
    np.testing.assert_allclose(outputs.log_std.offset, [np.log(0.75), 0.0])
    assert outputs.mean.fresh.dtype == np.bool_
    shifted = Layout((Feature("a", "1", 2.0, 10.0), target["held"]))
    moved = gaussian_outputs(carts(source, shifted, rules=rules), own, own)
    np.testing.assert_allclose(moved.mean.offset, [(3.0 * 2.0 - 6.0) / 4.0, 0.5])


def test_only_constant_numbers_are_clipped_before_the_network() -> None:
    here = Layout((Feature("above", "m"), Feature("below", "m"), Feature("copied", "m")))
    there = Layout((Feature("copied", "m"),))
    body_map = BodyMap.between(
        *(here, there, pendulum_action(), pendulum_action()), otherwise="hold"
    )
    mean, sigma = np.array([-90.0, 90.0, -90.0]), np.ones(3)
    affine = observation_affine(body_map, Scaling(mean, sigma, 10.0), Scaling.none(1))
    np.testing.assert_array_equal(affine.offset, [10.0, -10.0, 90.0])


def test_squashed_outputs_by_hand() -> None:
    """Models act in ranges of the env that are not centred at 0: copies and constants."""
    ours = (("a", 0.0, 2.0), ("b", 2.0, 6.0), ("high", 1.0, 3.0), ("low", -3.0, -1.0))
    theirs = (("a", 0.0, 2.0), ("held", 0.0, 8.0), ("b", 2.0, 6.0), ("end", 0.0, 8.0))
    source, target = (
        Layout(tuple(Feature(name, "1", low, high) for name, low, high in side))
        for side in (ours, theirs)
    )
    body_map = carts(source, target, rules={"held": Hold(6.0), "end": Hold(0.0)})
    spaces = [
        gym.spaces.Box(side.low.astype("f"), side.high.astype("f")) for side in (source, target)
    ]
    outputs = squashed_outputs(body_map, *spaces)
    np.testing.assert_array_equal(outputs.mean.matrix[[0, 2], [0, 1]], [1.0, 1.0])
    np.testing.assert_allclose(
        outputs.mean.offset, np.arctanh([0.0, 0.5, 0.0, -1.0 + 1e-6]), rtol=1e-9
    )
    matrix, still = critic_actions(body_map, outputs, spaces[0])
    np.testing.assert_array_equal(matrix.any(axis=1), [True, True, False, False])
    np.testing.assert_array_equal(still, [0.0, 0.0, -1.0, 1.0])
    shifted = Layout((*target.features[:2], Feature("b", "1", 3.0, 7.0), target["end"]))
    body_map = carts(source, shifted, otherwise="hold")
    box = gym.spaces.Box(shifted.low.astype("f"), shifted.high.astype("f"))
    with pytest.raises(TransplantError, match=r"become \+1 times the target's, shifted by -0\.5,"):
        squashed_outputs(body_map, spaces[0], box)


def test_without_torch_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.find_spec("shapechanger.transfer.transplant")
    assert spec is not None
    assert spec.loader is not None
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtra, match=r"pip install 'shapechanger\[learn\]'"):
        spec.loader.exec_module(importlib.util.module_from_spec(spec))
