"""Augmentation of images and its effect on their actions."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from shapechanger.demos.cloning.examples import STEERING, augmented, plain
from shapechanger.demos.cloning.pictures import CloningError
from shapechanger.demos.cloning.settings import Augmentation

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
    mirrored = torch.as_tensor(STEERING(actions.numpy()))
    wanted = torch.where(turned[:, None], mirrored, actions)
    return seen, wanted, plain(pictures, index), actions


def test_a_neutral_augmentation_changes_nothing() -> None:
    seen, wanted, before, actions = _augmented()
    torch.testing.assert_close(seen, before)
    torch.testing.assert_close(wanted, actions)


def test_a_mirrored_image_negates_the_steering() -> None:
    seen, wanted, before, actions = _augmented(mirror=1.0)
    torch.testing.assert_close(seen, before.flip(3))
    torch.testing.assert_close(wanted, actions * torch.tensor([-1.0, 1.0]))


def test_each_image_is_mirrored_with_its_action() -> None:
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


def test_colour_channels_are_scaled_separately() -> None:
    seen, _, before, _ = _augmented(colour=1.2)
    factor = (seen / before).flatten(2)
    assert float(factor.std(dim=2).max()) < 1e-5
    assert float(factor.mean(dim=2).std(dim=1).mean()) > 0.02


def test_the_share_of_blurred_and_noisy_images() -> None:
    for changes in ({"blurred": 0.25}, {"noisy": 0.25, "noise": 0.1}):
        seen, _, before, _ = _augmented(**changes)
        assert int((seen != before).any(dim=(1, 2, 3)).sum()) in (16, 17)


def test_values_stay_in_range() -> None:
    seen, _, _, _ = _augmented(gain=4.0, offset=0.5, noise=0.5, noisy=1.0, blurred=1.0)
    assert float(seen.min()) >= 0.0
    assert float(seen.max()) <= 1.0


def test_the_same_seed_gives_the_same_images() -> None:
    changes = {"mirror": 0.5, "shift": 2, "gain": 1.5, "noise": 0.1, "noisy": 0.5, "blurred": 0.5}
    assert torch.equal(_augmented(3, **changes)[0], _augmented(3, **changes)[0])
    assert not torch.equal(_augmented(3, **changes)[0], _augmented(4, **changes)[0])


@pytest.mark.parametrize(
    "wrong", [{"mirror": 1.5}, {"noisy": -0.1}, {"shift": -1}, {"noise": -1.0}, {"gain": 0.5}]
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(CloningError):
        Augmentation(**wrong)  # pyright: ignore[reportArgumentType]
