"""One policy for bodies of any number of limbs: rows, network, learner and files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
import pytest
import torch

from shapechanger.contract.env_ref import EnvRef, each_body
from shapechanger.errors import LayoutError, StudyError, TransplantError, UnknownName
from shapechanger.layout import Element, Feature, Layout
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.export import export_limbs
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.settings import LimbSettings
from shapechanger.transfer.limbs.envs import (
    LimbEnv,
    LimbLearner,
    LimbVecEnv,
    fitted,
    limb_envs,
    rows_of_each,
)
from shapechanger.transfer.limbs.policy import LimbPolicy
from shapechanger.transfer.limbs.rows import require_same_columns, rows_of
from shapechanger.transfer.methods import basic
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.study import make_plan, run_study

ANT, EXTENDED = EnvRef("shapechanger/Ant-v1"), EnvRef("shapechanger/ExtendedAnt-v1")
# Eleven of these twelve bodies have eight limbs and one layout; the other one also has a foot.
SOME: dict[str, Any] = {"bodies": {"split": "train", "count": 12}}


def _limb_env(env: EnvRef = ANT, room: int = 0) -> LimbEnv:
    return LimbEnv(env.make(), room)


@pytest.mark.parametrize(
    "env", ["Ant", "ExtendedAnt", "HalfCheetah", "Humanoid", "InvertedPendulum"]
)
def test_every_number_has_one_column(env: str) -> None:
    """Each observation has one column of one row; columns of limbs are named after the limb."""
    with gym.make(f"shapechanger/{env}-v1") as made:
        rows = rows_of(made)
        names = rows.layouts()[0].names
        inner: Any = made.unwrapped
        assert rows.selection.sum(axis=1).tolist() == [1.0] * inner.observation_layout.size
        for feature, column in zip(
            inner.observation_layout.features, rows.selection.argmax(axis=1), strict=True
        ):
            if feature.element.kind == "joint" and feature.element.name in rows.limbs:
                quantity = feature.name.partition("/")[2]
                assert names[column] == f"{feature.element.name}: {quantity}"


def test_actions_reach_their_motors() -> None:
    """A limb's number moves its own motor, from one end of its range to the other."""
    env = _limb_env(EnvRef("shapechanger/Humanoid-v1"))
    inner: Any = env.unwrapped
    for limb in (0, 7):
        given = np.zeros(env.rows.room, np.float32)
        given[limb] = 1.0
        taken = env.rows.actions(given)
        motor = np.flatnonzero(taken).tolist()
        assert [inner.model.actuator(m).name for m in motor] == [env.rows.limbs[limb]]
        assert taken[motor[0]] == pytest.approx(0.4)
    assert env.rows.actions(-np.ones(env.rows.room)) == pytest.approx(inner.action_space.low)


def test_envs_of_many_bodies_equal_single_ones() -> None:
    """Rows, rewards, ends and speeds of each env equal the single env's."""
    envs = LimbVecEnv(ANT.having(SOME), 12)
    single = limb_envs(ANT.having(SOME), 12)
    envs.seed(5)
    rows = envs.reset()
    np.testing.assert_array_equal(rows, [one.reset(seed=5 + i)[0] for i, one in enumerate(single)])
    rng = np.random.default_rng(0)
    for _ in range(4):
        actions = rng.uniform(-1, 1, (12, 9)).astype(np.float32)
        rows, rewards, ends, infos = envs.step(actions)
        for i, one in enumerate(single):
            row, reward, terminated, _, info = one.step(actions[i])
            np.testing.assert_array_equal(rows[i], row)
            assert rewards[i] == np.float32(reward)
            assert ends[i] == terminated
            assert infos[i]["x_velocity"] == info["x_velocity"]
    assert len(envs.get_attr("family_name")) == 12
    assert [len(tree.limbs) for tree in envs.get_attr("tree")] == [
        len(cast("Any", one.unwrapped).tree.limbs) for one in single
    ]
    envs.close()


def test_room_adds_empty_rows() -> None:
    """Rows of missing limbs are zeros, and their actions have no effect."""
    own, roomy = _limb_env(), _limb_env(room=12)
    (few, _), (many, _) = own.reset(seed=1), roomy.reset(seed=1)
    np.testing.assert_array_equal(many[: few.size], few)
    assert not many[few.size :].any()
    action = np.linspace(-1, 1, 12, dtype=np.float32)
    np.testing.assert_array_equal(own.rows.actions(action[:8]), roomy.rows.actions(action))
    assert roomy.action_layout.names[-1] == "no limb 11: action"
    assert len(set(roomy.observation_layout.names)) == many.size


def test_bodies_by_name_or_drawn() -> None:
    """`bodies` lists bodies, or states how to draw them; without it there is one body."""
    assert each_body(ANT) == [ANT]
    listed = each_body(ANT.having({"bodies": ["Ant", "BigAnt"]}))
    assert [env.kwargs["body"] for env in listed] == ["Ant", "BigAnt"]
    assert len(each_body(ANT.having(SOME))) == 12


