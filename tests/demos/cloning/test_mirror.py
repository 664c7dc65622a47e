"""Mirroring of actions and states, and layouts without a known mirror image."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.demos.cloning.examples import STEERING, mirror_of
from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.layout import Feature, Layout


def _layout(*names: str, low: float = -1.0) -> Layout:
    return Layout(tuple(Feature(name, "1", low, 1.0) for name in names))


def test_steering_is_negated_and_throttle_kept() -> None:
    assert mirror_of(_layout("steering", "throttle")) == STEERING
    turned = mirror_of(_layout("throttle", "steering"))(np.array([[0.5, -0.25]], np.float32))
    np.testing.assert_array_equal(turned, [[0.5, 0.25]])


def test_left_and_right_are_swapped() -> None:
    keys = mirror_of(_layout("forward", "backward", "right", "left", low=0.0))
    left, right = np.eye(4, dtype=np.float32)[[3]], np.eye(4, dtype=np.float32)[[2]]
    np.testing.assert_array_equal(keys(left), right)
    np.testing.assert_array_equal(keys(keys(left)), left)
    tracks = mirror_of(_layout("left", "right"))
    np.testing.assert_array_equal(tracks(np.array([[1.0, -0.5]], np.float32)), [[-0.5, 1.0]])


def test_a_state_is_mirrored_with_its_image() -> None:
    layout = Layout((Feature("speed", "m/s"), Feature("yaw_rate", "rad/s")))
    turned = mirror_of(layout)(np.array([[2.0, 0.5]], np.float32))
    np.testing.assert_array_equal(turned, [[2.0, -0.5]])


@pytest.mark.parametrize(
    ("layout", "name"),
    [
        (_layout("hip_1/angle", "throttle"), "hip_1/angle"),
        (_layout("left", "throttle"), "left"),
        (_layout("steering", low=0.0), "steering"),
        (Layout((Feature("speed", "1", shape=(3,)),)), "array speed"),
    ],
)
def test_a_layout_without_a_mirror_is_refused(layout: Layout, name: str) -> None:
    with pytest.raises(CloningError, match=f"the mirror image of .*{name}"):
        mirror_of(layout)


def test_balance_of_both_sides() -> None:
    keys = mirror_of(_layout("forward", "backward", "right", "left", low=0.0))
    forward, _, right, left = np.eye(4, dtype=np.float32)
    assert keys.balance(np.stack([left, left, forward])) == 0.0
    assert keys.balance(np.stack([left, left, right])) == 0.5
    assert keys.balance(np.stack([forward, forward])) == 1.0
    assert STEERING.balance(np.array([[-0.5, 1.0], [1.0, 1.0]], np.float32)) == 0.5
