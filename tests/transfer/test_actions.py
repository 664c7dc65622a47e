"""Learners act from -1 to 1; envs, policies and exports use the units of the actuators."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import SpaceMismatch
from shapechanger.layout import Feature, Layout
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.actions import ActionScale, learners_space, require_ranges
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.export import export_onnx
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import SpacesOnly
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.vec_env import ThreadVecEnv, training_vec_env
from shapechanger.transfer.runs import learner_of
from shapechanger.transfer.transplant import transplant
from tests.envs.vector.sameness import require_same
from tests.transfer.test_learners import SHORT

_HOIST = """
<mujoco><worldbody><body name="mass">
  <joint name="lift" type="slide" axis="0 0 1" range="0 1" damping="5"/>
  <geom type="box" size=".1 .1 .1" mass="1.5"/></body></worldbody>
  <actuator>{actuator}</actuator></mujoco>
"""
# A motor of 32 N with controls in several units; factors are powers of two, so rounding is equal.
_UNITS = {
    "share": '<motor joint="lift" gear="32" ctrlrange="-1 1"/>',
    "newtons": '<motor joint="lift" gear="1" ctrlrange="-32 32"/>',
    "thousands": '<motor joint="lift" gear="1024" ctrlrange="-.03125 .03125"/>',
}
_BYTES = (
    f'<general joint="lift" ctrlrange="0 255" biastype="affine" gainprm="{64.0 / 255.0}" '
    'biasprm="-32 0 0"/>'
)
_PPO = {"n_envs": 2, "n_steps": 32, "batch_size": 16, "steps": 128, "eval_every": 64}
_Range = tuple[float, float]


def _ref(folder: Path, unit: str, actuator: str) -> EnvRef:
    file = folder / f"{unit}.xml"
    file.write_text(_HOIST.format(actuator=actuator))
    task = {"task": "tests.envs.own_robots:Hoist", "max_episode_steps": 20}
    return EnvRef("shapechanger/OwnRobot-v1", {"path": str(file), **task})


def _trained(folder: Path, name: str, unit: str, actuator: str) -> tuple[Any, list[Evaluation]]:
    changed = SHORT if name == "sac" else {**_PPO, "eval_episodes": 2, "net_arch": [8]}
    _, settings = resolve_learner(name, changed)
    curve: list[Evaluation] = []
    train = learner_of(name, settings).train
    env = _ref(folder, unit, actuator)
    return train(env, settings.steps, 0, on_evaluation=curve.append), curve


@pytest.mark.parametrize(
    ("name", "units"), [("ppo-balance", ("newtons", "thousands")), ("sac", ("newtons",))]
)
def test_the_unit_of_an_actuator_does_not_change_learning(
    tmp_path: Path, name: str, units: tuple[str, ...]
) -> None:
    policy, curve = _trained(tmp_path, name, "share", _UNITS["share"])
    assert len({evaluation.mean_return for evaluation in curve}) > 1
    for unit in units:
        other, also = _trained(tmp_path, name, unit, _UNITS[unit])
        assert also == curve
        for key, value in policy.model.policy.state_dict().items():
            assert value.equal(other.model.policy.state_dict()[key]), (unit, key)
        np.testing.assert_array_equal(other.model.action_space.high, [1.0])


@pytest.mark.parametrize("name", ["ppo-balance", "sac"])
def test_a_policy_acts_in_the_units_of_the_env(tmp_path: Path, name: str) -> None:
    """The trained policy, its file and its ONNX export give actions from 0 to 255."""
    policy, _ = _trained(tmp_path, name, "bytes", _BYTES)
    seen = np.random.default_rng(0).normal(size=(20, 2))
    expected = policy.act(seen)
    raw = policy.model.predict(seen, deterministic=True)[0]
    np.testing.assert_allclose(expected, 127.5 + 127.5 * raw, rtol=1e-6)
    save_policy(policy, tmp_path / "p.safetensors")
    loaded = load_policy(tmp_path / "p.safetensors")
    np.testing.assert_array_equal(loaded.act(seen), expected)
    assert loaded.card.action.high.tolist() == [255.0]
    export_onnx(loaded, tmp_path / "p.onnx")
    np.testing.assert_allclose(load_policy(tmp_path / "p.onnx").act(seen), expected, rtol=1e-5)


def test_a_transplant_keeps_the_units_of_the_map(tmp_path: Path) -> None:
    """PPO's means and deviations are converted from 0 to 255 of the source to ±32 of the target."""
    policy, _ = _trained(tmp_path, "ppo-balance", "bytes", _BYTES)
    source = policy.card.action
    target = Layout((msgspec.structs.replace(source.features[0], low=-32.0, high=32.0),))
    seen = policy.card.observation
    env = SpacesOnly(policy.model.observation_space, learners_space(policy.model.action_space))
    moved = transplant(policy.model, BodyMap.between(seen, seen, source, target), env)
    observations = torch.randn(20, 2)
    before, after = (
        model.policy.get_distribution(observations).distribution for model in (policy.model, moved)
    )
    expected = (127.5 + 127.5 * before.mean) / 32.0
    torch.testing.assert_close(after.mean, expected)
    torch.testing.assert_close(after.stddev, before.stddev * 127.5 / 32.0)


