"""Learning from images or states, with classes or regression."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
import torch

from shapechanger.demos.cloning.evaluation import evaluate
from shapechanger.demos.cloning.learn import Inputs, Training, learn
from shapechanger.demos.cloning.pictures import CloningError, PolicyError
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.layout import Feature, Layout
from tests.demos.cloning.data import KEYS, QUICK, STEERS, stripes


@pytest.fixture(scope="module")
def keys() -> tuple[CameraPolicy, Training]:
    """A policy that learned which key is held."""
    return learn(stripes(200, 0), settings=QUICK, seed=3)


def test_it_learns_which_key_is_held(keys: tuple[CameraPolicy, Training]) -> None:
    policy, training = keys
    report = evaluate(policy, stripes(90, 1))
    assert report.accuracy > 0.9
    assert report.macro_f1 > 0.9
    assert (policy.card.head, policy.card.members) == ("class", 2)
    assert training.learned == 200
    assert training.mirrored > 0.3  # The data go to both sides.


def test_actions_follow_the_layout(keys: tuple[CameraPolicy, Training]) -> None:
    done = keys[0].predict_many(stripes(30, 2).pictures)
    assert done.shape == (30, 4)
    assert set(map(tuple, done.tolist())) <= set(keys[0].card.classes)
    probabilities = keys[0].outputs(stripes(30, 2).pictures)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize("inputs", ["picture", "state", "both"])
def test_regression_from_any_input(inputs: Inputs) -> None:
    policy, _ = learn(stripes(200, 0, STEERS), settings=QUICK, inputs=inputs, seed=0)
    report = evaluate(policy, stripes(90, 1, STEERS))
    assert report.head == "regression"
    assert report.accuracy > 0.9
    assert report.errors[0] < 0.25
    assert report.errors[1] < 0.1


def test_applied_actions_are_not_inputs() -> None:
    policy, _ = learn(stripes(100, 0, STEERS), settings=QUICK, inputs="state")
    assert policy.card.unseen == ("steering/applied",)
    states = stripes(10, 1, STEERS).states
    assert states is not None
    other = states.copy()
    other[:, 2] = 0.123
    np.testing.assert_array_equal(
        policy.predict_many(None, states), policy.predict_many(None, other)
    )


def test_missing_state_values_are_handled() -> None:
    data = stripes(100, 0, STEERS)
    assert data.states is not None
    data.states[::3, 1] = np.nan
    policy, _ = learn(data, settings=QUICK, inputs="state")
    for value in (np.nan, np.inf, 1e30):
        assert np.isfinite(policy.predict(None, np.full(3, value))).all()


def test_one_sided_data_are_not_mirrored() -> None:
    data = stripes(200, 0)
    to_the_right = data.actions[:, 2] > 0
    data.actions[to_the_right] = [1, 0, 0, 0]
    _, training = learn(data, settings=msgspec.structs.replace(QUICK, fewest_steps=2, most_steps=2))
    assert training.mirrored == 0.0
    assert "one side" in training.mirror_note


def test_a_layout_without_a_mirror_is_not_mirrored() -> None:
    odd = Layout(tuple(Feature(f"joint_{i}/angle", "rad", -1.0, 1.0) for i in range(4)))
    data = replace(stripes(60, 0), action_layout=odd)
    _, training = learn(data, settings=msgspec.structs.replace(QUICK, fewest_steps=2, most_steps=2))
    assert training.mirrored == 0.0
    assert training.mirror_note == (
        "No image is mirrored, because the mirror image of joint_0/angle is unknown."
    )


def test_the_same_seed_gives_the_same_policy() -> None:
    few = msgspec.structs.replace(QUICK, fewest_steps=5, most_steps=5)
    data, test = stripes(40, 0), stripes(10, 1).pictures

    def outputs(seed: int) -> np.ndarray:
        return learn(data, settings=few, seed=seed)[0].outputs(test)

    first = outputs(1)
    torch.rand(3)
    np.testing.assert_array_equal(outputs(1), first)
    assert not np.array_equal(outputs(2), first)


def test_held_out_steps_are_not_learned_from() -> None:
    few = msgspec.structs.replace(QUICK, fewest_steps=5, most_steps=5)
    data = stripes(60, 0)
    learned = np.arange(60) < 40
    first, _ = learn(data, learned, settings=few)
    assert data.pictures is not None
    data.pictures[40:] = 255
    data.actions[40:] = [0, 1, 0, 0]
    again, _ = learn(data, learned, settings=few)
    test = stripes(10, 1).pictures
    np.testing.assert_array_equal(first.outputs(test), again.outputs(test))


def test_a_policy_for_another_layout_is_refused(keys: tuple[CameraPolicy, Training]) -> None:
    with pytest.raises(PolicyError, match=r"policy are forward \[1\].*here are steering \[1\]"):
        evaluate(keys[0], stripes(10, 0, STEERS))
    keys[0].card.require_layouts(KEYS)
    felt, _ = learn(
        stripes(40, 0),
        settings=msgspec.structs.replace(QUICK, fewest_steps=1, most_steps=1),
        inputs="state",
    )
    with pytest.raises(PolicyError, match=r"needs the state distance \[m\].*gets none"):
        felt.card.require_layouts(KEYS)


def test_a_policy_without_layouts_needs_steering_and_throttle() -> None:
    policy = CameraPolicy.fresh(QUICK, 0)
    policy.card.require_layouts(STEERS)
    with pytest.raises(PolicyError, match="policy are steering, throttle"):
        policy.card.require_layouts(KEYS)


def test_invalid_data_are_refused() -> None:
    data = stripes(20, 0)
    with pytest.raises(CloningError, match="no step to learn from"):
        learn(data, np.zeros(20, np.bool_), settings=QUICK)
    with pytest.raises(CloningError, match="no images"):
        learn(replace(data, pictures=None), settings=QUICK, inputs="picture")
    with pytest.raises(CloningError, match="no state"):
        learn(replace(data, states=None, state_layout=None), settings=QUICK, inputs="both")
    data.actions[3, 0] = np.nan
    with pytest.raises(CloningError, match=r"Action 3 must be finite, got \[nan"):
        learn(data, settings=QUICK)
