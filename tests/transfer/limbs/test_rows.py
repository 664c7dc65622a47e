"""Observations and actions of any body as rows of a trunk and limbs."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.contract.env_ref import EnvRef, each_body
from shapechanger.errors import LayoutError, StudyError, TransplantError, UnknownName
from shapechanger.layout import Element, Feature, Layout
from shapechanger.transfer.limbs.envs import LimbEnv, LimbVecEnv, fitted, limb_envs, rows_of_each
from shapechanger.transfer.limbs.rows import require_same_columns, rows_of

ANT = EnvRef("shapechanger/Ant-v1")
# Two of these have a foot, each on another leg, and two are of one layout.
SOME: dict[str, Any] = {"bodies": {"split": "train", "count": 12}}


def _limb_env(env: EnvRef = ANT, room: int = 0) -> LimbEnv:
    return LimbEnv(env.make(), room)


@pytest.mark.parametrize(
    "env", ["Ant", "ExtendedAnt", "HalfCheetah", "Humanoid", "InvertedPendulum"]
)
def test_every_number_has_one_column(env: str) -> None:
    """Each observation has one column of one row, which is named after its part."""
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
    """Rows, rewards, ends and infos of each env equal the single env's."""
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
    """Rows of limbs that a body has not are zeros, and their actions do nothing."""
    own, roomy = _limb_env(), _limb_env(room=12)
    (few, _), (many, _) = own.reset(seed=1), roomy.reset(seed=1)
    np.testing.assert_array_equal(many[: few.size], few)
    assert not many[few.size :].any()
    action = np.linspace(-1, 1, 12, dtype=np.float32)
    np.testing.assert_array_equal(own.rows.actions(action[:8]), roomy.rows.actions(action))
    assert roomy.action_layout.names[-1] == "no limb 11: action"
    assert len(set(roomy.observation_layout.names)) == many.size


def test_bodies_by_name_or_drawn() -> None:
    """`bodies` is a list of bodies, or says how to draw them; without it the env stands alone."""
    assert each_body(ANT) == [ANT]
    listed = each_body(ANT.having({"bodies": ["Ant", "BigAnt"]}))
    assert [env.kwargs["body"] for env in listed] == ["Ant", "BigAnt"]
    assert len(each_body(ANT.having(SOME))) == 12


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(StudyError, match="a body of 12 limbs, and the policy has room for 8"):
        _limb_env(EnvRef("shapechanger/ExtendedAnt-v1"), room=8)
    with pytest.raises(StudyError, match="CartPole-v1 has no kinematic tree"):
        rows_of(gym.make("CartPole-v1"))
    with pytest.raises(StudyError, match="12 bodies need as many envs, and there are 4: give --se"):
        LimbVecEnv(ANT.having(SOME), 4)
    with pytest.raises(StudyError, match="needs at least one body"):
        each_body(ANT.having({"bodies": []}))
    with pytest.raises(
        StudyError, match=r"The bodies of shapechanger/Ant-v1 are wrong: .*`counts`"
    ):
        each_body(ANT.having({"bodies": {"counts": 3}}))
    with pytest.raises(UnknownName, match="split matches 'training'"):
        each_body(ANT.having({"bodies": {"split": "training"}}))
    with pytest.raises(StudyError, match="belongs to no family to draw from"):
        each_body(EnvRef("shapechanger/Finger-v1", {"bodies": {}}))
    with pytest.raises(StudyError, match="A reset cannot change the body behind its rows"):
        _limb_env().reset(options={"body": "BigAnt"})
    with pytest.raises(StudyError, match="These bodies sense different things"):
        rows_of_each([ANT, EnvRef("shapechanger/HalfCheetah-v1")])
    with pytest.raises(TransplantError, match="another family than shapechanger/HalfChe"):
        fitted(gym.make("shapechanger/HalfCheetah-v1"), _limb_env().observation_layout)
    require_same_columns(
        _limb_env().observation_layout,
        _limb_env(EnvRef("shapechanger/ExtendedAnt-v1")).observation_layout,
        "shapechanger/ExtendedAnt-v1",
    )


class _Strange(gym.Wrapper[Any, Any, Any, Any]):
    """Env with other layouts than its own."""

    def __init__(self, env: gym.Env[Any, Any], observation: Feature, action: Feature) -> None:
        super().__init__(env)
        self.observation_layout = Layout((observation,))
        self.action_layout = Layout((action,))


def test_strange_layouts_are_refused() -> None:
    """A number that belongs to no part of the body has no row."""
    goal = Feature("goal/x", "m", element=Element("task", "goal"))
    wing = Feature("wing/angle", "rad", element=Element("body", "wing"))
    motor = Feature("flap/motor", "1", -1.0, 1.0, Element("actuator", "flap"))
    hip = Feature("hip_1/motor", "1", -1.0, 1.0, Element("actuator", "hip_1"))
    assert rows_of(_Strange(ANT.make(), goal, hip)).columns.trunk == ("goal/x",)
    with pytest.raises(LayoutError, match="wing/angle belongs to no limb of the body"):
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
