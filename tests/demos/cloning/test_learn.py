"""Learning from images or states, with classes or regression, from scratch or from a policy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from shapechanger.demos.cloning.clone import Augmentation, CloneSettings
from shapechanger.demos.cloning.evaluation import evaluate
from shapechanger.demos.cloning.learn import Inputs, Training, learn
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.dataset import Dataset
from shapechanger.errors import DemosError, PolicyError
from shapechanger.layout import Feature, Layout
from shapechanger.policy import Framing
from tests.demos.cloning.data import KEYS, QUICK, SMALL, STEERS, corridor, error, stripes

_FEW = msgspec.structs.replace(QUICK, fewest_steps=5, most_steps=5)
_HASTY = msgspec.structs.replace(SMALL, fewest_steps=4, most_steps=4, checks=2, warm_up=1)

Cloned = tuple[CameraPolicy, Training]


@pytest.fixture(scope="module")
def keys() -> Cloned:
    return learn(stripes(200, 0), settings=QUICK, seed=3)


def _cloned(
    data: Dataset, settings: CloneSettings, start: CameraPolicy | None = None, **more: Any
) -> Cloned:
    start = CameraPolicy.fresh(settings, 0, data.action_layout) if start is None else start
    return learn(data, settings=settings, start=start, symmetric=True, **more)


@pytest.fixture(scope="module")
def driver() -> Cloned:
    return _cloned(corridor(600, 1), SMALL)


def test_a_policy_learns_which_key_is_held(keys: Cloned) -> None:
    policy, training = keys
    report = evaluate(policy, stripes(90, 1))
    assert report.accuracy > 0.9
    assert report.macro_f1 > 0.9
    assert (report.head, policy.net.members) == ("class", 2)
    assert policy.card.steps == 200
    assert "% of the images are mirrored" in training.mirror_note
    assert policy.card.settings.augmentation.mirror > 0.3  # The data steer to both sides.


@pytest.mark.parametrize("inputs", ["picture", "state", "both"])
def test_regression_from_any_input(inputs: Inputs) -> None:
    policy, _ = learn(stripes(200, 0, STEERS), settings=QUICK, inputs=inputs, seed=0)
    report = evaluate(policy, stripes(90, 1, STEERS))
    assert report.head == "regression"
    assert report.accuracy > 0.9
    assert report.errors[0] < 0.25
    assert report.errors[1] < 0.1


def test_applied_actions_are_not_inputs_and_missing_values_are_handled() -> None:
    data = stripes(100, 0, STEERS)
    assert data.states is not None
    data.states[::3, 1] = np.nan
    policy, _ = learn(data, settings=QUICK, inputs="state")
    assert policy.net.unseen == ("steering/applied",)
    other = data.states.copy()
    other[:, 2] = 0.123
    done = policy.predict_many(None, data.states)
    np.testing.assert_array_equal(done, policy.predict_many(None, other))
    for value in (np.nan, np.inf, 1e30):
        assert np.isfinite(policy.predict(None, np.full(3, value))).all()


def test_one_sided_data_are_only_mirrored_if_symmetric_is_set() -> None:
    data = stripes(200, 0)
    data.actions[data.actions[:, 2] > 0] = [1, 0, 0, 0]
    policy, training = learn(data, settings=_FEW)
    assert policy.card.settings.augmentation.mirror == 0.0
    assert "one side" in training.mirror_note
    policy, training = learn(data, settings=_FEW, symmetric=True)
    assert (policy.card.settings.augmentation.mirror, training.mirror_note) == (0.5, "")


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_layout_without_a_mirror_is_not_mirrored(symmetric: bool) -> None:
    odd = Layout(tuple(Feature(f"joint_{i}/angle", "rad", -1.0, 1.0) for i in range(4)))
    data = replace(stripes(60, 0), action_layout=odd)
    policy, training = learn(data, settings=_FEW, symmetric=symmetric)
    assert policy.card.settings.augmentation.mirror == 0.0
    assert "because the mirror image of joint_0/angle is unknown" in training.mirror_note


def test_the_same_seed_gives_the_same_policy() -> None:
    keys, drive = stripes(40, 0), corridor(40, 5)
    ways: list[Callable[[int], NDArray[np.float32]]] = [
        lambda seed: learn(keys, settings=_FEW, seed=seed)[0].outputs(keys.pictures),
        lambda seed: _cloned(drive, _HASTY, seed=seed)[0].outputs(drive.pictures),
    ]
    for outputs in ways:
        first = outputs(1)
        torch.rand(3)
        np.testing.assert_array_equal(outputs(1), first)
        assert not np.array_equal(outputs(2), first)


def test_a_policy_for_another_layout_is_refused(keys: Cloned) -> None:
    with pytest.raises(PolicyError, match=r"policy are forward \[1\].*here are steering \[1\]"):
        evaluate(keys[0], stripes(10, 0, STEERS))
    with pytest.raises(PolicyError, match=r"policy are forward \[1\].*here are steering \[1\]"):
        learn(stripes(10, 0, STEERS), settings=_FEW, start=keys[0])
    keys[0].card.require_layouts(KEYS)
    felt, _ = learn(stripes(40, 0), settings=_FEW, inputs="state")
    with pytest.raises(PolicyError, match=r"needs the state distance \[m\].*gets none"):
        felt.card.require_layouts(KEYS)
    plain = CameraPolicy.fresh(QUICK, 0, STEERS)
    assert plain.card.action is None
    plain.card.require_layouts(STEERS)
    with pytest.raises(PolicyError, match="policy are steering, throttle"):
        plain.card.require_layouts(KEYS)


def test_the_training_log_matches_the_policy(driver: Cloned) -> None:
    policy, training = driver
    assert [check.step for check in training.checks] == [0, 30, 60, 90, 120, 150]
    best = min(training.checks, key=lambda check: check.error)
    assert training.best_steps == (best.step,)
    assert policy.card.steps == 600


def test_a_start_policy_helps_with_few_images(driver: Cloned) -> None:
    few, test = corridor(30, 3, gain=0.5), corridor(200, 4, gain=0.5)
    settings = msgspec.structs.replace(SMALL, fewest_steps=40, most_steps=40)
    scratch, further = (_cloned(few, settings, start)[0] for start in (None, driver[0]))
    assert error(further, test) < 0.8 * error(scratch, test)
    assert error(further, test) < 0.8 * error(driver[0], test)


def test_rehearsal_reduces_forgetting(driver: Cloned) -> None:
    """The target steers the opposite way, and rehearsal keeps more of the source skill."""
    source, target = corridor(100, 1), corridor(60, 3, gain=-1.0)
    settings = msgspec.structs.replace(SMALL, rehearsal=0.5, fewest_steps=40, most_steps=40)
    forgets, keeps = (
        _cloned(target, settings, driver[0], rehearsal=old)[0] for old in (None, source)
    )
    old = corridor(200, 2)
    assert error(keeps, old) < 0.9 * error(forgets, old)


def test_a_start_policy_sets_the_architecture_and_is_not_changed(driver: Cloned) -> None:
    policy, few = driver[0], corridor(20, 3)
    before = policy.predict_many(few.pictures)
    # Without held-out images, the last policy is kept.
    settings = msgspec.structs.replace(_HASTY, held_out=0.0, channels=(4, 4))
    further, _ = _cloned(few, settings, policy, seed=7)
    np.testing.assert_array_equal(policy.predict_many(few.pictures), before)
    assert not np.array_equal(further.predict_many(few.pictures), before)
    assert (policy.net.seeds, further.net.seeds) == ((0,), (0, 7))
    assert further.net.channels == SMALL.channels


def test_one_image_is_enough() -> None:
    one = corridor(1, 0)
    policy, training = _cloned(one, _HASTY)
    assert (training.best_steps, policy.card.steps) == ((4,), 1)
    assert all(math.isnan(check.error) for check in training.checks)
    assert np.isfinite(policy.predict_many(one.pictures)).all()


def test_invalid_data_are_refused() -> None:
    data = stripes(20, 0)
    with pytest.raises(DemosError, match="no step to learn from"):
        learn(data.part(np.zeros(20, np.bool_)), settings=QUICK)
    with pytest.raises(DemosError, match="no images"):
        learn(replace(data, pictures=None), settings=QUICK, inputs="picture")
    with pytest.raises(DemosError, match="no state"):
        learn(replace(data, states=None, state_layout=None), settings=QUICK, inputs="both")
    data.actions[3, 0] = np.nan
    with pytest.raises(DemosError, match=r"Action 3 must be finite, got \[nan"):
        learn(data, settings=QUICK)
    few = corridor(4, 0)
    few.actions[2] = [0.0, 1.5]
    with pytest.raises(DemosError, match=r"action 2 is \[0.0, 1.5\]"):
        _cloned(few, _HASTY)
    with pytest.raises(DemosError, match="needs an image"):
        _cloned(replace(corridor(4, 0), pictures=None), _HASTY)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (CloneSettings, {"channels": (), "batch": 0, "most_steps": 10, "learning_rate": 0.0}),
        (CloneSettings, {"held_out": 1.0, "weight_decay": -1.0}),
        (Augmentation, {"mirror": 1.5, "noisy": -0.1, "shift": -1, "noise": -1.0, "gain": 0.5}),
        (Framing, {"height": 0, "width": -1, "top": 1.0}),
        (Framing, {"top": float("nan")}),
    ],
)
def test_invalid_settings_are_refused(kind: Any, wrong: dict[str, float]) -> None:
    for name, value in wrong.items():
        with pytest.raises((DemosError, PolicyError)):
            kind(**{name: value})
