"""Preparation of images for a policy, and their edges, which hardly depend on light and colour."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from shapechanger.demos.cloning.clone import prepare
from shapechanger.demos.cloning.network import DIRECTIONS, edges
from shapechanger.errors import DemosError
from shapechanger.policy import Framing

_FRAMING = Framing()


def _pictures(n: int, height: int = 120, width: int = 160) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (n, height, width, 3), np.uint8)


@pytest.mark.parametrize("scale", [1, 2])
def test_each_pixel_is_the_mean_of_its_block(scale: int) -> None:
    pictures = _pictures(3, 120 * scale, 160 * scale)
    size = 2 * scale
    blocks = pictures[:, 24 * scale :].reshape(3, 48, size, 80, size, 3).astype(np.float64)
    expected = np.floor(blocks.mean(axis=(2, 4)) + 0.5)
    np.testing.assert_array_equal(prepare(pictures, _FRAMING), expected)


@pytest.mark.parametrize("size", [(100, 160), (120, 170), (20, 40), (7, 1), (1, 1)])
def test_other_sizes_are_resized_by_area(size: tuple[int, int]) -> None:
    framing = Framing(height=6, width=9, top=0.2)
    pictures = _pictures(2, *size)
    first = min(round(0.2 * size[0]), size[0] - 1)
    fine = pictures[:, first:].astype(np.float64).repeat(6, axis=1).repeat(9, axis=2)
    rows, columns = fine.shape[1] // 6, fine.shape[2] // 9
    means = fine.reshape(2, 6, rows, 9, columns, 3).mean(axis=(2, 4))
    seen = prepare(pictures, framing)
    assert seen.shape == (2, 6, 9, 3)
    np.testing.assert_allclose(seen, means, atol=0.501)


def test_prepared_images_are_returned_unchanged() -> None:
    small = prepare(_pictures(2), _FRAMING)
    assert prepare(small, _FRAMING) is small
    assert prepare(_pictures(0), _FRAMING).shape == (0, 48, 80, 3)


@pytest.mark.parametrize(
    ("pictures", "message"),
    [
        (_pictures(1, 0, 40), r"shape \(1, 0, 40, 3\)"),
        (_pictures(1)[0], r"shape \(120, 160, 3\)"),
        (_pictures(1)[..., :1], r"shape \(1, 120, 160, 1\)"),
        (_pictures(1).astype(np.float32), "float32"),
    ],
)
def test_invalid_images_are_refused(pictures: np.ndarray, message: str) -> None:
    with pytest.raises(DemosError, match=message):
        prepare(pictures, _FRAMING)


def _bars(upright: bool) -> Tensor:
    bar = 0.3 + 0.5 * (torch.arange(32) // 4 % 2).float()
    rows = bar.expand(32, 32)
    return (rows if upright else rows.T).expand(1, 3, 32, 32).clone()


def test_each_direction_has_its_channel() -> None:
    upright, level = (edges(_bars(x), (4, 4)).mean(dim=(0, 2, 3)) for x in (True, False))
    assert int(upright.argmax()) == 0
    assert int(level.argmax()) == DIRECTIONS // 2
    assert float(upright[0]) > 5.0 * float(upright[1:].max())


def test_edges_hardly_depend_on_light_and_colour() -> None:
    before = edges(_bars(True), (4, 4))
    yellow = torch.tensor([1.0, 0.9, 0.4]).view(1, 3, 1, 1)
    for other in (0.5 * _bars(True), yellow * _bars(True)):
        torch.testing.assert_close(edges(other, (4, 4)), before, atol=0.05, rtol=0.0)