@pytest.mark.parametrize(
    ("bodies", "message"),
    [
        ([], "needs at least one body"),
        ({"counts": 3}, r"The bodies of shapechanger/Ant-v1 are wrong: .*`counts`"),
        ({"split": "training"}, "split matches 'training'"),
    ],
)
def test_wrong_bodies_are_refused(bodies: Any, message: str) -> None:
    with pytest.raises((StudyError, UnknownName), match=message):
        each_body(ANT.having({"bodies": bodies}))


def test_unsuitable_envs_are_refused() -> None:
    with pytest.raises(StudyError, match="belongs to no family to draw from"):
        each_body(EnvRef("shapechanger/Finger-v1", {"bodies": {}}))
    with pytest.raises(StudyError, match="a body of 12 limbs, and the policy has room for 8"):
        _limb_env(EXTENDED, room=8)
    with pytest.raises(StudyError, match="CartPole-v1 has no kinematic tree"):
        rows_of(gym.make("CartPole-v1"))
    with pytest.raises(StudyError, match="12 bodies need as many envs, and there are 4: give --se"):
        LimbVecEnv(ANT.having(SOME), 4)
    with pytest.raises(StudyError, match="A reset cannot change the body behind its rows"):
        _limb_env().reset(options={"body": "BigAnt"})
    with pytest.raises(StudyError, match="These bodies have different columns"):
        rows_of_each([ANT, EnvRef("shapechanger/HalfCheetah-v1")])
    with pytest.raises(TransplantError, match="another family than shapechanger/HalfChe"):
        fitted(gym.make("shapechanger/HalfCheetah-v1"), _limb_env().observation_layout)
    layouts = (_limb_env(env).observation_layout for env in (ANT, EXTENDED))
    require_same_columns(*layouts, EXTENDED.id)


class _Strange(gym.Wrapper[Any, Any, Any, Any]):
    """Env with given layouts."""

    def __init__(self, env: gym.Env[Any, Any], observation: Feature, action: Feature) -> None:
        super().__init__(env)
        self.observation_layout = Layout((observation,))
        self.action_layout = Layout((action,))


def test_strange_layouts_are_refused() -> None:
    """Numbers of a task are in the trunk's row; all others must belong to a part of the body."""
    goal = Feature("goal/x", "m", element=Element("task", "goal"))
    wing = Feature("wing/angle", "rad", element=Element("body", "wing"))
    motor = Feature("flap/motor", "1", -1.0, 1.0, Element("actuator", "flap"))
    hip = Feature("hip_1/motor", "1", -1.0, 1.0, Element("actuator", "hip_1"))
    assert rows_of(_Strange(ANT.make(), goal, hip)).columns.trunk == ("goal/x",)
    with pytest.raises(LayoutError, match="wing/angle must belong to a limb or the trunk"):
        rows_of(_Strange(ANT.make(), wing, hip))
    with pytest.raises(LayoutError, match="the action 'flap' moves no limb"):
        rows_of(_Strange(ANT.make(), goal, motor))


def test_the_last_observation_of_an_episode_is_a_row() -> None:
    envs = LimbVecEnv(EnvRef("shapechanger/HalfCheetah-v1", {"max_episode_steps": 2, **SOME}), 12)
    envs.reset()
    for _ in range(2):
        rows, _, ends, infos = envs.step(np.zeros((12, 6), np.float32))
    assert ends.all()
    assert infos[0]["terminal_observation"].shape == rows[0].shape
    assert infos[0]["TimeLimit.truncated"]
    envs.close()


FEW: Final = ANT.having({"bodies": {"count": 2}, "max_episode_steps": 20})
TINY: Final = LimbSettings(
    n_envs=2,
    n_steps=16,
    batch_size=32,
    n_epochs=1,
    learning_rate=1e-3,
    normalise=True,
    steps=64,
    source_steps=32,
    eval_every=32,
    eval_episodes=2,
)
# A policy of limbs needs no map.
_NO_MAP: Any = object()


def _learner(**changed: Any) -> LimbLearner:
    return LimbLearner("limbs", msgspec.structs.replace(TINY, **changed))


@pytest.fixture(scope="module")
def policy() -> TrainedPolicy:
    return _learner().train(FEW, 32, 0)


def _net(policy: TrainedPolicy) -> LimbPolicy:
    net = policy.model.policy
    assert isinstance(net, LimbPolicy)
    return net


def test_limbs_may_come_in_any_order_and_number(policy: TrainedPolicy) -> None:
    """Another order gives the same actions in that order; empty rows change nothing."""
    (env,) = limb_envs(ANT, 1)
    rows, _ = env.reset(seed=0)
    width = rows.size // 9
    actions = policy.act(rows[None])[0]
    order = np.random.default_rng(0).permutation(8)
    turned = rows.reshape(9, width)[[0, *(order + 1)]].ravel()
    np.testing.assert_allclose(policy.act(turned[None])[0], actions[order], atol=1e-6)
    roomy = np.concatenate([rows, np.zeros(3 * width, np.float32)])
    np.testing.assert_allclose(policy.act(roomy[None])[0, :8], actions, atol=1e-6)
    value = _net(policy).critic_net
    np.testing.assert_allclose(
        value(torch.as_tensor(rows.reshape(1, 9, width))).item(),
        value(torch.as_tensor(roomy.reshape(1, 12, width))).item(),
        atol=1e-5,
    )


