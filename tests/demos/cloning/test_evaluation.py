"""Metrics of a policy, and its outputs: classes for few distinct actions, else regression."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shapechanger.demos.cloning.clone import targets
from shapechanger.demos.cloning.evaluation import evaluate, output_fields, tercile_classes
from shapechanger.demos.cloning.learn import best_temperature, learn
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout
from shapechanger.policy import CloneNetwork
from tests.demos.cloning.data import KEYS, QUICK, STEERS, clone_card, stripes


@pytest.fixture(scope="module")
def keys() -> CameraPolicy:
    return learn(stripes(120, 0), settings=QUICK, seed=0)[0]


def test_the_metrics_are_consistent(keys: CameraPolicy) -> None:
    """Confusion, accuracy, calibration and worst frames describe the same steps."""
    data = stripes(60, 5)
    data.actions[:5] = [0, 1, 0, 0]  # A key that was not in the training data.
    report = evaluate(keys, data)
    confusion = np.array(report.confusion)
    assert confusion.sum() == report.steps == 60
    assert np.trace(confusion) / 60 == pytest.approx(report.accuracy)
    assert sum(b.steps for b in report.calibration) == 60
    right = sum(b.accuracy * b.steps for b in report.calibration) / 60
    assert right == pytest.approx(report.accuracy)
    assert report.ece == pytest.approx(
        sum(b.steps * abs(b.confidence - b.accuracy) for b in report.calibration) / 60
    )
    assert "backward" in report.classes
    assert set(range(5)) <= set(report.worst)
    with pytest.raises(DemosError, match="no step to evaluate"):
        evaluate(keys, data.part(np.zeros(60, np.bool_)))


def test_actions_are_classed_by_the_third_of_their_range() -> None:
    actions = np.array([[-1.0, 1.0], [-0.4, 0.4], [0.2, 0.0], [0.4, -0.9]])
    names, numbers = tercile_classes(actions, STEERS, actions)
    found = [names[i] for i in numbers]
    assert found == ["left forward", "left forward", "straight still", "right back"]


class Answers:
    """A policy with given outputs for the steps in order."""

    def __init__(self, done: NDArray[np.float64]) -> None:
        self._done = done
        self.card = SimpleNamespace(require_layouts=lambda *_: None)
        self.net = SimpleNamespace(classes=())

    def outputs(self, *_: object) -> NDArray[np.float64]:
        """Return the given outputs; as `predict_many`, these are the actions of a regression."""
        return self._done

    predict_many = outputs


def scores(done: NDArray[np.float64], wanted: NDArray[np.float64], layout: Layout) -> list[float]:
    """Return the metrics of outputs without classes; larger values are better."""
    shown = stripes(len(wanted), 0, layout)
    data = dataclasses.replace(shown, actions=wanted, pictures=None)
    report = evaluate(Answers(done), data)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    return [report.accuracy, report.within, report.macro_f1, *(-np.array(report.errors))]


UNBOUNDED = Layout((Feature("left", "N·m"), Feature("right", "N·m", high=1.0)))


@settings(max_examples=50)
@given(
    seed=st.integers(0, 10_000),
    steps=st.integers(1, 12),
    layout=st.sampled_from([STEERS, UNBOUNDED]),
    absurd=st.sampled_from([-1e6, -100.0, -3.3, 3.3, 100.0, 1e6]),
    unrelated=st.booleans(),
)
def test_no_metric_gains_from_an_absurd_output(
    *, seed: int, steps: int, layout: Layout, absurd: float, unrelated: bool
) -> None:
    rng = np.random.default_rng(seed)
    wanted = rng.uniform(-1.0, 1.0, (steps, 2))
    done = rng.uniform(-1.0, 1.0, (steps, 2)) if unrelated else wanted.copy()
    before = scores(done, wanted, layout)
    for step in rng.permutation(steps):
        done = done.copy()
        done[step, rng.integers(2)] = absurd
        after = scores(done, wanted, layout)
        assert all(b <= a + 1e-12 for a, b in zip(before, after, strict=True))
        before = after


def test_regression_is_evaluated_by_errors() -> None:
    policy = learn(stripes(120, 0, STEERS), settings=QUICK, seed=0)[0]
    data = stripes(50, 6, STEERS)
    report = evaluate(policy, data)
    done = policy.predict_many(data.pictures)
    np.testing.assert_allclose(report.errors, np.abs(done - data.actions).mean(axis=0), rtol=1e-5)
    assert report.within == pytest.approx((np.abs(done - data.actions) <= 0.1).all(axis=1).mean())
    np.testing.assert_allclose(report.predicted, done, rtol=1e-6)
    assert report.ece is None


def test_the_temperature_calibrates_confidence() -> None:
    generator = torch.Generator().manual_seed(0)
    logits = torch.randn((4000, 3), generator=generator)
    drawn = torch.multinomial(logits.softmax(dim=1), 1, generator=generator)[:, 0]
    assert best_temperature(3.0 * logits, drawn) == pytest.approx(3.0, rel=0.15)
    assert best_temperature(3.0 * logits[:5], drawn[:5]) == 1.0


def _keys(text: str) -> np.ndarray:
    held = np.zeros((len(text), 4), np.float32)
    for i, letter in enumerate(text):
        if letter != "N":
            held[i, "FBRL".index(letter)] = 1.0
    return held


def _card(actions: np.ndarray, layout: Layout) -> CloneNetwork:
    return clone_card(layout, **output_fields(actions, layout, "auto")).network


def test_keys_become_classes_with_names() -> None:
    card = _card(_keys("FFFFFFFFFFLLLLLLNNNN"), KEYS)
    assert card.class_names == ("forward", "left", "none")
    assert targets(card, _keys("LFNB")).tolist() == [1, 0, 2, -1]


def test_numbers_are_scaled_by_their_range() -> None:
    layout = Layout((Feature("a", "N", 0.0, 10.0), Feature("b", "m"), Feature("c", "m")))
    actions = np.stack([np.linspace(2, 8, 50), np.linspace(-3, 5, 50), np.ones(50)], axis=1)
    card = _card(actions.astype(np.float32), layout)
    assert (card.classes, card.low, card.high[:2]) == ((), (0.0, -3.0, 1.0), (10.0, 5.0))
    np.testing.assert_allclose(targets(card, actions[:1]), [[-0.6, -1.0, -1.0]], atol=1e-6)


def test_too_many_classes_and_equal_actions_are_refused() -> None:
    rng = np.random.default_rng(0)
    many = rng.uniform(-1, 1, (200, 2)).astype(np.float32)
    with pytest.raises(DemosError, match="200 different actions, but at most 16"):
        output_fields(many, STEERS, "class")
    with pytest.raises(DemosError, match=r"All of 5 actions are equal \(left\)"):
        output_fields(_keys("LLLLL"), KEYS, "auto")
