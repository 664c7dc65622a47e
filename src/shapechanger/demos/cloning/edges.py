"""Eyes that see edges: how strong, in which direction, and about where.

Few pictures of one building teach a network its colours and lamps sooner than its corners. Edges
of a logarithm know neither, and their sums over cells forgive a shift by some pixels: histograms of
oriented gradients, N. Dalal and B. Triggs, CVPR 2005.
"""

from __future__ import annotations

import math
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from shapechanger.demos.cloning.pictures import Framing

__all__ = ["DIRECTIONS", "EdgeEyes", "edges"]

DIRECTIONS: Final = 6
"""Directions of edges that are told apart, over half a turn: 30 degrees each."""

# Pixels of a cell, along each side.
_CELL: Final = 4
# Added before the logarithm, as a share of full brightness: about a camera's noise in the dark.
_DARK: Final = 8.0 / 255.0
# Keeps an even picture from being blown up: the mean strength of an edge that is noise.
_EVEN: Final = 1e-4


class EdgeEyes(nn.Module):
    """From a picture to features, by way of its edges.

    Args:
        framing: Size of the pictures.
        channels: Filters of each layer that follows the edges; each halves rows and columns.
        features: How many features.
    """

    def __init__(self, framing: Framing, channels: tuple[int, ...], features: int) -> None:
        super().__init__()
        height, width = max(framing.height // _CELL, 1), max(framing.width // _CELL, 1)
        self._cells = height, width
        layers: list[nn.Module] = []
        before = DIRECTIONS
        for after in channels:
            layers += [nn.Conv2d(before, after, 3, stride=2, padding=1), nn.ReLU()]
            height, width, before = (height + 1) // 2, (width + 1) // 2, after
        self.filters = nn.Sequential(*layers)
        self.boiled_down = nn.Linear(before * height * width, features)

    def forward(self, pictures: Tensor) -> Tensor:
        """Features, shape (n, features), of pictures in [0, 1], shape (n, 3, height, width)."""
        found = self.filters(edges(pictures, self._cells) - 1.0)
        return torch.relu(self.boiled_down(found.flatten(1)))


def edges(pictures: Tensor, cells: tuple[int, int]) -> Tensor:
    """How strong the edges of each direction are in each cell, 1 where they are as in the mean.

    Args:
        pictures: In [0, 1], shape (n, 3, height, width).
        cells: Rows and columns of cells.

    Returns:
        At least 0, shape (n, DIRECTIONS, rows, columns).
    """
    light = torch.log(pictures.mean(dim=1, keepdim=True) + _DARK)
    across = functional.pad(light[..., 2:] - light[..., :-2], (1, 1, 0, 0))
    down = functional.pad(light[..., 2:, :] - light[..., :-2, :], (0, 0, 1, 1))
    strength = torch.hypot(across, down)
    # A direction and its opposite are the same edge, seen from the other side.
    turn = torch.remainder(torch.atan2(down, across), math.pi) * (DIRECTIONS / math.pi)
    apart = (turn - torch.arange(DIRECTIONS, device=turn.device).view(1, -1, 1, 1)).abs()
    share = (1.0 - torch.minimum(apart, DIRECTIONS - apart)).clamp(min=0.0)
    pooled = functional.adaptive_avg_pool2d(strength * share, cells)
    return torch.sqrt(pooled / (pooled.mean(dim=(1, 2, 3), keepdim=True) + _EVEN))