def test_limbs_without_a_motor_have_no_effect_on_probabilities(policy: TrainedPolicy) -> None:
    (env,) = limb_envs(EXTENDED.having({"body": "ExtendedAntPassive"}), 1)
    rows, _ = env.reset(seed=0)
    net = _net(policy)
    observation = torch.as_tensor(rows[None])
    idle = torch.as_tensor(rows.reshape(13, -1)[1:, 1] == 0.0)
    assert idle.sum() == 4
    actions = torch.zeros(1, 12)
    _, before, entropy = net.evaluate_actions(observation, actions)
    _, other, _ = net.evaluate_actions(observation, torch.where(idle, 5.0, actions))
    assert before.item() == other.item()
    _, moved, _ = net.evaluate_actions(observation, torch.where(idle, actions, 0.5))
    assert moved.item() != before.item()
    one = 0.5 + 0.5 * np.log(2 * np.pi) + float(net.log_std.detach())
    assert entropy.item() == pytest.approx(8 * one, rel=1e-5)


def test_statistics_of_a_policy(policy: TrainedPolicy) -> None:
    """Rows are not normalised; fine-tuning continues the source's statistics of returns."""
    assert policy.normalisation is not None
    assert not policy.normalisation.observation.mean.any()
    assert (policy.normalisation.observation.var == 1.0).all()
    scale = policy.normalisation.reward
    tuned = _learner().train(FEW, 32, 1, start=policy, body_map=_NO_MAP)
    assert tuned.normalisation is not None
    # The 32 steps of the fine-tuning are added to the steps of the source.
    assert tuned.normalisation.reward.count == pytest.approx(scale.count + 32)


def test_a_padded_network_fits_its_room_only(tmp_path: Path) -> None:
    learner = _learner(network="padded", room=9, net_arch=(8,))
    trained = learner.train(FEW, 32, 0)
    save_policy(trained, tmp_path / "padded.safetensors")
    loaded = load_policy(tmp_path / "padded.safetensors")
    assert learner.evaluate(FEW, loaded, _NO_MAP) == learner.evaluate(FEW, trained, _NO_MAP)
    with pytest.raises(StudyError, match="12 limbs, and the policy has room for 9"):
        learner.evaluate(EXTENDED, loaded, _NO_MAP)
    with pytest.raises(TransplantError, match=r"padded for another number of limbs .*--set room"):
        _learner(network="padded", room=12, net_arch=(8,)).train(
            EXTENDED, 32, 0, start=loaded, body_map=_NO_MAP
        )
    with pytest.raises(StudyError, match="A padded network needs room"):
        msgspec.structs.replace(TINY, network="padded")


def test_a_generalist_is_an_arm_of_a_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(basic, "BODIES", 4)
    short = {"max_episode_steps": 20}
    task = TransferTask(ANT.having(short), EXTENDED.having(short))
    plan = make_plan(
        task,
        "limbs",
        msgspec.structs.replace(
            TINY, n_envs=4, n_steps=16, eval_every=64, steps=64, source_steps=64
        ),
        seeds=2,
        arms=("scratch", "generalist"),
    )
    trained: list[EnvRef] = []
    train = LimbLearner.train

    def recorded(self: LimbLearner, env: EnvRef, *arguments: Any, **more: Any) -> TrainedPolicy:
        trained.append(env)
        return train(self, env, *arguments, **more)

    monkeypatch.setattr(LimbLearner, "train", recorded)
    study = run_study(plan, tmp_path / "study", executor=Serial())
    many = task.source.having({"bodies": {"split": "train", "count": 4, "seed": 0}})
    assert [trained.count(env) for env in (many, task.target)] == [2, 4]
    curve = study.of("generalist")[0].curve
    assert [evaluation.steps for evaluation in curve] == [0, 64]
    assert curve[0].mean_return != study.of("scratch")[0].curve[0].mean_return


def test_onnx_of_a_body_equals_pytorch(tmp_path: Path) -> None:
    trained = _learner(network="padded", room=12, net_arch=(8, 8)).train(FEW, 32, 0)
    with EXTENDED.make() as env:
        export_limbs(trained, env, EXTENDED, tmp_path / "ant.onnx")
        exported = load_policy(tmp_path / "ant.onnx")
        assert exported.card.env == EXTENDED
        acting = fitted(env, trained.card.observation, 12)
        observation, _ = env.reset(seed=0)
        seen = observation + np.random.default_rng(0).normal(0.0, 0.5, (20, observation.size))
        expected = acting.rows.actions(trained.act(acting.rows.of(seen)))
        np.testing.assert_allclose(exported.act(seen), expected, atol=1e-5)
        assert np.ptp(expected, axis=0).max() > 1e-3  # Actions depend on observations.