@given(
    bounds=st.lists(
        st.tuples(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3)).map(
            lambda pair: (pair[0], pair[0] + pair[1])
        ),
        min_size=1,
        max_size=4,
    ),
    seed=st.integers(0, 100),
)
def test_scales_are_inverse_and_stay_in_the_range(bounds: list[_Range], seed: int) -> None:
    layout = Layout(tuple(Feature(f"a{i}", "N·m", *pair) for i, pair in enumerate(bounds)))
    space = gym.spaces.Box(
        layout.low.astype(np.float32), layout.high.astype(np.float32), dtype=np.float32
    )
    require_ranges("env", space, layout)
    scale = ActionScale.between(learners_space(space), layout)
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (5, len(bounds)))
    moved = scale.to_env(actions)
    width = layout.high - layout.low
    np.testing.assert_allclose(scale.to_model(moved), actions, atol=1e-3)
    assert (moved >= space.low - 1e-6 * width).all()
    assert (moved <= space.high + 1e-6 * width).all()
    ones = np.ones(len(bounds), np.float32)
    for sign, end in ((-1.0, space.low), (1.0, space.high)):
        np.testing.assert_allclose(scale.to_env(sign * ones), end, rtol=1e-6, atol=1e-4)
    # A model that acts in the env's units is not scaled.
    assert ActionScale.between(space, layout).is_identity
    np.testing.assert_array_equal(ActionScale.between(space, layout).to_env(moved), moved)


@pytest.mark.parametrize(
    ("low", "high", "stated", "sentence"),
    [
        (-np.inf, np.inf, (-np.inf, np.inf), "'a' of env ranges from -inf to inf, and a learner"),
        (0.0, np.inf, (0.0, np.inf), "from 0 to inf"),
        (1.0, 1.0, (1.0, 1.0), "from 1 to 1"),
        (-2.0, 2.0, (-1.0, 1.0), "from -2 to 2 in its action space and from -1 to 1 in its layout"),
        (-2.0, 2.0, (-np.inf, np.inf), "from -inf to inf in its layout: make them equal"),
    ],
)
def test_actions_without_a_known_range_are_refused(
    low: float, high: float, stated: _Range, sentence: str
) -> None:
    space = gym.spaces.Box(np.float32(low), np.float32(high), (1,), np.float32)
    with pytest.raises(SpaceMismatch, match=sentence):
        require_ranges("env", space, Layout((Feature("a", "1", *stated),)))


_PENDULUM = "shapechanger/InvertedPendulum-v1"


def _pair(env_id: str, threads: int, **more: Any) -> tuple[Any, Any]:
    ours = ThreadVecEnv(env_id, 3, threads=threads, **more)
    return ours, DummyVecEnv([lambda: gym.make(env_id, **more)] * 3)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("env_id", [_PENDULUM, "shapechanger/Ant-v1", "shapechanger/Hopper-v1"])
def test_results_equal_stable_baselines3(env_id: str, threads: int) -> None:
    ours, theirs = (VecMonitor(one) for one in _pair(env_id, threads, max_episode_steps=60))
    for one in (ours, theirs):
        one.seed(5)
    require_same(ours.reset(), theirs.reset())
    require_same(ours.reset_infos, theirs.reset_infos)
    rng, ended = np.random.default_rng(0), 0
    space = ours.action_space
    for _ in range(150):
        actions = rng.uniform(space.low, space.high, (3, *space.shape)).astype(np.float32)
        (found, expected) = (one.step(actions) for one in (ours, theirs))
        for one in (found, expected):
            for info in one[3]:
                info.get("episode", {}).pop("t", None)  # Wall-clock time.
        require_same(found, expected)
        require_same(ours.reset_infos, theirs.reset_infos)
        ended += int(found[2].sum())
    assert ended >= 6
    ours.close()
    theirs.close()
    ours.close()


def test_each_env_gets_its_own_options() -> None:
    ours, theirs = _pair("shapechanger/Ant-v1", 2)
    for one in (ours, theirs):
        one.seed(1)
        one.set_options([{"body": "BigAnt"}, {}, {"body": "AmputatedAnt"}])
    require_same(ours.reset(), theirs.reset())
    require_same(ours.get_attr("body"), theirs.get_attr("body"))
    require_same(ours.reset()[1].shape, theirs.reset()[1].shape)
    ours.close()
    theirs.close()


def test_foreign_envs_use_dummy_vec_env() -> None:
    for env_id, kind in ((_PENDULUM, ThreadVecEnv), ("CartPole-v1", DummyVecEnv)):
        envs = training_vec_env(EnvRef(env_id), 2, 1)
        assert type(envs) is kind
        envs.close()
    envs = training_vec_env(EnvRef(f"shapechanger:{_PENDULUM}", {"max_episode_steps": 3}), 2, None)
    assert isinstance(envs, ThreadVecEnv)
    envs.close()
