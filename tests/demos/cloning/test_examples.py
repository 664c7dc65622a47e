"""Augmentation, mirror images, and splits of demonstrations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from shapechanger.demos.cloning.clone import Augmentation
from shapechanger.demos.cloning.examples import augmented, evaluated_steps, mirror_of, stretch
from shapechanger.demos.cloning.network import scaled
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout
from tests.demos.cloning.data import KEYS, STEERS

_NOTHING = {"mirror": 0.0, "shift": 0, "gain": 1.0, "colour": 1.0, "offset": 0.0, "noise": 0.0}
_NOTHING_ELSE = {"noisy": 0.0, "blurred": 0.0}


def _shown(n: int = 64) -> tuple[Tensor, Tensor]:
    rng = np.random.default_rng(0)
    pictures = rng.integers(40, 200, (n, 12, 20, 3), np.uint8)
    actions = rng.uniform(-1.0, 1.0, (n, 2)).astype(np.float32)
    return torch.as_tensor(pictures), torch.as_tensor(actions)


def _augmented(seed: int = 0, **changes: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    pictures, actions = _shown()
    index = torch.arange(len(pictures))
    augmentation = Augmentation(**{**_NOTHING, **_NOTHING_ELSE, **changes})  # pyright: ignore[reportArgumentType]
    generator = torch.Generator().manual_seed(seed)
    seen, turned = augmented(pictures, index, augmentation, generator)
    mirrored = torch.as_tensor(mirror_of(STEERS)(actions.numpy()))
    wanted = torch.where(turned[:, None], mirrored, actions)
    return seen, wanted, scaled(pictures), actions


def test_actions_are_mirrored_with_their_images() -> None:
    seen, wanted, before, actions = _augmented(mirror=0.5)
    turned = (seen == before.flip(3)).all(dim=(1, 2, 3))
    kept = (seen == before).all(dim=(1, 2, 3))
    assert bool((turned ^ kept).all())
    assert 16 < int(turned.sum()) < 48
    torch.testing.assert_close(wanted[:, 0], torch.where(turned, -1.0, 1.0) * actions[:, 0])


def test_a_shift_repeats_the_edge() -> None:
    seen, wanted, before, actions = _augmented(shift=2)
    moved = set[tuple[int, int]]()
    for new, old in zip(seen, before, strict=True):
        for dy in range(-2, 3):
            for dx in range(-2, 3):
                rows = (torch.arange(12) + dy).clamp(0, 11)
                columns = (torch.arange(20) + dx).clamp(0, 19)
                if torch.equal(new, old[:, rows][:, :, columns]):
                    moved.add((dy, dx))
    assert len(moved) > 15  # Of 25.
    torch.testing.assert_close(wanted, actions)


def test_the_gain_scales_whole_images() -> None:
    seen, _, before, _ = _augmented(gain=1.25)
    factor = (seen / before).flatten(1)
    assert float(factor.std(dim=1).max()) < 1e-5
    assert 0.8 - 1e-5 < float(factor.min()) < 0.85
    assert 1.2 < float(factor.max()) < 1.25 + 1e-5


def test_the_share_of_blurred_and_noisy_images() -> None:
    for changes in ({"blurred": 0.25}, {"noisy": 0.25, "noise": 0.1}):
        seen, _, before, _ = _augmented(**changes)
        assert int((seen != before).any(dim=(1, 2, 3)).sum()) in (16, 17)


def _layout(*names: str, low: float = -1.0) -> Layout:
    return Layout(tuple(Feature(name, "1", low, 1.0) for name in names))


def test_left_and_right_are_swapped() -> None:
    keys = mirror_of(KEYS)
    left, right = np.eye(4, dtype=np.float32)[[3]], np.eye(4, dtype=np.float32)[[2]]
    np.testing.assert_array_equal(keys(left), right)
    np.testing.assert_array_equal(keys(keys(left)), left)
    tracks = mirror_of(_layout("left", "right"))
    np.testing.assert_array_equal(tracks(np.array([[1.0, -0.5]], np.float32)), [[-0.5, 1.0]])


@pytest.mark.parametrize(
    ("layout", "name"),
    [
        (_layout("hip_1/angle", "throttle"), "hip_1/angle"),
        (_layout("left", "throttle"), "left"),
        (_layout("steering", low=0.0), "steering"),
        (Layout((Feature("speed", "1", shape=(3,)),)), "speed"),
    ],
)
def test_a_layout_without_a_mirror_is_refused(layout: Layout, name: str) -> None:
    with pytest.raises(DemosError, match=f"the mirror image of .*{name}"):
        mirror_of(layout)


def test_balance_of_both_sides() -> None:
    keys = mirror_of(KEYS)
    forward, _, right, left = np.eye(4, dtype=np.float32)
    assert keys.balance(np.stack([left, left, forward])) == 0.0
    assert keys.balance(np.stack([left, left, right])) == 0.5
    assert keys.balance(np.stack([forward, forward])) == 1.0
    assert mirror_of(STEERS).balance(np.array([[-0.5, 1.0], [1.0, 1.0]], np.float32)) == 0.5


@pytest.mark.parametrize(
    ("episodes", "by", "share", "held_out"),
    [
        ([6, 4], "time", 0.3, 3),
        ([6, 4], "time", 0.0, 0),
        ([6, 3, 1], "episode", 0.2, 4),  # Whole episodes, with at least the share.
        ([6, 4], "episode", 0.01, 4),  # At least one.
        ([6, 4], "episode", 0.99, 4),  # Never all.
    ],
)
def test_the_last_steps_are_held_out(
    episodes: list[int], by: Any, share: float, held_out: int
) -> None:
    expected = [False] * (10 - held_out) + [True] * held_out
    assert evaluated_steps(episodes, by, share).tolist() == expected


def test_invalid_splits_are_refused() -> None:
    with pytest.raises(DemosError, match=r"one episode only.*split by time"):
        evaluated_steps([10, 0], "episode", 0.2)
    with pytest.raises(DemosError, match=r"share must be in \[0, 1\)"):
        evaluated_steps([10], "time", 1.0)


def test_each_member_holds_out_its_own_stretch() -> None:
    masks = [stretch(100, member, 4, 0.15) for member in range(4)]
    assert [int(mask.sum()) for mask in masks] == [15] * 4
    assert sum(masks).max() == 1  # pyright: ignore[reportAttributeAccessIssue]
    assert masks[3][85:].all()
    assert all(np.ptp(np.flatnonzero(mask)) == 14 for mask in masks)
