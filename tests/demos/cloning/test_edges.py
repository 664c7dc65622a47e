"""Edge features: invariant to light and colour, tolerant to small shifts."""

from __future__ import annotations

import torch
from torch import Tensor

from shapechanger.demos.cloning.network import DIRECTIONS, Eyes, edges
from shapechanger.demos.cloning.pictures import Framing


def _bars(upright: bool) -> Tensor:
    """Return bars of four pixels, shape (1, 3, 32, 32)."""
    bar = 0.3 + 0.5 * (torch.arange(32) // 4 % 2).float()
    rows = bar.expand(32, 32)
    return (rows if upright else rows.T).expand(1, 3, 32, 32).clone()


def test_each_direction_has_its_channel() -> None:
    upright, level = (edges(_bars(x), (4, 4)).mean(dim=(0, 2, 3)) for x in (True, False))
    assert int(upright.argmax()) == 0
    assert int(level.argmax()) == DIRECTIONS // 2
    assert float(upright[0]) > 5.0 * float(upright[1:].max())


def test_neither_light_nor_colour_matters() -> None:
    before = edges(_bars(True), (4, 4))
    yellow = torch.tensor([1.0, 0.9, 0.4]).view(1, 3, 1, 1)
    for other in (0.5 * _bars(True), yellow * _bars(True)):
        torch.testing.assert_close(edges(other, (4, 4)), before, atol=0.05, rtol=0.0)


def test_a_black_image_has_no_edges() -> None:
    assert float(edges(torch.zeros(1, 3, 32, 32), (4, 4)).max()) == 0.0


def test_images_of_any_size_have_features() -> None:
    for height, width in ((48, 64), (30, 41), (3, 5)):
        eyes = Eyes(Framing(height=height, width=width, top=0.0), (8, 8), 5, by_edges=True)
        found = eyes(torch.rand(2, 3, height, width))
        assert found.shape == (2, 5)
        assert bool((found >= 0.0).all())
