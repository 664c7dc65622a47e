"""Outputs: classes for few distinct actions, regression otherwise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.demos.cloning.card import CloneCard, class_numbers
from shapechanger.demos.cloning.evaluation import AskedHead, output_fields
from shapechanger.demos.cloning.pictures import CloningError, Framing
from shapechanger.layout import Feature, Layout
from tests.demos.cloning.data import KEYS, STEERS


def _keys(text: str) -> np.ndarray:
    held = np.zeros((len(text), 4), np.float32)
    for i, letter in enumerate(text):
        if letter != "N":
            held[i, "FBRL".index(letter)] = 1.0
    return held


def _card(
    actions: np.ndarray, layout: Layout, asked: AskedHead, mirrored: np.ndarray | None = None
) -> CloneCard:
    fields = output_fields(actions, layout, asked, mirrored)
    return CloneCard(framing=Framing(), channels=(8,), features=8, action_layout=layout, **fields)


def test_keys_become_classes_with_names() -> None:
    card = _card(_keys("FFFFFFFFFFLLLLLLNNNN"), KEYS, "auto")
    assert (card.head, card.class_names) == ("class", ("forward", "left", "none"))
    assert card.targets(_keys("LFNB")).tolist() == [1, 0, 2, -1]


def test_mirrored_actions_are_classes_too() -> None:
    actions = _keys("FFFFFFFFLLLLLLLL")
    card = _card(actions, KEYS, "class", actions[:, [0, 1, 3, 2]])
    assert set(card.class_names) == {"forward", "left", "right"}


def test_numbers_are_scaled_by_their_layout() -> None:
    layout = Layout((Feature("a", "N", 0.0, 10.0), Feature("b", "m"), Feature("c", "m")))
    actions = np.stack([np.linspace(2, 8, 50), np.linspace(-3, 5, 50), np.ones(50)], axis=1)
    card = _card(actions.astype(np.float32), layout, "auto")
    assert (card.head, card.low, card.high[:2]) == ("regression", (0.0, -3.0, 1.0), (10.0, 5.0))
    np.testing.assert_allclose(card.targets(actions[:1]), [[-0.6, -1.0, -1.0]], atol=1e-6)


def test_many_distinct_actions_give_regression() -> None:
    rng = np.random.default_rng(0)
    card = _card(rng.uniform(-1, 1, (10, 2)).astype(np.float32), STEERS, "auto")
    assert card.head == "regression"


def test_unsuitable_classes_are_refused() -> None:
    rng = np.random.default_rng(0)
    many = rng.uniform(-1, 1, (200, 2)).astype(np.float32)
    with pytest.raises(CloningError, match="200 different actions, but at most 16"):
        output_fields(many, STEERS, "class")
    with pytest.raises(CloningError, match=r"All of 5 actions are equal \(left\)"):
        output_fields(_keys("LLLLL"), KEYS, "auto")


def test_an_action_outside_the_classes() -> None:
    classes = ((0.0, 1.0), (1.0, 0.0))
    actions = np.array([[1.0 + 1e-6, 0.0], [0.5, 0.5], [math.nan, 0.0]])
    assert class_numbers(actions, classes).tolist() == [1, -1, -1]
