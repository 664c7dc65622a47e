"""Start poses and terminations derived from the body."""

from __future__ import annotations

import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.contract.testing import examine
from shapechanger.errors import MorphologyError
from shapechanger.morphology import Edit, Gear, Lock, Remove, Split, StartHeight, Stretch
from shapechanger.morphology.pose import StartRules, trunk_lift

_HEALTHY = ("Hopper", "Walker2d", "Humanoid")
_LEGS = {"HalfCheetah": "?shin", "Hopper": "leg", "Walker2d": "leg*", "Humanoid": "*_shin"}
_POLES = "shapechanger/InvertedDoublePendulum-v1"


def _made(name: str, **arguments: Any) -> Any:
    with gym.make(f"shapechanger/{name}-v1", **arguments) as env:
        return env.unwrapped


@pytest.mark.parametrize("name", _HEALTHY)
def test_healthy_ranges_equal_gymnasiums(name: str) -> None:
    """Bodies of the original shape have Gymnasium's numbers."""
    with gym.make(f"{name}-v5") as env:
        theirs = env.unwrapped._healthy_z_range
    for body in (name, Gear("*", 2.0)):
        assert _made(name, body=body).healthy_z_range == theirs


@pytest.mark.parametrize("name", _HEALTHY)
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_healthy_heights_scale_with_the_body(name: str, factor: float) -> None:
    """Healthy heights are proportional to the standing height, also after a reset."""
    plain, legs = _made(name), Stretch(_LEGS[name], factor)
    tall = _made(name, body=legs)
    growth = tall.standing_height / plain.standing_height
    assert (growth > 1.0) == (factor > 1.0)
    assert tall.healthy_z_range == pytest.approx([growth * z for z in plain.healthy_z_range])
    plain.reset(seed=0, options={"body": legs})
    assert plain.healthy_z_range == tall.healthy_z_range
    assert plain.is_healthy


@pytest.mark.parametrize("name", _HEALTHY)
def test_an_explicit_range_takes_precedence(name: str) -> None:
    """A given range is kept for any body and in copies; None derives it."""
    env = _made(name, body=Stretch(_LEGS[name], 2.0), healthy_z_range=(0.1, 9.0))
    for one in (env, pickle.loads(pickle.dumps(env))):
        assert one.healthy_z_range == (0.1, 9.0)
    assert _made(name, healthy_z_range=None).healthy_z_range == _made(name).healthy_z_range


@pytest.mark.parametrize("name", _LEGS)
def test_long_legs_start_above_the_floor(name: str) -> None:
    """The trunk is raised so that no foot starts in the floor, with noise too."""
    env = _made(name, body=Stretch(_LEGS[name], 2.0))
    lift = trunk_lift(env.model)
    assert lift is not None
    assert lift.height(env.init_qpos) == pytest.approx(env.standing_height)
    for seed in range(5):
        env.reset(seed=seed)
        assert StartRules(env.model).floor_gap(env.data) > -1e-9


@pytest.mark.parametrize("height_m", [0.5, 2.0])
def test_the_range_is_relative_to_the_joints_zero(height_m: float) -> None:
    """The healthy height does not depend on the start height of the model."""
    env = _made("Hopper", body=StartHeight("torso", height_m))
    lift = trunk_lift(env.model)
    assert lift is not None
    pose = env.init_qpos.copy()
    pose[lift.place] = env.healthy_z_range[0]
    assert lift.height(pose) == pytest.approx(0.7)
    assert env.standing_height == pytest.approx(1.21)
    env.reset(seed=0)
    assert env.is_healthy


@pytest.mark.parametrize(("factor", "rail_m"), [(0.5, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)])
def test_pole_rewards_are_relative_to_the_length(factor: float, rail_m: float) -> None:
    """Heights are relative to the first hinge, whatever the height of the rail."""
    body = (Stretch("pole*", factor), StartHeight("cart", rail_m))
    with gym.make(_POLES, body=body if rail_m else body[0]) as made:
        env: Any = made.unwrapped
        made.reset(seed=0)
        for part, fallen in ((1.01, False), (0.99, True)):
            # Both poles lean equally; on the original model the tip is at about 1 m.
            lean = math.acos(part / 1.2)
            env.set_state(np.array([0.0, lean, 0.0]), np.zeros(3))
            y = env.data.site_xpos[0, 2]
            assert y == pytest.approx(factor * part + rail_m)
            reward, terms = env._get_rew(0.0, y, not fallen)
            assert terms["distance_penalty"] == pytest.approx(-((part - 2.0) ** 2))
            assert terms["reward_survive"] == (0.0 if fallen else 10.0)
            assert reward == pytest.approx(sum(terms.values()))
        env.set_state(np.array([0.0, 1.0, 0.0]), np.zeros(3))
        assert made.step(np.zeros(1, np.float32))[2]
        made.reset(seed=0)
        assert not made.step(np.zeros(1, np.float32))[2]


_ROOT = "must be slide, slide, hinge; here they are slide"
_CART = "needs a cart on a slide and a pole on a hinge"
_BOTH = "two poles on hinges and a tip above them"


@pytest.mark.parametrize(
    ("name", "body", "sentence"),
    [
        *(("Hopper", Lock("rooty"), _ROOT), ("HalfCheetah", Lock("rooty"), _ROOT)),
        *(("InvertedDoublePendulum", edit, _BOTH) for edit in (Lock("hinge2"), Remove("pole2"))),
        *(("InvertedPendulum", edit, _CART) for edit in (Lock("hinge"), Remove("pole"))),
        ("InvertedPendulum", Lock("slider"), _CART),
    ],
)
def test_bodies_without_what_the_task_reads_are_refused(
    name: str, body: Edit, sentence: str
) -> None:
    """Bodies without root joints, cart or poles are refused at `make` and at `reset`."""
    with pytest.raises(MorphologyError, match=sentence):
        _made(name, body=body)
    env = _made(name)
    env.reset(seed=0)
    with pytest.raises(MorphologyError, match=sentence):
        env.reset(options={"body": body})
    env.step(np.zeros(env.action_space.shape, np.float32))


def test_a_split_pole_has_two_hinges() -> None:
    """Both hinges are observed, and the env keeps all promises of the exam."""
    body = Split("pole", "upper_pole")
    env = gym.make("shapechanger/InvertedPendulum-v1", body=body)
    assert env.observation_space.shape == (6,)
    observation, _ = env.reset(seed=0)
    assert observation.shape == (6,)
    names = env.get_wrapper_attr("observation_layout").names
    assert names[:3] == ("slider/position", "hinge/angle", "upper_pole/angle")
    assert np.isfinite(observation).all()
    assert len(list(examine(lambda: gym.make("shapechanger/InvertedPendulum-v1", body=body)))) == 7
